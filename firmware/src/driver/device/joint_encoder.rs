//! The encoder at the joint's side of the gear: position of the joint, and the difference of the two sides.
//!
//! ```text
//! motor, its encoder -> gear with play and torsion -> joint, its encoder
//!        6064h                                              60E4h:1
//! ```
//! It measures and compares. Commutation, velocity and position loop use the motor's encoder, so that the joint can be
//! driven and stopped without it. The board latches its frame when a report of the current loop comes.
//!
//! | fault | reaction |
//! |---|---|
//! | no frame, wrong CRC, error bit | no position, warning (`encoder-magnet`) until 0.5 s after the last |
//! | one to three frames in a row that jump | the same |
//! | stuck, reversed, jump that stays, slipped or broken coupling | while armed: `following-error`, with its reaction |
//!
//! A stuck encoder and a broken coupling look the same at rest, so that both stop the joint. The difference counts from
//! the arming on, and includes play and torsion of the gear.

use super::Device;
use crate::control::LoopFlags;
use crate::control::transform::{RAD_PER_UNIT, binary_angle};
use crate::driver::angle;
use crate::driver::loop_data::LoopReport;
use crate::node::dictionary::records::JointEncoderObject;
use crate::parameter_set::ParameterSet;
use crate::sensors::SensorParameters;
use crate::sensors::biss::{BissEncoder, WORDS};
use crate::sensors::evaluation::Evaluation;
use embedded_storage::nor_flash::NorFlash;

/// 60E4h:1 without a position.
pub const NO_POSITION: i32 = i32::MIN;

/// Time from the sample of a report to the latch of the frame, s: two periods until the report is sent, conversion and
/// interrupt (28 us), and up to a period until the background has time.
const LATCHED_AFTER_S: f32 = 150e-6;
/// Share of the window by which the difference may change from one frame to the next.
const JUMP_SHARE: f32 = 0.25;
/// Frames in a row that jump until the last one is taken.
const MOST_JUMPS: u8 = 3;
/// Reports for which a warning lasts.
const WARNING_REPORTS: u16 = 500;

/// States in 2032h:2 and in byte 4 of an emergency.
mod state {
    /// The last frame is valid, or there is no encoder.
    pub const VALID: u8 = 0;
    /// The last report had no valid frame.
    pub const MISSING: u8 = 1;
    /// The last frame jumps.
    pub const JUMPS: u8 = 2;
    /// The two sides differ by more than the window.
    pub const APART: u8 = 3;
}

/// Angles of both sides at the last valid frame, 2^-32 turns.
#[derive(Clone, Copy, Debug)]
struct Sides {
    /// Angle of the joint's encoder, and of the joint with its turns.
    angle: u32,
    joint: i64,
    /// Rotation of the rotor.
    turned: i64,
    /// Joint less motor, rad.
    apart_rad: f32,
}

with_defaults! {
    /// State of the joint's encoder.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct JointEncoder {
        /// Words of the last frame; `None` if there is no encoder at the joint's side.
        pub(super) words: Option<[u16; WORDS]>,
        sides: Option<Sides>,
        /// Rotor's angle of the last report, and its rotation since the first one, 2^-32 turns.
        rotor: u32,
        turned: i64,
        /// Position, rad; NaN while it is not valid.
        position_rad: f32 = f32::NAN,
        /// Joint less motor at the arming, rad; NaN before the first valid frame after it.
        armed_rad: f32 = f32::NAN,
        /// Joint less motor since the arming, rad.
        difference_rad: f32,
        was_driving: bool,
        jumps: u8,
        warning_left: u16,
        state: u8 = state::VALID,
    }
}

impl JointEncoder {
    /// 60E4h:1, 1e-6 rad.
    pub(crate) fn position(&self) -> i32 {
        if self.position_rad.is_nan() { NO_POSITION } else { angle::micro(self.position_rad) }
    }

    /// 2032h.
    pub(crate) const fn object(&self) -> JointEncoderObject {
        JointEncoderObject {
            difference_rad: self.difference_rad.to_bits(),
            state: self.state as u32,
        }
    }

    /// Returns the state, as 2032h:2.
    pub(super) const fn state(&self) -> u8 {
        self.state
    }

    /// Returns true if frames were missing or jumped in the last 0.5 s.
    pub(super) const fn has_warning(&self) -> bool {
        self.warning_left > 0
    }

    /// Returns true if the two sides differ by more than the window.
    pub(super) const fn are_sides_apart(&self) -> bool {
        self.state == state::APART
    }

    /// Ends a report without a valid frame.
    const fn reject(&mut self, state: u8) {
        self.position_rad = f32::NAN;
        self.state = state;
        self.warning_left = WARNING_REPORTS;
    }

    /// Follows the rotor to a report. `drives`: the joint is armed, and its motor is not measured.
    fn follow_rotor(&mut self, report: &LoopReport, drives: bool) {
        self.turned += i64::from(report.rotor_angle.wrapping_sub(self.rotor) as i32);
        self.rotor = report.rotor_angle;
        self.warning_left = self.warning_left.saturating_sub(1);
        if report.loop_flags.contains(LoopFlags::ENCODER_LOST) {
            // Nothing to compare with: the next frame begins anew.
            self.sides = None;
        }
        if drives && !self.was_driving {
            self.armed_rad = f32::NAN;
        }
        self.was_driving = drives;
    }

    /// Returns the angle of the joint in the last frame, 2^-32 turns; `None` without a valid one.
    fn angle(&mut self, sensors: &SensorParameters) -> Option<u32> {
        let bits = [sensors.joint_encoder_bits, sensors.joint_encoder_turn_bits];
        let [bits, turn_bits] = bits.map(|bits| bits as u32);
        let angle = match BissEncoder::new(bits, turn_bits).evaluate(self.words) {
            Evaluation::Angle(angle) => angle,
            Evaluation::Doubtful(angle) => {
                self.warning_left = WARNING_REPORTS;
                angle
            }
            Evaluation::Missing | Evaluation::Contradiction => return None,
        };
        let is_reversed = sensors.joint_encoder_direction < 0.0;
        let angle = if is_reversed { angle.wrapping_neg() } else { angle };
        Some(angle.wrapping_add(binary_angle(sensors.joint_encoder_offset_rad)))
    }

    /// Evaluates the frame of a report; `drives` as in [`Self::follow_rotor`].
    fn step(&mut self, report: &LoopReport, set: &ParameterSet, drives: bool) {
        self.follow_rotor(report, drives);
        let (sensors, motor) = (&set.sensors, &set.motor);
        let Some(angle) = self.angle(sensors) else { return self.reject(state::MISSING) };
        let joint_per_motor = motor.joint_direction / motor.gear_ratio;
        let joint = match self.sides {
            Some(last) => {
                // The motor shows the turns that missing frames do not.
                let expected = ((self.turned - last.turned) as f32 * joint_per_motor) as i64;
                let off = angle.wrapping_sub(last.angle).wrapping_sub(expected as u32) as i32;
                last.joint + expected + i64::from(off)
            }
            None => i64::from(angle as i32),
        };
        let position_rad = joint as f32 * RAD_PER_UNIT - LATCHED_AFTER_S * report.velocity_rad_s;
        let apart_rad = position_rad - self.turned as f32 * (RAD_PER_UNIT * joint_per_motor);
        let window_rad = sensors.joint_encoder_window_rad;
        // Without a window nothing is compared.
        let window_rad = if window_rad > 0.0 { window_rad } else { f32::INFINITY };
        if let Some(last) = self.sides
            && self.jumps < MOST_JUMPS
            && (apart_rad - last.apart_rad).abs() > JUMP_SHARE * window_rad
        {
            self.jumps += 1;
            return self.reject(state::JUMPS);
        }
        self.jumps = 0;
        self.sides = Some(Sides { angle, joint, turned: self.turned, apart_rad });
        self.position_rad = position_rad;
        if self.armed_rad.is_nan() {
            self.armed_rad = apart_rad;
        }
        self.difference_rad = apart_rad - self.armed_rad;
        let is_apart = drives && self.difference_rad.abs() > window_rad;
        self.state = if is_apart { state::APART } else { state::VALID };
    }
}

impl<F: NorFlash> Device<F> {
    /// Evaluates the frame of a report. A joint in HIL has no side of its own.
    #[inline(never)]
    pub(super) fn step_joint_encoder(&mut self) {
        let words = self.joint_encoder.words;
        if words.is_none() || self.base.settings.is_in_hil() {
            self.joint_encoder = JointEncoder { words, ..JointEncoder::default() };
            return;
        }
        let drives = self.base.is_bridge_in_use() && !self.motion.is_measuring_motor();
        let (report, set) = (self.base.report(), self.base.set());
        self.joint_encoder.step(report, set, drives);
    }
}
