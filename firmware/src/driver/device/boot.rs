//! Start of a device: from the flash or the defaults, with the result of the previous run.
//!
//! A device takes 14 KB. It is therefore created with defaults first, without deep calls, and completed in place.

use super::network::LiveNetwork;
use super::pdos::Pdos;
use super::program::ProgramState;
use super::{Boot, Device, Identity, NOT_RECEIVED, commissioning, watch};
use crate::access::Lock;
use crate::control::Covariates;
use crate::control::velocity_loop::{VelocityCommand, VelocityGains, VelocityLoop};
use crate::driver::counters::Counters;
use crate::driver::holding_brake::HoldingBrake;
use crate::driver::loop_data::{Home, LoopReport};
use crate::driver::motor_watch::{MotorState, MotorWatch};
use crate::driver::over_compensation::OverCompensationWatch;
use crate::driver::profile::Profile;
use crate::driver::received::ReceivedInputs;
use crate::driver::staging::Staging;
use crate::hil::{HilJoint, HilReply};
use crate::node::Outbox;
use crate::node::lss::Lss;
use crate::node::sdo::Abort;
use crate::node_settings::{BlockError, MAX_BLOCK_BYTES, NodeSettings, split_block};
use crate::scope::Scope;
use crate::sensors::enclosure;
use crate::sensors::stuck::StuckWatch;
use crate::store::{LoadError, Store};
use crate::supervisor::{self, CanState, ParameterSource, Supervisor};
use compensator_core::can::JointKind;
use embedded_storage::nor_flash::NorFlash;
use heapless::{Deque, String};

impl<F: NorFlash> Device<F> {
    /// Creates a device with default parameters, to be completed by [`Self::load`].
    pub(in crate::driver) fn with_defaults(
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
            program: ProgramState::default(),
            identity,
            errors: Deque::new(),
            last_panic: String::new(),
            run: 0,
            joint_kind: JointKind::default(),
            store: Store::open(flash),
            defaults,
            settings: defaults,
            supervisor: Supervisor::default(),
            outbox: Outbox::default(),
            sends_fd: false,
            hil: HilJoint::without_model(defaults.node, defaults.hil_setup()),
            hil_armed: false,
            received: ReceivedInputs::default(),
            inputs: NOT_RECEIVED,
            reply: HilReply::NONE,
            report: LoopReport::default(),
            report_seen: true,
            can: CanState::Active,
            enclosure: enclosure::Readings::default(),
            scope: Scope::default(),
            blocking: 0,
            set_number: 0,
            gate_resets: 0,
            home: Home::default(),
            profile: Profile::default(),
            brake: HoldingBrake::default(),
            braked_load: None,
            held_rad: None,
            stop: None,
            shorts_low_sides: false,
            commissioning: commissioning::Run::default(),
            over: OverCompensationWatch::default(),
            covariates: Covariates::MISSING,
            radial_force_watch: StuckWatch::default(),
            pressure_watch: StuckWatch::default(),
            compensation_left: 1.0,
            position: Default::default(),
            velocity: VelocityLoop::default(),
            velocity_gains: VelocityGains::default(),
            velocity_command: VelocityCommand::default(),
            motor_watch: MotorWatch::default(),
            motor_state: MotorState::default(),
            measured_wiring: None,
            target_us: 0,
            drive_counter: 0,
            pdos: Pdos::new(defaults.node),
            lss: Lss::default(),
            lock: Lock::default(),
            is_blank: false,
            is_stored: false,
            now_us,
        }
    }

    /// Loads settings and parameters from the store and records how the previous run ended.
    #[inline(never)]
    pub(in crate::driver) fn load(&mut self, boot: &Boot) {
        if let Some(program) = boot.program {
            self.store.open_mirrored(program.store_slots(true), program.store_slots(false));
            self.program = ProgramState::new(self.store.flash_mut(), program, self.now_us);
        }
        let mut parameters = self.load_block();
        if !self.build_hil() {
            parameters = ParameterSource::DefaultRefused;
        }
        self.is_blank = parameters == ParameterSource::Default;
        let set = self.staging.active();
        self.supervisor.start(
            &set.thresholds,
            &supervisor::SupervisorBoot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store: self.store.health(),
                parameters,
                commissioned: self.is_commissioned(),
                self_test_passed: boot.self_test_passed,
            },
        );
        self.watch = watch(&set.watch, &self.settings);
        self.network = LiveNetwork::of(set, &self.settings);
        self.last_panic = truncated(boot.panic.unwrap_or_default());
        self.pdos.set_node(self.settings.node);
    }

    /// Loads settings and parameters; the defaults stay if no block is stored or if it is refused.
    // Not inlined: its stack is free again when the rest of the start needs as much.
    #[inline(never)]
    fn load_block(&mut self) -> ParameterSource {
        let mut block = [0; MAX_BLOCK_BYTES];
        let length = match self.store.load(&mut block) {
            Ok(loaded) => loaded.length,
            Err(LoadError::Empty | LoadError::Damaged) => return ParameterSource::Default,
            // A set of another firmware is stored.
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                return ParameterSource::DefaultRefused;
            }
        };
        let block = block.get(..length).unwrap_or_default();
        let loaded = split_block(block).and_then(|(settings, set)| {
            self.staging.load(set).map_err(BlockError::Set)?;
            Ok(settings)
        });
        match loaded {
            Ok(settings) => {
                self.settings = settings;
                ParameterSource::Set
            }
            Err(error) => {
                self.staging.refuse(Abort::Value, error);
                ParameterSource::DefaultRefused
            }
        }
    }

    /// Builds the joint in HIL. Returns false if the set cannot be built for its period; there is no model then.
    #[inline(never)]
    fn build_hil(&mut self) -> bool {
        let (node, setup) = (self.settings.node, self.settings.hil_setup());
        let set = self.staging.active();
        let built = HilJoint::build(node, &set.friction, set.network.as_ref(), setup);
        let is_built = built.is_ok();
        self.hil = built.unwrap_or_else(|_refused| HilJoint::without_model(node, setup));
        is_built
    }
}

/// Returns a text, truncated to the size of the string.
fn truncated<const N: usize>(text: &str) -> String<N> {
    let mut string = String::new();
    for letter in text.chars() {
        if string.push(letter).is_err() {
            break;
        }
    }
    string
}
