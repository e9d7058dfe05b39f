//! Flash with faults, and flash with other page and word sizes.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use firmware::store::memory::{MemoryError, MemoryFlash, PAGE_BYTES};
use std::cell::{Cell, RefCell};
use std::rc::Rc;

/// Flash that the test shares with the store, with reads that can fail.
#[derive(Clone, Default)]
pub struct Shared {
    pub flash: Rc<RefCell<MemoryFlash<2>>>,
    /// Reads until the newer slot's payload reads wrong.
    pub good_reads: Rc<Cell<u32>>,
}

impl ErrorType for Shared {
    type Error = MemoryError;
}

impl ReadNorFlash for Shared {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        self.flash.borrow_mut().read(offset, bytes)?;
        let left = self.good_reads.get();
        self.good_reads.set(left.saturating_sub(1));
        if left == 0 && offset == PAGE_BYTES as u32 + 64 {
            bytes[0] ^= 1;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PAGE_BYTES
    }
}

impl NorFlash for Shared {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        self.flash.borrow_mut().erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        self.flash.borrow_mut().write(offset, bytes)
    }
}

/// Flash with one cell that always reads 1, and one that always reads 0.
pub struct Worn {
    pub flash: MemoryFlash<2>,
    pub one: (usize, u8),
    pub zero: (usize, u8),
}

impl ErrorType for Worn {
    type Error = MemoryError;
}

impl ReadNorFlash for Worn {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        self.flash.read(offset, bytes)?;
        for (at, byte) in (offset as usize..).zip(bytes) {
            *byte |= if at == self.one.0 { self.one.1 } else { 0 };
            *byte &= if at == self.zero.0 { !self.zero.1 } else { 0xFF };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Worn {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        self.flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        self.flash.write(offset, bytes)
    }
}

/// Flash that is programmed by 4 bytes and erased by 512 bytes.
pub struct Words(pub Vec<u8>);

impl ErrorType for Words {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Words {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        assert_eq!((offset % 4, bytes.len() % 4), (0, 0));
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Words {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 512;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let place = &mut self.0[offset as usize..][..bytes.len()];
        assert!(place.iter().all(|byte| *byte == 0xFF), "programmed twice");
        place.copy_from_slice(bytes);
        Ok(())
    }
}
