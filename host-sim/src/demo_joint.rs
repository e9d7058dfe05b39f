//! What `monitor --bus loop` shows: a joint driver in this process, and a bus master that feeds it.
//!
//! The joint is simulated ([`simulated_machines`]: side load, pressure, noise on the torque sensor), its driver is
//! the firmware's own ([`JointNode`]) with the true parameters of that seal. The master plays the recording
//! over and over. Time on the bus is virtual and kept at the pace of the wall clock. The driver is a real
//! one: it can be disarmed, armed, and its answers are computed.

use compensator_core::can::{Entry, Message, Motion, Node, Seal, Sync, Torque};
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, ParameterId, Parameters};
use joint_bus::bus::{BitRates, Hub, Participant, Port};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::replay::{Setup, set_up};
use joint_trace::CanFrame;
use simulated_machines::friction::Seal as TrueSeal;
use simulated_machines::{Recording, record};
use std::collections::VecDeque;

/// The seal that is drawn.
const SEED: u64 = 7;
/// Time from SYNC to SYNC, s.
const PERIOD_S: f64 = 1e-3;

/// Puts a joint and its master on a bus, and gives a place on it; what came before time keeps pace, the
/// start of the driver too, waits to be heard there.
///
/// # Errors
/// The driver cannot be started, or refuses its parameters; one line.
pub fn start(node: Node) -> Result<(Hub, Port), String> {
    let hub = Hub::with_bit_rates(BitRates::FASTEST);
    let port = hub.port();
    hub.attach(JointNode::start(node, None).map_err(|error| error.to_string())?);
    let how = Recording { runs: 4, seconds: 10.0, rate_hz: 1.0 / PERIOD_S, ..Recording::default() };
    let truth = record(SEED, how);
    let setup = Setup {
        friction: Some(configuration(&truth.seal)),
        network: None,
        number: None,
        period_s: PERIOD_S as f32,
    };
    set_up(&mut Client::new(hub.port(), node), node, &setup).map_err(|error| error.to_string())?;
    let samples = truth.runs.iter().enumerate().flat_map(|(run, rows)| {
        rows.iter().enumerate().map(move |(row, of)| Fed {
            begins: (row == 0).then_some(run as u32 + 1),
            motion: Motion {
                velocity_rad_s: of.velocity_rad_s as f32,
                position_rad: of.position_rad as f32,
            },
            torque: Torque { torque_nm: of.torque_nm as f32, load_torque_nm: f32::NAN },
            seal: Seal {
                radial_force_n: of.radial_force_n as f32,
                pressure_diff_pa: of.pressure_diff_pa as f32,
            },
        })
    });
    let samples: Vec<Fed> = samples.collect();
    hub.attach(Master { node, samples, next: 0, count: 0, outbox: VecDeque::new() });
    hub.keep_pace(1.0);
    Ok((hub, port))
}

/// The driver's parameters: those of the seal itself.
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
    // The simulated bristles are damped alike at every speed, as the paper's are.
    model.choices.allow_active = true;
    Configuration { model, compensator: CompensatorParameters::default() }
}

/// A sample of the recording.
struct Fed {
    begins: Option<u32>,
    motion: Motion,
    torque: Torque,
    seal: Seal,
}

/// Feeds the joint.
struct Master {
    node: Node,
    samples: Vec<Fed>,
    next: usize,
    count: u32,
    outbox: VecDeque<CanFrame>,
}

impl Participant for Master {
    fn receive(&mut self, _: &CanFrame, _: u64) {}

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        let node = self.node;
        let fed = self.samples.get(self.next)?;
        if fed.begins.is_some() {
            self.count = 0;
        }
        let begins = fed.begins.map(|run| Message::Entry(node, Entry::Run(run)));
        // Load and pressure are slow: at every tenth sample, as a master with slow sensors would.
        let seal = self.count.is_multiple_of(10).then_some(Message::Seal(node, fed.seal));
        let measured = [Message::Motion(node, fed.motion), Message::Torque(node, fed.torque)];
        let sync = [Message::Sync(Sync::of(self.count))];
        let messages = begins.into_iter().chain(measured).chain(seal).chain(sync);
        self.outbox.extend(messages.map(|message| CanFrame::from(message.emit())));
        self.count += 1;
        self.next = (self.next + 1) % self.samples.len();
        Some(now_ns + (PERIOD_S * 1e9) as u64)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.outbox.pop_front()
    }
}
