//! The joint of `scope --bus loop`: a commissioned joint with a simulated motor, and a master that moves it.
//!
//! The master sends target velocities of a sine (CiA 402, mode 9), so that friction passes through zero twice a second.
//! Time is virtual.

use canopen_rs::{Address, NmtCommand};
use compensator_core::can::{Frame, NodeId, cob_id};
use firmware::driver::profile::CSV;
use firmware::node::dictionary::index;
use joint_bus::bus::{Bus, Hub, Participant};
use joint_bus::canopen::{Client, SdoError};
use joint_rig::{MotorNode, RigError};
use joint_trace::CanFrame;
use std::collections::VecDeque;
use std::time::Duration;

/// Time between two targets, ns.
const TARGET_PERIOD_NS: u64 = 10_000_000;
/// Amplitude, rad/s, and frequency, Hz, of the target velocity.
const AMPLITUDE_RAD_S: f64 = 1.0;
const FREQUENCY_HZ: f64 = 1.0;
/// Time until the joint is enabled, ns.
const ENABLE_NS: u64 = 300_000_000;

/// Attaches the joint and its master to a new bus.
///
/// # Errors
/// Returns an error if the joint does not start.
pub fn start() -> Result<Hub, RigError> {
    let hub = Hub::new();
    hub.attach(MotorNode::commissioned()?);
    hub.attach(Master { begin_ns: None, outbox: VecDeque::new() });
    Ok(hub)
}

/// Brings the joint into operation, and waits until it moves.
///
/// # Errors
/// Returns an error if the joint does not answer.
pub fn bring_up<B: Bus>(client: &mut Client<B>) -> Result<(), SdoError> {
    client.write(Address::new(index::MODE, 0), &CSV.to_le_bytes())?;
    client.command(NmtCommand::StartRemoteNode)?;
    Ok(client.bus().discard_within(Duration::from_nanos(2 * ENABLE_NS))?)
}

/// The master of the bus.
struct Master {
    begin_ns: Option<u64>,
    outbox: VecDeque<CanFrame>,
}

impl Participant for Master {
    fn receive(&mut self, _: &CanFrame, _: u64) {}

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        let elapsed_ns = now_ns - *self.begin_ns.get_or_insert(now_ns);
        // Shutdown, switch on, enable operation: each repeated until the next is due.
        let controlword: u16 = match elapsed_ns {
            0..100_000_000 => 0x06,
            100_000_000..200_000_000 => 0x07,
            _ => 0x0F,
        };
        let angle = std::f64::consts::TAU * FREQUENCY_HZ * elapsed_ns as f64 * 1e-9;
        let target_rad_s = if elapsed_ns < ENABLE_NS { 0.0 } else { AMPLITUDE_RAD_S * angle.sin() };
        let mut data = [0; 8];
        data[..2].copy_from_slice(&controlword.to_le_bytes());
        data[4..].copy_from_slice(&((1e6 * target_rad_s) as i32).to_le_bytes());
        let identifier = cob_id::RPDO_1 + u16::from(NodeId::FIRST.number());
        self.outbox.extend(Frame::new(identifier, &data).map(CanFrame::from));
        Some(now_ns + TARGET_PERIOD_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.outbox.pop_front()
    }
}
