//! The dictionary as a driver searches it: a row of six bytes for each object, and an entry of two bytes for each value.
//!
//! The compiler makes both from [`OBJECTS`](super::OBJECTS), of which a board has nothing else. The values of an array have
//! one entry.

use super::entry::{Access, DataType, Entry, entry};
use super::{ALL, Level, Shape, has_written_count};
use crate::node::sdo::Abort;

/// What a lookup needs of an object.
#[derive(Clone, Copy)]
struct Row {
    index: u16,
    /// Place of its first entry in [`ENTRIES`].
    first: u16,
    /// 0 for a variable.
    highest_sub_index: u8,
    /// Bits of the object, and the rights of sub-index 0.
    traits: u8,
}

/// An entry. Its access has the lower three bits.
#[derive(Clone, Copy)]
struct ListedEntry {
    #[cfg(not(target_os = "none"))]
    name: &'static str,
    data: DataType,
    rights: u8,
}

/// A record: each of its values has an entry.
const RECORD: u8 = 1;
/// Sub-index 0 can be written.
const WRITTEN_COUNT: u8 = 2;
/// A compact node has the object.
const COMPACT: u8 = 4;
/// A write needs the service level.
const SERVICE: u8 = 8;
/// An armed joint accepts a write.
const ARMED: u8 = 16;

static ROWS: [Row; ALL.len()] = rows();
const LISTED: usize = listed_before(ALL.len());
static ENTRIES: [ListedEntry; LISTED] = entries();

/// Returns the number of entries of the first `count` objects.
const fn listed_before(count: usize) -> usize {
    let (mut place, mut listed) = (0, 0);
    while place < count {
        listed += ALL[place].listed();
        place += 1;
    }
    listed
}

const fn rows() -> [Row; ALL.len()] {
    let mut rows = [Row { index: 0, first: 0, highest_sub_index: 0, traits: 0 }; ALL.len()];
    let mut place = 0;
    while place < ALL.len() {
        let object = &ALL[place];
        let of_shape = if matches!(object.shape, Shape::Record(_)) { RECORD } else { 0 };
        let of_count = if has_written_count(object) { WRITTEN_COUNT } else { 0 };
        let of_node = if object.is_compact { COMPACT } else { 0 };
        let of_write = rights(object.level, object.is_written_armed);
        rows[place] = Row {
            index: object.index,
            first: listed_before(place) as u16,
            highest_sub_index: object.highest_sub_index(),
            traits: of_shape | of_count | of_node | of_write,
        };
        place += 1;
    }
    rows
}

const fn entries() -> [ListedEntry; LISTED] {
    let mut entries = [ListedEntry::of(ALL[0].listed_entry(0)); LISTED];
    let (mut object, mut place, mut filled) = (0, 0, 0);
    while filled < LISTED {
        entries[filled] = ListedEntry::of(ALL[object].listed_entry(place));
        (place, filled) = (place + 1, filled + 1);
        if place == ALL[object].listed() {
            (object, place) = (object + 1, 0);
        }
    }
    entries
}

impl ListedEntry {
    const fn of(entry: Entry) -> Self {
        Self {
            #[cfg(not(target_os = "none"))]
            name: entry.name,
            data: entry.data,
            rights: entry.access as u8 | rights(entry.level, entry.is_written_armed),
        }
    }

    fn entry(self) -> Entry {
        #[cfg(not(target_os = "none"))]
        let name = self.name;
        #[cfg(target_os = "none")]
        let name = "";
        let access = match self.rights & 7 {
            0 => Access::Const,
            1 => Access::ReadOnly,
            2 => Access::ReadWrite,
            3 => Access::Input,
            _ => Access::WriteOnly,
        };
        with_rights(entry(name, self.data, access), self.rights)
    }
}

const fn rights(level: Level, is_written_armed: bool) -> u8 {
    let of_level = if matches!(level, Level::Service) { SERVICE } else { 0 };
    of_level | if is_written_armed { ARMED } else { 0 }
}

fn with_rights(entry: Entry, rights: u8) -> Entry {
    let level = if rights & SERVICE != 0 { Level::Service } else { Level::Open };
    Entry { level, is_written_armed: rights & ARMED != 0, ..entry }
}

#[inline(never)]
fn row(index: u16) -> Result<Row, Abort> {
    let at = ROWS.binary_search_by_key(&index, |row| row.index).map_err(|_| Abort::NoObject)?;
    ROWS.get(at).copied().ok_or(Abort::NoObject)
}

/// Returns true if a compact node has an object.
pub fn is_compact(index: u16) -> bool {
    row(index).is_ok_and(|row| row.traits & COMPACT != 0)
}

/// Returns the highest sub-index of an object that has several values; `None` for a variable.
pub fn value_count(index: u16) -> Option<u8> {
    row(index).ok().map(|row| row.highest_sub_index).filter(|highest| *highest > 0)
}

/// Returns the entry at an address.
///
/// # Errors
/// Returns [`Abort::NoObject`] or [`Abort::NoSubIndex`].
#[inline(never)]
pub fn find(index: u16, sub_index: u8) -> Result<Entry, Abort> {
    let row = row(index)?;
    if sub_index > row.highest_sub_index {
        return Err(Abort::NoSubIndex);
    }
    if sub_index == 0 && row.highest_sub_index > 0 {
        let is_written = row.traits & WRITTEN_COUNT != 0;
        let access = if is_written { Access::ReadWrite } else { Access::Const };
        let count = entry("highest_sub_index", DataType::Unsigned8, access);
        return Ok(with_rights(count, row.traits));
    }
    let place = if row.traits & RECORD != 0 { u16::from(sub_index) - 1 } else { 0 };
    let listed = ENTRIES.get(usize::from(row.first + place)).ok_or(Abort::NoSubIndex)?;
    #[cfg(not(target_os = "none"))]
    if let Some(name) = super::Object::find(index).and_then(|object| object.name_at(sub_index)) {
        return Ok(Entry { name, ..listed.entry() });
    }
    Ok(listed.entry())
}
