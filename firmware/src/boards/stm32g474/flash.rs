//! The parameter store's flash: the last four pages of the second bank.
//!
//! The image is in the first bank and is read on while a page of the second is erased, so an erase of 25 ms
//! stalls nobody. Only while the option bytes keep two banks (DBANK, as delivered): else there is no flash
//! here, every access fails, and the driver says that its store is damaged.
//!
//! A double word that was torn by a loss of power has check bits that do not fit. Reading it raises the
//! non-maskable interrupt. [`ecc_error`] is that interrupt: during a read of ours it becomes an `Err`;
//! anywhere else the image itself has rotted, and the firmware stops.

use super::watchdog;
use core::sync::atomic::{AtomicU8, Ordering};
use embassy_stm32::flash::{Blocking, Flash, MAX_ERASE_SIZE, WRITE_SIZE};
use embassy_stm32::{Peri, pac, peripherals};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Bytes of a page.
const PAGE: usize = 2048;
const _: () = assert!(MAX_ERASE_SIZE == PAGE && WRITE_SIZE == 8, "two banks of 2 KB pages");
/// Two slots of two pages each, at the end of 512 KB.
const SIZE: usize = 4 * PAGE;
const BASE: u32 = (512 * 1024 - SIZE) as u32;

/// Nobody reads; a read is under way; a read met check bits that do not fit.
const IDLE: u8 = 0;
const READING: u8 = 1;
const FAILED: u8 = 2;
static READ: AtomicU8 = AtomicU8::new(IDLE);

/// The non-maskable interrupt. Says whether it was a read of ours; if not, nothing can be trusted.
pub fn ecc_error() -> bool {
    let status = pac::FLASH.eccr().read();
    let ours = READ.load(Ordering::Relaxed) != IDLE && (status.eccd() || status.eccd2());
    if ours {
        // Written as read: its flags are cleared by ones.
        pac::FLASH.eccr().write_value(status);
        READ.store(FAILED, Ordering::Relaxed);
    }
    ours
}

/// Why the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Not aligned, or beyond the end.
    Bounds(NorFlashErrorKind),
    /// Check bits do not fit.
    Ecc,
    /// The option bytes make it one bank.
    OneBank,
    /// The controller refused to erase or program.
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

/// The store's flash.
pub struct StoreFlash(Option<Flash<'static, Blocking>>);

impl StoreFlash {
    /// Takes the flash; where the option bytes are others, it refuses from then on.
    pub fn new(flash: Peri<'static, peripherals::FLASH>) -> Self {
        // Asked first, for embassy would panic.
        let two_banks = pac::FLASH.optr().read().dbank();
        Self(two_banks.then(|| Flash::new_blocking(flash)))
    }

    fn inner(&mut self) -> Result<&mut Flash<'static, Blocking>, FlashError> {
        self.0.as_mut().ok_or(FlashError::OneBank)
    }
}

impl ErrorType for StoreFlash {
    type Error = FlashError;
}

impl ReadNorFlash for StoreFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check_read(self, offset, bytes.len())?;
        let flash = self.inner()?;
        READ.store(READING, Ordering::SeqCst);
        let read = flash.blocking_read(BASE + offset, bytes);
        // The interrupt comes with the access, not with the next instruction.
        cortex_m::asm::dsb();
        let sound = READ.swap(IDLE, Ordering::SeqCst) == READING;
        match (read, sound) {
            (Ok(()), true) => Ok(()),
            (_, false) => Err(FlashError::Ecc),
            (Err(_), true) => Err(FlashError::Refused),
        }
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for StoreFlash {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check_erase(self, from, to)?;
        for page in (from..to).step_by(PAGE) {
            // The background lives, it only waits; whether the loop does is looked at.
            watchdog::feed();
            let (start, end) = (BASE + page, BASE + page + PAGE as u32);
            self.inner()?.blocking_erase(start, end).map_err(|_| FlashError::Refused)?;
        }
        watchdog::feed();
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len())?;
        watchdog::feed();
        self.inner()?.blocking_write(BASE + offset, bytes).map_err(|_| FlashError::Refused)
    }
}
