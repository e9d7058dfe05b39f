//! Fuzzes the update of a program by its objects (1F50h, 1F51h, 1F56h, 1F57h, 2040h), with restarts and cuts of the power.
//!
//! The input is a list of steps: commands, parts of right and wrong packages in any kind of transfer, frames with any
//! bytes, time, cuts, restarts, and arming. The flash refuses what the state of the joint does not allow: a joint in
//! operation writes the slot that does not run, its marks, and its own confirmation; an armed joint writes nothing; the
//! boot program writes marks; the start copies the parameters to the other store. A trial is given only to an image that is
//! complete and signed. A joint that has had a confirmed image always starts one. After any input, an update succeeds.

use crate::bytes::Bytes;
use crate::programs::{
    Flash, PAGE, Package, SLOTS, found_in, packages, program, requirement, torn_step,
};
use crate::transfer::Ending;
use compensator_core::can::{Frame, NodeId};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::access::AccessSettings;
use firmware::driver::{Boot, Driver, Identity};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{OperationObject, ProgramObject, StateObject};
use firmware::node_settings::NodeSettings;
use firmware::store::memory::MemoryError;
use firmware::supervisor::{ResetCause, SelfTest};
use firmware::update::boot::{LastRun, Selection, is_intact, select};
use firmware::update::marks::{self, SlotState};
use firmware::update::recovery::{RECOVERY_STATE, Recovery, identity};
use firmware::update::session::OtherState;
use std::ops::Range;

const CLEAR: u8 = 3;
const START: u8 = 1;
const CONFIRMED: u32 = 2;
/// Places of the mark CONFIRMED, bytes from the begin of the marks.
const RUNNING_MARKS: Range<u32> = 5 * 8..16 * 8;
/// Longest time of an input, ms.
const LONGEST_MS: u64 = 100_000;

/// Flash that panics at a write outside the places that are allowed.
#[derive(Clone)]
struct WatchedFlash {
    flash: Flash,
    allowed: Vec<Range<u32>>,
}

impl WatchedFlash {
    fn check(&self, from: u32, to: u32) {
        let is_allowed = |range: &Range<u32>| range.start <= from && to <= range.end;
        assert!(self.allowed.iter().any(is_allowed), "{from:#x} to {to:#x} is written");
    }
}

impl ErrorType for WatchedFlash {
    type Error = MemoryError;
}

impl ReadNorFlash for WatchedFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        self.flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for WatchedFlash {
    const WRITE_SIZE: usize = Flash::WRITE_SIZE;
    const ERASE_SIZE: usize = Flash::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        self.check(from, to);
        self.flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        self.check(offset, offset + bytes.len() as u32);
        self.flash.write(offset, bytes)
    }
}

enum Running {
    /// The image of this slot.
    Driver(Box<Driver<WatchedFlash>>, usize),
    Recovery(Box<Recovery<WatchedFlash>>),
    Off(Box<WatchedFlash>),
}

struct Joint {
    running: Running,
    now_us: u64,
    /// An image was confirmed, so that one must always start.
    has_image: bool,
    passes_self_test: bool,
}

impl Joint {
    /// A joint with a confirmed image in slot 0, or without an image.
    fn new(has_image: bool) -> Self {
        let everything = 0..Flash::new().capacity() as u32;
        let mut flash = WatchedFlash { flash: Flash::new(), allowed: vec![everything] };
        if has_image {
            let (package, slot) = (&packages()[0], &SLOTS[0]);
            flash.write(slot.start, &package.bytes).expect("space");
            marks::receive(&mut flash, slot, &package.header, 1).expect("space");
            let SlotState::Image(image) = marks::state(&mut flash, slot) else { panic!() };
            marks::confirm(&mut flash, slot, &image).expect("space");
        }
        let running = Running::Off(Box::new(flash));
        let mut joint = Self { running, now_us: 0, has_image, passes_self_test: true };
        joint.start(ResetCause::PowerOn);
        joint
    }

    fn flash(&self) -> &WatchedFlash {
        match &self.running {
            Running::Driver(driver, _) => driver.joint.flash(),
            Running::Recovery(recovery) => recovery.flash(),
            Running::Off(flash) => flash,
        }
    }

    /// Starts as the boot program does, with the power on.
    fn start(&mut self, cause: ResetCause) {
        let mut flash = self.flash().clone();
        flash.flash.power_on();
        let last_run = LastRun::of(cause, false);
        let before = SLOTS.map(|slot| marks::state(&mut flash, &slot));
        flash.allowed = SLOTS.each_ref().map(|slot| slot.marks_page(PAGE)).to_vec();
        let selection = select(&mut flash, &SLOTS, &requirement(), last_run, |_, _| true);
        let Selection::Start { slot, is_trial } = selection else {
            assert!(!self.has_image, "nothing starts");
            let second_slot = SLOTS[1].start..SLOTS[1].marks + PAGE;
            flash.allowed = vec![second_slot];
            let node = Recovery::boot(NodeId::FIRST, flash, program(0), identity(9), self.now_us);
            self.running = Running::Recovery(Box::new(node));
            return;
        };
        let found = found_in(&mut flash, slot).expect("a damaged image starts");
        assert!(found.is_signed, "an image that is not signed starts");
        let is_ours = found.slot == slot && !found.is_foreign;
        assert!(is_ours, "an image of another slot or board starts");
        let SlotState::Image(image) = before[slot] else { panic!("an incomplete image starts") };
        assert!(!image.is_rejected && is_trial != image.is_confirmed);
        let board = program(slot);
        let store = board.stores[1]..board.stores[1] + board.store_bytes;
        flash.allowed = vec![store];
        let fails = is_trial && !self.passes_self_test;
        let failed_self_test = fails.then_some(SelfTest::EncoderClock);
        let boot = Boot { cause, failed_self_test, program: Some(board), ..Boot::default() };
        let node = Identity { hardware: "fuzz", serial: 9, stage: StageTraits::NONE };
        let access = AccessSettings { is_locked: false, ..AccessSettings::default() };
        let settings = NodeSettings { access, ..NodeSettings::default() };
        let driver = Driver::boot(settings, flash, node, &boot, self.now_us);
        self.running = Running::Driver(Box::new(driver), slot);
        self.allow();
    }

    /// Tells the flash what the joint may write now.
    fn allow(&mut self) {
        let Running::Driver(driver, running) = &mut self.running else { return };
        let (running, other) = (SLOTS[*running], SLOTS[1 - *running]);
        let running_marks = running.marks + RUNNING_MARKS.start..running.marks + RUNNING_MARKS.end;
        driver.joint.flash_mut().allowed = if driver.joint.is_armed() {
            vec![]
        } else {
            vec![other.start..other.marks + PAGE, running_marks]
        };
    }

    /// Follows a loss of power and a restart.
    fn follow(&mut self) {
        self.allow();
        let is_reset = match &self.running {
            Running::Driver(driver, _) => driver.is_reset_requested(),
            Running::Recovery(node) => node.is_reset_requested(),
            Running::Off(_) => return,
        };
        self.note_confirmation();
        if !self.flash().flash.has_power() {
            self.running = Running::Off(Box::new(self.flash().clone()));
        } else if is_reset {
            self.start(ResetCause::Software);
        }
    }

    fn note_confirmation(&mut self) {
        if let Running::Driver(driver, running) = &mut self.running
            && let SlotState::Image(image) =
                marks::state(driver.joint.flash_mut(), &SLOTS[*running])
        {
            self.has_image |= image.is_confirmed;
        }
    }

    /// Sends a frame; returns the last answer of the SDO server.
    fn frame(&mut self, identifier: u16, data: &[u8]) -> Option<[u8; 8]> {
        let frame = Frame::new(identifier, data).expect("legal");
        match &mut self.running {
            Running::Driver(driver, _) => driver.receive(&frame, self.now_us),
            Running::Recovery(node) => node.receive(&frame, self.now_us),
            Running::Off(_) => {}
        }
        self.answer()
    }

    fn answer(&mut self) -> Option<[u8; 8]> {
        let next = || match &mut self.running {
            Running::Driver(driver, _) => driver.transmit(),
            Running::Recovery(node) => node.transmit(),
            Running::Off(_) => None,
        };
        let answers = std::iter::from_fn(next).filter(|frame| frame.identifier() == 0x581);
        answers.last().and_then(|frame| frame.data().try_into().ok())
    }

    fn pass(&mut self, ms: u64, step_ms: u64) {
        for _ in 0..ms / step_ms {
            self.now_us += 1000 * step_ms;
            match &mut self.running {
                Running::Driver(driver, _) => driver.tick(self.now_us),
                Running::Recovery(node) => node.tick(self.now_us),
                Running::Off(_) => return,
            }
            self.answer();
            self.follow();
        }
    }

    /// Writes an object; returns true if it is accepted.
    fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) -> bool {
        let [low, high] = at.to_le_bytes();
        let mut request = [0x23 | (4 - value.len() as u8) << 2, low, high, sub_index, 0, 0, 0, 0];
        request[4..4 + value.len()].copy_from_slice(value);
        self.frame(0x601, &request).is_some_and(|answer| answer[0] == 0x60)
    }

    fn read(&mut self, at: u16, sub_index: u8) -> Option<u32> {
        let [low, high] = at.to_le_bytes();
        let answer = self.frame(0x601, &[0x40, low, high, sub_index, 0, 0, 0, 0])?;
        let [command, _, _, _, data @ ..] = answer;
        (command & 0xE3 == 0x43).then(|| u32::from_le_bytes(data))
    }

    fn is_armed(&self) -> bool {
        matches!(&self.running, Running::Driver(driver, _) if driver.joint.is_armed())
    }

    fn control(&mut self, command: u8) -> bool {
        let is_armed = self.is_armed();
        let is_accepted = self.write(index::PROGRAM_CONTROL, 1, &[command]);
        assert!(!(is_armed && is_accepted), "an armed joint takes a command");
        is_accepted
    }

    /// Number of the slot that receives.
    fn receiving_slot(&self) -> usize {
        match &self.running {
            Running::Driver(_, running) => 1 - running,
            _ => 1,
        }
    }

    fn received(&mut self) -> usize {
        self.read(index::PROGRAM, ProgramObject::RECEIVED).unwrap_or(0) as usize
    }

    /// Sends a part of a package.
    fn send(&mut self, part: &[u8], kind: u8, ending: Ending) {
        let (is_armed, before) = (self.is_armed(), self.flash().flash.steps());
        crate::transfer::send(kind, part, ending, &mut |request| self.frame(0x601, request));
        assert!(!is_armed || self.flash().flash.steps() == before, "an armed joint writes");
    }

    /// Arms the joint, as one in HIL, or disarms it.
    fn arm(&mut self, arms: bool) {
        let Running::Driver(driver, running) = &self.running else { return };
        let mut flash = driver.joint.flash().clone();
        let state = marks::state(&mut flash, &SLOTS[*running]);
        let is_trial = matches!(state, SlotState::Image(image) if !image.is_confirmed);
        self.write(index::OPERATION, OperationObject::SOURCE, &[1]);
        let is_busy = self.read(index::PROGRAM_CONTROL, 1) == Some(0);
        let is_accepted = self.write(index::STATE, StateObject::REQUEST, &[arms.into()]);
        assert!(!(arms && is_accepted && (is_trial || is_busy)), "armed during an update");
        self.allow();
    }

    /// Reads what a master asks for, and compares it with the flash.
    fn check_objects(&mut self) {
        let slot = SLOTS[self.receiving_slot()];
        let mut flash = self.flash().clone();
        let status = self.read(index::FLASH_STATUS, 1);
        let crc = self.read(index::PROGRAM_IDENTIFICATION, 2);
        let state = self.read(index::PROGRAM, ProgramObject::OTHER_STATE);
        if state != Some(OtherState::Waiting as u32) {
            return;
        }
        // A command may have cleared it behind an error of the flash.
        assert!(status.is_some());
        let SlotState::Image(image) = marks::state(&mut flash, &slot) else { panic!("no image") };
        assert!(is_intact(&mut flash, &slot, &image), "a damaged image waits for its start");
        assert_eq!(crc, Some(image.header.crc));
    }

    /// Installs a package as a master does.
    fn update(&mut self, package: &Package) {
        assert!(self.control(CLEAR), "the slot is cleared");
        self.send(&package.bytes, 1, Ending::Whole);
        let status = self.read(index::FLASH_STATUS, 1);
        assert_eq!(self.received(), package.bytes.len(), "status {status:x?}");
        self.pass(20, 1);
        assert_eq!(self.read(index::FLASH_STATUS, 1), Some(0));
        assert!(self.control(START));
        self.pass(10, 1);
        assert_eq!(
            self.read(index::PROGRAM, ProgramObject::VERSION),
            Some(package.header.version.0)
        );
        self.pass(2200, 100);
        assert_eq!(self.read(index::PROGRAM, ProgramObject::STATE), Some(CONFIRMED));
    }

    /// After any input, a joint with power takes an update.
    fn finish(&mut self) {
        self.passes_self_test = true;
        self.start(ResetCause::PowerOn);
        // A trial ends.
        self.pass(2200, 100);
        let state = self.read(index::PROGRAM, ProgramObject::STATE);
        assert!(matches!(state, Some(CONFIRMED | RECOVERY_STATE)), "{state:?}");
        let slot = self.receiving_slot();
        let newest = packages().iter().rfind(|package| package.slot == slot);
        self.update(newest.expect("a package for each slot"));
    }
}

/// Sends a part of one of the packages, from where the joint stands or from any byte.
fn send_part(joint: &mut Joint, bytes: &mut Bytes) {
    let (choice, kind, share) = (bytes.byte(), bytes.byte(), bytes.byte());
    let half = packages().len() / 2;
    let slot = if choice & 0x80 == 0 { joint.receiving_slot() } else { 1 - joint.receiving_slot() };
    let package = &packages()[half * slot + usize::from(choice) % half];
    let mut sent = package.bytes.clone();
    let received = joint.received().min(sent.len());
    let start = if kind & 8 == 0 { received } else { usize::from(bytes.byte()) * 8 % sent.len() };
    if kind & 16 != 0 {
        let at = usize::from(bytes.byte()) << 8 | usize::from(bytes.byte());
        sent[at % package.bytes.len()] ^= 1 << (bytes.byte() % 8);
    }
    let left = sent.len() - start;
    let length = if share > 200 { left } else { left * usize::from(share) / 200 };
    let ending = match kind >> 5 {
        0..=3 => Ending::Whole,
        4 => Ending::Left(bytes.byte()),
        5 => Ending::Aborted(bytes.byte()),
        6 => Ending::Lost(bytes.byte()),
        _ => Ending::WrongCrc,
    };
    if length > 0 {
        joint.send(&sent[start..start + length], kind, ending);
    }
}

/// Sends a frame with any bytes. One that begins a transfer names an object of the update.
fn send_any(joint: &mut Joint, bytes: &mut Bytes) {
    let mut request: [u8; 8] = std::array::from_fn(|_| bytes.byte());
    if matches!(request[0] & 0xE0, 0x20 | 0x40 | 0xA0 | 0xC0) {
        let objects = [
            (index::PROGRAM_DATA, 1),
            (index::PROGRAM_CONTROL, 1),
            (index::PROGRAM_IDENTIFICATION, request[3] % 4),
            (index::FLASH_STATUS, 1),
            (index::PROGRAM, request[3] % 16),
            (index::PROGRAM_DATA, request[3]),
        ];
        let (at, sub_index) = objects[usize::from(request[1]) % objects.len()];
        let [low, high] = at.to_le_bytes();
        request[1..4].copy_from_slice(&[low, high, sub_index]);
    }
    joint.frame(0x601, &request);
}

fn step(joint: &mut Joint, selector: u8, bytes: &mut Bytes) {
    let choice = selector >> 4;
    match selector & 0xF {
        0..=2 => _ = joint.control(choice % 5),
        3..=6 => send_part(joint, bytes),
        7 => send_any(joint, bytes),
        8 => joint.pass(u64::from(bytes.byte() % 32), 1),
        9 => joint.pass(100 * u64::from(bytes.byte() % 128), 100),
        10 => {
            let (step, kind) = (u32::from(bytes.byte()) * u32::from(choice), bytes.byte());
            let torn = torn_step(kind, bytes.byte().into());
            match &mut joint.running {
                Running::Driver(driver, _) => driver.joint.flash_mut().flash.cut_power(step, torn),
                // Recovery gives its flash for reading only.
                Running::Recovery(_) | Running::Off(_) => {}
            }
        }
        11 => {
            let causes = [ResetCause::PowerOn, ResetCause::Watchdog, ResetCause::Pin];
            joint.start(causes[usize::from(choice) % 3]);
        }
        12 => _ = joint.frame(0, &[if choice & 1 == 0 { 0x81 } else { 0x82 }, 1]),
        13 => joint.arm(choice & 1 == 0),
        14 => joint.passes_self_test = choice & 1 == 0,
        _ => joint.check_objects(),
    }
    joint.follow();
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut joint = Joint::new(bytes.byte() % 8 != 0);
    while let Some(selector) = bytes.next()
        && joint.now_us < 1000 * LONGEST_MS
    {
        step(&mut joint, selector, &mut bytes);
    }
    joint.finish();
}
