//! Tests of the whole driver in virtual time: CAN frames, background loop, queues, interrupt, bridge and plant.

use crate::plant::Machine;
use crate::rig::{PERIOD_CYCLES, Stage};
use compensator_core::can::{CommandFrame, Frame, Message, NodeId};
use firmware::background::{Background, Board, BoardState, RoundOutcome, TICK_US};
use firmware::control::BridgeFault;
use firmware::deadline::DeadlineLimits;
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{LoopParts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node::dictionary::index;
use firmware::node_settings::NodeSettings;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;
use std::collections::VecDeque;

const NODE: NodeId = NodeId::FIRST;
const PERIODS_PER_TICK: usize = 20;

/// A simulated board in virtual time.
struct SimulatedBoard {
    now_us: u64,
    received: VecDeque<Frame>,
    sent: Vec<Frame>,
    /// Number of frames that the transmit queue holds.
    room: usize,
    /// True if all frames have left the controller. Stays false if no other node acknowledges them.
    is_idle: bool,
    /// Time that passes with each reading of the clock, us.
    reading_us: u64,
    /// Number of readings of the board's state.
    state_reads: usize,
    /// Number of refreshes of the watchdog.
    watchdog_refreshes: usize,
    link: LoopLink<'static>,
}

impl Board for SimulatedBoard {
    const RESTART_FLUSH_US: u64 = 500;

    fn now_us(&mut self) -> u64 {
        self.now_us += self.reading_us;
        self.now_us
    }
    fn receive(&mut self) -> Option<Frame> {
        self.received.pop_front()
    }
    fn has_room(&mut self) -> bool {
        self.sent.len() < self.room
    }
    fn send(&mut self, frame: &Frame) {
        self.sent.push(*frame);
    }
    fn is_idle(&mut self) -> bool {
        self.is_idle
    }
    fn state(&mut self, _now_us: u64) -> BoardState {
        self.state_reads += 1;
        BoardState::default()
    }
    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        Some(&mut self.link)
    }
    fn refresh_watchdog(&mut self) {
        self.watchdog_refreshes += 1;
    }
}

/// A joint driver with its board, its current loop and the plant.
struct Joint {
    background: Background<MemoryFlash<4>>,
    board: SimulatedBoard,
    task: LoopTask,
    port: LoopPort<'static>,
    stage: Stage,
    commands: u8,
}

impl Joint {
    /// Returns a commissioned driver in NMT state operational, with the plant at rest.
    fn started() -> Self {
        let identity = Identity { hardware: "bench", serial: 7 };
        let driver = Driver::boot(
            NodeSettings::default(),
            MemoryFlash::new(),
            identity,
            &Boot::default(),
            0,
        );
        let task = LoopTask::new(
            LoopParts::build_or_measure_only(driver.set(), StageTraits::NONE),
            DeadlineLimits::for_period(PERIOD_CYCLES, 2000),
        );
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
            link,
        };
        let stage = Stage::new(Machine::default());
        let background = Background::new(driver, 0);
        let mut joint = Self { background, board, task, port, stage, commands: 0 };
        // The encoder's angle is valid after 0.1 s.
        joint.run_ms(150);
        joint.queue_frame(0, &[1, NODE.number()]);
        let wiring = joint.background.driver().set().wiring_crc();
        joint.write_object(index::COMMISSIONING, 3, wiring.to_le_bytes(), 4);
        joint.run_ms(1);
        joint
    }

    /// Queues a frame for the driver.
    fn queue_frame(&mut self, identifier: u16, data: &[u8]) {
        let frame = Frame::new(identifier, data).expect("a valid frame");
        self.board.received.push_back(frame);
    }

    /// Queues an expedited SDO download of the first `length` bytes of `value`.
    fn write_object(&mut self, index: u16, sub_index: u8, value: [u8; 4], length: u8) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value;
        let header = 0x23 | (4 - length) << 2;
        self.queue_frame(0x601, &[header, low, high, sub_index, a, b, c, d]);
    }

    /// Queues a write of the state request: 0 stops, 1 arms, 2 clears faults.
    fn request_state(&mut self, request: u8) {
        self.write_object(index::STATE, 1, [request, 0, 0, 0], 1);
    }

    /// Queues a current command.
    fn queue_command(&mut self, current_a: f32) {
        self.commands = self.commands.wrapping_add(1);
        let command = CommandFrame::new(current_a, 0.0, self.commands);
        self.board.received.push_back(Message::Command(NODE, command).emit());
    }

    /// Runs the interrupts of one tick.
    fn run_interrupts(&mut self) {
        for _ in 0..PERIODS_PER_TICK {
            let at = self.stage.cycles;
            self.task.interrupt(&mut self.stage, &mut self.port, at, at.wrapping_add(200));
            self.stage.advance();
        }
    }

    /// Runs one round of the background loop, a tick later.
    fn run_round(&mut self) -> RoundOutcome {
        self.board.now_us += TICK_US;
        self.background.round(&mut self.board)
    }

    /// Runs interrupts and background loop.
    fn run_ms(&mut self, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.run_interrupts();
            assert_eq!(self.run_round(), RoundOutcome::Sleep);
        }
    }

    /// Runs with a current command every millisecond.
    fn drive_ms(&mut self, current_a: f32, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.queue_command(current_a);
            self.run_ms(1);
        }
    }
}

#[test]
fn state_request_over_can_starts_and_stops_joint() {
    let mut joint = Joint::started();
    joint.drive_ms(5.0, 5);
    assert!(!joint.stage.is_on(), "a command alone enables the bridge");
    joint.request_state(1);
    joint.drive_ms(5.0, 100);
    assert!(joint.background.driver().is_armed() && joint.stage.is_on());
    let velocity = joint.stage.plant.velocity();
    assert!((0.5..3.0).contains(&velocity), "{velocity} rad/s");
    joint.request_state(0);
    joint.drive_ms(5.0, 2);
    assert!(!joint.stage.is_on());
}

#[test]
fn committed_set_reaches_loop_before_later_requests() {
    let mut joint = Joint::started();
    let names = firmware::control::MotorParameters::NAMES.iter();
    let sub_index = names.take_while(|name| **name != "current_limit_a").count() as u8 + 1;
    joint.write_object(index::MOTOR, sub_index, 2f32.to_le_bytes(), 4);
    joint.queue_frame(0x601, &[0x40, 0x27, 0x20, 2, 0, 0, 0, 0]);
    joint.run_ms(1);
    let answer = joint.board.sent.last().expect("the staged CRC").data();
    let crc = answer[4..8].try_into().expect("four bytes");
    joint.write_object(index::COMMIT, 3, crc, 4);
    joint.request_state(1);
    joint.drive_ms(10.0, 2);
    joint.request_state(1);
    joint.drive_ms(10.0, 20);
    assert!(joint.stage.is_on());
    let largest =
        joint.stage.plant.phase_currents().into_iter().fold(0.0, |a, b| f64::max(a, b.abs()));
    assert!((0.5..2.4).contains(&largest), "{largest} A");
}

#[test]
fn stopped_loop_ends_watchdog_refresh_and_raises_fault() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 5);
    assert!(joint.background.driver().is_armed());
    let missing =
        |joint: &Joint| joint.background.driver().supervisor().faults().contains(Code::AdcTimeout);
    assert!(!missing(&joint));
    let watchdog_refreshes = joint.board.watchdog_refreshes;
    for _ in 0..20 {
        joint.queue_command(1.0);
        assert_eq!(joint.run_round(), RoundOutcome::Sleep);
    }
    // A report is valid for 5 ms.
    assert_eq!(joint.board.watchdog_refreshes - watchdog_refreshes, 4);
    assert!(missing(&joint) && !joint.background.driver().is_armed());
}

#[test]
fn answers_with_full_transmit_queue_wait_for_room() {
    let mut joint = Joint::started();
    joint.board.sent.clear();
    joint.board.room = 1;
    for _ in 0..3 {
        joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    }
    joint.run_ms(3);
    assert_eq!(joint.board.sent.len(), 1);
    joint.board.room = usize::MAX;
    joint.run_ms(1);
    assert_eq!(joint.board.sent.len(), 3);
}

#[test]
fn missed_ticks_are_skipped() {
    let mut joint = Joint::started();
    let state_reads = joint.board.state_reads;
    joint.board.now_us += 100 * TICK_US;
    joint.run_ms(1);
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Sleep);
    assert_eq!(joint.board.state_reads - state_reads, 1);
    // After a delay of less than a tick, the next tick keeps its time.
    joint.board.now_us += TICK_US / 2;
    joint.run_ms(1);
    joint.board.now_us += TICK_US / 2;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Sleep);
    assert_eq!(joint.board.state_reads - state_reads, 3);
}

#[test]
fn restart_waits_for_last_frames_or_timeout() {
    let mut joint = Joint::started();
    joint.board.sent.clear();
    joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.queue_frame(0, &[0x81, NODE.number()]);
    joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.board.is_idle = false;
    joint.board.reading_us = 1;
    joint.run_interrupts();
    assert_eq!(joint.run_round(), RoundOutcome::Restart);
    assert_eq!(joint.board.sent.len(), 1, "a frame was processed after the restart request");
    let began_us = joint.board.now_us;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Restart);
    assert!((500..520).contains(&(joint.board.now_us - began_us)));
    joint.board.is_idle = true;
    let began_us = joint.board.now_us;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Restart);
    assert!(joint.board.now_us - began_us < 10);
}

/// The amplifiers' offsets drift as they warm up. The driver measures them with the bridge open at each arming.
#[test]
fn shunt_offset_is_removed_at_next_arming() {
    let current_error = |offset_a: [f64; 3], is_before_arming: bool| {
        let mut joint = Joint::started();
        if is_before_arming {
            joint.stage.shunt_offset_a = offset_a;
        }
        joint.drive_ms(0.0, 5);
        joint.request_state(1);
        joint.drive_ms(0.0, 20);
        joint.stage.shunt_offset_a = offset_a;
        joint.drive_ms(0.0, 50);
        assert!(joint.background.driver().is_armed() && joint.stage.is_on());
        // The plant's largest phase current while the loop measures 0 A.
        joint.stage.plant.phase_currents().into_iter().fold(0.0, |a, b| f64::max(a, b.abs()))
    };
    let offset_a = [0.3, -0.26, 0.0];
    let (after, before) = (current_error(offset_a, false), current_error(offset_a, true));
    assert!((0.15..0.6).contains(&after), "offset after arming: {after} A");
    assert!(before < 0.08, "offset before arming: {before} A");
}

/// The gate driver latches its fault until its enable input is low. A first "clear" over CAN may only lower the enable
/// input; a second one then clears the fault.
#[test]
fn latched_gate_driver_fault_is_cleared_over_can() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
    (joint.stage.fault, joint.stage.has_latched_fault) = (Some(BridgeFault::GateDriver), true);
    joint.drive_ms(1.0, 1);
    assert!(!joint.stage.is_on() && !joint.stage.is_awake, "duties off and gate driver disabled");
    let has = |joint: &Joint, code| joint.background.driver().supervisor().faults().contains(code);
    joint.drive_ms(1.0, 50);
    assert!(
        has(&joint, Code::GateDriverFault)
            && joint.stage.is_awake
            && !joint.stage.has_latched_fault
    );
    assert!(!has(&joint, Code::CurrentSensorInvalid), "disabled amplifiers reported as faulty");
    joint.request_state(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    // With the bridge off, a fault does not lower the enable input. The first "clear" does.
    (joint.stage.fault, joint.stage.has_latched_fault) = (Some(BridgeFault::GateDriver), true);
    joint.drive_ms(1.0, 50);
    assert!(has(&joint, Code::GateDriverFault) && joint.stage.has_latched_fault);
    joint.request_state(2);
    joint.drive_ms(1.0, 30);
    assert!(has(&joint, Code::GateDriverFault) && !joint.stage.has_latched_fault);
    joint.request_state(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
}

#[test]
fn system_break_is_distinguished_from_gate_driver_fault() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    joint.stage.fault = Some(BridgeFault::System);
    joint.drive_ms(1.0, 3);
    assert!(!joint.stage.is_on());
    let supervisor = joint.background.driver().supervisor();
    assert!(supervisor.faults().contains(Code::SystemBreak));
    assert!(!supervisor.faults().contains(Code::GateDriverFault));
}
