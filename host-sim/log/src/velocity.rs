//! Velocity from position, for a log without a velocity.
//!
//! A plain difference is used on purpose. Most drives log the same as their velocity, and the reconstruction of the
//! motion ([`crate::motion`]) recognises it by its delay of half a row and uses the position instead. A smoother
//! estimate would distort the reversals. No difference is taken over a gap.

use super::dataset::Run;
use super::segment::{segments, segments_of};
use compensator_core::quantity::Quantity;

impl Run {
    /// Derives the velocity from the position, piece by piece.
    pub(crate) fn derive_velocity(&mut self) {
        let Some(position) = self.get(Quantity::Position) else { return };
        let pieces = segments(self).into_iter();
        self.velocity = pieces
            .flat_map(|rows| differences(&self.time_s[rows.clone()], &position[rows]))
            .collect();
    }
}

/// Returns the differences of a position from row to row in each segment. The first row gets the value of the second.
/// The result is late by half a row.
pub(crate) fn differences(time: &[f64], position: &[f64]) -> Vec<f64> {
    let mut velocity = vec![0.0; time.len()];
    for rows in segments_of(time) {
        for row in rows.start + 1..rows.end {
            let step = time[row] - time[row - 1];
            let travel = position[row] - position[row - 1];
            velocity[row] = if step > 0.0 { travel / step } else { velocity[row - 1] };
        }
        if rows.len() > 1 {
            velocity[rows.start] = velocity[rows.start + 1];
        }
    }
    velocity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_with_gap_or_zero_step_stays_in_segment() {
        let time = [0.0, 1.0, 2.0, 3.0, 3.0, 100.0, 101.0];
        let position = [0.0, 2.0, 4.0, 6.0, 6.0, 500.0, 501.0];
        assert_eq!(differences(&time, &position), [2.0, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0]);
    }
}
