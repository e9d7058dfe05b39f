//! Start of a device: from the flash or the defaults, with the result of the previous run.
//!
//! A device takes 14 KB. It is therefore created with defaults first, without deep calls, and completed in place.

use super::inputs::Samples;
use super::memory::Memory;
use super::network::LiveNetwork;
use super::pdos::Pdos;
use super::program::ProgramState;
use super::trend::StoredTrend;
use super::{Boot, Device, Identity};
use crate::access::Lock;
use crate::hil::HilJoint;
use crate::joint_node::JointBase;
use crate::node::lss::Lss;
use crate::node_settings::NodeSettings;
use crate::scope::Scope;
use crate::sensors::enclosure;
use crate::store::{FoundIdentity, StartFinds, is_newer};
use crate::supervisor::ParameterSource;
use crate::update::Program;
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
        const NAME: &str = "friction-compensated joint driver";
        // The value of the function, not a local one, which would be another 14 KB of stack.
        Self {
            base: JointBase::new(NAME, defaults, identity, now_us),
            network: LiveNetwork::default(),
            motion: Default::default(),
            program: ProgramState::default(),
            memory: Memory::new(flash, defaults),
            trial: Default::default(),
            sends_fd: false,
            samples: Samples::new(&defaults),
            enclosure: enclosure::Readings::default(),
            scope: Scope::default(),
            adaptation: Default::default(),
            trend: Default::default(),
            stored_home: Default::default(),
            turn_readings: Default::default(),
            home: Default::default(),
            touch: Default::default(),
            joint_encoder: Default::default(),
            pdos: Pdos::new(defaults.node),
            lss: Lss::default(),
            lock: Lock::default(),
            model_log_us: Some(now_us.saturating_add(MODEL_LOG_DELAY_US)),
        }
    }

    /// Loads settings and parameters from the store and records how the previous run ended.
    #[inline(never)]
    pub(super) fn load_stored(&mut self, boot: &Boot) {
        let StartFinds { journals, home } = match boot.program {
            Some(program) => self.open_banks(program),
            None => {
                let home = self.memory.store.find_home();
                StartFinds { journals: Default::default(), home }
            }
        };
        let (mut parameters, sequence) = self.load_block();
        self.trend = StoredTrend::after(self.memory.store.restore_trend(journals));
        self.keep_identity(boot, sequence);
        if !self.build_hil() {
            parameters = ParameterSource::DefaultRefused;
        }
        let store = self.memory.store.health();
        self.base.start(boot, store, parameters);
        self.network = LiveNetwork::of(self.base.set(), &self.base.settings);
        self.pdos.set_node(self.base.settings.node);
        self.restart_adaptation();
        self.begin_home(boot.home);
        self.begin_stored_home(home);
    }

    /// Opens the store of a board with two banks.
    fn open_banks(&mut self, program: Program) -> StartFinds {
        let opened = self.memory.store.open_mirrored(
            program.running_store(),
            program.other_store(),
            |block| NodeSettings::split(block).map(|(settings, _)| settings.identity()),
        );
        self.program = ProgramState::new(self.memory.store.flash_mut(), program, self.base.now_us);
        opened
    }

    /// Loads settings and parameters, and returns the sequence number of the set if its settings are known. The defaults stay
    /// if no block is stored or if it is refused; of a refused one, the identity is kept.
    fn load_block(&mut self) -> (ParameterSource, Option<u32>) {
        let loaded = self.base.load_block(&mut self.memory.store);
        let Some(settings) = loaded.settings else { return (loaded.parameters, None) };
        self.base.settings = match loaded.parameters {
            ParameterSource::Set => settings,
            _ => {
                let kept = self.base.settings.with_identity(&settings.identity());
                kept.unwrap_or(self.base.settings)
            }
        };
        (loaded.parameters, Some(loaded.sequence))
    }

    /// Takes address, key and policy from their copies if the settings are not known, or if they are those of an older set.
    /// Without an intact copy, no response unlocks the joint. `loaded` is the sequence number of the loaded set.
    #[inline(never)]
    fn keep_identity(&mut self, boot: &Boot, loaded: Option<u32>) {
        let newest = boot.program.map(|program| program.running_store());
        let kept = match (self.memory.store.find_identity(newest), loaded) {
            (FoundIdentity::Copy(copy), loaded)
                if loaded.is_none_or(|loaded| !is_newer(loaded, copy.sequence)) =>
            {
                self.base.settings.with_identity(&copy.identity)
            }
            (_, Some(_)) => return,
            (FoundIdentity::None, None) => return self.memory.is_blank = true,
            _ => None,
        };
        match kept {
            Some(settings) => self.base.settings = settings,
            None => self.lock.seal(),
        }
    }

    /// Builds the joint in HIL. Returns false if the set cannot be built for its period; there is no model then.
    #[inline(never)]
    pub(super) fn build_hil(&mut self) -> bool {
        let (node, setup) = (self.base.settings.node, self.base.settings.hil_setup());
        let set = self.base.set();
        let built = HilJoint::build(node, &set.friction, set.network.as_ref(), setup);
        let is_built = built.is_ok();
        self.samples.set_hil(built.unwrap_or_else(|_refused| HilJoint::without_model(node, setup)));
        is_built
    }
}
