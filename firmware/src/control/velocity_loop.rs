//! The velocity loop above the current loop: one step per report of the current loop, in the background.
//!
//! ```text
//! reference' = reference moved towards the target by at most  acceleration_max dt
//! current    = J reference'/kt + gain (reference - velocity) + integral + offset,  limited
//! integral'  = gain (reference - velocity) / integral_s + 4 withheld / integral_s,  not while limited here
//! ```
//! `withheld` is what the current loop applied less what was commanded: its limits of current, voltage and braking
//! power, and the derating. It moves the integral to the current that flows, so that the loop does not wind up
//! against a limit that it cannot know.
//!
//! `offset` is the current of a torque that a master knows. A loop that began with the current of a load has this current
//! in its integral, which the first offset replaces: the same load counts once.
//!
//! The velocity loop does not model friction. Its reference goes to the compensator with the current, and the
//! compensator adds the friction current of that speed in the interrupt, before the limits. The velocity loop
//! handles inertia, load and model errors. Current and velocity are delayed by 1 ms each. With an observer of
//! 100 Hz, a crossover at 10 Hz keeps half of its phase margin.

use super::parameters::MotorParameters;
use super::space_vector::clamp;

/// Rate at which the integral follows a withheld current, per integral time. At a constant error the command then
/// exceeds the applied current by a quarter of the proportional part.
const TRACKING_RATE: f32 = 4.0;

/// Gains of the velocity loop, built from the written parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityGains {
    /// Proportional gain, A per rad/s.
    gain: f32,
    /// Integral gain per step, A per rad/s.
    integral: f32,
    /// Share of the withheld current that reaches the integral in a step.
    tracking: f32,
    /// Feed-forward of the inertia: A per change of the reference in a step, rad/s.
    inertia: f32,
    /// Maximum change of the reference in a step, rad/s.
    slew_rad_s: f32,
}

impl VelocityGains {
    /// Builds the gains for a step of `period_s`. Parameters must be validated; joint torque per current is in
    /// Nm/A.
    pub fn build(motor: &MotorParameters, torque_constant_nm_per_a: f32, period_s: f32) -> Self {
        let gain = motor.velocity_gain_a_s_per_rad;
        Self {
            gain,
            integral: gain * period_s / motor.velocity_integral_s,
            tracking: TRACKING_RATE * period_s / motor.velocity_integral_s,
            inertia: motor.inertia_kg_m2 / (torque_constant_nm_per_a * period_s),
            slew_rad_s: motor.acceleration_max_rad_s2 * period_s,
        }
    }

    /// Returns the gains with another maximum acceleration of the reference, rad/s^2, for a step of `period_s`.
    #[must_use]
    pub fn with_acceleration(self, acceleration_rad_s2: f32, period_s: f32) -> Self {
        Self { slew_rad_s: acceleration_rad_s2 * period_s, ..self }
    }
}

/// Command of a step to the current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityCommand {
    /// Current before compensation, A.
    pub current_a: f32,
    /// Reference velocity, rad/s.
    pub reference_rad_s: f32,
}

/// Reference of a position loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedVelocity {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Change of the velocity that the inertia needs in this step, rad/s.
    pub change_rad_s: f32,
}

/// State of the velocity loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityLoop {
    reference_rad_s: f32,
    integral_a: f32,
    offset_a: f32,
    /// The integral began with the current of a load.
    is_loaded: bool,
}

impl VelocityLoop {
    /// Creates a loop that starts at a joint velocity, rad/s, with zero current.
    pub fn begin(velocity_rad_s: f32) -> Self {
        let reference_rad_s = if velocity_rad_s.is_finite() { velocity_rad_s } else { 0.0 };
        Self { reference_rad_s, ..Self::default() }
    }

    /// Creates a loop that starts at a joint velocity, rad/s, with the current that holds the load, A.
    pub fn begin_loaded(velocity_rad_s: f32, load_a: f32) -> Self {
        let integral_a = if load_a.is_finite() { load_a } else { 0.0 };
        Self { integral_a, is_loaded: integral_a != 0.0, ..Self::begin(velocity_rad_s) }
    }

    /// Sets the current that a master adds, A. It changes nothing if it is not finite.
    pub fn feed_forward(&mut self, offset_a: f32) {
        if !offset_a.is_finite() {
            return;
        }
        if self.is_loaded && offset_a != 0.0 {
            self.integral_a -= offset_a - self.offset_a;
            self.is_loaded = false;
        }
        self.offset_a = offset_a;
    }

    /// Moves the current that a master added into the integral, from which the next one counts, as that of a load.
    pub fn absorb_feed_forward(&mut self) {
        if self.offset_a != 0.0 {
            self.integral_a += self.offset_a;
            self.offset_a = 0.0;
            self.is_loaded = true;
        }
    }

    /// Runs a step towards a target, rad/s, at a velocity, rad/s. The current is limited to `+-limit_a`.
    /// `withheld_a` is the current that was applied less the command of the last step, A; 0 unless a limit of the
    /// current loop acts. If target or velocity is not finite, the current is 0.
    #[must_use]
    pub fn step(
        &mut self,
        gains: &VelocityGains,
        target_rad_s: f32,
        velocity_rad_s: f32,
        limit_a: f32,
        withheld_a: f32,
    ) -> VelocityCommand {
        if !(target_rad_s.is_finite() && velocity_rad_s.is_finite()) {
            return self.command(0.0);
        }
        let change = clamp(target_rad_s - self.reference_rad_s, gains.slew_rad_s);
        self.reference_rad_s += change;
        self.act(gains, change, velocity_rad_s, limit_a, withheld_a)
    }

    /// Runs a step as [`VelocityLoop::step`] with a reference that a position loop gives, without a limit of its
    /// acceleration.
    #[must_use]
    pub fn track(
        &mut self,
        gains: &VelocityGains,
        reference: TrackedVelocity,
        velocity_rad_s: f32,
        limit_a: f32,
        withheld_a: f32,
    ) -> VelocityCommand {
        let TrackedVelocity { velocity_rad_s: reference_rad_s, change_rad_s } = reference;
        if !(reference_rad_s.is_finite() && change_rad_s.is_finite() && velocity_rad_s.is_finite())
        {
            return self.command(0.0);
        }
        self.reference_rad_s = reference_rad_s;
        self.act(gains, change_rad_s, velocity_rad_s, limit_a, withheld_a)
    }

    fn act(
        &mut self,
        gains: &VelocityGains,
        change: f32,
        velocity_rad_s: f32,
        limit_a: f32,
        withheld_a: f32,
    ) -> VelocityCommand {
        let error = self.reference_rad_s - velocity_rad_s;
        let demand_a =
            gains.inertia * change + gains.gain * error + self.integral_a + self.offset_a;
        let current_a = clamp(demand_a, limit_a);
        let grows = current_a == demand_a || (demand_a > 0.0) != (error > 0.0);
        let withheld_a = if withheld_a.is_finite() { withheld_a } else { 0.0 };
        let growth_a = if grows { gains.integral * error } else { 0.0 };
        self.integral_a = clamp(self.integral_a + growth_a + gains.tracking * withheld_a, limit_a);
        self.command(current_a)
    }

    /// Returns a command with this current, A, at the present reference.
    pub const fn command(&self, current_a: f32) -> VelocityCommand {
        VelocityCommand { current_a, reference_rad_s: self.reference_rad_s }
    }

    /// Inverts the integral. The integral that holds the joint against friction in one direction fits the other
    /// direction with opposite sign. A friction run calls this when its reference reverses, because no model
    /// supplies the friction.
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

    /// Simulates a joint with Coulomb friction, measured two steps late, under a loop tuned for 0.12 kg m^2.
    /// Returns the last and the largest velocity.
    fn follow(target: f32, friction_nm: f32, inertia: f32, seconds: f32) -> (f32, f32) {
        let (mut control, gains) = (VelocityLoop::begin(0.0), gains());
        let (mut velocity, mut seen, mut most) = (0.0f32, [0.0f32; 2], 0.0f32);
        for _ in 0..(seconds / DT) as u32 {
            let command = control.step(&gains, target, seen[1], LIMIT_A, 0.0);
            seen = [velocity, seen[0]];
            let driven = velocity + DT / inertia * command.current_a;
            let taken = DT / inertia * friction_nm;
            velocity = driven - driven.clamp(-taken, taken);
            most = most.max(velocity);
        }
        (velocity, most)
    }

    #[test]
    fn velocity_loop_with_friction_and_wrong_inertia_reaches_its_target() {
        for inertia in [0.04, 0.12, 0.36] {
            for friction_nm in [0.0, 3.0] {
                let (velocity, most) = follow(2.0, friction_nm, inertia, 3.0);
                assert!((velocity - 2.0).abs() < 0.02, "{velocity} of 2 rad/s, {inertia} kg m^2");
                assert!((1.99..3.5).contains(&most), "{most} rad/s, {inertia} kg m^2");
            }
        }
    }

    #[test]
    fn velocity_loop_at_its_limit_does_not_wind_up() {
        let (mut control, gains) = (VelocityLoop::begin(0.0), gains());
        // Held for five seconds, then released.
        for _ in 0..5000 {
            assert!(control.step(&gains, 2.0, 0.0, LIMIT_A, 0.0).current_a <= LIMIT_A);
        }
        let command = control.step(&gains, 2.0, 6.0, LIMIT_A, 0.0);
        assert!(command.current_a < 0.0, "{command:?}");
    }

    #[test]
    fn velocity_loop_with_withheld_current_moves_its_integral_to_the_applied_one() {
        let (mut control, gains) = (VelocityLoop::begin(0.0), gains());
        // The loop asks for more and more at a constant error; the current loop applies 2 A.
        let (mut command, mut withheld_a) = (VelocityCommand::default(), 0.0);
        for _ in 0..2000 {
            command = control.step(&gains, 2.0, 1.0, LIMIT_A, withheld_a);
            withheld_a = 2.0 - command.current_a;
        }
        assert!((command.current_a - 2.75).abs() < 0.1, "2 A and a quarter of 3 A: {command:?}");
        // When the velocity arrives, the command is below the applied current at once.
        let command = control.step(&gains, 2.0, 2.0, LIMIT_A, 0.0);
        assert!(command.current_a < 0.0, "{command:?}");
        for withheld_a in [f32::NAN, f32::INFINITY] {
            assert!(control.step(&gains, 2.0, 2.0, LIMIT_A, withheld_a).current_a.is_finite());
        }
    }

    #[test]
    fn velocity_reference_respects_the_acceleration_limit() {
        let (mut control, gains) = (VelocityLoop::begin(0.5), gains());
        let most = MotorParameters::default().acceleration_max_rad_s2 * DT;
        let mut last = 0.5;
        for _ in 0..50 {
            let now = control.step(&gains, -5.0, 0.0, LIMIT_A, 0.0).reference_rad_s;
            assert!(last - now <= most * 1.001 && now < last);
            last = now;
        }
    }

    #[test]
    fn velocity_loop_with_unknown_velocity_gives_no_current() {
        let (mut control, gains) = (VelocityLoop::begin(f32::NAN), gains());
        for (target, velocity) in [(1.0, f32::NAN), (f32::NAN, 1.0), (f32::INFINITY, f32::NAN)] {
            assert_eq!(control.step(&gains, target, velocity, LIMIT_A, 0.0).current_a, 0.0);
        }
        assert_eq!(control, VelocityLoop::begin(0.0));
    }
}
