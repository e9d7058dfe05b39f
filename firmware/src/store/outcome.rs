//! What is found in the store, and what a load or a save of it gives.

use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;
use embedded_storage::nor_flash::NorFlashErrorKind;

/// State of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotState {
    /// Erased: no set was ever saved here.
    Blank,
    /// A save or an erase was interrupted before the commit, so the slot holds no valid set.
    Incomplete,
    /// Not an intact set: bit errors, a torn commit, a half-erased page or foreign bytes.
    Damaged,
    /// An intact set that this firmware can read.
    Whole {
        /// Sequence number of the set.
        sequence: u32,
        /// Bytes of payload.
        length: usize,
    },
    /// An intact set with a layout that this firmware does not know.
    Foreign {
        /// Version of that layout.
        version: u16,
        /// Sequence number of the set.
        sequence: u32,
    },
}

impl SlotState {
    /// Returns true for a set that this firmware can read.
    pub(super) const fn is_whole(&self) -> bool {
        matches!(self, Self::Whole { .. })
    }

    /// Returns the sequence number of an intact set, of any layout.
    pub(super) const fn sequence(&self) -> Option<u32> {
        match self {
            Self::Whole { sequence, .. } | Self::Foreign { sequence, .. } => Some(*sequence),
            Self::Blank | Self::Incomplete | Self::Damaged => None,
        }
    }
}

/// State of the whole store, for a fault code and an object on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreHealth {
    /// A set is stored and nothing is wrong.
    Sound,
    /// A set is stored, but the other slot is damaged. After bit errors this set may be the older one.
    /// There is no second copy until the next save. A power cut during a save has the same result.
    Reduced,
    /// No set was ever saved.
    Empty,
    /// No intact set is stored, and one may have been lost.
    Damaged,
    /// Only sets with an unknown layout are stored.
    Foreign,
}

/// Description of a loaded set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadedSet {
    /// Bytes of payload.
    pub length: usize,
    /// Slot of the set, 0 or 1.
    pub slot: usize,
    /// Sequence number of the set.
    pub sequence: u32,
}

/// Set that a save replaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SavePlace {
    /// The one that is not current.
    Former,
    /// The current one.
    Newest,
}

/// Result of a successful save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveOutcome {
    /// Written, read back and committed.
    Written {
        /// Slot of the set, 0 or 1.
        slot: usize,
        /// Sequence number of the set.
        sequence: u32,
    },
    /// The same bytes are already current. Nothing was written, to spare the flash.
    Unchanged,
}

/// Reason why nothing was loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// No set was ever saved.
    Empty,
    /// No intact set is stored, and one may have been lost.
    Damaged,
    /// The stored sets have this layout version, which this firmware does not know.
    Foreign(u16),
    /// The buffer is too small.
    TooSmall {
        /// Length of the set, bytes.
        needed: usize,
        /// Length of the buffer, bytes.
        given: usize,
    },
}

/// Reason why a save failed. The set that was current stays current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The payload is too long.
    TooLong {
        /// Length of the payload, bytes.
        length: usize,
        /// Maximum length, bytes.
        max: usize,
    },
    /// The slots overlap, are not whole pages or exceed the flash.
    Slots,
    /// The page at this offset is not blank after an erase: the flash is worn out.
    NotErased(u32),
    /// The double word at this offset does not read as written: the flash is worn out or the power fails.
    NotVerified(u32),
    /// The flash reported an error.
    Flash(NorFlashErrorKind),
}

impl From<StoreError> for Reason {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::TooLong { length, max } => {
                refusal!("a parameter set of {u32} bytes, at most {u32} fit", length, max)
            }
            StoreError::Slots => refusal!("the two slots must be whole pages that do not overlap"),
            StoreError::NotErased(at) => refusal!("flash at {hex} is not blank after an erase", at),
            StoreError::NotVerified(at) => refusal!("flash at {hex} does not read as written", at),
            StoreError::Flash(kind) => match kind {
                NorFlashErrorKind::NotAligned => refusal!("flash: a write is not aligned"),
                NorFlashErrorKind::OutOfBounds => refusal!("flash: a place outside it"),
                _ => refusal!("flash: it reported an error"),
            },
        }
    }
}
