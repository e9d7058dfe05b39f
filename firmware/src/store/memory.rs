//! Flash in RAM with the rules of the STM32G474's flash and a simulated power supply.
//!
//! It serves the driver on a PC, the emulated board and the tests. What violates the rules of the chip is
//! refused here too: a page of 2048 bytes is erased as a whole; a double word of 8 bytes is programmed once
//! after that, even if only with ones; programming changes bits from 1 to 0 only.
//!
//! Each double word programmed and each page erased is a *step*. [`MemoryFlash::cut_power`] cuts the power
//! at a later step, and [`TornStep`] selects what the step leaves behind. All operations then fail until
//! [`MemoryFlash::power_on`]. [`MemoryFlash::flip_bit`] simulates a bit error.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Length of a page, bytes.
pub const PAGE_BYTES: usize = 2048;

/// Length of a double word, bytes.
pub const DOUBLE_WORD_BYTES: usize = 8;

const WORDS_PER_PAGE: usize = PAGE_BYTES / DOUBLE_WORD_BYTES;

/// Reason why an operation was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryError {
    /// Not aligned to a double word, or to a page for an erase.
    NotAligned,
    /// Beyond the end of the flash.
    OutOfBounds,
    /// The double word was already programmed since the last erase.
    ProgrammedTwice,
    /// The double word was torn, so its check bits are wrong.
    Unreadable,
    /// The power is off.
    PowerLost,
}

impl NorFlashError for MemoryError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for MemoryError {
    fn from(kind: NorFlashErrorKind) -> Self {
        if kind == NorFlashErrorKind::NotAligned { Self::NotAligned } else { Self::OutOfBounds }
    }
}

/// Result of the step during which the power fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TornStep {
    /// Nothing is changed.
    Nothing,
    /// Only the first half of the step is done.
    FirstHalf,
    /// Only the second half of the step is done.
    LastHalf,
    /// Each bit that should change did so or not, at random from this seed.
    Partly(u32),
    /// Every bit is random, from this seed.
    Garbage(u32),
    /// As [`TornStep::Partly`], and the affected double words cannot be read.
    Unreadable(u32),
    /// The step was completed, but an error is returned.
    Done,
}

#[derive(Clone, Debug)]
struct Page {
    bytes: [u8; PAGE_BYTES],
    /// One bit per double word programmed since the last erase.
    programmed: [u32; WORDS_PER_PAGE / 32],
    unreadable: [u32; WORDS_PER_PAGE / 32],
    erases: u32,
}

impl Page {
    const ERASED: Self = Self {
        bytes: [0xFF; PAGE_BYTES],
        programmed: [0; WORDS_PER_PAGE / 32],
        unreadable: [0; WORDS_PER_PAGE / 32],
        erases: 0,
    };
}

fn is_bit_set(words: &[u32; WORDS_PER_PAGE / 32], word: usize) -> bool {
    words.get(word / 32).is_some_and(|bits| bits & (1 << (word % 32)) != 0)
}

fn set_bit(words: &mut [u32; WORDS_PER_PAGE / 32], word: usize) {
    if let Some(bits) = words.get_mut(word / 32) {
        *bits |= 1 << (word % 32);
    }
}

/// Flash of `PAGES` pages.
#[derive(Clone, Debug)]
pub struct MemoryFlash<const PAGES: usize> {
    pages: [Page; PAGES],
    steps: u32,
    cut: Option<(u32, TornStep)>,
    power: bool,
}

impl<const PAGES: usize> Default for MemoryFlash<PAGES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const PAGES: usize> MemoryFlash<PAGES> {
    /// Erased flash.
    pub const fn new() -> Self {
        Self { pages: [Page::ERASED; PAGES], steps: 0, cut: None, power: true }
    }

    /// Sets the content from a saved image that starts at offset 0. Double words that are not all ones
    /// count as programmed. Bytes beyond the flash are ignored.
    pub fn restore(&mut self, image: &[u8]) {
        for (page, bytes) in self.pages.iter_mut().zip(image.chunks(PAGE_BYTES)) {
            *page = Page { erases: page.erases, ..Page::ERASED };
            for (word, (place, unit)) in page
                .bytes
                .chunks_mut(DOUBLE_WORD_BYTES)
                .zip(bytes.chunks(DOUBLE_WORD_BYTES))
                .enumerate()
            {
                place.iter_mut().zip(unit).for_each(|(to, from)| *to = *from);
                if unit.iter().any(|byte| *byte != 0xFF) {
                    set_bit(&mut page.programmed, word);
                }
            }
        }
    }

    /// Returns the bytes page by page, to save them.
    pub fn image(&self) -> impl Iterator<Item = &[u8; PAGE_BYTES]> {
        self.pages.iter().map(|page| &page.bytes)
    }

    /// Returns the number of steps so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Returns how often a page was erased.
    pub fn erases(&self, page: usize) -> u32 {
        self.pages.get(page).map_or(0, |page| page.erases)
    }

    /// Cuts the power during a later step; 0 is the next one.
    pub fn cut_power(&mut self, step: u32, torn: TornStep) {
        self.cut = Some((self.steps.saturating_add(step), torn));
    }

    /// Returns true if the power is on.
    pub fn has_power(&self) -> bool {
        self.power
    }

    /// Switches the power on and cancels a pending cut.
    pub fn power_on(&mut self) {
        self.power = true;
        self.cut = None;
    }

    /// Inverts a bit, counted from the lowest bit of the first byte.
    pub fn flip_bit(&mut self, bit: usize) {
        let at = bit / 8;
        let page = self.pages.get_mut(at / PAGE_BYTES);
        if let Some(byte) = page.and_then(|page| page.bytes.get_mut(at % PAGE_BYTES)) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// Counts a step. Returns the result of the step if the power fails during it.
    fn step(&mut self) -> Option<TornStep> {
        let torn = self.cut.filter(|(step, _)| *step == self.steps).map(|(_, torn)| torn);
        self.steps = self.steps.saturating_add(1);
        if torn.is_some() {
            self.power = false;
        }
        torn
    }
}

/// Applies a torn change from `place` to `wanted`.
fn tear<'a>(
    place: impl ExactSizeIterator<Item = &'a mut u8>,
    wanted: impl Iterator<Item = u8>,
    torn: TornStep,
) {
    let half = place.len() / 2;
    let mut random = RandomBytes::of(torn);
    for (index, (byte, wanted)) in place.zip(wanted).enumerate() {
        let changed = match torn {
            TornStep::Nothing => 0,
            TornStep::Done => 0xFF,
            TornStep::FirstHalf => u8::from(index < half) * 0xFF,
            TornStep::LastHalf => u8::from(index >= half) * 0xFF,
            TornStep::Partly(_) | TornStep::Unreadable(_) => random.byte(),
            TornStep::Garbage(_) => {
                *byte = random.byte();
                continue;
            }
        };
        *byte ^= (*byte ^ wanted) & changed;
    }
}

/// Random bytes from Marsaglia's xorshift.
struct RandomBytes(u32);

impl RandomBytes {
    fn of(torn: TornStep) -> Self {
        let (TornStep::Partly(seed) | TornStep::Garbage(seed) | TornStep::Unreadable(seed)) = torn
        else {
            return Self(1);
        };
        // The state must not be 0; small seeds need a few rounds to spread.
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9) | 1);
        (0..8).for_each(|_| _ = random.byte());
        random
    }

    fn byte(&mut self) -> u8 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 24) as u8
    }
}

impl<const PAGES: usize> ErrorType for MemoryFlash<PAGES> {
    type Error = MemoryError;
}

impl<const PAGES: usize> ReadNorFlash for MemoryFlash<PAGES> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        check_read(self, offset, bytes.len())?;
        if !self.power {
            return Err(MemoryError::PowerLost);
        }
        let (mut at, mut rest) = (offset as usize, bytes);
        while !rest.is_empty() {
            let Some(page) = self.pages.get(at / PAGE_BYTES) else {
                return Err(MemoryError::OutOfBounds);
            };
            let within = at % PAGE_BYTES;
            if is_bit_set(&page.unreadable, within / DOUBLE_WORD_BYTES) {
                return Err(MemoryError::Unreadable);
            }
            // To the end of the page, or of the double word if another one is torn.
            let is_readable = page.unreadable.iter().all(|bits| *bits == 0);
            let unit = if is_readable { PAGE_BYTES } else { DOUBLE_WORD_BYTES };
            let length = (unit - within % unit).min(rest.len());
            let (part, left) = rest.split_at_mut(length);
            let found = page.bytes.get(within..within + length);
            part.copy_from_slice(found.ok_or(MemoryError::OutOfBounds)?);
            (at, rest) = (at + length, left);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        PAGES * PAGE_BYTES
    }
}

impl<const PAGES: usize> NorFlash for MemoryFlash<PAGES> {
    const WRITE_SIZE: usize = DOUBLE_WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        check_erase(self, from, to)?;
        for number in from as usize / PAGE_BYTES..to as usize / PAGE_BYTES {
            if !self.power {
                return Err(MemoryError::PowerLost);
            }
            let torn = self.step();
            let Some(page) = self.pages.get_mut(number) else { break };
            page.erases = page.erases.saturating_add(1);
            let blank = core::iter::repeat(0xFF);
            tear(page.bytes.iter_mut(), blank, torn.unwrap_or(TornStep::Done));
            let unfinished = !matches!(torn, None | Some(TornStep::Done | TornStep::Nothing));
            if torn != Some(TornStep::Nothing) {
                // A half-erased page must be erased again before it is programmed.
                page.programmed = [if unfinished { !0 } else { 0 }; WORDS_PER_PAGE / 32];
                let unreadable = matches!(torn, Some(TornStep::Unreadable(_)));
                page.unreadable = [if unreadable { !0 } else { 0 }; WORDS_PER_PAGE / 32];
            }
            if torn.is_some() {
                return Err(MemoryError::PowerLost);
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        check_write(self, offset, bytes.len())?;
        for (at, unit) in
            (offset as usize..).step_by(DOUBLE_WORD_BYTES).zip(bytes.chunks(DOUBLE_WORD_BYTES))
        {
            if !self.power {
                return Err(MemoryError::PowerLost);
            }
            let word = at % PAGE_BYTES / DOUBLE_WORD_BYTES;
            if self
                .pages
                .get(at / PAGE_BYTES)
                .is_some_and(|page| is_bit_set(&page.programmed, word))
            {
                return Err(MemoryError::ProgrammedTwice);
            }
            let torn = self.step();
            let Some(page) = self.pages.get_mut(at / PAGE_BYTES) else { break };
            let Some(place) =
                page.bytes.get_mut(at % PAGE_BYTES..at % PAGE_BYTES + DOUBLE_WORD_BYTES)
            else {
                break;
            };
            // Programming changes bits to 0 only.
            let mut wanted = [0; DOUBLE_WORD_BYTES];
            for ((wanted, old), new) in wanted.iter_mut().zip(&*place).zip(unit) {
                *wanted = old & new;
            }
            tear(place.iter_mut(), wanted.into_iter(), torn.unwrap_or(TornStep::Done));
            if torn != Some(TornStep::Nothing) {
                set_bit(&mut page.programmed, word);
            }
            if matches!(torn, Some(TornStep::Unreadable(_))) {
                set_bit(&mut page.unreadable, word);
            }
            if torn.is_some() {
                return Err(MemoryError::PowerLost);
            }
        }
        Ok(())
    }
}
