//! The shipped joint driver on a simulated joint: CAN frames, background loop, queues, interrupt, bridge and plant.
//!
//! ```text
//! master (1 kHz) -- frames, with delay --> Driver -- orders --> LoopTask (20 kHz) --> bridge --> JointPlant
//!        ^------ Motion, at each SYNC --------'        ^------- currents, encoder --------------'
//! ```
//! All driver code is the firmware's own, as it runs on the board. The plant
//! ([`simulated_machines::joint_plant`]) does not depend on it. Time is virtual, and equal seeds give equal bits.
//!
//! The caller of [`JointRig::step_with_command`] is the bus master. The firmware controls current, so velocity and
//! position loops belong to the caller, as on a robot's own computer. Simulated sensors of side load, pressure and
//! temperature send their frames on the same bus.
//!
//! [`simulated::dataset`] turns the log of a simulated machine into a data set for identification.

mod board;
mod bus;
mod driver;
mod error;
mod faults;
mod incremental;
mod node;
pub mod service;
pub mod simulated;
mod stage;

pub use board::{
    BOARD_TRAITS, BoardScales, BoardSensors, CurrentChain, DRIVER_SCALES, ESC1_SCALES, EncoderFault,
};
pub use bus::RigBus;
pub use driver::{
    LibraryDriver, RigDriver, RigFlash, WATCHDOG_TIMEOUT_MS, codes_from_bits, stored_flash,
};
pub use error::RigError;
pub use faults::{RigFaults, SealSensorFault};
pub use incremental::{HallFault, LineEdges, LineFault};
pub use node::{JointEvent, MotorNode};
pub use simulated_machines::joint_plant::SerialFault;
pub use stage::{InterruptTiming, PERIOD_CYCLES, Stage, StageExtremes};

use canopen_rs::Address;
use canopen_rs::sdo::encode_upload_request;
use compensator_core::can::{
    CommandFrame, Frame, Message, NodeId, SealFrame, SurroundingsFrame, SyncFrame, cob_id,
};
use faults::DelayLine;
use firmware::background::{BoardState, TICK_US};
use firmware::compact;
use firmware::control::PERIOD_S;
use firmware::drive_settings::DriveSettings;
use firmware::driver::{Boot, Device};
use firmware::joint_node::Joint;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    AccessObject, InputsObject, StateObject, TransmitPdoObject,
};
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::CodeSet;
use joint_bus::canopen::{Client, download_request, expedited};
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Shown};
use std::collections::VecDeque;

const NODE: NodeId = NodeId::FIRST;

/// Periods of the current loop per millisecond.
pub const PERIODS_PER_MS: usize = (1e-3 / PERIOD_S + 0.5) as usize;

/// Settling time of the angle observer, ms: a triple pole at 100 Hz, with margin.
pub const OBSERVER_SETTLING_MS: usize = 150;

/// Maximum time from the arming request to the armed state, ms; the bridge finds its offsets in it.
pub const ARMING_TIMEOUT_MS: usize = 60;

/// Interval between temperature frames, ms; a thermometer is slow.
const TEMPERATURE_INTERVAL_MS: u32 = 50;

/// Interval between the objects of the load torque, ms. With one each millisecond, and its answer, the frames of a
/// millisecond would not fit on a bus of 1 Mbit/s.
const LOAD_INTERVAL_MS: u32 = 4;

/// Longest time until the driver answers the request of an object, ms. Its process frames may be sent before.
const ANSWER_TIMEOUT_MS: usize = 20;

/// Last values that the master received from the driver, as the frames carry them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MasterView {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Position, rad; NaN if unknown.
    pub position_rad: f32,
    /// Current, A.
    pub current_a: f32,
    /// Friction torque of the model, Nm.
    pub friction_torque_nm: f32,
    /// Torque that no part of the model explains, Nm.
    pub residual_torque_nm: f32,
}

/// A driver connected to a simulated joint.
pub struct JointRig {
    driver: Box<dyn RigDriver>,
    faults: RigFaults,
    line: DelayLine,
    /// What the seal sensors showed last before they stuck.
    stuck_seal: Option<Shown>,
    now_us: u64,
    milliseconds: u32,
    command_count: u8,
    received: Received,
    /// The rig's master sends a SYNC every millisecond.
    sends_sync: bool,
    board_state: BoardState,
}

/// What the master received from the driver.
#[derive(Default)]
struct Received {
    view: MasterView,
    answers: Vec<Frame>,
    /// Frames from the driver for an external bus; `None` if the rig's own master receives them.
    outgoing_frames: Option<VecDeque<CanFrame>>,
}

/// State of the driver at power-up.
#[derive(Clone, Copy, Debug)]
pub struct PowerUp<'a> {
    /// Parameter set in flash; `None` for a blank flash.
    pub set: Option<&'a ParameterSet>,
    /// The wiring was confirmed by commissioning.
    pub commissioned: bool,
    /// Simulates the sensors and traits of the driver's board instead of ideal ones.
    pub board: bool,
    /// Scales of these sensors.
    pub scales: BoardScales,
    /// Settings of the drive in flash, with the set.
    pub drive: DriveSettings,
    /// How the previous run of the processor ended.
    pub boot: Boot<'a>,
}

impl Default for PowerUp<'_> {
    /// A blank flash, on the board.
    fn default() -> Self {
        Self {
            set: None,
            commissioned: false,
            board: true,
            scales: DRIVER_SCALES,
            drive: DriveSettings::default(),
            boot: Boot::default(),
        }
    }
}

/// Starts a driver with this parameter set on a plant, arms it, and calls `work` as its master.
///
/// # Errors
/// Returns one line if the set is rejected or the driver does not arm.
pub fn run_armed<R>(
    set: &ParameterSet,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, RigError> {
    let start = PowerUp { set: Some(set), commissioned: true, board: false, ..PowerUp::default() };
    let position_rad = plant.position_rad();
    run_from_power_up(&start, plant, faults, |rig| rig.arm(position_rad).map(|()| work(rig)))?
}

/// Starts a driver from power-up with an open bridge, and calls `work` as its master.
///
/// # Errors
/// Returns one line if the set is rejected.
pub fn run_from_power_up<R>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, RigError> {
    start_driver::<Device<RigFlash>>(start, plant, faults).map(|mut rig| work(&mut rig))
}

/// Starts a compact node as [`run_from_power_up`] starts the whole driver.
///
/// # Errors
/// Returns one line if the set is rejected.
pub fn run_compact_from_power_up<R>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, RigError> {
    start_driver::<compact::Device<RigFlash>>(start, plant, faults).map(|mut rig| work(&mut rig))
}

/// Returns the stage of a start: the plant, with the sensors of the driver's board if they are simulated.
pub fn stage_at_power_up(start: &PowerUp, mut plant: JointPlant, faults: &RigFaults) -> Stage {
    let default = ParameterSet::default();
    let set = start.set.unwrap_or(&default);
    let board =
        start.board.then(|| BoardSensors::start(&mut plant, set, start.scales, faults.seed));
    let mut stage = Stage::new(plant, faults);
    stage.board = board;
    stage
}

/// Starts the library as driver from power-up.
fn start_driver<J: Joint<Flash = RigFlash> + 'static>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
) -> Result<JointRig, RigError> {
    let traits = if start.board { start.scales.traits } else { StageTraits::NONE };
    let stage = stage_at_power_up(start, plant, &faults);
    let driver = LibraryDriver::<J>::start(start, traits, stage)?;
    Ok(JointRig::new(Box::new(driver), faults))
}

impl JointRig {
    /// Connects a driver that has started, and waits until its observer has settled.
    pub fn new(driver: Box<dyn RigDriver>, faults: RigFaults) -> Self {
        let line = DelayLine::new(&faults);
        let mut rig = Self {
            driver,
            faults,
            line,
            stuck_seal: None,
            now_us: 0,
            milliseconds: 0,
            command_count: 0,
            received: Received::default(),
            sends_sync: true,
            board_state: BoardState::default(),
        };
        (0..OBSERVER_SETTLING_MS).for_each(|_| rig.step_idle());
        rig
    }

    /// Starts the node, sets the joint position, and arms the driver at 0 A.
    ///
    /// # Errors
    /// Returns one line with the driver's reason if it does not arm.
    pub fn arm(&mut self, position_rad: f64) -> Result<(), RigError> {
        // The rig's master uses Answer and Telemetry of every sample.
        for at_index in [index::TRANSMIT_ANSWER, index::TRANSMIT_TELEMETRY] {
            self.write_object_byte(at_index, TransmitPdoObject::TRANSMISSION_TYPE, 1);
            self.step_idle();
        }
        self.send_immediately(0, &[1, NODE.number()]);
        let position_rad = (position_rad as f32).to_le_bytes();
        self.write_object(index::STATE, StateObject::SET_POSITION, position_rad);
        (0..5).for_each(|_| self.step_with_command(0.0, 0.0));
        self.request_state(1);
        for _ in 0..ARMING_TIMEOUT_MS {
            self.step_with_command(0.0, 0.0);
        }
        if self.is_armed() {
            return Ok(());
        }
        Err(RigError::NotArmed(Client::new(RigBus::new(self), NODE).read_refusal()?))
    }

    /// Unlocks the objects of the service level with the default key, which takes some milliseconds. A joint with a
    /// stored set is open already.
    ///
    /// # Errors
    /// Returns one line if the driver refuses.
    pub fn unlock(&mut self) -> Result<(), RigError> {
        if self.read_object(index::ACCESS, AccessObject::LEVEL) == Some(1) {
            return Ok(());
        }
        Ok(Client::new(RigBus::new(self), NODE).unlock()?)
    }

    /// Runs 1 ms with a command: current before compensation, A, and reference velocity of the joint, rad/s.
    pub fn step_with_command(&mut self, current_a: f32, velocity_reference_rad_s: f32) {
        self.command_count = self.command_count.wrapping_add(1);
        let command = CommandFrame::new(current_a, velocity_reference_rad_s, self.command_count);
        self.line.send(Message::Command(NODE, command).emit());
        let shown = self.driver.stage_mut().plant.show();
        if let Some(seal) =
            self.faults.seal_reading(self.milliseconds, &shown, &mut self.stuck_seal)
        {
            let seal = SealFrame {
                radial_force_n: seal.radial_force_n as f32,
                pressure_diff_pa: seal.pressure_diff_pa as f32,
            };
            self.line.send(Message::Seal(NODE, seal).emit());
            // The driver measures its own torque, so the load goes to it as an object and not in a Torque frame.
            if self.milliseconds.is_multiple_of(LOAD_INTERVAL_MS) {
                let load_nm = (shown.load_torque_nm as f32).to_le_bytes();
                self.line.send(sdo_download(index::INPUTS, InputsObject::LOAD_TORQUE, &load_nm));
            }
        }
        if self.milliseconds.is_multiple_of(TEMPERATURE_INTERVAL_MS) {
            let temperature_c = shown.temperature_c as f32;
            let surroundings = SurroundingsFrame { temperature_c, auxiliary: f32::NAN };
            self.line.send(Message::Surroundings(NODE, surroundings).emit());
        }
        while let Some(frame) = self.line.receive() {
            self.driver.receive(&frame);
        }
        self.step_idle();
    }

    /// Runs 1 ms without a command.
    pub fn step_idle(&mut self) {
        self.now_us += TICK_US;
        let sync = SyncFrame::of(self.milliseconds);
        let sync = self.sends_sync.then(|| Message::Sync(sync).emit());
        let received = &mut self.received;
        self.driver.step(&self.board_state, sync, &mut |frame| received.take(&frame));
        self.line.tick();
        self.milliseconds += 1;
    }

    /// Stalls the background loop for this time, as during a long transfer; the interrupt continues.
    pub fn stall_background(&mut self, milliseconds: u32) {
        self.driver.stall_background(milliseconds);
    }

    /// Stops the SYNC frames.
    pub fn stop_sync(&mut self) {
        self.sends_sync = false;
    }

    /// Returns true after a reset, by the watchdog or as the network requested. The rig then stays inactive until
    /// [`JointRig::restart`].
    pub fn is_reset(&self) -> bool {
        self.driver.is_reset()
    }

    /// Resets the processor from outside.
    pub fn reset(&mut self) {
        self.driver.reset();
    }

    /// Cuts the power of the processor, whose RAM loses its content.
    pub fn cut_power(&mut self) {
        self.driver.cut_power();
    }

    /// Runs 1 ms, in which a driver that was reset starts again from its flash, on the joint as it is.
    ///
    /// # Errors
    /// Returns one line if the driver cannot be restarted.
    pub fn restart(&mut self) -> Result<(), RigError> {
        self.now_us += TICK_US;
        self.line.tick();
        self.milliseconds += 1;
        self.driver.restart()
    }

    /// Measurements of the board about itself: temperatures, stack, bus.
    pub fn board_state_mut(&mut self) -> &mut BoardState {
        &mut self.board_state
    }

    /// The power stage, for measurements and faults.
    pub fn stage_mut(&mut self) -> &mut Stage {
        self.driver.stage_mut()
    }

    /// Last values that the master received.
    pub fn master_view(&self) -> &MasterView {
        &self.received.view
    }

    /// The plant, for measurements.
    pub fn plant(&self) -> &JointPlant {
        &self.driver.stage().plant
    }

    /// The plant, to change its temperature, wear or pressure.
    pub fn plant_mut(&mut self) -> &mut JointPlant {
        &mut self.driver.stage_mut().plant
    }

    /// Returns true if the driver is armed.
    pub fn is_armed(&mut self) -> bool {
        self.driver.is_armed()
    }

    /// Returns the driver's latched faults.
    pub fn latched_faults(&mut self) -> CodeSet {
        self.driver.faults()
    }

    /// Returns the driver's active limits.
    pub fn active_limits(&mut self) -> CodeSet {
        self.driver.limits()
    }

    /// Takes the frames since the last call that are not process data: object answers and emergencies.
    pub fn take_answers(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.received.answers)
    }

    /// Delivers a frame of up to eight bytes to the driver without delay.
    pub fn send_immediately(&mut self, identifier: u16, data: &[u8]) {
        let frame = Frame::new(identifier, data).expect("11 bits and at most eight bytes");
        self.driver.receive(&frame);
    }

    /// Writes an object of four bytes.
    pub fn write_object(&mut self, index: u16, sub_index: u8, value: [u8; 4]) {
        self.driver.receive(&sdo_download(index, sub_index, &value));
    }

    /// Writes an object of one byte.
    pub fn write_object_byte(&mut self, index: u16, sub_index: u8, value: u8) {
        self.driver.receive(&sdo_download(index, sub_index, &[value]));
    }

    /// Reads an object of at most four bytes, which takes some milliseconds. Returns `None` if there is no answer, or the
    /// driver rejects the request.
    pub fn read_object(&mut self, index: u16, sub_index: u8) -> Option<u32> {
        let request = encode_upload_request(Address::new(index, sub_index));
        self.received.answers.clear();
        self.send_immediately(SDO_REQUEST, &request);
        (0..ANSWER_TIMEOUT_MS).find_map(|_| {
            self.step_idle();
            self.received.answers.iter().find_map(|frame| {
                let answer: &[u8; 8] = frame.data().try_into().ok()?;
                let value = expedited(answer).filter(|_| answer[1..4] == request[1..4])?;
                Some(value.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte)))
            })
        })
    }

    /// Requests the driver to arm (1), to disarm (0) or to clear its faults (2).
    pub fn request_state(&mut self, request: u8) {
        self.write_object_byte(index::STATE, StateObject::REQUEST, request);
    }
}

impl Received {
    fn take(&mut self, frame: &CanFrame) {
        match &mut self.outgoing_frames {
            Some(outgoing_frames) => outgoing_frames.push_back(*frame),
            None => frame.joint_frames().for_each(|frame| self.take_joint_frame(&frame)),
        }
    }

    fn take_joint_frame(&mut self, frame: &Frame) {
        match Message::parse(frame) {
            Ok(Message::Motion(_, motion)) => {
                self.view.velocity_rad_s = motion.velocity_rad_s;
                self.view.position_rad = motion.position_rad;
            }
            Ok(Message::Telemetry(_, telemetry)) => {
                self.view.current_a = telemetry.current_a;
                self.view.residual_torque_nm = telemetry.residual_torque_nm;
            }
            Ok(Message::Answer(_, answer)) => {
                self.view.friction_torque_nm = answer.friction_torque_nm;
            }
            Ok(_) => {}
            // Not a process frame: an object answer or an emergency.
            Err(_) => self.answers.push(*frame),
        }
    }
}

/// Identifier of the requests to the node's objects.
const SDO_REQUEST: u16 = cob_id::SDO_REQUEST + NODE.number() as u16;

/// Returns the frame that writes an object of one to four bytes.
fn sdo_download(index: u16, sub_index: u8, value: &[u8]) -> Frame {
    let request = download_request(Address::new(index, sub_index), value);
    Frame::new(SDO_REQUEST, &request).expect("11 bits and eight bytes")
}
