//! What a board gives to its joint, and what it takes: at the start, and once per tick.

use crate::access::Key;
use crate::driver::KeptHome;
use crate::loop_parts::StageTraits;
use crate::node::dictionary::records::IdentityObject;
use crate::sensors::biss::{self, TURN_WORDS};
use crate::sensors::{LocalReadings, enclosure};
use crate::supervisor::{CanState, ResetCause, SelfTest};
use crate::update::{Program, recovery};

/// Identity of a driver.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Name of the board.
    pub hardware: &'static str,
    /// Serial number of the board.
    pub serial: u32,
    /// Properties of its power stage, which limit the parameters.
    pub stage: StageTraits,
}

impl Identity {
    /// Returns the identity object of the dictionary.
    pub fn object(&self) -> IdentityObject {
        recovery::identity(self.serial)
    }
}

/// State of the board at the start, and how the previous run ended.
#[derive(Clone, Copy, Debug)]
pub struct Boot<'a> {
    /// Cause of the reset.
    pub cause: ResetCause,
    /// Text of a panic before the reset.
    pub panic: Option<&'a str>,
    /// The guard below the stack was overwritten.
    pub stack_overflowed: bool,
    /// First of the board's start-up tests that failed.
    pub failed_self_test: Option<SelfTest>,
    /// Rise of the winding above the stator at the end of the previous run, K. `None` if the board has lost it, such as
    /// without power: the winding is then assumed to be hot.
    pub winding_rise_k: Option<f32>,
    /// Home that the previous run kept; `None` if the board has lost it, such as without power. The flash may have it then.
    pub home: Option<KeptHome>,
    /// Places of images and parameters, if the board has two banks. Otherwise the parameters use the whole flash, and
    /// there are no updates.
    pub program: Option<Program>,
}

impl Default for Boot<'_> {
    /// Power-on without faults, after a pause in which the winding has cooled.
    fn default() -> Self {
        Self {
            cause: ResetCause::PowerOn,
            panic: None,
            stack_overflowed: false,
            failed_self_test: None,
            winding_rise_k: Some(0.0),
            home: None,
            program: None,
        }
    }
}

/// What a board has for a driver, once it has started.
#[derive(Debug, Default)]
pub struct Equipment {
    /// The CAN controller sends frames of CAN FD. Without it, `fd_telemetry` (2001h:9) is refused.
    pub sends_fd: bool,
    /// Memory of the scope, values of 32 bits. Without it, a capture is refused.
    pub scope: Option<&'static mut [f32]>,
    /// Secret of the access challenges: random bytes, new at every start. Without them, the challenges depend on the key and
    /// the time.
    pub seed: Option<[u8; Key::LENGTH]>,
}

with_defaults! {
    /// State of a board and its surroundings.
    #[derive(Clone, Copy, Debug)]
    pub struct BoardState {
        /// Temperature of the bridge, deg C; `None` if it is not measured.
        pub bridge_temperature_c: Option<f32>,
        /// Temperature of the motor, deg C; `None` if it is not measured.
        pub motor_temperature_c: Option<f32>,
        /// The guard below the stack is intact.
        pub stack_intact: bool = true,
        /// The CAN controller lost received frames since the last query.
        pub receiver_overrun: bool,
        /// State of the CAN controller.
        pub can: CanState,
        /// Last readings of the board's own slow sensors.
        pub sensors: LocalReadings,
        /// Last readings of the dry side, and the channels of safe torque off.
        pub enclosure: enclosure::Readings,
        /// First words of the last frame of a BiSS encoder; `None` without one.
        pub biss: Option<[u16; TURN_WORDS]>,
        /// Levels of the Hall sensors, bits 0 to 2; 0 without sensors.
        pub hall: u8,
        /// Words of the encoder at the joint's side of the gear, latched when the last report came, or at this tick; `None` if
        /// there is no such encoder.
        pub joint_words: Option<[u16; biss::WORDS]>,
    }
    /// Nothing is measured and there are no faults.
}

/// What a tick gives to the board.
#[derive(Clone, Copy, Debug, Default)]
pub struct BoardOutput {
    /// Level of the holding brake's output. With `None` the output is not driven, and the brake must be closed.
    pub brake: Option<bool>,
    /// Rise of the winding above the stator, K, to keep across a reset ([`Boot::winding_rise_k`]); `None` if it is not known.
    pub winding_rise_k: Option<f32>,
    /// Home to keep across a reset ([`Boot::home`]); `None` if it is not known.
    pub home: Option<KeptHome>,
}
