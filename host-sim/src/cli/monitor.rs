//! `monitor`: a live view of a joint.
//!
//! On a terminal it draws; in a pipe, or with `--json`, it prints a line of JSON a second. It listens, and
//! asks the joint for its state twice a second; with `--listen` it sends nothing at all.

use super::bus::BusArguments;
use crate::demo_joint;
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::monitor::view::Setting;
use joint_bus::monitor::{Session, run_lines, run_screen, screen};
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `monitor`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    bus: BusArguments,
    /// Send nothing at all; without it state, faults and watch are read twice a second. An slcan adapter
    /// is opened to listen, so that it acknowledges nothing either
    #[arg(long)]
    listen: bool,
    /// Print one JSON object a second instead of drawing; so also where standard output is no terminal
    #[arg(long)]
    json: bool,
    /// Stop after so many seconds; without it at q or Ctrl-C
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "expected a number above 0".to_owned())
}

static STOPPED: AtomicBool = AtomicBool::new(false);

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let lines = arguments.json || !std::io::stdout().is_terminal();
    if lines && !arguments.json {
        eprintln!("note: standard output is no terminal: one JSON object a second, as with --json");
    }
    let is_demo = arguments.bus.bus == BusName::Loop;
    let bus = if is_demo { open_demo(arguments)? } else { open(arguments)? };
    // SIGTERM and SIGHUP too: the terminal is given back, a record is written out.
    // Asked a second time, it ends whatever it is in the middle of.
    let stop = || {
        if STOPPED.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    };
    ctrlc::set_handler(stop).map_err(|error| format!("Ctrl-C: {error}"))?;
    let is_over = |elapsed_s: f64| {
        STOPPED.load(Ordering::Relaxed) || arguments.seconds.is_some_and(|most| elapsed_s >= most)
    };
    let mut session = Session::new(arguments.bus.node_id, arguments.listen, bus.now_ns());
    session.set_bit_rate(arguments.bus.bit_rate.bits_per_second());
    let name = arguments.bus.bus.to_string();
    if lines {
        let name = if is_demo { "loop (demo: a simulated joint in this process)" } else { &name };
        let mut bus = bus;
        return run_lines(&mut session, &mut bus, name, is_over, print);
    }
    let setting = Setting { bus: name, demo: is_demo, epoch: !is_demo, ..Setting::default() };
    let again = || {
        if is_demo {
            return Err("the demo has ended: start it again".to_owned());
        }
        // A record begun anew would overwrite the one there is.
        if arguments.bus.record.is_some() {
            return Err("the bus has gone, and what was recorded is kept: start again".to_owned());
        }
        open(arguments)
    };
    screen::with_terminal(|terminal| {
        run_screen(&mut session, bus, setting, terminal, again, is_over)
    })
}

/// The bus that was asked for.
fn open(arguments: &Arguments) -> Result<Box<dyn Bus>, String> {
    arguments.bus.open_with(&Hub::new(), arguments.listen)
}

fn open_demo(arguments: &Arguments) -> Result<Box<dyn Bus>, String> {
    let (_, port) = demo_joint::start(arguments.bus.node_id)?;
    arguments.bus.recorded(Box::new(port))
}

/// Prints a line; a reader that has seen enough ends it.
fn print(line: &str) -> Result<bool, String> {
    let mut out = std::io::stdout().lock();
    match out.write_all(line.as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(format!("standard output: {error}")),
    }
}
