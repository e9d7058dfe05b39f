//! Calibration of the rule of the stochastic extension with a reference without missing physics.
//!
//! A permitted spread is large for two reasons: the data vary, or the output hardly depends on the parameter. The second
//! reason does not indicate missing physics, but usually dominates. A reference certificate, computed for the fitted
//! model's own torque with the sensor's noise on the same inputs, contains only the second reason. The ratio of both
//! certificates contains only the first. By the *calibrated* rule, the parameter with the largest ratio is to be
//! improved, and none if no ratio is significant.

use compensator_core::{ParameterId, Parameters};
use friction_fit::Track;
use stochastic_extension::certificate::is_unlimited;
use stochastic_extension::study::{CertificateStudy, ResidualSource};
use stochastic_extension::{Certificate, Settings};

/// Ratio above which a parameter is significant: simulated joints without missing physics rarely exceed it
/// (`docs/src/explanation/stochastic-extension.md`).
pub const SIGNIFICANT_RATIO: f64 = 1.15;

/// Result of the calibrated rule.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// Permitted spread divided by that of the reference: geometric mean over the classes in which the reference determines
    /// the parameter. A parameter that no class determines has no ratio.
    pub ratios: Vec<(ParameterId, f64)>,
    /// The parameter with the largest ratio, if that is more than [`SIGNIFICANT_RATIO`].
    pub verdict: Option<ParameterId>,
    /// The reference certificate.
    pub nothing_hidden: Certificate,
}

/// Computes a certificate and the result of the calibrated rule.
pub fn certify_calibrated(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    settings: &Settings,
) -> (Certificate, Calibrated) {
    let begin = friction_fit::clock::Instant::now();
    let study = CertificateStudy::new(parameters, free, tracks, settings);
    let mut certificate = study.certify(ResidualSource::Measured);
    certificate.seconds = begin.elapsed().as_secs_f64();
    let calibrated = Calibrated::of(&certificate, study.certify(ResidualSource::NoiseAlone));
    (certificate, calibrated)
}

impl Calibrated {
    /// Compares a certificate with a reference certificate of the same parameters and classes.
    pub fn of(certificate: &Certificate, nothing_hidden: Certificate) -> Self {
        let ratio = |(measured, quiet): (&Vec<f64>, &Vec<f64>)| -> Option<f64> {
            let logarithms: Vec<f64> = measured
                .iter()
                .zip(quiet)
                .filter(|(measured, quiet)| {
                    **measured > 0.0 && **quiet > 0.0 && !is_unlimited(**quiet)
                })
                .map(|(measured, quiet)| (measured / quiet).ln())
                .collect();
            let count = logarithms.len() as f64;
            (count > 0.0).then(|| (logarithms.iter().sum::<f64>() / count).exp())
        };
        let spreads = certificate.spread.iter().zip(&nothing_hidden.spread);
        let ratios: Vec<(ParameterId, f64)> = certificate
            .parameters
            .iter()
            .zip(spreads.map(ratio))
            .filter_map(|(id, ratio)| ratio.map(|ratio| (*id, ratio)))
            .collect();
        let largest = ratios.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let verdict = largest.filter(|(_, ratio)| *ratio > SIGNIFICANT_RATIO).map(|(id, _)| *id);
        Self { ratios, verdict, nothing_hidden }
    }
}
