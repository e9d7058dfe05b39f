//! Layout of the two banks, as offsets from the start of the flash: see `memory.x`.
//!
//! An image is linked for one slot, [`crate::SLOT`]. The boot program counts as the first, so in recovery it receives into
//! the second.

use super::pins::WIRING;
use crate::SLOT;
use embassy_stm32::pac;
use firmware::update::{Board, Program, Slot};

/// This board in packages: its type, and its wiring.
pub const BOARD: Board = Board { number: u32::from_be_bytes(*b"G474"), wiring: WIRING };
/// Address of the flash.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Length of a bank, bytes.
pub const BANK_BYTES: u32 = 256 * 1024;
/// Offset of a package in its bank: behind a part of the boot program.
pub const PACKAGE_OFFSET: u32 = 0x5000;
/// Offset of the public key in the boot program: see `boot.x`.
const KEY_OFFSET: u32 = PACKAGE_OFFSET - 32;
const MARKS_OFFSET: u32 = 0x3_D800;
const STORE_OFFSET: u32 = 0x3_E000;
const STORE_BYTES: u32 = BANK_BYTES - STORE_OFFSET;
/// Both banks are one area ([`super::flash`]).
pub const AREA_OFFSET: u32 = 0;
pub const AREA_BYTES: usize = 2 * BANK_BYTES as usize;
/// The slot that does not run.
const OTHER: usize = 1 - SLOT;

const fn slot(bank: u32) -> Slot {
    let start = bank * BANK_BYTES;
    Slot { start: start + PACKAGE_OFFSET, marks: start + MARKS_OFFSET }
}

const fn store(bank: usize) -> u32 {
    bank as u32 * BANK_BYTES + STORE_OFFSET
}

/// Returns true if the option bytes select two banks (DBANK, the factory setting).
///
/// What is erased while an image runs is in the other bank, so an erase of 25 ms does not stall the current loop. A mark in
/// the own bank takes one program operation of 85 us.
pub fn is_usable() -> bool {
    pac::FLASH.optr().read().dbank()
}

/// Returns true if a firmware may write here: not the parts of the boot program, at the start of each bank.
pub const fn is_writable(offset: u32) -> bool {
    offset % BANK_BYTES >= PACKAGE_OFFSET
}

/// Slots A and B.
pub const SLOTS: [Slot; 2] = [slot(0), slot(1)];

/// What the update knows of this board.
pub const PROGRAM: Program = Program {
    board: BOARD,
    key_at: KEY_OFFSET,
    base: FLASH_BASE,
    running: SLOTS[SLOT],
    other: SLOTS[OTHER],
    stores: [store(SLOT), store(OTHER)],
    store_bytes: STORE_BYTES,
};
