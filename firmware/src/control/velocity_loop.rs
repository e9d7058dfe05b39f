//! The velocity loop above the current loop: once a millisecond, in the background, on what the loop reported.
//!
//! ```text
//! reference' = reference moved towards the target by at most  acceleration_max dt
//! current    = J reference'/kt + gain (reference - velocity) + integral,  held to the limit
//! integral'  = gain (reference - velocity) / integral_s,  not further into the limit
//! ```
//! Friction is not its business: the reference goes along with the current, and the compensator adds what that speed takes, in
//! the interrupt and before the limits. So what the loop is left with is inertia, load and what the model does not know.
//! Current and velocity are a millisecond old each: with 100 Hz of observer a crossover of 10 Hz is left half of its phase.

use super::parameters::MotorParameters;
use super::space_vector::clamp;

/// The loop's numbers, built from what a person writes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityGains {
    /// A per rad/s.
    gain: f32,
    /// Change of the integral per error and step, A per rad/s.
    integral: f32,
    /// A per step's change of the reference, rad/s.
    inertia: f32,
    /// Largest change of the reference in a step, rad/s.
    slew_rad_s: f32,
}

impl VelocityGains {
    /// For steps of so many seconds; parameters as validated, joint torque per current in Nm/A.
    pub fn build(motor: &MotorParameters, torque_constant_nm_per_a: f32, period_s: f32) -> Self {
        let gain = motor.velocity_gain_a_s_per_rad;
        Self {
            gain,
            integral: gain * period_s / motor.velocity_integral_s,
            inertia: motor.inertia_kg_m2 / (torque_constant_nm_per_a * period_s),
            slew_rad_s: motor.acceleration_max_rad_s2 * period_s,
        }
    }
}

/// What a step asks of the current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityOrder {
    /// Current before compensation, A.
    pub current_a: f32,
    /// Velocity the joint is meant to have now, rad/s.
    pub reference_rad_s: f32,
}

/// The loop's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityLoop {
    reference_rad_s: f32,
    integral_a: f32,
}

impl VelocityLoop {
    /// A loop that takes over a joint that moves so fast, rad/s, under no current.
    pub fn begin(velocity_rad_s: f32) -> Self {
        let reference_rad_s = if velocity_rad_s.is_finite() { velocity_rad_s } else { 0.0 };
        Self { reference_rad_s, integral_a: 0.0 }
    }

    /// A step towards a target, rad/s, at a velocity, rad/s; current within `limit_a` to either side. A velocity that is not
    /// known makes no current.
    #[must_use]
    pub fn step(
        &mut self,
        gains: &VelocityGains,
        target_rad_s: f32,
        velocity_rad_s: f32,
        limit_a: f32,
    ) -> VelocityOrder {
        if !(target_rad_s.is_finite() && velocity_rad_s.is_finite()) {
            return VelocityOrder { current_a: 0.0, reference_rad_s: self.reference_rad_s };
        }
        let change = clamp(target_rad_s - self.reference_rad_s, gains.slew_rad_s);
        self.reference_rad_s += change;
        let error = self.reference_rad_s - velocity_rad_s;
        let wanted_a = gains.inertia * change + gains.gain * error + self.integral_a;
        let current_a = clamp(wanted_a, limit_a);
        if current_a == wanted_a || (wanted_a > 0.0) != (error > 0.0) {
            self.integral_a = clamp(self.integral_a + gains.integral * error, limit_a);
        }
        VelocityOrder { current_a, reference_rad_s: self.reference_rad_s }
    }

    /// An order of this current at the reference it has, A.
    pub const fn order(&self, current_a: f32) -> VelocityOrder {
        VelocityOrder { current_a, reference_rad_s: self.reference_rad_s }
    }

    /// What holds against friction one way holds against it the other way with its sign turned: for a run that knows no model
    /// and reverses, at the moment its reference does.
    pub fn turn_integral(&mut self) {
        self.integral_a = -self.integral_a;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f32 = 1e-3;
    const LIMIT_A: f32 = 10.0;

    fn gains() -> VelocityGains {
        let motor = MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() };
        VelocityGains::build(&motor, 1.0, DT)
    }

    /// Seconds of a joint under Coulomb friction, seen two steps late, by a loop that takes it for 0.12 kg m^2; its last
    /// velocity and the largest.
    fn follow(target: f32, friction_nm: f32, inertia: f32, seconds: f32) -> (f32, f32) {
        let (mut control, gains) = (VelocityLoop::begin(0.0), gains());
        let (mut velocity, mut seen, mut most) = (0.0f32, [0.0f32; 2], 0.0f32);
        for _ in 0..(seconds / DT) as u32 {
            let order = control.step(&gains, target, seen[1], LIMIT_A);
            seen = [velocity, seen[0]];
            let driven = velocity + DT / inertia * order.current_a;
            let taken = DT / inertia * friction_nm;
            velocity = driven - driven.clamp(-taken, taken);
            most = most.max(velocity);
        }
        (velocity, most)
    }

    #[test]
    fn it_reaches_its_target_with_friction_and_with_another_inertia() {
        for inertia in [0.04, 0.12, 0.36] {
            for friction_nm in [0.0, 3.0] {
                let (velocity, most) = follow(2.0, friction_nm, inertia, 3.0);
                assert!((velocity - 2.0).abs() < 0.02, "{velocity} of 2 rad/s, {inertia} kg m^2");
                assert!((1.99..3.5).contains(&most), "{most} rad/s, {inertia} kg m^2");
            }
        }
    }

    #[test]
    fn a_limit_winds_nothing_up() {
        let (mut control, gains) = (VelocityLoop::begin(0.0), gains());
        // Held for five seconds, then free.
        for _ in 0..5000 {
            assert!(control.step(&gains, 2.0, 0.0, LIMIT_A).current_a <= LIMIT_A);
        }
        let order = control.step(&gains, 2.0, 6.0, LIMIT_A);
        assert!(order.current_a < 0.0, "{order:?}");
    }

    #[test]
    fn the_reference_moves_no_faster_than_the_acceleration_allows() {
        let (mut control, gains) = (VelocityLoop::begin(0.5), gains());
        let most = MotorParameters::default().acceleration_max_rad_s2 * DT;
        let mut last = 0.5;
        for _ in 0..50 {
            let now = control.step(&gains, -5.0, 0.0, LIMIT_A).reference_rad_s;
            assert!(last - now <= most * 1.001 && now < last);
            last = now;
        }
    }

    #[test]
    fn what_is_not_known_makes_no_current() {
        let (mut control, gains) = (VelocityLoop::begin(f32::NAN), gains());
        for (target, velocity) in [(1.0, f32::NAN), (f32::NAN, 1.0), (f32::INFINITY, f32::NAN)] {
            assert_eq!(control.step(&gains, target, velocity, LIMIT_A).current_a, 0.0);
        }
        assert_eq!(control, VelocityLoop::begin(0.0));
    }
}
