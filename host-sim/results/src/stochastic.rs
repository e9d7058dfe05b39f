//! The stochastic extension of the models of a diagnosis, and how its verdict differs.
//!
//! It belongs to the feature `stochastic`. Without it, `diagnosis.json` has no key `stochastic_extension`, and its page no such
//! section.

use friction_diagnose::Diagnosis;
use serde_json::Value;
#[cfg(feature = "stochastic")]
use {
    compensator_core::ParameterId,
    friction_fit::{Outcome, State},
    stochastic_extension::{Certificate, Settings, certify, reading},
};

/// Certificates of both models of a diagnosis; without the feature, none.
#[derive(Clone, Debug)]
pub struct StochasticExtension {
    /// Of the base model.
    #[cfg(feature = "stochastic")]
    pub before: Certificate,
    /// Of the extended model; that of the base model if it was not extended.
    #[cfg(feature = "stochastic")]
    pub after: Certificate,
    /// How the paper's verdict differs from that of the diagnosis, and why.
    #[cfg(feature = "stochastic")]
    pub reading: String,
}

#[cfg(feature = "stochastic")]
impl StochasticExtension {
    /// Certifies both models of a diagnosis on its training runs. `seed` is that of the diagnosis.
    pub fn new(found: &Diagnosis, seed: u64, progress: &dyn Fn(&str)) -> Self {
        progress("certifying");
        let Diagnosis { log, baseline, extended, findings, .. } = found;
        let settings = Settings { seed, joint: log.train.joint, ..Settings::default() };
        let certify = |outcome: &Outcome| {
            let fitted = outcome.estimates.iter().filter(|e| e.std_error.is_some());
            let free: Vec<ParameterId> = fitted.map(|e| e.id).collect();
            certify(&outcome.parameters, &free, &log.train_tracks, &settings)
        };
        let before = certify(baseline);
        let after = if extended.spec == baseline.spec { before.clone() } else { certify(extended) };
        let loose = baseline.estimates.iter().filter(|e| e.state != State::Determined);
        let loose: Vec<ParameterId> = loose.map(|e| e.id).collect();
        let causes = findings.iter().map(|finding| (finding.cause.name(), finding.cause.acts_on()));
        let reading = reading(&before, &loose, &causes.collect::<Vec<_>>());
        Self { before, after, reading }
    }

    /// Returns the value of `stochastic_extension` in `diagnosis.json`.
    pub(crate) fn json(&self) -> Value {
        let (before, after) = (self.before.json(), self.after.json());
        serde_json::json!({ "before": before, "after": after, "reading": self.reading })
    }
}

#[cfg(not(feature = "stochastic"))]
impl StochasticExtension {
    /// Certifies nothing.
    pub fn new(_: &Diagnosis, _: u64, _: &dyn Fn(&str)) -> Self {
        Self {}
    }

    /// Returns null.
    pub(crate) fn json(&self) -> Value {
        Value::Null
    }
}
