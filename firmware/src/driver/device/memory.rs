//! The stored block of settings and parameters, and the defaults.

use crate::joint_node::{StoredBlock, recall};
use crate::node_settings::NodeSettings;
use crate::parameter_set::ParameterSet;
use crate::store::{Identity, SaveOutcome, SavePlace, Store, StoreError, StoreHealth};
use embedded_storage::nor_flash::NorFlash;

/// The store, with what is known of its content.
#[derive(Debug)]
pub(super) struct Memory<F> {
    pub(super) store: Store<F>,
    /// Settings that apply if none are stored.
    pub(super) defaults: NodeSettings,
    /// The joint has started without stored settings: for LSS, it has no node number of its own.
    pub(super) is_blank: bool,
    /// Settings were stored since the start.
    pub(super) is_stored: bool,
    /// The former block is in use: the next save replaces the newest.
    pub(super) is_undone: bool,
}

impl<F: NorFlash> Memory<F> {
    pub(super) fn new(flash: F, defaults: NodeSettings) -> Self {
        Self {
            store: Store::open(flash),
            defaults,
            is_blank: false,
            is_stored: false,
            is_undone: false,
        }
    }

    /// Reads the set of a stored block, and returns the settings beside it, as [`recall`]. If nothing is stored, the newest are
    /// the defaults.
    pub(super) fn recall(
        &mut self,
        from: StoredBlock,
        set: &mut ParameterSet,
    ) -> Option<NodeSettings> {
        let recalled = recall(&mut self.store, from, set);
        if recalled.is_some()
            || from == StoredBlock::Former
            || self.store.health() != StoreHealth::Empty
        {
            return recalled;
        }
        *set = ParameterSet::default();
        Some(self.defaults)
    }

    /// Stores a block, and the identity of its settings.
    ///
    /// # Errors
    /// The error of the store.
    pub(super) fn save(
        &mut self,
        block: &[u8],
        identity: &Identity,
    ) -> Result<SaveOutcome, StoreError> {
        let place = if self.is_undone { SavePlace::Newest } else { SavePlace::Former };
        let saved = self.store.save_at(place, block, identity);
        self.is_undone &= saved.is_err();
        saved
    }
}
