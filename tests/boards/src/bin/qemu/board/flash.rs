//! Emulated flash: in RAM that survives a reset, or in a file of the host that survives the emulator.
//!
//! It follows the rules of the STM32G474 ([`MemoryFlash`]). Each double word programmed and each page
//! erased is written to the file before the step counts as done. An emulator that is killed therefore
//! leaves what a chip leaves after a power cut. Without a file, the bytes are in RAM that start-up code
//! does not clear ([`super::kept`]).

use super::kept::{Kept, LENGTH, PAGES};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use firmware::store::memory::{DOUBLE_WORD_BYTES, MemoryError, MemoryFlash, PAGE_BYTES};
use semihosting::fs::File;
use semihosting::io::{self, Read, Seek, SeekFrom, Write};

/// Reason why an operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// The rules of the flash were violated.
    Rule(MemoryError),
    /// The host could not write the file.
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

/// Reason why the flash could not be opened.
#[derive(Clone, Copy, Debug)]
pub enum OpenError {
    /// The file can be neither opened, created nor read.
    Host,
    /// The file has this length, bytes, which is not that of a driver's flash.
    Length(u64),
}

/// Storage of the bytes.
enum Storage {
    File(File),
    Kept(Kept),
}

/// The emulated flash.
pub struct BoardFlash {
    memory: MemoryFlash<PAGES>,
    copy: Storage,
}

impl BoardFlash {
    /// Returns flash that only survives a reset.
    pub fn kept(mut kept: Kept) -> Self {
        let mut memory = MemoryFlash::new();
        if kept.is_warm() {
            memory.restore(kept.bytes());
        } else {
            memory.image().zip(kept.bytes_mut().chunks_mut(PAGE_BYTES)).for_each(
                |(page, place)| {
                    place.copy_from_slice(page);
                },
            );
        }
        Self { memory, copy: Storage::Kept(kept) }
    }

    /// Returns flash in this file, which is created if it does not exist.
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
        Ok(Self { memory, copy: Storage::File(file) })
    }

    /// Writes a changed range to the storage.
    fn save_range(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        for at in (from..to).step_by(DOUBLE_WORD_BYTES) {
            let mut unit = [0; DOUBLE_WORD_BYTES];
            self.memory.read(at, &mut unit)?;
            match &mut self.copy {
                Storage::File(file) => file
                    .seek(SeekFrom::Start(u64::from(at)))
                    .and_then(|_| file.write_all(&unit))
                    .map_err(|_| FlashError::File)?,
                Storage::Kept(kept) => {
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
    const WRITE_SIZE: usize = DOUBLE_WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.memory.erase(from, to)?;
        self.save_range(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        for (at, unit) in (offset..).step_by(DOUBLE_WORD_BYTES).zip(bytes.chunks(DOUBLE_WORD_BYTES))
        {
            self.memory.write(at, unit)?;
            self.save_range(at, at + DOUBLE_WORD_BYTES as u32)?;
        }
        Ok(())
    }
}
