//! The paper's rule held against a world with nothing hidden.
//!
//! A permitted spread is large for two reasons: the data vary, and the output hardly depends on the
//! parameter. The second is there without any missing physics, and it is most of the number. The same
//! certificate for the fitted model's own torque with the sensor's noise, on the same inputs, has it alone;
//! the ratio of the two has the first alone. By the *calibrated* rule the parameter with the largest ratio is
//! the one to be improved, and none is where no ratio stands out.

use super::certificate::{Certificate, is_unlimited};
use super::settings::Settings;
use super::study::{Residual, Study};
use crate::fit::Track;
use compensator_core::{ParameterId, Parameters};

/// A ratio up to this is what worlds with nothing hidden have too (39 of 40 of them, measured;
/// `docs/stochastic-extension.md`).
pub const TELLING: f64 = 1.15;

/// What the calibrated rule says.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// Permitted spread over that of a world with nothing hidden: geometric mean over the classes in
    /// which that world determines the parameter. A parameter that no class determines has none.
    pub ratios: Vec<(ParameterId, f64)>,
    /// The parameter with the largest ratio, where it is more than [`TELLING`].
    pub verdict: Option<ParameterId>,
    /// The certificate of the world with nothing hidden.
    pub nothing_hidden: Certificate,
}

/// A certificate and what the calibrated rule says.
pub fn certify_calibrated(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    settings: &Settings,
) -> (Certificate, Calibrated) {
    let begin = std::time::Instant::now();
    let study = Study::new(parameters, free, tracks, settings);
    let mut certificate = study.certify(Residual::Measured);
    certificate.seconds = begin.elapsed().as_secs_f64();
    let calibrated = Calibrated::of(&certificate, study.certify(Residual::NoiseAlone));
    (certificate, calibrated)
}

/// What the calibrated rule says.
pub fn calibrated_verdict(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    settings: &Settings,
) -> Calibrated {
    certify_calibrated(parameters, free, tracks, settings).1
}

impl Calibrated {
    /// Holds a certificate against one of a world with nothing hidden, of the same parameters and classes.
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
        let verdict = largest.filter(|(_, ratio)| *ratio > TELLING).map(|(id, _)| *id);
        Self { ratios, verdict, nothing_hidden }
    }
}
