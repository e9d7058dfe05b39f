//! A whole joint driver in virtual time: CAN frames, background loop, queues, interrupt, bridge and plant.

use super::plant::Machine;
use super::rig::{PERIOD_CYCLES, Stage};
use compensator_core::can::{CommandFrame, Frame, Message, NodeId};
use firmware::access::AccessSettings;
use firmware::background::{Background, Board, BoardState, RoundOutcome, TICK_US};
use firmware::deadline::DeadlineLimits;
use firmware::driver::{Boot, Device, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::StageTraits;
use firmware::loop_task::LoopTask;
use firmware::node::dictionary::index;
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use firmware::sensors::{SensorParameters, enclosure};
use firmware::store::Store;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;
use std::collections::VecDeque;

pub const NODE: NodeId = NodeId::FIRST;
const PERIODS_PER_TICK: usize = 20;

/// A simulated board in virtual time.
pub struct SimulatedBoard {
    pub now_us: u64,
    pub received: VecDeque<Frame>,
    pub sent: Vec<Frame>,
    /// Number of frames that the transmit queue holds.
    pub room: usize,
    /// True if all frames have left the controller. Stays false if no other node acknowledges them.
    pub is_idle: bool,
    /// Time that passes with each reading of the clock, us.
    pub reading_us: u64,
    /// Number of readings of the board's state.
    pub state_reads: usize,
    /// Number of refreshes of the watchdog.
    pub watchdog_refreshes: usize,
    /// Time of the last refresh, and the longest time from one to the next, us.
    pub refreshed_us: u64,
    pub longest_pause_us: u64,
    /// Time that each received frame takes, us.
    pub frame_us: u64,
    /// Constants of the sensors that the background applied last.
    pub sensors: SensorParameters,
    /// Readings of the dry side.
    pub enclosure: enclosure::Readings,
    pub link: LoopLink<'static>,
}

impl Board for SimulatedBoard {
    const RESTART_FLUSH_US: u64 = 500;

    fn now_us(&mut self) -> u64 {
        self.now_us += self.reading_us;
        self.now_us
    }
    fn receive(&mut self) -> Option<Frame> {
        let frame = self.received.pop_front()?;
        self.now_us += self.frame_us;
        Some(frame)
    }
    fn has_room_for(&mut self, _identifier: u16) -> bool {
        self.sent.len() < self.room
    }
    fn send(&mut self, frame: &Frame) {
        self.sent.push(*frame);
    }
    fn is_idle(&mut self) -> bool {
        self.is_idle
    }
    fn apply_sensors(&mut self, sensors: &SensorParameters) {
        self.sensors = *sensors;
    }
    fn state(&mut self, _now_us: u64) -> BoardState {
        self.state_reads += 1;
        BoardState { enclosure: self.enclosure, ..BoardState::default() }
    }
    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        Some(&mut self.link)
    }
    fn refresh_watchdog(&mut self) {
        self.watchdog_refreshes += 1;
        self.longest_pause_us = self.longest_pause_us.max(self.now_us - self.refreshed_us);
        self.refreshed_us = self.now_us;
    }
}

/// A joint driver with its board, its current loop and the plant.
pub struct Joint {
    pub background: Background<Device<MemoryFlash<4>>>,
    pub board: SimulatedBoard,
    pub task: LoopTask,
    pub port: LoopPort<'static>,
    pub stage: Stage,
    pub commands: u8,
}

/// Returns the settings of a joint that needs no unlock: these tests write its objects as frames.
fn open_settings() -> NodeSettings {
    let access = AccessSettings { is_locked: false, ..AccessSettings::default() };
    NodeSettings { access, ..NodeSettings::default() }
}

impl Joint {
    /// Returns a commissioned driver in NMT state operational, with the plant at rest.
    pub fn started() -> Self {
        Self::start(Machine::default(), MemoryFlash::new())
    }

    /// Returns a commissioned driver with this parameter set on this plant.
    pub fn with(machine: Machine, set: &ParameterSet) -> Self {
        let mut store = Store::open(MemoryFlash::new());
        store
            .save(&emit_block(&open_settings(), set), &open_settings().identity())
            .expect("the flash works");
        Self::start(machine, store.into_flash())
    }

    /// Starts a driver with this content of its flash, and confirms its wiring.
    pub fn start(machine: Machine, flash: MemoryFlash<4>) -> Self {
        let mut joint = Self::restarted(machine, flash);
        joint.confirm_wiring();
        joint
    }

    /// Starts a driver with this content of its flash, in NMT state operational.
    pub fn restarted(machine: Machine, flash: MemoryFlash<4>) -> Self {
        let identity = Identity { hardware: "bench", serial: 7, stage: StageTraits::NONE };
        let driver = Driver::boot(open_settings(), flash, identity, &Boot::default(), 0);
        let (port, link) = Box::leak(Box::new(LoopQueues::new())).split(StageTraits::NONE, 0);
        let board = SimulatedBoard {
            now_us: 0,
            received: VecDeque::new(),
            sent: Vec::new(),
            room: usize::MAX,
            is_idle: true,
            reading_us: 0,
            state_reads: 0,
            watchdog_refreshes: 0,
            refreshed_us: 0,
            longest_pause_us: 0,
            frame_us: 0,
            sensors: SensorParameters::default(),
            enclosure: enclosure::Readings::default(),
            link,
        };
        let stage = Stage::new(machine);
        let mut background = Background::new(driver, 0);
        let task = background.loop_task(DeadlineLimits::for_period(PERIOD_CYCLES, 2000));
        let mut joint = Self { background, board, task, port, stage, commands: 0 };
        // The encoder's angle is valid after 0.1 s.
        joint.run_ms(150);
        joint.queue_frame(0, &[1, NODE.number()]);
        joint.run_ms(1);
        joint
    }

    /// Confirms the wiring parameters in use.
    pub fn confirm_wiring(&mut self) {
        let wiring = self.background.node().joint.set().wiring_crc();
        self.write_object(index::COMMISSIONING, 3, wiring.to_le_bytes(), 4);
        self.run_ms(1);
    }

    /// Commits the staged set.
    pub fn commit_staged(&mut self) {
        self.run_ms(1);
        self.queue_frame(0x601, &[0x40, 0x27, 0x20, 2, 0, 0, 0, 0]);
        self.run_ms(1);
        let answer = self.board.sent.last().expect("the staged CRC").data();
        let crc = answer[4..8].try_into().expect("four bytes");
        self.write_object(index::COMMIT, 3, crc, 4);
        self.run_ms(1);
    }

    /// Returns the content of the flash, as a reset leaves it.
    pub fn into_flash(self) -> MemoryFlash<4> {
        self.background.into_node().joint.into_flash()
    }

    /// Queues a frame for the driver.
    pub fn queue_frame(&mut self, identifier: u16, data: &[u8]) {
        let frame = Frame::new(identifier, data).expect("a valid frame");
        self.board.received.push_back(frame);
    }

    /// Queues an expedited SDO download of the first `length` bytes of `value`.
    pub fn write_object(&mut self, index: u16, sub_index: u8, value: [u8; 4], length: u8) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value;
        let header = 0x23 | (4 - length) << 2;
        self.queue_frame(0x601, &[header, low, high, sub_index, a, b, c, d]);
    }

    /// Queues a write of the state request: 0 stops, 1 arms, 2 clears faults.
    pub fn request_state(&mut self, request: u8) {
        self.write_object(index::STATE, 1, [request, 0, 0, 0], 1);
    }

    /// Queues a current command.
    pub fn queue_command(&mut self, current_a: f32) {
        self.commands = self.commands.wrapping_add(1);
        let command = CommandFrame::new(current_a, 0.0, self.commands);
        self.board.received.push_back(Message::Command(NODE, command).emit());
    }

    /// Runs the interrupts of one tick.
    pub fn run_interrupts(&mut self) {
        for _ in 0..PERIODS_PER_TICK {
            let at = self.stage.cycles;
            self.task.interrupt(&mut self.stage, &mut self.port, at, at.wrapping_add(200));
            self.stage.advance();
        }
    }

    /// Runs the background loop for a tick: the frames that wait, and then the tick.
    pub fn run_round(&mut self) -> RoundOutcome {
        let outcome = self.background.round(&mut self.board);
        if outcome == RoundOutcome::Restart {
            return outcome;
        }
        self.board.now_us += TICK_US;
        self.background.round(&mut self.board)
    }

    /// Runs interrupts and background loop.
    pub fn run_ms(&mut self, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.run_interrupts();
            assert_eq!(self.run_round(), RoundOutcome::Sleep);
        }
    }

    /// Runs with a current command every millisecond.
    pub fn drive_ms(&mut self, current_a: f32, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.queue_command(current_a);
            self.run_ms(1);
        }
    }

    /// Selects a mode of CiA 402, and enables the drive at rest.
    pub fn enable_mode(&mut self, mode: u8) {
        self.write_object(index::MODE, 0, [mode, 0, 0, 0], 1);
        for word in [0x06, 0x07, 0x0F] {
            (0..10).for_each(|_| self.drive_velocity(word, 0.0));
        }
        assert!(self.background.node().joint.is_armed());
    }

    /// Sends a controlword and a target velocity, rad/s, and runs 1 ms.
    pub fn drive_velocity(&mut self, controlword: u16, velocity_rad_s: f64) {
        let mut data = [0; 8];
        data[..2].copy_from_slice(&controlword.to_le_bytes());
        data[4..].copy_from_slice(&((1e6 * velocity_rad_s).round() as i32).to_le_bytes());
        self.queue_frame(0x200 + u16::from(NODE.number()), &data);
        self.run_ms(1);
    }

    /// Returns true if this fault is latched.
    pub fn has_fault(&self, code: Code) -> bool {
        self.background.node().joint.supervisor().faults().contains(code)
    }
}
