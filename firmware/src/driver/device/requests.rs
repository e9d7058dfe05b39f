//! What a tool may ask of a driver, and what it answers where that cannot be.

use super::network::LiveNetwork;
use super::{Device, Home, watch};
use crate::hil::HilJoint;
use crate::node::sdo::Abort;
use crate::node_settings::{NodeSettings, Source, emit_block};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{self, Code, InUse};
use compensator_core::parameters::Digits;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// A request to the state machine: 0 disarm, 1 arm, 2 clear faults.
    pub(in crate::driver) fn request(&mut self, request: u8) -> Result<(), Abort> {
        match request {
            0 => {
                self.disarm();
                Ok(())
            }
            1 => self.arm(),
            2 => self.supervisor.clear_faults().map_err(|left| {
                self.blocking = left.fault_bits();
                if left.contains(Code::GateDriverFault) {
                    // It may hold its fault until it has slept, and the bridge is off: asked again, it is gone.
                    self.gate_resets = self.gate_resets.wrapping_add(1);
                    let why = format_args!("{} (its driver was reset: ask again)", Still(left));
                    return self.staging.refuse(Abort::State, why);
                }
                self.staging.refuse(Abort::State, Still(left))
            }),
            _ => Err(self.staging.refuse(
                Abort::Value,
                format_args!(
                    "request = {request}: must be 0 (disarm), 1 (arm) or 2 (clear faults)"
                ),
            )),
        }
    }

    /// Somebody knows where the joint is, rad: at rest at a stop, or from a sensor behind the gear.
    pub(in crate::driver) fn set_position(&mut self, position_rad: f32) -> Result<(), Abort> {
        if self.settings.source == Source::Bus {
            let why =
                "set_position_rad: the position of a joint fed by the bus comes with its frames";
            return Err(self.staging.refuse(Abort::State, why));
        }
        if !position_rad.is_finite() {
            let why = format_args!(
                "set_position_rad = {}: must be a finite number",
                Digits(position_rad.into())
            );
            return Err(self.staging.refuse(Abort::Value, why));
        }
        self.home = Home { position_rad, number: self.home.number.wrapping_add(1) };
        Ok(())
    }

    fn arm(&mut self) -> Result<(), Abort> {
        if self.commissions() {
            let why =
                "the joint commissions itself: wait until it has ended, or stop it (200Ch:1 = 0)";
            return Err(self.staging.refuse(Abort::State, why));
        }
        if self.settings.source == Source::Sensors {
            self.begin_velocity(self.set().motor.acceleration_max_rad_s2);
            return self.supervisor.arm(self.now_us).map_err(|refusal| {
                self.blocking = refusal.causes.fault_bits();
                self.staging.refuse(Abort::State, refusal)
            });
        }
        // A joint in HIL drives nothing: no set-point and no bus voltage is needed, but no fault either.
        let causes = self.in_the_way();
        if !causes.is_empty() {
            self.blocking = causes.fault_bits();
            return Err(self.staging.refuse(Abort::State, Still(causes)));
        }
        self.hil_armed = true;
        self.hil.set_enabled(true);
        Ok(())
    }

    /// What stops a joint in HIL: faults, and a master that has gone.
    pub(super) fn in_the_way(&self) -> supervisor::CodeSet {
        let mut causes = self.supervisor.faults();
        if self.supervisor.causes().contains(Code::HeartbeatLost) {
            causes.insert(Code::HeartbeatLost);
        }
        causes
    }

    /// Makes the staged set the active one, all at once.
    pub(in crate::driver) fn commit(&mut self, meant: u32) -> Result<(), Abort> {
        let set = self.staging.committed(meant)?;
        let network = set.network.as_ref();
        let setup = self.settings.hil_setup();
        let hil = HilJoint::build(self.settings.node, &set.friction, network, setup);
        let hil = hil.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        set.builds().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        let thresholds = self.supervisor.configure(&set.thresholds);
        thresholds.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.hil = hil;
        self.watch = watch(&set.watch, &self.settings);
        self.network = LiveNetwork::of(&set, &self.settings);
        self.staging.activate(set);
        self.forget_over_compensation();
        self.supervisor.parameters(InUse::Set);
        self.see_to_commissioned();
        self.set_number = self.set_number.wrapping_add(1);
        Ok(())
    }

    /// Somebody has seen that the joint is wired as its parameters say: those of this CRC, and no others.
    pub(in crate::driver) fn commission(&mut self, seen: u32) -> Result<(), Abort> {
        let wiring = self.staging.active().wiring_crc();
        if seen != wiring {
            let why = format_args!(
                "confirm = {seen:08x}: the wiring in use has the crc {wiring:08x}, and only that can be confirmed"
            );
            return Err(self.staging.refuse(Abort::Value, why));
        }
        self.settings.commissioned = seen;
        self.see_to_commissioned();
        Ok(())
    }

    pub(in crate::driver) fn is_commissioned(&self) -> bool {
        self.settings.commissioned == self.staging.active().wiring_crc()
    }

    fn see_to_commissioned(&mut self) {
        let confirmed = self.is_commissioned();
        self.supervisor.commissioned(confirmed);
    }

    /// Takes other settings; the node's number counts from the next start.
    pub(in crate::driver) fn set_settings(&mut self, settings: NodeSettings) -> Result<(), Abort> {
        let set = self.staging.active();
        let watch = watch(&set.watch, &settings);
        let (network, setup) = (set.network.as_ref(), settings.hil_setup());
        let live = LiveNetwork::of(set, &settings);
        let hil = HilJoint::build(self.settings.node, &set.friction, network, setup);
        self.hil = hil.map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.watch = watch;
        self.network = live;
        self.settings = settings;
        self.live.forget_command();
        Ok(())
    }

    /// Stores settings and the active set.
    pub(in crate::driver) fn save(&mut self) -> Result<(), Abort> {
        let block = emit_block(&self.settings, self.staging.active());
        self.write_block(&block)
    }

    /// Stores the defaults; they count from the next start, as CiA 301 has it.
    pub(in crate::driver) fn restore_defaults(&mut self) -> Result<(), Abort> {
        self.write_block(&emit_block(&self.defaults, &ParameterSet::default()))
    }

    fn write_block(&mut self, block: &[u8]) -> Result<(), Abort> {
        let saved = self.store.save(block);
        self.supervisor.store(self.store.health());
        match saved {
            Ok(_) => Ok(()),
            Err(error) => Err(self.staging.refuse(Abort::Hardware, error)),
        }
    }
}

/// Faults that stand in the way, by name.
struct Still(supervisor::CodeSet);

impl core::fmt::Display for Still {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("still there:")?;
        self.0.iter().try_for_each(|code: Code| write!(f, " {}", code.info().name))
    }
}
