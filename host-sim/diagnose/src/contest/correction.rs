//! Corrections of the log: how its columns may be wrong in time.
//!
//! A correction is applied to the columns of the model, never to the measured torque: a torque that is logged late is
//! explained by columns moved later, a torque that passed a filter by columns that pass the same filter. So every hypothesis
//! is judged on the same numbers.

use super::rows::Rows;
use friction_fit::{LowPassShape, TorqueLowPass};

/// A correction of the log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Correction {
    /// The log as it is.
    #[default]
    None,
    /// The torque is logged this many rows late (early if negative).
    TorqueLate(f64),
    /// The torque passed a low-pass of this delay, rows.
    TorqueLowPass(f64, LowPassShape),
}

/// Relative difference of sizes below which two corrections are one.
const NEAR: f64 = 0.2;

/// Delays of the torque that are tried, rows.
const DELAYS: [f64; 13] = [-5.0, -3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 20.0];

/// Delays of low-passes that are tried, rows.
const LOW_PASSES: [f64; 4] = [1.5, 4.0, 10.0, 25.0];

/// Returns the corrections that are tried beside the log as it is.
pub fn tried() -> Vec<Correction> {
    let low_pass = |shape| LOW_PASSES.map(move |by| Correction::TorqueLowPass(by, shape));
    let low_passes = LowPassShape::ALL.into_iter().flat_map(low_pass);
    DELAYS.into_iter().map(Correction::TorqueLate).chain(low_passes).collect()
}

impl Correction {
    /// Returns the corrections beside this one, nearer to it than its neighbours in `tried`.
    pub fn nearer(self) -> Vec<Self> {
        self.times(&[0.7, 0.85, 1.2, 1.45])
    }

    /// Returns the corrections between this one and those of [`Correction::nearer`]. What an inaccurate correction leaves
    /// resembles an inertia.
    pub fn finer(self) -> Vec<Self> {
        self.times(&[0.9, 0.95, 1.05, 1.1])
    }

    fn times(self, factors: &[f64]) -> Vec<Self> {
        let scaled = |factor: &f64| match self {
            Correction::None => Correction::None,
            Correction::TorqueLate(by) => Correction::TorqueLate(factor * by),
            Correction::TorqueLowPass(by, shape) => Correction::TorqueLowPass(factor * by, shape),
        };
        factors.iter().map(scaled).collect()
    }

    /// Returns true if the other correction is of the same kind and of nearly the same size.
    pub fn is_near(self, other: Self) -> bool {
        let alike = |a: f64, b: f64| (a - b).abs() < NEAR * a.abs().max(b.abs());
        match (self, other) {
            (Correction::None, Correction::None) => true,
            (Correction::TorqueLate(a), Correction::TorqueLate(b)) => alike(a, b),
            (Correction::TorqueLowPass(a, shape), Correction::TorqueLowPass(b, other)) => {
                shape == other && alike(a, b)
            }
            _ => false,
        }
    }

    /// Returns the delay of the torque, s, and its low-pass, for a sample period.
    pub fn of_torque(self, step_s: f64) -> (f64, TorqueLowPass) {
        match self {
            Correction::None => (0.0, TorqueLowPass::default()),
            Correction::TorqueLate(rows) => (rows * step_s, TorqueLowPass::default()),
            Correction::TorqueLowPass(rows, shape) => {
                (0.0, TorqueLowPass { time_s: rows * step_s, shape })
            }
        }
    }

    /// Returns a column as the torque channel would have logged it.
    pub fn apply(self, rows: &Rows, column: &[f64]) -> Vec<f64> {
        let (late_s, low_pass) = self.of_torque(rows.step_s);
        rows.motion.as_logged(column, late_s, low_pass)
    }

    /// Returns true if the correction is a cause of its own, `channel-delay`. A row early or late is within the convention of
    /// when a row is sampled. A filtered torque (`torque-lag`) and a torque before its motion, which is a late velocity
    /// (`velocity-lag`), are faults of the log: they are corrected and are no cause.
    pub fn is_cause(self) -> bool {
        matches!(self, Correction::TorqueLate(rows) if rows > 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::rows::tests::example;

    #[test]
    fn apply_of_late_torque_moves_columns_later_within_runs() {
        let rows = example();
        let moved = Correction::TorqueLate(2.0).apply(&rows, &rows.torque);
        assert_eq!(moved[602], rows.torque[600]);
        assert_eq!(moved[600], rows.torque[600]);
        assert_eq!(Correction::None.apply(&rows, &rows.torque), rows.torque);
    }
}
