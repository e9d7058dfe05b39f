//! `simulate`: a simulated machine's log and the truth behind it.

use super::output::{OutputArguments, say};
use crate::plant::{Recording, record};
use clap::ValueEnum;

/// Machines that can be simulated.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Scenario {
    /// The joint of paper 0 on its test stand: speeds, side loads and pressures
    UnderwaterJoint,
}

/// Arguments of `simulate`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The machine
    #[arg(value_enum)]
    scenario: Scenario,
    #[command(flatten)]
    output: OutputArguments,
    /// Draws the machine; the same seed, the same log
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Number of runs
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Length of a run, s
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = positive)]
    seconds: f64,
    /// Sample rate, Hz
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = positive)]
    rate: f64,
    /// Standard deviation of the torque sensor, Nm
    #[arg(long, value_name = "NM", default_value_t = 0.05, value_parser = positive)]
    noise: f64,
    /// No side load and no pressure
    #[arg(long)]
    unloaded: bool,
    /// Steady sliding only
    #[arg(long)]
    steady: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number <= 1e6 => Ok(number),
        _ => Err("expected a number above 0 and up to 1e6".into()),
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let Scenario::UnderwaterJoint = arguments.scenario;
    let how = Recording {
        runs: arguments.runs as usize,
        seconds: arguments.seconds,
        rate_hz: arguments.rate,
        noise_nm: arguments.noise,
        loaded: !arguments.unloaded,
        steady: arguments.steady,
    };
    if how.seconds * how.rate_hz * how.runs as f64 > 1e8 {
        return Err("--runs x --seconds x --rate: more than 1e8 rows".into());
    }
    let truth = record(arguments.seed, how);
    let json = serde_json::to_string_pretty(&truth.json()).map_err(|e| e.to_string())? + "\n";
    arguments.output.write(&[("data.csv", &truth.csv()), ("truth.json", &json)])?;
    if arguments.output.json {
        return say(&json);
    }
    let rows: usize = truth.runs.iter().map(Vec::len).sum();
    let out = arguments.output.out.display();
    say(&format!(
        "simulated: {} runs, {rows} rows, seed {}\nwritten: {out}/data.csv, {out}/truth.json\n",
        truth.runs.len(),
        truth.seed
    ))
}
