//! Flash in RAM, with the rules of the STM32G474's and a power switch.
//!
//! For the driver that runs on a PC, for the emulated board, and for the tests: what breaks the rules
//! of the chip is refused here too. A page of 2048 bytes is erased as a whole; a double word of 8 bytes
//! is programmed once after that, also if only with ones; programming only takes bits from 1 to 0.
//!
//! Each double word programmed and each page erased is a *step*. [`MemoryFlash::cut`] takes the power
//! away at a step to come, and [`Torn`] says what the step leaves behind. Then everything fails until
//! [`MemoryFlash::power_on`]. [`MemoryFlash::flip`] rots a bit. With none of that called it is a flash
//! that works.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Bytes of a page.
pub const PAGE: usize = 2048;

/// Bytes of a double word.
pub const DOUBLE_WORD: usize = 8;

const WORDS: usize = PAGE / DOUBLE_WORD;

/// Why the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryError {
    /// Not on the boundary of a double word, or of a page for an erase.
    NotAligned,
    /// Beyond the end.
    OutOfBounds,
    /// The double word was programmed before and not erased since.
    ProgrammedTwice,
    /// The double word was torn so that its check bits no longer fit.
    Unreadable,
    /// There is no power.
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

/// What the step that the power went in leaves behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torn {
    /// Nothing was changed.
    Nothing,
    /// Its first half is done.
    FirstHalf,
    /// Its second half is done.
    LastHalf,
    /// Each bit that was to change did so or not, by chance from this seed.
    Partly(u32),
    /// Every bit is chance, from this seed.
    Garbage(u32),
    /// As [`Torn::Partly`], and the double words it touched cannot be read.
    Unreadable(u32),
    /// It was done, and nobody was told.
    Done,
}

#[derive(Clone, Debug)]
struct Page {
    bytes: [u8; PAGE],
    /// Double words programmed since the last erase, a bit each.
    programmed: [u32; WORDS / 32],
    unreadable: [u32; WORDS / 32],
    erases: u32,
}

impl Page {
    const NEW: Self = Self {
        bytes: [0xFF; PAGE],
        programmed: [0; WORDS / 32],
        unreadable: [0; WORDS / 32],
        erases: 0,
    };
}

fn bit(words: &[u32; WORDS / 32], word: usize) -> bool {
    words.get(word / 32).is_some_and(|bits| bits & (1 << (word % 32)) != 0)
}

fn set_bit(words: &mut [u32; WORDS / 32], word: usize) {
    if let Some(bits) = words.get_mut(word / 32) {
        *bits |= 1 << (word % 32);
    }
}

/// Flash of this many pages.
#[derive(Clone, Debug)]
pub struct MemoryFlash<const PAGES: usize> {
    pages: [Page; PAGES],
    steps: u32,
    cut: Option<(u32, Torn)>,
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
        Self { pages: [Page::NEW; PAGES], steps: 0, cut: None, power: true }
    }

    /// Takes over what a file held: `image` from offset 0. Double words that are not all ones count as
    /// programmed. What goes beyond the flash is left out.
    pub fn restore(&mut self, image: &[u8]) {
        for (page, bytes) in self.pages.iter_mut().zip(image.chunks(PAGE)) {
            *page = Page { erases: page.erases, ..Page::NEW };
            for (word, (place, unit)) in
                page.bytes.chunks_mut(DOUBLE_WORD).zip(bytes.chunks(DOUBLE_WORD)).enumerate()
            {
                place.iter_mut().zip(unit).for_each(|(to, from)| *to = *from);
                if unit.iter().any(|byte| *byte != 0xFF) {
                    set_bit(&mut page.programmed, word);
                }
            }
        }
    }

    /// The bytes, page by page, to put into a file.
    pub fn image(&self) -> impl Iterator<Item = &[u8; PAGE]> {
        self.pages.iter().map(|page| &page.bytes)
    }

    /// Steps done so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// How often a page was erased.
    pub fn erases(&self, page: usize) -> u32 {
        self.pages.get(page).map_or(0, |page| page.erases)
    }

    /// Takes the power away in a step to come, 0 for the next.
    pub fn cut(&mut self, step: u32, torn: Torn) {
        self.cut = Some((self.steps.saturating_add(step), torn));
    }

    /// Whether there is power.
    pub fn has_power(&self) -> bool {
        self.power
    }

    /// Gives the power back, and takes a cut back that has not come.
    pub fn power_on(&mut self) {
        self.power = true;
        self.cut = None;
    }

    /// Rots a bit, counted from the first byte's lowest.
    pub fn flip(&mut self, bit: usize) {
        let at = bit / 8;
        let page = self.pages.get_mut(at / PAGE);
        if let Some(byte) = page.and_then(|page| page.bytes.get_mut(at % PAGE)) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// Counts a step; says what becomes of it if the power goes in it.
    fn step(&mut self) -> Option<Torn> {
        let torn = self.cut.filter(|(step, _)| *step == self.steps).map(|(_, torn)| torn);
        self.steps = self.steps.saturating_add(1);
        if torn.is_some() {
            self.power = false;
        }
        torn
    }
}

/// What is left of `place` when the change to `wanted` was torn.
fn tear<'a>(
    place: impl ExactSizeIterator<Item = &'a mut u8>,
    wanted: impl Iterator<Item = u8>,
    torn: Torn,
) {
    let half = place.len() / 2;
    let mut chance = Chance::of(torn);
    for (index, (byte, wanted)) in place.zip(wanted).enumerate() {
        let changed = match torn {
            Torn::Nothing => 0,
            Torn::Done => 0xFF,
            Torn::FirstHalf => u8::from(index < half) * 0xFF,
            Torn::LastHalf => u8::from(index >= half) * 0xFF,
            Torn::Partly(_) | Torn::Unreadable(_) => chance.byte(),
            Torn::Garbage(_) => {
                *byte = chance.byte();
                continue;
            }
        };
        *byte ^= (*byte ^ wanted) & changed;
    }
}

/// Marsaglia's xorshift: chance enough to tear a page.
struct Chance(u32);

impl Chance {
    fn of(torn: Torn) -> Self {
        let (Torn::Partly(seed) | Torn::Garbage(seed) | Torn::Unreadable(seed)) = torn else {
            return Self(1);
        };
        // Its one bad state is 0; small seeds need a few rounds to spread.
        let mut chance = Self(seed.wrapping_mul(0x9E37_79B9) | 1);
        (0..8).for_each(|_| _ = chance.byte());
        chance
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
        for (at, byte) in (offset as usize..).zip(bytes) {
            let Some(page) = self.pages.get(at / PAGE) else {
                return Err(MemoryError::OutOfBounds);
            };
            if bit(&page.unreadable, at % PAGE / DOUBLE_WORD) {
                return Err(MemoryError::Unreadable);
            }
            *byte = page.bytes.get(at % PAGE).copied().unwrap_or(0);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        PAGES * PAGE
    }
}

impl<const PAGES: usize> NorFlash for MemoryFlash<PAGES> {
    const WRITE_SIZE: usize = DOUBLE_WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        check_erase(self, from, to)?;
        for number in from as usize / PAGE..to as usize / PAGE {
            if !self.power {
                return Err(MemoryError::PowerLost);
            }
            let torn = self.step();
            let Some(page) = self.pages.get_mut(number) else { break };
            page.erases = page.erases.saturating_add(1);
            let blank = core::iter::repeat(0xFF);
            tear(page.bytes.iter_mut(), blank, torn.unwrap_or(Torn::Done));
            let unfinished = !matches!(torn, None | Some(Torn::Done | Torn::Nothing));
            if torn != Some(Torn::Nothing) {
                // A page half erased is to be erased again before it is programmed.
                page.programmed = [if unfinished { !0 } else { 0 }; WORDS / 32];
                let unreadable = matches!(torn, Some(Torn::Unreadable(_)));
                page.unreadable = [if unreadable { !0 } else { 0 }; WORDS / 32];
            }
            if torn.is_some() {
                return Err(MemoryError::PowerLost);
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        check_write(self, offset, bytes.len())?;
        for (at, unit) in (offset as usize..).step_by(DOUBLE_WORD).zip(bytes.chunks(DOUBLE_WORD)) {
            if !self.power {
                return Err(MemoryError::PowerLost);
            }
            let word = at % PAGE / DOUBLE_WORD;
            if self.pages.get(at / PAGE).is_some_and(|page| bit(&page.programmed, word)) {
                return Err(MemoryError::ProgrammedTwice);
            }
            let torn = self.step();
            let Some(page) = self.pages.get_mut(at / PAGE) else { break };
            let Some(place) = page.bytes.get_mut(at % PAGE..at % PAGE + DOUBLE_WORD) else { break };
            // Programming takes bits to 0 and never back.
            let mut wanted = [0; DOUBLE_WORD];
            for ((wanted, old), new) in wanted.iter_mut().zip(&*place).zip(unit) {
                *wanted = old & new;
            }
            tear(place.iter_mut(), wanted.into_iter(), torn.unwrap_or(Torn::Done));
            if torn != Some(Torn::Nothing) {
                set_bit(&mut page.programmed, word);
            }
            if matches!(torn, Some(Torn::Unreadable(_))) {
                set_bit(&mut page.unreadable, word);
            }
            if torn.is_some() {
                return Err(MemoryError::PowerLost);
            }
        }
        Ok(())
    }
}
