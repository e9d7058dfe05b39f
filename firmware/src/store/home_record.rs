//! Home of a joint at rest: small records that survive a power cut.
//!
//! The records lie before the copy of the identity, on the last page of each slot. A record needs no erase. It has three double
//! words: two of content, and a mark that is erased while the record is valid. The mark is programmed before the joint may
//! move. A full slot is renewed as for the trend: the current set is saved again in the other slot.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | joint position, rad, as `f32` |
//! | 4 | 4 | angle of the encoder, 2^-32 turns |
//! | 8 | 2 | number of the parameters of the shaft |
//! | 10 | 2 | number of turns of the encoder, 0 if it counts none |
//! | 12 | 4 | CRC-32 (ISO-HDLC) of everything before |
//! | 16 | 8 | erased: the joint is at rest; else it may have moved |
//!
//! Only the last written place of a slot counts, so that no older record becomes valid again. A power cut tears at most one
//! double word:
//!
//! * **Content**: The check is wrong, and the home is lost.
//! * **Mark**: A double word that is not all ones, or that cannot be read, counts as programmed. Otherwise the record is right,
//!   because the joint moves only after the mark is read back.
//! * **Save**: A new slot has no record, and that of the former slot counts. Two valid records contradict each other.
//! * **Erase**: The first page of a slot is erased first, and then the slot has no set. Its records do not count.

use super::identity::{COPY_BYTES, copy_place};
use super::image::{ERASED, PAYLOAD_AT, UNIT_BYTES, crc};
use super::{LoadedSet, MAX_PAYLOAD, SlotState, Store, StoreError};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Length of a record, bytes.
pub const HOME_RECORD_BYTES: usize = 3 * UNIT_BYTES;
/// Records of a slot. More of them leave fewer places to the trend.
pub const HOME_RECORDS: usize = 20;
const PLACES_BYTES: usize = HOME_RECORDS * HOME_RECORD_BYTES;
/// Offset of the mark in a record.
const MARK_AT: u32 = 2 * UNIT_BYTES as u32;
const MARK: [u8; UNIT_BYTES] = [0; UNIT_BYTES];

/// A joint at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomeRecord {
    /// Joint position, rad.
    pub position_rad: f32,
    /// Angle of the encoder at that position, 2^-32 turns.
    pub encoder: u32,
    /// Number of the parameters of the shaft.
    pub shaft: u16,
    /// Number of turns of the encoder, modulo 2^16; 0 if it counts none.
    pub turns: u16,
}

/// What a start finds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FoundHome {
    /// There was no record since the last erase.
    #[default]
    None,
    /// The joint may have moved since the last record.
    Lost,
    /// The joint was at rest when the power failed.
    At(HomeRecord),
}

impl HomeRecord {
    fn emit(&self) -> [[u8; UNIT_BYTES]; 2] {
        let first = join(self.position_rad.to_bits(), self.encoder);
        let numbers = u32::from(self.shaft) | u32::from(self.turns) << 16;
        [first, join(numbers, check(first, numbers))]
    }

    fn parse(first: [u8; UNIT_BYTES], second: [u8; UNIT_BYTES]) -> Option<Self> {
        let [position, encoder] = split(first);
        let [numbers, found] = split(second);
        let (shaft, turns) = (numbers as u16, (numbers >> 16) as u16);
        let position_rad = f32::from_bits(position);
        (found == check(first, numbers)).then_some(Self { position_rad, encoder, shaft, turns })
    }
}

fn check(first: [u8; UNIT_BYTES], numbers: u32) -> u32 {
    let mut bytes = [0; UNIT_BYTES + 4];
    bytes.iter_mut().zip(first.into_iter().chain(numbers.to_le_bytes())).for_each(|(to, from)| {
        *to = from;
    });
    crc(&bytes)
}

fn join(low: u32, high: u32) -> [u8; UNIT_BYTES] {
    (u64::from(low) | u64::from(high) << 32).to_le_bytes()
}

fn split(unit: [u8; UNIT_BYTES]) -> [u32; 2] {
    let both = u64::from_le_bytes(unit);
    [both as u32, (both >> 32) as u32]
}

/// Returns the places of the records in a slot; none if the longest set would leave no room for them.
pub(super) fn home_places(slot: &Range<u32>) -> Range<u32> {
    let end = copy_place(slot).unwrap_or(slot.start);
    let needed = PAYLOAD_AT as usize + MAX_PAYLOAD + PLACES_BYTES + COPY_BYTES;
    let length = if slot.len() < needed { 0 } else { PLACES_BYTES as u32 };
    end - length..end
}

impl<F: NorFlash> Store<F> {
    /// Returns the home of the current set, or that of the former one if a save has followed it.
    #[inline(never)]
    pub fn find_home(&mut self) -> FoundHome {
        let Some(LoadedSet { slot, .. }) = self.current() else { return FoundHome::None };
        match (self.home_in(slot), self.home_in(1 - slot)) {
            (FoundHome::At(_), FoundHome::At(_)) => FoundHome::Lost,
            (FoundHome::None, former) => former,
            (newest, _) => newest,
        }
    }

    /// Marks that the joint may move. It takes one program operation at most, of 85 us.
    ///
    /// # Errors
    /// Returns what failed. The last record is still valid then.
    #[inline(never)]
    pub fn mark_home(&mut self) -> Result<(), StoreError> {
        for slot in self.slots.clone() {
            let Some(at) = self.last_home(&slot) else { continue };
            if self.unit(at + MARK_AT) == Some(ERASED) {
                let written = self.program(at + MARK_AT, &MARK);
                // A mark that is programmed in part is one.
                if self.unit(at + MARK_AT) == Some(ERASED) {
                    return written;
                }
            }
        }
        Ok(())
    }

    /// Adds a record of a joint at rest. If there is no place and `may_erase` is true, the current set is saved again, and the
    /// former one is lost. The processor waits for its flash meanwhile, so do not call it while the bridge is on.
    ///
    /// # Errors
    /// Returns what failed. [`StoreError::Slots`] if no set is stored, or if there is no room.
    #[inline(never)]
    pub fn append_home(&mut self, record: &HomeRecord, may_erase: bool) -> Result<(), StoreError> {
        self.mark_home()?;
        let mut places = self.free_home_places();
        if places.len() < HOME_RECORD_BYTES && may_erase {
            self.renew_slot()?;
            places = self.free_home_places();
        }
        for at in places.step_by(HOME_RECORD_BYTES) {
            let mut units = (at..).step_by(UNIT_BYTES).zip(record.emit());
            if units.all(|(at, unit)| self.program(at, &unit).is_ok()) {
                return Ok(());
            }
        }
        Err(StoreError::Slots)
    }

    /// Returns the places after the last record of the current set.
    fn free_home_places(&mut self) -> Range<u32> {
        let current = self.current().and_then(|set| self.slots.get(set.slot).cloned());
        let Some(slot) = current else { return 0..0 };
        let places = home_places(&slot);
        let after = self.last_home(&slot).map(|at| at + HOME_RECORD_BYTES as u32);
        after.unwrap_or(places.start)..places.end
    }

    /// Returns the last written place of a slot.
    fn last_home(&mut self, slot: &Range<u32>) -> Option<u32> {
        let places = home_places(slot).step_by(HOME_RECORD_BYTES);
        places.rev().find(|at| {
            let mut units = (*at..).step_by(UNIT_BYTES).take(HOME_RECORD_BYTES / UNIT_BYTES);
            units.any(|at| self.unit(at) != Some(ERASED))
        })
    }

    fn home_in(&mut self, slot: usize) -> FoundHome {
        let range = self.slots.get(slot).cloned().unwrap_or_default();
        let is_whole = matches!(self.states.get(slot), Some(SlotState::Whole { .. }));
        let Some(at) = self.last_home(&range).filter(|_| is_whole) else { return FoundHome::None };
        let units = [at, at + UNIT_BYTES as u32, at + MARK_AT].map(|at| self.unit(at));
        let [Some(first), Some(second), Some(ERASED)] = units else { return FoundHome::Lost };
        HomeRecord::parse(first, second).map_or(FoundHome::Lost, FoundHome::At)
    }
}
