//! Position control of the device: CSP, PP, homing at a stop, and the software position limits.
//!
//! ```text
//! velocity = reference velocity + gain (reference position - position),  limited by 607Dh and 6080h
//! ```
//! The position loop runs a step per report, above the velocity loop, once a millisecond. Its reference comes from
//! [`crate::driver::trajectory`]. The friction compensator receives the velocity of the sum.
//!
//! *Limits* (607Dh) act on a known position in every mode. The speed towards a limit is at most the one from which
//! 6084h stops at the limit. In torque mode the velocity loop's gain bounds the current accordingly.
//!
//! *Targets*: in CSP the joint holds its position until the first target after enabling, so that an old target moves
//! nothing.

use super::velocity::VelocityTarget;
use super::{Motion, Refused};
use crate::control::velocity_loop::TrackedVelocity;
use crate::driver::angle::{Angle, micro};
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::driver::profile::{self, Homing, SetPoint};
use crate::driver::trajectory::{Interpolation, MoveLimits, Reference};
use crate::joint_node::JointBase;
use crate::node::sdo::Abort;
use compensator_core::text;

/// Share of the homing torque that counts as reached: the loop's own limit.
const CONTACT_SHARE: f32 = 0.95;
/// Speed of a joint that stands at its stop, rad/s.
const CONTACT_RAD_S: f32 = 0.02;
/// Reports until a new position is in use: commands and report, with margin.
const POSITION_REPORTS: u8 = 5;
/// Speed at which a joint beyond its limit returns, rad/s.
const RETURN_RAD_S: f32 = 0.5;

/// Progress of homing at a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum HomingStep {
    #[default]
    Idle,
    /// Moves to the stop, from this position, rad from the arbitrary zero; `still_ms` at the stop.
    Seeks { from_rad: f32, still_ms: u16 },
    /// The position is set, and takes effect in this number of reports.
    Sets(u8),
    /// Moves to position 0.
    Returns,
}

/// State of the position loop.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PositionControl {
    /// The reference follows from the present position.
    has_begun: bool,
    reference: Reference,
    interpolation: Interpolation,
    /// A target was received since the drive was enabled (CSP).
    has_target: bool,
    homing: HomingStep,
    error_rad: f32,
    /// Time for which the following error has exceeded its window, ms.
    exceeded_ms: u32,
    /// Time for which the joint is within the window of its target, ms.
    reached_ms: u32,
    /// A limit acts on the reference.
    pub is_limited: bool,
    /// A limit changed the last target (CSP).
    is_target_limited: bool,
}

impl Motion {
    /// Returns true if the position loop commands the velocity loop.
    #[inline(never)]
    pub(crate) fn is_in_position_control(&self, joint: &JointBase) -> bool {
        let is_mode = match self.profile.mode {
            profile::CSP | profile::PP => true,
            profile::HOMING => self.profile.homes_at_stop(),
            _ => false,
        };
        is_mode && !joint.settings.is_in_hil()
    }

    /// Restarts position control, at every arming.
    pub(crate) fn begin_position(&mut self) {
        self.position = PositionControl::default();
        self.profile.set_points = SetPoint::default();
        if self.profile.homing == Homing::Running {
            self.profile.homing = Homing::Failed;
        }
    }

    /// Interrupts the reference while something else moves the joint; it then begins at the present position.
    pub(crate) fn interrupt_position(&mut self) {
        self.position.has_begun = false;
        self.position.has_target = false;
        self.position.is_target_limited = false;
    }

    /// Ends the course of a mode; that of the next one begins at the present position.
    pub(crate) fn end_position_course(&mut self) {
        self.interrupt_position();
        self.position.homing = HomingStep::Idle;
    }

    /// Returns the current limit of a step as a share of that of 6072h.
    #[inline(never)]
    pub(crate) fn torque_share(&self, joint: &JointBase) -> f32 {
        match self.position.homing {
            HomingStep::Seeks { .. } if self.is_in_position_control(joint) => {
                f32::from(joint.settings.drive.homing_torque) * 1e-3
            }
            _ => 1.0,
        }
    }

    /// Runs a step of the position loop.
    pub(crate) fn position_target(&mut self, joint: &JointBase) -> VelocityTarget {
        let actual_rad = joint.position_rad();
        if !self.position.has_begun {
            let velocity_rad_s = self.velocity.command().reference_rad_s;
            let reference = Reference { position: Angle::from_rad(actual_rad), velocity_rad_s };
            self.position.reference = reference;
            self.position.interpolation = Interpolation::begin(reference);
            self.position.has_begun = true;
        }
        let before = self.position.reference;
        self.position.is_limited = false;
        match self.profile.mode {
            profile::CSP => self.step_csp(joint),
            profile::PP => self.step_pp(joint),
            _ => {
                if let Some(target) = self.step_homing(joint) {
                    self.interrupt_position();
                    return target;
                }
            }
        }
        let reference = self.position.reference;
        // The report shows the joint at the end of the step before, where that step's reference was due.
        let error_rad = before.position - Angle::from_rad(actual_rad);
        self.watch_following(joint, error_rad);
        let gain = joint.settings.drive.position_gain as f32 * 1e-3;
        let most = self.max_speed_rad_s(joint);
        let offset =
            if self.profile.mode == profile::CSP { self.velocity_offset_rad_s() } else { 0.0 };
        let wanted = (reference.velocity_rad_s + offset + gain * error_rad).clamp(-most, most);
        let velocity_rad_s = self.bounded_velocity(joint, wanted);
        let change_rad_s = reference.velocity_rad_s - before.velocity_rad_s;
        VelocityTarget::Track(TrackedVelocity { velocity_rad_s, change_rad_s })
    }

    fn step_csp(&mut self, joint: &JointBase) {
        let late =
            self.move_limits(joint.settings.drive.quick_deceleration, self.max_speed_rad_s(joint));
        if self.position.has_target {
            self.position.reference = self.position.interpolation.step(&late, REPORT_PERIOD_S);
        } else {
            self.slow_down(&late);
            self.position.interpolation = Interpolation::begin(self.position.reference);
        }
    }

    /// Brings the reference to rest.
    fn slow_down(&mut self, limits: &MoveLimits) {
        let at = self.position.reference.position;
        self.position.reference.move_towards(at, limits, REPORT_PERIOD_S);
    }

    fn step_pp(&mut self, joint: &JointBase) {
        let drive = &joint.settings.drive;
        let limits = MoveLimits {
            speed_rad_s: (drive.profile_velocity as f32 * 1e-6)
                .min(self.profile_speed_rad_s(joint)),
            acceleration_rad_s2: drive.acceleration as f32 * 1e-6,
            deceleration_rad_s2: drive.deceleration as f32 * 1e-6,
        };
        let (window_rad, window_ms) =
            (drive.position_window as f32 * 1e-6, u32::from(drive.position_time_ms));
        let wanted = self.profile.set_points.active_micro_rad.map(Angle::from_micro_rad);
        let target = wanted
            .map_or(self.position.reference.position, |wanted| self.bounded_target(joint, wanted));
        self.position.is_limited = wanted.is_some_and(|wanted| wanted != target);
        let has_ended = self.position.reference.move_towards(target, &limits, REPORT_PERIOD_S);
        let error_rad = target - Angle::from_rad(joint.position_rad());
        let is_near = has_ended && error_rad.abs() <= window_rad;
        let position = &mut self.position;
        position.reached_ms = if is_near { position.reached_ms.saturating_add(1) } else { 0 };
        let is_reached = is_near && position.reached_ms >= window_ms;
        // The next set-point begins when the move to this one has ended.
        if self.profile.set_points.step(has_ended, is_reached) {
            self.position.reached_ms = 0;
        }
    }

    /// Runs a step of homing at a stop. Returns the velocity if the reference does not give it.
    fn step_homing(&mut self, joint: &JointBase) -> Option<VelocityTarget> {
        let drive = joint.settings.drive;
        let acceleration = drive.homing_acceleration as f32 * 1e-6;
        let gains = self.velocity.gains().with_acceleration(acceleration, REPORT_PERIOD_S);
        match self.position.homing {
            HomingStep::Idle => {
                let limits =
                    self.move_limits(drive.homing_acceleration, self.max_speed_rad_s(joint));
                self.slow_down(&limits);
                None
            }
            HomingStep::Seeks { from_rad, still_ms } => {
                if (joint.report().turned_rad - from_rad).abs() > drive.homing_way as f32 * 1e-6 {
                    self.end_homing(Homing::Failed);
                    return None;
                }
                let way = if self.profile.homing_method == -1 { -1.0 } else { 1.0 };
                let share = self.torque_share(joint) * joint.supervisor.current_share();
                let limit_a = joint.rated_current_a() * self.profile.max_share() * share;
                let is_still = joint.report().velocity_rad_s.abs() < CONTACT_RAD_S
                    && way * self.velocity.command().current_a >= CONTACT_SHARE * limit_a;
                let still_ms = if is_still { still_ms + 1 } else { 0 };
                if still_ms < drive.homing_time_ms {
                    self.position.homing = HomingStep::Seeks { from_rad, still_ms };
                    let target_rad_s = way * drive.homing_speed as f32 * 1e-6;
                    return Some(VelocityTarget::Slew { gains, target_rad_s });
                }
                // The torque ends; the position at the stop is minus the offset.
                self.begin_velocity(joint, joint.set().motor.acceleration_max_rad_s2);
                let home_rad = -Angle::from_micro_rad(self.profile.home_offset_micro_rad).rad();
                self.orders.home_rad = Some(home_rad);
                self.position.homing = HomingStep::Sets(POSITION_REPORTS);
                Some(VelocityTarget::Slew { gains, target_rad_s: 0.0 })
            }
            HomingStep::Sets(left) => {
                self.position.homing =
                    if left == 0 { HomingStep::Returns } else { HomingStep::Sets(left - 1) };
                Some(VelocityTarget::Slew { gains, target_rad_s: 0.0 })
            }
            HomingStep::Returns => {
                let speed_rad_s = drive.homing_return_speed as f32 * 1e-6;
                let limits = self.move_limits(drive.homing_acceleration, speed_rad_s);
                if self.position.reference.move_towards(Angle::default(), &limits, REPORT_PERIOD_S)
                {
                    self.end_homing(Homing::Attained);
                }
                None
            }
        }
    }

    fn end_homing(&mut self, result: Homing) {
        self.position.homing = HomingStep::Idle;
        self.profile.homing = result;
        if result == Homing::Failed {
            let why = text!("homing found no stop within 2031h:3");
            self.orders.refusal = Some(Refused::new(Abort::State, why));
        }
    }

    /// Starts homing at a stop.
    pub(crate) fn begin_homing(&mut self, joint: &JointBase) {
        let from_rad = joint.report().turned_rad;
        self.position.homing = HomingStep::Seeks { from_rad, still_ms: 0 };
        self.profile.homing = Homing::Running;
    }

    /// Ends homing if the master withdraws its command.
    pub(crate) fn watch_homing(&mut self) {
        if self.profile.homing == Homing::Running && !self.profile.wants_homing() {
            self.position.homing = HomingStep::Idle;
            self.profile.homing = Homing::NotBegun;
        }
    }

    fn move_limits(&self, acceleration: u32, speed_rad_s: f32) -> MoveLimits {
        let acceleration = acceleration as f32 * 1e-6;
        MoveLimits {
            speed_rad_s,
            acceleration_rad_s2: acceleration,
            deceleration_rad_s2: acceleration,
        }
    }

    fn watch_following(&mut self, joint: &JointBase, error_rad: f32) {
        let window = joint.settings.drive.following_window;
        let exceeds = window != u32::MAX && error_rad.abs() > window as f32 * 1e-6;
        let position = &mut self.position;
        position.error_rad = error_rad;
        position.exceeded_ms = if exceeds { position.exceeded_ms.saturating_add(1) } else { 0 };
    }

    /// Returns the time for which the following error has exceeded its window, ms; 0 without position control.
    #[inline(never)]
    pub(crate) fn following_exceeded_ms(&self, joint: &JointBase) -> u32 {
        let is_controlled = self.is_in_position_control(joint)
            && self.profile.mode != profile::HOMING
            && self.position.has_begun;
        if is_controlled { self.position.exceeded_ms } else { 0 }
    }

    /// Returns true if the following error has exceeded its window for the time of 6066h.
    pub(crate) fn has_following_error(&self, joint: &JointBase) -> bool {
        let most_ms = joint.settings.drive.following_time_ms;
        self.following_exceeded_ms(joint) > u32::from(most_ms)
    }

    /// Returns the limits of 607Dh, if they act.
    fn position_limits(&self, joint: &JointBase) -> Option<[Angle; 2]> {
        let drive = &joint.settings.drive;
        let is_known = !joint.settings.is_in_hil()
            && !joint.report().position_rad.is_nan()
            && self.profile.mode != profile::HOMING;
        (is_known && drive.position_min < drive.position_max)
            .then(|| [drive.position_min, drive.position_max].map(Angle::from_micro_rad))
    }

    /// Returns a target within the limits.
    #[inline(never)]
    fn bounded_target(&self, joint: &JointBase, wanted: Angle) -> Angle {
        let Some([least, most]) = self.position_limits(joint) else { return wanted };
        wanted.max(least).min(most)
    }

    /// Returns the velocities, rad/s, between which the joint stops at its limits.
    fn velocity_bounds(&self, joint: &JointBase) -> Option<[f32; 2]> {
        let [least, most] = self.position_limits(joint)?;
        let at = Angle::from_rad(joint.report().position_rad);
        let drive = &joint.settings.drive;
        let deceleration = drive.deceleration as f32 * 1e-6;
        let gain = drive.position_gain as f32 * 1e-3;
        let speed = |left_rad: f32| {
            if left_rad > 0.0 {
                // Near the limit the position loop is slower than the ramp.
                libm::sqrtf(2.0 * deceleration * left_rad).min(gain * left_rad)
            } else {
                (gain * left_rad).max(-RETURN_RAD_S)
            }
        };
        Some([-speed(at - least), speed(most - at)])
    }

    /// Returns the velocities, rad/s, to which torque modes are limited: those of the position limits, and in mode 4 6080h.
    fn torque_mode_bounds(&self, joint: &JointBase) -> Option<[f32; 2]> {
        let bounds = self.velocity_bounds(joint);
        if self.profile.mode == profile::CST {
            return bounds;
        }
        let speed_rad_s = self.max_speed_rad_s(joint);
        let [least, most] = bounds.unwrap_or([-speed_rad_s, speed_rad_s]);
        Some([least.max(-speed_rad_s), most.min(speed_rad_s)])
    }

    /// Returns a velocity within the limits, rad/s.
    pub(crate) fn bounded_velocity(&mut self, joint: &JointBase, wanted_rad_s: f32) -> f32 {
        let Some([least, most]) = self.velocity_bounds(joint) else { return wanted_rad_s };
        let bounded = wanted_rad_s.max(least).min(most);
        self.position.is_limited |= bounded != wanted_rad_s;
        bounded
    }

    /// Returns a current of torque mode that does not drive the joint beyond its limits, A.
    pub(crate) fn bounded_current_a(&self, joint: &JointBase, wanted_a: f32) -> f32 {
        let Some([lower_a, upper_a]) = self.current_bounds(joint) else { return wanted_a };
        wanted_a.max(lower_a).min(upper_a)
    }

    /// Returns the currents, A, with which the velocity loop would keep the joint within its limits.
    fn current_bounds(&self, joint: &JointBase) -> Option<[f32; 2]> {
        if !matches!(self.profile.mode, profile::CST | profile::TQ) {
            return None;
        }
        let motor = &joint.set().motor;
        let constant = joint.set().friction.compensator.torque_constant_nm_per_a;
        let deceleration = joint.settings.drive.deceleration as f32 * 1e-6;
        let braking_a = motor.inertia_kg_m2 * deceleration / constant;
        let rated_a = joint.rated_current_a();
        let [least, most] = self.torque_mode_bounds(joint)?;
        let (gain, at) = (motor.velocity_gain_a_s_per_rad, joint.report().velocity_rad_s);
        // The current of the ramp is needed only by a joint that moves towards the limit.
        let ramp =
            |towards: f32| (braking_a * (towards / CONTACT_RAD_S).clamp(0.0, 1.0)).min(rated_a);
        let upper_a = gain * (most - at) - ramp(at);
        let lower_a = gain * (least - at) + ramp(-at);
        Some([lower_a.clamp(-rated_a, rated_a), upper_a.clamp(-rated_a, rated_a)])
    }

    /// Returns true if a position limit acts.
    pub(crate) fn is_position_limited(&self, joint: &JointBase) -> bool {
        let wanted_a = self.torque_mode_current_a(joint);
        let by_current = self.bounded_current_a(joint, wanted_a) != wanted_a;
        by_current || self.position.is_limited || self.position.is_target_limited
    }

    /// 607Ah.
    pub(crate) fn set_target_position(&mut self, joint: &JointBase, target_micro_rad: i32) {
        self.profile.target_position_micro_rad = target_micro_rad;
        if self.profile.mode != profile::CSP
            || !joint.supervisor.is_armed()
            || !self.position.has_begun
        {
            return;
        }
        let wanted = Angle::from_micro_rad(target_micro_rad);
        let target = self.bounded_target(joint, wanted);
        let steps = joint.settings.drive.interpolation_ms();
        let speed = self.max_speed_rad_s(joint);
        let is_slow = self.position.interpolation.set_target(target, steps, speed, REPORT_PERIOD_S);
        self.position.has_target = true;
        self.position.is_target_limited = target != wanted || !is_slow;
    }

    /// Takes a set-point of mode 1.
    pub(crate) fn take_set_point(&mut self) {
        let present_micro_rad = self.position.reference.position.micro_rad();
        self.profile.set_points.take(self.profile.set_point_offer(), present_micro_rad);
        self.position.reached_ms = 0;
    }

    /// 6062h, 1e-6 rad.
    pub(crate) fn position_demand(&self, joint: &JointBase) -> i32 {
        let begun = self.is_in_position_control(joint) && self.position.has_begun;
        if begun { self.position.reference.position.micro_rad() } else { joint.actual_position() }
    }

    /// 60F4h, 1e-6 rad.
    pub(crate) fn following_error(&self) -> i32 {
        micro(self.position.error_rad)
    }
}
