//! The parameter store: one set of bytes in flash that a power cut cannot lose.
//!
//! Flash is erased by the page and programmed by the double word, each once after an erase, and power
//! may go in the middle of either. So there are two slots. A save goes to the slot that is *not*
//! current, and counts only from its last double word on, the commit ([`image`] has the layout): until
//! then the old set is what a start finds, from then on the new one. Which of two whole sets is newer
//! is told by a sequence number that may wrap round. Every double word is read back as it is written,
//! so what cannot be read is never committed. Nothing is trusted because it was written once: each
//! load checks the CRC of what it hands out, and where the newer set has rotted the older stands in.
//!
//! A start reads only. Garbage, a half-erased page or a word the flash refuses to read (on the
//! STM32G4 a torn double word raises an ECC interrupt, which its driver has to give as a read error)
//! makes that slot [`SlotState::Damaged`] and no more. What no store can see is a cell left between 0
//! and 1 by a cut, that reads one way today and the other tomorrow: a commit cut at its very end
//! may count at one start and not at the next. Either way a whole set is found.

pub mod image;
pub mod memory;

use core::fmt;
use core::ops::Range;
use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};
use image::{COMMIT_AT, Commit, Head, PAYLOAD_AT, UNIT};

/// Largest payload, bytes.
pub const MAX_PAYLOAD: usize = 3072;

/// What was found in a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotState {
    /// Erased: nothing was ever saved here.
    Blank,
    /// A save or an erase was cut before the commit: nothing here has ever counted, or no longer did.
    Incomplete,
    /// Not a whole set: rotted, torn in the commit, half erased, or foreign bytes.
    Damaged,
    /// Whole, and this firmware can read it.
    Whole {
        /// Its sequence number.
        sequence: u32,
        /// Bytes of payload.
        length: usize,
    },
    /// Whole, but of a layout this firmware does not know.
    Foreign {
        /// Version of that layout.
        version: u16,
        /// Its sequence number.
        sequence: u32,
    },
}

/// The state of the store as one word, for a fault code and an object on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// A set is there, and nothing is wrong.
    Sound,
    /// A set is there, but the other slot is damaged: after bit rot this set may be the older one,
    /// and there is no second behind it until the next save. A power cut in a save looks the same.
    Reduced,
    /// No set was ever saved.
    Empty,
    /// There is no whole set, and there may have been one.
    Damaged,
    /// There are only sets of an unknown layout.
    Foreign,
}

/// What was loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// Bytes of payload.
    pub length: usize,
    /// Slot it lies in, 0 or 1.
    pub slot: usize,
    /// Its sequence number.
    pub sequence: u32,
}

/// How a save ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// Written, read back and committed.
    Written {
        /// Slot it lies in, 0 or 1.
        slot: usize,
        /// Its sequence number.
        sequence: u32,
    },
    /// The same bytes are current already: nothing was written, to spare the flash.
    Unchanged,
}

/// Why nothing was loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// No set was ever saved.
    Empty,
    /// There is no whole set, and there may have been one.
    Damaged,
    /// The sets are of this layout, which this firmware does not know.
    Foreign(u16),
    /// The place given is too small.
    TooSmall {
        /// Bytes the set has.
        needed: usize,
        /// Bytes there is place for.
        given: usize,
    },
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("no parameter set was ever saved"),
            Self::Damaged => f.write_str("no parameter set is whole"),
            Self::Foreign(version) => {
                write!(
                    f,
                    "the parameter sets are of version {version}, expected {}",
                    image::VERSION
                )
            }
            Self::TooSmall { needed, given } => {
                write!(f, "a parameter set of {needed} bytes, and place for {given}")
            }
        }
    }
}

impl core::error::Error for LoadError {}

/// Why a save failed. The set that was current still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The payload does not fit.
    TooLong {
        /// Its bytes.
        length: usize,
        /// Bytes that fit.
        most: usize,
    },
    /// The slots overlap, are not whole pages or lie beyond the flash.
    Slots,
    /// The page at this offset did not read as erased after an erase: worn out.
    NotErased(u32),
    /// The double word at this offset did not read as it was written: worn out, or power is failing.
    NotVerified(u32),
    /// The flash refused.
    Flash(NorFlashErrorKind),
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong { length, most } => {
                write!(f, "a parameter set of {length} bytes, at most {most} fit")
            }
            Self::Slots => f.write_str("the two slots must be whole pages apart from each other"),
            Self::NotErased(at) => write!(f, "flash at {at:#x} is not blank after an erase"),
            Self::NotVerified(at) => write!(f, "flash at {at:#x} does not read as written"),
            Self::Flash(kind) => write!(f, "flash: {kind}"),
        }
    }
}

impl core::error::Error for StoreError {}

/// A parameter store over the flash handed to it.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    slots: [Range<u32>; 2],
    states: [SlotState; 2],
}

impl<F: NorFlash> Store<F> {
    /// The layout is made of double words; a flash that cannot read or program one is not for it.
    const FITS: () = assert!(
        UNIT.is_multiple_of(F::WRITE_SIZE)
            && UNIT.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(UNIT),
        "the store programs double words of 8 bytes"
    );

    /// Opens a store in the two halves of the flash, each rounded down to whole pages. Reads only, and
    /// takes whatever it finds. In a flash of less than two pages nothing is found and nothing fits.
    pub fn open(flash: F) -> Self {
        let pages = flash.capacity() / F::ERASE_SIZE / 2;
        let half = u32::try_from(pages * F::ERASE_SIZE).unwrap_or(0);
        Self::inspected(flash, [0..half, half..half.saturating_mul(2)])
    }

    /// Opens a store in two slots of one's own choice, each one or more whole pages. Reads only.
    ///
    /// # Errors
    /// [`StoreError::Slots`] if they are not pages, are empty, overlap or lie beyond the flash.
    pub fn open_at(flash: F, slots: [Range<u32>; 2]) -> Result<Self, StoreError> {
        let sound = |slot: &Range<u32>| {
            let page = F::ERASE_SIZE as u64;
            let (start, end) = (u64::from(slot.start), u64::from(slot.end));
            start < end && start % page == 0 && end % page == 0 && end <= flash.capacity() as u64
        };
        let [first, second] = &slots;
        let apart = first.end <= second.start || second.end <= first.start;
        if !(sound(first) && sound(second) && apart) {
            return Err(StoreError::Slots);
        }
        Ok(Self::inspected(flash, slots))
    }

    fn inspected(flash: F, slots: [Range<u32>; 2]) -> Self {
        let () = Self::FITS;
        let mut store = Self { flash, slots, states: [SlotState::Blank; 2] };
        store.inspect();
        store
    }

    /// Gives the flash back.
    pub fn release(self) -> F {
        self.flash
    }

    /// The flash, to look at.
    pub fn flash(&self) -> &F {
        &self.flash
    }

    /// Bytes of payload that fit, at most [`MAX_PAYLOAD`].
    pub fn most(&self) -> usize {
        let [first, second] = &self.slots;
        let slot = first.len().min(second.len());
        slot.saturating_sub(PAYLOAD_AT as usize).min(MAX_PAYLOAD)
    }

    /// What lay in the two slots when they were last looked at: by open, load or save.
    pub fn slots(&self) -> [SlotState; 2] {
        self.states
    }

    /// The same in one word.
    pub fn health(&self) -> Health {
        let damaged = self.states.contains(&SlotState::Damaged);
        if self.current().is_some() {
            return if damaged { Health::Reduced } else { Health::Sound };
        }
        if self.states.iter().any(|state| matches!(state, SlotState::Foreign { .. })) {
            return Health::Foreign;
        }
        if damaged { Health::Damaged } else { Health::Empty }
    }

    /// Looks at both slots anew and copies the newest whole set into `into`. A set that fails while
    /// it is copied gives way to the other one.
    ///
    /// # Errors
    /// Says why there is nothing to load; `into` may then hold bytes of no meaning.
    pub fn load(&mut self, into: &mut [u8]) -> Result<Loaded, LoadError> {
        self.inspect();
        while let Some((slot, sequence, length)) = self.current() {
            let given = into.len();
            let Some(place) = into.get_mut(..length) else {
                return Err(LoadError::TooSmall { needed: length, given });
            };
            let mut bytes = place.iter_mut();
            let found = self.scan(slot, |byte| {
                if let Some(place) = bytes.next() {
                    *place = byte;
                }
            });
            if found == (SlotState::Whole { sequence, length }) {
                return Ok(Loaded { length, slot, sequence });
            }
            // It read differently a moment ago; whatever it says now is not to be believed.
            self.set_state(slot, SlotState::Damaged);
        }
        for state in self.states {
            if let SlotState::Foreign { version, .. } = state {
                return Err(LoadError::Foreign(version));
            }
        }
        let damaged = self.states.contains(&SlotState::Damaged);
        Err(if damaged { LoadError::Damaged } else { LoadError::Empty })
    }

    /// Saves a set. Takes one erase and a program for each 8 bytes, in which the processor waits for
    /// its flash: not for while a bridge is on. A set that is current already is not written again, so
    /// long as the other slot is sound; if that is damaged, the save makes it a second good copy.
    ///
    /// # Errors
    /// Says what failed; what was current before still is.
    pub fn save(&mut self, payload: &[u8]) -> Result<Saved, StoreError> {
        let most = self.most();
        if payload.len() > most || most == 0 {
            return Err(StoreError::TooLong { length: payload.len(), most });
        }
        self.inspect();
        let current = self.current();
        if let Some((slot, ..)) = current
            && !self.states.contains(&SlotState::Damaged)
            && self.holds(slot, payload)
        {
            return Ok(Saved::Unchanged);
        }
        // What must stand: the current set, else the newest of a layout unknown.
        let kept = current.map(|(slot, sequence, _)| (slot, sequence)).or_else(|| self.newest());
        let (slot, sequence) = match kept {
            Some((slot, sequence)) => (1 - slot, sequence.wrapping_add(1)),
            // Nothing stands: a slot that is not damaged is the better place.
            None => (usize::from(self.states[0] == SlotState::Damaged), 1),
        };
        let written = self.write(slot, sequence, payload);
        let state = self.scan(slot, |_| ());
        self.set_state(slot, state);
        written?;
        let start = self.slots.get(slot).map_or(0, |slot| slot.start);
        if state != (SlotState::Whole { sequence, length: payload.len() }) {
            return Err(StoreError::NotVerified(start + COMMIT_AT));
        }
        Ok(Saved::Written { slot, sequence })
    }

    /// Erases a slot and writes a set into it, the commit last.
    fn write(&mut self, slot: usize, sequence: u32, payload: &[u8]) -> Result<(), StoreError> {
        let Some(Range { start, end }) = self.slots.get(slot).cloned() else {
            return Err(StoreError::Slots);
        };
        // Always, also where it reads blank: an erase that was cut may read so and not last.
        self.flash.erase(start, end).map_err(refused)?;
        for at in (start..end).step_by(UNIT) {
            if self.unit(at) != Some(image::ERASED) {
                return Err(StoreError::NotErased(at));
            }
        }
        let head = Head { version: image::VERSION, length: payload.len() as u16, sequence }.emit();
        let mut commit = Commit::begin();
        for (at, unit) in image::units(&head, payload) {
            commit.take(&unit);
            self.program(start + at, &unit)?;
        }
        self.program(start + COMMIT_AT, &commit.emit())
    }

    fn program(&mut self, at: u32, unit: &[u8; UNIT]) -> Result<(), StoreError> {
        self.flash.write(at, unit).map_err(refused)?;
        if self.unit(at) == Some(*unit) { Ok(()) } else { Err(StoreError::NotVerified(at)) }
    }

    /// One double word, or `None` where the flash cannot read it.
    fn unit(&mut self, at: u32) -> Option<[u8; UNIT]> {
        let mut unit = [0; UNIT];
        self.flash.read(at, &mut unit).ok().map(|()| unit)
    }

    fn inspect(&mut self) {
        self.states = [self.scan(0, |_| ()), self.scan(1, |_| ())];
    }

    fn set_state(&mut self, slot: usize, state: SlotState) {
        if let Some(place) = self.states.get_mut(slot) {
            *place = state;
        }
    }

    /// Reads a slot through and says what it is; `sink` is given the payload byte by byte.
    fn scan(&mut self, slot: usize, mut sink: impl FnMut(u8)) -> SlotState {
        let Some(Range { start, end }) = self.slots.get(slot).cloned() else {
            return SlotState::Damaged;
        };
        if start == end {
            return SlotState::Blank;
        }
        let Some(committed) = self.unit(start + COMMIT_AT) else { return SlotState::Damaged };
        if committed == image::ERASED {
            let blank = (start..end).step_by(UNIT).all(|at| self.unit(at) == Some(image::ERASED));
            return if blank { SlotState::Blank } else { SlotState::Incomplete };
        }
        let (Some(first), Some(second)) = (self.unit(start), self.unit(start + UNIT as u32)) else {
            return SlotState::Damaged;
        };
        let Some(head) = Head::parse(&first, &second) else { return SlotState::Damaged };
        let length = usize::from(head.length);
        if length > (end - start - PAYLOAD_AT) as usize {
            return SlotState::Damaged;
        }
        let mut commit = Commit::begin();
        commit.take(&first);
        commit.take(&second);
        let mut left = length;
        let mut at = start + PAYLOAD_AT;
        while left > 0 {
            let Some(unit) = self.unit(at) else { return SlotState::Damaged };
            commit.take(&unit);
            unit.iter().take(left).for_each(|byte| sink(*byte));
            left = left.saturating_sub(UNIT);
            at += UNIT as u32;
        }
        if commit.emit() != committed {
            return SlotState::Damaged;
        }
        let Head { version, sequence, .. } = head;
        if version != image::VERSION || length > MAX_PAYLOAD {
            return SlotState::Foreign { version, sequence };
        }
        SlotState::Whole { sequence, length }
    }

    /// Whether the slot holds these bytes, whole.
    fn holds(&mut self, slot: usize, payload: &[u8]) -> bool {
        let mut expected = payload.iter();
        let mut same = true;
        let state = self.scan(slot, |byte| same &= expected.next() == Some(&byte));
        matches!(state, SlotState::Whole { .. }) && same && expected.next().is_none()
    }

    /// Slot, sequence and length of the newest set this firmware can read.
    fn current(&self) -> Option<(usize, u32, usize)> {
        let whole = |slot: usize| match self.states.get(slot) {
            Some(SlotState::Whole { sequence, length }) => Some((slot, *sequence, *length)),
            _ => None,
        };
        match (whole(0), whole(1)) {
            (Some(first), Some(second)) if newer(second.1, first.1) => Some(second),
            (first, second) => first.or(second),
        }
    }

    /// Slot and sequence of the newest set of any layout.
    fn newest(&self) -> Option<(usize, u32)> {
        let whole = |slot: usize| match self.states.get(slot) {
            Some(SlotState::Whole { sequence, .. } | SlotState::Foreign { sequence, .. }) => {
                Some((slot, *sequence))
            }
            _ => None,
        };
        match (whole(0), whole(1)) {
            (Some(first), Some(second)) if newer(second.1, first.1) => Some(second),
            (first, second) => first.or(second),
        }
    }
}

/// Whether sequence `a` comes after `b`, on the circle of `u32`: less than half way round ahead.
fn newer(a: u32, b: u32) -> bool {
    (1..1 << 31).contains(&a.wrapping_sub(b))
}

fn refused(error: impl NorFlashError) -> StoreError {
    StoreError::Flash(error.kind())
}
