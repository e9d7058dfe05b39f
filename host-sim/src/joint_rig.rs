//! The shipped joint driver on the simulated joint: CAN frames, background loop, queues, interrupt, bridge, plant.
//!
//! ```text
//! master (1 kHz) -- frames, maybe late --> Driver -- orders --> LoopTask (20 kHz) --> bridge --> JointPlant
//!        ^------ Motion, at each SYNC --------'        ^------- currents, encoder --------------'
//! ```
//! All of the driver is the firmware's own code, as it runs on the board; the plant
//! ([`simulated_machines::joint_plant`]) knows nothing of it. Time is virtual, and the same seed gives the same bits. The master
//! is whoever calls [`JointRig::millisecond`]: the firmware controls current, so velocity and position loops lie above
//! it, as they would on a robot's own computer. Sensors of side load, pressure and temperature answer on the bus.

mod faults;
mod stage;

pub use faults::{Faults, SealSensor};
pub use stage::Stage;

use compensator_core::can::{Command, Frame, Message, Node, Seal, Surroundings, Sync};
use faults::Line;
use firmware::background::{Background, BoardState, TICK_US};
use firmware::control::PERIOD_S;
use firmware::deadline::Limits;
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{Parts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node::dictionary::index;
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use firmware::store::Store;
use firmware::store::memory::MemoryFlash;
use simulated_machines::joint_plant::JointPlant;
use stage::PERIOD_CYCLES;

const NODE: Node = Node::FIRST;

/// Periods of the current loop in a millisecond.
const PERIODS: usize = (1e-3 / PERIOD_S + 0.5) as usize;

/// The observer's angle is believed after this, ms (a triple pole at 100 Hz, with room).
const SETTLE_MS: usize = 150;

/// The bridge is given its offsets within this after arming, ms.
const ARM_MS: usize = 60;

/// Surroundings are sent once in so many milliseconds: a thermometer is slow.
const SURROUNDINGS_EVERY: u32 = 50;

/// What the master heard last, and what the loop did: all as the frames say it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heard {
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Position, rad; NaN where it is not known.
    pub position_rad: f32,
    /// Current, A.
    pub current_a: f32,
    /// The model's friction, Nm.
    pub friction_torque_nm: f32,
    /// What no part of the model explains, Nm.
    pub residual_torque_nm: f32,
}

/// A driver on its joint.
pub struct JointRig<'q> {
    background: Background<MemoryFlash<4>>,
    task: LoopTask,
    port: LoopPort<'q>,
    link: LoopLink<'q>,
    stage: Stage,
    faults: Faults,
    line: Line,
    /// What a sensor said before it stuck: side load, N, and pressure, Pa.
    stuck: Option<[f64; 2]>,
    now_us: u64,
    milliseconds: u32,
    commands: u8,
    heard: Heard,
    answers: Vec<Frame>,
}

/// Starts a driver with this parameter set on a plant, arms it, and lets `work` be its master.
///
/// # Errors
/// The set is refused, or the driver does not arm; one line.
pub fn with_joint<R>(
    set: &ParameterSet,
    plant: JointPlant,
    faults: Faults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, String> {
    Parts::build(set, StageTraits::NONE, PERIOD_S).map_err(|refused| refused.to_string())?;
    let settings = NodeSettings { commissioned: set.wiring_crc(), ..NodeSettings::default() };
    let mut store = Store::open(MemoryFlash::<4>::new());
    store.save(&emit_block(&settings, set)).map_err(|error| format!("flash: {error:?}"))?;
    let identity = Identity { hardware: "simulated joint", serial: 1 };
    let driver = Driver::boot(settings, store.release(), identity, &Boot::default(), 0);
    let task = LoopTask::new(
        Parts::first(driver.set(), StageTraits::NONE),
        Limits::of_period(PERIOD_CYCLES, 2000),
    );
    let mut queues = LoopQueues::new();
    let (port, link) = queues.split(StageTraits::NONE, 0);
    let line = Line::new(&faults);
    let start_rad = plant.position_rad();
    let mut rig = JointRig {
        background: Background::new(driver, 0),
        task,
        port,
        link,
        stage: Stage::new(plant, &faults),
        faults,
        line,
        stuck: None,
        now_us: 0,
        milliseconds: 0,
        commands: 0,
        heard: Heard::default(),
        answers: Vec::new(),
    };
    rig.start(start_rad)?;
    Ok(work(&mut rig))
}

impl JointRig<'_> {
    fn start(&mut self, position_rad: f64) -> Result<(), String> {
        // The background is not asked before the interrupt has run: it would find no conversion.
        self.periods();
        (0..SETTLE_MS).for_each(|_| self.pass());
        self.give(0, &[1, NODE.number()]);
        self.write(index::STATE, 6, (position_rad as f32).to_le_bytes());
        (0..5).for_each(|_| self.millisecond(0.0, 0.0));
        self.request(1);
        for _ in 0..ARM_MS {
            self.millisecond(0.0, 0.0);
        }
        if self.is_armed() {
            return Ok(());
        }
        let faults: Vec<&str> =
            self.driver().supervisor().faults().iter().map(|code| code.info().name).collect();
        Err(format!("the driver does not arm: {}", faults.join(", ")))
    }

    /// One millisecond under a command: current before compensation, A, and the velocity the joint is meant to
    /// have, rad/s.
    pub fn millisecond(&mut self, current_a: f32, velocity_reference_rad_s: f32) {
        self.commands = self.commands.wrapping_add(1);
        let command = Command::new(current_a, velocity_reference_rad_s, self.commands);
        self.line.send(Message::Command(NODE, command).emit());
        let shown = self.stage.plant.show();
        if let Some(seal) = self.faults.seal(self.milliseconds, &shown, &mut self.stuck) {
            let seal = Seal {
                radial_force_n: seal.radial_force_n as f32,
                pressure_diff_pa: seal.pressure_diff_pa as f32,
            };
            self.line.send(Message::Seal(NODE, seal).emit());
            // A joint on its own sensors is told the load as an object: its Torque frame is its own.
            self.line.send(sdo(index::INPUTS, 4, (shown.load_torque_nm as f32).to_le_bytes()));
        }
        if self.milliseconds.is_multiple_of(SURROUNDINGS_EVERY) {
            let temperature_c = shown.temperature_c as f32;
            let of = Surroundings { temperature_c, auxiliary: f32::NAN };
            self.line.send(Message::Surroundings(NODE, of).emit());
        }
        while let Some(frame) = self.line.receive() {
            self.background.receive(&frame, self.now_us);
        }
        self.pass();
    }

    /// A millisecond in which nobody commands.
    fn pass(&mut self) {
        self.now_us += TICK_US;
        self.background.tick(&BoardState::default(), Some(&mut self.link), self.now_us);
        let sync = Message::Sync(Sync::of(self.milliseconds)).emit();
        self.background.receive(&sync, self.now_us);
        while let Some(frame) = self.background.transmit() {
            self.hear(&frame);
        }
        self.periods();
        self.line.tick();
        self.milliseconds += 1;
    }

    fn periods(&mut self) {
        for _ in 0..PERIODS {
            let at = self.stage.cycles();
            self.task.interrupt(&mut self.stage, &mut self.port, at, at.wrapping_add(200));
            self.stage.pass();
        }
    }

    fn hear(&mut self, frame: &Frame) {
        match Message::parse(frame) {
            Ok(Message::Motion(_, motion)) => {
                self.heard.velocity_rad_s = motion.velocity_rad_s;
                self.heard.position_rad = motion.position_rad;
            }
            Ok(Message::Telemetry(_, told)) => {
                self.heard.current_a = told.current_a;
                self.heard.residual_torque_nm = told.residual_torque_nm;
            }
            Ok(Message::Answer(_, answer)) => {
                self.heard.friction_torque_nm = answer.friction_torque_nm;
            }
            Ok(_) => {}
            // Not a process frame: an answer of the object server, or an emergency.
            Err(_) => self.answers.push(*frame),
        }
    }

    /// What the master heard last.
    pub fn heard(&self) -> &Heard {
        &self.heard
    }

    /// The plant, to be looked at.
    pub fn plant(&self) -> &JointPlant {
        &self.stage.plant
    }

    /// The plant, to be warmed, worn or sunk.
    pub fn plant_mut(&mut self) -> &mut JointPlant {
        &mut self.stage.plant
    }

    /// The driver, to be looked at.
    pub fn driver(&self) -> &Driver<MemoryFlash<4>> {
        self.background.driver()
    }

    /// Whether it is armed.
    pub fn is_armed(&self) -> bool {
        self.driver().is_armed()
    }

    /// Frames that were no process data since the last call: object answers, emergencies.
    pub fn take_answers(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.answers)
    }

    /// Gives the driver a frame at once.
    fn give(&mut self, identifier: u16, data: &[u8]) {
        if let Some(frame) = Frame::new(identifier, data) {
            self.background.receive(&frame, self.now_us);
        }
    }

    /// Writes an object of four bytes.
    pub fn write(&mut self, index: u16, sub_index: u8, value: [u8; 4]) {
        let frame = sdo(index, sub_index, value);
        self.background.receive(&frame, self.now_us);
    }

    /// Asks the driver to arm (1), disarm (0) or clear its faults (2).
    pub fn request(&mut self, request: u8) {
        let [low, high] = index::STATE.to_le_bytes();
        self.give(0x600 + u16::from(NODE.number()), &[0x2F, low, high, 1, request, 0, 0, 0]);
    }
}

/// An expedited download of four bytes.
fn sdo(index: u16, sub_index: u8, value: [u8; 4]) -> Frame {
    let [low, high] = index.to_le_bytes();
    let [a, b, c, d] = value;
    let identifier = 0x600 + u16::from(NODE.number());
    Frame::new(identifier, &[0x23, low, high, sub_index, a, b, c, d])
        .unwrap_or_else(|| Message::Sync(Sync::of(0)).emit())
}
