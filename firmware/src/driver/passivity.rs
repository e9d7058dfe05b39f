//! Passivity of the compensation where a master or a hand, and not this driver, controls the motion (torque modes).
//!
//! A set with more friction than the joint makes the compensation drive the shaft. The residual does not show it: a hand, a
//! current of water and a load look the same. Energy does. With the kinetic energy `K = J v^2 / 2`:
//!
//! ```text
//! W:  work of the command,  dW/dt = 2 |command v|,  towards K if above;  it fades when nothing is commanded for 0.15 s,
//!     and is K for a command above the friction of the set, which moves the joint without compensation, too
//! share of the compensation = 1 up to K - 2 W = B / 4, falling to 0 at K - 2 W = B;   B = J (0.05 largest speed)^2 / 2
//! ```
//! *Bound*: While `K - 2 W >= B`, the joint has its own friction only. Without a command it is then never faster than without
//! compensation by more than 5 % of its largest speed: two joints of one friction that rises with speed approach each other,
//! whatever drives both. It holds at every time and in one direction, for any set. With a command, its kinetic energy is at
//! most `B` more than four times the work of the command. A factor of two allows for half of the inertia of the set, the other
//! for the noise of a speed from Hall sensors.
//!
//! Below that speed, a hand keeps the whole compensation for 1 s per stroke. If the joint still loses less energy
//! than the set leaves it, the compensation falls to half within 0.1 s, or until the joint is slowed as it should be. It rises
//! with the friction that a joint shows which is slowed or commanded.
//!
//! The velocity loops of the driver need none of this: they hold the speed, so that [`super::over_compensation`] suffices.

use super::loop_data::REPORT_PERIOD_S;

/// Largest speed by the compensation alone, as a share of the joint's largest speed.
const SPEED_SHARE: f32 = 0.05;
/// Share of `B` from which the compensation falls.
const FULL_SHARE: f32 = 0.25;
/// Kinetic energy per work of the command: for an inertia that is wrong, and for the noise of the speed.
const WORK_FACTOR: f32 = 2.0;
const NOISE_FACTOR: f32 = 2.0;
/// Share of the work beyond the kinetic energy that ends in a report: a time constant of 0.1 s, many edges of Hall sensors.
const ENDED_WORK: f32 = REPORT_PERIOD_S / 0.1;
/// Least command, as a share of the friction, for a set that leaves none to the master.
const LEAST_COMMAND: f32 = 0.03;
/// Time without a command after which its work fades, s: a course of a master crosses zero within it.
const QUIET_S: f32 = 0.15;
/// Share of the work that remains after a report without a command: a time constant of 30 ms.
const KEPT_WORK: f32 = 1.0 - REPORT_PERIOD_S / 0.03;
/// Time of a stroke in one direction without a command in which the compensation stays, s.
const STROKE_S: f32 = 1.0;
/// Share of a report in the mean powers: a time constant of 50 ms.
const NEW_SHARE: f32 = REPORT_PERIOD_S / 0.05;
/// Fall of the share per report, from 1 to 0 in 0.2 s, and its rise, from 0 to 1 in 0.5 s of evidence.
const FALL: f32 = REPORT_PERIOD_S / 0.2;
const RISE: f32 = REPORT_PERIOD_S / 0.5;
/// Share that a hand keeps: the friction of a joint is hardly less than half of its set.
const LEAST_SHARE: f32 = 0.5;
/// Minimum speed of sliding, rad/s.
const MIN_SLIDING_RAD_S: f32 = 0.02;

/// Values of one report.
#[derive(Clone, Copy, Debug)]
pub struct TorqueSample {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Torque of the master's target, Nm.
    pub command_nm: f32,
    /// Torque of the compensation, Nm.
    pub compensation_nm: f32,
    /// Friction torque of the model, Nm.
    pub friction_nm: f32,
}

/// Parameters of the joint.
#[derive(Clone, Copy, Debug)]
pub struct PassivityParameters {
    /// Inertia at the joint, kg m^2. If it is 0, it is unknown: every command counts.
    pub inertia_kg_m2: f32,
    /// Largest speed of the joint, rad/s.
    pub velocity_max_rad_s: f32,
    /// Compensated share of the model's friction, 0..=1.
    pub scale: f32,
}

/// Mean powers, W.
#[derive(Clone, Copy, Debug, Default)]
struct MeanPowers {
    /// What the joint loses: work of command and compensation less the rise of the kinetic energy.
    lost: f32,
    compensation: f32,
    model: f32,
}

impl MeanPowers {
    fn take(&mut self, lost: f32, compensation: f32, model: f32) {
        self.lost += NEW_SHARE * (lost - self.lost);
        self.compensation += NEW_SHARE * (compensation - self.compensation);
        self.model += NEW_SHARE * (model - self.model);
    }
}

with_defaults! {
    /// Limits the compensation to what the master's work and the passivity of the set allow.
    #[derive(Clone, Copy, Debug)]
    pub struct PassivityGuard {
        /// `W` as the square of a speed, (rad/s)^2.
        // Unknown: a loop of the driver has moved the joint.
        work: f32 = f32::NAN,
        /// Square of the last speed, (rad/s)^2.
        square: f32,
        means: MeanPowers,
        /// Time without a command, s.
        quiet_s: f32 = QUIET_S,
        /// Time of the present stroke without a command, s.
        stroke_s: f32,
        direction: f32,
        /// Share by what the joint showed.
        shown: f32 = 1.0,
        share: f32 = 1.0,
    }
}

impl PassivityGuard {
    /// Returns the share of the compensation that is passive, 0..=1.
    pub const fn share(&self) -> f32 {
        self.share
    }

    /// Returns true if the joint showed less friction than its compensation.
    pub fn is_detected(&self) -> bool {
        self.shown < 1.0 - SPEED_SHARE
    }

    /// Ends the control by torque: only what the joint showed is kept.
    pub fn interrupt(&mut self) {
        *self = Self { shown: self.shown, share: self.shown, ..Self::default() };
    }

    /// Processes a report of a compensated joint. A report that is not finite is ignored.
    pub fn step(&mut self, sample: &TorqueSample, joint: &PassivityParameters) {
        let TorqueSample { velocity_rad_s, command_nm, compensation_nm, friction_nm } = *sample;
        let sum = velocity_rad_s + command_nm + compensation_nm + friction_nm;
        if !sum.is_finite() {
            return;
        }
        let square = velocity_rad_s * velocity_rad_s;
        if self.work.is_nan() {
            (self.work, self.square) = (square, square);
        }
        let command_power = command_nm * velocity_rad_s;
        let half_inertia = 0.5 * joint.inertia_kg_m2;
        let left = (0.5 * (1.0 - joint.scale)).max(LEAST_COMMAND);
        if command_nm.abs() >= left * friction_nm.abs() {
            self.quiet_s = 0.0;
            let is_alone = command_nm.abs() >= friction_nm.abs();
            self.work = if is_alone || half_inertia == 0.0 {
                self.work.max(square)
            } else {
                let risen = command_power.abs() * (WORK_FACTOR * REPORT_PERIOD_S) / half_inertia;
                // No more than at the largest speed: a tiny inertia would make it infinite, and it has to fade.
                (self.work + risen).min(joint.velocity_max_rad_s * joint.velocity_max_rad_s)
            };
        } else {
            self.quiet_s = (self.quiet_s + REPORT_PERIOD_S).min(QUIET_S);
        }
        let is_quiet = self.quiet_s >= QUIET_S;
        if is_quiet {
            self.work *= KEPT_WORK;
        }
        self.work -= ENDED_WORK * (self.work - square).max(0.0);
        let stored = half_inertia * (square - self.square) * (1.0 / REPORT_PERIOD_S);
        self.square = square;
        let compensation_power = compensation_nm * velocity_rad_s;
        let lost = command_power + compensation_power - stored;
        self.means.take(lost, compensation_power, (friction_nm * velocity_rad_s).abs());
        self.evaluate_stroke(velocity_rad_s, is_quiet, joint.scale);
        let largest = SPEED_SHARE * joint.velocity_max_rad_s;
        let left = 1.0 - (square - NOISE_FACTOR * self.work) / (largest * largest);
        self.share = self.shown * (left / (1.0 - FULL_SHARE)).clamp(0.0, 1.0);
    }

    /// Compares what the joint loses with what the set leaves it.
    fn evaluate_stroke(&mut self, velocity_rad_s: f32, is_quiet: bool, scale: f32) {
        let is_sliding = velocity_rad_s.abs() > MIN_SLIDING_RAD_S;
        let direction = if is_sliding { velocity_rad_s.signum() } else { 0.0 };
        let is_same = is_sliding && direction == self.direction;
        self.direction = direction;
        if !(is_same && is_quiet) {
            self.stroke_s = 0.0;
        }
        if !is_sliding {
            return;
        }
        let means = &self.means;
        let is_driven = 0.5 * (1.0 + scale) * means.lost < means.compensation;
        if is_driven && is_quiet {
            self.stroke_s += REPORT_PERIOD_S;
            if self.stroke_s > STROKE_S {
                self.shown = (self.shown - FALL).max(LEAST_SHARE.min(self.shown));
            }
        } else if !is_driven && means.lost > self.shown * means.model {
            self.shown = (self.shown + RISE).min(1.0);
        }
    }
}

#[cfg(test)]
#[path = "passivity_tests.rs"]
mod tests;
