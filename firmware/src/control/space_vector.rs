//! A voltage vector as three duties: space-vector modulation by min-max injection.
//!
//! The three phase voltages sum to 0, but the motor sees differences only: adding one number to all
//! three changes nothing for it. Minus the middle of the largest and the smallest centres them in the
//! bus, and vectors up to `bus / sqrt 3` fit, 15 % longer than without:
//! `duty_x = 1/2 + (v_x - (max + min)/2) / bus`. Longer vectors are shortened *on the circle*, d first
//! ([`limit`]): what the magnet needs is kept and torque gives way, and no harmonics are made.
//!
//! Valid for a positive finite bus voltage; whatever goes in, each duty is a number within 0..=1.

use super::transform::{Rotating, Stationary, inverse_clarke, root};

/// Length of the longest vector in terms of the bus voltage.
pub const CIRCLE: f32 = 0.577_350_26;

/// A vector within the circle, and whether it had to be shortened. `radius_v` is at least 0.
///
/// `d' = d` within `+-r`; `q' = q` within `+-sqrt(r^2 - d'^2)`.
#[inline(always)]
pub fn limit(wanted: Rotating, radius_v: f32) -> (Rotating, bool) {
    let square = radius_v * radius_v;
    if wanted.d * wanted.d + wanted.q * wanted.q <= square {
        return (wanted, false);
    }
    let d = clamp(wanted.d, radius_v);
    (Rotating { d, q: clamp(wanted.q, root(square - d * d)) }, true)
}

/// `value` within `+-bound`; NaN becomes 0.
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

/// Duties of phases a, b, c for a vector within the circle, V, at a bus voltage, V.
#[inline(always)]
pub fn duties(vector: Stationary, bus_v: f32) -> [f32; 3] {
    let [a, b, c] = inverse_clarke(vector);
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    let low = if c < low { c } else { low };
    let high = if c > high { c } else { high };
    let (middle, per_volt) = (0.5 * (low + high), 1.0 / bus_v);
    // Within 0..=1 but for rounding, and for what is no number.
    [a, b, c].map(|phase| 0.5 + clamp((phase - middle) * per_volt, 0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::transform::{Rotation, clarke};

    const BUS_V: f32 = 48.0;

    #[test]
    fn the_whole_circle_fits_and_comes_out_of_the_bridge_as_it_went_in() {
        let (mut least, mut most) = (1.0f32, 0.0f32);
        for angle in (0..1u32 << 16).map(|i| i << 16) {
            let wanted = Rotation::at(angle).inverse_park(Rotating { d: 0.0, q: BUS_V * CIRCLE });
            // The sine's error makes the vector up to 0.11 % longer than the circle: scaled back.
            let length = wanted.alpha.hypot(wanted.beta) / (BUS_V * CIRCLE);
            let wanted = Stationary { alpha: wanted.alpha / length, beta: wanted.beta / length };
            let duty = duties(wanted, BUS_V);
            let given = clarke(duty.map(|share| share * BUS_V));
            assert!((given.alpha - wanted.alpha).abs() < 2e-5 * BUS_V);
            assert!((given.beta - wanted.beta).abs() < 2e-5 * BUS_V);
            least = duty.iter().fold(least, |least, share| least.min(*share));
            most = duty.iter().fold(most, |most, share| most.max(*share));
        }
        // All of the bus is used, and no more.
        assert!((0.0..1e-3).contains(&least), "{least}");
        assert!((0.999..=1.0).contains(&most), "{most}");
    }

    #[test]
    fn shortened_vectors_lie_on_the_circle_and_keep_their_d() {
        let radius = 20.0;
        assert_eq!(
            limit(Rotating { d: 12.0, q: -16.0 }, radius),
            (Rotating { d: 12.0, q: -16.0 }, false)
        );
        for (d, q) in [(3.0, 40.0), (-19.9, -40.0), (0.0, 20.1), (-100.0, 1.0), (20.0, 20.0)] {
            let (given, limited) = limit(Rotating { d, q }, radius);
            assert!(limited);
            assert_eq!(given.d, d.clamp(-radius, radius));
            let length = given.d.hypot(given.q);
            assert!((length - radius).abs() < 2e-4, "{given:?}: {length}");
        }
    }

    #[test]
    fn nonsense_gives_legal_duties() {
        let odd = [0.0, -1.0, 1e30, -1e38, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for alpha in odd {
            for beta in odd {
                for bus in odd {
                    let duty = duties(Stationary { alpha, beta }, bus);
                    assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{duty:?}");
                    let (given, _) = limit(Rotating { d: alpha, q: beta }, 20.0);
                    assert!(given.d.abs() <= 20.0 && given.q.abs() <= 20.001, "{given:?}");
                }
            }
        }
    }
}
