//! Velocity from position, for a log that has none.
//!
//! A plain difference, and on purpose: it is what most drives log as their velocity, and the reconstruction of the motion
//! ([`crate::motion`]) knows it by its delay of half a row and takes the position instead. Anything smoother would round
//! off the reversals before they are looked at. Nothing is carried over a gap.

use super::segment::segments_of;

/// A position's differences from row to row over each unbroken stretch, its first row as its second: the velocity of
/// an encoder that logs none. It is late by half a row, which the reconstruction of the motion knows to tell.
pub(super) fn differences(time: &[f64], position: &[f64]) -> Vec<f64> {
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
    fn no_difference_crosses_a_gap_or_divides_by_nothing() {
        let time = [0.0, 1.0, 2.0, 3.0, 3.0, 100.0, 101.0];
        let position = [0.0, 2.0, 4.0, 6.0, 6.0, 500.0, 501.0];
        assert_eq!(differences(&time, &position), [2.0, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0]);
    }
}
