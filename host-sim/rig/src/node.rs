//! A joint driver with a simulated motor on an in-process bus, for trying a tool before a bench exists.
//!
//! The driver is the shipped one, with the simulated sensors of its board. Motor, gear, seal and encoder belong to the
//! plant. One millisecond on the bus is one millisecond of the plant, and another participant of the bus sends the SYNC
//! frames.
//!
//! There are three starts: a blank flash ([`MotorNode::start`]), the reference joint commissioned
//! ([`MotorNode::commissioned`]), and a drawn joint in service ([`MotorNode::drawn`]). A reset restarts the driver from its
//! flash, on the joint as it is.

use super::{
    EncoderFault, JointRig, PowerUp, RigDriver, RigError, RigFaults, RigFlash, service,
    start_driver,
};
use compensator_core::can::{Message, NodeId, SealFrame, SurroundingsFrame};
use firmware::driver::Device;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::StateObject;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::CanState;
use joint_bus::bus::Participant;
use joint_trace::CanFrame;
use simulated_machines::joint_plant::drawn::JointSensors;
use simulated_machines::joint_plant::{DrawnJoint, JointPlant, Load, Parameters, Shown};
use std::collections::VecDeque;
use std::f64::consts::PI;

const NODE: NodeId = NodeId::FIRST;

const MILLISECOND_NS: u64 = 1_000_000;

/// Maximum time simulated at once after a gap in the bus time, ms; the rest of the gap is skipped.
const MAX_CATCH_UP_MS: u64 = 50;

/// Time from a reset until the driver starts again, ms: start-up code and self-test of the board.
const RESTART_MS: u32 = 50;

/// Intervals of the frames of the seal sensors and of the thermometer, ms.
const SEAL_INTERVAL_MS: u64 = 10;
const THERMOMETER_INTERVAL_MS: u64 = 50;

/// Time for the answer to an object that the start writes, ms.
const ANSWER_MS: usize = 5;

/// What happens to a joint from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointEvent {
    /// The bus cable is cut: no frame reaches the driver, and none leaves the joint.
    CableCut,
    /// The bus cable is connected again.
    CableRestored,
    /// The encoder has this fault, or none.
    Encoder(EncoderFault),
    /// The sensors of side load and pressure repeat their last reading.
    SealSensorsStuck,
    /// The sensors of side load and pressure measure again.
    SealSensorsRestored,
    /// The processor is reset.
    ProcessorReset,
    /// The supply has this voltage, V.
    Supply(f64),
    /// A stop against positive motion is at this position, rad.
    Stop(f64),
}

/// A driver with its motor and joint.
pub struct MotorNode {
    rig: JointRig,
    /// Bus time up to which the rig has run, ns.
    simulated_until_ns: u64,
    sensors: JointSensors,
    /// Last reading of stuck seal sensors.
    stuck: Option<Shown>,
    last_shown: Option<Shown>,
    is_cut: bool,
    /// Events by their bus time, ns.
    events: Vec<(u64, JointEvent)>,
    /// Time since a reset of the processor, ms.
    reset_ms: u32,
    restarts: u32,
}

impl MotorNode {
    /// Starts an uncommissioned joint of the reference drive. Its encoder is reversed and offset, and its motor cogs.
    ///
    /// # Errors
    /// Returns one line if the driver does not start.
    pub fn start() -> Result<Self, RigError> {
        let constants = Parameters {
            encoder_direction: -1.0,
            encoder_zero_rad: 0.3 * PI,
            cogging_nm: 0.004,
            ..Parameters::default()
        };
        Self::with_constants(&constants, &PowerUp::default())
    }

    /// Starts the same joint commissioned, its encoder mounted as the default parameters state.
    ///
    /// # Errors
    /// As [`MotorNode::start`].
    pub fn commissioned() -> Result<Self, RigError> {
        let set = ParameterSet::default();
        let start = PowerUp { set: Some(&set), commissioned: true, ..PowerUp::default() };
        Self::with_constants(&Parameters::default(), &start)
    }

    /// Starts a drawn joint in service: commissioned with this set, the settings of [`service::drive_settings`] and open
    /// access in its flash, and its position known. [`service::starting_set`] is a set without compensation.
    ///
    /// The joint's sensors send Seal frames every 10 ms and Surroundings frames every 50 ms.
    ///
    /// # Errors
    /// Returns one line if the set is rejected.
    pub fn drawn(joint: &DrawnJoint, set: &ParameterSet) -> Result<Self, RigError> {
        let mut node = Self::with_plant(joint.plant(), &Self::power_up(joint, set))?;
        node.home(joint);
        Ok(node)
    }

    /// Starts a drawn joint with another driver, such as an emulated board, that was powered up with
    /// [`MotorNode::power_up`] on the joint's plant.
    pub fn drawn_on(driver: Box<dyn RigDriver>, joint: &DrawnJoint) -> Self {
        let mut node = Self::with_rig(JointRig::new(driver, RigFaults::default()));
        node.home(joint);
        node
    }

    /// Returns the state of a drawn joint's driver at power-up.
    pub fn power_up<'a>(joint: &DrawnJoint, set: &'a ParameterSet) -> PowerUp<'a> {
        let drive = service::drive_settings(joint);
        PowerUp { set: Some(set), commissioned: true, drive, ..PowerUp::default() }
    }

    fn with_constants(constants: &Parameters, start: &PowerUp) -> Result<Self, RigError> {
        let mut plant = JointPlant::new(constants, Load::Free, 1);
        plant.watch_overcurrent();
        Self::with_plant(plant, start)
    }

    fn with_plant(plant: JointPlant, start: &PowerUp) -> Result<Self, RigError> {
        start_driver::<Device<RigFlash>>(start, plant, RigFaults::default()).map(Self::with_rig)
    }

    fn with_rig(mut rig: JointRig) -> Self {
        rig.received.outgoing_frames = Some(VecDeque::new());
        rig.stop_sync();
        Self {
            rig,
            simulated_until_ns: 0,
            sensors: JointSensors::default(),
            stuck: None,
            last_shown: None,
            is_cut: false,
            events: Vec::new(),
            reset_ms: 0,
            restarts: 0,
        }
    }

    /// Sets the driver's position to that of the joint, and connects its sensors.
    fn home(&mut self, joint: &DrawnJoint) {
        let position_rad = self.rig.plant().position_rad() as f32;
        let position = position_rad.to_le_bytes();
        self.rig.write_object(index::STATE, StateObject::SET_POSITION, position);
        (0..ANSWER_MS).for_each(|_| self.rig.step_idle());
        if let Some(outgoing) = &mut self.rig.received.outgoing_frames {
            outgoing.clear();
        }
        self.sensors = joint.sensors;
    }

    /// Lets something happen at a bus time, ns.
    pub fn schedule(&mut self, time_ns: u64, event: JointEvent) {
        self.events.push((time_ns, event));
    }

    /// The plant, with the true position and friction.
    pub fn plant(&self) -> &JointPlant {
        self.rig.plant()
    }

    /// The rig, for inspection of driver and bridge.
    pub fn rig(&mut self) -> &mut JointRig {
        &mut self.rig
    }

    /// Returns how often the driver was restarted after a reset.
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    fn apply(&mut self, event: JointEvent) {
        match event {
            JointEvent::CableCut | JointEvent::CableRestored => {
                self.is_cut = event == JointEvent::CableCut;
                // Without a receiver nothing is acknowledged: a controller stops at error passive.
                let state = if self.is_cut { CanState::Passive } else { CanState::Active };
                self.rig.board_state_mut().can = state;
            }
            JointEvent::Encoder(fault) => {
                if let Some(board) = &mut self.rig.stage_mut().board {
                    board.set_encoder(fault);
                }
            }
            JointEvent::SealSensorsStuck => self.stuck = self.last_shown,
            JointEvent::SealSensorsRestored => self.stuck = None,
            JointEvent::ProcessorReset => self.rig.reset(),
            JointEvent::Supply(voltage_v) => self.rig.plant_mut().set_supply(voltage_v),
            JointEvent::Stop(position_rad) => self.rig.plant_mut().stop_rad = position_rad,
        }
    }

    /// Applies the events that are due, in the order of their times.
    fn apply_due_events(&mut self) {
        while let Some(at) = (0..self.events.len()).min_by_key(|at| self.events[*at].0)
            && self.events[at].0 <= self.simulated_until_ns
        {
            let (_, event) = self.events.remove(at);
            self.apply(event);
        }
    }

    /// Sends the frames of the sensors that are due.
    fn send_readings(&mut self) {
        let milliseconds = self.simulated_until_ns / MILLISECOND_NS;
        let is_seal_due = milliseconds.is_multiple_of(SEAL_INTERVAL_MS);
        if self.sensors.has_seal_sensors && is_seal_due {
            let shown = self.stuck.unwrap_or_else(|| self.rig.plant_mut().show());
            self.last_shown = Some(shown);
            let seal = SealFrame {
                radial_force_n: shown.radial_force_n as f32,
                pressure_diff_pa: shown.pressure_diff_pa as f32,
            };
            self.send_reading(Message::Seal(NODE, seal));
        }
        let is_temperature_due = milliseconds.is_multiple_of(THERMOMETER_INTERVAL_MS);
        if self.sensors.has_thermometer && is_temperature_due {
            let temperature_c = self.rig.plant().seal.shown_temperature_c() as f32;
            let surroundings = SurroundingsFrame { temperature_c, auxiliary: f32::NAN };
            self.send_reading(Message::Surroundings(NODE, surroundings));
        }
    }

    fn send_reading(&mut self, message: Message) {
        let frame = message.emit();
        self.rig.driver.receive(&frame);
        if let Some(outgoing) = &mut self.rig.received.outgoing_frames {
            outgoing.push_back(frame.into());
        }
    }

    /// Runs 1 ms.
    fn step(&mut self) {
        self.apply_due_events();
        self.send_readings();
        self.reset_ms = if self.rig.is_reset() { self.reset_ms + 1 } else { 0 };
        // A driver that cannot be restarted stays inactive.
        if self.reset_ms > RESTART_MS && self.rig.restart().is_ok() {
            (self.reset_ms, self.restarts) = (0, self.restarts + 1);
        } else {
            self.rig.step_idle();
        }
        self.simulated_until_ns += MILLISECOND_NS;
    }
}

impl Participant for MotorNode {
    fn receive(&mut self, frame: &CanFrame, _now_ns: u64) {
        if let Some(frame) = frame.to_joint().filter(|_| !self.is_cut) {
            self.rig.driver.receive(&frame);
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.simulated_until_ns =
            self.simulated_until_ns.max(now_ns.saturating_sub(MAX_CATCH_UP_MS * MILLISECOND_NS));
        while self.simulated_until_ns <= now_ns {
            self.step();
        }
        Some(now_ns + MILLISECOND_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        let outgoing = self.rig.received.outgoing_frames.as_mut()?;
        if self.is_cut {
            outgoing.clear();
        }
        outgoing.pop_front()
    }
}
