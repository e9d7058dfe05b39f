//! A whole joint driver in virtual time: CAN frames, background loop, queues, interrupt, bridge, plant.

use crate::plant::Machine;
use crate::rig::{PERIOD_CYCLES, Stage};
use compensator_core::can::{Command, Frame, Message, Node};
use firmware::background::{Background, Board, BoardState, Next, TICK_US};
use firmware::control::Broke;
use firmware::deadline::Limits;
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{Parts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node::dictionary::index;
use firmware::node_settings::NodeSettings;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;
use std::collections::VecDeque;

const NODE: Node = Node::FIRST;
const PERIODS_PER_TICK: usize = 20;

/// The wires of a board, in virtual time.
struct Wires {
    now_us: u64,
    received: VecDeque<Frame>,
    sent: Vec<Frame>,
    room: usize,
    /// A bus nobody acknowledges on never sends its last frame.
    is_idle: bool,
    /// How far the clock moves when it is read, us.
    reading_us: u64,
    looked: usize,
    fed: usize,
    link: LoopLink<'static>,
}

impl Board for Wires {
    const FAREWELL_US: u64 = 500;

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
        self.looked += 1;
        BoardState::default()
    }
    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        Some(&mut self.link)
    }
    fn feed_watchdog(&mut self) {
        self.fed += 1;
    }
}

struct Joint {
    background: Background<MemoryFlash<4>>,
    wires: Wires,
    task: LoopTask,
    port: LoopPort<'static>,
    stage: Stage,
    commands: u8,
}

impl Joint {
    /// A driver that has started, operational, on a plant at rest.
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
            Parts::first(driver.set(), StageTraits::NONE),
            Limits::of_period(PERIOD_CYCLES, 2000),
        );
        let (port, link) = Box::leak(Box::new(LoopQueues::new())).split(StageTraits::NONE, 0);
        let wires = Wires {
            now_us: 0,
            received: VecDeque::new(),
            sent: Vec::new(),
            room: usize::MAX,
            is_idle: true,
            reading_us: 0,
            looked: 0,
            fed: 0,
            link,
        };
        let stage = Stage::new(Machine::default());
        let background = Background::new(driver, 0);
        let mut joint = Self { background, wires, task, port, stage, commands: 0 };
        // An angle is believed after 0.1 s.
        joint.pass_ms(150);
        joint.give(0, &[1, NODE.number()]);
        let wiring = joint.background.driver().set().wiring_crc();
        joint.write(index::COMMISSIONING, 3, wiring.to_le_bytes(), 4);
        joint.pass_ms(1);
        joint
    }

    fn give(&mut self, identifier: u16, data: &[u8]) {
        let frame = Frame::new(identifier, data).expect("a legal frame");
        self.wires.received.push_back(frame);
    }

    fn write(&mut self, index: u16, sub_index: u8, value: [u8; 4], length: u8) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value;
        let header = 0x23 | (4 - length) << 2;
        self.give(0x601, &[header, low, high, sub_index, a, b, c, d]);
    }

    fn request(&mut self, request: u8) {
        self.write(index::STATE, 1, [request, 0, 0, 0], 1);
    }

    fn command(&mut self, current_a: f32) {
        self.commands = self.commands.wrapping_add(1);
        let command = Command::new(current_a, 0.0, self.commands);
        self.wires.received.push_back(Message::Command(NODE, command).emit());
    }

    fn interrupts(&mut self) {
        for _ in 0..PERIODS_PER_TICK {
            let at = self.stage.cycles;
            self.task.interrupt(&mut self.stage, &mut self.port, at, at.wrapping_add(200));
            self.stage.pass();
        }
    }

    fn round(&mut self) -> Next {
        self.wires.now_us += TICK_US;
        self.background.round(&mut self.wires)
    }

    fn pass_ms(&mut self, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.interrupts();
            assert_eq!(self.round(), Next::Sleep);
        }
    }

    /// Under this command, given every millisecond.
    fn drive_ms(&mut self, current_a: f32, milliseconds: usize) {
        for _ in 0..milliseconds {
            self.command(current_a);
            self.pass_ms(1);
        }
    }
}

#[test]
fn frames_turn_a_joint_and_stop_it() {
    let mut joint = Joint::started();
    joint.drive_ms(5.0, 5);
    assert!(!joint.stage.is_on(), "a command alone closes no bridge");
    joint.request(1);
    joint.drive_ms(5.0, 100);
    assert!(joint.background.driver().is_armed() && joint.stage.is_on());
    let velocity = joint.stage.plant.velocity();
    assert!((0.5..3.0).contains(&velocity), "{velocity} rad/s");
    joint.request(0);
    joint.drive_ms(5.0, 2);
    assert!(!joint.stage.is_on());
}

#[test]
fn a_committed_set_is_in_the_loop_before_the_orders_for_it() {
    let mut joint = Joint::started();
    let limit = firmware::control::MotorParameters::NAMES.iter();
    let place = limit.take_while(|name| **name != "current_limit_a").count() as u8 + 1;
    joint.write(index::MOTOR, place, 2f32.to_le_bytes(), 4);
    joint.give(0x601, &[0x40, 0x27, 0x20, 2, 0, 0, 0, 0]);
    joint.pass_ms(1);
    let answer = joint.wires.sent.last().expect("the staged CRC").data();
    let crc = answer[4..8].try_into().expect("four bytes");
    joint.write(index::COMMIT, 3, crc, 4);
    joint.request(1);
    joint.drive_ms(10.0, 2);
    joint.request(1);
    joint.drive_ms(10.0, 20);
    assert!(joint.stage.is_on());
    let largest = joint.stage.plant.phases().into_iter().fold(0.0, |a, b| f64::max(a, b.abs()));
    assert!((0.5..2.4).contains(&largest), "{largest} A");
}

#[test]
fn a_loop_that_dies_starves_the_watchdog_and_is_a_fault() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request(1);
    joint.drive_ms(1.0, 5);
    assert!(joint.background.driver().is_armed());
    let missing =
        |joint: &Joint| joint.background.driver().supervisor().faults().contains(Code::AdcTimeout);
    assert!(!missing(&joint));
    let fed = joint.wires.fed;
    for _ in 0..20 {
        joint.command(1.0);
        assert_eq!(joint.round(), Next::Sleep);
    }
    // The last report counts for 5 ms.
    assert_eq!(joint.wires.fed - fed, 4);
    assert!(missing(&joint) && !joint.background.driver().is_armed());
}

#[test]
fn answers_wait_for_room() {
    let mut joint = Joint::started();
    joint.wires.sent.clear();
    joint.wires.room = 1;
    for _ in 0..3 {
        joint.give(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    }
    joint.pass_ms(3);
    assert_eq!(joint.wires.sent.len(), 1);
    joint.wires.room = usize::MAX;
    joint.pass_ms(1);
    assert_eq!(joint.wires.sent.len(), 3);
}

#[test]
fn ticks_that_were_missed_are_not_made_up_for() {
    let mut joint = Joint::started();
    let looked = joint.wires.looked;
    joint.wires.now_us += 100 * TICK_US;
    joint.pass_ms(1);
    assert_eq!(joint.background.round(&mut joint.wires), Next::Sleep);
    assert_eq!(joint.wires.looked - looked, 1);
    // Late by less than a tick, the next comes when it would have.
    joint.wires.now_us += TICK_US / 2;
    joint.pass_ms(1);
    joint.wires.now_us += TICK_US / 2;
    assert_eq!(joint.background.round(&mut joint.wires), Next::Sleep);
    assert_eq!(joint.wires.looked - looked, 3);
}

#[test]
fn a_restart_comes_after_the_last_frames_or_after_its_time() {
    let mut joint = Joint::started();
    joint.wires.sent.clear();
    joint.give(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.give(0, &[0x81, NODE.number()]);
    joint.give(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.wires.is_idle = false;
    joint.wires.reading_us = 1;
    joint.interrupts();
    assert_eq!(joint.round(), Next::Restart);
    assert_eq!(joint.wires.sent.len(), 1, "nothing is taken in after the request");
    let began_us = joint.wires.now_us;
    assert_eq!(joint.background.round(&mut joint.wires), Next::Restart);
    assert!((500..520).contains(&(joint.wires.now_us - began_us)));
    joint.wires.is_idle = true;
    let began_us = joint.wires.now_us;
    assert_eq!(joint.background.round(&mut joint.wires), Next::Restart);
    assert!(joint.wires.now_us - began_us < 10);
}

/// Amplifiers warm up after the start: what they show with the bridge open is taken off anew at each arming.
#[test]
fn a_drift_of_a_shunt_is_gone_at_the_next_arming() {
    let torque_error = |drift: [f64; 3], warm_before_arming: bool| {
        let mut joint = Joint::started();
        if warm_before_arming {
            joint.stage.drift = drift;
        }
        joint.drive_ms(0.0, 5);
        joint.request(1);
        joint.drive_ms(0.0, 20);
        joint.stage.drift = drift;
        joint.drive_ms(0.0, 50);
        assert!(joint.background.driver().is_armed() && joint.stage.is_on());
        // What really flows while the loop believes that it holds 0 A.
        joint.stage.plant.phases().into_iter().fold(0.0, |most, of| f64::max(most, of.abs()))
    };
    let drift = [0.3, -0.26, 0.0];
    let (left, right) = (torque_error(drift, false), torque_error(drift, true));
    assert!((0.15..0.6).contains(&left), "drift after arming is current: {left} A");
    assert!(right < 0.08, "drift before arming is none: {right} A");
}

/// A gate driver keeps its fault until its enable was low: over CAN that is "clear", and once more when it has gone.
#[test]
fn a_fault_the_gate_driver_holds_is_cleared_over_can() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
    (joint.stage.broke, joint.stage.latched_fault) = (Some(Broke::GateDriver), true);
    joint.drive_ms(1.0, 1);
    assert!(!joint.stage.is_on() && !joint.stage.awake, "off both ways");
    let has = |joint: &Joint, code| joint.background.driver().supervisor().faults().contains(code);
    joint.drive_ms(1.0, 50);
    assert!(has(&joint, Code::GateDriverFault) && joint.stage.awake && !joint.stage.latched_fault);
    assert!(!has(&joint, Code::CurrentSensorInvalid), "amplifiers asleep are no fault of theirs");
    joint.request(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    // With the bridge off nothing trips, and "clear" itself is what lets it sleep.
    (joint.stage.broke, joint.stage.latched_fault) = (Some(Broke::GateDriver), true);
    joint.drive_ms(1.0, 50);
    assert!(has(&joint, Code::GateDriverFault) && joint.stage.latched_fault);
    joint.request(2);
    joint.drive_ms(1.0, 30);
    assert!(has(&joint, Code::GateDriverFault) && !joint.stage.latched_fault);
    joint.request(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    joint.request(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
}

#[test]
fn a_break_of_the_chip_itself_is_told_apart_from_the_gate_drivers() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request(1);
    joint.drive_ms(1.0, 30);
    joint.stage.broke = Some(Broke::System);
    joint.drive_ms(1.0, 3);
    assert!(!joint.stage.is_on());
    let supervisor = joint.background.driver().supervisor();
    assert!(supervisor.faults().contains(Code::SystemBreak));
    assert!(!supervisor.faults().contains(Code::GateDriverFault));
}
