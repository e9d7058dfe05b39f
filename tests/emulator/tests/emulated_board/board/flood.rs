//! Floods of frames at full bus load, against the image on a moving joint.
//!
//! Frames that are no set-points must neither reset the chip, nor delay its loops. The watchdog is refreshed once per tick
//! of the background, so the longest time between two refreshes is that between two ticks. `LONG_TESTS=1` runs ten minutes
//! of emulated time.

use super::course::set;
use crate::common::image;
use compensator_core::can::{CommandFrame, Frame, Message, NodeId};
use emulated_board::chip::CORE_HZ;
use emulated_board::costs::Costs;
use emulated_board::{BoardDriver, StopReason};
use firmware::node::dictionary::index;
use firmware::supervisor::Code;
use joint_rig::{PERIOD_CYCLES, PowerUp, RigDriver, RigFaults, stage_at_power_up};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};

const MILLISECOND: u64 = CORE_HZ / 1000;
/// Slices of a millisecond, each shorter than the shortest frame.
const SLICES: u64 = 20;
const REQUEST: u16 = 0x601;
/// Speed of the joint during a flood, rad/s.
const SPEED_RAD_S: f64 = 2.2;
/// Longest time between two ticks: one, and the longest work on a frame, ms.
const LONGEST_PAUSE_MS: f64 = 1.25;
/// Latest end of the interrupt, as a share of its period.
const LATEST_END: f64 = 0.65;

/// A frame of a flood.
enum FloodFrame {
    Data(Frame),
    Remote(Frame),
}

/// Makes the next frame of a flood from random numbers and its number.
type Flood = fn(&mut Pcg64Mcg, u32) -> FloodFrame;

fn frame(identifier: u16, data: &[u8]) -> Frame {
    Frame::new(identifier, data).expect("a frame")
}

fn data_frame(identifier: u16, data: &[u8]) -> FloodFrame {
    FloodFrame::Data(frame(identifier, data))
}

fn bytes(random: &mut Pcg64Mcg, length: usize) -> Vec<u8> {
    (0..length).map(|_| random.random()).collect()
}

/// The CRCs of both parameter sets in turn.
fn reads_of_crcs(_: &mut Pcg64Mcg, number: u32) -> FloodFrame {
    data_frame(REQUEST, &[0x40, 0x27, 0x20, 1 + (number % 2) as u8, 0, 0, 0, 0])
}

/// Long values, in segments and in blocks: friction model, network, and all other parameters.
fn reads_of_records(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let sub_index = random.random_range(5..=7);
    let command = if random.random_bool(0.5) { 0x40 } else { 0xA4 };
    data_frame(REQUEST, &[command, 0x27, 0x20, sub_index, 127, 0, 0, 0])
}

/// Reads of any object, parts of transfers, and requests that no client sends.
fn requests(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let mut data = bytes(random, 8);
    // A write could stop the joint, as its level permits.
    data[0] =
        [0x40, 0x40, 0x60, 0x70, 0xA4, 0xA2, 0xA3, 0xA1, 0x80, 0xE0][random.random_range(0..10)];
    data[2] = [0x10, 0x14, 0x18, 0x20, 0x20, 0x60][random.random_range(0..6)];
    data_frame(REQUEST, &data)
}

/// Layer setting services.
fn lss(random: &mut Pcg64Mcg, number: u32) -> FloodFrame {
    let mut data = bytes(random, 8);
    if number.is_multiple_of(2) {
        data[0] = [0x04, 0x11, 0x13, 0x17, 0x40, 0x43, 0x4C, 0x51, 0x5A, 0x5E]
            [random.random_range(0..10)];
        data[1] = random.random_range(0..3);
    }
    data_frame(0x7E5, &data)
}

/// Network commands to other nodes.
fn network_commands(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let command = [0x01, 0x02, 0x80, 0x81, 0x82][random.random_range(0..5)];
    data_frame(0, &[command, random.random_range(2..=127)])
}

/// Remote frames, the shortest there are.
fn remote_frames(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let identifier =
        [0, 0x80, 0x181, 0x201, 0x301, REQUEST, 0x701, 0x7E5][random.random_range(0..8)];
    FloodFrame::Remote(frame(identifier, &[]))
}

/// The shortest frames that the filters accept: SYNC, heartbeats and emergencies without data.
fn short_frames(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let identifier = [0x80, 0x701, REQUEST, 0x7E5, 0x705][random.random_range(0..5)];
    data_frame(identifier, &[])
}

/// Any identifier but those of the set-points.
fn random_frames(random: &mut Pcg64Mcg, _: u32) -> FloodFrame {
    let length = random.random_range(0..=8);
    let identifier = random.random_range(1..0x800);
    let is_to_joint = identifier & 0x7F == 1;
    let identifier = if is_to_joint { identifier + 1 } else { identifier };
    data_frame(identifier, &bytes(random, length))
}

const FLOODS: [(&str, Flood); 9] = [
    ("reads of the CRCs", reads_of_crcs),
    ("reads of records", reads_of_records),
    ("requests of objects", requests),
    ("LSS", lss),
    ("NMT for others", network_commands),
    ("remote frames", remote_frames),
    ("short frames", short_frames),
    ("random frames", random_frames),
    ("all of them", |random, number| {
        let flood = random.random_range(0..FLOODS.len() - 1);
        FLOODS[flood].1(random, number)
    }),
];

/// The image on a joint, with a master that holds its speed.
struct FloodedJoint {
    driver: BoardDriver,
    commands: u8,
    integral_a: f64,
    costs: Costs,
    frames: u32,
    /// Largest deviation from the speed, rad/s.
    deviation_rad_s: f64,
}

impl FloodedJoint {
    fn armed() -> Self {
        let set = set();
        let start =
            PowerUp { set: Some(&set), commissioned: true, board: true, ..PowerUp::default() };
        let plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
        let stage = stage_at_power_up(&start, plant, &RigFaults::default());
        let driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
        let mut joint = Self {
            driver,
            commands: 0,
            integral_a: 0.0,
            costs: Costs::default(),
            frames: 0,
            deviation_rad_s: 0.0,
        };
        (0..150).for_each(|_| joint.run_millisecond(0.0, None));
        joint.deliver(0, &[1, 1]);
        (0..5).for_each(|_| joint.run_millisecond(0.0, None));
        let [low, high] = index::STATE.to_le_bytes();
        joint.deliver(REQUEST, &[0x2F, low, high, 1, 1, 0, 0, 0]);
        (0..60).for_each(|_| joint.run_millisecond(0.0, None));
        assert!(joint.driver.is_armed(), "{:?}", joint.driver.faults());
        (0..500).for_each(|_| joint.run_millisecond(SPEED_RAD_S, None));
        joint
    }

    fn deliver(&mut self, identifier: u16, data: &[u8]) {
        self.driver.receive(&frame(identifier, data));
    }

    /// Runs 1 ms with a set-point, and this flood on the rest of the bus.
    fn run_millisecond(&mut self, speed_rad_s: f64, mut flood: Option<(&mut Pcg64Mcg, Flood)>) {
        let error = speed_rad_s - self.driver.stage().plant.velocity_rad_s();
        self.deviation_rad_s = self.deviation_rad_s.max(error.abs());
        self.integral_a += 1.5e-3 * error;
        self.commands = self.commands.wrapping_add(1);
        let wanted = (1.5 * error + self.integral_a) as f32;
        let command = CommandFrame::new(wanted, speed_rad_s as f32, self.commands);
        self.driver.receive(&Message::Command(NodeId::FIRST, command).emit());
        for _ in 0..SLICES {
            // Few wait at a time: the set-point must get the bus.
            while let Some((random, next)) = &mut flood
                && self.driver.machine_mut().chip().can.waiting_frames() < 2
            {
                let next = next(random, self.frames);
                self.frames += 1;
                let chip = self.driver.machine_mut().chip_mut();
                match next {
                    FloodFrame::Data(frame) => chip.deliver(frame),
                    FloodFrame::Remote(frame) => chip.deliver_remote(frame),
                }
            }
            let machine = self.driver.machine_mut();
            assert_eq!(machine.run(MILLISECOND / SLICES), StopReason::Time, "{}", self.frames);
        }
        self.costs.add(self.driver.machine_mut(), u64::from(PERIOD_CYCLES));
    }
}

#[test]
fn flood_of_any_frames_neither_resets_nor_delays_the_loops() {
    let is_long = std::env::var_os("LONG_TESTS").is_some();
    let milliseconds = if is_long { 600_000 / FLOODS.len() } else { 300 };
    let mut random = Pcg64Mcg::seed_from_u64(45);
    let mut joint = FloodedJoint::armed();
    joint.driver.machine_mut().records_runs = true;
    for (name, flood) in FLOODS {
        joint.costs.add(joint.driver.machine_mut(), u64::from(PERIOD_CYCLES));
        (joint.costs, joint.frames, joint.deviation_rad_s) = (Costs::default(), 0, 0.0);
        joint.driver.machine_mut().chip_mut().watchdog.longest_pause = 0;
        for _ in 0..milliseconds {
            joint.run_millisecond(SPEED_RAD_S, Some((&mut random, flood)));
        }
        let pause = joint.driver.machine_mut().chip().watchdog.longest_pause;
        let pause_ms = pause as f64 / MILLISECOND as f64;
        let end = joint.costs.latest_end as f64 / f64::from(PERIOD_CYCLES);
        println!(
            "measured: {name}: {:.1} frames per ms; worst millisecond: {} cycles of the background, {pause_ms:.2} ms \
             between two ticks, interrupt ends after {:.0} % of its period",
            f64::from(joint.frames) / milliseconds as f64,
            joint.costs.background.upper,
            100.0 * end,
        );
        assert!(pause_ms < LONGEST_PAUSE_MS, "{name}: {pause_ms} ms");
        assert!(end < LATEST_END && joint.costs.runs > 0, "{name}: {end}");
        assert!(joint.deviation_rad_s < 0.5, "{name}: {} rad/s", joint.deviation_rad_s);
        assert!(joint.driver.is_armed(), "{name}: {:?}", joint.driver.faults());
        let limits = joint.driver.limits();
        assert!(!limits.contains(Code::LoopLate), "{name}: {limits:?}");
    }
}
