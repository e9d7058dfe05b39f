//! Certificates of a base model and of its extension, with the paper's verdict beside that of a diagnosis.

use super::certificate::Certificate;
use super::settings::Settings;
use super::{certify, reading};
use compensator_core::ParameterId;
use friction_fit::{Outcome, State, Track};
use serde_json::{Value, json};

/// Certificates of both models of a diagnosis.
#[derive(Clone, Debug)]
pub struct ModelCertificates {
    /// Of the base model.
    pub before: Certificate,
    /// Of the extended model; that of the base model if it was not extended.
    pub after: Certificate,
    /// How the paper's verdict differs from that of the diagnosis, and why.
    pub reading: String,
}

impl ModelCertificates {
    /// Certifies the base model and the extended model on the runs that they were fitted to.
    ///
    /// `causes` are those of the diagnosis, strongest first, each with the parameters that it acts through.
    pub fn new(
        baseline: &Outcome,
        extended: &Outcome,
        tracks: &[Track],
        causes: &[(&str, &[ParameterId])],
        settings: &Settings,
    ) -> Self {
        let of = |outcome: &Outcome| {
            let fitted = outcome.estimates.iter().filter(|e| e.std_error.is_some());
            let free: Vec<ParameterId> = fitted.map(|e| e.id).collect();
            certify(&outcome.parameters, &free, tracks, settings)
        };
        let before = of(baseline);
        let after = if extended.spec == baseline.spec { before.clone() } else { of(extended) };
        let loose = baseline.estimates.iter().filter(|e| e.state != State::Determined);
        let loose: Vec<ParameterId> = loose.map(|e| e.id).collect();
        let reading = reading(&before, &loose, causes);
        Self { before, after, reading }
    }

    /// Returns the certificates as in `diagnosis.json`.
    pub fn json(&self) -> Value {
        json!({
            "before": self.before.json(),
            "after": self.after.json(),
            "reading": self.reading,
        })
    }
}
