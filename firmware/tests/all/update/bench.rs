//! Packages, and a device that runs an update on flash with power cuts.

use ed25519_dalek::{Signer, SigningKey};
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES};
use firmware::update::boot::{LastRun, Requirement, Selection, select};
use firmware::update::marks::{self, SlotState};
use firmware::update::package::{CRC, HEADER_BYTES, Header, USED_BYTES, Version, emit};
use firmware::update::receiver::{Receiver, Refusal};
use firmware::update::{Board, Program, Slot};
use sha2::{Digest, Sha512};

pub type Flash = MemoryFlash<8>;

const PAGE: u32 = PAGE_BYTES as u32;
pub const BOARD: Board = Board { number: 0x4734_3734, wiring: 0x77 };
const BASE: u32 = 0x0800_0000;
pub const RUNNING: Slot = Slot { start: 0, marks: 3 * PAGE };
pub const OTHER: Slot = Slot { start: 4 * PAGE, marks: 7 * PAGE };
/// Length of the images: not whole pages.
pub const IMAGE_BYTES: usize = 4400;

pub fn key() -> SigningKey {
    SigningKey::from_bytes(&[7; 32])
}

/// The device's view: it runs from slot `own`, 0 or 1.
pub fn program(running: usize) -> Program {
    let (running, other) = if running == 0 { (RUNNING, OTHER) } else { (OTHER, RUNNING) };
    // There is no boot program, and the parameter store is not used here.
    let key_at = u32::MAX;
    Program { board: BOARD, key_at, base: BASE, running, other, stores: [0; 2], store_bytes: 0 }
}

/// A package whose image is linked for slot 1, unless [`Package::linked_for`] changes it.
pub struct Package {
    pub header: Header,
    pub bytes: Vec<u8>,
    key: SigningKey,
}

impl Package {
    /// Returns the package of the same image for this slot. One for slot 1 is not changed.
    fn linked_for(&self, slot: usize) -> Self {
        let key = self.key.clone();
        let address = program(1 - slot).image_address(&[RUNNING, OTHER][slot]);
        if self.header.address == address {
            return Self { header: self.header, bytes: self.bytes.clone(), key };
        }
        Self::sign(Header { address, ..self.header }, &self.bytes[HEADER_BYTES..], key)
    }

    fn sign(header: Header, image: &[u8], key: SigningKey) -> Self {
        let signed = header.signed(&Sha512::digest(image).into());
        let emitted = emit(&signed, &key.sign(&signed).to_bytes());
        let identity = CRC.checksum(&emitted[..USED_BYTES]);
        let bytes = [&emitted[..], image].concat();
        Self { header: Header { identity, ..header }, bytes, key }
    }
}

pub fn package(version: u32, counter: u32) -> Package {
    signed(&key(), BOARD, version, counter, IMAGE_BYTES)
}

pub fn signed(
    key: &SigningKey,
    board: Board,
    version: u32,
    counter: u32,
    length: usize,
) -> Package {
    let seed = version as u8;
    let image: Vec<u8> =
        (0..length).map(|at| (at as u8).wrapping_mul(37).wrapping_add(seed)).collect();
    let header = Header {
        board: board.number,
        wiring: board.wiring,
        version: Version(version),
        counter,
        length: length as u32,
        crc: CRC.checksum(&image),
        address: program(0).image_address(&OTHER),
        identity: 0,
    };
    Package::sign(header, &image, key.clone())
}

/// Reason why a run of the device ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    PowerLost,
    Refused(Refusal),
    /// The header states more bytes than were sent.
    Unfinished,
    Done,
}

/// Returns flash with a confirmed image in slot 0.
pub fn flash_with(package: &Package) -> Flash {
    let mut flash = Flash::new();
    // As a device that runs from slot 1 receives it.
    assert_eq!(receive(&mut flash, 1, package), End::Done);
    assert!(matches!(start(&mut flash, false), Selection::Start { slot: 0, is_trial: true }));
    confirm(&mut flash, 0).unwrap();
    flash
}

/// Receives and verifies a package, resuming if the flash holds a part of it.
pub fn receive(flash: &mut Flash, running: usize, package: &Package) -> End {
    let package = package.linked_for(1 - running);
    let mut receiver = Receiver::new(program(running));
    let resumed = receiver.resume(flash);
    if resumed.map(|header| header.identity) != Some(package.header.identity)
        && let Err(refusal) = receiver.clear(flash)
    {
        return ended(flash, refusal);
    }
    let rest = &package.bytes[receiver.received() as usize..];
    finish(flash, &mut receiver, rest)
}

/// Sends the rest in parts of changing length, and verifies it.
pub fn finish(flash: &mut Flash, receiver: &mut Receiver, rest: &[u8]) -> End {
    let mut rest = rest;
    let mut length = 1;
    while !rest.is_empty() {
        let (part, left) = rest.split_at(length.min(rest.len()));
        if let Err(refusal) = receiver.write(flash, part) {
            return ended(flash, refusal);
        }
        (rest, length) = (left, length % 90 + 7);
    }
    while receiver.is_verifying() {
        receiver.step(flash);
    }
    match receiver.refusal() {
        Some(refusal) => ended(flash, refusal),
        None if receiver.is_ready() => End::Done,
        None => End::Unfinished,
    }
}

fn ended(flash: &Flash, refusal: Refusal) -> End {
    if flash.has_power() { End::Refused(refusal) } else { End::PowerLost }
}

/// Starts the device.
pub fn start(flash: &mut Flash, has_failed: bool) -> Selection {
    start_after(flash, if has_failed { LastRun::Failed } else { LastRun::Interrupted })
}

/// Starts the device after this end of its last run.
pub fn start_after(flash: &mut Flash, last_run: LastRun) -> Selection {
    let public_key = key().verifying_key().to_bytes();
    select(flash, &[RUNNING, OTHER], &Requirement { board: BOARD, public_key }, last_run, |_, _| {
        true
    })
}

/// Confirms the image of a slot.
pub fn confirm(flash: &mut Flash, slot: usize) -> Result<(), marks::MarkError> {
    let slot = [RUNNING, OTHER][slot];
    match marks::state(flash, &slot) {
        SlotState::Image(image) => marks::confirm(flash, &slot, &image),
        state => panic!("no image: {state:?}"),
    }
}

/// Returns the image of a slot, byte by byte.
pub fn image(flash: &mut Flash, slot: usize, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    let start = [RUNNING, OTHER][slot].start + HEADER_BYTES as u32;
    flash.read(start, &mut bytes).unwrap();
    bytes
}

/// Asserts that this selection starts one of the packages completely; returns which one.
pub fn assert_starts_one_of(
    flash: &mut Flash,
    selection: Selection,
    packages: &[&Package],
) -> usize {
    let Selection::Start { slot, .. } = selection else { panic!("nothing starts") };
    let found = packages.iter().position(|package| {
        let expected = &package.bytes[HEADER_BYTES..];
        let mut bytes = vec![0; expected.len()];
        flash.read([RUNNING, OTHER][slot].start + HEADER_BYTES as u32, &mut bytes).is_ok()
            && bytes == expected
    });
    found.unwrap_or_else(|| panic!("slot {slot} holds none of the images"))
}

/// Erases the mark page of a slot.
pub fn erase_marks(flash: &mut Flash, slot: usize) {
    let page = [RUNNING, OTHER][slot].marks_page(PAGE);
    flash.erase(page.start, page.end).unwrap();
}
