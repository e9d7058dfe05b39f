//! Flash with two slots, and packages for them, right ones and wrong ones.

use ed25519_dalek::{Signer, SigningKey};
use embedded_storage::nor_flash::ReadNorFlash;
use firmware::store::memory::{MemoryFlash, PAGE_BYTES, TornStep};
use firmware::update::boot::Requirement;
use firmware::update::package::{CRC, HEADER_BYTES, Header, USED_BYTES, Version, emit};
use firmware::update::{Board, Program, Slot};
use sha2::{Digest, Sha512};
use std::sync::LazyLock;

pub const PAGE: u32 = PAGE_BYTES as u32;
const SLOT_PAGES: u32 = 3;
const STORE_PAGES: u32 = 4;
/// A bank: a slot, its marks, and a parameter store.
const BANK: u32 = (SLOT_PAGES + 1 + STORE_PAGES) * PAGE;
const BASE: u32 = 0x0800_0000;
const BOARD: Board = Board { number: u32::from_be_bytes(*b"FUZZ"), wiring: 0x77 };

pub type Flash = MemoryFlash<{ 2 * (SLOT_PAGES + 1 + STORE_PAGES) as usize }>;

pub const SLOTS: [Slot; 2] = [slot(0), slot(1)];

const fn slot(bank: u32) -> Slot {
    Slot { start: bank * BANK, marks: bank * BANK + SLOT_PAGES * PAGE }
}

fn key() -> SigningKey {
    SigningKey::from_bytes(&[7; 32])
}

/// Returns the board's description for a program that runs from this slot.
pub fn program(running: usize) -> Program {
    let store = |bank: u32| bank * BANK + (SLOT_PAGES + 1) * PAGE;
    let other = 1 - running;
    Program {
        board: BOARD,
        key_at: u32::MAX,
        base: BASE,
        running: SLOTS[running],
        other: SLOTS[other],
        stores: [store(running as u32), store(other as u32)],
        store_bytes: STORE_PAGES * PAGE,
    }
}

/// Returns what the boot program requires of an image.
#[allow(dead_code)] // One target starts none.
pub fn requirement() -> Requirement {
    static PUBLIC_KEY: LazyLock<[u8; 32]> = LazyLock::new(|| key().verifying_key().to_bytes());
    Requirement { board: BOARD, public_key: *PUBLIC_KEY }
}

/// A package for one slot.
#[allow(dead_code)] // One target only needs the bytes.
pub struct Package {
    pub slot: usize,
    pub header: Header,
    pub bytes: Vec<u8>,
    /// It is complete, and signed with the board's key. The boot program may start it.
    pub is_signed: bool,
    /// It is for another board or another wiring.
    pub is_foreign: bool,
}

/// What is wrong with a package.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fault {
    None,
    Key,
    Board,
    Wiring,
    /// The image was changed, with its CRC.
    Image,
}

fn package(slot: usize, version: u32, counter: u32, length: usize, fault: Fault) -> Package {
    let seed = version as u8 ^ slot as u8;
    let mut image: Vec<u8> = (0..length).map(|at| (at as u8).wrapping_mul(37) ^ seed).collect();
    let hash = Sha512::digest(&image);
    if fault == Fault::Image {
        image[length / 2] ^= 1;
    }
    let header = Header {
        board: BOARD.number + u32::from(fault == Fault::Board),
        wiring: BOARD.wiring + u32::from(fault == Fault::Wiring),
        version: Version(version),
        counter,
        length: length as u32,
        crc: CRC.checksum(&image),
        address: program(1 - slot).image_address(&SLOTS[slot]),
        identity: 0,
    };
    let key = if fault == Fault::Key { SigningKey::from_bytes(&[8; 32]) } else { key() };
    let signed = header.signed(&hash.into());
    let emitted = emit(&signed, &key.sign(&signed).to_bytes());
    let header = Header { identity: CRC.checksum(&emitted[..USED_BYTES]), ..header };
    Package {
        slot,
        header,
        bytes: [&emitted[..], &image].concat(),
        is_signed: !matches!(fault, Fault::Key | Fault::Image),
        is_foreign: matches!(fault, Fault::Board | Fault::Wiring),
    }
}

/// Counter of the oldest good packages; a smaller one is refused.
pub const COUNTER: u32 = 5;

/// All packages, those for slot 0 first. The last of each half is newer than all others.
pub fn packages() -> &'static [Package] {
    static PACKAGES: LazyLock<Vec<Package>> = LazyLock::new(|| {
        let of_slot = |slot| {
            [
                package(slot, 1, COUNTER, 4400, Fault::None),
                package(slot, 2, COUNTER, 1200, Fault::None),
                package(slot, 3, COUNTER + 1, 5632, Fault::None),
                package(slot, 4, COUNTER, 1200, Fault::Key),
                package(slot, 5, COUNTER, 1200, [Fault::Board, Fault::Wiring][slot]),
                package(slot, 6, COUNTER, 1200, Fault::Image),
                package(slot, 7, COUNTER - 1, 1200, Fault::None),
                package(slot, 9, COUNTER + 4, 1704, Fault::None),
            ]
        };
        [0, 1].into_iter().flat_map(of_slot).collect()
    });
    &PACKAGES
}

/// Returns the package that a slot holds completely, whatever slot it is for.
pub fn found_in<F: ReadNorFlash>(flash: &mut F, slot: usize) -> Option<&'static Package> {
    packages().iter().find(|package| {
        let mut bytes = vec![0; package.bytes.len()];
        // The end of the header is not signed.
        flash.read(SLOTS[slot].start, &mut bytes).is_ok()
            && bytes[..USED_BYTES] == package.bytes[..USED_BYTES]
            && bytes[HEADER_BYTES..] == package.bytes[HEADER_BYTES..]
    })
}

/// Returns what a cut of the power leaves of a step.
#[allow(dead_code)] // One target cuts no power.
pub fn torn_step(kind: u8, seed: u32) -> TornStep {
    match kind % 7 {
        0 => TornStep::Nothing,
        1 => TornStep::FirstHalf,
        2 => TornStep::LastHalf,
        3 => TornStep::Partly(seed),
        4 => TornStep::Garbage(seed),
        5 => TornStep::Unreadable(seed),
        _ => TornStep::Done,
    }
}
