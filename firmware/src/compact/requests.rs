//! Requests of a tool to a compact node, and their refusals.

use super::device::Device;
use crate::joint_node::larger_than_stored;
use crate::node::sdo::Abort;
use crate::node_settings::{NodeSettings, emit_block};
use crate::parameter_set::ParameterSet;
use compensator_core::refusal;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Executes a request to the state machine: 0 disarm, 1 arm, 2 clear faults.
    pub(super) fn request(&mut self, request: u8) -> Result<(), Abort> {
        match request {
            0 => {
                self.base.supervisor.disarm();
                Ok(())
            }
            1 => self.arm(),
            2 => self.base.clear_faults(),
            _ => Err(self.base.refuse_request(request)),
        }
    }

    /// Arms the joint. A compact node has torque modes only, and no lock: it compensates at most what someone has saved, while
    /// disarmed, for every later start.
    fn arm(&mut self) -> Result<(), Abort> {
        if let Some(larger) = larger_than_stored(&mut self.store, self.base.set()) {
            let why = refusal!("{name}: larger than stored: save the set first (1010h:1)", larger);
            return Err(self.base.refuse(Abort::State, why));
        }
        self.base.arm()
    }

    /// Makes the staged set the active one.
    pub(super) fn commit(&mut self, meant: u32) -> Result<(), Abort> {
        self.base.staging.validate_commit(meant)?;
        self.base.accept_staged()?;
        self.base.activate_staged();
        self.base.follow_set();
        Ok(())
    }

    /// Stores settings and the active set. The processor may wait for its flash meanwhile, so the bridge must be off: the
    /// rights of the object ensure it.
    pub(super) fn save(&mut self) -> Result<(), Abort> {
        let (block, settings) =
            (emit_block(&self.base.settings, self.base.set()), self.base.settings);
        self.write_block(&block, &settings)
    }

    /// Stores the defaults; they apply from the next start, as in CiA 301.
    pub(super) fn restore_defaults(&mut self) -> Result<(), Abort> {
        let settings = NodeSettings::default();
        self.write_block(&emit_block(&settings, &ParameterSet::default()), &settings)
    }

    #[inline(never)]
    fn write_block(&mut self, block: &[u8], settings: &NodeSettings) -> Result<(), Abort> {
        let saved = self.store.save(block, &settings.identity());
        self.base.supervisor.set_store_health(self.store.health());
        saved.map(drop).map_err(|error| self.base.refuse(Abort::Hardware, error))
    }
}
