//! The joint that `monitor --bus loop` shows: a joint driver in this process and a bus master.
//!
//! The joint is simulated ([`simulated_machines`]) with side load, pressure, and noise of the torque sensor. Its driver
//! is the firmware's ([`JointNode`]) with the true parameters of the simulated seal. The master replays the simulated
//! recording in a loop. Bus time is virtual and runs at the speed of the wall clock. The driver computes its answers
//! and can be armed and disarmed.

use compensator_core::can::{
    Message, MotionFrame, NodeId, SealFrame, SyncFrame, TorqueFrame, TraceEntry,
};
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, ParameterId, Parameters};
use joint_bus::bus::{BitRates, Hub, Participant, Port};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::replay::{ReplaySetup, SetupError, set_up};
use joint_trace::CanFrame;
use simulated_machines::friction::Seal as TrueSeal;
use simulated_machines::{Recording, record};
use std::collections::VecDeque;

/// Seed of the simulated joint.
const SEED: u64 = 7;
/// Time between two SYNC frames, s.
const PERIOD_S: f64 = 1e-3;

/// Attaches the joint and its master to a new bus. Returns the bus and a port on it. The port already holds the frames
/// of the driver's start.
///
/// # Errors
/// Returns an error if the driver cannot be started or rejects its parameters.
pub fn start(node: NodeId) -> Result<(Hub, Port), SetupError> {
    let hub = Hub::with_bit_rates(BitRates::FASTEST);
    let port = hub.port();
    hub.attach(JointNode::start(node, None)?);
    let how = Recording { runs: 4, seconds: 10.0, rate_hz: 1.0 / PERIOD_S, ..Recording::default() };
    let truth = record(SEED, how);
    let setup = ReplaySetup {
        friction: Some(configuration(&truth.seal)),
        network: None,
        number: None,
        period_s: PERIOD_S as f32,
        adaptation: None,
    };
    set_up(&mut Client::new(hub.port(), node), node, &setup)?;
    let log = truth.log();
    let samples = log.runs.iter().enumerate().flat_map(|(number, run)| {
        let names =
            ["velocity_rad_s", "position_rad", "torque_nm", "radial_force_n", "pressure_diff_pa"];
        let columns = names.map(|name| log.column(run, name).expect("the simulated joint logs it"));
        (0..run.rows()).map(move |row| {
            let [velocity_rad_s, position_rad, torque_nm, radial_force_n, pressure_diff_pa] =
                columns.map(|column| column[row] as f32);
            RecordedSample {
                new_run: (row == 0).then_some(number as u32 + 1),
                motion: MotionFrame { velocity_rad_s, position_rad },
                torque: TorqueFrame { torque_nm, load_torque_nm: f32::NAN },
                seal: SealFrame { radial_force_n, pressure_diff_pa },
            }
        })
    });
    let samples: Vec<RecordedSample> = samples.collect();
    hub.attach(ReplayMaster { node, samples, next: 0, count: 0, outbox: VecDeque::new() });
    hub.keep_pace(1.0);
    Ok((hub, port))
}

/// Returns the driver's parameters, which are the true parameters of the seal.
fn configuration(seal: &TrueSeal) -> Configuration {
    let mut model = Parameters::<f32>::new(LawKind::ImprovedLugre);
    for (id, value) in [
        (ParameterId::CoulombTorque, seal.coulomb_nm),
        (ParameterId::StaticTorque, seal.static_nm),
        (ParameterId::StribeckVelocity, seal.stribeck_rad_s),
        (ParameterId::BristleStiffness, seal.k0),
        (ParameterId::BristleDamping, seal.k1),
        (ParameterId::ViscousFriction, seal.k2),
        (ParameterId::RadialForceCoulomb, seal.per_force),
        (ParameterId::PressureCoulomb, seal.per_pressure),
        (ParameterId::RadialForceRate, seal.eta3),
    ] {
        model.set(id, value as f32);
    }
    // As in the paper, the damping of the simulated bristles does not depend on speed; such a law may be active.
    model.choices.allow_active = true;
    Configuration { model, compensator: CompensatorParameters::default() }
}

/// One sample of the recording.
struct RecordedSample {
    /// Number of the run that starts with this sample.
    new_run: Option<u32>,
    motion: MotionFrame,
    torque: TorqueFrame,
    seal: SealFrame,
}

/// Bus master that replays the recording to the joint.
struct ReplayMaster {
    node: NodeId,
    samples: Vec<RecordedSample>,
    next: usize,
    count: u32,
    outbox: VecDeque<CanFrame>,
}

impl Participant for ReplayMaster {
    fn receive(&mut self, _: &CanFrame, _: u64) {}

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        let node = self.node;
        let sample = self.samples.get(self.next)?;
        if sample.new_run.is_some() {
            self.count = 0;
        }
        let new_run = sample.new_run.map(|run| Message::Entry(node, TraceEntry::Run(run)));
        // Load and pressure change slowly; they are sent at every tenth sample, as by slow sensors.
        let seal = self.count.is_multiple_of(10).then_some(Message::Seal(node, sample.seal));
        let measured = [Message::Motion(node, sample.motion), Message::Torque(node, sample.torque)];
        let sync = [Message::Sync(SyncFrame::of(self.count))];
        let messages = new_run.into_iter().chain(measured).chain(seal).chain(sync);
        self.outbox.extend(messages.map(|message| CanFrame::from(message.emit())));
        self.count += 1;
        self.next = (self.next + 1) % self.samples.len();
        Some(now_ns + (PERIOD_S * 1e9) as u64)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.outbox.pop_front()
    }
}
