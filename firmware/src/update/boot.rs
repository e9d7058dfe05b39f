//! The choice of the image at a start.
//!
//! Images are ordered by the number of their update, the newest first. The first one starts that is bare, or signed,
//! intact, not rejected, and confirmed or with a start left. An unconfirmed image that was reset by the watchdog or by
//! software is rejected: it hung, or panicked. A loss of power, and a restart that the bus ordered, only use one of its
//! starts. A reset by a debugger ([`LastRun::Debugged`]) uses none. An image for another board or another wiring does not
//! start, and before its first start an image must not be older than a confirmed one: the receiver checks both, but it may
//! be the part that was replaced.

use super::flash::read_chunks;
use super::marks::{self, ImageState, SlotState, TRIALS, is_newer};
use super::package::HEADER_BYTES;
use super::signature;
use super::{Board, Slot};
use crate::supervisor::ResetCause;
use crc::{CRC_32_ISO_HDLC, Crc, Table};
use embedded_storage::nor_flash::NorFlash;

/// Result of [`select`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Start the image of this slot, 0 or 1.
    Start {
        /// Number of the slot.
        slot: usize,
        /// It is not confirmed yet.
        is_trial: bool,
    },
    /// No image can be started.
    Recover,
}

/// The CRC of images, fast: it is computed at every start.
static CRC_WITH_TABLE: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// What an image must have to be started.
#[derive(Clone, Copy, Debug)]
pub struct Requirement {
    /// The board for which it must be made.
    pub board: Board,
    /// Ed25519 public key with which it must be signed ([`signature`]), needed before the first start.
    pub public_key: [u8; 32],
}

/// End of the last run, as it concerns an image on trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastRun {
    /// By the watchdog or by software: the image hung, or panicked.
    Failed,
    /// By a debugger, whose reset is one by software. It is no failure, and uses no start of the trial.
    Debugged,
    /// By a loss of power or the reset pin.
    Interrupted,
}

impl LastRun {
    /// Returns the end of the last run by the cause of the reset, and whether a debugger is attached.
    pub const fn of(reset: ResetCause, is_debugged: bool) -> Self {
        match reset {
            ResetCause::Software if is_debugged => Self::Debugged,
            ResetCause::Software | ResetCause::Watchdog => Self::Failed,
            ResetCause::PowerOn | ResetCause::BrownOut | ResetCause::Pin | ResetCause::Unknown => {
                Self::Interrupted
            }
        }
    }
}

/// Selects the image to start, and writes the marks of a trial or a rejection.
///
/// `is_plausible` checks the start of an image in a slot, such as its stack pointer.
pub fn select<F: NorFlash>(
    flash: &mut F,
    slots: &[Slot; 2],
    requirement: &Requirement,
    last_run: LastRun,
    mut is_plausible: impl FnMut(&mut F, usize) -> bool,
) -> Selection {
    let states = slots.each_ref().map(|slot| marks::state(flash, slot));
    // The counter of the image that received the other one.
    let least = states.iter().filter_map(confirmed_counter).max().unwrap_or(0);
    for number in newest_first(states) {
        let Some(slot) = slots.get(number) else { continue };
        let image = match marks::state(flash, slot) {
            SlotState::Empty => continue,
            SlotState::Bare if is_plausible(flash, number) => {
                return Selection::Start { slot: number, is_trial: false };
            }
            SlotState::Bare => continue,
            SlotState::Image(image) => image,
        };
        if image.is_rejected || !is_intact(flash, slot, &image) || !is_plausible(flash, number) {
            continue;
        }
        let fits = requirement.board.fits(&image.header);
        if image.is_confirmed {
            if fits {
                return Selection::Start { slot: number, is_trial: false };
            }
            continue;
        }
        let is_refused = match image.trials {
            _ if !fits || image.header.counter < least => true,
            0 => !signature::is_authentic(flash, slot, &image, &requirement.public_key),
            _ if last_run == LastRun::Debugged => false,
            used => last_run == LastRun::Failed && !image.is_restart_ordered || used >= TRIALS,
        };
        if is_refused {
            // If the mark fails, the next start decides again.
            let _ = marks::reject(flash, slot, &image);
            continue;
        }
        let is_same_start = last_run == LastRun::Debugged && image.trials > 0;
        if is_same_start || marks::begin_trial(flash, slot, &image).is_ok() {
            return Selection::Start { slot: number, is_trial: true };
        }
    }
    Selection::Recover
}

/// Returns true if the image has the CRC of its header.
pub fn is_intact<F: NorFlash>(flash: &mut F, slot: &Slot, image: &ImageState) -> bool {
    let mut digest = CRC_WITH_TABLE.digest();
    let start = slot.start + HEADER_BYTES as u32;
    read_chunks(flash, start..start + image.header.length, |chunk| digest.update(chunk))
        && digest.finalize() == image.header.crc
}

fn confirmed_counter(state: &SlotState) -> Option<u32> {
    match state {
        SlotState::Image(image) if image.is_confirmed => Some(image.header.counter),
        _ => None,
    }
}

fn newest_first(states: [SlotState; 2]) -> [usize; 2] {
    match states {
        [SlotState::Image(first), SlotState::Image(second)]
            if !is_newer(second.sequence, first.sequence) =>
        {
            [0, 1]
        }
        // What a debugger wrote is older than any update that followed it.
        [_, SlotState::Image(_)] => [1, 0],
        _ => [0, 1],
    }
}
