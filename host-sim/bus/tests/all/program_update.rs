//! Program updates over a bus in virtual time: the shipped driver and recovery on two banks of flash.
#![cfg(feature = "update")]

use super::message;
use canopen_rs::Address;
use compensator_core::can::{Frame, NodeId};
use ed25519_dalek::SigningKey;
use firmware::driver::{Boot, Driver, Identity};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    CommitObject, OperationObject, ProgramObject, StateObject,
};
use firmware::node_settings::NodeSettings;
use firmware::store::memory::{MemoryFlash, PAGE_BYTES, TornStep};
use firmware::supervisor::{ResetCause, SelfTest};
use firmware::update::boot::{LastRun, Requirement, Selection, select};
use firmware::update::marks::TRIALS;
use firmware::update::package::Version;
use firmware::update::recovery::{RECOVERY_STATE, Recovery, identity};
use firmware::update::session::OtherState;
use firmware::update::{Board, Program, Slot};
use joint_bus::bus::{BitRates, Bus, Hub, Participant, Port};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::program::package::{Code, Package, Release};
use joint_bus::program::update::{Outcome, Update, UpdateError};
use joint_trace::CanFrame;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

const PAGE: u32 = PAGE_BYTES as u32;
const SLOT_PAGES: u32 = 12;
const STORE_PAGES: u32 = 4;
const BANK: u32 = (SLOT_PAGES + 1 + STORE_PAGES) * PAGE;
const BASE: u32 = 0x0800_0000;
const BOARD: Board = Board { number: u32::from_be_bytes(*b"TEST"), wiring: 0x77 };
const IMAGE_BYTES: usize = 20_000;
const KEY: [u8; 32] = [7; 32];
const NODE: NodeId = NodeId::FIRST;
const CONTROL: Address = Address::new(index::PROGRAM_CONTROL, 1);

const fn slot(bank: u32) -> Slot {
    Slot { start: bank * BANK, marks: bank * BANK + SLOT_PAGES * PAGE }
}

/// The board's description for a driver that runs from this slot.
fn program(running: u32) -> Program {
    let store = (SLOT_PAGES + 1) * PAGE;
    Program {
        board: BOARD,
        key_at: u32::MAX,
        base: BASE,
        running: slot(running),
        other: slot(1 - running),
        stores: [running * BANK + store, (1 - running) * BANK + store],
        store_bytes: STORE_PAGES * PAGE,
    }
}

fn package_of(board: Board, version: &str, key: &[u8; 32]) -> Release {
    let version = Version::parse(version).unwrap();
    let packages = [0, 1].map(|number| {
        let seed = version.0 as u8 ^ number as u8;
        let code = Code {
            address: program(0).image_address(&slot(number)),
            bytes: (0..IMAGE_BYTES).map(|at| (at * 31) as u8 ^ seed).collect(),
            board,
        };
        Package::sign(&code, version, &SigningKey::from_bytes(key))
    });
    Release::new(packages.to_vec()).unwrap()
}

fn package(version: &str) -> Release {
    package_of(BOARD, version, &KEY)
}

type Flash = MemoryFlash<34>;

enum Running {
    Driver(Box<Driver<Flash>>),
    Recovery(Box<Recovery<Flash>>),
    Off(Box<Flash>),
}

/// A joint with a boot program.
struct Joint {
    running: Running,
    /// The running image fails its self-test while it is on trial in the second bank.
    fails_in_second_bank: bool,
}

impl Joint {
    fn power_up(flash: Flash, now_ns: u64) -> Running {
        Self::start(flash, ResetCause::PowerOn, false, now_ns)
    }

    fn start(mut flash: Flash, cause: ResetCause, fails: bool, now_ns: u64) -> Running {
        let last_run = LastRun::of(cause, false);
        let public_key = SigningKey::from_bytes(&KEY).verifying_key().to_bytes();
        let requirement = Requirement { board: BOARD, public_key };
        let now_us = now_ns / 1000;
        match select(&mut flash, &[slot(0), slot(1)], &requirement, last_run, |_, _| true) {
            Selection::Start { slot, .. } => {
                let failed_self_test = (fails && slot == 1).then_some(SelfTest::EncoderClock);
                let program = Some(program(slot as u32));
                let boot = Boot { cause, failed_self_test, program, ..Boot::default() };
                let node = Identity { hardware: "test", serial: 9, stage: StageTraits::NONE };
                let driver = Driver::boot(NodeSettings::default(), flash, node, &boot, now_us);
                Running::Driver(Box::new(driver))
            }
            Selection::Recover => {
                let recovery = Recovery::boot(NODE, flash, program(0), identity(9), now_us);
                Running::Recovery(Box::new(recovery))
            }
        }
    }

    fn flash(&self) -> Flash {
        match &self.running {
            Running::Driver(driver) => driver.joint.flash().clone(),
            Running::Recovery(recovery) => recovery.flash().clone(),
            Running::Off(flash) => Flash::clone(flash),
        }
    }

    fn follow(&mut self, now_ns: u64) {
        let flash = self.flash();
        let is_reset = match &self.running {
            Running::Driver(driver) => driver.is_reset_requested(),
            Running::Recovery(recovery) => recovery.is_reset_requested(),
            Running::Off(_) => return,
        };
        if !flash.has_power() {
            self.running = Running::Off(Box::new(flash));
        } else if is_reset {
            self.running =
                Self::start(flash, ResetCause::Software, self.fails_in_second_bank, now_ns);
        }
    }
}

impl Participant for Joint {
    fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        if let Some(frame) = frame.to_joint() {
            match &mut self.running {
                Running::Driver(driver) => driver.receive(&frame, now_ns / 1000),
                Running::Recovery(recovery) => recovery.receive(&frame, now_ns / 1000),
                Running::Off(_) => {}
            }
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        match &mut self.running {
            Running::Driver(driver) => driver.tick(now_ns / 1000),
            Running::Recovery(recovery) => recovery.tick(now_ns / 1000),
            Running::Off(_) => {}
        }
        self.follow(now_ns);
        Some(now_ns + 1_000_000)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        match &mut self.running {
            Running::Driver(driver) => driver.transmit(),
            Running::Recovery(recovery) => recovery.transmit(),
            Running::Off(_) => None,
        }
        .map(CanFrame::from)
    }
}

struct Bench {
    hub: Hub,
    joint: Rc<RefCell<Joint>>,
    client: Client<Port>,
}

impl Bench {
    /// A joint without an image, in recovery.
    fn blank() -> Self {
        let hub = Hub::with_bit_rates(BitRates { nominal: 1_000_000, data: 1_000_000 });
        let running = Joint::power_up(MemoryFlash::new(), 0);
        let joint = Rc::new(RefCell::new(Joint { running, fails_in_second_bank: false }));
        hub.attach(joint.clone());
        let client = Client::new(hub.port(), NODE);
        Self { hub, joint, client }
    }

    /// A joint with version 1.0.0, confirmed in the first bank.
    fn running() -> Self {
        let mut bench = Self::blank();
        // Recovery receives into the second bank, so two updates lead to the first.
        bench.update(&package("0.9.0")).unwrap();
        bench.update(&package("1.0.0")).unwrap();
        bench
    }

    fn update(&mut self, package: &Release) -> Result<Outcome, UpdateError> {
        Update::new(&mut self.client, NODE.number(), package).run(&mut |_, _| ())
    }

    fn entry(&mut self, sub_index: u8) -> u32 {
        self.client.read_number(Address::new(index::PROGRAM, sub_index)).unwrap()
    }

    fn version(&mut self) -> String {
        Version(self.entry(ProgramObject::VERSION)).to_string()
    }

    fn power_cycle(&mut self) {
        let mut flash = self.joint.borrow().flash();
        flash.power_on();
        let running = Joint::power_up(flash, self.hub.now_ns());
        self.joint.borrow_mut().running = running;
    }

    fn cut_power(&mut self, step: u32, torn: TornStep) {
        match &mut self.joint.borrow_mut().running {
            Running::Driver(driver) => driver.joint.flash_mut().cut_power(step, torn),
            _ => panic!("the driver does not run"),
        }
    }
}

#[test]
fn update_from_recovery_and_between_both_banks_is_confirmed() {
    let mut bench = Bench::blank();
    assert_eq!(bench.entry(ProgramObject::STATE), RECOVERY_STATE);
    assert_eq!(bench.client.read_number(Address::new(index::IDENTITY, 4)).unwrap(), 9);
    let outcome = bench.update(&package("0.9.0")).unwrap();
    assert_eq!((outcome.previous, outcome.was_present), (None, false));
    let outcome = bench.update(&package("1.0.0")).unwrap();
    assert_eq!(outcome.previous, Version::parse("0.9.0"));
    assert_eq!(bench.version(), "1.0.0");
    assert_eq!(bench.entry(ProgramObject::OTHER_STATE), OtherState::Confirmed as u32);
    assert!(bench.update(&package("1.0.0")).unwrap().was_present);
}

#[test]
fn parameters_saved_before_each_update_are_in_use_after_it() {
    let mut bench = Bench::running();
    let heartbeat = Address::new(index::HEARTBEAT, 0);
    for (period_ms, version) in [(700u16, "1.1.0"), (800, "1.2.0"), (900, "1.3.0")] {
        bench.client.write(heartbeat, &period_ms.to_le_bytes()).unwrap();
        bench.client.write(Address::new(index::STORE, 1), b"save").unwrap();
        bench.update(&package(version)).unwrap();
        bench.power_cycle();
        assert_eq!(bench.client.read_number(heartbeat).unwrap(), u32::from(period_ms));
        assert_eq!(bench.version(), version);
    }
}

/// Returns the reason that the node gave for refusing a request.
fn refusal(error: SdoError) -> String {
    let SdoError::Refused { why, .. } = error else { panic!("{error}") };
    why
}

#[test]
fn update_with_unsuitable_package_is_refused_before_the_transfer() {
    let mut bench = Bench::running();
    let foreign = package_of(Board { number: BOARD.number + 1, ..BOARD }, "2.0.0", &KEY);
    let error = bench.update(&foreign).unwrap_err();
    assert!(matches!(error, UpdateError::Board { node: 1, .. }), "{error}");
    let parts = ["board TESU", "node 1", "board TEST"];
    message::check("updates", "other board", &error.to_string(), &parts);
    let rewired = package_of(Board { wiring: 0x78, ..BOARD }, "2.0.0", &KEY);
    let error = bench.update(&rewired).unwrap_err();
    assert!(matches!(error, UpdateError::Wiring { package: 0x78, node: 1, found: 0x77 }));
    let parts = ["00000078", "node 1", "00000077"];
    message::check("updates", "other wiring", &error.to_string(), &parts);
    let error = bench.update(&package("0.9.0")).unwrap_err();
    assert!(matches!(error, UpdateError::Older { node: 1, .. }), "{error}");
    let parts = ["0.9.0", "1.0.0", "node 1"];
    message::check("updates", "older version", &error.to_string(), &parts);
    assert_eq!(bench.version(), "1.0.0");
}

#[test]
fn update_of_armed_joint_is_refused_and_joint_is_not_armed_meanwhile() {
    let mut bench = Bench::running();
    let request = Address::new(index::STATE, StateObject::REQUEST);
    let source = Address::new(index::OPERATION, OperationObject::SOURCE);
    bench.client.write(source, &[1]).unwrap();
    bench.client.write(request, &[1]).unwrap();
    let error = bench.update(&package("1.1.0")).unwrap_err();
    assert!(matches!(error, UpdateError::Armed(1)), "{error}");
    // Another tool that does not ask is refused, too.
    let error = bench.client.write(CONTROL, &[3]).unwrap_err();
    let why = refusal(error);
    message::check("updates", "clear of an armed joint", &why, &[]);
    bench.client.write(request, &[0]).unwrap();
    bench.client.write(CONTROL, &[3]).unwrap();
    let error = bench.client.write(request, &[1]).unwrap_err();
    message::check("updates", "arming during an update", &refusal(error), &[]);
}

#[test]
fn image_of_another_key_is_not_started() {
    let mut bench = Bench::running();
    let error = bench.update(&package_of(BOARD, "2.0.0", &[8; 32])).unwrap_err();
    assert!(matches!(error, UpdateError::Returned { node: 1, .. }), "{error}");
    message::check("updates", "other key", &error.to_string(), &["node 1", "signature"]);
    assert_eq!(bench.version(), "1.0.0");
}

#[test]
fn trial_that_fails_its_self_test_returns_to_the_old_image() {
    let mut bench = Bench::running();
    bench.joint.borrow_mut().fails_in_second_bank = true;
    let error = bench.update(&package("1.1.0")).unwrap_err();
    assert!(matches!(error, UpdateError::Returned { node: 1, .. }), "{error}");
    message::check("updates", "trial failed", &error.to_string(), &["node 1"]);
    assert_eq!(bench.version(), "1.0.0");
    // The next update repairs it.
    bench.joint.borrow_mut().fails_in_second_bank = false;
    bench.update(&package("1.1.1")).unwrap();
    assert_eq!(bench.version(), "1.1.1");
}

#[test]
fn update_after_a_power_cut_goes_on_where_it_stopped() {
    let mut bench = Bench::running();
    for (version, step, torn) in [
        ("1.1.0", 1500, TornStep::Unreadable(1)),
        ("1.2.0", 1100, TornStep::Partly(2)),
        ("1.3.0", 2000, TornStep::FirstHalf),
    ] {
        let new = package(version);
        let before = bench.version();
        bench.cut_power(step, torn);
        assert!(bench.update(&new).is_err());
        bench.power_cycle();
        assert_eq!(bench.version(), before);
        let outcome = bench.update(&new).unwrap_or_else(|error| panic!("{version}: {error}"));
        assert!(outcome.resumed_at > 0, "{outcome:?}");
        assert_eq!(bench.version(), version);
    }
}

/// A master that answers boot-up messages by a reset of the node, so often.
struct ResettingMaster {
    resets: u32,
    is_due: bool,
}

impl Participant for ResettingMaster {
    fn receive(&mut self, frame: &CanFrame, _: u64) {
        let is_boot_up = frame
            .to_joint()
            .is_some_and(|frame| frame.identifier() == 0x701 && frame.data() == [0]);
        if is_boot_up && self.resets > 0 {
            self.resets -= 1;
            self.is_due = true;
        }
    }

    fn tick(&mut self, _: u64) -> Option<u64> {
        None
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        let request = std::mem::take(&mut self.is_due).then_some([0x81, 1])?;
        Frame::new(0, &request).map(CanFrame::from)
    }
}

#[test]
fn update_beside_a_master_that_resets_the_node_at_boot_up_is_confirmed() {
    for resets in [1, TRIALS - 1, TRIALS] {
        let mut bench = Bench::running();
        bench.hub.attach(Rc::new(RefCell::new(ResettingMaster { resets, is_due: false })));
        let outcome = bench.update(&package("1.1.0"));
        // Each reset uses a start. After the last one the joint returns, so that it does not restart for ever.
        let expected = if resets < TRIALS { "1.1.0" } else { "1.0.0" };
        assert_eq!(bench.version(), expected, "{resets} resets: {outcome:?}");
        assert_eq!(outcome.is_ok(), resets < TRIALS, "{outcome:?}");
    }
}

/// Starts an image in the second bank, beside 1.0.0 in the first one.
fn on_trial() -> Bench {
    let mut bench = Bench::running();
    let release = package("1.1.0");
    bench.client.write(CONTROL, &[3]).unwrap();
    let data = Address::new(index::PROGRAM_DATA, 1);
    let sent = release.for_address(program(0).image_address(&slot(1))).unwrap();
    bench.client.write_blocks(data, &sent.bytes, |_| ()).unwrap();
    bench.hub.run_until(bench.hub.now_ns() + 100_000_000).unwrap();
    bench.client.write(CONTROL, &[1]).unwrap();
    bench.hub.run_until(bench.hub.now_ns() + 50_000_000).unwrap();
    assert_eq!((bench.version().as_str(), bench.entry(ProgramObject::STATE)), ("1.1.0", 1));
    bench
}

#[test]
fn restart_by_object_during_a_trial_is_no_failure_and_clear_is_refused() {
    let mut bench = on_trial();
    bench.client.write(CONTROL, &[2]).unwrap();
    bench.hub.run_until(bench.hub.now_ns() + 50_000_000).unwrap();
    assert_eq!(bench.version(), "1.1.0");
    // The image before it is the only one that is known to work.
    let error = bench.client.write(CONTROL, &[3]).unwrap_err();
    message::check("updates", "clear during a trial", &refusal(error), &[]);
    assert_eq!(bench.entry(ProgramObject::OTHER_STATE), OtherState::Confirmed as u32);
    bench.hub.run_until(bench.hub.now_ns() + 2_100_000_000).unwrap();
    assert_eq!(bench.entry(ProgramObject::STATE), 2);
    bench.client.write(CONTROL, &[3]).unwrap();
}

/// A second master that clears, or adds bytes to, a program that it does not own.
struct SecondMaster {
    every_ns: u64,
    requests: Vec<[u8; 8]>,
    due: Option<[u8; 8]>,
}

impl Participant for SecondMaster {
    fn receive(&mut self, _: &CanFrame, _: u64) {}

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.due = self.requests.pop();
        Some(now_ns + self.every_ns)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        let request = self.due.take()?;
        Frame::new(0x601, &request).map(CanFrame::from)
    }
}

/// As after Ctrl-C in a transfer: the joint awaits the next segment, and takes a question for it.
#[test]
fn update_after_a_master_that_ended_within_a_block_is_confirmed() {
    let mut bench = Bench::running();
    let network = CommitObject::NETWORK_RECORD;
    for data in [[0xC6, 0x27, 0x20, network, 100, 0, 0, 0], [1, 0, 0, 0, 0, 0, 0, 0]] {
        bench.client.bus().send(&Frame::new(0x601, &data).unwrap().into()).unwrap();
        while bench.client.bus().receive_within(Duration::from_millis(2)).unwrap().is_some() {}
    }
    bench.update(&package("1.1.0")).unwrap();
    assert_eq!(bench.version(), "1.1.0");
}

#[test]
fn update_beside_a_second_master_ends_with_a_whole_image() {
    let clear = [0x2F, 0x51, 0x1F, 1, 3, 0, 0, 0];
    let data = [0x23, 0x50, 0x1F, 1, 1, 2, 3, 4];
    let abort = [0x80, 0x50, 0x1F, 1, 0, 0, 0, 8];
    for requests in [vec![clear], vec![data; 2], vec![abort; 5], vec![clear, data, abort]] {
        let mut bench = Bench::running();
        let every_ns = 130_000_000;
        bench.hub.attach(Rc::new(RefCell::new(SecondMaster { every_ns, requests, due: None })));
        let outcome = bench.update(&package("1.1.0"));
        let expected = if outcome.is_ok() { "1.1.0" } else { "1.0.0" };
        bench.power_cycle();
        assert_eq!(bench.version(), expected, "{outcome:?}");
        // Without the other master it succeeds.
        bench.update(&package("1.1.1")).unwrap();
    }
}
