//! The device behind the bus: what the objects stand for.

mod boot;
mod commissioning;
mod drive;
mod network;
mod pdos;
mod requests;
mod share;
mod values;
mod velocity;

pub(super) use pdos::PDO_UNUSED;

use super::commissioning::Reason;
use super::counters::{Counters, count};
use super::live::{CommandSequence, Home, Live, LoopOrders, LoopReport};
use super::motor_watch::{MotorSight, MotorWatch};
use super::over_compensation::OverCompensation;
use super::profile::Profile;
use super::staging::Staging;
use crate::control::Covariates;
use crate::control::velocity_loop::{VelocityGains, VelocityLoop, VelocityOrder};
use crate::hil::{HilJoint, Reply, Step};
use crate::log::log;
use crate::node::Outbox;
use crate::node::dictionary::ERRORS_KEPT;
use crate::node::dictionary::records::{self, Inputs};
use crate::node_settings::{NodeSettings, Source};
use crate::parameter_set::ParameterSet;
use crate::sensors::stuck::StuckWatch;
use crate::store::Store;
use crate::supervisor::{CanState, Code, Observation, ResetCause, State, Supervisor};
use crate::watch::{Watch, WatchParameters};
use compensator_core::can::{
    Answer, Command, Entry, Frame, JointKind, Message, Motion, Node, Seal, Status, Surroundings,
    Sync, Telemetry, Torque,
};
use embedded_storage::nor_flash::NorFlash;
use heapless::{Deque, String};
use network::LiveNetwork;
use pdos::TRANSMIT_PDOS;

/// Time between two reports of the current loop, s.
pub const REPORT_PERIOD_S: f32 = 1e-3;

/// Longest text of a panic that is kept, bytes.
pub const PANIC_TEXT: usize = 160;

/// Who a driver is.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// The board, in words.
    pub hardware: &'static str,
    /// Number of this very board.
    pub serial: u32,
}

impl Identity {
    /// As an object of the dictionary.
    pub fn object(&self) -> records::Identity {
        records::Identity {
            // No number was bought.
            vendor_id: 0,
            product_code: u32::from_be_bytes(*b"FRIC"),
            revision_number: compensator_core::record::VERSION.into(),
            serial_number: self.serial,
        }
    }
}

/// How the last life ended.
#[derive(Clone, Copy, Debug)]
pub struct Boot<'a> {
    /// Why there was a reset.
    pub cause: ResetCause,
    /// What a panic said before it.
    pub panic: Option<&'a str>,
    /// The guard below the stack was found overwritten.
    pub stack_overflowed: bool,
    /// The board's own tests at start passed.
    pub self_test_passed: bool,
}

impl Default for Boot<'_> {
    /// Power came, and all is well.
    fn default() -> Self {
        Self {
            cause: ResetCause::PowerOn,
            panic: None,
            stack_overflowed: false,
            self_test_passed: true,
        }
    }
}

/// All of a driver but its network state and its object server.
#[derive(Debug)]
pub struct Device<F> {
    pub(super) counters: Counters,
    pub(super) staging: Staging,
    pub(super) identity: Identity,
    /// The last errors, as object 1003h gives them; the newest last.
    pub(super) errors: Deque<u32, ERRORS_KEPT>,
    pub(super) last_panic: String<PANIC_TEXT>,
    pub(super) run: u32,
    pub(super) joint_kind: JointKind,
    store: Store<F>,
    /// What stands where nothing is stored.
    defaults: NodeSettings,
    settings: NodeSettings,
    supervisor: Supervisor,
    outbox: Outbox,
    hil: HilJoint,
    hil_armed: bool,
    live: Live,
    network: LiveNetwork,
    watch: Option<Watch>,
    inputs: Inputs,
    reply: Reply,
    report: LoopReport,
    /// A tick has looked at the report.
    report_seen: bool,
    can: CanState,
    blocking: u32,
    set_number: u32,
    gate_resets: u8,
    home: Home,
    pub(super) profile: Profile,
    commissioning: commissioning::Run,
    over: OverCompensation,
    radial_force_watch: StuckWatch,
    pressure_watch: StuckWatch,
    /// Share of the compensation that is left.
    compensation_left: f32,
    velocity: VelocityLoop,
    velocity_gains: VelocityGains,
    velocity_order: VelocityOrder,
    motor_watch: MotorWatch,
    motor_sight: MotorSight,
    /// Counts the commands that come of the profile.
    drive_counter: u8,
    /// Identifiers of transmit PDOs that a master has given; they last as long as the communication does.
    identifiers: [Option<u32>; TRANSMIT_PDOS],
    now_us: u64,
}

impl<F: NorFlash> Device<F> {
    pub(super) const fn settings(&self) -> &NodeSettings {
        &self.settings
    }

    pub(super) const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    pub(super) const fn set(&self) -> &ParameterSet {
        self.staging.active()
    }

    pub(super) fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    pub(super) fn flash(&self) -> &F {
        self.store.flash()
    }

    pub(super) fn into_flash(self) -> F {
        self.store.release()
    }

    /// Whether a joint is armed, on its own sensors or in HIL.
    pub(super) fn is_armed(&self) -> bool {
        self.supervisor.is_armed() || self.hil_armed
    }

    pub(super) fn set_time(&mut self, now_us: u64) {
        self.now_us = now_us;
    }

    /// Takes in a process frame, where it is for this node.
    pub(super) fn take(&mut self, message: &Message, frame: &Frame, node: Node, now_us: u64) {
        let inputs = &mut self.inputs;
        // One on its own sensors says these itself; it is told neither.
        let told = self.settings.source == Source::Bus;
        let places = match message {
            Message::Sync(sync) => {
                self.sign_of_life(now_us);
                return self.sync(*sync, node);
            }
            Message::Motion(of, _) if *of == node && told => {
                [&mut inputs.velocity_rad_s, &mut inputs.position_rad]
            }
            Message::Torque(of, _) if *of == node && told => {
                [&mut inputs.torque_nm, &mut inputs.load_torque_nm]
            }
            Message::Seal(of, _) if *of == node => {
                [&mut inputs.radial_force_n, &mut inputs.pressure_diff_pa]
            }
            Message::Surroundings(of, _) if *of == node => {
                [&mut inputs.temperature_c, &mut inputs.auxiliary]
            }
            Message::Command(of, _) if *of == node && !self.profile.is_on() => {
                [&mut inputs.command_current_a, &mut inputs.command_velocity_and_counter]
            }
            _ => return self.counters.count_foreign(),
        };
        for (place, word) in places.into_iter().zip(frame.data().as_chunks::<4>().0) {
            *place = u32::from_le_bytes(*word);
        }
        self.hear(message, now_us);
    }

    /// Takes in an input that was written as an object: as its frame would have brought it.
    pub(super) fn input(&mut self, sub_index: u8, word: u32) {
        let Some(words) = self.inputs.set(sub_index, word) else { return };
        let node = self.settings.node;
        let [first, second] = words.map(f32::from_bits);
        let message = match sub_index {
            Inputs::VELOCITY | Inputs::POSITION => {
                Message::Motion(node, Motion { velocity_rad_s: first, position_rad: second })
            }
            Inputs::TORQUE | Inputs::LOAD_TORQUE => {
                Message::Torque(node, Torque { torque_nm: first, load_torque_nm: second })
            }
            Inputs::RADIAL_FORCE | Inputs::PRESSURE_DIFF => {
                Message::Seal(node, Seal { radial_force_n: first, pressure_diff_pa: second })
            }
            Inputs::TEMPERATURE | Inputs::AUXILIARY => Message::Surroundings(
                node,
                Surroundings { temperature_c: first, auxiliary: second },
            ),
            _ => Message::Command(node, Command::from_words(words)),
        };
        self.hear(&message, self.now_us);
    }

    fn hear(&mut self, message: &Message, now_us: u64) {
        self.hil.take(message);
        match self.live.take(message, now_us) {
            Some(CommandSequence::New { lost }) => {
                count(&mut self.counters.command_lost, u32::from(lost));
                self.supervisor.command_received(now_us);
            }
            Some(CommandSequence::Duplicate) => count(&mut self.counters.command_duplicate, 1),
            Some(CommandSequence::Late) => count(&mut self.counters.command_late, 1),
            None => {}
        }
    }

    fn sync(&mut self, sync: Sync, node: Node) {
        let lost = match self.hil.sync(sync) {
            Step::Duplicate => return count(&mut self.counters.sync_duplicate, 1),
            Step::Late => return count(&mut self.counters.sync_late, 1),
            Step::Reply(reply, lost) => {
                if self.settings.source == Source::Bus {
                    self.reply = reply;
                }
                lost
            }
        };
        count(&mut self.counters.sync_lost, u32::from(lost));
        if self.settings.source == Source::Sensors {
            self.reply = self.measured_reply();
            // What the joint measured it says as a joint in HIL is given it: a log of a joint is a trace.
            self.send(Message::Motion(
                node,
                Motion {
                    velocity_rad_s: self.report.velocity_rad_s,
                    position_rad: self.report.position_rad,
                },
            ));
            let load_torque_nm = f32::from_bits(self.inputs.load_torque_nm);
            self.send(Message::Torque(
                node,
                Torque { torque_nm: self.report.motor_torque_nm, load_torque_nm },
            ));
        }
        let reply = self.reply;
        self.send(Message::Answer(node, reply.answer));
        self.send(Message::Status(node, reply.status));
        let every = u32::from(self.settings.telemetry_every);
        if every > 0 && reply.status.sequence.is_multiple_of(every) {
            self.send(Message::Telemetry(node, reply.telemetry));
        }
        self.send_drive_frame();
        if self.settings.source == Source::Bus
            && let Some(watch) = &mut self.watch
        {
            let residual_nm = reply.telemetry.residual_torque_nm;
            let velocity_rad_s = f32::from_bits(self.inputs.velocity_rad_s);
            watch.step(residual_nm, velocity_rad_s, residual_nm.is_finite());
        }
    }

    fn measured_reply(&self) -> Reply {
        Reply {
            answer: Answer {
                friction_torque_nm: self.report.friction_torque_nm,
                feed_forward_current_a: self.report.feed_forward_current_a,
            },
            status: Status {
                flags: self.report.flags | self.network.flags(),
                sequence: self.hil.inbox().sequence().wrapping_sub(1),
            },
            telemetry: Telemetry {
                current_a: self.report.current_a,
                residual_torque_nm: self.report.residual_torque_nm,
            },
        }
    }

    /// What a trace says of the samples that follow.
    pub(super) fn trace(&mut self, entry: Entry, message: &Message) {
        match entry {
            Entry::Run(number) => self.run = number,
            Entry::Sequence(_) => {}
            Entry::JointKind(kind) => self.joint_kind = kind,
        }
        self.hil.take(message);
    }

    /// What is due: see [`super::Driver::tick`].
    pub(super) fn tick(&mut self, heartbeat_lost: bool, now_us: u64) {
        self.now_us = now_us;
        let report = &self.report;
        let measures = self.settings.source == Source::Sensors;
        let in_band = self.watch.as_ref().and_then(Watch::in_band);
        let observation = if measures {
            Observation {
                bus_voltage_v: report.bus_voltage_v,
                phase_currents_a: report.phase_currents_a,
                current_a: report.current_a,
                current_setpoint_a: report.current_reference_a,
                velocity_rad_s: report.velocity_rad_s,
                bridge_temperature_c: report.bridge_temperature_c,
                motor_temperature_c: report.motor_temperature_c,
                winding_temperature_c: self.motor_sight.winding_c,
                motor_against: self.motor_sight.against,
                motor_stands: self.motor_sight.stands,
                stalled: self.motor_sight.stalls,
                over_compensated: self.over.is_too_much(),
                radial_force_stuck: self.radial_force_watch.is_stuck(),
                pressure_stuck: self.pressure_watch.is_stuck(),
                sample_age_us: report.sample_age_us,
                gate_driver_fault: report.gate_driver_fault,
                system_break: report.system_break,
                stack_intact: report.stack_intact,
                can: self.can,
                heartbeat_lost,
                loop_flags: report.loop_flags,
                compensator: report.flags,
                model_in_band: in_band,
            }
        } else {
            // A joint in HIL has no bridge to watch over.
            Observation {
                stack_intact: report.stack_intact,
                can: self.can,
                heartbeat_lost,
                model_in_band: in_band,
                ..Observation::default()
            }
        };
        self.supervisor.observe(&observation, now_us);
        let (fault, armed) = (self.supervisor.state() == State::Fault, self.is_armed());
        self.profile.follow(fault, armed);
        self.watch_commissioning();
        self.report_seen = true;
        if self.hil_armed && !self.in_the_way().is_empty() {
            // Not armed itself, the supervisor would only remember it.
            if heartbeat_lost {
                self.supervisor.trip(Code::HeartbeatLost);
            }
            self.disarm();
        }
    }

    /// Takes in what the current loop did: see [`super::Driver::report`].
    pub(super) fn take_report(&mut self, report: &LoopReport) {
        // What flags said since the last tick is not forgotten by a second report before the next.
        let seen = (self.report.loop_flags, self.report.flags);
        self.report = *report;
        if !self.report_seen {
            self.report.loop_flags |= seen.0;
            self.report.flags |= seen.1;
        }
        self.report_seen = false;
        let drives = self.supervisor.is_armed() && !self.measures();
        let (motor, thresholds) = (&self.staging.active().motor, self.supervisor.thresholds());
        self.motor_sight = self.motor_watch.step(&self.report, motor, thresholds, drives);
        self.see_over_compensation();
        self.step_commissioning();
        self.step_velocity();
        for _ in 0..report.overruns_in_a_row {
            self.supervisor.loop_overrun();
        }
        self.supervisor.loop_on_time();
        if self.settings.source == Source::Sensors
            && let Some(watch) = &mut self.watch
        {
            let valid = report.residual_torque_nm.is_finite();
            watch.step(report.residual_torque_nm, report.velocity_rad_s, valid);
        }
    }

    /// What the current loop is to do: see [`super::Driver::orders`].
    /// Looks whether the sensors of side load and pressure still measure: see [`super::Driver::watch_seal`].
    pub(super) fn watch_seal(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.radial_force_watch.look(&mut covariates.radial_force_n, now_us);
        self.pressure_watch.look(&mut covariates.pressure_diff_mpa, now_us);
    }

    pub(super) fn orders(&self, now_us: u64) -> LoopOrders {
        let drives = self.settings.source == Source::Sensors;
        let age_h = now_us as f32 * (1e-6 / 3600.0);
        LoopOrders {
            setpoint: self.commanded(now_us),
            covariates: self.live.covariates(self.settings.campaign_h + age_h, now_us),
            bridge: drives && self.supervisor.bridge_allowed(),
            compensation: drives && self.supervisor.compensation_allowed() && !self.commissions(),
            current_share: self.supervisor.current_share(),
            compensation_share: self.compensation_left,
            factors: None,
            set_number: self.set_number,
            gate_resets: self.gate_resets,
            home: self.home,
            probe: self.probe(),
        }
    }

    pub(super) fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        if receiver_overrun {
            count(&mut self.counters.receiver_overrun, 1);
        }
        if can == CanState::Off && self.can != CanState::Off {
            count(&mut self.counters.bus_off, 1);
        }
        self.can = can;
    }

    /// Disarms the joint, wherever its inputs come from.
    pub(super) fn disarm(&mut self) {
        self.supervisor.disarm();
        self.end_commissioning(Reason::Stopped);
        self.hil.set_enabled(false);
        self.hil_armed = false;
    }

    /// The next code that came or went, as an emergency: code, register, the joint's own detail.
    pub(super) fn next_event(&mut self) -> Option<(u16, u8, [u8; 5])> {
        let event = self.supervisor.take_event()?;
        let info = event.code.info();
        let code = if event.raised { info.emergency } else { 0 };
        log!(warn, "{=str} {=str}", info.name, if event.raised { "came" } else { "went" });
        if event.raised {
            self.keep_error(info.emergency, u16::from(info.number));
        }
        Some((code, self.error_register(), [info.number, 0, 0, 0, 0]))
    }
}

/// Inputs before any came: numbers that are none.
const NOT_RECEIVED: Inputs = {
    const NONE: u32 = f32::NAN.to_bits();
    Inputs {
        velocity_rad_s: NONE,
        position_rad: NONE,
        torque_nm: NONE,
        load_torque_nm: NONE,
        radial_force_n: NONE,
        pressure_diff_pa: NONE,
        temperature_c: NONE,
        auxiliary: NONE,
        command_current_a: NONE,
        command_velocity_and_counter: NONE,
    }
};

/// A watch for these parameters; `None` where it cannot be built. Samples farther apart than the
/// parameters ask for are independent too.
fn watch(written: &WatchParameters, settings: &NodeSettings) -> Option<Watch> {
    let period_s = match settings.source {
        Source::Sensors => REPORT_PERIOD_S,
        Source::Bus => settings.period_s,
    };
    let independent_s = written.independent_s.max(period_s);
    WatchParameters { independent_s, ..*written }.build(period_s).ok()
}
