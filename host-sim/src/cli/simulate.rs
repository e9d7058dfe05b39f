//! `simulate`: writes the log of a simulated machine and its true parameters.
//!
//! Without `--hide`, load and pressure act on the joint as in the model of Ding et al. With `--hide`, a random campaign
//! contains none, one or two hidden effects that a diagnosis has to find.

use super::error::{Result, in_part};
use super::missing_feature::refusal;
use super::output::{OutputArguments, pretty};
use super::progress::spinner;
use super::values::{Expected, number, one_of};
use crate::simulated;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use joint_log::{EmitOptions, emit};
use joint_trace::TextFormat;
use simulated_machines::scenarios::Hide;
use simulated_machines::{Log, Request, SIMULATIONS, Simulated, Simulation};

/// Arguments of `simulate`.
#[derive(clap::Args)]
pub struct SimulateArguments {
    /// Simulated machine
    #[arg(value_parser = simulations())]
    scenario: &'static Simulation,
    /// Hide a physical effect, such as `pressure-coulomb`; repeat the option for two
    ///
    /// SIZE is in the unit of the effect's term; by default a detectable size is drawn. CAUSE may also be `none` or
    /// `unknown`. All other settings are then drawn from the seed.
    #[arg(long, value_name = "CAUSE[:SIZE]", value_parser = Hide::parse, conflicts_with_all = ["unloaded", "steady"])]
    hide: Vec<Hide>,
    /// Seed of the machine; the same seed gives the same log
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Number of runs [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Duration of a run, s [default: 10]
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: Option<f64>,
    /// Sample rate, Hz [default: 1000]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
    /// Standard deviation of the torque sensor's noise, Nm [default: 0.05]
    #[arg(long, value_name = "NM", value_parser = positive)]
    noise: Option<f64>,
    /// Simulate without side load and pressure
    #[arg(long)]
    unloaded: bool,
    /// Simulate steady sliding only
    #[arg(long)]
    steady: bool,
    /// Format of the CAN trace: candump (trace.log), Vector (trace.asc) or PEAK (trace.trc)
    #[arg(long, value_name = "FORMAT", value_parser = formats(), default_value = "candump")]
    format: TextFormat,
    /// Replace the files of another simulation in the folder
    ///
    /// Without it, the command ends with an error if a file that it would write exists with other contents. The same command
    /// may be repeated: the same seed and options give the same files.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    output: OutputArguments,
}

/// Returns the parser of the format of a CAN trace.
fn formats() -> impl TypedValueParser<Value = TextFormat> {
    one_of([
        ("candump", "`candump -L`", TextFormat::Candump),
        ("asc", "Vector's ASC", TextFormat::Asc),
        ("trc", "PEAK's TRC 2.1", TextFormat::Trc),
    ])
}

fn positive(text: &str) -> Result<f64, Expected> {
    let is_positive = |number: &f64| *number > 0.0 && *number <= 1e6;
    number(text, is_positive, "a number above 0 and at most 1e6")
}

/// The machines of the papers, by name, which need the feature `papers`.
#[cfg(any(test, not(feature = "papers")))]
const PAPER_MACHINES: [&str; 3] = ["damper", "joint-bench", "manipulator"];

fn machines() -> impl Iterator<Item = &'static Simulation> + Clone {
    #[cfg(feature = "papers")]
    let others = paper_machines::SIMULATIONS;
    #[cfg(not(feature = "papers"))]
    let others: &[Simulation] = &[];
    SIMULATIONS.iter().chain(others)
}

/// Returns the parser of the machine's name; the help lists every machine with its description. A build without the feature
/// `papers` refuses the machines of the papers.
fn simulations() -> impl TypedValueParser<Value = &'static Simulation> {
    let values = machines().map(|of| PossibleValue::new(of.name).help(of.about));
    #[cfg(not(feature = "papers"))]
    let values = values.chain(
        PAPER_MACHINES
            .map(|name| PossibleValue::new(name).help("Needs a build with the feature `papers`")),
    );
    PossibleValuesParser::new(values).try_map(|name| {
        let found = machines().find(|of| of.name == name);
        found.ok_or_else(|| refusal(format!("simulate {name}"), "papers"))
    })
}

/// Runs the command.
pub fn run(arguments: &SimulateArguments) -> Result {
    let request = Request {
        seed: arguments.seed,
        runs: arguments.runs.map(|runs| runs as usize),
        seconds: arguments.seconds,
        rate_hz: arguments.rate,
        noise_nm: arguments.noise,
        unloaded: arguments.unloaded,
        steady: arguments.steady,
        hide: arguments.hide.clone(),
    };
    let bar = spinner(format!("simulating {}", arguments.scenario.name));
    let Simulated { log, truth, hidden } = arguments.scenario.simulate(&request)?;
    let (csv, json) = (log.csv(), pretty(&truth)?);
    let mut files = vec![("data.csv", csv.as_bytes()), ("truth.json", json.as_bytes())];
    let format = arguments.format;
    let name = format!("trace.{}", format.extension());
    let trace = trace(&log, format).map_err(in_part(&name))?;
    files.extend(trace.as_ref().map(|trace| (name.as_str(), trace.as_slice())));
    if !arguments.force {
        arguments.output.refuse_other_contents(&files)?;
    }
    bar.finish_and_clear();
    let (runs, rows, seed) = (log.runs.len(), log.rows(), arguments.seed);
    let mut text = format!("simulated: {runs} runs, {rows} rows, seed {seed}\n");
    hidden.iter().for_each(|line| text += &format!("{line}\n"));
    arguments.output.finish(&files, &json, &text)
}

/// Maximum number of rows for which a CAN trace is written. At six frames per row, this is about one gigabyte.
const MAX_TRACED_ROWS: usize = 2_000_000;

/// Returns the CAN trace of the log. Returns `None` for a log of several joints, because a trace holds the frames of one
/// driver, and for a log with more than [`MAX_TRACED_ROWS`] rows.
fn trace(log: &Log, format: TextFormat) -> Result<Option<Vec<u8>>> {
    let is_one_joint = log.columns.iter().any(|name| ["torque_nm", "force_n"].contains(&&**name));
    if log.rows() > MAX_TRACED_ROWS || !is_one_joint {
        return Ok(None);
    }
    let data = &simulated::dataset(log);
    let auxiliary = data.covariates.first().cloned();
    let options = EmitOptions { auxiliary, format, ..EmitOptions::default() };
    let mut trace = Vec::new();
    emit(data, &options, &mut trace)?;
    Ok(Some(trace))
}

#[cfg(all(test, feature = "papers"))]
mod tests {
    use super::*;

    #[test]
    fn paper_machines_are_those_refused_without_feature() {
        let names: Vec<&str> = paper_machines::SIMULATIONS.iter().map(|of| of.name).collect();
        assert_eq!(names, PAPER_MACHINES);
    }
}
