//! Requests of a tool to a compact node, and their refusals.

use super::device::Device;
use crate::control::PERIOD_S;
use crate::loop_parts::LoopParts;
use crate::node::sdo::Abort;
use crate::node_settings::{MAX_BLOCK_BYTES, NodeSettings, emit_block, split_block};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{Code, ParameterSource};
use compensator_core::parameters::Text;
use compensator_core::refusal;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Executes a request to the state machine: 0 disarm, 1 arm, 2 clear faults.
    pub(super) fn request(&mut self, request: u8) -> Result<(), Abort> {
        match request {
            0 => {
                self.disarm();
                Ok(())
            }
            1 => self.arm(),
            2 => self.supervisor.clear_faults().map_err(|left| {
                self.blocking = left.fault_bits();
                if left.contains(Code::GateDriverFault) {
                    self.current_loop.reset_gate_driver();
                }
                self.staging.refuse(Abort::State, self.supervisor.remaining(left))
            }),
            _ => Err(self.staging.refuse_request(request)),
        }
    }

    /// Arms the joint. A compact node has torque modes only, and no lock: it compensates at most what someone has saved, while
    /// disarmed, for every later start.
    fn arm(&mut self) -> Result<(), Abort> {
        if let Some(larger) = self.larger_than_stored() {
            let why = refusal!("{name}: larger than stored: save the set first (1010h:1)", larger);
            return Err(self.staging.refuse(Abort::State, why));
        }
        let checked = self.start.check(self.staging.active());
        checked.map_err(|why| self.staging.refuse(Abort::State, why))?;
        self.supervisor.arm(self.now_us).map_err(|refusal| {
            self.blocking = refusal.causes.fault_bits();
            self.staging.refuse(Abort::State, refusal)
        })
    }

    /// Returns the first quantity of the active set with which it compensates more than the set in the flash.
    // Not inlined: the stack of the stored set is free again afterwards.
    #[inline(never)]
    fn larger_than_stored(&mut self) -> Option<Text> {
        let mut stored = ParameterSet::default();
        let mut block = [0; MAX_BLOCK_BYTES];
        let loaded = self.store.load(&mut block).ok();
        let parameters =
            loaded.and_then(|loaded| Some(split_block(block.get(..loaded.length)?).ok()?.1));
        if parameters.is_none_or(|bytes| stored.read(bytes).is_err()) {
            stored = ParameterSet::default();
        }
        self.staging.active().larger_quantity(&stored)
    }

    /// Sets the joint position, rad: known at rest at a stop, or from a sensor behind the gear.
    pub(super) fn set_position(&mut self, position_rad: f32) -> Result<(), Abort> {
        if !position_rad.is_finite() {
            let why = refusal!("set_position_rad = {f32}: must be a finite number", position_rad);
            return Err(self.staging.refuse(Abort::Value, why));
        }
        self.current_loop.set_home(position_rad);
        Ok(())
    }

    /// Makes the staged set the active one.
    pub(super) fn commit(&mut self, meant: u32) -> Result<(), Abort> {
        self.staging.validate_commit(meant)?;
        let set = self.staging.staged();
        // The loop receives the same parts after the commit.
        let buildable = LoopParts::build(set, self.identity.stage, PERIOD_S).map(drop);
        let accepted = buildable.and_then(|()| self.supervisor.configure(&set.thresholds));
        accepted.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.staging.activate();
        self.supervisor.set_parameter_source(ParameterSource::Set);
        self.motor.forget_travel();
        self.start.set_refused(None);
        self.compensation.reset();
        self.restart_watch();
        self.update_commissioned();
        self.current_loop.take_set();
        Ok(())
    }

    /// Confirms that the joint is wired as its parameters say; `seen` is the CRC of these wiring parameters.
    pub(super) fn confirm_wiring(&mut self, seen: u32) -> Result<(), Abort> {
        self.staging.check_wiring(seen)?;
        self.settings.commissioned = seen;
        // Nothing was measured: the wiring may have been changed before the confirmation.
        self.settings.proven = 0;
        self.update_commissioned();
        Ok(())
    }

    fn update_commissioned(&mut self) {
        let confirmed = self.is_commissioned();
        self.supervisor.set_commissioned(confirmed);
    }

    /// Stores settings and the active set. The processor may wait for its flash meanwhile, so the bridge must be off: the
    /// rights of the object ensure it.
    pub(super) fn save(&mut self) -> Result<(), Abort> {
        let (block, settings) = (emit_block(&self.settings, self.staging.active()), self.settings);
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
        self.supervisor.set_store_health(self.store.health());
        saved.map(drop).map_err(|error| self.staging.refuse(Abort::Hardware, error))
    }
}
