//! `node`: a joint driver on this PC.

use super::bus::BusArguments;
use super::output::say;
use crate::joint_rig::MotorNode;
use compensator_core::can::Node;
use joint_bus::bus::{BusError, BusName, Hub};
use joint_bus::joint::{JointNode, live};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Arguments of `node`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    bus: BusArguments,
    /// File that stands for the driver's flash: saved parameters outlive the process
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// The driver has a motor and a joint, simulated in real time, and is commissioned: it is on its own sensors and drives.
    /// Node 1; what is saved is forgotten with it
    #[arg(long, conflicts_with = "flash")]
    motor: bool,
    /// Stop after so many seconds; without it at Ctrl-C
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
}

static STOPPED: AtomicBool = AtomicBool::new(false);

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    if arguments.bus.bus == BusName::Loop {
        return Err("node: nobody else is on the bus loop; give --bus vcan0, can0 or slcan:..., \
                    or use replay, which brings its own node on loop"
            .to_owned());
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
    say(&format!(
        "node {} on {}: pre-operational, fed by the bus; Ctrl-C ends it\n",
        arguments.bus.node_id.number(),
        arguments.bus.bus
    ))?;
    let start = Instant::now();
    let longest = arguments.seconds.map(Duration::from_secs_f64);
    let outcome = joint.run(&mut bus, |_| {
        STOPPED.load(Ordering::Relaxed) || longest.is_some_and(|longest| start.elapsed() >= longest)
    });
    let counters = joint.driver().map(|driver| *driver.counters()).unwrap_or_default();
    say(&format!("received {}, restarts {}\n", counters.received, joint.restarts()))?;
    ended(outcome)
}

/// A joint with its simulated motor.
fn run_motor(arguments: &Arguments) -> Result<(), String> {
    if arguments.bus.node_id != Node::FIRST {
        return Err("--motor: the simulated joint is node 1".into());
    }
    let mut joint = MotorNode::commissioned()?;
    let mut bus = arguments.bus.open(&Hub::new())?;
    ctrlc::set_handler(|| STOPPED.store(true, Ordering::Relaxed))
        .map_err(|error| format!("Ctrl-C: {error}"))?;
    say(&format!(
        "node 1 on {}: pre-operational, with a simulated motor, commissioned; Ctrl-C ends it\n",
        arguments.bus.bus
    ))?;
    let start = Instant::now();
    let longest = arguments.seconds.map(Duration::from_secs_f64);
    ended(live(&mut joint, &mut bus, |_, _| {
        let over = longest.is_some_and(|longest| start.elapsed() >= longest);
        Ok(over || STOPPED.load(Ordering::Relaxed))
    }))
}

fn ended(outcome: Result<(), BusError>) -> Result<(), String> {
    match outcome {
        // A peer that hangs up ends a node on a serial line; that is how it ends.
        Err(BusError::Closed { .. }) | Ok(()) => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}
