//! A parameter store in each of two banks, for a board whose image may run from either.
//!
//! A driver saves to the bank that it does not run from, because an erase stalls reads of its own bank. After an update
//! it runs from the other bank, so the newest set may be in its own one. The start then copies that set, with its
//! sequence number, and the driver goes on with the copy. The original stays: an earlier image that starts again finds
//! it, even if the copy is replaced by a set with a layout that this image does not know.

use super::{FoundHome, FoundIdentity, Identity, LoadedSet, MAX_PAYLOAD, Store, is_newer};
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// What a start finds beside the set.
#[derive(Clone, Debug)]
pub struct StartFinds {
    /// Journals in the bank of the running image, for [`Store::restore_trend`]: they may be newer than those of the store, also
    /// if the set is in both banks.
    pub journals: [Range<u32>; 2],
    /// The home. One in the bank of the running image is used once: it is marked, because later records are in the other bank.
    pub home: FoundHome,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store in the other bank. If the newest set that this firmware can read is in the own bank, it is copied
    /// before; if the copy fails, the own bank's store is used. `identity_of` returns the identity in a set.
    pub fn open_mirrored(
        &mut self,
        running: [Range<u32>; 2],
        other: [Range<u32>; 2],
        identity_of: fn(&[u8]) -> Option<Identity>,
    ) -> StartFinds {
        self.move_to(running.clone());
        let journals = [self.places_in(0), self.places_in(1)];
        let before = self.find_home();
        let is_marked = self.mark_home().is_ok();
        self.open_newest(running, other, identity_of);
        let home = match (before, self.find_home()) {
            (FoundHome::At(_), FoundHome::At(_)) => FoundHome::Lost,
            (FoundHome::At(_), _) if is_marked => before,
            (FoundHome::None, home) | (FoundHome::Lost, home @ FoundHome::At(_)) => home,
            _ => FoundHome::Lost,
        };
        StartFinds { journals, home }
    }

    // Not inlined: its buffer is free again when the set is loaded.
    #[inline(never)]
    fn open_newest(
        &mut self,
        running: [Range<u32>; 2],
        other: [Range<u32>; 2],
        identity_of: fn(&[u8]) -> Option<Identity>,
    ) {
        let Some(LoadedSet { sequence: newest, .. }) = self.current() else {
            return self.move_to(other);
        };
        let mut payload = [0; MAX_PAYLOAD];
        let loaded = self.load(&mut payload);
        self.move_to(other);
        if self.current().is_some_and(|present| !is_newer(newest, present.sequence)) {
            return;
        }
        let is_copied = loaded.is_ok_and(|set| {
            let payload = payload.get(..set.length).unwrap_or_default();
            let identity = match self.find_identity(Some(running.clone())) {
                FoundIdentity::Copy(copy) if !is_newer(set.sequence, copy.sequence) => {
                    Some(copy.identity)
                }
                _ => identity_of(payload),
            };
            identity.is_some_and(|identity| self.adopt(set.sequence, payload, &identity))
        });
        if !is_copied {
            self.move_to(running);
        }
    }

    fn move_to(&mut self, slots: [Range<u32>; 2]) {
        self.slots = slots;
        self.inspect();
    }

    /// Writes a set with this sequence number to the slot that is not current. Returns true if it is intact.
    fn adopt(&mut self, sequence: u32, payload: &[u8], identity: &Identity) -> bool {
        let slot = self.current().map_or(0, |set| 1 - set.slot);
        self.write_both(slot, sequence, payload, identity).is_ok()
    }
}
