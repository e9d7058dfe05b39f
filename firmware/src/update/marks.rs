//! The marks of a slot: its history since the last update, one double word per event.
//!
//! Each place is written once after an erase of the page. A mark names the header that it belongs to, so marks do not
//! apply to another image.
//!
//! | place | mark | a torn one means |
//! |---|---|---|
//! | 0 | RECEIVED with the sequence number | no image |
//! | 1 to 3 | TRIAL: this start was begun, after the check of the signature | the start is used |
//! | 4 | REJECTED | rejected |
//! | 5 to 7 | ORDERED: the bus ordered the restart that ends this start | the start ended by itself |
//! | 8 to 15 | CONFIRMED | not confirmed; the next place is written |
//! | 16 | BARE: written by a debugger together with an image without a header | not bare |
//!
//! Only a debugger writes BARE. An update erases the page first.

use super::package::{CRC, Header, USED_BYTES};
use super::{Slot, UNIT_BYTES};
use embedded_storage::nor_flash::NorFlash;

/// Number of starts without a confirmation. Three, so that a restart by a master and a loss of power reject no good image.
pub const TRIALS: u32 = 3;

const RECEIVED: u32 = 0;
const FIRST_TRIAL: u32 = 1;
const REJECTED: u32 = 4;
const FIRST_ORDERED: u32 = 5;
const CONFIRMED: core::ops::Range<u32> = 8..16;
const BARE: u32 = 16;

/// Content of the place BARE.
pub const BARE_MARK: [u8; 8] = *b"BAREIMG1";
const ERASED: [u8; 8] = [0xFF; 8];

/// Kinds of marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Kind {
    Received = 1,
    Trial = 2,
    Rejected = 3,
    Confirmed = 4,
    Ordered = 5,
}

/// State of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotState {
    /// There is no complete image.
    Empty,
    /// A debugger wrote the image: nothing is known of it.
    Bare,
    /// An image was received completely.
    Image(ImageState),
}

/// State of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageState {
    /// Its header.
    pub header: Header,
    /// Number of the update; the next one has the next number, modulo 65536.
    pub sequence: u16,
    /// Number of starts begun before a confirmation.
    pub trials: u32,
    /// The bus ordered the restart that ended the last of them.
    pub is_restart_ordered: bool,
    /// It failed, and is not started again.
    pub is_rejected: bool,
    /// It passed its self-test.
    pub is_confirmed: bool,
}

/// Reads the header of a slot; `None` if there is none.
pub fn header<F: NorFlash>(flash: &mut F, slot: &Slot) -> Option<Header> {
    let mut bytes = [0; USED_BYTES];
    flash.read(slot.start, &mut bytes).ok()?;
    let header = Header::parse(&bytes).ok()?;
    (header.package_bytes() <= slot.package_bytes()).then_some(header)
}

/// Reads the state of a slot. It checks the header and the marks, not the image.
pub fn state<F: NorFlash>(flash: &mut F, slot: &Slot) -> SlotState {
    if unit(flash, slot, BARE) == Some(BARE_MARK) {
        return SlotState::Bare;
    }
    let Some(header) = header(flash, slot) else { return SlotState::Empty };
    let identity = header.identity;
    let mark = |flash: &mut F, place: u32, kind: Kind| {
        unit(flash, slot, place).and_then(|bytes| parse(&bytes, kind, identity))
    };
    let Some(sequence) = mark(flash, RECEIVED, Kind::Received) else { return SlotState::Empty };
    // A used start is any place that is not erased, because a torn mark was begun.
    let is_used = |flash: &mut F, place: u32| unit(flash, slot, place) != Some(ERASED);
    let trials = (0..TRIALS).filter(|at| is_used(flash, FIRST_TRIAL + at)).count() as u32;
    SlotState::Image(ImageState {
        header,
        sequence,
        trials,
        is_restart_ordered: ordered_place(trials)
            .is_some_and(|place| mark(flash, place, Kind::Ordered).is_some()),
        is_rejected: is_used(flash, REJECTED),
        is_confirmed: CONFIRMED
            .into_iter()
            .any(|place| mark(flash, place, Kind::Confirmed).is_some()),
    })
}

/// Returns the sequence number of the next update.
#[inline(never)]
pub fn next_sequence(states: [SlotState; 2]) -> u16 {
    let number = |state: &SlotState| match state {
        SlotState::Image(image) => image.sequence,
        SlotState::Empty | SlotState::Bare => 0,
    };
    let [first, second] = [number(&states[0]), number(&states[1])];
    (if is_newer(second, first) { second } else { first }).wrapping_add(1)
}

/// Returns true if number `a` is newer than `b`, modulo wrapping.
pub(super) const fn is_newer(a: u16, b: u16) -> bool {
    let ahead = a.wrapping_sub(b);
    ahead > 0 && ahead < 0x8000
}

/// Marks an image as received completely. The page of marks must be erased.
///
/// # Errors
/// The flash refuses the mark, or reads it back differently.
pub fn receive<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    header: &Header,
    sequence: u16,
) -> Result<(), MarkError> {
    write(flash, slot, RECEIVED, Kind::Received, sequence, header)
}

/// Marks the begin of a start without a confirmation.
///
/// # Errors
/// The flash refuses the mark, or no start is left.
pub fn begin_trial<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
) -> Result<(), MarkError> {
    // The first erased place, which is not the number of used ones if a torn mark reads as erased.
    let place = (FIRST_TRIAL..FIRST_TRIAL + TRIALS)
        .find(|place| unit(flash, slot, *place) == Some(ERASED))
        .ok_or(MarkError::Full)?;
    write(flash, slot, place, Kind::Trial, image.sequence, &image.header)
}

/// Returns the place of the mark that belongs to the last of so many starts.
fn ordered_place(trials: u32) -> Option<u32> {
    trials.checked_sub(1).map(|last| FIRST_ORDERED + last.min(TRIALS - 1))
}

/// Marks the restart that follows as ordered by the bus: it is no failure of the image.
///
/// # Errors
/// The flash refuses the mark, or no start was begun.
pub fn order_restart<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
) -> Result<(), MarkError> {
    let place = ordered_place(image.trials).ok_or(MarkError::Full)?;
    write(flash, slot, place, Kind::Ordered, image.sequence, &image.header)
}

/// Marks an image as failed.
///
/// # Errors
/// The flash refuses the mark.
pub fn reject<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
) -> Result<(), MarkError> {
    write(flash, slot, REJECTED, Kind::Rejected, image.sequence, &image.header)
}

/// Marks an image as confirmed.
///
/// # Errors
/// The flash refuses the mark in every place that is left.
pub fn confirm<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
) -> Result<(), MarkError> {
    let mut last = MarkError::Full;
    for place in CONFIRMED {
        if unit(flash, slot, place) != Some(ERASED) {
            continue;
        }
        match write(flash, slot, place, Kind::Confirmed, image.sequence, &image.header) {
            Ok(()) => return Ok(()),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Reason why a mark was not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkError {
    /// The flash reported an error, or the mark reads back differently.
    Flash,
    /// All places are used.
    Full,
}

#[inline(never)]
fn unit<F: NorFlash>(flash: &mut F, slot: &Slot, place: u32) -> Option<[u8; 8]> {
    let mut bytes = [0; 8];
    flash.read(slot.marks + UNIT_BYTES * place, &mut bytes).ok().map(|()| bytes)
}

fn write<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    place: u32,
    kind: Kind,
    sequence: u16,
    header: &Header,
) -> Result<(), MarkError> {
    let bytes = emit(kind, sequence, header.identity);
    flash.write(slot.marks + UNIT_BYTES * place, &bytes).map_err(|_| MarkError::Flash)?;
    if unit(flash, slot, place) == Some(bytes) { Ok(()) } else { Err(MarkError::Flash) }
}

/// Returns a mark: kind, its inverse, sequence number, and the CRC-32 of these and the header's identity.
#[inline(never)]
fn emit(kind: Kind, sequence: u16, identity: u32) -> [u8; 8] {
    let [s0, s1] = sequence.to_le_bytes();
    let [i0, i1, i2, i3] = identity.to_le_bytes();
    let (kind, inverse) = (kind as u8, !(kind as u8));
    let [c0, c1, c2, c3] = CRC.checksum(&[kind, inverse, s0, s1, i0, i1, i2, i3]).to_le_bytes();
    [kind, inverse, s0, s1, c0, c1, c2, c3]
}

fn parse(bytes: &[u8; 8], kind: Kind, identity: u32) -> Option<u16> {
    let sequence = u16::from_le_bytes([bytes[2], bytes[3]]);
    (*bytes == emit(kind, sequence, identity)).then_some(sequence)
}
