//! A replay to a driver in this process, in virtual time.

use super::{Check, Plan, PlayResult, Rate, ReplaySetup, SetupError, play, set_up};
use crate::bus::{BusError, Hub};
use crate::canopen::Client;
use crate::joint::JointNode;
use compensator_core::can::NodeId;
use std::io;

/// Error of a replay in this process; its message is one line.
#[derive(Debug, thiserror::Error)]
pub enum InProcessError {
    /// The driver cannot start.
    #[error("driver: {0}")]
    Start(#[from] io::Error),
    /// The set-up failed.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Starts a driver and plays a plan to it at the maximum rate.
///
/// # Errors
/// See [`InProcessError`].
pub fn in_process(
    plan: &Plan,
    node: NodeId,
    setup: &ReplaySetup,
) -> Result<PlayResult, InProcessError> {
    let hub = Hub::new();
    hub.attach(JointNode::start(node, None)?);
    let mut client = Client::new(hub.port(), node);
    let core = set_up(&mut client, node, setup)?;
    let mut bus = client.into_bus();
    Ok(play(&mut bus, plan, Rate::Max, Check::new(node, core), &mut |_| {})?)
}
