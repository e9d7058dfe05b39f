//! Space-vector modulation by min-max injection: converts a voltage vector to three duties.
//!
//! The three phase voltages sum to 0, but only their differences act on the motor: a number added to all three
//! has no effect. Subtracting the mean of the largest and the smallest centres them in the bus. Vectors up to
//! `bus / sqrt 3` then fit, 15 % longer than without: `duty_x = 1/2 + (v_x - (max + min)/2) / bus`. Longer
//! vectors are shortened *to the circle* ([`limit`]), so that no harmonics arise.
//!
//! Valid for a positive finite bus voltage. For every input each duty is a number within 0..=1.

use super::transform::{Rotating, square_root};

/// Length of the longest vector, per bus voltage.
pub const MAX_VECTOR_PER_BUS_V: f32 = 0.577_350_26;

/// Longest demand that is shortened in its own direction, V; its square is finite.
const MAX_DEMAND_V: f32 = 1e9;

/// Returns a vector within the circle, and whether it was shortened. `radius_v` is at least 0.
///
/// A longer vector keeps its direction. If one axis had priority, the other axis would have no voltage left at
/// high speed, and its current would be uncontrolled.
#[inline(always)]
pub fn limit(demand: Rotating, radius_v: f32) -> (Rotating, bool) {
    if demand.d * demand.d + demand.q * demand.q <= radius_v * radius_v {
        return (demand, false);
    }
    (shorten(demand, radius_v), true)
}

/// Shortens a vector to a length of `radius_v`; NaN counts as 0.
#[inline(never)]
fn shorten(demand: Rotating, radius_v: f32) -> Rotating {
    let (d, q) = (clamp(demand.d, MAX_DEMAND_V), clamp(demand.q, MAX_DEMAND_V));
    let length = square_root(d * d + q * q);
    if length <= radius_v {
        return Rotating { d, q };
    }
    let share = radius_v / length;
    Rotating { d: d * share, q: q * share }
}

/// Limits `value` to `+-bound`; NaN becomes 0.
#[inline(always)]
pub(super) fn clamp(value: f32, bound: f32) -> f32 {
    if value > bound {
        bound
    } else if value < -bound {
        -bound
    } else if value.is_nan() {
        0.0
    } else {
        value
    }
}

/// Returns the duties of phases a, b, c for their voltages, V, whose vector is within the circle, at a bus voltage, V.
#[inline(always)]
pub fn duties([a, b, c]: [f32; 3], bus_v: f32) -> [f32; 3] {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    let low = if c < low { c } else { low };
    let high = if c > high { c } else { high };
    let (middle, per_volt) = (0.5 * (low + high), 1.0 / bus_v);
    // The clamp removes rounding errors and NaN.
    let duty = |phase: f32| 0.5 + clamp((phase - middle) * per_volt, 0.5);
    // Written out: the compiler makes a loop over memory of `map`.
    [duty(a), duty(b), duty(c)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::transform::{Rotation, Stationary, clarke, inverse_clarke};

    const BUS_V: f32 = 48.0;

    #[test]
    fn duties_of_a_vector_on_the_circle_reproduce_it() {
        let (mut least, mut most) = (1.0f32, 0.0f32);
        for angle in (0..1u32 << 16).map(|i| i << 16) {
            let demand = Rotation::at(angle)
                .inverse_park(Rotating { d: 0.0, q: BUS_V * MAX_VECTOR_PER_BUS_V });
            // The sine error makes the vector up to 0.11 % longer than the circle, so it is scaled back.
            let length = demand.alpha.hypot(demand.beta) / (BUS_V * MAX_VECTOR_PER_BUS_V);
            let demand = Stationary { alpha: demand.alpha / length, beta: demand.beta / length };
            let duty = duties(inverse_clarke(demand), BUS_V);
            let applied = clarke(duty.map(|share| share * BUS_V));
            assert!((applied.alpha - demand.alpha).abs() < 2e-5 * BUS_V);
            assert!((applied.beta - demand.beta).abs() < 2e-5 * BUS_V);
            least = duty.iter().fold(least, |least, share| least.min(*share));
            most = duty.iter().fold(most, |most, share| most.max(*share));
        }
        // The whole bus voltage is used.
        assert!((0.0..1e-3).contains(&least), "{least}");
        assert!((0.999..=1.0).contains(&most), "{most}");
    }

    #[test]
    fn limit_of_a_long_vector_keeps_its_direction_and_ends_on_the_circle() {
        let radius = 20.0;
        assert_eq!(
            limit(Rotating { d: 12.0, q: -16.0 }, radius),
            (Rotating { d: 12.0, q: -16.0 }, false)
        );
        for (d, q) in [(3.0f32, 40.0f32), (-19.9, -40.0), (0.0, 20.1), (-100.0, 1.0), (1e20, 1e20)]
        {
            let (applied, limited) = limit(Rotating { d, q }, radius);
            assert!(limited);
            let length = applied.d.hypot(applied.q);
            assert!((length - radius).abs() < 2e-4, "{applied:?}: {length}");
            let turned = applied.d * (q / d.hypot(q)) - applied.q * (d / d.hypot(q));
            assert!(turned.abs() < 2e-4, "{applied:?} for {d} {q}");
        }
    }

    #[test]
    fn duties_with_invalid_input_stay_within_range() {
        let odd = [0.0, -1.0, 1e30, -1e38, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for alpha in odd {
            for beta in odd {
                for bus in odd {
                    let duty = duties(inverse_clarke(Stationary { alpha, beta }), bus);
                    assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{duty:?}");
                    let (applied, _) = limit(Rotating { d: alpha, q: beta }, 20.0);
                    assert!(applied.d.abs() <= 20.001 && applied.q.abs() <= 20.001, "{applied:?}");
                }
            }
        }
    }
}
