//! The parameter store: it keeps one set of bytes in flash and survives a power cut at any time.
//!
//! Flash is erased by the page and programmed by the double word, once after each erase. Power may fail
//! during either. The store therefore has two slots. A save writes the slot that is *not* current. The new
//! set becomes valid with its last double word, the commit ([`image`] has the layout); until then a start
//! finds the previous set. A sequence number, which may wrap around, decides which of two intact sets is
//! newer. Each double word is read back after it is written, so unreadable data is never committed. Each
//! load checks the CRC. If the newer set is damaged, the older one is used. The end of each slot has a copy of what a
//! joint keeps even then ([`Identity`]). Between set and copy lie the trend of its learnt levels ([`TrendEntry`]) and
//! the home of a joint at rest ([`HomeRecord`]).
//!
//! Opening only reads. Random bytes, a half-erased page or an unreadable word make a slot
//! [`SlotState::Damaged`] and have no other effect. (On the STM32G4 a torn double word raises an ECC
//! interrupt, which its flash driver returns as a read error.) One case cannot be detected: a power cut at
//! the very end of the commit may leave a cell between 0 and 1. That commit may be valid at one start and
//! invalid at the next, but an intact set is loaded either way.

mod home_record;
mod identity;
pub mod image;
pub mod memory;
mod mirror;
mod outcome;
mod trend;

pub use home_record::{FoundHome, HOME_RECORD_BYTES, HOME_RECORDS, HomeRecord};
pub use identity::{FoundIdentity, IDENTITY_BYTES, Identity, IdentityCopy};
pub use mirror::StartFinds;
pub use outcome::{
    LoadError, LoadedSet, SaveOutcome, SavePlace, SlotState, StoreError, StoreHealth,
};
pub use trend::{ENTRY_BYTES, LastEntry, TIME_UNIT_S, TrendEntry};

use core::ops::Range;
use embedded_storage::nor_flash::{NorFlash, NorFlashError};
use identity::COPY_BYTES;
use image::{COMMIT_AT, Commit, PAYLOAD_AT, SlotHeader, UNIT_BYTES};

/// Maximum payload, bytes.
pub const MAX_PAYLOAD: usize = 3072;

/// A parameter store in the given flash.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    slots: [Range<u32>; 2],
    states: [SlotState; 2],
}

impl<F: NorFlash> Store<F> {
    /// Checks that the flash can read and program double words, of which the layout consists.
    const IS_FLASH_SUITABLE: () = assert!(
        UNIT_BYTES.is_multiple_of(F::WRITE_SIZE)
            && UNIT_BYTES.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(UNIT_BYTES),
        "the store programs double words of 8 bytes"
    );

    /// Opens a store in the two halves of the flash, each rounded down to whole pages. It only reads and
    /// accepts any content. In a flash of less than two pages nothing is found and nothing can be saved.
    pub fn open(flash: F) -> Self {
        let pages = flash.capacity() / F::ERASE_SIZE / 2;
        let half = u32::try_from(pages * F::ERASE_SIZE).unwrap_or(0);
        Self::open_within(flash, [0..half, half..half.saturating_mul(2)])
    }

    /// Opens a store in two given slots, each of one or more whole pages. It only reads.
    ///
    /// # Errors
    /// Returns [`StoreError::Slots`] if the slots are empty, overlap, are not whole pages or exceed the
    /// flash.
    pub fn open_at(flash: F, slots: [Range<u32>; 2]) -> Result<Self, StoreError> {
        let is_valid = |slot: &Range<u32>| {
            let page = F::ERASE_SIZE as u64;
            let (start, end) = (u64::from(slot.start), u64::from(slot.end));
            start < end && start % page == 0 && end % page == 0 && end <= flash.capacity() as u64
        };
        let [first, second] = &slots;
        let are_disjoint = first.end <= second.start || second.end <= first.start;
        if !(is_valid(first) && is_valid(second) && are_disjoint) {
            return Err(StoreError::Slots);
        }
        Ok(Self::open_within(flash, slots))
    }

    /// Opens a store in two slots that are known to be legal. It only reads.
    pub fn open_within(flash: F, slots: [Range<u32>; 2]) -> Self {
        let () = Self::IS_FLASH_SUITABLE;
        let mut store = Self { flash, slots, states: [SlotState::Blank; 2] };
        store.inspect();
        store
    }

    /// Closes the store and returns the flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Returns the flash.
    pub fn flash(&self) -> &F {
        &self.flash
    }

    /// Returns the flash for what lies beside the store.
    pub(crate) const fn flash_mut(&mut self) -> &mut F {
        &mut self.flash
    }

    /// Returns the maximum length of a payload, bytes; never more than [`MAX_PAYLOAD`].
    pub fn max_payload_bytes(&self) -> usize {
        let [first, second] = &self.slots;
        let slot = first.len().min(second.len());
        slot.saturating_sub(PAYLOAD_AT as usize + COPY_BYTES).min(MAX_PAYLOAD)
    }

    /// Returns the states of the two slots as of the last open, load or save.
    pub fn slots(&self) -> [SlotState; 2] {
        self.states
    }

    /// Returns the state of the whole store.
    pub fn health(&self) -> StoreHealth {
        let damaged = self.states.contains(&SlotState::Damaged);
        if self.current().is_some() {
            return if damaged { StoreHealth::Reduced } else { StoreHealth::Sound };
        }
        if self.states.iter().any(|state| matches!(state, SlotState::Foreign { .. })) {
            return StoreHealth::Foreign;
        }
        if damaged { StoreHealth::Damaged } else { StoreHealth::Empty }
    }

    /// Inspects both slots and copies the set before the newest into `into`. The two were saved one after the other.
    ///
    /// # Errors
    /// Returns why nothing was loaded; [`LoadError::Empty`] also if the other set was not saved right before the newest.
    /// `into` may then hold undefined bytes.
    pub fn load_former(&mut self, into: &mut [u8]) -> Result<LoadedSet, LoadError> {
        self.inspect();
        let Some(newest) = self.current() else { return Err(self.why_nothing_is_loaded()) };
        match self.set_in(1 - newest.slot) {
            Some(former) if newest.sequence == former.sequence.wrapping_add(1) => {
                if self.copy_set(former, into)? { Ok(former) } else { Err(LoadError::Damaged) }
            }
            _ => Err(self.why_nothing_is_loaded()),
        }
    }

    /// Inspects both slots, and returns the sequence number of the newest set that this firmware can read.
    pub fn newest_sequence(&mut self) -> Option<u32> {
        self.inspect();
        self.current().map(|set| set.sequence)
    }

    /// Inspects both slots and copies the newest intact set into `into`. If reading fails during the copy,
    /// the other set is used.
    ///
    /// # Errors
    /// Returns why nothing was loaded. `into` may then hold undefined bytes.
    pub fn load(&mut self, into: &mut [u8]) -> Result<LoadedSet, LoadError> {
        self.inspect();
        while let Some(set) = self.current() {
            if self.copy_set(set, into)? {
                return Ok(set);
            }
        }
        Err(self.why_nothing_is_loaded())
    }

    /// Copies a set that was found into `into`. Returns false if the slot reads differently now: it is damaged.
    fn copy_set(&mut self, set: LoadedSet, into: &mut [u8]) -> Result<bool, LoadError> {
        let LoadedSet { length, slot, sequence } = set;
        let given = into.len();
        let Some(place) = into.get_mut(..length) else {
            return Err(LoadError::TooSmall { needed: length, given });
        };
        let found = self.scan(slot, Payload::Copied(place));
        let is_same = found == (SlotState::Whole { sequence, length });
        if !is_same {
            self.set_state(slot, SlotState::Damaged);
        }
        Ok(is_same)
    }

    /// Returns the reason for which no set is found, from the states of the slots.
    fn why_nothing_is_loaded(&self) -> LoadError {
        for state in self.states {
            if let SlotState::Foreign { version, .. } = state {
                return LoadError::Foreign(version);
            }
        }
        let damaged = self.states.contains(&SlotState::Damaged);
        if damaged { LoadError::Damaged } else { LoadError::Empty }
    }

    /// Saves a set. It needs one erase and one program operation per 8 bytes. The processor waits for its
    /// flash meanwhile, so do not call it while the bridge is on.
    ///
    /// A set that is already current is not written again, unless the other slot is damaged or has not this identity: then
    /// the save makes a second intact copy. `identity` is what the joint keeps if its sets are lost.
    ///
    /// # Errors
    /// Returns what failed. The set that was current stays current, unless only the copies of the identity
    /// failed, which are written after the commit.
    pub fn save(&mut self, payload: &[u8], identity: &Identity) -> Result<SaveOutcome, StoreError> {
        self.save_at(SavePlace::Former, payload, identity)
    }

    /// Saves a set as [`Self::save`] does, in this place. In that of the newest set, the newest is erased first; the former
    /// stays intact until the new set is committed, and then too unless the identity changes.
    ///
    /// # Errors
    /// As [`Self::save`]. If the place is that of the newest set, the former may be the current one afterwards.
    pub fn save_at(
        &mut self,
        place: SavePlace,
        payload: &[u8],
        identity: &Identity,
    ) -> Result<SaveOutcome, StoreError> {
        let max = self.max_payload_bytes();
        if payload.len() > max || max == 0 {
            return Err(StoreError::TooLong { length: payload.len(), max });
        }
        self.inspect();
        if let Some(LoadedSet { slot, sequence, .. }) = self.current()
            && !self.states.contains(&SlotState::Damaged)
            && self.slots.get(slot).cloned().and_then(|slot| self.copy(&slot))
                == Some(IdentityCopy { sequence, identity: *identity })
            && self.keeps_identity(1 - slot, identity)
            && self.holds_exactly(slot, payload)
        {
            return Ok(SaveOutcome::Unchanged);
        }
        // The set to keep: the current one, or else the newest with an unknown layout.
        let kept = self.newest(SlotState::is_whole).or_else(|| self.newest(|_| true));
        let (slot, sequence) = match kept {
            Some(kept) => {
                let slot = if place == SavePlace::Newest { kept.slot } else { 1 - kept.slot };
                (slot, kept.sequence.wrapping_add(1))
            }
            // No set to keep: an undamaged slot is preferred.
            None => (usize::from(self.states[0] == SlotState::Damaged), 1),
        };
        self.write_both(slot, sequence, payload, identity)
    }

    fn write_checked(
        &mut self,
        slot: usize,
        sequence: u32,
        payload: &[u8],
        identity: &Identity,
    ) -> Result<SaveOutcome, StoreError> {
        let written = self.write(slot, sequence, payload, identity);
        let state = self.scan(slot, Payload::Ignored);
        self.set_state(slot, state);
        written?;
        let start = self.slots.get(slot).map_or(0, |slot| slot.start);
        if state != (SlotState::Whole { sequence, length: payload.len() }) {
            return Err(StoreError::NotVerified(start + COMMIT_AT));
        }
        Ok(SaveOutcome::Written { slot, sequence })
    }

    /// Erases a slot and writes a set into it. The commit is written after the set, and the copy of the identity last.
    fn write(
        &mut self,
        slot: usize,
        sequence: u32,
        payload: &[u8],
        identity: &Identity,
    ) -> Result<(), StoreError> {
        let Some(Range { start, end }) = self.slots.get(slot).cloned() else {
            return Err(StoreError::Slots);
        };
        // Erase even if the slot reads blank: an interrupted erase may read as blank and not last.
        self.flash.erase(start, end).map_err(flash_error)?;
        for at in (start..end).step_by(UNIT_BYTES) {
            if self.unit(at) != Some(image::ERASED) {
                return Err(StoreError::NotErased(at));
            }
        }
        let head =
            SlotHeader { version: image::VERSION, length: payload.len() as u16, sequence }.emit();
        let mut commit = Commit::begin();
        for (at, unit) in image::units(&head, payload) {
            commit.update(&unit);
            self.program(start + at, &unit)?;
        }
        self.program(start + COMMIT_AT, &commit.emit())?;
        self.write_copy(&(start..end), sequence, identity)
    }

    fn program(&mut self, at: u32, unit: &[u8; UNIT_BYTES]) -> Result<(), StoreError> {
        self.flash.write(at, unit).map_err(flash_error)?;
        if self.unit(at) == Some(*unit) { Ok(()) } else { Err(StoreError::NotVerified(at)) }
    }

    /// Reads one double word; `None` if the flash cannot read it.
    #[inline(never)]
    fn unit(&mut self, at: u32) -> Option<[u8; UNIT_BYTES]> {
        let mut unit = [0; UNIT_BYTES];
        self.flash.read(at, &mut unit).ok().map(|()| unit)
    }

    fn inspect(&mut self) {
        self.states = [0, 1].map(|slot| self.scan(slot, Payload::Ignored));
    }

    fn set_state(&mut self, slot: usize, state: SlotState) {
        if let Some(place) = self.states.get_mut(slot) {
            *place = state;
        }
    }

    /// Reads a whole slot and returns its state.
    // Neither generic nor inlined: its several callers would each add 500 bytes to an image.
    #[inline(never)]
    fn scan(&mut self, slot: usize, mut payload: Payload<'_>) -> SlotState {
        let Some(Range { start, end }) = self.slots.get(slot).cloned() else {
            return SlotState::Damaged;
        };
        if start == end {
            return SlotState::Blank;
        }
        let Some(committed) = self.unit(start + COMMIT_AT) else { return SlotState::Damaged };
        if committed == image::ERASED {
            let blank =
                (start..end).step_by(UNIT_BYTES).all(|at| self.unit(at) == Some(image::ERASED));
            return if blank { SlotState::Blank } else { SlotState::Incomplete };
        }
        let (Some(first), Some(second)) = (self.unit(start), self.unit(start + UNIT_BYTES as u32))
        else {
            return SlotState::Damaged;
        };
        let Some(head) = SlotHeader::parse(&first, &second) else { return SlotState::Damaged };
        let length = usize::from(head.length);
        if length > (end - start - PAYLOAD_AT) as usize {
            return SlotState::Damaged;
        }
        let mut commit = Commit::begin();
        commit.update(&first);
        commit.update(&second);
        let mut left = length;
        let mut at = start + PAYLOAD_AT;
        while left > 0 {
            let Some(unit) = self.unit(at) else { return SlotState::Damaged };
            commit.update(&unit);
            payload.take(unit.get(..left).unwrap_or(&unit));
            left = left.saturating_sub(UNIT_BYTES);
            at += UNIT_BYTES as u32;
        }
        if commit.emit() != committed {
            return SlotState::Damaged;
        }
        let SlotHeader { version, sequence, .. } = head;
        if version != image::VERSION || length > MAX_PAYLOAD {
            return SlotState::Foreign { version, sequence };
        }
        SlotState::Whole { sequence, length }
    }

    /// Returns true if the slot holds exactly these bytes, intact.
    fn holds_exactly(&mut self, slot: usize, payload: &[u8]) -> bool {
        let mut is_same = true;
        let state = self.scan(slot, Payload::Compared(payload, &mut is_same));
        matches!(state, SlotState::Whole { length, .. } if length == payload.len()) && is_same
    }

    /// Returns the newest set that this firmware can read.
    fn current(&self) -> Option<LoadedSet> {
        self.set_in(self.newest(SlotState::is_whole)?.slot)
    }

    /// Returns the set in a slot, if this firmware can read it.
    fn set_in(&self, slot: usize) -> Option<LoadedSet> {
        match *self.states.get(slot)? {
            SlotState::Whole { sequence, length } => Some(LoadedSet { length, slot, sequence }),
            _ => None,
        }
    }

    /// Returns the newest of the sets whose state is wanted.
    fn newest(&self, is_wanted: fn(&SlotState) -> bool) -> Option<NumberedSlot> {
        let number = |slot: usize| {
            let state = self.states.get(slot).filter(|state| is_wanted(state))?;
            Some(NumberedSlot { slot, sequence: state.sequence()? })
        };
        match (number(0), number(1)) {
            (Some(first), Some(second)) if is_newer(second.sequence, first.sequence) => {
                Some(second)
            }
            (first, second) => first.or(second),
        }
    }
}

/// A slot with a set, and the number of the set.
#[derive(Clone, Copy)]
struct NumberedSlot {
    slot: usize,
    sequence: u32,
}

/// Use of the payload of a slot while the slot is read.
enum Payload<'a> {
    /// None: only the state of the slot is needed.
    Ignored,
    /// Copied to a place.
    Copied(&'a mut [u8]),
    /// Compared with bytes; the flag is cleared if a byte differs.
    Compared(&'a [u8], &'a mut bool),
}

impl Payload<'_> {
    /// Takes the next bytes.
    fn take(&mut self, bytes: &[u8]) {
        match self {
            Self::Ignored => {}
            Self::Copied(place) => {
                for (place, byte) in place.iter_mut().zip(bytes) {
                    *place = *byte;
                }
                *place = core::mem::take(place).get_mut(bytes.len()..).unwrap_or_default();
            }
            Self::Compared(expected, is_same) => {
                **is_same &= expected.starts_with(bytes);
                *expected = expected.get(bytes.len()..).unwrap_or_default();
            }
        }
    }
}

/// Returns true if sequence number `a` is newer than `b`: less than half the range of `u32` ahead, modulo
/// wrapping.
pub(crate) const fn is_newer(a: u32, b: u32) -> bool {
    let ahead = a.wrapping_sub(b);
    ahead > 0 && ahead < 1 << 31
}

fn flash_error(error: impl NorFlashError) -> StoreError {
    StoreError::Flash(error.kind())
}
