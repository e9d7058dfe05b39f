//! The flash of the chip, or the part of it that a board's `banks` names ([`super::banks`]).
//!
//! The board states which part a firmware may write, and whether the option bytes are as its layout requires. Otherwise
//! every access fails and the driver reports a damaged store.
//!
//! A double word that was torn by a power cut has wrong check bits. Reading it raises the non-maskable
//! interrupt, which calls [`ecc_error`]. During a read by this module the error becomes an `Err`. At any
//! other time the image itself is damaged, and the firmware stops.

use super::banks::{AREA_BYTES, AREA_OFFSET, is_usable, is_writable};
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
const _: () = assert!(MAX_ERASE_SIZE == PAGE_BYTES && WRITE_SIZE == 8, "pages of 2 KB");

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
    /// The option bytes select another layout.
    Layout,
    /// The controller refused an erase or a program operation.
    Refused,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Bounds(kind) => *kind,
            Self::Ecc | Self::Layout | Self::Refused => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for FlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Bounds(kind)
    }
}

/// The board's area of the flash.
pub struct ChipFlash(Option<Flash<'static, Blocking>>);

impl ChipFlash {
    /// Creates the flash. With other option bytes every access fails.
    pub fn new(flash: Peri<'static, peripherals::FLASH>) -> Self {
        // Checked first, because embassy would panic.
        Self(is_usable().then(|| Flash::new_blocking(flash)))
    }

    /// Refuses the parts that no firmware may write.
    fn check_writable(&self, offset: u32) -> Result<(), FlashError> {
        if is_writable(offset) { Ok(()) } else { Err(FlashError::Refused) }
    }

    fn inner(&mut self) -> Result<&mut Flash<'static, Blocking>, FlashError> {
        self.0.as_mut().ok_or(FlashError::Layout)
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
        let read = flash.blocking_read(AREA_OFFSET + offset, bytes);
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
        AREA_BYTES
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
            let (from, to) = (AREA_OFFSET + page, AREA_OFFSET + page + PAGE_BYTES as u32);
            self.inner()?.blocking_erase(from, to).map_err(|_| FlashError::Refused)?;
        }
        watchdog::refresh_if_loop_runs();
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len())?;
        self.check_writable(offset)?;
        watchdog::refresh_if_loop_runs();
        self.inner()?.blocking_write(AREA_OFFSET + offset, bytes).map_err(|_| FlashError::Refused)
    }
}
