//! The flash: both banks, for images, marks and parameters.
//!
//! What is erased while an image runs is in the other bank ([`super::banks`]), so an erase of 25 ms does not stall the
//! current loop. A mark in the own bank takes one program operation of 85 us. This requires that the option bytes select
//! two banks (DBANK, the factory setting). Otherwise every access fails and the driver reports a damaged store. The boot
//! program is never written.
//!
//! A double word that was torn by a power cut has wrong check bits. Reading it raises the non-maskable
//! interrupt, which calls [`ecc_error`]. During a read by this module the error becomes an `Err`. At any
//! other time the image itself is damaged, and the firmware stops.

use super::banks::{BANK_BYTES, PACKAGE_OFFSET};
use super::watchdog;
use core::sync::atomic::{AtomicU8, Ordering};
use embassy_stm32::flash::{Blocking, Flash, MAX_ERASE_SIZE, WRITE_SIZE};
use embassy_stm32::{Peri, pac, peripherals};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Length of a page, bytes.
const PAGE_BYTES: usize = 2048;
const _: () = assert!(MAX_ERASE_SIZE == PAGE_BYTES && WRITE_SIZE == 8, "two banks of 2 KB pages");
/// Length of both banks, bytes.
const FLASH_BYTES: usize = 2 * BANK_BYTES as usize;

/// States of a read: none, active, and failed with an ECC error.
const READ_NONE: u8 = 0;
const READ_ACTIVE: u8 = 1;
const READ_FAILED: u8 = 2;
static READ_STATE: AtomicU8 = AtomicU8::new(READ_NONE);

/// Handles an ECC error. Returns true if it occurred during a read by this module; if not, the image is
/// damaged.
pub fn ecc_error() -> bool {
    let status = pac::FLASH.eccr().read();
    let is_expected =
        READ_STATE.load(Ordering::Relaxed) != READ_NONE && (status.eccd() || status.eccd2());
    if is_expected {
        // Writing the value back clears its flags, which are cleared by ones.
        pac::FLASH.eccr().write_value(status);
        READ_STATE.store(READ_FAILED, Ordering::Relaxed);
    }
    is_expected
}

/// Reason why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Not aligned, or beyond the end.
    Bounds(NorFlashErrorKind),
    /// The check bits are wrong.
    Ecc,
    /// The option bytes select a single bank.
    OneBank,
    /// The controller refused an erase or a program operation.
    Refused,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Bounds(kind) => *kind,
            Self::Ecc | Self::OneBank | Self::Refused => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for FlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Bounds(kind)
    }
}

/// Both banks of the flash.
pub struct ChipFlash(Option<Flash<'static, Blocking>>);

impl ChipFlash {
    /// Creates the flash. With other option bytes every access fails.
    pub fn new(flash: Peri<'static, peripherals::FLASH>) -> Self {
        // Checked first, because embassy would panic.
        let two_banks = pac::FLASH.optr().read().dbank();
        Self(two_banks.then(|| Flash::new_blocking(flash)))
    }

    /// Refuses the parts of the boot program, at the start of each bank.
    fn check_writable(&self, offset: u32) -> Result<(), FlashError> {
        if offset % BANK_BYTES < PACKAGE_OFFSET { Err(FlashError::Refused) } else { Ok(()) }
    }

    fn inner(&mut self) -> Result<&mut Flash<'static, Blocking>, FlashError> {
        self.0.as_mut().ok_or(FlashError::OneBank)
    }
}

impl ErrorType for ChipFlash {
    type Error = FlashError;
}

impl ReadNorFlash for ChipFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check_read(self, offset, bytes.len())?;
        let flash = self.inner()?;
        READ_STATE.store(READ_ACTIVE, Ordering::SeqCst);
        let read = flash.blocking_read(offset, bytes);
        // The interrupt occurs with the access, which must complete before the state is read.
        cortex_m::asm::dsb();
        let sound = READ_STATE.swap(READ_NONE, Ordering::SeqCst) == READ_ACTIVE;
        match (read, sound) {
            (Ok(()), true) => Ok(()),
            (_, false) => Err(FlashError::Ecc),
            (Err(_), true) => Err(FlashError::Refused),
        }
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for ChipFlash {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check_erase(self, from, to)?;
        for page in (from..to).step_by(PAGE_BYTES) {
            // The background only waits here, so it refreshes the watchdog if the loop runs.
            watchdog::refresh_if_loop_runs();
            self.check_writable(page)?;
            let end = page + PAGE_BYTES as u32;
            self.inner()?.blocking_erase(page, end).map_err(|_| FlashError::Refused)?;
        }
        watchdog::refresh_if_loop_runs();
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len())?;
        self.check_writable(offset)?;
        watchdog::refresh_if_loop_runs();
        self.inner()?.blocking_write(offset, bytes).map_err(|_| FlashError::Refused)
    }
}
