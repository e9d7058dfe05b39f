//! Trend of the learnt friction levels: a journal of small entries that survives restarts.
//!
//! The entries lie in the slot of the current set, between the end of its payload and the records of the home. Those pages
//! are erased by each save anyway, and no other page of a bank is free. An entry needs no erase: it is programmed into the
//! next two double words.
//!
//! * **Save**: The new set is committed first, then the entries follow from the other slot. A start completes a copy that a
//!   power cut has interrupted, because the other slot still has all entries.
//! * **Full journal**: The current set is saved again in the other slot, and the entries follow. If they are more than half
//!   of the places, they are thinned to equal distances in time. So each erase makes room for half of the places.
//! * **Power cut**: It tears at most the entry that is being written. A torn entry has a wrong check and is skipped.
//!
//! | offset | size | content of an entry |
//! |---|---|---|
//! | 0 | 3 | time of learning since the first entry's begin, in units of 10 s |
//! | 3 | 1 | standard deviation of the level's gain, thousandths, at most 255 |
//! | 4 | 4 | learnt Coulomb level, Nm or N, as `f32` |
//! | 8 | 2 | gain on the level of the set, thousandths |
//! | 10 | 2 | gain on the viscous friction, thousandths |
//! | 12 | 2 | term whose gain differs most from 1: bits 13 to 15 its place in the set, the others its gain in units of 0.002 |
//! | 14 | 2 | low half of the CRC-32 (ISO-HDLC) of everything else |

use super::home_record::home_places;
use super::image::{PAYLOAD_AT, UNIT_BYTES, crc};
use super::{MAX_PAYLOAD, SlotState, Store, StoreError};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Length of an entry, bytes.
pub const ENTRY_BYTES: usize = 2 * UNIT_BYTES;
type EntryBytes = [u8; ENTRY_BYTES];
/// Unit of the time of an entry, s.
pub const TIME_UNIT_S: f32 = 10.0;
/// A place as an erase leaves it.
const BLANK: EntryBytes = [0xFF; ENTRY_BYTES];
const _: () = assert!(compensator_core::term::MAX_TERMS <= 8, "the place of a term has three bits");
/// Largest gain of the term in an entry, in units of 0.002.
const MAX_TERM_GAIN: u16 = 0x1FFF;

/// Learnt levels at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrendEntry {
    /// Time of learning, in units of [`TIME_UNIT_S`]; at most 24 bits.
    pub learnt: u32,
    /// Standard deviation of the level's gain, thousandths, at most 255.
    pub deviation_permille: u8,
    /// Learnt Coulomb level, Nm or N.
    pub level_nm: f32,
    /// Gain on the level of the set, thousandths.
    pub level_permille: u16,
    /// Gain on the viscous friction of the set, thousandths.
    pub viscous_permille: u16,
    /// Place in the set of the term whose gain differs most from 1: 0 to 7.
    pub term: u8,
    /// Gain of that term, in units of 0.002.
    pub term_gain: u16,
}

impl TrendEntry {
    /// Returns the entry as bytes.
    pub fn emit(&self) -> EntryBytes {
        let term = u32::from(self.term) << 13 | u32::from(self.term_gain.min(MAX_TERM_GAIN));
        let words = [
            self.learnt & 0xFF_FFFF | u32::from(self.deviation_permille) << 24,
            self.level_nm.to_bits(),
            u32::from(self.level_permille) | u32::from(self.viscous_permille) << 16,
            term,
        ];
        let mut bytes = [0; ENTRY_BYTES];
        for (place, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
        [bytes[ENTRY_BYTES - 2], bytes[ENTRY_BYTES - 1]] = check(&bytes);
        bytes
    }

    /// Parses an entry; `None` if it is torn, or if the place is erased.
    pub fn parse(bytes: &EntryBytes) -> Option<Self> {
        let [t0, t1, t2, deviation_permille, n0, n1, n2, n3, l0, l1, v0, v1, g0, g1, ..] = *bytes;
        let term = u16::from_le_bytes([g0, g1]);
        is_intact(bytes).then_some(Self {
            learnt: u32::from_le_bytes([t0, t1, t2, 0]),
            deviation_permille,
            level_nm: f32::from_le_bytes([n0, n1, n2, n3]),
            level_permille: u16::from_le_bytes([l0, l1]),
            viscous_permille: u16::from_le_bytes([v0, v1]),
            term: (term >> 13) as u8,
            term_gain: term & MAX_TERM_GAIN,
        })
    }
}

/// Returns the check of an entry.
fn check(bytes: &EntryBytes) -> [u8; 2] {
    let [low, high, ..] = crc(bytes.split_at(ENTRY_BYTES - 2).0).to_le_bytes();
    [low, high]
}

#[inline(never)]
fn is_intact(bytes: &EntryBytes) -> bool {
    bytes.ends_with(&check(bytes))
}

/// Returns the time of an entry.
fn learnt(bytes: &EntryBytes) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], 0])
}

/// Content of the places of a slot.
#[derive(Clone, Copy, Debug)]
struct Journal {
    /// First place that was never written.
    next: u32,
    /// End of the places.
    end: u32,
    /// The newest entry.
    last: LastEntry,
}

/// What a driver needs of the newest entry to continue a trend.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastEntry {
    /// Time of learning, in units of [`TIME_UNIT_S`]; 0 if there is no entry.
    pub learnt: u32,
    /// Learnt Coulomb level, Nm or N.
    pub level_nm: f32,
}

impl<F: NorFlash> Store<F> {
    /// Returns the length of the journal in bytes, torn entries included.
    pub fn trend_length(&mut self) -> usize {
        let places = self.trend_places();
        (self.journal(&places).next - places.start) as usize
    }

    /// Reads a part of the journal. What the flash cannot read is 0, which is no entry.
    pub fn read_trend(&mut self, offset: usize, part: &mut [u8]) {
        let start = self.trend_places().start;
        for (at, byte) in (offset..).zip(part) {
            let within = at % UNIT_BYTES;
            let unit = self.unit(start + (at - within) as u32).unwrap_or_default();
            *byte = unit.get(within).copied().unwrap_or_default();
        }
    }

    /// Adds an entry. If the journal is full and `may_erase` is true, it is thinned: the current set is saved again, and the
    /// former one is lost. The processor waits for its flash meanwhile, so do not call it while the bridge is on.
    ///
    /// # Errors
    /// Returns what failed. [`StoreError::Slots`] if no set is stored, or if there is no room.
    pub fn append_trend(&mut self, entry: &TrendEntry, may_erase: bool) -> Result<(), StoreError> {
        let places = self.trend_places();
        let mut journal = self.journal(&places);
        if journal.next >= journal.end && may_erase {
            self.renew_slot()?;
            let places = self.trend_places();
            journal = self.journal(&places);
        }
        if self.append(&mut journal, &entry.emit()) { Ok(()) } else { Err(StoreError::Slots) }
    }

    /// Saves the current set again, in the other slot.
    // Not inlined: its buffer is on the stack.
    #[inline(never)]
    pub(super) fn renew_slot(&mut self) -> Result<(), StoreError> {
        let mut payload = [0; MAX_PAYLOAD];
        let loaded = self.load(&mut payload).map_err(|_| StoreError::Slots)?;
        let slot = self.slots.get(loaded.slot).cloned().unwrap_or_default();
        let copy = self.copy(&slot).ok_or(StoreError::Slots)?;
        let payload = payload.get(..loaded.length).unwrap_or_default();
        let sequence = loaded.sequence.wrapping_add(1);
        self.write_both(1 - loaded.slot, sequence, payload, &copy.identity).map(drop)
    }

    /// Returns the places in the slot of the current set.
    fn trend_places(&self) -> Range<u32> {
        self.current().map_or(0..0, |set| self.places_in(set.slot))
    }

    /// Returns the places in a slot; none if it has no intact set.
    pub(super) fn places_in(&self, slot: usize) -> Range<u32> {
        match (self.states.get(slot), self.slots.get(slot)) {
            (Some(SlotState::Whole { length, .. }), Some(range)) => {
                let start = range.start + PAYLOAD_AT + length.next_multiple_of(UNIT_BYTES) as u32;
                start..home_places(range).start.max(start)
            }
            _ => 0..0,
        }
    }

    /// Completes the journal of the current set with that of the other slot, after a power cut during a save, and with those
    /// of another bank ([`Store::open_mirrored`]). Returns the newest entry.
    #[inline(never)]
    pub fn restore_trend(&mut self, journals: [Range<u32>; 2]) -> LastEntry {
        let places = self.trend_places();
        let slots = [self.places_in(0), self.places_in(1)];
        for from in journals.iter().chain(&slots) {
            self.merge_places(from, &places);
        }
        self.journal(&places).last
    }

    /// Completes the journal of a slot with the newer entries of another one.
    pub(super) fn merge_trend(&mut self, from: usize, to: usize) {
        self.merge_places(&self.places_in(from), &self.places_in(to));
    }

    /// Completes a journal with the newer entries of other places. If the others have more entries than half of its places,
    /// they are thinned to equal distances in time.
    #[inline(never)]
    fn merge_places(&mut self, from: &Range<u32>, to: &Range<u32>) {
        let (source, mut target) = (self.journal(from), self.journal(to));
        let half = (to.len() / ENTRY_BYTES / 2) as u32;
        let newest = source.last.learnt;
        let is_thinned = source.next - from.start > half * ENTRY_BYTES as u32;
        // Thinned, each interval of this length keeps its first entry.
        let length = if is_thinned { newest / half.max(1) + 1 } else { 1 };
        for at in (from.start..source.next).step_by(ENTRY_BYTES) {
            let entry = self.entry(at);
            let (time, last) = (learnt(&entry), target.last.learnt);
            let is_kept = time / length > last / length || last == 0 || time == newest;
            if time > last && is_kept && is_intact(&entry) {
                self.append(&mut target, &entry);
            }
        }
    }

    /// Writes an entry to the next place that takes it.
    #[inline(never)]
    fn append(&mut self, journal: &mut Journal, entry: &EntryBytes) -> bool {
        while journal.next < journal.end {
            let at = journal.next;
            journal.next += ENTRY_BYTES as u32;
            let mut units = (at..).step_by(UNIT_BYTES).zip(entry.as_chunks().0);
            if units.all(|(at, unit)| self.program(at, unit).is_ok()) {
                journal.last.learnt = learnt(entry);
                return true;
            }
        }
        false
    }

    /// Reads the bytes of a place; zeros, which are no entry, if the flash cannot read them.
    #[inline(never)]
    fn entry(&mut self, at: u32) -> EntryBytes {
        let mut bytes = [0; ENTRY_BYTES];
        match self.flash.read(at, &mut bytes) {
            Ok(()) => bytes,
            Err(_) => [0; ENTRY_BYTES],
        }
    }

    /// Reads the journal in these places.
    #[inline(never)]
    fn journal(&mut self, places: &Range<u32>) -> Journal {
        let (next, end) = (places.start, places.end - places.len() as u32 % ENTRY_BYTES as u32);
        let mut journal = Journal { next, end, last: LastEntry::default() };
        for at in (next..end).step_by(ENTRY_BYTES) {
            let bytes = self.entry(at);
            if bytes == BLANK {
                continue;
            }
            journal.next = at + ENTRY_BYTES as u32;
            if is_intact(&bytes) {
                let [_, _, _, _, n0, n1, n2, n3, ..] = bytes;
                let level_nm = f32::from_le_bytes([n0, n1, n2, n3]);
                journal.last = LastEntry { learnt: learnt(&bytes), level_nm };
            }
        }
        journal
    }
}
