//! Program update with two image slots: receive, verify, try once, confirm, or fall back.
//!
//! A flash holds two *slots*. The driver runs from one (`own`) and receives a [`package`] into the other. Its image is
//! linked for that slot, so a release has one for each. A slot ends with a page of *marks* ([`marks`]): double words that
//! are each written once after an erase of that page.
//!
//! ```text
//! clear           receive          CRC right        [boot] signature right    [driver] self-test passed
//! marks erased -> header, image -> mark RECEIVED -> mark TRIAL -----------> mark CONFIRMED
//!                                                    | signature wrong, or reset by watchdog or software: mark REJECTED
//! ```
//! [`boot::select`] chooses the slot at every start: the newest one that is signed, intact, and confirmed or with a
//! start left. Every step leaves at most one torn double word or page, and each reading of it is safe: a torn RECEIVED
//! is no image, a torn TRIAL counts as used, a torn CONFIRMED is written again in the next place. The running image is
//! never written, and a trial does not clear the image before it, so one image always starts. [`receiver`] is the
//! receiving side, [`signature`] checks who signed.

pub mod boot;
mod flash;
pub mod marks;
pub mod package;
pub mod receiver;
pub mod recovery;
pub mod session;
pub mod signature;
pub mod trial;

use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Length of the unit of programming, bytes.
pub const UNIT_BYTES: u32 = 8;

/// Place of an image and of its marks in a flash, as offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// First byte of the package: a multiple of a page.
    pub start: u32,
    /// Offset of the page of marks: the end of the space for the package.
    pub marks: u32,
}

impl Slot {
    /// Returns the maximum length of a package, bytes.
    pub const fn package_bytes(&self) -> u32 {
        self.marks.saturating_sub(self.start)
    }

    /// Returns the offsets of the page of marks for this length of a page.
    pub const fn marks_page(&self, page_bytes: u32) -> Range<u32> {
        self.marks..self.marks + page_bytes
    }
}

/// First four bytes of the published test key (`keys/test.pub`), as object 2040h:12 reports those of the key in use.
pub const PUBLISHED_KEY: u32 = 0xEA4A_6C63;

/// Board of an image. Images of another board or another wiring are refused: an output would drive something else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Number of the board type, four letters.
    pub number: u32,
    /// Identity of its wiring: it differs if a pin or a scale does.
    pub wiring: u32,
}

impl Board {
    /// Returns true if the image of a header is made for this board.
    pub const fn fits(&self, header: &package::Header) -> bool {
        self.number == header.board && self.wiring == header.wiring
    }
}

/// Description of a board for the update.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// Board for which images must be made.
    pub board: Board,
    /// Offset of the public key of the boot program in the flash.
    pub key_at: u32,
    /// Address of the flash in the processor's memory.
    pub base: u32,
    /// Slot of the running image.
    pub running: Slot,
    /// Slot that receives updates.
    pub other: Slot,
    /// Offsets of the parameter stores: in the bank of the running image, and in the other one. Both have
    /// [`Program::store_bytes`].
    pub stores: [u32; 2],
    /// Length of a parameter store, bytes.
    pub store_bytes: u32,
}

impl Program {
    /// Returns the first four bytes of the boot program's public key, which tell the published test key from others; 0 if
    /// there is no boot program.
    pub fn update_key<F: NorFlash>(&self, flash: &mut F) -> u32 {
        let mut bytes = [0; 4];
        let is_read = flash.read(self.key_at, &mut bytes).is_ok();
        if is_read && bytes != [0xFF; 4] { u32::from_be_bytes(bytes) } else { 0 }
    }

    /// Returns the address of the image in a slot, which is that of its vector table.
    pub const fn image_address(&self, slot: &Slot) -> u32 {
        self.base + slot.start + package::HEADER_BYTES as u32
    }

    /// Returns the two slots of the parameter store in the bank of the running image.
    pub const fn running_store(&self) -> [Range<u32>; 2] {
        self.store_slots(self.stores[0])
    }

    /// Returns the two slots of the parameter store in the other bank.
    pub const fn other_store(&self) -> [Range<u32>; 2] {
        self.store_slots(self.stores[1])
    }

    const fn store_slots(&self, start: u32) -> [Range<u32>; 2] {
        let half = start + self.store_bytes / 2;
        [start..half, half..start + self.store_bytes]
    }
}
