//! Calibration of the rule of the stochastic extension with a reference without missing physics.
//!
//! A permitted spread is large for two reasons: the data vary, or the output hardly depends on the parameter. The second
//! reason does not indicate missing physics, but usually dominates. A reference certificate, computed for the fitted
//! model's own torque with the sensor's noise on the same inputs, contains only the second reason. The ratio of both
//! certificates contains only the first. By the *calibrated* rule, the parameter with the largest ratio is to be
//! improved, and none if no ratio is significant.

use compensator_core::{ParameterId, Parameters};
use friction_fit::Track;
use friction_fit::white_noise;
use statrs::distribution::{ContinuousCDF, Normal};
use stochastic_extension::certificate::is_unlimited;
use stochastic_extension::range::{Ranges, share_beyond};
use stochastic_extension::study::CertificateStudy;
use stochastic_extension::trials::Trials;
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
    let study = CertificateStudy::new(parameters, free, tracks, settings);
    let certificate = study.certify();
    let draws = settings.counts().trials;
    let quiet = study.certify_within(|trials| noise_range(noise(trials), draws));
    let calibrated = Calibrated::of(&certificate, quiet);
    (certificate, calibrated)
}

/// Returns the range of `draws` values of white noise. `noise` is its standard deviation, Nm.
fn noise_range(noise: f64, draws: usize) -> Ranges {
    Ranges::symmetric((noise * Normal::standard().inverse_cdf(1.0 - share_beyond(draws))) as f32)
}

/// Returns the noise of the torque, Nm.
fn noise(trials: &Trials) -> f64 {
    let torques = || trials.blocks.iter().map(|block| block.torque.as_slice());
    let rows = torques().map(<[f64]>::len).sum::<usize>().max(1) as f64;
    let squares: f64 = torques().flatten().map(|torque| torque * torque).sum();
    // The lower limit is the rounding of a log without noise.
    white_noise(torques()).max(1e-5 * (squares / rows).sqrt()).max(1e-12)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_range_is_the_median_range_of_draws() {
        let (low, high) = noise_range(2.0, 50).at(0.0);
        assert!(low == -high && (high - 4.41).abs() < 0.01, "{high}");
        assert!(noise_range(2.0, 1732).at(0.0).1 > 6.0);
    }
}
