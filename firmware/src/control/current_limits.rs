//! Limits of the current vector: its length, the voltage circle, and the power returned to the bus.
//!
//! All three depend on the induced voltage `e = w psi`. With the copper at temperature, a vector `(d, q)` takes the
//! power `p = 1.5 (R (d^2 + q^2) + e q)` from the bus; negative power charges it.
//!
//! *Power.* In the plane of d and q, the vectors that return more than a share `room` of the largest possible power
//! `1.5 e^2 / 4R` lie in a circle around `(0, -h)`, with `h = e / 2R` and the radius `|h| sqrt(1 - room)`. Near its
//! largest voltage the bus can take no more. A vector in the circle then receives a d current that moves it to the
//! edge: the copper burns the rest of the power, and the torque stays. A load that is held or lowered slowly never
//! enters the circle. Only if the length of the vector does not suffice, q is reduced.
//!
//! *Voltage.* The vector needs `v_d = R d - w L_q q` and `v_q = e + R q + w L_d d`. If this exceeds the voltage
//! circle, q is reduced until it fits, so that both currents stay controlled. If the induced voltage alone nearly
//! fills the circle, a negative d current weakens the field first.
//!
//! *Length.* The sum of squares stays within the square of the limit; d has priority, because it is what makes the
//! other two limits hold.

use super::flags::LoopFlags;
use super::parameters::Motor;
use super::space_vector::clamp;
use super::transform::{Rotating, square_root};

/// Share of the voltage circle for a steady current. The rest is for parameter errors and for changes of the
/// current.
const STEADY_SHARE: f32 = 0.97;

/// Share of that circle above which the induced voltage is reduced by a d current.
const EMF_SHARE: f32 = 0.9;

/// State in which a current vector is limited.
#[derive(Clone, Copy, Debug)]
pub(super) struct OperatingPoint {
    /// Electrical speed of the rotor, rad/s.
    pub electrical_rad_s: f32,
    /// Bus voltage of the previous cycle, V: the capacitor holds it for one period.
    pub bus_v: f32,
    /// Maximum length of the vector, A.
    pub limit_a: f32,
}

/// Returns the reference vector for a torque-producing current within `+-limit_a`, and the limits that changed it.
pub(super) fn limit(motor: &Motor, q_a: f32, at: &OperatingPoint) -> (Rotating, LoopFlags) {
    let room = (motor.braking_end_v - at.bus_v) * motor.braking_per_v;
    let (emf_v, reactive_v) =
        (at.electrical_rad_s * motor.flux_vs, at.electrical_rad_s * motor.inductance_q_h * q_a);
    let active_v = emf_v + motor.resistance_ohm * q_a;
    let radius_v = STEADY_SHARE * motor.radius_per_bus * at.bus_v;
    let fits = reactive_v * reactive_v + active_v * active_v <= radius_v * radius_v;
    if fits && room >= 1.0 {
        return (Rotating { d: 0.0, q: q_a }, LoopFlags::empty());
    }
    let mut flags = LoopFlags::empty();
    let mut vector = Rotating { d: 0.0, q: q_a };
    if room < 1.0 {
        vector = burn(q_a, emf_v * motor.half_per_burning_ohm, room.max(0.0), at.limit_a);
        flags |= LoopFlags::BRAKING_LIMITED.when(vector.d != 0.0 || vector.q != q_a);
    }
    let before = vector;
    let reactance = at.electrical_rad_s.abs() * motor.inductance_d_h;
    let excess_v = emf_v.abs() - EMF_SHARE * radius_v;
    if excess_v > 0.0 && reactance > 0.0 {
        vector.d = vector.d.min(-(excess_v / reactance).min(at.limit_a));
    }
    vector.q = fit_voltage(motor, vector, at.electrical_rad_s, radius_v);
    let room_q = square_root(at.limit_a * at.limit_a - vector.d * vector.d);
    vector.q = clamp(vector.q, room_q);
    flags |= LoopFlags::VOLTAGE_LIMITED.when(vector != before);
    (vector, flags)
}

/// Moves a vector out of the circle of excess power around `(0, -half_a)`.
fn burn(q_a: f32, half_a: f32, room: f32, limit_a: f32) -> Rotating {
    let square = |a: f32| a * a;
    let missing = square(half_a) * (1.0 - room) - square(q_a + half_a);
    if missing <= 0.0 {
        return Rotating { d: 0.0, q: q_a };
    }
    if missing + square(q_a) <= square(limit_a) {
        return Rotating { d: -square_root(missing), q: q_a };
    }
    // The circle of the length meets the circle of the power here.
    let least = (square(limit_a) + square(half_a) * room) / (2.0 * half_a.abs());
    let q = clamp(q_a, least.min(limit_a));
    Rotating { d: -square_root(square(limit_a) - square(q)), q }
}

/// Returns the q current nearest to that of a vector whose voltage fits the circle: the root of
/// `(R d - w L_q q)^2 + (e + w L_d d + R q)^2 = r^2` beyond which it does not fit.
fn fit_voltage(motor: &Motor, vector: Rotating, electrical_rad_s: f32, radius_v: f32) -> f32 {
    let (r, x) = (motor.resistance_ohm, electrical_rad_s * motor.inductance_q_h);
    let along = r * vector.d;
    let across = electrical_rad_s * (motor.flux_vs + motor.inductance_d_h * vector.d);
    let square = |a: f32| a * a;
    if square(along - x * vector.q) + square(across + r * vector.q) <= square(radius_v) {
        return vector.q;
    }
    // a q^2 + 2 b q + c = 0
    let a = r * r + x * x;
    let b = across * r - along * x;
    let c = along * along + across * across - radius_v * radius_v;
    let root = square_root(b * b - a * c);
    let q = if vector.q > 0.0 { root - b } else { -root - b };
    let q = q / a;
    // Never beyond the current that was asked for, nor of the other sign.
    if q * vector.q <= 0.0 { 0.0 } else { clamp(q, vector.q.abs()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::parameters::BURNING_SHARE;
    use crate::control::{MotorParameters, PERIOD_S};
    use proptest::prelude::*;

    fn motor() -> Motor {
        MotorParameters::default().build(PERIOD_S).expect("defaults are legal")
    }

    proptest! {
        #[test]
        fn limited_vector_is_finite_within_its_length_and_returns_at_most_the_permitted_power(
            electrical_rad_s in -1e4f32..1e4, bus_v in 0.0f32..60.0, q_share in -1.0f32..=1.0,
            limit_a in 0.0f32..40.0,
        ) {
            let motor = motor();
            let at = OperatingPoint { electrical_rad_s, bus_v, limit_a };
            let asked_a = q_share * limit_a;
            let (vector, flags) = limit(&motor, asked_a, &at);
            prop_assert!(vector.d.is_finite() && vector.q.is_finite(), "{vector:?}");
            prop_assert!(vector.d.hypot(vector.q) <= limit_a * 1.0001 + 1e-3, "{vector:?}");
            prop_assert!(vector.q * asked_a >= 0.0 && vector.q.abs() <= asked_a.abs() * 1.0001);
            let room = ((motor.braking_end_v - bus_v) * motor.braking_per_v).clamp(0.0, 1.0);
            let emf_v = electrical_rad_s * motor.flux_vs;
            let ohm = BURNING_SHARE * motor.resistance_ohm;
            let taken = ohm * (vector.d * vector.d + vector.q * vector.q) + emf_v * vector.q;
            let permitted = room * emf_v * emf_v / (4.0 * ohm);
            // With too little voltage for the current, the voltage decides.
            if !flags.contains(LoopFlags::VOLTAGE_LIMITED) {
                let rounding = 1e-3 * (1.0 + emf_v * emf_v / ohm);
                prop_assert!(taken >= -permitted - rounding, "{vector:?}: {taken} of {permitted}");
            }
        }
    }

    #[test]
    fn limit_with_room_and_voltage_keeps_the_current() {
        let at = OperatingPoint { electrical_rad_s: 2000.0, bus_v: 48.0, limit_a: 26.0 };
        for q in [-26.0, -3.0, 0.0, 11.0, 26.0] {
            let (vector, flags) = limit(&motor(), q, &at);
            assert_eq!((vector, flags), (Rotating { d: 0.0, q }, LoopFlags::empty()));
        }
    }

    #[test]
    fn limit_at_an_emf_near_the_circle_weakens_the_field() {
        // 16 rad/s of the joint induce 10.7 V; a bus of 18.5 V gives 10.1 V.
        let at = OperatingPoint { electrical_rad_s: 5712.0, bus_v: 18.5, limit_a: 26.0 };
        let (vector, flags) = limit(&motor(), 5.0, &at);
        assert!((-6.0..-2.0).contains(&vector.d), "{vector:?}");
        assert!(flags.contains(LoopFlags::VOLTAGE_LIMITED));
    }
}
