//! Requests of a tool to a driver, and their refusals.

use super::network::LiveNetwork;
use super::{Device, watch};
use crate::control::PERIOD_S;
use crate::driver::motion::Motion;
use crate::hil::HilJoint;
use crate::loop_parts::LoopParts;
use crate::node::sdo::Abort;
use crate::node_settings::{InputSource, NodeSettings, emit_block};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{self, Code, ParameterSource};
use compensator_core::refusal;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Executes a request to the state machine: 0 disarm, 1 arm, 2 clear faults.
    pub(in crate::driver) fn request(&mut self, request: u8) -> Result<(), Abort> {
        match request {
            0 => {
                self.motion.stopping.open_low_sides();
                self.disarm();
                Ok(())
            }
            1 => self.arm(),
            2 if self.supervisor.is_stopping() => Err(self
                .staging
                .refuse(Abort::State, text!("the joint still stops: wait until it stands"))),
            2 => self.supervisor.clear_faults().map_err(|left| {
                self.blocking = left.fault_bits();
                if left.contains(Code::GateDriverFault) {
                    // The gate driver may latch its fault until it has slept, and the bridge is off. The next
                    // request succeeds.
                    self.current_loop.reset_gate_driver();
                    let why = refusal!(
                        "still present:{faults}{limits} (its driver was reset: ask again)",
                        left.fault_bits(),
                        left.limit_bits()
                    );
                    return self.staging.refuse(Abort::State, why);
                }
                self.staging.refuse(Abort::State, self.supervisor.remaining(left))
            }),
            _ => Err(self.staging.refuse_request(request)),
        }
    }

    /// Sets the joint position, rad: known at rest at a stop, or from a sensor behind the gear.
    pub(in crate::driver) fn set_position(&mut self, position_rad: f32) -> Result<(), Abort> {
        if self.settings.source == InputSource::Bus {
            let why = text!("set_position_rad: a joint in HIL receives its position over the bus");
            return Err(self.staging.refuse(Abort::State, why));
        }
        if !position_rad.is_finite() {
            let why = refusal!("set_position_rad = {f32}: must be a finite number", position_rad);
            return Err(self.staging.refuse(Abort::Value, why));
        }
        self.begin_home(None);
        self.outdate_stored_home();
        self.current_loop.set_home(position_rad);
        Ok(())
    }

    fn arm(&mut self) -> Result<(), Abort> {
        self.finish_trial();
        if self.motion.is_commissioning() {
            let why = text!(
                "commissioning is running: wait until it has ended, or stop it (200Ch:1 = 0)"
            );
            return Err(self.staging.refuse(Abort::State, why));
        }
        if self.motion.brake_test.is_running() {
            let why = text!("the brake is being tested: wait until 2030h:12 is not 1");
            return Err(self.staging.refuse(Abort::State, why));
        }
        if let Some(why) = self.update_blocks_arming() {
            return Err(self.staging.refuse(Abort::State, why));
        }
        if self.settings.source == InputSource::Sensors {
            let is_test_due = self.motion.is_brake_test_due(&self.seen());
            if !is_test_due {
                self.move_by(Motion::begin_driving);
            }
            return self.arm_supervisor().map(|()| {
                if is_test_due {
                    self.motion.begin_brake_test(false);
                }
            });
        }
        // A joint in HIL drives nothing: it needs no set-point and no bus voltage, but must have no fault.
        let causes = self.hil_blocking_codes();
        if !causes.is_empty() {
            self.blocking = causes.fault_bits();
            return Err(self.staging.refuse(Abort::State, self.supervisor.remaining(causes)));
        }
        self.samples.arm_hil(true);
        Ok(())
    }

    /// Arms the joint on its own sensors.
    pub(super) fn arm_supervisor(&mut self) -> Result<(), Abort> {
        self.check_start()?;
        self.supervisor.arm(self.now_us).map_err(|refusal| {
            self.blocking = refusal.causes.fault_bits();
            self.staging.refuse(Abort::State, refusal)
        })
    }

    /// Checks that the board can drive with the set in use, which needs no restart.
    pub(super) fn check_start(&mut self) -> Result<(), Abort> {
        self.start
            .check(self.staging.active())
            .map_err(|why| self.staging.refuse(Abort::State, why))
    }

    /// Returns the codes that stop a joint in HIL: faults, and a lost master.
    pub(super) fn hil_blocking_codes(&self) -> supervisor::CodeSet {
        let mut causes = self.supervisor.faults();
        if self.supervisor.causes().contains(Code::HeartbeatLost) {
            causes.insert(Code::HeartbeatLost);
        }
        causes
    }

    /// Makes the staged set the active one.
    pub(in crate::driver) fn commit(&mut self, meant: u32) -> Result<(), Abort> {
        self.staging.validate_commit(meant)?;
        // More friction than the joint has drives it, and no watch bounds that in every motion.
        if !self.is_service()
            && let Some(larger) = self.memory.larger_than_stored(self.staging.staged())
        {
            let why = refusal!("{name}: larger than stored, which needs the service level", larger);
            return Err(self.staging.refuse(Abort::Locked, why));
        }
        let hil = {
            let set = self.staging.staged();
            let (network, setup) = (set.network.as_ref(), self.settings.hil_setup());
            HilJoint::build(self.settings.node, &set.friction, network, setup)
        };
        let hil = hil.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        let set = self.staging.staged();
        if self.settings.drive.has_short() && !set.motor.is_short_bounded() {
            let why = text!(
                "overcurrent_a: the shorted motor would exceed it, and a reaction to a stop is -1 (605Ah to 605Eh)"
            );
            return Err(self.staging.refuse(Abort::Value, why));
        }
        let buildable = set.check_buildable();
        // The loop receives the same parts after the commit.
        let buildable =
            buildable.and_then(|()| LoopParts::build(set, self.identity.stage, PERIOD_S).map(drop));
        let accepted = buildable.and_then(|()| self.supervisor.configure(&set.thresholds));
        accepted.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.samples.set_hil(hil);
        self.staging.activate();
        self.supervisor.set_parameter_source(ParameterSource::Set);
        self.follow_set();
        Ok(())
    }

    /// Makes all but the supervisor's thresholds and the joint in HIL follow the set that became active.
    pub(super) fn follow_set(&mut self) {
        // A proof belongs to the wiring that turned the joint.
        self.motor.forget_travel();
        self.start.set_refused(None);
        let set = self.staging.active();
        self.watch = watch(&set.watch, &self.settings);
        self.network = LiveNetwork::of(set, &self.settings);
        self.compensation.reset();
        self.restart_adaptation();
        let is_commissioned = self.is_commissioned();
        self.supervisor.set_commissioned(is_commissioned);
        self.current_loop.take_set();
    }

    /// Confirms that the joint is wired as its parameters say; `seen` is the CRC of these wiring parameters.
    pub(in crate::driver) fn commission(&mut self, seen: u32) -> Result<(), Abort> {
        self.staging.check_wiring(seen)?;
        self.settings.commissioned = seen;
        // A measurement turned the motor. Without it, the wiring may have been changed before the confirmation.
        let is_measured =
            self.motor.has_measured(seen) && self.start.is_in_use(self.staging.active());
        self.settings.proven = if is_measured { seen } else { 0 };
        self.supervisor.set_commissioned(true);
        Ok(())
    }

    pub(in crate::driver) fn is_commissioned(&self) -> bool {
        self.settings.commissioned == self.staging.wiring_crc()
    }

    /// Returns true if the motor was seen to turn by its current with the wiring in use.
    pub(in crate::driver) fn is_wiring_proven(&self) -> bool {
        self.settings.proven == self.staging.wiring_crc()
    }

    /// Applies other settings; a new node number is used from the next start.
    pub(in crate::driver) fn set_settings(&mut self, settings: NodeSettings) -> Result<(), Abort> {
        let set = self.staging.active();
        let watch = watch(&set.watch, &settings);
        let (network, setup) = (set.network.as_ref(), settings.hil_setup());
        let live = LiveNetwork::of(set, &settings);
        let hil = HilJoint::build(self.settings.node, &set.friction, network, setup);
        self.samples.set_hil(hil.map_err(|error| self.staging.refuse(Abort::Value, error))?);
        self.watch = watch;
        self.network = live;
        let is_resampled =
            (self.settings.source, self.settings.period_s) != (settings.source, settings.period_s);
        self.settings = settings;
        if is_resampled {
            self.restart_adaptation();
        }
        self.forget_command();
        Ok(())
    }

    /// Sets the period of the heartbeat, ms; 0 disables it. Nothing else depends on it, so that an armed joint may
    /// have another one.
    pub(in crate::driver) fn set_heartbeat(&mut self, period_ms: u16) {
        self.settings.heartbeat_ms = period_ms;
    }

    /// Stores settings and the active set. The caller has checked that they may be saved: a trial ends by its own order.
    pub(in crate::driver) fn save(&mut self) -> Result<(), Abort> {
        let settings = self.settings;
        let block = emit_block(&settings, self.staging.active());
        self.write_block(&block, &settings)?;
        self.memory.mark_stored();
        Ok(())
    }

    /// Stores the defaults; they apply from the next start, as in CiA 301. Key and policy stay: they change by proof only.
    pub(in crate::driver) fn restore_defaults(&mut self) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        let settings = NodeSettings { access: self.settings.access, ..*self.memory.defaults() };
        self.write_block(&emit_block(&settings, &ParameterSet::default()), &settings)
    }

    /// Stores a block that has these settings.
    fn write_block(&mut self, block: &[u8], settings: &NodeSettings) -> Result<(), Abort> {
        let saved = self.memory.save(block, &settings.identity());
        self.supervisor.set_store_health(self.memory.store().health());
        match saved {
            Ok(_) => Ok(()),
            Err(error) => Err(self.staging.refuse(Abort::Hardware, error)),
        }
    }
}
