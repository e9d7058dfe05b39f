//! `node`: runs a joint driver on this PC, connected to a CAN bus.

use super::bus::BusArguments;
use super::error::{Result, in_part, unfit};
use super::interrupt;
use super::output::print_text;
use super::values::seconds;
use joint_bus::bus::{BusError, Hub};
use joint_bus::joint::{JointError, JointNode, run_participant};
use joint_rig::{MotorNode, service};
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `node`.
#[derive(clap::Args)]
pub struct NodeArguments {
    /// File that holds the driver's flash; saved parameters are kept after the process ends
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Simulate a motor and a joint in real time
    ///
    /// The driver is commissioned, uses its own sensors, and can move the joint. It starts with open access. Node 1 only;
    /// saved parameters are lost when the process ends. With --seed or --hide, the joint is a drawn one in service: its
    /// position is known, and limited to 1 rad around the start.
    #[arg(long, conflicts_with = "flash")]
    motor: bool,
    /// With --motor: hide a cause in the joint, of a given size or of one that is visible; repeat for several
    ///
    /// none hides nothing.
    #[arg(long, value_name = "CAUSE[:SIZE]", requires = "motor", value_parser = Hide::parse)]
    hide: Vec<Hide>,
    /// With --motor: seed of the drawn joint [default with --hide: 1]
    #[arg(long, value_name = "N", requires = "motor")]
    seed: Option<u64>,
    /// Stop after this time, s; by default at Ctrl-C
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
    #[command(flatten)]
    bus: BusArguments,
}

/// Runs the command.
pub fn run(arguments: &NodeArguments) -> Result {
    if arguments.bus.is_loop() {
        return Err(unfit(
            "node",
            "the bus loop has no other participant; give --bus vcan0, can0 or slcan:..., or use replay, which starts its \
             own node on loop",
        ));
    }
    if arguments.motor {
        return run_motor(arguments);
    }
    let mut joint = JointNode::start(arguments.bus.node_id, arguments.flash.as_deref())?;
    let mut bus = arguments.bus.open(&Hub::new())?;
    let is_over = is_over(arguments.seconds)?;
    print_text(&format!(
        "{}: pre-operational, receives its inputs from the bus; stop with Ctrl-C\n",
        arguments.bus.joint_name()
    ))?;
    let outcome = joint.run(&mut bus, |_| is_over());
    let counters = *joint.driver().joint.counters();
    print_text(&format!(
        "frames received: {}, restarts: {}\n",
        counters.received,
        joint.restarts()
    ))?;
    node_result(outcome)
}

/// Runs a driver with a simulated motor and joint.
fn run_motor(arguments: &NodeArguments) -> Result {
    arguments.bus.check_first_node("--motor")?;
    let (mut joint, what) = motor_joint(arguments)?;
    let mut bus = arguments.bus.open(&Hub::new())?;
    let is_over = is_over(arguments.seconds)?;
    print_text(&format!(
        "{}: pre-operational, with a simulated motor, {what}; stop with Ctrl-C\n",
        arguments.bus.joint_name()
    ))?;
    node_result(run_participant(&mut joint, &mut bus, |_, _| Ok(is_over())))
}

/// Starts the joint of `--motor`, and returns it with its description.
fn motor_joint(arguments: &NodeArguments) -> Result<(MotorNode, String)> {
    if arguments.hide.is_empty() && arguments.seed.is_none() {
        return Ok((MotorNode::commissioned()?, "commissioned".to_owned()));
    }
    let seed = arguments.seed.unwrap_or(1);
    let joint = DrawnJoint::draw(seed, &arguments.hide, None).map_err(in_part("--hide"))?;
    let node = MotorNode::drawn(&joint, &service::starting_set(&joint))?;
    Ok((node, format!("drawn with seed {seed}, in service")))
}

/// Returns a function that is true when the node ends: by Ctrl-C, or after this time, s.
fn is_over(longest_s: Option<f64>) -> Result<impl Fn() -> bool> {
    let is_interrupted = interrupt::flag()?;
    let start = Instant::now();
    let is_late = move |longest_s| start.elapsed().as_secs_f64() >= longest_s;
    Ok(move || is_interrupted() || longest_s.is_some_and(is_late))
}

fn node_result(outcome: Result<(), JointError>) -> Result {
    match outcome {
        // The other end of a serial line ends the node by closing the connection.
        Err(JointError::Bus(BusError::Closed { .. })) | Ok(()) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
