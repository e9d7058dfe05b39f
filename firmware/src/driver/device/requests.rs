//! Requests of a tool to a driver, and their refusals.

use super::Device;
use super::network::LiveNetwork;
use crate::driver::motion::Motion;
use crate::hil::HilJoint;
use crate::joint_node::larger_than_stored;
use crate::node::sdo::Abort;
use crate::node_settings::{NodeSettings, emit_block};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{self, Code};
use compensator_core::refusal;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Executes a request to the state machine: 0 disarm, 1 arm, 2 clear faults.
    pub(crate) fn request(&mut self, request: u8) -> Result<(), Abort> {
        match request {
            0 => {
                self.disarm_by_master();
                Ok(())
            }
            1 => self.arm(),
            2 => self.clear_faults(),
            _ => Err(self.base.refuse_request(request)),
        }
    }

    /// Disarms the joint, and opens its low sides.
    pub(super) fn disarm_by_master(&mut self) {
        self.motion.stopping.shorts_low_sides = false;
        self.disarm();
    }

    /// Clears the faults whose causes have ended, once the joint has stopped.
    pub(super) fn clear_faults(&mut self) -> Result<(), Abort> {
        if self.base.supervisor.is_stopping() {
            let why = text!("the joint still stops: wait until it stands");
            return Err(self.base.refuse(Abort::State, why));
        }
        self.base.clear_faults()
    }

    /// Sets the joint position, rad: known at rest at a stop, or from a sensor behind the gear.
    pub(crate) fn set_position(&mut self, position_rad: f32) -> Result<(), Abort> {
        if self.base.settings.is_in_hil() {
            let why = text!("set_position_rad: a joint in HIL receives its position over the bus");
            return Err(self.base.refuse(Abort::State, why));
        }
        self.base.set_position(position_rad)?;
        self.begin_home(None);
        self.outdate_stored_home();
        Ok(())
    }

    /// Arms the joint, on its own sensors or in HIL.
    pub(super) fn arm(&mut self) -> Result<(), Abort> {
        self.finish_trial();
        if self.motion.is_commissioning() {
            let why = text!(
                "commissioning is running: wait until it has ended, or stop it (200Ch:1 = 0)"
            );
            return Err(self.base.refuse(Abort::State, why));
        }
        if self.motion.brake_test.is_running() {
            let why = text!("the brake is being tested: wait until 2030h:12 is not 1");
            return Err(self.base.refuse(Abort::State, why));
        }
        if let Some(why) = self.update_blocks_arming() {
            return Err(self.base.refuse(Abort::State, why));
        }
        if !self.base.settings.is_in_hil() {
            let is_test_due = self.motion.is_brake_test_due(&self.base);
            if !is_test_due {
                self.move_by(Motion::begin_driving);
            }
            return self.base.arm().map(|()| {
                if is_test_due {
                    self.motion.begin_brake_test(false);
                }
            });
        }
        // A joint in HIL drives nothing: it needs no set-point and no bus voltage, but must have no fault.
        let causes = self.hil_blocking_codes();
        if !causes.is_empty() {
            return Err(self.base.refuse_blocked(causes));
        }
        self.arm_hil(true);
        Ok(())
    }

    /// Returns the codes that stop a joint in HIL: faults, and a lost master.
    pub(super) fn hil_blocking_codes(&self) -> supervisor::CodeSet {
        let mut causes = self.base.supervisor.faults();
        if self.base.supervisor.causes().contains(Code::HeartbeatLost) {
            causes.insert(Code::HeartbeatLost);
        }
        causes
    }

    /// Makes the staged set the active one.
    pub(crate) fn commit(&mut self, meant: u32) -> Result<(), Abort> {
        self.base.staging.validate_commit(meant)?;
        // More friction than the joint has drives it, and no watch bounds that in every motion.
        if !self.is_service()
            && let Some(larger) =
                larger_than_stored(&mut self.memory.store, self.base.staging.staged())
        {
            let why = refusal!("{name}: larger than stored, which needs the service level", larger);
            return Err(self.base.refuse(Abort::Locked, why));
        }
        let hil = {
            let set = self.base.staging.staged();
            let (network, setup) = (set.network.as_ref(), self.base.settings.hil_setup());
            HilJoint::build(self.base.settings.node, &set.friction, network, setup)
        };
        let hil = hil.map_err(|error| self.base.refuse(Abort::Value, error))?;
        let set = self.base.staging.staged();
        if self.base.settings.drive.has_short() && !set.motor.is_short_bounded() {
            let why = text!(
                "overcurrent_a: the shorted motor would exceed it, and a reaction to a stop is -1 (605Ah to 605Eh)"
            );
            return Err(self.base.refuse(Abort::Value, why));
        }
        let buildable = set.check_buildable();
        buildable.map_err(|error| self.base.refuse(Abort::Value, error))?;
        self.base.accept_staged()?;
        self.samples.set_hil(hil);
        self.base.activate_staged();
        self.follow_set();
        Ok(())
    }

    /// Makes all but the supervisor's thresholds and the joint in HIL follow the set that became active.
    pub(super) fn follow_set(&mut self) {
        self.base.follow_set();
        self.network = LiveNetwork::of(self.base.set(), &self.base.settings);
        self.restart_adaptation();
    }

    /// Applies other settings; a new node number is used from the next start.
    pub(crate) fn set_settings(&mut self, settings: NodeSettings) -> Result<(), Abort> {
        let set = self.base.set();
        let watch = self.base.watch_of(&settings);
        let (network, setup) = (set.network.as_ref(), settings.hil_setup());
        let live = LiveNetwork::of(set, &settings);
        let hil = HilJoint::build(self.base.settings.node, &set.friction, network, setup);
        self.samples.set_hil(hil.map_err(|error| self.base.refuse(Abort::Value, error))?);
        self.base.watch = watch;
        self.network = live;
        let is_resampled = (self.base.settings.source, self.base.settings.period_s)
            != (settings.source, settings.period_s);
        self.base.settings = settings;
        if is_resampled {
            self.restart_adaptation();
        }
        self.forget_command();
        Ok(())
    }

    /// Stores settings and the active set. The caller has checked that they may be saved: a trial ends by its own order.
    pub(crate) fn save(&mut self) -> Result<(), Abort> {
        let settings = self.base.settings;
        let block = emit_block(&settings, self.base.set());
        self.write_block(&block, &settings)?;
        self.memory.is_stored = true;
        Ok(())
    }

    /// Stores the defaults; they apply from the next start, as in CiA 301. Key and policy stay: they change by proof only.
    pub(crate) fn restore_defaults(&mut self) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        let settings = NodeSettings { access: self.base.settings.access, ..self.memory.defaults };
        self.write_block(&emit_block(&settings, &ParameterSet::default()), &settings)
    }

    /// Stores a block that has these settings.
    fn write_block(&mut self, block: &[u8], settings: &NodeSettings) -> Result<(), Abort> {
        let saved = self.memory.save(block, &settings.identity());
        self.base.supervisor.set_store_health(self.memory.store.health());
        saved.map(drop).map_err(|error| self.base.refuse(Abort::Hardware, error))
    }
}
