//! The stored block of settings and parameters, and the defaults.

use crate::node_settings::{MAX_BLOCK_BYTES, NodeSettings, split_block};
use crate::parameter_set::ParameterSet;
use crate::store::{Identity, LoadError, SaveOutcome, SavePlace, Store, StoreError};
use embedded_storage::nor_flash::NorFlash;

/// A stored block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StoredBlock {
    /// The one that a start loads.
    Newest,
    /// The one that was saved before it.
    Former,
}

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

    /// Reads the set of a stored block, and returns the settings beside it. If nothing is stored, the newest are the
    /// defaults. `None` if the block is not intact or refused; the set is then undefined.
    // Not inlined: the stack of the block is free again when the set is built.
    #[inline(never)]
    pub(super) fn recall(
        &mut self,
        from: StoredBlock,
        set: &mut ParameterSet,
    ) -> Option<NodeSettings> {
        let mut block = [0; MAX_BLOCK_BYTES];
        let loaded = match from {
            StoredBlock::Newest => self.store.load(&mut block),
            StoredBlock::Former => self.store.load_former(&mut block),
        };
        match loaded {
            Ok(loaded) => {
                let (settings, parameters) = split_block(block.get(..loaded.length)?).ok()?;
                set.read(parameters).ok()?;
                Some(settings)
            }
            Err(LoadError::Empty) if from == StoredBlock::Newest => {
                *set = ParameterSet::default();
                Some(self.defaults)
            }
            Err(_) => None,
        }
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
