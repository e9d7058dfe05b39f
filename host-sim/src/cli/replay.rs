//! `replay`: replays a CAN trace to a joint driver and compares every answer with the core, bit for bit.

use super::bus::BusArguments;
use super::error::Result;
use super::network;
use super::output::{OutputArguments, pretty, print_result};
use super::progress::{announce, counted_progress, duration_in_words};
use super::values::{Expected, number, one_of};
use crate::driver_file;
use firmware::hil::NumberType;
use firmware::level_learner::{OFF, ON};
use joint_bus::bus::{FaultInjector, FaultPlan, Faults};
use joint_bus::replay::real_time::request_real_time;
use joint_bus::replay::report::ReplayDescription;
use joint_bus::replay::{Check, Plan, Rate, ReplayReport, ReplaySetup, play, set_up};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `replay`.
#[derive(clap::Args)]
pub struct ReplayArguments {
    /// CAN trace with the frames of a joint, in the format of candump -L (for example `trace.log` of simulate)
    #[arg(value_name = "TRACE")]
    trace: PathBuf,
    /// Replay speed: 1 as recorded, N times as fast, or max
    #[arg(long, value_name = "1|N|max", default_value = "1", value_parser = rate)]
    rate: Rate,
    /// Parameters to write to the driver before the replay; by default the driver's own parameters
    #[arg(long, value_name = "PARAMS.TOML")]
    params: Option<PathBuf>,
    /// Number type the driver computes with; by default its current one
    #[arg(long, value_name = "NUMBER", value_parser = one_of(NUMBERS))]
    number: Option<NumberType>,
    /// Adaptation of the friction levels (2044h): the driver and the PC learn from the torques of the trace; by default as the
    /// driver is set
    #[arg(long, value_name = "MODE", value_parser = one_of(ADAPTATIONS))]
    adaptation: Option<u8>,
    /// Time between two SYNC frames, s; by default that of the trace
    #[arg(long, value_name = "S")]
    period: Option<f32>,
    /// Shares of frames to drop, duplicate, corrupt, delay or reorder, for example drop=0.01,corrupt=0.001
    #[arg(long, value_name = "FAULT=SHARE,...", value_parser = faults)]
    faults: Option<Faults>,
    /// Seed of the random faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    bus: BusArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// Number types that a driver computes with.
const NUMBERS: [(&str, &str, NumberType); 2] = [
    ("f32", "f32", NumberType::Float),
    ("fixed", "Fixed point, 20 fractional bits", NumberType::Fixed),
];

/// Modes of the adaptation.
const ADAPTATIONS: [(&str, &str, u8); 2] =
    [("off", "The set applies", OFF), ("on", "The driver learns gains on its set", ON)];

fn rate(text: &str) -> Result<Rate, Expected> {
    if text == "max" {
        return Ok(Rate::Max);
    }
    let expected = "1, a number above 0, or max";
    number(text.trim_end_matches('x'), |times| *times > 0.0, expected).map(Rate::Times)
}

/// A share of faults that is not accepted.
#[derive(Debug, thiserror::Error)]
#[error("{0}: expected drop, duplicate, corrupt, delay or reorder = SHARE from 0 to 1")]
struct UnfitFault(String);

fn faults(text: &str) -> Result<Faults, UnfitFault> {
    let mut faults = Faults { longest_delay_ns: 2_000_000, ..Faults::default() };
    for part in text.split(',') {
        let unfit = || UnfitFault(part.to_owned());
        let (name, share) = part.split_once('=').ok_or_else(unfit)?;
        let is_share = |share: &f64| (0.0..=1.0).contains(share);
        let share = number(share, is_share, "").map_err(|_| unfit())?;
        match name.trim() {
            "drop" => faults.drop = share,
            "duplicate" => faults.duplicate = share,
            "corrupt" => faults.corrupt = share,
            "delay" => faults.delay = share,
            "reorder" => faults.reorder = share,
            _ => return Err(unfit()),
        }
    }
    Ok(faults)
}

/// Returns how many samples are replayed, and how long that takes. `is_virtual` is true for a bus in this process, whose
/// clock does not wait.
fn announcement(samples: u64, recorded_s: f64, rate: Rate, is_virtual: bool) -> String {
    let recorded = duration_in_words(recorded_s);
    match rate {
        _ if is_virtual => {
            format!("replaying {samples} samples ({recorded} recorded) as fast as this PC computes")
        }
        Rate::Max => {
            format!(
                "replaying {samples} samples ({recorded} recorded) as fast as the driver answers"
            )
        }
        Rate::Times(times) => format!(
            "replaying {samples} samples takes {} at rate {times}; --rate max is as fast as the driver answers",
            duration_in_words(recorded_s / times)
        ),
    }
}

/// Runs the command. Returns exit code 1 if an answer differs or is missing.
pub fn run(arguments: &ReplayArguments) -> Result<ExitCode> {
    let node = arguments.bus.node_id;
    let plan = Plan::read(&arguments.trace, node)?;
    let file = arguments.params.as_deref().map(driver_file::read).transpose()?;
    let network = file.as_ref().map(network::for_driver).transpose()?.flatten();
    let hub = arguments.bus.hub_with_driver()?;
    let mut bus = arguments.bus.open(&hub)?;
    // The set-up runs without faults, because only the replay is under test.
    let mut client = arguments.bus.client(&mut bus)?;
    let setup = ReplaySetup {
        friction: file.map(|file| file.friction()),
        network,
        number: arguments.number,
        period_s: arguments.period.unwrap_or(plan.period_s as f32),
        adaptation: arguments.adaptation,
    };
    let core = set_up(&mut client, node, &setup)?;
    let setup = core.setup();
    let recorded_s = plan.frames.last().map_or(0.0, |frame| frame.due_ns as f64 * 1e-9);
    let is_virtual = arguments.bus.is_loop();
    announce(&announcement(plan.samples, recorded_s, arguments.rate, is_virtual));
    let bar = counted_progress("replaying", "samples", plan.samples);
    let mut report_progress = |samples| bar.set_position(samples);
    let check = Check::new(node, core);
    let keeps_time = !is_virtual && arguments.rate != Rate::Max;
    let raised_priority = keeps_time && request_real_time();
    let played = match arguments.faults {
        Some(faults) => {
            let faults = FaultPlan { sent: faults, received: faults };
            let mut bus = FaultInjector::new(&mut bus, faults, arguments.seed);
            play(&mut bus, &plan, arguments.rate, check, &mut report_progress)
        }
        None => play(&mut bus, &plan, arguments.rate, check, &mut report_progress),
    };
    bar.finish_and_clear();
    let played = played?;
    // Disarm the driver, as it was before. The report shows a driver that stopped answering.
    let mut client = arguments.bus.client(&mut bus)?;
    let at = canopen_rs::Address::new(firmware::node::dictionary::index::STATE, 1);
    let disarmed = client.write(at, &[0]);

    let about = ReplayDescription {
        trace: arguments.trace.display().to_string(),
        bus: arguments.bus.bus.to_string(),
        node: node.number(),
        number: if setup.number == NumberType::Float { "f32" } else { "fixed" },
        clock: arguments.bus.clock(),
        raised_priority,
        period_s: setup.period_s,
        rate: match arguments.rate {
            Rate::Times(times) => Some(times),
            Rate::Max => None,
        },
        is_virtual,
        bit_rate: arguments.bus.bit_rate.bits_per_second(),
    };
    let report = ReplayReport::new(about, &plan, played);
    let json = pretty(&report)?;
    arguments.output.write(&[("replay.json", json.as_bytes())])?;
    print_result(arguments.output.json, &report, &report.text())?;
    if report.holds {
        disarmed?;
    }
    Ok(ExitCode::from(u8::from(!report.holds)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn announcement_states_duration_at_the_rate() {
        let at_one = announcement(500_000, 500.0, Rate::Times(1.0), false);
        for figure in ["500000 samples", " 8 min 20 s ", "rate 1;"] {
            assert!(at_one.contains(figure), "{figure}: {at_one}");
        }
        let faster = announcement(500, 500.0, Rate::Times(10.0), false);
        assert!(faster.contains(" 50 s ") && faster.contains("rate 10"), "{faster}");
        let mut lines = [at_one, faster].join("\n");
        for (rate, is_virtual) in [(Rate::Max, false), (Rate::Times(1.0), true)] {
            let unknown = announcement(500, 500.0, rate, is_virtual);
            assert!(unknown.contains("(8 min 20 s "), "{unknown}");
            lines += &format!("\n{unknown}");
        }
        crate::snapshot::check("units-of-commands", "announcement of a replay", &lines);
    }
}
