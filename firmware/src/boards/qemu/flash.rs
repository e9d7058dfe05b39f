//! Flash in RAM that outlives resets, and in a file of the host's that outlives the emulator.
//!
//! The rules are those of the STM32G474's ([`MemoryFlash`]). Every double word programmed and every page
//! erased goes into the file at its own place before the step counts as done, so an emulator that is killed leaves what
//! a chip does whose power is cut. Without a file the bytes are kept in RAM that start-up leaves alone
//! ([`super::kept`]): they outlive a reset of the machine.

use super::kept::{Kept, LENGTH, PAGES};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use firmware::store::memory::{DOUBLE_WORD, MemoryError, MemoryFlash, PAGE};
use semihosting::fs::File;
use semihosting::io::{self, Read, Seek, SeekFrom, Write};

/// Why the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Its own rules.
    Rule(MemoryError),
    /// The host could not write its file.
    File,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Rule(error) => error.kind(),
            Self::File => NorFlashErrorKind::Other,
        }
    }
}

impl From<MemoryError> for FlashError {
    fn from(error: MemoryError) -> Self {
        Self::Rule(error)
    }
}

/// Why there is no flash.
#[derive(Clone, Copy, Debug)]
pub enum OpenError {
    /// The file can be neither opened nor made, or not read.
    Host,
    /// It is no flash of a driver: so many bytes.
    Length(u64),
}

/// Where the bytes are kept.
enum Copy {
    File(File),
    Kept(Kept),
}

/// The flash.
pub struct BoardFlash {
    memory: MemoryFlash<PAGES>,
    copy: Copy,
}

impl BoardFlash {
    /// Flash that is kept over a reset, and no longer.
    pub fn kept(mut kept: Kept) -> Self {
        let mut memory = MemoryFlash::new();
        if kept.is_warm() {
            memory.restore(kept.bytes());
        } else {
            memory.image().zip(kept.bytes_mut().chunks_mut(PAGE)).for_each(|(page, place)| {
                place.copy_from_slice(page);
            });
        }
        Self { memory, copy: Copy::Kept(kept) }
    }

    /// Flash in this file, made where there is none.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn in_file(path: &core::ffi::CStr) -> Result<Self, OpenError> {
        let host = |_: io::Error| OpenError::Host;
        let mut memory = MemoryFlash::new();
        let mut options = File::options();
        options.read(true).write(true);
        let mut file = match options.open(path) {
            Ok(file) => file,
            Err(_) => options.create(true).truncate(true).open(path).map_err(host)?,
        };
        match file.metadata().map_err(host)?.len() {
            0 => memory.image().try_for_each(|page| file.write_all(page)).map_err(host)?,
            length if length == LENGTH as u64 => {
                let mut page = [0; LENGTH];
                file.read_exact(&mut page).map_err(host)?;
                memory.restore(&page);
            }
            length => return Err(OpenError::Length(length)),
        }
        Ok(Self { memory, copy: Copy::File(file) })
    }

    /// Copies what changed.
    fn keep(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        for at in (from..to).step_by(DOUBLE_WORD) {
            let mut unit = [0; DOUBLE_WORD];
            self.memory.read(at, &mut unit)?;
            match &mut self.copy {
                Copy::File(file) => file
                    .seek(SeekFrom::Start(u64::from(at)))
                    .and_then(|_| file.write_all(&unit))
                    .map_err(|_| FlashError::File)?,
                Copy::Kept(kept) => {
                    let place = kept.bytes_mut().get_mut(at as usize..).unwrap_or_default();
                    place.iter_mut().zip(unit).for_each(|(place, byte)| *place = byte);
                }
            }
        }
        Ok(())
    }
}

impl ErrorType for BoardFlash {
    type Error = FlashError;
}

impl ReadNorFlash for BoardFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        Ok(self.memory.read(offset, bytes)?)
    }

    fn capacity(&self) -> usize {
        LENGTH
    }
}

impl NorFlash for BoardFlash {
    const WRITE_SIZE: usize = DOUBLE_WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.memory.erase(from, to)?;
        self.keep(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        for (at, unit) in (offset..).step_by(DOUBLE_WORD).zip(bytes.chunks(DOUBLE_WORD)) {
            self.memory.write(at, unit)?;
            self.keep(at, at + DOUBLE_WORD as u32)?;
        }
        Ok(())
    }
}
