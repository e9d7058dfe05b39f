//! Structure of the residual that follows no column: the finding `unknown` without a term.

use super::cause::Cause;
use super::evaluation::resampled_errors;
use super::extended::Size;
use super::finding::Finding;
use super::{Diagnosis, STRUCTURE};
use friction_fit::Predicted;
use joint_log::number::figure;
use statrs::distribution::{ContinuousCDF, Normal};

/// Returns the finding of structure that follows no column.
///
/// Its size is the error above the noise floor. The interval comes from resampled blocks of rows, drawn with `seed`.
pub(crate) fn unexplained(cause: &'static Cause, found: &Diagnosis, seed: u64) -> Finding {
    let (after, noise_floor) = (&found.after, found.noise_floor);
    let rmse = after.metrics.rmse;
    let beyond = |rmse: f64| (rmse * rmse - noise_floor * noise_floor).max(0.0).sqrt();
    let drawn: Vec<f64> = resampled_errors(after, seed).into_iter().map(beyond).collect();
    let least = beyond(STRUCTURE * noise_floor);
    let stability = drawn.iter().filter(|size| **size > least).count() as f64 / drawn.len() as f64;
    let unit = found.log.train.joint.torque_unit();
    let tail = drawn.len() / 40;
    let interval = [drawn[tail], drawn[drawn.len() - 1 - tail]];
    let size = Size::with_interval(beyond(rmse), interval, unit);
    let p_value = like_noise(after);
    Finding {
        in_words: format!(
            "an error remains, {} {unit} RMS above the noise of {} {unit}, which no cause explains",
            figure(size.value),
            figure(noise_floor)
        ),
        size,
        p_value,
        probability: 1.0 - p_value.clamp(0.0, 1.0),
        stability,
        share_of_residual: (1.0 - (noise_floor / rmse).powi(2)).clamp(0.0, 1.0),
        ..Finding::of(cause)
    }
}

/// Returns the probability that white noise has the residual's autocorrelation between neighbouring
/// rows.
fn like_noise(after: &Predicted) -> f64 {
    let (mut products, mut squares, mut rows) = (0.0, 0.0, 0.0);
    for track in &after.residuals {
        products += track.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
        squares += track.iter().map(|r| r * r).sum::<f64>();
        rows += track.len() as f64;
    }
    let surprise = products / f64::max(squares, f64::MIN_POSITIVE) * f64::sqrt(rows);
    Normal::standard().sf(surprise)
}
