//! The stochastic extension of the models of a diagnosis.
//!
//! It belongs to the feature `stochastic`. Without it, `diagnosis.json` has no key `stochastic_extension`, and its page no such
//! section.

use friction_diagnose::Diagnosis;
use serde_json::Value;
#[cfg(feature = "stochastic")]
use stochastic_extension::{ModelCertificates, Settings};

/// Certificates of both models of a diagnosis.
#[derive(Clone, Debug)]
pub struct StochasticExtension {
    #[cfg(feature = "stochastic")]
    pub(crate) certificates: ModelCertificates,
}

impl StochasticExtension {
    /// Certifies both models of a diagnosis on its training runs. `seed` is that of the diagnosis.
    #[cfg(feature = "stochastic")]
    pub fn new(found: &Diagnosis, seed: u64, progress: &dyn Fn(&str)) -> Self {
        progress("certifying");
        let causes: Vec<_> = found
            .findings
            .iter()
            .map(|finding| (finding.cause.name(), finding.cause.acts_on()))
            .collect();
        let settings = Settings { seed, joint: found.log.train.joint, ..Settings::default() };
        let (baseline, extended) = (&found.baseline, &found.extended);
        let tracks = &found.log.train_tracks;
        let certificates = ModelCertificates::new(baseline, extended, tracks, &causes, &settings);
        Self { certificates }
    }

    /// Certifies nothing, without the feature `stochastic`.
    #[cfg(not(feature = "stochastic"))]
    pub fn new(_: &Diagnosis, _: u64, _: &dyn Fn(&str)) -> Self {
        Self {}
    }

    /// Returns the value of `stochastic_extension` in `diagnosis.json`; `None` without the feature.
    pub(crate) fn json(&self) -> Option<Value> {
        #[cfg(feature = "stochastic")]
        return Some(self.certificates.json());
        #[cfg(not(feature = "stochastic"))]
        None
    }
}
