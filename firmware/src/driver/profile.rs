//! The joint driver as a drive of CiA 402: its state machine, cyclic synchronous torque (CST) and velocity (CSV), homing.
//!
//! For masters that know drives and no friction (ros2_canopen, CODESYS and their like). Mode 10 or 9 in 6060h switches it on;
//! the joint's own Command frame is passed over then. The controlword asks, the supervisor decides: *operation enabled*
//! is armed and nothing else, *fault* is the supervisor's, and a rising bit 7 clears what may be cleared. Quick stop and
//! "disable voltage" open the bridge; there is no ramp (605Ah would be 0).
//!
//! Such a master repeats a value that does not change, or does not send it at all: so every frame with a target, every
//! SYNC, and the heartbeat that is awaited (1016h) are signs of life, and a set-point is as young as the last of them. A
//! master that is silent for `command_timeout_us` has gone, as ever.
//!
//! Homing (mode 6) takes the place where the joint stands for its home (methods 37 and 35): a joint has no switches, and a master
//! drives to the stop in CST or CSV first. Home is at -607Ch, for the zero lies 607Ch beyond the home. While it is on, the
//! drive is enabled and gives no torque of its own.
//!
//! Units: torque in thousandths of the rated torque (6076h), which is what the current limit makes at the joint; position
//! and velocity in 1e-6 rad and 1e-6 rad/s, -2147.483648 rad where the position is not known. The largest motor speed (6080h)
//! is in turns of the motor per minute, as the profile has it.

/// 1000h: servo drive (2), profile 402.
pub const DEVICE_TYPE: u32 = 0x0002_0192;
/// Mode of operation: cyclic synchronous torque.
pub const CST: i8 = 10;
/// Mode of operation: cyclic synchronous velocity.
pub const CSV: i8 = 9;
/// Mode of operation: homing.
pub const HOMING: i8 = 6;
/// 6502h: which modes there are, bit `mode - 1`.
pub const SUPPORTED_MODES: u32 = 1 << (CST - 1) | 1 << (CSV - 1) | 1 << (HOMING - 1);
/// 60E3h: methods of homing, both the current position; 35 is what older masters call it.
pub const HOMING_METHODS: [i8; 2] = [37, 35];
/// Speed up to which a joint stands, rad/s: between two reports, a millisecond, home is missed by less than a tenth of a
/// milliradian; the joint's encoder has steps of 8 urad.
pub const STANDS_RAD_S: f32 = 0.1;
/// Largest 6072h, thousandths of the rated torque: what the current limit lets through.
pub const TORQUE_MAX_PERMILLE: u16 = 1000;

/// Bits of the controlword.
mod control {
    pub const ENABLE_VOLTAGE: u16 = 1 << 1;
    pub const QUICK_STOP: u16 = 1 << 2;
    pub const START_HOMING: u16 = 1 << 4;
    pub const FAULT_RESET: u16 = 1 << 7;
}

/// Bits of the statusword beside its state.
pub mod status {
    /// The bus voltage is there.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// A limit acts.
    pub const WARNING: u16 = 1 << 7;
    /// Manufacturer: the position is known.
    pub const POSITION_KNOWN: u16 = 1 << 8;
    /// The network is operational.
    pub const REMOTE: u16 = 1 << 9;
    /// Homing: it does not run, or has ended.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// The current limit acts.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// The drive follows its target.
    pub const FOLLOWS: u16 = 1 << 12;
    /// Homing: the joint is at home.
    pub const HOMED: u16 = FOLLOWS;
    /// Homing: it failed.
    pub const HOMING_FAILED: u16 = 1 << 13;
}

/// How the last homing went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Homing {
    /// There was none since the mode was switched on.
    #[default]
    NotBegun,
    /// The position is that of the home.
    Attained,
    /// The joint moved.
    Failed,
}

/// States of the drive that its own, not the supervisor's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
}

/// What a controlword asks of the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Nothing.
    None,
    /// To arm; [`Profile::refused`] says that it did not.
    Arm,
    /// To disarm.
    Disarm,
    /// To clear faults.
    ClearFaults,
    /// To take the place where the joint stands for its home.
    Home,
}

/// The drive's side of the profile.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    state: State,
    /// 6040h.
    pub controlword: u16,
    /// 6060h.
    pub mode: i8,
    /// 6071h.
    pub target_permille: i16,
    /// 6072h.
    pub max_permille: u16,
    /// 60FFh, 1e-6 rad/s.
    pub target_micro_rad_s: i32,
    /// 6080h, turns of the motor per minute; none where no master has written it.
    pub max_motor_rpm: Option<u32>,
    /// 6098h, of [`HOMING_METHODS`].
    pub homing_method: i8,
    /// 607Ch, 1e-6 rad.
    pub home_offset_micro_rad: i32,
    /// How the last homing went.
    pub homing: Homing,
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            state: State::default(),
            controlword: 0,
            mode: 0,
            target_permille: 0,
            max_permille: TORQUE_MAX_PERMILLE,
            target_micro_rad_s: 0,
            max_motor_rpm: None,
            homing_method: HOMING_METHODS[0],
            home_offset_micro_rad: 0,
            homing: Homing::default(),
        }
    }
}

impl Profile {
    /// Whether the profile has the say.
    pub const fn is_on(&self) -> bool {
        matches!(self.mode, CST | CSV | HOMING)
    }

    /// 6072h as a share of the rated torque.
    pub fn max_share(&self) -> f32 {
        f32::from(self.max_permille.min(TORQUE_MAX_PERMILLE)) * 1e-3
    }

    /// 60FFh within so many rad/s, and whether it lay beyond.
    pub fn target_rad_s(&self, most_rad_s: f32) -> (f32, bool) {
        let target_rad_s = self.target_micro_rad_s as f32 * 1e-6;
        let held = target_rad_s.max(-most_rad_s).min(most_rad_s);
        (held, held != target_rad_s)
    }

    /// Target within 6072h, as a share of the rated torque.
    pub fn target_share(&self) -> f32 {
        let most = i32::from(self.max_permille.min(TORQUE_MAX_PERMILLE));
        i32::from(self.target_permille).clamp(-most, most) as f32 * 1e-3
    }

    /// Takes a controlword; `fault` and `armed` as the supervisor has it now.
    #[must_use]
    pub fn control(&mut self, controlword: u16, fault: bool, armed: bool) -> Request {
        let rising = controlword & !self.controlword;
        self.controlword = controlword;
        self.follow(fault, armed);
        if fault {
            let reset = rising & control::FAULT_RESET != 0;
            return if reset { Request::ClearFaults } else { Request::None };
        }
        let powered =
            controlword & control::ENABLE_VOLTAGE != 0 && controlword & control::QUICK_STOP != 0;
        let was = self.state;
        self.state = match (was, controlword & 0xF) {
            _ if !powered => State::SwitchOnDisabled,
            // Shutdown is the only way on from there.
            (_, 0b0110 | 0b1110) => State::ReadyToSwitchOn,
            (State::SwitchOnDisabled, _) => State::SwitchOnDisabled,
            (_, 0b0111) => State::SwitchedOn,
            // Through "switched on" in one, as the profile allows.
            _ => State::OperationEnabled,
        };
        match (was == State::OperationEnabled, self.state == State::OperationEnabled) {
            (false, true) => Request::Arm,
            (true, false) => Request::Disarm,
            (true, true) if self.mode == HOMING && rising & control::START_HOMING != 0 => {
                Request::Home
            }
            _ => Request::None,
        }
    }

    /// The supervisor did not arm: it stays switched on, and the next enabling asks again.
    pub fn refused(&mut self) {
        self.state = State::SwitchedOn;
    }

    /// What the supervisor did by itself is so here too.
    pub fn follow(&mut self, fault: bool, armed: bool) {
        if fault || self.state == State::OperationEnabled && !armed {
            self.state = State::SwitchOnDisabled;
        }
    }

    /// The state's bits of the statusword.
    pub fn state_bits(&self, fault: bool) -> u16 {
        match self.state {
            _ if fault => 0x08,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled if self.mode == HOMING => 0x27,
            State::OperationEnabled => 0x27 | status::FOLLOWS,
        }
    }

    /// The bits of the statusword that say how homing went, in its mode.
    pub fn homing_bits(&self, stands: bool) -> u16 {
        let ended = |bits| if stands { bits | status::TARGET_REACHED } else { bits };
        match self.homing {
            _ if self.mode != HOMING => 0,
            Homing::NotBegun => status::TARGET_REACHED,
            Homing::Attained => status::TARGET_REACHED | status::HOMED,
            Homing::Failed => ended(status::HOMING_FAILED),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHUTDOWN: u16 = 0x06;
    const SWITCH_ON: u16 = 0x07;
    const ENABLE: u16 = 0x0F;

    fn on() -> Profile {
        Profile { mode: CST, ..Profile::default() }
    }

    #[test]
    fn it_goes_through_its_states_and_only_shutdown_leads_out_of_the_first() {
        let mut drive = on();
        assert_eq!(drive.state_bits(false), 0x40);
        for stays in [ENABLE, SWITCH_ON, 0x00, 0x80] {
            assert_eq!(drive.control(stays, false, false), Request::None);
            assert_eq!(drive.state_bits(false), 0x40, "{stays:#x}");
        }
        for (word, bits, request) in [
            (SHUTDOWN, 0x21, Request::None),
            (SWITCH_ON, 0x23, Request::None),
            (ENABLE, 0x27 | status::FOLLOWS, Request::Arm),
        ] {
            assert_eq!(drive.control(word, false, false), request);
            assert_eq!(drive.state_bits(false), bits);
        }
        // The same again asks for nothing again.
        assert_eq!(drive.control(ENABLE, false, true), Request::None);
        for (word, bits) in [(SWITCH_ON, 0x23), (SHUTDOWN, 0x21), (0x02, 0x40), (0x05, 0x40)] {
            let mut drive = drive;
            assert_eq!(drive.control(word, false, true), Request::Disarm, "{word:#x}");
            assert_eq!(drive.state_bits(false), bits, "{word:#x}");
        }
    }

    #[test]
    fn a_refusal_leaves_it_switched_on_and_enabling_asks_again() {
        let mut drive = on();
        let _ = drive.control(SHUTDOWN, false, false);
        assert_eq!(drive.control(ENABLE, false, false), Request::Arm);
        drive.refused();
        assert_eq!(drive.state_bits(false), 0x23);
        assert_eq!(drive.control(ENABLE, false, false), Request::Arm);
    }

    #[test]
    fn a_fault_is_left_by_an_edge_alone_and_leads_to_the_first_state() {
        let mut drive = on();
        for word in [SHUTDOWN, ENABLE] {
            let _ = drive.control(word, false, false);
        }
        assert_eq!(drive.state_bits(true), 0x08);
        assert_eq!(drive.control(ENABLE, true, false), Request::None);
        assert_eq!(drive.control(0x80, true, false), Request::ClearFaults);
        assert_eq!(drive.control(0x80, true, false), Request::None, "no edge");
        // Cleared: it does not start again by a word that was still there.
        assert_eq!(drive.control(ENABLE, false, false), Request::None);
        assert_eq!(drive.state_bits(false), 0x40);
        // Disarmed by somebody else it is not enabled any more, either.
        let mut drive = on();
        for word in [SHUTDOWN, ENABLE] {
            let _ = drive.control(word, false, false);
        }
        drive.follow(false, false);
        assert_eq!(drive.state_bits(false), 0x40);
    }

    #[test]
    fn homing_begins_with_an_edge_in_its_own_mode_where_the_drive_is_enabled() {
        const START: u16 = ENABLE | 0x10;
        let mut drive = Profile { mode: HOMING, ..Profile::default() };
        assert_eq!(drive.control(START, false, false), Request::None);
        for word in [SHUTDOWN, ENABLE] {
            let _ = drive.control(word, false, false);
        }
        assert_eq!(drive.state_bits(false) | drive.homing_bits(true), 0x0427, "not begun");
        assert_eq!(drive.control(START, false, true), Request::Home);
        assert_eq!(drive.control(START, false, true), Request::None, "no edge");
        drive.homing = Homing::Attained;
        assert_eq!(drive.state_bits(false) | drive.homing_bits(true), 0x1427);
        drive.homing = Homing::Failed;
        assert_eq!(drive.homing_bits(true), 0x2400);
        assert_eq!(drive.homing_bits(false), 0x2000);
        let mut other = on();
        for word in [SHUTDOWN, ENABLE] {
            let _ = other.control(word, false, false);
        }
        assert_eq!(
            (other.control(START, false, true), other.homing_bits(true)),
            (Request::None, 0)
        );
    }

    #[test]
    fn a_target_is_held_to_the_largest_torque() {
        let share = |target_permille, max_permille| {
            Profile { target_permille, max_permille, ..on() }.target_share()
        };
        assert_eq!(share(250, 1000), 0.25);
        assert_eq!(share(-250, 100), -0.1);
        assert_eq!((share(i16::MAX, u16::MAX), share(i16::MIN, u16::MAX)), (1.0, -1.0));
        assert_eq!(share(500, 0), 0.0);
    }
}
