//! `tune`: tunes a joint over the bus, and keeps new parameters only if they are proven to gain.

use super::bus::BusArguments;
use super::error::{Refusal, Result, in_file, in_part};
use super::joint_on_bus::{JointArguments, MotionArguments, start_hub};
use super::output::{OutputArguments, is_answered_yes, print_message, print_text};
use super::tune_from::{ForeignArguments, run_foreign};
use super::values::{Expected, number};
use clap::Args;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use joint_tuning::trial_set::UndoError;
use joint_tuning::{MotionLimits, TuneOptions, TuneUser, motion, trial_set, tune};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments of `tune`.
#[derive(Args)]
pub struct TuneArguments {
    /// Motion of the trial: a CSV file with time_s and position_rad [default: sines and a slow triangle through reversals]
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Time on the bus, minutes; what a proof needs at least is performed in any case, which the question states
    #[arg(long, value_name = "MIN", default_value = "5", value_parser = minutes)]
    minutes: f64,
    /// Do not ask before the joint moves
    #[arg(long)]
    yes: bool,
    /// Also try laws that can supply energy, and so keep a joint moving
    #[arg(long)]
    allow_active: bool,
    /// Bring back the parameters from before the last tuning, and save them
    #[arg(long, conflicts_with_all = ["motion", "yes", "allow_active"])]
    undo: bool,
    #[command(flatten)]
    joint: JointArguments,
    #[command(flatten)]
    limits: MotionArguments,
    #[command(flatten)]
    foreign: ForeignArguments,
    #[command(flatten)]
    bus: BusArguments,
    #[command(flatten)]
    output: OutputArguments,
}

fn minutes(text: &str) -> Result<f64, Expected> {
    number(text, |minutes| (1.0..=60.0).contains(minutes), "1 to 60")
}

/// The user at a terminal.
pub(super) struct Terminal {
    pub(super) yes: bool,
    pub(super) quiet: bool,
}

impl TuneUser for Terminal {
    fn confirms(&mut self, what: &str) -> bool {
        if self.yes {
            if !self.quiet {
                print_message(what);
            }
            return true;
        }
        if !std::io::stdin().is_terminal() {
            print_message(&Refusal::NoTerminal(what.to_owned()).to_string());
            return false;
        }
        is_answered_yes(what).unwrap_or(false)
    }

    fn progress(&mut self, line: &str) {
        if !self.quiet {
            print_message(line);
        }
    }
}

/// Runs the command.
pub fn run(arguments: &TuneArguments) -> Result<ExitCode> {
    if let Some(tool) = arguments.foreign.from {
        return run_foreign(tool, &arguments.foreign, &arguments.output);
    }
    let (limits, _) = arguments.limits.limits(false)?;
    let motion = arguments.motion.as_ref().map(|path| read_motion(path, &limits)).transpose()?;
    let hub = start_hub(&arguments.bus, &arguments.joint)?;
    let client = arguments.bus.client(arguments.bus.open(&hub)?)?;
    let name = arguments.bus.joint_name();
    if arguments.undo {
        return undo(client, &name, arguments.output.json);
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let options = TuneOptions {
        node: arguments.bus.node_id,
        limits,
        seconds: 60.0 * arguments.minutes,
        motion,
        allow_active: arguments.allow_active,
        seed: arguments.joint.seed(),
        joint: name,
        is_simulated: arguments.bus.is_loop(),
        now_s: now.as_secs(),
    };
    let interrupted = super::interrupt::flag()?;
    let mut user =
        Terminal { yes: arguments.yes || options.is_simulated, quiet: arguments.output.json };
    let session = tune(client, &options, interrupted, &mut user)?;
    let files = joint_tuning::results::files(&session)?;
    let all: Vec<(&str, &[u8])> = files.all().collect();
    let output = arguments.output.of_command("tune");
    output.finish(&all, &files.document.1, &session.report.text())?;
    Ok(if session.is_saved() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Reads the motion of a file.
pub(super) fn read_motion(path: &PathBuf, limits: &MotionLimits) -> Result<motion::Motion> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(in_file(path))?;
    Ok(motion::parse(&name, &text, limits)?)
}

fn undo<B: Bus>(mut client: Client<B>, name: &str, json: bool) -> Result<ExitCode> {
    let record = trial_set::undo(&mut client).map_err(|error| match error {
        UndoError::NotTuned => in_part(name)(error),
        error => error.into(),
    })?;
    let crc = format!("{:08x}", record.before_crc);
    let text = if json {
        serde_json::json!({"joint": name, "undone": true, "crc": crc}).to_string()
    } else {
        format!("{name}: the parameters from before the tuning are back and saved (crc {crc})")
    };
    print_text(&(text + "\n")).map(|()| ExitCode::SUCCESS)
}
