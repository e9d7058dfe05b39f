//! Start of a device: from the flash or the defaults, with the result of the previous run.
//!
//! A device takes 14 KB. It is therefore created with defaults first, without deep calls, and completed in place.

use super::inputs::Samples;
use super::memory::Memory;
use super::network::LiveNetwork;
use super::pdos::Pdos;
use super::program::ProgramState;
use super::trend::StoredTrend;
use super::{Boot, Device, Identity, watch};
use crate::access::Lock;
use crate::driver::counters::Counters;
use crate::driver::received::ReceivedInputs;
use crate::driver::staging::Staging;
use crate::hil::HilJoint;
use crate::node::Outbox;
use crate::node::lss::Lss;
use crate::node::sdo::Abort;
use crate::node_settings::{MAX_BLOCK_BYTES, NodeSettings, split_block};
use crate::scope::Scope;
use crate::sensors::enclosure;
use crate::start_values::StartRecord;
use crate::store::{FoundHome, FoundIdentity, LoadError, is_newer};
use crate::supervisor::{self, CanState, ParameterSource, Supervisor};
use crate::update::Program;
use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Time from the start until the model and its live terms are logged, us: sensors and bus have reported by then.
const MODEL_LOG_DELAY_US: u64 = 1_000_000;

impl<F: NorFlash> Device<F> {
    /// Creates a device with default parameters, to be completed by [`Self::load_stored`].
    pub(super) fn unloaded(
        defaults: NodeSettings,
        flash: F,
        identity: Identity,
        now_us: u64,
    ) -> Self {
        // The value of the function, not a local one, which would be another 14 KB of stack.
        Self {
            counters: Counters::default(),
            watch: None,
            network: LiveNetwork::default(),
            staging: Staging::default(),
            motion: Default::default(),
            program: ProgramState::default(),
            identity,
            history: Default::default(),
            memory: Memory::new(flash, defaults),
            trial: Default::default(),
            start: Default::default(),
            settings: defaults,
            supervisor: Supervisor::default(),
            outbox: Outbox::default(),
            sends_fd: false,
            samples: Samples::new(&defaults),
            received: ReceivedInputs::default(),
            current_loop: Default::default(),
            can: CanState::Active,
            enclosure: enclosure::Readings::default(),
            scope: Scope::default(),
            blocking: 0,
            compensation: Default::default(),
            adaptation: Default::default(),
            trend: Default::default(),
            stored_home: Default::default(),
            turn_readings: Default::default(),
            seal_sensors: Default::default(),
            motor: Default::default(),
            home: Default::default(),
            touch: Default::default(),
            joint_encoder: Default::default(),
            pdos: Pdos::new(defaults.node),
            lss: Lss::default(),
            lock: Lock::default(),
            model_log_us: Some(now_us.saturating_add(MODEL_LOG_DELAY_US)),
            now_us,
        }
    }

    /// Loads settings and parameters from the store and records how the previous run ended.
    #[inline(never)]
    pub(super) fn load_stored(&mut self, boot: &Boot) {
        let (journals, home) = match boot.program {
            Some(program) => self.open_banks(program),
            None => (Default::default(), self.memory.store_mut().find_home()),
        };
        let (mut parameters, sequence) = self.load_block();
        self.trend = StoredTrend::after(self.memory.store_mut().restore_trend(journals));
        self.keep_identity(boot, sequence);
        if !self.build_hil() {
            parameters = ParameterSource::DefaultRefused;
        }
        let set = self.staging.active();
        self.start = StartRecord::of(set, self.settings.bus());
        self.supervisor.start(
            &set.thresholds,
            &supervisor::SupervisorBoot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store: self.memory.store().health(),
                parameters,
                commissioned: self.is_commissioned(),
                failed_self_test: boot.failed_self_test,
            },
        );
        self.motor.set_winding_rise(boot.winding_rise_k);
        self.watch = watch(&set.watch, &self.settings);
        self.network = LiveNetwork::of(set, &self.settings);
        self.history.set_panic(boot.panic.unwrap_or_default());
        self.pdos.set_node(self.settings.node);
        self.restart_adaptation();
        self.begin_home(boot.home);
        self.begin_stored_home(home);
    }

    /// Opens the store of a board with two banks. Returns its older journals, and the home.
    fn open_banks(&mut self, program: Program) -> ([Range<u32>; 2], FoundHome) {
        let opened = self.memory.store_mut().open_mirrored(
            program.store_slots(true),
            program.store_slots(false),
            |block| split_block(block).ok().map(|(settings, _)| settings.identity()),
        );
        self.program = ProgramState::new(self.memory.flash_mut(), program, self.now_us);
        opened
    }

    /// Loads settings and parameters, and returns the sequence number of the set if its settings are known. The defaults stay
    /// if no block is stored or if it is refused.
    // Not inlined: its stack is free again when the rest of the start needs as much.
    #[inline(never)]
    fn load_block(&mut self) -> (ParameterSource, Option<u32>) {
        let mut block = [0; MAX_BLOCK_BYTES];
        let set = match self.memory.store_mut().load(&mut block) {
            Ok(set) => set,
            Err(LoadError::Empty | LoadError::Damaged) => return (ParameterSource::Default, None),
            // A set of another firmware is stored.
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                return (ParameterSource::DefaultRefused, None);
            }
        };
        let block = block.get(..set.length).unwrap_or_default();
        let (settings, parameters) = match split_block(block) {
            Ok(parts) => parts,
            Err(error) => {
                self.staging.refuse(Abort::Value, error);
                return (ParameterSource::DefaultRefused, None);
            }
        };
        let source = match self.staging.load(parameters) {
            Ok(()) => {
                self.settings = settings;
                ParameterSource::Set
            }
            Err(error) => {
                self.staging.refuse(Abort::Value, error);
                let kept = self.settings.with_identity(&settings.identity());
                self.settings = kept.unwrap_or(self.settings);
                ParameterSource::DefaultRefused
            }
        };
        (source, Some(set.sequence))
    }

    /// Takes address, key and policy from their copies if the settings are not known, or if they are those of an older set.
    /// Without an intact copy, no response unlocks the joint. `loaded` is the sequence number of the loaded set.
    #[inline(never)]
    fn keep_identity(&mut self, boot: &Boot, loaded: Option<u32>) {
        let own = boot.program.map(|program| program.store_slots(true));
        let kept = match (self.memory.store_mut().find_identity(own), loaded) {
            (FoundIdentity::Copy(sequence, copy), loaded)
                if loaded.is_none_or(|loaded| !is_newer(loaded, sequence)) =>
            {
                self.settings.with_identity(&copy)
            }
            (_, Some(_)) => return,
            (FoundIdentity::None, None) => return self.memory.set_blank(true),
            _ => None,
        };
        match kept {
            Some(settings) => self.settings = settings,
            None => self.lock.seal(),
        }
    }

    /// Builds the joint in HIL. Returns false if the set cannot be built for its period; there is no model then.
    #[inline(never)]
    pub(super) fn build_hil(&mut self) -> bool {
        let (node, setup) = (self.settings.node, self.settings.hil_setup());
        let set = self.staging.active();
        let built = HilJoint::build(node, &set.friction, set.network.as_ref(), setup);
        let is_built = built.is_ok();
        self.samples.set_hil(built.unwrap_or_else(|_refused| HilJoint::without_model(node, setup)));
        is_built
    }
}
