//! Copies of what a joint must not lose with its set: its address, and who may write to it.
//!
//! A copy lies at the end of each slot, on another page than the begin of the set, and has a check of its own. It is written
//! after the commit, so it never belongs to a set that was not saved. A save whose identity differs from the copy in the
//! other slot writes that slot too. Both slots thus have the present identity, and no older set has another one.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `JKEY` |
//! | 4 | 4 | sequence number of the set |
//! | 8 | 36 | identity |
//! | 44 | 4 | CRC-32 (ISO-HDLC) of everything else |

use super::image::{COMMIT_AT, ERASED, UNIT_BYTES, crc};
use super::{SaveOutcome, SlotState, Store, StoreError, is_newer};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Length of an identity, bytes.
pub const IDENTITY_BYTES: usize = 36;
/// What a joint must not lose with its set. The store does not interpret it.
pub type Identity = [u8; IDENTITY_BYTES];

/// Length of a copy, bytes.
pub(super) const COPY_BYTES: usize = 48;
const MAGIC: [u8; 4] = *b"JKEY";

/// What is known of the identity of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoundIdentity {
    /// No set was ever saved completely.
    None,
    /// Sets were saved, and no copy is intact.
    Lost,
    /// The newest copy.
    Copy(IdentityCopy),
}

/// A copy of an identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentityCopy {
    /// Sequence number of the set with which it was saved.
    pub sequence: u32,
    /// The identity.
    pub identity: Identity,
}

impl<F: NorFlash> Store<F> {
    /// Returns the newest copy in this store, and in two slots of another bank. It reads no sets: a start has little time.
    #[inline(never)]
    pub fn find_identity(&mut self, other_bank: Option<[Range<u32>; 2]>) -> FoundIdentity {
        let mut found = FoundIdentity::None;
        for slots in [Some(self.slots.clone()), other_bank].into_iter().flatten() {
            for slot in &slots {
                let Some(copy) = self.copy(slot) else { continue };
                if !matches!(found, FoundIdentity::Copy(last) if !is_newer(copy.sequence, last.sequence))
                {
                    found = FoundIdentity::Copy(copy);
                }
            }
            // A first save writes one slot after the other: it was cut if one is blank.
            if found == FoundIdentity::None && slots.iter().all(|slot| self.is_written(slot)) {
                found = FoundIdentity::Lost;
            }
        }
        found
    }

    /// Returns true if a slot has a header or a commit, intact or not.
    fn is_written(&mut self, slot: &Range<u32>) -> bool {
        let places = [slot.start, slot.start + COMMIT_AT];
        copy_place(slot).is_some() && places.into_iter().any(|at| self.unit(at) != Some(ERASED))
    }

    /// Writes a set into a slot, and into the other one unless it has this identity. The trend follows it.
    pub(super) fn write_both(
        &mut self,
        slot: usize,
        sequence: u32,
        payload: &[u8],
        identity: &Identity,
    ) -> Result<SaveOutcome, StoreError> {
        let other = 1 - slot;
        // The other slot has the whole trend before this one is erased.
        self.merge_trend(slot, other);
        let written = self.write_checked(slot, sequence, payload, identity)?;
        self.merge_trend(other, slot);
        if !self.keeps_identity(other, identity) {
            self.write_checked(other, sequence, payload, identity)?;
            self.merge_trend(slot, other);
        }
        Ok(written)
    }

    /// Returns true if a slot has this identity, or a set of another layout, which is not replaced for an identity.
    pub(super) fn keeps_identity(&mut self, slot: usize, identity: &Identity) -> bool {
        let place = self.slots.get(slot).cloned().unwrap_or_default();
        matches!(self.states.get(slot), Some(SlotState::Foreign { .. }))
            || self.copy(&place).is_some_and(|copy| copy.identity == *identity)
    }

    /// Returns the copy in a slot; `None` if it is not intact.
    pub(super) fn copy(&mut self, slot: &Range<u32>) -> Option<IdentityCopy> {
        let at = copy_place(slot)?;
        let mut bytes = [0; COPY_BYTES];
        self.flash.read(at, &mut bytes).ok()?;
        let (head, rest) = bytes.split_first_chunk::<8>()?;
        let (identity, check) = rest.split_first_chunk::<IDENTITY_BYTES>()?;
        let [m0, m1, m2, m3, s0, s1, s2, s3] = *head;
        let sequence = u32::from_le_bytes([s0, s1, s2, s3]);
        let is_intact = [m0, m1, m2, m3] == MAGIC && emit(sequence, identity).ends_with(check);
        is_intact.then_some(IdentityCopy { sequence, identity: *identity })
    }

    /// Writes the copy in a slot, whose place must be erased.
    pub(super) fn write_copy(
        &mut self,
        slot: &Range<u32>,
        sequence: u32,
        identity: &Identity,
    ) -> Result<(), StoreError> {
        let place = copy_place(slot).ok_or(StoreError::Slots)?;
        let bytes = emit(sequence, identity);
        for (at, unit) in (place..).step_by(UNIT_BYTES).zip(bytes.as_chunks().0) {
            self.program(at, unit)?;
        }
        Ok(())
    }
}

#[inline(never)]
pub(super) fn copy_place(slot: &Range<u32>) -> Option<u32> {
    slot.end.checked_sub(COPY_BYTES as u32).filter(|at| *at >= slot.start)
}

fn emit(sequence: u32, identity: &Identity) -> [u8; COPY_BYTES] {
    let mut bytes = [0; COPY_BYTES];
    let content = MAGIC.into_iter().chain(sequence.to_le_bytes()).chain(*identity);
    bytes.iter_mut().zip(content).for_each(|(to, from)| *to = from);
    let (content, check) = bytes.split_at_mut(COPY_BYTES - 4);
    check.copy_from_slice(&crc(content).to_le_bytes());
    bytes
}
