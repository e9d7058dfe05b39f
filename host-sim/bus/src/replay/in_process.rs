//! A replay without a bus of the kernel: to a driver in this process, in virtual time.

use super::{Check, Plan, Played, Rate, Setup, SetupError, play, set_up};
use crate::bus::{BusError, Hub};
use crate::canopen::Client;
use crate::joint::JointNode;
use compensator_core::can::Node;
use std::io;

/// Why there was no replay; one line.
#[derive(Debug, thiserror::Error)]
pub enum InProcessError {
    /// The driver would not start.
    #[error("driver: {0}")]
    Start(#[from] io::Error),
    /// It refused what it was to be set up for.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The bus in this process.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Plays a plan, as fast as can be, to a driver that is started for it.
///
/// # Errors
/// See [`InProcessError`].
pub fn in_process(plan: &Plan, node: Node, setup: &Setup) -> Result<Played, InProcessError> {
    let hub = Hub::new();
    hub.attach(JointNode::start(node, None)?);
    let mut client = Client::new(hub.port(), node);
    let core = set_up(&mut client, node, setup)?;
    let mut bus = client.into_bus();
    Ok(play(&mut bus, plan, Rate::Max, Check::new(node, core), &mut |_| {})?)
}
