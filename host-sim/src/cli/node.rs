//! `node`: runs a joint driver on this PC, connected to a CAN bus.

use super::bus::BusArguments;
use super::output::print_text;
use compensator_core::can::NodeId;
use joint_bus::bus::{BusError, BusName, Hub};
use joint_bus::joint::{JointNode, run_participant};
use joint_rig::{MotorNode, service};
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    #[command(flatten)]
    bus: BusArguments,
}

static STOPPED: AtomicBool = AtomicBool::new(false);

/// Runs the command.
pub fn run(arguments: &NodeArguments) -> Result<(), String> {
    if arguments.bus.bus == BusName::Loop {
        return Err(
            "node: the bus loop has no other participant; give --bus vcan0, can0 or slcan:..., \
                    or use replay, which starts its own node on loop"
                .to_owned(),
        );
    }
    if arguments.motor {
        return run_motor(arguments);
    }
    let path = arguments.flash.as_deref();
    let mut joint = JointNode::start(arguments.bus.node_id, path).map_err(|error| {
        let name = path.map_or_else(String::new, |path| format!("{}: ", path.display()));
        format!("{name}{error}")
    })?;
    let mut bus = arguments.bus.open(&Hub::new())?;
    ctrlc::set_handler(|| STOPPED.store(true, Ordering::Relaxed))
        .map_err(|error| format!("Ctrl-C: {error}"))?;
    print_text(&format!(
        "node {} on {}: pre-operational, receives its inputs from the bus; stop with Ctrl-C\n",
        arguments.bus.node_id.number(),
        arguments.bus.bus
    ))?;
    let start = Instant::now();
    let longest = arguments.seconds.map(Duration::from_secs_f64);
    let outcome = joint.run(&mut bus, |_| {
        STOPPED.load(Ordering::Relaxed) || longest.is_some_and(|longest| start.elapsed() >= longest)
    });
    let counters = joint.driver().map(|driver| *driver.joint.counters()).unwrap_or_default();
    print_text(&format!(
        "frames received: {}, restarts: {}\n",
        counters.received,
        joint.restarts()
    ))?;
    node_result(outcome)
}

/// Runs a driver with a simulated motor and joint.
fn run_motor(arguments: &NodeArguments) -> Result<(), String> {
    if arguments.bus.node_id != NodeId::FIRST {
        return Err("--motor: the simulated joint is node 1".into());
    }
    let (mut joint, what) = motor_joint(arguments)?;
    let mut bus = arguments.bus.open(&Hub::new())?;
    ctrlc::set_handler(|| STOPPED.store(true, Ordering::Relaxed))
        .map_err(|error| format!("Ctrl-C: {error}"))?;
    print_text(&format!(
        "node 1 on {}: pre-operational, with a simulated motor, {what}; stop with Ctrl-C\n",
        arguments.bus.bus
    ))?;
    let start = Instant::now();
    let longest = arguments.seconds.map(Duration::from_secs_f64);
    node_result(run_participant(&mut joint, &mut bus, |_, _| {
        let is_over = longest.is_some_and(|longest| start.elapsed() >= longest);
        Ok(is_over || STOPPED.load(Ordering::Relaxed))
    }))
}

/// Starts the joint of `--motor`, and returns it with its description.
fn motor_joint(arguments: &NodeArguments) -> Result<(MotorNode, String), String> {
    if arguments.hide.is_empty() && arguments.seed.is_none() {
        return Ok((MotorNode::commissioned()?, "commissioned".to_owned()));
    }
    let seed = arguments.seed.unwrap_or(1);
    let joint =
        DrawnJoint::draw(seed, &arguments.hide, None).map_err(|why| format!("--hide: {why}"))?;
    let node = MotorNode::drawn(&joint, &service::starting_set(&joint))?;
    Ok((node, format!("drawn with seed {seed}, in service")))
}

fn node_result(outcome: Result<(), BusError>) -> Result<(), String> {
    match outcome {
        // On a serial line, the peer ends the node by closing the connection.
        Err(BusError::Closed { .. }) | Ok(()) => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}
