//! A replay to a driver in this process, in virtual time.

use super::{Check, Plan, PlayResult, Rate, ReplaySetup, SetupError, play, set_up};
use crate::bus::Hub;
use crate::canopen::{Client, SdoError};
use crate::joint::JointNode;
use compensator_core::can::NodeId;

/// Starts a driver and plays a plan to it at the maximum rate.
///
/// # Errors
/// See [`SetupError`].
pub fn in_process(
    plan: &Plan,
    node: NodeId,
    setup: &ReplaySetup,
) -> Result<PlayResult, SetupError> {
    let hub = Hub::new();
    hub.attach(JointNode::start(node, None)?);
    let mut client = Client::new(hub.port(), node);
    let core = set_up(&mut client, node, setup)?;
    let mut bus = client.into_bus();
    let check = Check::new(node, core);
    Ok(play(&mut bus, plan, Rate::Max, check, &mut |_| {}).map_err(SdoError::from)?)
}
