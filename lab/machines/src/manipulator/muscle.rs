//! Fluidic muscles in antagonistic pairs, and their valves.
//!
//! A muscle pulls with `F = pi r^2 p (a (1 - k)^2 - b)` at gauge pressure `p` and contraction `k`, where
//! `a = 3 / tan^2 angle` and `b = 1 / sin^2 angle` come from the angle of its thread (Tondu and Lopez 2000,
//! [10.1109/37.833638](https://doi.org/10.1109/37.833638)). Two muscles pull on a pulley in opposite directions.
//!
//! The pressure follows from the mass flow of the valve by ISO 6358 (sonic and subsonic flow), a polytropic change of
//! state, and the volume, which grows with the contraction. The internal losses of a muscle act on the joint as
//! friction. They are part of [`super::friction`].

use std::f64::consts::PI;

/// Atmospheric pressure, Pa.
const ATMOSPHERE_PA: f64 = 101_325.0;
/// Absolute supply pressure of the valves, Pa.
const SUPPLY_PA: f64 = 700_000.0 + ATMOSPHERE_PA;
/// Gas constant of air times its temperature, J/kg.
const AIR_J_KG: f64 = 287.0 * 293.15;
/// Polytropic exponent, between isothermal and adiabatic, as measured for filling processes.
const POLYTROPIC: f64 = 1.2;
/// Density at the reference state of ISO 6358, kg/m^3.
const REFERENCE_DENSITY_KG_M3: f64 = 1.185;
/// Critical pressure ratio of the valve.
const CRITICAL_RATIO: f64 = 0.35;
/// Deviation from the set pressure at which a valve is fully open, Pa.
const FULLY_OPEN_PA: f64 = 30_000.0;

/// A pair of muscles on a joint, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Inner radius of a muscle at rest, m.
    pub radius_m: f64,
    /// Length of a muscle at rest, m.
    pub length_m: f64,
    /// Angle of the thread at rest, rad.
    pub thread_rad: f64,
    /// Radius of the pulley, m.
    pub pulley_m: f64,
    /// Contraction of both muscles at joint angle 0.
    pub contraction: f64,
    /// Sonic conductance of each valve, m^3/(s Pa).
    pub conductance_m3_s_pa: f64,
}

/// Muscle of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Pulls towards negative angles.
    Left,
    /// Pulls towards positive angles.
    Right,
}

/// The muscles of the three joints: 10 mm at joints 1 and 3, 20 mm at joint 2, which lifts the arm.
pub const PAIRS: [Pair; 3] = [pair(0.005, 1.5e-10), pair(0.010, 6e-10), pair(0.005, 1.5e-10)];

const fn pair(radius_m: f64, conductance_m3_s_pa: f64) -> Pair {
    Pair {
        radius_m,
        length_m: 0.25,
        thread_rad: 0.436,
        pulley_m: 0.05,
        contraction: 0.10,
        conductance_m3_s_pa,
    }
}

impl Pair {
    /// Returns the contraction of a muscle at a joint angle, rad.
    fn contraction(&self, side: Side, angle_rad: f64) -> f64 {
        let share = self.pulley_m * angle_rad / self.length_m;
        match side {
            Side::Right => self.contraction + share,
            Side::Left => self.contraction - share,
        }
    }

    /// Returns the pull of a muscle, N, at a gauge pressure, Pa. It is not negative.
    pub fn pull_n(&self, side: Side, pressure_pa: f64, angle_rad: f64) -> f64 {
        let left = 1.0 - self.contraction(side, angle_rad);
        let (sine, tangent) = (self.thread_rad.sin(), self.thread_rad.tan());
        let shape = 3.0 * left * left / (tangent * tangent) - 1.0 / (sine * sine);
        (PI * self.radius_m * self.radius_m * pressure_pa * shape).max(0.0)
    }

    /// Returns the torque of the pair, Nm, at gauge pressures (left, right), Pa, and a joint angle, rad.
    pub fn torque_nm(&self, pressures_pa: [f64; 2], angle_rad: f64) -> f64 {
        let [left, right] = pressures_pa;
        let pull =
            self.pull_n(Side::Right, right, angle_rad) - self.pull_n(Side::Left, left, angle_rad);
        self.pulley_m * pull
    }

    /// Returns the rate of a muscle's gauge pressure, Pa/s, for the set pressure `set_pa` and the joint velocity
    /// `velocity_rad_s`.
    pub fn pressure_rate(
        &self,
        side: Side,
        pressure_pa: f64,
        set_pa: f64,
        angle_rad: f64,
        velocity_rad_s: f64,
    ) -> f64 {
        let left = 1.0 - self.contraction(side, angle_rad);
        let (sine, cosine) = self.thread_rad.sin_cos();
        let cylinder = PI * self.radius_m * self.radius_m * self.length_m / (sine * sine);
        let volume = cylinder * left * (1.0 - (cosine * left).powi(2));
        let by_left = cylinder * (1.0 - 3.0 * (cosine * left).powi(2));
        let turning = self.pulley_m * velocity_rad_s / self.length_m;
        let left_rate = match side {
            Side::Right => -turning,
            Side::Left => turning,
        };
        let absolute = pressure_pa + ATMOSPHERE_PA;
        let opening = ((set_pa - pressure_pa) / FULLY_OPEN_PA).clamp(-1.0, 1.0);
        let (from, to) =
            if opening > 0.0 { (SUPPLY_PA, absolute) } else { (absolute, ATMOSPHERE_PA) };
        let mass = opening
            * self.conductance_m3_s_pa
            * REFERENCE_DENSITY_KG_M3
            * from
            * relative_flow(to / from);
        POLYTROPIC * (AIR_J_KG * mass - absolute * by_left * left_rate) / volume
    }
}

/// Returns the flow relative to the sonic flow at a ratio of downstream to upstream pressure.
fn relative_flow(ratio: f64) -> f64 {
    if ratio >= 1.0 {
        return 0.0;
    }
    let beyond = ((ratio - CRITICAL_RATIO) / (1.0 - CRITICAL_RATIO)).max(0.0);
    (1.0 - beyond * beyond).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(set_pa: f64) -> f64 {
        let mut pressure = 550e3;
        for _ in 0..100_000 {
            pressure += 1e-4 * PAIRS[1].pressure_rate(Side::Left, pressure, set_pa, 0.1, 0.0);
        }
        pressure
    }

    #[test]
    fn pressure_rate_settles_at_the_set_pressure() {
        for set in [200e3, 550e3, 620e3] {
            assert!((settled(set) - set).abs() < 1.0, "{set} {}", settled(set));
        }
    }

    #[test]
    fn torque_of_equal_pressures_is_zero_and_of_unequal_is_not() {
        let pair = PAIRS[0];
        assert!(pair.torque_nm([550e3, 550e3], 0.0).abs() < 1e-12);
        assert!(pair.torque_nm([550e3, 200e3], 0.0) < -1.0);
        // A deflected pair acts as a spring.
        assert!(pair.torque_nm([550e3, 550e3], 0.2) < -1.0);
    }

    /// Without flow, `p V^n` is constant.
    #[test]
    fn pressure_rate_without_flow_is_polytropic() {
        let pair = PAIRS[2];
        let volume = |angle: f64| {
            let left = 1.0 - pair.contraction(Side::Right, angle);
            left * (1.0 - (pair.thread_rad.cos() * left).powi(2))
        };
        let (mut pressure, dt) = (400e3, 1e-5);
        for step in 0..50_000 {
            let angle = f64::from(step) * dt;
            pressure += dt * pair.pressure_rate(Side::Right, pressure, pressure, angle, 1.0);
        }
        let kept =
            |pressure: f64, angle: f64| (pressure + ATMOSPHERE_PA) * volume(angle).powf(POLYTROPIC);
        assert!((kept(pressure, 0.5) / kept(400e3, 0.0) - 1.0).abs() < 1e-4);
    }
}
