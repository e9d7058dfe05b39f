//! A single motion by hand: `move`.

use crate::master::{Master, MasterError};
use crate::motion::{Motion, MotionLimits};
use crate::preflight::{Purpose, examine};
use crate::recording::Recording;
use crate::score::{Scores, score};
use crate::session::{TuneError, TuneUser};
use compensator_core::can::NodeId;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;

/// What is asked of the joint.
#[derive(Clone, Debug)]
pub struct MoveOptions {
    /// Node number of the joint.
    pub node: NodeId,
    /// Bounds of the motion.
    pub limits: MotionLimits,
    /// Motion around the present position.
    pub motion: Option<Motion>,
    /// Position to move to before, rad.
    pub to_rad: Option<f64>,
    /// Name of the joint for messages: bus and node.
    pub joint: String,
}

/// What the joint did.
#[derive(Clone, Debug)]
pub struct Moved {
    /// The rows of the motion; none for a move to a position.
    pub recording: Recording,
    /// How well the joint followed the motion; `None` for a move to a position.
    pub scores: Option<Scores>,
    /// Position at the end, rad.
    pub position_rad: f64,
}

/// Moves a joint, with the parameters that it has, and disarms it afterwards.
///
/// # Errors
/// Returns one line if the joint must not be moved, the user declines, or the drive stops.
pub fn perform<B: Bus>(
    mut client: Client<B>,
    options: &MoveOptions,
    is_interrupted: Box<dyn Fn() -> bool>,
    user: &mut dyn TuneUser,
) -> Result<Moved, TuneError> {
    let purpose = options.to_rad.map_or(Purpose::Move, Purpose::MoveTo);
    let found = examine(&mut client, options.node, &options.limits, purpose)?;
    let (range, at) = (options.limits.range_rad, found.position_rad);
    let way = match options.to_rad {
        Some(to) => format!("from {at:.3} to {to} rad"),
        None => format!("by up to {range} rad to either side of {at:.3} rad"),
    };
    let question = format!(
        "{} will move {way}, at up to {} rad/s. Keep the range clear and be ready to switch off the supply. Continue?",
        options.joint, options.limits.speed_rad_s
    );
    if !user.confirms(&question) {
        return Err(TuneError::Declined);
    }
    let mut master = Master::new(client, options.node, options.limits, is_interrupted);
    let moved = drive(&mut master, options, found.position_rad);
    let disabled = master.disable();
    let restored = master.set_interpolation(found.interpolation);
    let recording = moved?;
    disabled.and(restored).and_then(|()| master.leave())?;
    let nm_per_a = f64::from(found.set.friction.compensator.torque_constant_nm_per_a);
    let scores = options.motion.is_some().then(|| score(&recording, nm_per_a).scores);
    Ok(Moved { recording, scores, position_rad: master.last().position_rad })
}

fn drive<B: Bus>(
    master: &mut Master<B>,
    options: &MoveOptions,
    origin_rad: f64,
) -> Result<Recording, MasterError> {
    master.configure()?;
    master.enable()?;
    let speed = options.limits.speed_rad_s;
    master.approach(options.to_rad.unwrap_or(origin_rad), speed)?;
    match &options.motion {
        Some(motion) => master.play(motion, origin_rad),
        None => Ok(Recording::default()),
    }
}
