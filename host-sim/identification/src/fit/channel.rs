//! What the torque's channel makes of a torque.
//!
//! A current or a load cell is filtered before it is logged. A first-order low-pass of time constant `tau` answers a
//! torque `T` with
//!
//! ```text
//! y -> y + (T - y) (1 - exp(-dt / tau))
//! ```
//!
//! row by row. Taken off the measured torque it would blow up whatever noise came after it; so it is put on the
//! model's torque instead, on its derivatives and on every column that is held beside them, and what is fitted
//! remains the friction at the shaft. What the filter held before a track is the first measured torque.

use super::track::Track;
use compensator_core::Real;

/// A low-pass on its way along a track.
pub struct LowPass<'a, T> {
    track: &'a Track,
    /// Share of the way to its input in one of the track's own periods.
    share: f64,
    held: T,
}

impl<'a, T: Real<Setting = T>> LowPass<'a, T> {
    /// The low-pass of a track's torque, if it has one, from its first measured torque.
    pub fn of_torque(track: &'a Track) -> Option<Self> {
        Self::of_changes(track).map(|own| Self { held: T::from_f64(track.torque[0]), ..own })
    }

    /// The same for what is added to a torque, from nothing.
    pub fn of_changes(track: &'a Track) -> Option<Self> {
        let share = share(track.period_s, track.torque_low_pass_s)?;
        Some(Self { track, share, held: T::zero() })
    }

    /// What comes out in a row into which this goes.
    pub fn pass(&mut self, row: usize, value: T) -> T {
        let share = match &self.track.period_ratio {
            Some(ratios) => {
                -(-self.track.period_s * ratios[row] / self.track.torque_low_pass_s).exp_m1()
            }
            None => self.share,
        };
        self.held = self.held + (value - self.held) * T::from_f64(share);
        self.held
    }
}

/// Share of the way to its input that a low-pass goes in a period; none without one.
fn share(period_s: f64, time_constant_s: f64) -> Option<f64> {
    (time_constant_s > 0.0).then(|| -(-period_s / time_constant_s).exp_m1())
}

/// A column beside a model's torque, as the torque's channel shows it.
pub fn passed(track: &Track, column: Vec<f64>) -> Vec<f64> {
    let Some(mut low_pass) = LowPass::of_changes(track) else { return column };
    column.into_iter().enumerate().map(|(row, value)| low_pass.pass(row, value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::fit::simulate::{Resolution, simulate};
    use compensator_core::{LawKind, ParameterId as Id, Parameters, Sample};

    #[test]
    fn a_step_comes_through_as_the_time_constant_says() {
        let mut track = Track::even(vec![Sample::default(); 500], vec![0.0; 500], 1e-3);
        track.torque_low_pass_s = 0.05;
        let out = passed(&track, vec![2.0; 500]);
        let expected = 2.0 * (1.0 - (-0.1f64 / 0.05).exp());
        assert!((out[99] - expected).abs() < 1e-12, "{}", out[99]);
        // Uneven rows of the same time in all.
        track.period_ratio = Some([0.5, 1.5].repeat(250));
        let uneven = passed(&track, vec![2.0; 500]);
        assert!((uneven[99] - expected).abs() < 1e-12, "{}", uneven[99]);
    }

    #[test]
    fn a_models_derivatives_go_through_it_too() {
        let velocity = |row: usize| 0.5 * (0.02 * row as f64).sin();
        let samples = (0..2000)
            .map(|row| Sample { velocity_rad_s: velocity(row), ..Sample::default() })
            .collect();
        let mut track = Track::even(samples, vec![0.1; 2000], 1e-3);
        track.torque_low_pass_s = 0.02;
        let joint = |coulomb: f64| {
            Parameters::<f64>::new(LawKind::Linear)
                .with(Id::CoulombTorque, coulomb)
                .with(Id::ViscousFriction, 0.3)
        };
        let torque = |coulomb: f64| {
            let mut torques = Vec::new();
            simulate(&joint(coulomb), &track, None, Resolution::PLAIN, |_, torque, _| {
                torques.push(torque);
                true
            });
            torques
        };
        let mut dual = joint(1.5).convert::<Dual<1>>();
        dual.set(Id::CoulombTorque, Dual::parameter(1.5, 0));
        let (low, high) = (torque(1.4999), torque(1.5001));
        simulate(&dual, &track, None, Resolution::PLAIN, |row, torque, _| {
            let difference = (high[row] - low[row]) / 2e-4;
            assert!((torque.gradient[0] - difference).abs() < 1e-8, "row {row}");
            true
        });
        // Late, and never further than the friction goes.
        assert!(low[0].abs() < 0.2 && low.iter().all(|torque| torque.abs() < 1.66));
    }
}
