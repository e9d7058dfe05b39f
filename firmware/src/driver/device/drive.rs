//! The device as a drive of CiA 402: what its objects stand for. The state machine is [`profile`]'s.

use super::{Command, Device, Message, Source, State};
use crate::driver::profile::{self, Homing, Request, status};
use crate::node::sdo::Abort;
use crate::supervisor::Code;
use compensator_core::can::Frame;
use compensator_core::parameters::Digits;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Rated current, A, and torque, Nm: what the current limits make at the joint.
    pub(super) fn rated(&self) -> (f32, f32) {
        let (motor, joint) = (&self.set().motor, &self.set().friction.compensator);
        let current_a = motor.current_limit_a.min(joint.current_limit_a);
        (current_a, current_a * joint.torque_constant_nm_per_a)
    }

    /// 6075h, mA, and 6076h, mNm.
    pub(in crate::driver) fn ratings(&self) -> [u32; 2] {
        let (current_a, torque_nm) = self.rated();
        [(current_a * 1e3) as u32, (torque_nm * 1e3) as u32]
    }

    /// 6077h: torque of the measured current, thousandths of the rated one; a joint in HIL has none.
    pub(in crate::driver) fn actual_permille(&self) -> i16 {
        (self.report.motor_torque_nm / self.rated().1 * 1e3) as i16
    }

    /// 6064h, 1e-6 rad; the least number where it is not known.
    pub(in crate::driver) fn actual_position(&self) -> i32 {
        let position_rad = f32::from_bits(self.measured().position_rad);
        if position_rad.is_nan() { i32::MIN } else { micro(position_rad).max(i32::MIN + 1) }
    }

    /// 606Ch, 1e-6 rad/s; 0 where it is not known.
    pub(in crate::driver) fn actual_velocity(&self) -> i32 {
        micro(f32::from_bits(self.measured().velocity_rad_s))
    }

    /// 603Fh: the emergency code of the first fault; 0 for none.
    pub(in crate::driver) fn error_code(&self) -> u16 {
        self.supervisor.faults().iter().next().map_or(0, |code| code.info().emergency)
    }

    /// 6041h.
    pub(in crate::driver) fn statusword(&self) -> u16 {
        let when = |bit: u16, is_so: bool| if is_so { bit } else { 0 };
        let level_v = self.supervisor.thresholds().bus_undervoltage_v;
        let powered = match self.settings.source {
            Source::Sensors => self.report.bus_voltage_v.is_some_and(|bus_v| bus_v > level_v),
            Source::Bus => true,
        };
        let limits = self.supervisor.limits();
        let (_, too_fast) = self.profile.target_rad_s(self.max_speed_rad_s());
        let too_fast = self.profile.mode == profile::CSV && too_fast;
        let known = !f32::from_bits(self.measured().position_rad).is_nan();
        self.profile.state_bits(self.is_faulty())
            | self.profile.homing_bits(self.stands())
            | status::REMOTE
            | when(status::VOLTAGE_ENABLED, powered)
            | when(status::WARNING, limits.iter().next().is_some())
            | when(status::POSITION_KNOWN, known)
            | when(status::INTERNAL_LIMIT, limits.contains(Code::CurrentLimited) || too_fast)
    }

    fn is_faulty(&self) -> bool {
        self.supervisor.state() == State::Fault
    }

    /// 6060h.
    pub(in crate::driver) fn set_mode(&mut self, mode: i8) -> Result<(), Abort> {
        if ![0, profile::HOMING, profile::CSV, profile::CST].contains(&mode) {
            let why = format_args!(
                "modes_of_operation = {mode}: must be 0 (none), 6 (homing), 9 (CSV) or 10 (CST)"
            );
            return Err(self.staging.refuse(Abort::Value, why));
        }
        if [profile::CSV, profile::HOMING].contains(&mode) && self.settings.source == Source::Bus {
            let why = format_args!(
                "a joint fed by the bus drives nothing and has no position of its own: mode {mode} needs its own sensors (2001h:1)"
            );
            return Err(self.staging.refuse(Abort::State, why));
        }
        self.profile.mode = mode;
        self.profile.homing = Homing::NotBegun;
        self.profile.target_permille = 0;
        self.profile.target_micro_rad_s = 0;
        self.live.forget_command();
        Ok(())
    }

    /// 6040h. Says no where the supervisor does.
    pub(in crate::driver) fn set_controlword(&mut self, controlword: u16) -> Result<(), Abort> {
        if !self.profile.is_on() {
            self.profile.controlword = controlword;
            return Ok(());
        }
        self.sign_of_life(self.now_us);
        let (fault, armed) = (self.is_faulty(), self.is_armed());
        match self.profile.control(controlword, fault, armed) {
            Request::None => Ok(()),
            Request::Arm => self.request(1).inspect_err(|_| self.profile.refused()),
            Request::Disarm => self.request(0),
            Request::ClearFaults => self.request(2),
            Request::Home => {
                self.home_here();
                Ok(())
            }
        }
    }

    /// Whether the joint stands, as far as a homing asks.
    fn stands(&self) -> bool {
        self.report.velocity_rad_s.abs() <= profile::STANDS_RAD_S
    }

    /// Takes the place where the joint stands for its home; where it moves, the statusword says that homing failed, and 2028h why.
    fn home_here(&mut self) {
        let home_rad = -(f64::from(self.profile.home_offset_micro_rad) * 1e-6) as f32;
        let homed = self.stands() && self.set_position(home_rad).is_ok();
        self.profile.homing = if homed { Homing::Attained } else { Homing::Failed };
        if !homed {
            let why = format_args!(
                "homing takes the place where the joint stands, and it moves (more than {} rad/s)",
                Digits(profile::STANDS_RAD_S.into())
            );
            let _ = self.staging.refuse(Abort::State, why);
        }
    }

    /// 6098h.
    pub(in crate::driver) fn set_homing_method(&mut self, method: i8) -> Result<(), Abort> {
        if !profile::HOMING_METHODS.contains(&method) {
            let why = format_args!(
                "homing_method = {method}: must be 37 or 35 (the place where the joint stands); it has no switches"
            );
            return Err(self.staging.refuse(Abort::Value, why));
        }
        self.profile.homing_method = method;
        Ok(())
    }

    /// 6071h.
    pub(in crate::driver) fn set_target(&mut self, target_permille: i16) {
        self.profile.target_permille = target_permille;
        self.sign_of_life(self.now_us);
    }

    /// 60FFh.
    pub(in crate::driver) fn set_target_velocity(&mut self, target_micro_rad_s: i32) {
        self.profile.target_micro_rad_s = target_micro_rad_s;
        self.sign_of_life(self.now_us);
    }

    /// Receive PDO 1: controlword, target torque and target velocity; a master that knows no velocity leaves it out.
    pub(in crate::driver) fn take_drive_frame(&mut self, frame: &Frame, now_us: u64) {
        let (velocity, [a, b, c, d]) = match *frame.data() {
            [a, b, c, d] => (None, [a, b, c, d]),
            [a, b, c, d, w, x, y, z] => (Some(i32::from_le_bytes([w, x, y, z])), [a, b, c, d]),
            _ => return self.counters.count_wrong_length(),
        };
        self.now_us = now_us;
        self.profile.target_permille = i16::from_le_bytes([c, d]);
        if let Some(velocity) = velocity {
            self.profile.target_micro_rad_s = velocity;
        }
        if self.profile.is_on() {
            self.sign_of_life(now_us);
        }
        // A refusal is told as an object is (2028h), and seen in the statusword.
        let _ = self.set_controlword(u16::from_le_bytes([a, b]));
    }

    /// The master lives: the target it last gave is young. Where the profile has not the say, this is nothing.
    pub(in crate::driver) fn sign_of_life(&mut self, now_us: u64) {
        if !self.profile.is_on() {
            return;
        }
        // A velocity is made a current at each report; what counts here is that the master lives.
        let by_torque = self.profile.mode == profile::CST;
        let current_a = if by_torque { self.profile.target_share() * self.rated().0 } else { 0.0 };
        self.drive_counter = self.drive_counter.wrapping_add(1);
        let command = Command::new(current_a, f32::NAN, self.drive_counter);
        self.hear(&Message::Command(self.settings.node, command), now_us);
    }

    /// Transmit PDO 6: statusword, torque, position.
    pub(super) fn send_drive_frame(&mut self) {
        let [a, b] = self.statusword().to_le_bytes();
        let [c, d] = self.actual_permille().to_le_bytes();
        let [e, f, g, h] = self.actual_position().to_le_bytes();
        self.transmit(super::pdos::DRIVE_SLOT, &[a, b, c, d, e, f, g, h]);
    }
}

/// In millionths; a cast holds to the range, and takes NaN for 0.
pub(super) fn micro(number: f32) -> i32 {
    (f64::from(number) * 1e6) as i32
}
