//! Motion within the device: what it sees, what it orders, and the objects whose writing needs more than motion.

use super::Device;
use crate::driver::motion::{Motion, Refused, Target};
use crate::driver::profile::DriveRequest;
use crate::driver::profile::stop::{StopCause, StopReaction};
use crate::joint_node::JointBase;
use crate::node::sdo::Abort;
use compensator_core::can::Frame;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Runs a step of motion, and executes what it orders.
    pub(super) fn move_by(&mut self, step: fn(&mut Motion, &JointBase)) {
        self.move_with(&mut |motion, joint| step(motion, joint));
    }

    /// Runs a step of motion with arguments.
    // One copy for all steps: each would take 100 bytes.
    #[inline(never)]
    pub(super) fn move_with(&mut self, step: &mut dyn FnMut(&mut Motion, &JointBase)) {
        step(&mut self.motion, &self.base);
        self.execute_orders();
    }

    /// Reports a refusal.
    #[inline(never)]
    pub(crate) fn refuse(&mut self, Refused { abort, why }: Refused) -> Abort {
        self.base.refuse(abort, why)
    }

    #[inline(never)]
    fn execute_orders(&mut self) {
        let orders = core::mem::take(&mut self.motion.orders);
        if let Some(refused) = orders.refusal {
            let _ = self.refuse(refused);
        }
        if let Some(home_rad) = orders.home_rad {
            let _ = self.set_position(home_rad);
        }
        if orders.confirms {
            self.base.supervisor.record_command(self.base.now_us);
            if self.base.settings.is_in_hil() {
                let current_a = self.motion.torque_mode_current_a(&self.base);
                self.samples.hil.set_command(current_a);
            }
        }
        if let Some(code) = orders.trips {
            self.base.supervisor.trip(code);
        }
        if orders.disarms {
            self.disarm();
        }
    }

    /// 6079h, mV; 0 if it is not measured.
    pub(crate) fn bus_millivolts(&self) -> u32 {
        (self.base.report().bus_voltage_v.unwrap_or_default() * 1e3) as u32
    }

    /// 603Fh: the emergency code of the first fault; 0 for none.
    pub(crate) fn error_code(&self) -> u16 {
        self.base.supervisor.faults().iter().next().map_or(0, |code| code.info().emergency)
    }

    /// 6040h. Returns an error if the supervisor refuses.
    fn set_controlword(&mut self, controlword: u16) -> Result<(), Abort> {
        if !self.motion.profile.is_active() {
            self.motion.profile.controlword = controlword;
            return Ok(());
        }
        self.move_by(Motion::confirm_target);
        let request = self.motion.profile.control(controlword, self.base.state());
        self.motion.watch_homing();
        match request {
            DriveRequest::None => {
                self.move_by(Motion::update_stop);
                Ok(())
            }
            DriveRequest::Arm => self.arm().inspect_err(|_| self.motion.profile.arm_refused()),
            DriveRequest::Disarm => {
                self.disarm_by_master();
                Ok(())
            }
            DriveRequest::ClearFaults => self.clear_faults(),
            DriveRequest::Home if self.motion.profile.homes_at_stop() => {
                self.move_by(Motion::begin_homing);
                Ok(())
            }
            DriveRequest::Home => {
                self.move_by(Motion::home_here);
                Ok(())
            }
            DriveRequest::TakeSetPoint => {
                self.motion.take_set_point();
                Ok(())
            }
        }
    }

    /// 6060h.
    pub(crate) fn set_mode(&mut self, mode: i8) -> Result<(), Abort> {
        let begins_anew = !self.base.is_bridge_in_use();
        let mut taken = Ok(());
        self.move_with(&mut |motion, joint| taken = motion.set_mode(joint, mode));
        taken.map_err(|refused| self.refuse(refused))?;
        if begins_anew {
            self.base.received.reset_command();
        }
        Ok(())
    }

    /// Receive PDO 1.
    pub(crate) fn take_drive_frame(&mut self, frame: &Frame) {
        let Some(target) = Target::parse(frame.data()) else {
            return self.base.counters.count_wrong_length();
        };
        // A refusal is reported as for an object (2028h), and in the statusword.
        let _ = self.take_target(&target);
    }

    /// Takes a target: its parts are set together, and then the controlword is processed, which may refer to them.
    ///
    /// # Errors
    /// The supervisor refuses what the controlword requests.
    pub(crate) fn take_target(&mut self, target: &Target) -> Result<(), Abort> {
        self.move_with(&mut |motion, joint| motion.set_target(joint, target));
        target.controlword.map_or(Ok(()), |controlword| self.set_controlword(controlword))
    }

    /// Refreshes the age of the target at the monitored heartbeat, if the targets have no deadline (1400h:5).
    pub(crate) fn confirm_target_by_heartbeat(&mut self, now_us: u64) {
        if self.base.settings.target_timeout_ms == 0 {
            self.base.now_us = now_us;
            self.move_by(Motion::confirm_target);
        }
    }

    /// Forgets the last target, or Command frame: the next one begins anew.
    #[inline(never)]
    pub(super) fn forget_command(&mut self) {
        self.base.received.reset_command();
        self.motion.target_us = None;
    }

    /// Stops the joint because its network stops, with the reaction of 6007h. A ramp after a fault goes on.
    pub(crate) fn stop_connection(&mut self) {
        self.trial.lose_connection();
        if self.base.supervisor.is_stopping() {
            return;
        }
        self.motion.profile.stop_connection();
        let reaction = self.base.settings.drive.reaction(StopCause::ConnectionLost);
        match reaction {
            StopReaction::Ramp(deceleration)
                if self.base.supervisor.is_armed() && self.motion.can_ramp(&self.base) =>
            {
                self.move_with(&mut |motion, joint| {
                    motion.begin_stop(joint, StopCause::ConnectionLost, deceleration)
                });
            }
            _ => {
                self.motion.stopping.shorts_low_sides = reaction == StopReaction::Short;
                self.disarm();
            }
        }
    }

    /// Writes a setting of the drive. Any other object is read-only here.
    pub(crate) fn set_drive_setting(
        &mut self,
        at_index: u16,
        sub_index: u8,
        word: u32,
    ) -> Result<(), Abort> {
        let mut changed = self.base.settings.drive;
        let written = changed.set(at_index, sub_index, word).ok_or(Abort::ReadOnly)?;
        written.map_err(|error| self.base.refuse(Abort::Value, error))?;
        if changed.has_short() && !self.set().motor.is_short_bounded() {
            let why = text!(
                "-1 (short): the shorted motor would exceed overcurrent_a at velocity_max_rad_s"
            );
            return Err(self.base.refuse(Abort::Value, why));
        }
        self.base.settings.drive = changed;
        Ok(())
    }

    /// 2030h:11: starts (1) or ends (0) a test on request.
    pub(crate) fn order_brake_test(&mut self, order: u8) -> Result<(), Abort> {
        match order {
            0 if self.motion.brake_test.is_running() => {
                self.disarm();
                return Ok(());
            }
            0 => return Ok(()),
            1 => {}
            _ => {
                let legal = text!("0 (end) or 1 (test)");
                return Err(self.base.refuse_setting(text!("test_order"), legal));
            }
        }
        let drive = &self.base.settings.drive;
        let why = if drive.brake_output == 0 {
            text!("the joint has no holding brake that could be tested (2030h:1)")
        } else if drive.brake_test_torque == 0 {
            text!("2030h:7 = 0: set the torque of the brake test first")
        } else {
            self.may_begin()?;
            self.base.arm()?;
            self.motion.begin_brake_test(true);
            return Ok(());
        };
        Err(self.base.refuse(Abort::State, why))
    }
}
