//! Resistance, and the voltage that the dead time takes, from three currents along a field at rest.
//!
//! ```text
//! v = R i + 2/3 u (h(i / w) + h(i / 2w))        u: lost by a phase;  w: current at which half of it is lost
//! h(x) = x / 2 below 1, 1 - 1 / 2x above        crate::control::dead_time::charged_share
//! ```
//! Phase a carries the current, b and c half of it against it. `h` is the share that is lost: during the dead time the
//! current charges the switches, and turns the phase over from `w` on. For a given `w`, the two larger currents give `R`
//! and `u`. The smallest one tells `w`: a larger one lowers the voltage that it expects. Bisection finds it.
//! [`crate::control::dead_time`] compensates by a smooth function of the same two constants, which needs no branches.

use crate::control::dead_time::charged_share;

/// Mean current and voltage along the field.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub current_a: f32,
    pub voltage_v: f32,
}

/// Result of the three currents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loss {
    pub resistance_ohm: f32,
    /// Voltage that a phase loses at a large current, V; at least 0.
    pub lost_v: f32,
    /// Phase current at which half of it is lost, A.
    pub current_a: f32,
}

/// Range of the scale: minimum in A, because the noise of the sensors hides a smaller one, and maximum as a share of the
/// largest current.
const SCALE_MIN_A: f32 = 0.05;
const SCALE_MAX_SHARE: f32 = 0.25;
const BISECTIONS: u32 = 12;

/// Returns resistance and loss for currents in ascending order. It is not finite if two currents are equal.
#[inline(never)]
pub(super) fn find([low, half, full]: [Level; 3]) -> Loss {
    let (mut least, mut most) = (SCALE_MIN_A, SCALE_MAX_SHARE * full.current_a);
    let mut found = solve(half, full, least);
    for _ in 0..BISECTIONS {
        let scale = 0.5 * (least + most);
        let at = solve(half, full, scale);
        let expected_v =
            at.resistance_ohm * low.current_a + at.lost_v * shape(low.current_a, scale);
        if expected_v > low.voltage_v {
            (least, found) = (scale, at);
        } else {
            most = scale;
        }
    }
    found.lost_v = found.lost_v.max(0.0);
    found
}

/// Returns resistance and loss of two currents for a scale.
fn solve(half: Level, full: Level, scale_a: f32) -> Loss {
    let (s, t) = (shape(half.current_a, scale_a), shape(full.current_a, scale_a));
    let per = 1.0 / (half.current_a * t - full.current_a * s);
    Loss {
        resistance_ohm: (half.voltage_v * t - full.voltage_v * s) * per,
        lost_v: (half.current_a * full.voltage_v - full.current_a * half.voltage_v) * per,
        current_a: scale_a,
    }
}

/// Returns the voltage lost along the field, per voltage lost by a phase.
fn shape(current_a: f32, scale_a: f32) -> f32 {
    let x = current_a / scale_a;
    2.0 / 3.0 * (charged_share(x) + charged_share(0.5 * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(ohm: f32, lost: impl Fn(f32) -> f32, full_a: f32) -> [Level; 3] {
        [0.06, 0.5, 1.0].map(|share| {
            let i = share * full_a;
            Level { current_a: i, voltage_v: ohm * i + 2.0 / 3.0 * (lost(i) + lost(0.5 * i)) }
        })
    }

    #[test]
    fn find_with_loss_of_the_model_returns_its_parameters() {
        for scale_a in [0.06f32, 0.2, 0.5] {
            let found = find(levels(0.13, |i| 0.48 * charged_share(i / scale_a), 7.8));
            assert!((found.resistance_ohm / 0.13 - 1.0).abs() < 2e-3, "{found:?}");
            assert!((found.lost_v / 0.48 - 1.0).abs() < 5e-3, "{found:?}");
            assert!((found.current_a / scale_a - 1.0).abs() < 0.03, "{found:?}");
        }
    }

    #[test]
    fn find_with_loss_of_another_shape_stays_within_tolerance() {
        // Proportional up to a current, then constant; and a smooth function with a long tail.
        for (scale_a, is_ramp) in [(0.05f32, true), (0.1, true), (0.05, false), (0.15, false)] {
            let lost = |i: f32| {
                let ramp = (0.5 * i / scale_a).min(1.0);
                0.48 * if is_ramp { ramp } else { i / (i + scale_a) }
            };
            let found = find(levels(0.13, lost, 7.8));
            assert!((found.resistance_ohm / 0.13 - 1.0).abs() < 0.03, "{scale_a}: {found:?}");
            assert!((found.lost_v / 0.48 - 1.0).abs() < 0.1, "{scale_a}: {found:?}");
            assert!(
                (0.02..2.0 * scale_a + 0.05).contains(&found.current_a),
                "{scale_a}: {found:?}"
            );
        }
    }

    #[test]
    fn find_without_dead_time_returns_no_loss() {
        let found = find(levels(0.13, |_| 0.0, 7.8));
        assert!((found.resistance_ohm - 0.13).abs() < 1e-5 && found.lost_v < 1e-4, "{found:?}");
    }
}
