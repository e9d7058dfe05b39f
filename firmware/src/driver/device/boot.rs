//! Start of a device: from the flash or the defaults, with the result of the previous run.

use super::network::LiveNetwork;
use super::pdos::Pdos;
use super::program::ProgramState;
use super::{Boot, Device, Identity, NOT_RECEIVED, commissioning, watch};
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
use crate::node_settings::{BlockError, MAX_BLOCK_BYTES, NodeSettings, parse_block};
use crate::parameter_set::ParameterSet;
use crate::scope::Scope;
use crate::sensors::enclosure;
use crate::sensors::stuck::StuckWatch;
use crate::store::{LoadError, Store, mirror};
use crate::supervisor::{self, CanState, ParameterSource, Supervisor};
use compensator_core::can::JointKind;
use embedded_storage::nor_flash::NorFlash;
use heapless::{Deque, String};

impl<F: NorFlash> Device<F> {
    #[inline]
    pub(in crate::driver) fn boot(
        defaults: NodeSettings,
        flash: F,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let mut store = match &boot.program {
            Some(program) => {
                mirror::open(flash, program.store_slots(true), program.store_slots(false))
            }
            None => Store::open(flash),
        };
        let mut loaded = LoadedSet::load(&mut store, defaults);
        let hil = loaded.build_hil();
        Self::assemble(store, loaded, hil, defaults, identity, boot, now_us)
    }

    // Not inlined, so that its stack is not needed while the set is loaded.
    #[inline(never)]
    fn assemble(
        mut store: Store<F>,
        loaded: LoadedSet,
        hil: HilJoint,
        defaults: NodeSettings,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let LoadedSet { settings, set, parameters, refusal } = loaded;
        let is_blank = parameters == ParameterSource::Default;
        let supervisor = Supervisor::boot(
            &set.thresholds,
            &supervisor::SupervisorBoot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store: store.health(),
                parameters,
                commissioned: settings.commissioned == set.wiring_crc(),
                self_test_passed: boot.self_test_passed,
            },
        );
        let (watch, network) = (watch(&set.watch, &settings), LiveNetwork::of(&set, &settings));
        let mut staging = Staging::new(set);
        if let Some(error) = refusal {
            staging.refuse(Abort::Value, error);
        }
        let program = ProgramState::new(&mut store, boot.program, now_us);
        // The value of the function, not a local one, which would be another 14 KB of stack.
        Self {
            counters: Counters::default(),
            watch,
            network,
            program,
            staging,
            identity,
            errors: Deque::new(),
            last_panic: truncated(boot.panic.unwrap_or_default()),
            run: 0,
            joint_kind: JointKind::default(),
            store,
            defaults,
            settings,
            supervisor,
            outbox: Outbox::default(),
            hil,
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
            pdos: Pdos::new(settings.node),
            lss: Lss::default(),
            is_blank,
            is_stored: false,
            now_us,
        }
    }
}

/// Settings and parameters at the start.
struct LoadedSet {
    settings: NodeSettings,
    set: ParameterSet,
    parameters: ParameterSource,
    /// Why the stored block was refused.
    refusal: Option<BlockError>,
}

impl LoadedSet {
    /// Loads settings and parameters from the store; the defaults replace a block that is missing or refused.
    // Not inlined: its 20 KB of stack are free again when the rest of the start needs as much.
    #[inline(never)]
    fn load<F: NorFlash>(store: &mut Store<F>, defaults: NodeSettings) -> Self {
        let mut block = [0; MAX_BLOCK_BYTES];
        let default = |parameters, refusal| Self {
            settings: defaults,
            set: ParameterSet::default(),
            parameters,
            refusal,
        };
        match store.load(&mut block).map(|loaded| loaded.length) {
            Ok(length) => match parse_block(block.get(..length).unwrap_or_default()) {
                Ok((settings, set)) => {
                    Self { settings, set, parameters: ParameterSource::Set, refusal: None }
                }
                Err(error) => default(ParameterSource::DefaultRefused, Some(error)),
            },
            Err(LoadError::Empty | LoadError::Damaged) => default(ParameterSource::Default, None),
            // A set of another firmware is stored.
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                default(ParameterSource::DefaultRefused, None)
            }
        }
    }
}

impl LoadedSet {
    /// Builds the joint in HIL. A stored set that cannot be built for its period counts as refused.
    #[inline(never)]
    fn build_hil(&mut self) -> HilJoint {
        let (node, setup) = (self.settings.node, self.settings.hil_setup());
        let network = self.set.network.as_ref();
        HilJoint::build(node, &self.set.friction, network, setup).unwrap_or_else(|_refused| {
            self.parameters = ParameterSource::DefaultRefused;
            HilJoint::without_model(node, setup)
        })
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
