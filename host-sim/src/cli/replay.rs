//! `replay`: a trace, played to a joint driver, every answer held against the core.

use super::bus::BusArguments;
use super::input::spinner;
use super::output::{OutputArguments, say};
use crate::driver_file;
use firmware::hil::Number;
use joint_bus::bus::{BusName, FaultInjector, FaultPlan, Faults, Hub};
use joint_bus::canopen::Client;
use joint_bus::joint::JointNode;
use joint_bus::replay::play::Progress;
use joint_bus::replay::real_time::request_real_time;
use joint_bus::replay::report::About;
use joint_bus::replay::{Check, Plan, Rate, Report, Setup, play, set_up};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `replay`.
#[derive(clap::Args)]
pub struct Arguments {
    /// A candump log with a joint's frames (candump -L, or `trace.log` of simulate)
    #[arg(value_name = "TRACE")]
    trace: PathBuf,
    #[command(flatten)]
    bus: BusArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// How fast: 1 as recorded, N times as fast, or max
    #[arg(long, value_name = "1|N|max", default_value = "1", value_parser = rate)]
    rate: Rate,
    /// Parameters to give the driver; without it those it has
    #[arg(long, value_name = "PARAMS.TOML")]
    params: Option<PathBuf>,
    /// The number it is to compute with; without it the one it has
    #[arg(long, value_name = "NUMBER")]
    number: Option<NumberArgument>,
    /// Time from SYNC to SYNC, s; without it the trace's own
    #[arg(long, value_name = "S")]
    period: Option<f32>,
    /// Shares of frames to drop, duplicate, corrupt, delay or reorder, as drop=0.01,corrupt=0.001
    #[arg(long, value_name = "FAULT=SHARE,...", value_parser = faults)]
    faults: Option<Faults>,
    /// Where the faults' dice start
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// The number a driver computes with.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum NumberArgument {
    /// f32
    F32,
    /// Fixed point, 20 fractional bits
    Fixed,
}

fn rate(text: &str) -> Result<Rate, String> {
    if text == "max" {
        return Ok(Rate::Max);
    }
    let number = text.trim_end_matches('x').parse::<f64>().ok();
    let legal = number.filter(|times| times.is_finite() && *times > 0.0);
    legal.map(Rate::Times).ok_or_else(|| "expected 1, a number above 0, or max".to_owned())
}

fn faults(text: &str) -> Result<Faults, String> {
    let mut faults = Faults { longest_delay_ns: 2_000_000, ..Faults::default() };
    for part in text.split(',') {
        let expected =
            || format!("{part}: expected drop, duplicate, corrupt, delay or reorder = 0..1");
        let (name, share) = part.split_once('=').ok_or_else(expected)?;
        let share: f64 = share.trim().parse().map_err(|_| expected())?;
        if !(0.0..=1.0).contains(&share) {
            return Err(expected());
        }
        match name.trim() {
            "drop" => faults.drop = share,
            "duplicate" => faults.duplicate = share,
            "corrupt" => faults.corrupt = share,
            "delay" => faults.delay = share,
            "reorder" => faults.reorder = share,
            _ => return Err(expected()),
        }
    }
    Ok(faults)
}

/// Runs the command; exit code 1 where an answer differs or is missing.
pub fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let words = |error: &dyn std::error::Error| error.to_string();
    let node = arguments.bus.node_id;
    let plan = Plan::read(&arguments.trace, node).map_err(|error| words(&error))?;
    let file = arguments.params.as_deref().map(driver_file::read).transpose();
    let file = file.map_err(|error| words(&error))?;
    let network = file.as_ref().map(driver_file::network).transpose()?.flatten();
    let hub = Hub::new();
    if arguments.bus.bus == BusName::Loop {
        let joint = JointNode::start(node, None).map_err(|error| words(&error))?;
        hub.attach(joint);
    }
    let mut bus = arguments.bus.open(&hub)?;
    // Set up without faults: what is tested is the replay, not the patience of the set-up.
    let mut client = Client::new(&mut bus, node);
    let setup = Setup {
        friction: file.map(|file| file.friction()),
        network,
        number: arguments.number.map(|number| match number {
            NumberArgument::F32 => Number::Float,
            NumberArgument::Fixed => Number::Fixed,
        }),
        period_s: arguments.period.unwrap_or(plan.period_s as f32),
    };
    let core = set_up(&mut client, node, &setup).map_err(|error| words(&error))?;
    let setup = core.setup();
    let bar = spinner("replaying".into());
    let mut tell = |progress: Progress| {
        bar.set_message(format!("{} of {} samples", progress.samples, progress.of));
    };
    let check = Check::new(node, core);
    let keeps_time = arguments.bus.bus != BusName::Loop && arguments.rate != Rate::Max;
    let raised_priority = keeps_time && request_real_time();
    let played = match arguments.faults {
        Some(faults) => {
            let faults = FaultPlan { sent: faults, received: faults };
            let mut bus = FaultInjector::new(&mut bus, faults, arguments.seed);
            play(&mut bus, &plan, arguments.rate, check, &mut tell)
        }
        None => play(&mut bus, &plan, arguments.rate, check, &mut tell),
    };
    bar.finish_and_clear();
    let played = played.map_err(|error| words(&error))?;
    // Leave the driver as it is found: not armed. One that fell silent is in the report.
    let mut client = Client::new(&mut bus, node);
    let at = canopen_rs::Address::new(firmware::node::dictionary::index::STATE, 1);
    let disarmed = client.write(at, &[0]);

    let (trace, name) = (arguments.trace.display().to_string(), arguments.bus.bus.to_string());
    let about = About {
        trace: &trace,
        bus: &name,
        node: node.number(),
        number: if setup.number == Number::Float { "f32" } else { "fixed" },
        clock: arguments.bus.clock(),
        raised_priority,
        period_s: setup.period_s,
        rate: arguments.rate,
        is_virtual: arguments.bus.bus == BusName::Loop,
        bit_rate: arguments.bus.bit_rate.bits_per_second(),
    };
    let report = Report::new(&about, &plan, played);
    let json = serde_json::to_string_pretty(&report).map_err(|error| error.to_string())? + "\n";
    arguments.output.write(&[("replay.json", json.as_str())])?;
    if arguments.output.json {
        say(&json)?;
    } else {
        say(&report.text())?;
    }
    if report.holds {
        disarmed.map_err(|error| words(&error))?;
    }
    Ok(if report.holds { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
