//! The stored block of settings and parameters, and the defaults.

use crate::node_settings::NodeSettings;
use crate::store::{Identity, SaveOutcome, Store, StoreError};
use embedded_storage::nor_flash::NorFlash;

/// The store, with what is known of its content.
#[derive(Debug)]
pub(super) struct Memory<F> {
    store: Store<F>,
    /// Settings that apply if none are stored.
    defaults: NodeSettings,
    /// The joint has started without stored settings: for LSS, it has no node number.
    is_blank: bool,
    /// Settings were stored since the start.
    is_stored: bool,
}

impl<F: NorFlash> Memory<F> {
    pub(super) fn new(flash: F, defaults: NodeSettings) -> Self {
        Self { store: Store::open(flash), defaults, is_blank: false, is_stored: false }
    }

    pub(super) const fn store(&self) -> &Store<F> {
        &self.store
    }

    pub(super) const fn store_mut(&mut self) -> &mut Store<F> {
        &mut self.store
    }

    pub(super) fn flash_mut(&mut self) -> &mut F {
        self.store.flash_mut()
    }

    pub(super) fn into_flash(self) -> F {
        self.store.into_flash()
    }

    /// Returns the settings that apply if none are stored.
    pub(super) const fn defaults(&self) -> &NodeSettings {
        &self.defaults
    }

    /// Returns true if the joint has no node number of its own.
    pub(super) const fn is_blank(&self) -> bool {
        self.is_blank
    }

    pub(super) fn set_blank(&mut self, is_blank: bool) {
        self.is_blank = is_blank;
    }

    /// Takes settings that were stored since the start as those of the joint.
    pub(super) fn end_blank_if_stored(&mut self) {
        self.is_blank &= !self.is_stored;
    }

    /// Notes that the present settings are stored.
    pub(super) fn mark_stored(&mut self) {
        self.is_stored = true;
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
        self.store.save(block, identity)
    }
}
