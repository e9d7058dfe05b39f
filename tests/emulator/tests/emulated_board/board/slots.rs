//! Images written to the slots of a flash without a bus, by the marks of the firmware's library.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use emulated_board::chip::flash::{BASE, Content};
use firmware::update::Slot;
use firmware::update::marks::{self, SlotState};
use joint_bus::program::package::Package;

/// The slots of the board (firmware/src/boards/stm32g474/banks.rs).
pub const SLOTS: [Slot; 2] =
    [Slot { start: 0x5000, marks: 0x3_D800 }, Slot { start: 0x4_5000, marks: 0x7_D800 }];

/// Both banks.
pub struct Both<'a>(pub &'a mut Content);

impl ErrorType for Both<'_> {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Both<'_> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let at = offset as usize;
        bytes.copy_from_slice(&self.0.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        512 << 10
    }
}

impl NorFlash for Both<'_> {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 2048;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.0.bytes[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.0.load(BASE + offset, bytes);
        Ok(())
    }
}

/// Writes a package to a slot and marks it as received.
pub fn install(content: &mut Content, slot: usize, package: &Package, sequence: u16) {
    let slot = SLOTS[slot];
    let mut flash = Both(content);
    flash.erase(slot.start, slot.marks + 2048).expect("erased");
    flash.write(slot.start, &package.bytes).expect("written");
    marks::receive(&mut flash, &slot, &package.header, sequence).expect("marked");
}

/// Marks the image of a slot as confirmed.
pub fn confirm(content: &mut Content, slot: usize) {
    let mut flash = Both(content);
    match marks::state(&mut flash, &SLOTS[slot]) {
        SlotState::Image(image) => {
            marks::confirm(&mut flash, &SLOTS[slot], &image).expect("marked")
        }
        state => panic!("{state:?}"),
    }
}
