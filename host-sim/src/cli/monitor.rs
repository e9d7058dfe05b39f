//! `monitor`: shows live data of a joint.
//!
//! On a terminal it draws a screen: the paged view if the feature `monitor` is compiled in, otherwise the plain one. In a
//! pipe, or with `--json`, it prints one JSON object per second. It receives the joint's frames and reads state, faults
//! and watch twice a second. With `--listen` it sends no frame.

use super::bus::BusArguments;
use super::error::{Refusal, Result};
use super::values::seconds;
use crate::demo_joint;
use joint_bus::bus::{Bus, Hub};
use joint_bus::monitor::plain::{Terminal, run_plain};
use joint_bus::monitor::rows::Setting;
use joint_bus::monitor::{ReopenError, Session, run_lines};
#[cfg(feature = "monitor")]
use joint_monitor::{run_screen, screen};
use rustix::termios::tcgetwinsize;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `monitor`.
#[derive(clap::Args)]
pub struct MonitorArguments {
    /// Send no frames
    ///
    /// Without this option, state, faults and watch are read twice a second. An slcan adapter is opened in listen-only mode
    /// and acknowledges no frame.
    #[arg(long)]
    listen: bool,
    /// Print one JSON object per second instead of a screen; default if standard output is not a terminal
    #[arg(long)]
    json: bool,
    /// View on a terminal
    ///
    /// `plain`: the values and states on one screen; `paged`: with charts, keys and a log that scrolls. By default `paged`
    /// in a build with the feature `monitor`, else `plain`.
    #[arg(long, value_name = "VIEW", value_enum, conflicts_with = "json")]
    view: Option<ViewChoice>,
    /// Stop after this time, s; by default at Ctrl-C, in the paged view also at q
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
    #[command(flatten)]
    bus: BusArguments,
}

/// A view on a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ViewChoice {
    Plain,
    Paged,
}

static STOPPED: AtomicBool = AtomicBool::new(false);

/// Runs the command.
pub fn run(arguments: &MonitorArguments) -> Result {
    #[cfg(not(feature = "monitor"))]
    if arguments.view == Some(ViewChoice::Paged) {
        return Err(super::missing_feature::refusal("--view paged", "monitor").into());
    }
    let lines = arguments.json || !std::io::stdout().is_terminal();
    if lines && !arguments.json {
        eprintln!(
            "note: standard output is not a terminal: printing one JSON object per second, as with --json"
        );
    }
    let is_demo = arguments.bus.is_loop();
    let open = || arguments.bus.open_with(&Hub::new(), arguments.listen);
    let bus = if is_demo { Box::new(demo_joint::start(arguments.bus.node_id)?.1) } else { open()? };
    let mut bus = arguments.bus.with_recorder(bus)?;
    // SIGTERM and SIGHUP too: restore the terminal and flush the record. A second signal ends the process immediately.
    let stop = || {
        if STOPPED.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    };
    ctrlc::set_handler(stop).map_err(Refusal::Signals)?;
    let is_over = |elapsed_s: f64| {
        STOPPED.load(Ordering::Relaxed) || arguments.seconds.is_some_and(|most| elapsed_s >= most)
    };
    let mut session = Session::new(arguments.bus.node_id, arguments.listen, bus.now_ns());
    let name = arguments.bus.bus.to_string();
    session.joint.set_bus(&name, arguments.bus.bit_rate.bits_per_second());
    if lines {
        let name = if is_demo { "loop (demo: a simulated joint in this process)" } else { &name };
        return Ok(run_lines(&mut session, &mut bus, name, is_over, print)?);
    }
    let setting = Setting { bus: name, demo: is_demo, ..Setting::default() };
    let again = || match &arguments.bus.record {
        _ if is_demo => Err(ReopenError::DemoEnded),
        Some(_) => Err(ReopenError::RecordKept),
        None => Ok(open()?),
    };
    #[cfg(feature = "monitor")]
    if arguments.view != Some(ViewChoice::Plain) {
        return Ok(screen::with_terminal(|terminal| {
            run_screen(&mut session, bus, setting, terminal, again, is_over)
        })?);
    }
    let mut out = std::io::stdout().lock();
    Ok(run_plain(&mut session, bus, setting, &mut out, plain_terminal, again, is_over)?)
}

/// Returns the terminal of standard output as it is now.
fn plain_terminal() -> Terminal {
    let size = tcgetwinsize(std::io::stdout()).map(|size| (size.ws_col, size.ws_row));
    // A terminal without a known size reports 0.
    let (width, height) = size.ok().filter(|size| size.0 > 0 && size.1 > 0).unwrap_or((80, 24));
    let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    Terminal { width: width.into(), height: height.into(), colour }
}

/// Prints a line. Returns false if the reader has closed the pipe.
fn print(line: &str) -> std::io::Result<bool> {
    let mut out = std::io::stdout().lock();
    match out.write_all(line.as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}
