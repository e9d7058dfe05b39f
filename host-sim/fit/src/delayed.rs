//! Channel delay of a model, applied to the log's motion.
//!
//! The driver's delay line counts its own steps. A log is simulated at another rate, partly with finer steps. A
//! simulation therefore removes the delay from the model and uses a delayed motion instead. A torque that is logged late is late
//! against all of the motion, so the acceleration and the position are delayed with the velocity.

use super::track::Track;
use compensator_core::{ParameterId, Parameters, Real, Sample, TermKind};

/// The motion of a row as a model with a delay has it.
#[derive(Clone, Copy, Debug)]
pub struct Motion<T> {
    /// Velocity, rad/s.
    pub velocity_rad_s: T,
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: T,
    /// Position, rad.
    pub position_rad: T,
}

impl<T: Real> Motion<T> {
    fn of(sample: &Sample<f64>) -> Self {
        Self {
            velocity_rad_s: T::from_f64(sample.velocity_rad_s),
            acceleration_rad_s2: T::from_f64(sample.acceleration_rad_s2),
            position_rad: T::from_f64(sample.position_rad),
        }
    }

    /// Returns the motion between this one and another.
    pub fn towards(&self, to: &Self, share: T) -> Self {
        let between = |from: T, to: T| from + (to - from) * share;
        Self {
            velocity_rad_s: between(self.velocity_rad_s, to.velocity_rad_s),
            acceleration_rad_s2: between(self.acceleration_rad_s2, to.acceleration_rad_s2),
            position_rad: between(self.position_rad, to.position_rad),
        }
    }

    /// Returns the motion without derivatives.
    pub fn value(&self) -> Motion<f64> {
        Motion {
            velocity_rad_s: self.velocity_rad_s.value(),
            acceleration_rad_s2: self.acceleration_rad_s2.value(),
            position_rad: self.position_rad.value(),
        }
    }
}

/// Returns the model without its delay, and the delayed motion if it has one.
///
/// The delayed motion is interpolated linearly between samples. Before the track, its first sample is used.
pub fn undelayed<T: Real<Setting = T>>(
    parameters: &Parameters<T>,
    track: &Track,
) -> (Parameters<T>, Option<Vec<Motion<T>>>) {
    if !parameters.terms.contains(&TermKind::ChannelDelay) {
        return (parameters.clone(), None);
    }
    let mut plain = parameters.clone();
    plain.terms.retain(|term| *term != TermKind::ChannelDelay);
    let delay = parameters.get(ParameterId::ChannelDelay);
    let times = track.times_s();
    let motion = |row: usize| Motion::of(&track.samples[row]);
    let mut earlier = 0;
    let delayed = times
        .iter()
        .map(|time| {
            let then = time - delay.value();
            while earlier + 1 < times.len() && times[earlier + 1] <= then {
                earlier += 1;
            }
            if then <= 0.0 || earlier + 1 == times.len() {
                return motion(earlier);
            }
            let step = times[earlier + 1] - times[earlier];
            let share = (T::from_f64(time - times[earlier]) - delay) * T::from_f64(1.0 / step);
            motion(earlier).towards(&motion(earlier + 1), share)
        })
        .collect();
    (plain, Some(delayed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::LawKind;

    #[test]
    fn undelayed_model_moves_velocity_acceleration_and_position_by_the_delay() {
        let at = |row: usize| Sample {
            velocity_rad_s: row as f64,
            acceleration_rad_s2: 10.0 * row as f64,
            position_rad: 100.0 * row as f64,
            ..Sample::default()
        };
        let track = Track::even((0..6).map(at).collect(), vec![0.0; 6], 0.01);
        let mut parameters = Parameters::<f64>::new(LawKind::Linear);
        assert!(undelayed(&parameters, &track).1.is_none());
        assert!(parameters.add_term(TermKind::ChannelDelay));
        let parameters = parameters.with(ParameterId::ChannelDelay, 0.015);
        let (plain, delayed) = undelayed(&parameters, &track);
        assert!(plain.terms.is_empty());
        let delayed = delayed.expect("a delayed motion");
        assert_eq!(delayed[1].velocity_rad_s, 0.0);
        for (found, expected) in [
            (delayed[4].velocity_rad_s, 2.5),
            (delayed[4].acceleration_rad_s2, 25.0),
            (delayed[4].position_rad, 250.0),
        ] {
            assert!((found - expected).abs() < 1e-9, "{found} in place of {expected}");
        }
    }
}
