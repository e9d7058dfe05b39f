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

mod board;
mod bus;
mod faults;
mod node;
mod stage;

pub use board::{BoardSensors, EncoderFault, TRAITS as BOARD_TRAITS};
pub use bus::RigBus;
pub use faults::{Faults, SealSensor};
pub use node::MotorNode;
pub use stage::{Extremes, Interrupt, PERIOD_CYCLES, Stage};

use canopen_rs::Address;
use compensator_core::can::{Command, Frame, Message, Node, Seal, Surroundings, Sync};
use faults::Line;
use firmware::background::{Background, BoardState, TICK_US};
use firmware::control::{PERIOD_S, PowerStage};
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
use joint_bus::canopen::Client;
use simulated_machines::joint_plant::JointPlant;
use std::collections::VecDeque;

const NODE: Node = Node::FIRST;

/// Periods of the current loop in a millisecond.
const PERIODS: usize = (1e-3 / PERIOD_S + 0.5) as usize;

/// The observer's angle is believed after this, ms (a triple pole at 100 Hz, with room).
pub const SETTLE_MS: usize = 150;

/// A watchdog nobody feeds for so long resets the processor, ms: the board's.
pub const WATCHDOG_MS: u32 = 50;

/// Frames that wait for the background, at most: the board's queue.
const FRAMES: usize = 64;

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
    /// What goes out, where somebody carries it on to a bus.
    outgoing: Option<VecDeque<Frame>>,
    /// Milliseconds the background still stands still, and what came in the meantime.
    stalled_ms: u32,
    waiting: VecDeque<Frame>,
    /// Milliseconds since the watchdog was fed, and whether it has reset the processor.
    unfed_ms: u32,
    reset: bool,
    /// Somebody sends a SYNC every millisecond.
    syncs: bool,
    surroundings: BoardState,
}

/// How a driver begins its life.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// What its flash holds; nothing of a blank one.
    pub set: Option<&'a ParameterSet>,
    /// Somebody has confirmed the wiring.
    pub commissioned: bool,
    /// Sensors and traits of the driver's board, in place of ideal ones.
    pub board: bool,
    /// How the last life ended.
    pub boot: Boot<'a>,
}

impl Default for Start<'_> {
    /// A blank flash on the board.
    fn default() -> Self {
        Self { set: None, commissioned: false, board: true, boot: Boot::default() }
    }
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
    let start = Start { set: Some(set), commissioned: true, board: false, boot: Boot::default() };
    let position_rad = plant.position_rad();
    with_driver(&start, plant, faults, |rig| rig.arm(position_rad).map(|()| work(rig)))?
}

/// Starts a driver at power-up, its bridge open, and lets `work` be its master.
///
/// # Errors
/// The set is refused; one line.
pub fn with_driver<R>(
    start: &Start,
    plant: JointPlant,
    faults: Faults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, String> {
    let mut queues = LoopQueues::new();
    start_driver(&mut queues, start, plant, faults).map(|mut rig| work(&mut rig))
}

/// The same; the driver is given back, between these queues.
fn start_driver<'q>(
    queues: &'q mut LoopQueues,
    start: &Start,
    mut plant: JointPlant,
    faults: Faults,
) -> Result<JointRig<'q>, String> {
    let traits = if start.board { BOARD_TRAITS } else { StageTraits::NONE };
    let mut store = Store::open(MemoryFlash::<4>::new());
    let mut settings = NodeSettings::default();
    if let Some(set) = start.set {
        Parts::build(set, traits, PERIOD_S).map_err(|refused| refused.to_string())?;
        settings.commissioned = if start.commissioned { set.wiring_crc() } else { 0 };
        let block = emit_block(&settings, set);
        store.save(&block).map_err(|error| format!("flash: {error:?}"))?;
    }
    let identity = Identity { hardware: "simulated joint", serial: 1 };
    let driver = Driver::boot(settings, store.release(), identity, &start.boot, 0);
    let task =
        LoopTask::new(Parts::first(driver.set(), traits), Limits::of_period(PERIOD_CYCLES, 2000));
    let (port, link) = queues.split(traits, 0);
    let line = Line::new(&faults);
    let board = start.board.then(|| BoardSensors::start(&mut plant, faults.seed));
    let mut stage = Stage::new(plant, &faults);
    stage.board = board;
    let mut rig = JointRig {
        background: Background::new(driver, 0),
        task,
        port,
        link,
        stage,
        faults,
        line,
        stuck: None,
        now_us: 0,
        milliseconds: 0,
        commands: 0,
        heard: Heard::default(),
        answers: Vec::new(),
        outgoing: None,
        stalled_ms: 0,
        waiting: VecDeque::new(),
        unfed_ms: 0,
        reset: false,
        syncs: true,
        surroundings: BoardState::default(),
    };
    // The background is not asked before the interrupt has run: it would find no conversion.
    rig.periods();
    (0..SETTLE_MS).for_each(|_| rig.pass());
    Ok(rig)
}

impl JointRig<'_> {
    /// Starts the node, says where the joint is, and arms it, at 0 A.
    ///
    /// # Errors
    /// It does not arm; one line that names what stands against it.
    pub fn arm(&mut self, position_rad: f64) -> Result<(), String> {
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
        let mut client = Client::new(RigBus::new(self), NODE);
        let why = client.read_text(Address::new(index::REFUSAL, 0));
        Err(format!("the driver does not arm: {}", why.map_err(|error| error.to_string())?))
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
            self.deliver(frame);
        }
        self.pass();
    }

    /// A millisecond in which nobody commands.
    pub fn pass(&mut self) {
        self.now_us += TICK_US;
        if self.stalled_ms == 0 && !self.reset {
            while let Some(frame) = self.waiting.pop_front() {
                self.background.receive(&frame, self.now_us);
            }
            let link = Some(&mut self.link);
            if self.background.tick(&self.surroundings, link, self.now_us) {
                self.unfed_ms = 0;
            }
        }
        if self.syncs {
            self.deliver(Message::Sync(Sync::of(self.milliseconds)).emit());
        }
        while self.stalled_ms == 0
            && let Some(frame) = self.background.transmit()
        {
            self.hear(&frame);
        }
        self.stalled_ms = self.stalled_ms.saturating_sub(1);
        self.unfed_ms += 1;
        if self.unfed_ms > WATCHDOG_MS {
            self.reset = true;
        }
        self.periods();
        self.line.tick();
        self.milliseconds += 1;
    }

    /// Gives the background a frame, or keeps it until it is back.
    fn deliver(&mut self, frame: Frame) {
        if self.stalled_ms == 0 && !self.reset {
            self.background.receive(&frame, self.now_us);
        } else if self.waiting.len() < FRAMES {
            self.waiting.push_back(frame);
        }
    }

    fn periods(&mut self) {
        for _ in 0..PERIODS {
            if self.reset {
                // The timer is reset with the processor: its outputs are at their idle level.
                self.stage.off();
            } else if let Some(late) = self.stage.interrupt() {
                let at = self.stage.cycles();
                let now = at.wrapping_add(200 + late);
                self.task.interrupt(&mut self.stage, &mut self.port, at, now);
            }
            self.stage.pass();
        }
    }

    /// The background stands still for so many milliseconds, as in a long transfer; the interrupt goes on.
    pub fn stall(&mut self, milliseconds: u32) {
        self.stalled_ms = milliseconds;
    }

    /// Nobody sends SYNCs any more.
    pub fn stop_sync(&mut self) {
        self.syncs = false;
    }

    /// Whether the watchdog has reset the processor, which then does nothing any more here: its next life is another rig.
    pub fn is_reset(&self) -> bool {
        self.reset
    }

    /// What the board finds around itself: temperatures, stack, bus.
    pub fn surroundings_mut(&mut self) -> &mut BoardState {
        &mut self.surroundings
    }

    /// The power stage, to be looked at and to be broken.
    pub fn stage_mut(&mut self) -> &mut Stage {
        &mut self.stage
    }

    fn hear(&mut self, frame: &Frame) {
        if let Some(outgoing) = &mut self.outgoing {
            return outgoing.push_back(*frame);
        }
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
    pub fn give(&mut self, identifier: u16, data: &[u8]) {
        if let Some(frame) = Frame::new(identifier, data) {
            self.background.receive(&frame, self.now_us);
        }
    }

    /// Writes an object of four bytes.
    pub fn write(&mut self, index: u16, sub_index: u8, value: [u8; 4]) {
        let frame = sdo(index, sub_index, value);
        self.background.receive(&frame, self.now_us);
    }

    /// Writes an object of one byte.
    pub fn write_byte(&mut self, index: u16, sub_index: u8, value: u8) {
        let [low, high] = index.to_le_bytes();
        self.give(0x600 + u16::from(NODE.number()), &[0x2F, low, high, sub_index, value, 0, 0, 0]);
    }

    /// Reads an object of at most four bytes, which takes a millisecond; `None` where it is refused.
    pub fn read(&mut self, index: u16, sub_index: u8) -> Option<u32> {
        let [low, high] = index.to_le_bytes();
        self.answers.clear();
        self.give(0x600 + u16::from(NODE.number()), &[0x40, low, high, sub_index, 0, 0, 0, 0]);
        self.pass();
        self.answers.iter().find_map(|frame| match *frame.data() {
            // An answer at once: 0100 nn11, nn bytes of four unused.
            [head, l, h, s, a, b, c, d]
                if head & 0xF3 == 0x43 && [l, h, s] == [low, high, sub_index] =>
            {
                let word = u32::from_le_bytes([a, b, c, d]);
                Some(word & (u32::MAX >> (8 * ((head >> 2) & 3))))
            }
            _ => None,
        })
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
