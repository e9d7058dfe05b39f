//! How a device begins: what the flash holds, or the defaults, and what the last life ended with.

use super::network::LiveNetwork;
use super::pdos::TRANSMIT_PDOS;
use super::{Boot, Device, Identity, NOT_RECEIVED, commissioning, watch};
use crate::control::velocity_loop::{VelocityGains, VelocityLoop, VelocityOrder};
use crate::driver::counters::Counters;
use crate::driver::live::{Home, Live, LoopReport};
use crate::driver::motor_watch::{MotorSight, MotorWatch};
use crate::driver::over_compensation::OverCompensation;
use crate::driver::profile::Profile;
use crate::driver::staging::Staging;
use crate::hil::{HilJoint, Reply};
use crate::node::Outbox;
use crate::node::sdo::Abort;
use crate::node_settings::{BLOCK_LENGTH, NodeSettings, parse_block};
use crate::parameter_set::ParameterSet;
use crate::sensors::stuck::StuckWatch;
use crate::store::{LoadError, Store};
use crate::supervisor::{self, CanState, InUse, Supervisor};
use compensator_core::can::JointKind;
use embedded_storage::nor_flash::NorFlash;
use heapless::{Deque, String};

impl<F: NorFlash> Device<F> {
    pub(in crate::driver) fn boot(
        defaults: NodeSettings,
        flash: F,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let mut store = Store::open(flash);
        let mut block = [0; BLOCK_LENGTH];
        let loaded = store.load(&mut block).map(|loaded| loaded.length);
        let fresh = || (defaults, ParameterSet::default());
        let mut why = None;
        let ((settings, set), parameters) = match loaded {
            Ok(length) => match parse_block(block.get(..length).unwrap_or_default()) {
                Ok(both) => (both, InUse::Set),
                Err(error) => {
                    why = Some(error);
                    (fresh(), InUse::DefaultRefused)
                }
            },
            Err(LoadError::Empty | LoadError::Damaged) => (fresh(), InUse::Default),
            // There is a set, of another firmware.
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                (fresh(), InUse::DefaultRefused)
            }
        };
        // A stored set that cannot be built for its period is as good as refused.
        let setup = settings.hil_setup();
        let network = set.network.as_ref();
        let (hil, parameters) = match HilJoint::build(settings.node, &set.friction, network, setup)
        {
            Ok(hil) => (hil, parameters),
            Err(_) => (HilJoint::without_model(settings.node, setup), InUse::DefaultRefused),
        };
        let supervisor = Supervisor::boot(
            &set.thresholds,
            &supervisor::Boot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store: store.health(),
                parameters,
                commissioned: settings.commissioned == set.wiring_crc(),
                self_test_passed: boot.self_test_passed,
            },
        );
        let mut last_panic = String::new();
        for letter in boot.panic.unwrap_or_default().chars() {
            if last_panic.push(letter).is_err() {
                break;
            }
        }
        let mut device = Self {
            counters: Counters::default(),
            watch: watch(&set.watch, &settings),
            network: LiveNetwork::of(&set, &settings),
            staging: Staging::new(set),
            identity,
            errors: Deque::new(),
            last_panic,
            run: 0,
            joint_kind: JointKind::default(),
            store,
            defaults,
            settings,
            supervisor,
            outbox: Outbox::default(),
            hil,
            hil_armed: false,
            live: Live::default(),
            inputs: NOT_RECEIVED,
            reply: Reply::NONE,
            report: LoopReport::default(),
            report_seen: true,
            can: CanState::Active,
            blocking: 0,
            set_number: 0,
            gate_resets: 0,
            home: Home::default(),
            profile: Profile::default(),
            commissioning: commissioning::Run::default(),
            over: OverCompensation::default(),
            radial_force_watch: StuckWatch::default(),
            pressure_watch: StuckWatch::default(),
            compensation_left: 1.0,
            velocity: VelocityLoop::default(),
            velocity_gains: VelocityGains::default(),
            velocity_order: VelocityOrder::default(),
            motor_watch: MotorWatch::default(),
            motor_sight: MotorSight::default(),
            drive_counter: 0,
            identifiers: [None; TRANSMIT_PDOS],
            now_us,
        };
        if let Some(error) = why {
            device.staging.refuse(Abort::Value, error);
        }
        device
    }
}
