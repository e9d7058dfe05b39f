//! A log with its diagnosis: the input of the documents and pages of a diagnosis.

use crate::stochastic::StochasticExtension;
use friction_diagnose::Diagnosis;
use friction_diagnose::prepare::Prepared;

/// A diagnosis with what its result files need.
#[derive(Clone, Copy)]
pub struct DiagnosedLog<'a> {
    /// The diagnosis.
    pub found: &'a Diagnosis,
    /// Its stochastic extension.
    pub stochastic: &'a StochasticExtension,
    /// The log.
    pub input: &'a Prepared,
}
