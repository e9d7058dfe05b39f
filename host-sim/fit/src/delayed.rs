//! Channel delay of a model, applied to the log's velocity.
//!
//! The driver's delay line counts its own steps. A log is simulated at another rate, partly with finer steps. A
//! simulation therefore removes the delay from the model and uses a delayed velocity instead.

use super::track::Track;
use compensator_core::{ParameterId, Parameters, Real, TermKind};

/// Returns the model without its delay, and the delayed velocities if it has one.
///
/// Delayed velocities are interpolated linearly between samples. Before the track, the first velocity is used.
pub fn undelayed<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
) -> (Parameters<T>, Option<Vec<T>>) {
    if !parameters.terms.contains(&TermKind::ChannelDelay) {
        return (parameters.clone(), None);
    }
    let mut plain = parameters.clone();
    plain.terms.retain(|term| *term != TermKind::ChannelDelay);
    let delay = parameters.get(ParameterId::ChannelDelay);
    let ratio = |row: usize| track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
    let mut time = 0.0;
    let times: Vec<f64> = (0..track.len())
        .map(|row| {
            time += if row > 0 { track.period_s * ratio(row) } else { 0.0 };
            time
        })
        .collect();
    let velocity = |row: usize| T::from_f64(track.samples[row].velocity_rad_s);
    let mut earlier = 0;
    let delayed = times
        .iter()
        .map(|time| {
            let then = time - delay.value();
            while earlier + 1 < times.len() && times[earlier + 1] <= then {
                earlier += 1;
            }
            if then <= 0.0 || earlier + 1 == times.len() {
                return velocity(earlier);
            }
            let step = times[earlier + 1] - times[earlier];
            let share = (T::from_f64(time - times[earlier]) - delay) * T::from_f64(1.0 / step);
            velocity(earlier) + (velocity(earlier + 1) - velocity(earlier)) * share
        })
        .collect();
    (plain, Some(delayed))
}
