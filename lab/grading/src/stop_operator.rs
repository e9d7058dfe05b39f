//! The elastic sign: a stop operator over displacement, with a gap for backlash.

use joint_log::{Quantity, Run};

/// Returns the displacement of each row since the row before, from the logged position or the integrated velocity.
pub(super) fn displacements(run: &Run) -> Vec<f64> {
    let mut steps = vec![0.0; run.len()];
    for at in 1..run.len() {
        steps[at] = match run.get(Quantity::Position) {
            Some(position) => position[at] - position[at - 1],
            None => {
                let seconds = run.time_s[at] - run.time_s[at - 1];
                0.5 * (run.velocity[at] + run.velocity[at - 1]) * seconds
            }
        };
    }
    steps
}

/// Evaluates `s <- clamp(s + d / travel, -1, 1)`. After each reversal the first `gap` of the displacement has no effect.
pub(super) fn stop(displacements: &[f64], travel: f64, gap: f64) -> Vec<f64> {
    let (mut sign, mut play) = (0.0f64, 0.5 * gap);
    displacements
        .iter()
        .map(|&step| {
            // The play is an interval of length `gap` that the step moves.
            let room = if step > 0.0 { gap - play } else { play };
            let crossed = step.abs().min(room.max(0.0));
            play += crossed.copysign(step);
            let left = (step.abs() - crossed).copysign(step);
            sign = (sign + left / travel).clamp(-1.0, 1.0);
            sign
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_after_reversal_turns_over_its_travel() {
        let there = vec![0.5; 8];
        let back = vec![-0.5; 8];
        let found = stop(&[there, back].concat(), 2.0, 0.0);
        assert_eq!(found[..5], [0.25, 0.5, 0.75, 1.0, 1.0]);
        assert_eq!(found[8..12], [0.75, 0.5, 0.25, 0.0]);
    }

    #[test]
    fn stop_with_gap_skips_gap_first() {
        let found = stop(&[1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0], 1.0, 2.0);
        assert_eq!(found, [0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    }
}
