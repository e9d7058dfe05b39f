//! The command line.
//!
//! Every command takes `--out DIR` (where its files go) and `--json` (its result on standard output);
//! exit code 0 is done, 1 a check that failed, 2 bad usage or bad input, said in one line. A command that
//! fails leaves no file behind: files are written when all is known.

mod bus;
mod compare;
mod demo;
mod diagnose;
mod each_joint;
mod export;
mod identify;
mod identify_network;
mod input;
mod inside;
mod monitor;
mod node;
mod output;
mod paper;
mod parameters;
mod replay;
mod simulate;
mod terminal;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "host-sim", version, about, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fit one friction model to measured data
    Identify(identify::Arguments),
    /// Fit all friction models to measured data, side by side
    Compare(compare::Arguments),
    /// Say what the model gets wrong, why, and what a better one gains
    Diagnose(diagnose::Arguments),
    /// The whole story in a minute: a joint, a hidden effect, its CAN trace, the diagnosis, the truth
    Demo(demo::Arguments),
    /// A fitted model for other hands: a record for flash, Rust, C, MuJoCo, URDF
    Export(export::Arguments),
    /// A live view of a joint: velocity, friction, current, flags, model in band
    Monitor(monitor::Arguments),
    /// Be a joint driver, on the bus, on this PC
    Node(node::Arguments),
    /// A paper's tables and plots anew, ours beside the printed
    Paper(paper::Arguments),
    /// Read and write a joint driver's parameters
    Params(parameters::Arguments),
    /// Play a trace to a joint driver and hold every answer against the core, bit for bit
    Replay(replay::Arguments),
    /// Simulate a machine: its log, and the truth behind it
    Simulate(simulate::Arguments),
}

/// Runs the command line and returns the exit code.
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refused(&error),
    };
    let done = |outcome: Result<(), String>| outcome.map(|()| ExitCode::SUCCESS);
    let outcome = match arguments.command {
        Command::Identify(arguments) => done(identify::run(&arguments)),
        Command::Compare(arguments) => done(compare::run(&arguments)),
        Command::Diagnose(arguments) => done(diagnose::run(&arguments)),
        Command::Demo(arguments) => done(demo::run(&arguments)),
        Command::Export(arguments) => done(export::run(&arguments)),
        Command::Monitor(arguments) => done(monitor::run(&arguments)),
        Command::Node(arguments) => done(node::run(&arguments)),
        Command::Paper(arguments) => done(paper::run(&arguments)),
        Command::Params(arguments) => parameters::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Simulate(arguments) => done(simulate::run(&arguments)),
    };
    match outcome {
        Ok(code) => code,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

/// Bad usage in one line, as bad input is; help and version as they are.
fn refused(error: &clap::Error) -> ExitCode {
    let asked = [ErrorKind::DisplayHelp, ErrorKind::DisplayVersion];
    let help_instead = ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
    if asked.contains(&error.kind()) || error.kind() == help_instead {
        // Nobody is left to tell if the terminal has gone.
        let _ = error.print();
        return ExitCode::from(if asked.contains(&error.kind()) { 0 } else { 2 });
    }
    let text = error.to_string();
    let advice = |line: &str| ["Usage:", "For more"].iter().any(|start| line.starts_with(start));
    let said = text.lines().take_while(|line| !advice(line));
    let words: Vec<&str> = said.flat_map(str::split_whitespace).collect();
    eprintln!("{}", words.join(" "));
    ExitCode::from(2)
}
