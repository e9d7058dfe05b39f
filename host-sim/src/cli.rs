//! The command line.
//!
//! Every command accepts `--out DIR` (folder of the result files) and `--json` (result on standard output as JSON).
//!
//! Exit codes: 0 success; 1 a requested check failed; 2 bad usage or bad input. Every error is one line on standard
//! error. A command writes its files only after all computations succeeded, so a failed command leaves no file behind.

mod access;
mod bus;
mod compare;
mod demo;
mod diagnose;
mod each_joint;
mod error;
mod examples;
mod export;
mod fit_arguments;
mod fleet;
mod identify;
mod input;
#[cfg(feature = "papers")]
mod inside;
mod interrupt;
mod joint_on_bus;
mod missing_feature;
mod monitor;
mod move_joint;
mod network;
mod node;
mod output;
#[cfg(feature = "papers")]
mod paper;
mod parameters;
mod predict;
mod predict_adapted;
mod progress;
mod replay;
mod scope;
#[cfg(feature = "update")]
mod sign;
mod simulate;
mod table;
mod terminal;
mod tune;
mod tune_from;
#[cfg(feature = "update")]
mod update;
mod values;
mod words;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use error::Result;
use input::LogArguments;
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "host-sim", version, about, max_term_width = 100)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Demonstrate all steps in one minute: simulate a joint with a hidden effect, diagnose its CAN trace, compare with the truth
    Demo(demo::DemoArguments),
    /// Simulate a machine: write its log and the true parameters
    Simulate(simulate::SimulateArguments),
    /// Find the physical effects a friction model misses, and the gain of an extended model
    Diagnose(diagnose::DiagnoseArguments),
    /// Fit one friction model to measured data
    Identify(identify::IdentifyArguments),
    /// Fit all friction models to measured data and compare them
    Compare(compare::CompareArguments),
    /// Predict the torque of every row of a log with a fitted model
    Predict(predict::PredictArguments),
    /// Export a fitted model as a flash record, Rust, C, ONNX, MuJoCo or URDF
    Export(export::ExportArguments),
    /// Diagnose the logs of many joints and campaigns, and compare them on one page
    Fleet(fleet::FleetArguments),
    #[cfg(feature = "papers")]
    /// Reproduce the tables and plots of a paper, beside the printed values
    Paper(paper::PaperArguments),
    #[cfg(not(feature = "papers"))]
    /// Reproduce the tables and plots of a paper (needs a build with the feature `papers`)
    #[command(disable_help_flag = true)]
    Paper(missing_feature::AnyArguments),
    /// Replay a CAN trace to a joint driver and check every answer bit for bit
    Replay(replay::ReplayArguments),
    /// Run a joint driver on this PC, connected to a CAN bus
    Node(node::NodeArguments),
    /// Move a joint: to a position, along a sine or a file; and report how well it followed
    Move(move_joint::MoveArguments),
    /// Tune a joint over the bus: measure, diagnose, try new parameters, and save them only if the joint moves better
    Tune(tune::TuneArguments),
    /// Read and write a joint driver's parameters
    Params(parameters::ParamsArguments),
    /// Show live data of a joint: velocity, friction, current, flags, model-in-band
    Monitor(monitor::MonitorArguments),
    /// Record signals of a joint's current loop at up to 20 kHz, around a trigger
    Scope(scope::ScopeArguments),
    /// Show or change the lock of a joint: its state, its key
    Access(access::AccessArguments),
    #[cfg(feature = "update")]
    /// Make a signed package of a program for `update`, or a key pair
    Sign(sign::SignArguments),
    #[cfg(not(feature = "update"))]
    /// Make a signed package of a program for `update`, or a key pair (needs a build with the feature `update`)
    #[command(disable_help_flag = true)]
    Sign(missing_feature::AnyArguments),
    #[cfg(feature = "update")]
    /// Install a signed package on a joint over its bus
    Update(update::UpdateArguments),
    #[cfg(not(feature = "update"))]
    /// Install a signed package on a joint over its bus (needs a build with the feature `update`)
    #[command(disable_help_flag = true)]
    Update(missing_feature::AnyArguments),
}

/// Returns the command line with all its commands and their help.
pub fn command() -> clap::Command {
    examples::with_examples(CommandLine::command(), "")
}

/// Runs the command line and returns the exit code.
pub fn run() -> ExitCode {
    let matches = command().try_get_matches();
    let arguments = match matches.and_then(|matches| CommandLine::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => return report_usage_error(&error),
    };
    execute(arguments.command).unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::from(2)
    })
}

/// Executes a command, or describes the columns of its logs. Returns exit code 1 if a requested check failed.
fn execute(command: Command) -> Result<ExitCode> {
    if let Some(columns) = command.log().map(LogArguments::described_columns).transpose()?.flatten()
    {
        return output::print_formatted(&columns).map(|()| ExitCode::SUCCESS);
    }
    let done = |outcome: Result| outcome.map(|()| ExitCode::SUCCESS);
    match command {
        Command::Access(arguments) => done(access::run(&arguments)),
        Command::Identify(arguments) => done(identify::run(&arguments)),
        Command::Compare(arguments) => done(compare::run(&arguments)),
        Command::Diagnose(arguments) => done(diagnose::run(&arguments)),
        Command::Demo(arguments) => done(demo::run(&arguments)),
        Command::Export(arguments) => done(export::run(&arguments)),
        Command::Fleet(arguments) => done(fleet::run(&arguments)),
        Command::Monitor(arguments) => done(monitor::run(&arguments)),
        Command::Node(arguments) => done(node::run(&arguments)),
        #[cfg(feature = "papers")]
        Command::Paper(arguments) => done(paper::run(&arguments)),
        #[cfg(not(feature = "papers"))]
        Command::Paper(_) => Err(missing_feature::refusal("paper", "papers").into()),
        Command::Params(arguments) => parameters::run(&arguments),
        Command::Predict(arguments) => done(predict::run(&arguments)),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Scope(arguments) => done(scope::run(&arguments)),
        #[cfg(feature = "update")]
        Command::Sign(arguments) => done(sign::run(&arguments)),
        #[cfg(not(feature = "update"))]
        Command::Sign(_) => Err(missing_feature::refusal("sign", "update").into()),
        Command::Simulate(arguments) => done(simulate::run(&arguments)),
        Command::Move(arguments) => done(move_joint::run(&arguments)),
        Command::Tune(arguments) => tune::run(&arguments),
        #[cfg(feature = "update")]
        Command::Update(arguments) => done(update::run(&arguments)),
        #[cfg(not(feature = "update"))]
        Command::Update(_) => Err(missing_feature::refusal("update", "update").into()),
    }
}

impl Command {
    /// Returns the arguments that name measured logs, if the command reads them.
    fn log(&self) -> Option<&LogArguments> {
        match self {
            Self::Identify(arguments) => Some(&arguments.data.log),
            Self::Compare(arguments) => Some(&arguments.data.log),
            Self::Diagnose(arguments) => Some(&arguments.data.log),
            Self::Predict(arguments) => Some(&arguments.log),
            _ => None,
        }
    }
}

/// Prints a usage error as one line, and help or version unchanged. Returns the exit code.
fn report_usage_error(error: &clap::Error) -> ExitCode {
    let requested_output = [ErrorKind::DisplayHelp, ErrorKind::DisplayVersion];
    let help_for_missing = ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
    if requested_output.contains(&error.kind()) || error.kind() == help_for_missing {
        // If the terminal is closed, the error cannot be reported anywhere.
        let _ = error.print();
        return ExitCode::from(if requested_output.contains(&error.kind()) { 0 } else { 2 });
    }
    let text = error.to_string();
    let is_advice = |line: &str| ["Usage:", "For more"].iter().any(|start| line.starts_with(start));
    let message = text.lines().take_while(|line| !is_advice(line));
    let words: Vec<&str> = message.flat_map(str::split_whitespace).collect();
    eprintln!("{}", words.join(" "));
    ExitCode::from(2)
}
