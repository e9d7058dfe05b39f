//! Process data at a SYNC, on a bus that others load up to 100 %.
//!
//! Two things are measured: the time from the end of the SYNC to the end of the transmit PDO, and whether a receive PDO
//! acts before the next SYNC. The controlword changes in each cycle, so the statusword must, too. Frames of others with a
//! lower identifier go first, those with a higher one delay a PDO by the one that is on the bus. The phase between SYNC and
//! the driver's tick is random: a SYNC that arrives during a tick waits for its end. A run writes the times to
//! `target/figures/pdo-timing.tsv`.

use crate::common::{image, write_figures};
use compensator_core::can::{Frame, NodeId};
use emulated_board::chip::CORE_HZ;
use emulated_board::{BoardDriver, StopReason};
use firmware::node::dictionary::index;
use joint_rig::{PowerUp, RigFaults, stage_at_power_up};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::fmt::Write;

const MICROSECOND: u64 = CORE_HZ / 1_000_000;
const MILLISECOND: u64 = CORE_HZ / 1000;
/// Slices of a millisecond, each shorter than the shortest frame.
const SLICES: u64 = 25;
const CYCLES: usize = 300;
const SYNC: u16 = 0x080;
const TRANSMIT_PDO: u16 = 0x1C1;
const RECEIVE_PDO: u16 = 0x201;
const ANSWER: u16 = 0x581;

/// Frames of others.
#[derive(Clone, Copy)]
struct Traffic {
    name: &'static str,
    /// Frames with lower identifiers than the PDO, all at the SYNC.
    before: u16,
    /// Frames with higher identifiers use the rest of the bus.
    fills: bool,
    /// Limits of the delay, us. The least are the frames that go first and the PDO, of 122 us, and a few for the driver. The
    /// most are a fifth beyond what the frames, that on the bus, and the longest tick of the driver take.
    limits_us: [f64; 2],
}

const TRAFFICS: [Traffic; 4] = [
    Traffic { name: "none", before: 0, fills: false, limits_us: [150.0, 460.0] },
    Traffic {
        name: "4 frames of higher priority",
        before: 4,
        fills: false,
        limits_us: [590.0, 730.0],
    },
    Traffic { name: "100 %, of lower priority", before: 0, fills: true, limits_us: [200.0, 590.0] },
    Traffic {
        name: "100 %, of it 4 frames of higher priority",
        before: 4,
        fills: true,
        limits_us: [590.0, 730.0],
    },
];

/// Delays of the transmit PDO of all cycles, us, in ascending order, and what went wrong.
struct Timing {
    delays_us: Vec<f64>,
    missing: usize,
    late_controlwords: usize,
    load: f64,
}

struct Bus {
    driver: BoardDriver,
    random: Pcg64Mcg,
    traffic: Traffic,
    /// Frames of the joint, with their end.
    sent: Vec<(u64, Frame)>,
    others: u64,
}

impl Bus {
    fn start() -> Self {
        let start = PowerUp { commissioned: true, board: true, ..PowerUp::default() };
        let plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
        let stage = stage_at_power_up(&start, plant, &RigFaults::default());
        let driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
        let random = Pcg64Mcg::seed_from_u64(48);
        let mut bus = Self { driver, random, traffic: TRAFFICS[0], sent: Vec::new(), others: 0 };
        let [a, b, c, d] = u32::from(TRANSMIT_PDO).to_le_bytes();
        bus.write(index::TRANSMIT_DRIVE, 1, &[a, b, c, d]);
        // Nothing but what a master of a drive maps: the other frames of the joint would be its own load.
        for pdo in 0..5 {
            bus.write(0x1800 + pdo, 1, &(0x8000_0181 + 0x100 * u32::from(pdo)).to_le_bytes());
        }
        bus.write(index::MODE, 0, &[10]);
        bus.deliver(0, &[1, NodeId::FIRST.number()]);
        bus.run(20);
        bus
    }

    fn deliver(&mut self, identifier: u16, data: &[u8]) {
        let frame = Frame::new(identifier, data).expect("a frame");
        self.driver.machine_mut().chip_mut().deliver(frame);
    }

    fn write(&mut self, at_index: u16, sub_index: u8, value: &[u8]) {
        let [low, high] = at_index.to_le_bytes();
        let mut request = [0x23 | ((4 - value.len()) as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        request[4..4 + value.len()].copy_from_slice(value);
        self.sent.clear();
        self.deliver(0x600 + u16::from(NodeId::FIRST.number()), &request);
        self.run(5);
        let answer = self.sent.iter().find(|(_, frame)| frame.identifier() == ANSWER);
        let (_, answer) = answer.expect("an answer");
        assert_eq!(answer.data()[0], 0x60, "{at_index:04X}h: {answer:?}");
    }

    /// Runs a time without SYNC, ms.
    fn run(&mut self, milliseconds: u64) {
        (0..milliseconds * SLICES).for_each(|_| self.run_slice());
    }

    /// Runs a slice of a millisecond, with the traffic of others.
    fn run_slice(&mut self) {
        // One waits while another is on the bus, so that the bus is never free.
        while self.traffic.fills && self.driver.machine_mut().chip().can.waiting_frames() < 3 {
            // Answers to the requests of others, which this joint does not receive.
            let identifier = self.random.random_range(0x582..0x600);
            self.send_as_other(identifier);
        }
        let machine = self.driver.machine_mut();
        assert_eq!(machine.run(MILLISECOND / SLICES), StopReason::Time);
        self.sent.extend(machine.chip_mut().can.sent.drain(..));
    }

    fn send_as_other(&mut self, identifier: u16) {
        let data: [u8; 8] = self.random.random();
        self.deliver(identifier, &data);
        self.others += 1;
    }

    /// Runs a cycle: a random wait, SYNC, a receive PDO, and the rest of a millisecond. Returns the end of the SYNC.
    fn run_cycle(&mut self, controlword: u8) -> u64 {
        (0..self.random.random_range(0..SLICES)).for_each(|_| self.run_slice());
        self.sent.clear();
        self.driver.machine_mut().chip_mut().can.arrived.clear();
        self.deliver(SYNC, &[]);
        (0..self.traffic.before).for_each(|place| self.send_as_other(0x102 + place));
        let mut sync = None;
        for slice in 0..SLICES {
            if slice == SLICES / 2 {
                self.deliver(RECEIVE_PDO, &[controlword, 0, 0, 0]);
            }
            self.run_slice();
            let arrived = &self.driver.machine_mut().chip().can.arrived;
            let found = arrived.iter().find(|(_, identifier)| *identifier == SYNC);
            if sync.is_none() && slice < SLICES / 2 {
                sync = found.map(|(end, _)| *end);
            }
        }
        sync.expect("the SYNC has the lowest identifier")
    }

    fn measure(&mut self, traffic: Traffic) -> Timing {
        self.traffic = traffic;
        self.others = 0;
        let begun = self.driver.machine_mut().now();
        let mut timing =
            Timing { delays_us: Vec::new(), missing: 0, late_controlwords: 0, load: 0.0 };
        let (mut expected, mut sent_frames) = (None, 0);
        for cycle in 0..CYCLES {
            let (controlword, state) = [(0x06, 0x21), (0x07, 0x23)][cycle % 2];
            let sync = self.run_cycle(controlword);
            let is_pdo =
                |(end, frame): &&(u64, Frame)| frame.identifier() == TRANSMIT_PDO && *end > sync;
            let pdo = self.sent.iter().find(is_pdo);
            sent_frames += self.sent.len();
            match pdo {
                Some((end, frame)) => {
                    timing.delays_us.push((end - sync) as f64 / MICROSECOND as f64);
                    let is_late = expected.is_some_and(|state| frame.data()[0] & 0x6F != state);
                    timing.late_controlwords += usize::from(is_late);
                }
                None => timing.missing += 1,
            }
            expected = Some(state);
        }
        let elapsed_us = (self.driver.machine_mut().now() - begun) as f64 / MICROSECOND as f64;
        let frames = self.others as f64 + sent_frames as f64 + CYCLES as f64;
        timing.load = frames * 122.0 / elapsed_us;
        timing.delays_us.sort_by(f64::total_cmp);
        timing
    }
}

#[test]
fn process_data_keep_their_time_on_a_bus_with_full_load() {
    let mut bus = Bus::start();
    let mut table = String::from("traffic of others\tleast, us\tmedian, us\tmost, us\n");
    for traffic in TRAFFICS {
        let timing = bus.measure(traffic);
        assert_eq!((timing.missing, timing.late_controlwords), (0, 0), "{}", traffic.name);
        assert_eq!(timing.load > 0.9, traffic.fills, "{}: load {}", traffic.name, timing.load);
        let last = timing.delays_us.len() - 1;
        let delays_us = [0, last / 2, last].map(|place| timing.delays_us[place].round());
        let [least_us, median_us, most_us] = delays_us;
        println!(
            "measured: PDO after SYNC, traffic of others {}: {least_us}, {median_us}, {most_us} us, load {:.2}",
            traffic.name, timing.load
        );
        let _ = writeln!(table, "{}\t{least_us}\t{median_us}\t{most_us}", traffic.name);
        let [from_us, to_us] = traffic.limits_us;
        let is_within = from_us <= least_us && most_us <= to_us;
        assert!(is_within, "{}: {least_us} to {most_us} us", traffic.name);
    }
    write_figures("pdo-timing.tsv", &table);
}
