//! `simulate`: a simulated machine's log and the truth behind it.
//!
//! Without `--hide` the log is of a joint whose load and pressure act as Ding et al. say. With it, one
//! physical effect or two, or none, is hidden in an otherwise random campaign, for a diagnosis to find.

use super::output::{OutputArguments, say};
use crate::simulated;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use friction_identification::data::{EmitOptions, emit};
use joint_trace::TextFormat;
use simulated_machines::scenarios::Hide;
use simulated_machines::{Log, Request, SIMULATIONS, Simulated, Simulation};

/// Arguments of `simulate`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The machine
    #[arg(value_parser = simulations())]
    scenario: &'static dyn Simulation,
    #[command(flatten)]
    output: OutputArguments,
    /// Hide a physical effect, of SIZE in its term's unit or of one that shows; `none` and `unknown`
    /// are causes too. Twice for two effects. What is not given below is then drawn by the seed
    #[arg(long, value_name = "CAUSE[:SIZE]", value_parser = Hide::parse, conflicts_with_all = ["unloaded", "steady"])]
    hide: Vec<Hide>,
    /// Draws the machine; the same seed, the same log
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Number of runs [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Length of a run, s [default: 10]
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: Option<f64>,
    /// Sample rate, Hz [default: 1000]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
    /// Standard deviation of the torque sensor, Nm [default: 0.05]
    #[arg(long, value_name = "NM", value_parser = positive)]
    noise: Option<f64>,
    /// No side load and no pressure
    #[arg(long)]
    unloaded: bool,
    /// Steady sliding only
    #[arg(long)]
    steady: bool,
    /// The CAN trace as candump, Vector or PEAK write it: trace.log, trace.asc, trace.trc
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t = TraceFormat::Candump)]
    format: TraceFormat,
}

/// Formats of a CAN trace.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum TraceFormat {
    /// `candump -L`.
    Candump,
    /// Vector's ASC.
    Asc,
    /// PEAK's TRC 2.1.
    Trc,
}

impl From<TraceFormat> for TextFormat {
    fn from(format: TraceFormat) -> Self {
        match format {
            TraceFormat::Candump => Self::Candump,
            TraceFormat::Asc => Self::Asc,
            TraceFormat::Trc => Self::Trc,
        }
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number <= 1e6 => Ok(number),
        _ => Err("expected a number above 0 and up to 1e6".into()),
    }
}

/// The names of the simulations, each with what it is.
fn simulations() -> impl TypedValueParser<Value = &'static dyn Simulation> {
    let values = SIMULATIONS.iter().map(|of| PossibleValue::new(of.name()).help(of.about()));
    PossibleValuesParser::new(values).try_map(|name| {
        SIMULATIONS.iter().copied().find(|of| of.name() == name).ok_or("no such simulation")
    })
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
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
    let Simulated { log, csv, truth, hidden } = arguments.scenario.simulate(&request)?;
    let json = serde_json::to_string_pretty(&truth).map_err(|e| e.to_string())? + "\n";
    let mut files = vec![("data.csv", csv.as_str()), ("truth.json", json.as_str())];
    let format = TextFormat::from(arguments.format);
    let name = format!("trace.{}", format.ending());
    let trace = trace(&log, format).map_err(|error| format!("{name}: {error}"))?;
    files.extend(trace.as_ref().map(|trace| (name.as_str(), trace.as_str())));
    arguments.output.write(&files)?;
    if arguments.output.json {
        return say(&json);
    }
    let out = arguments.output.folder().display();
    let written: Vec<String> = files.iter().map(|(name, _)| format!("{out}/{name}")).collect();
    let (runs, rows, seed) = (log.runs.len(), log.rows(), arguments.seed);
    let hidden: String = hidden.iter().map(|line| format!("{line}\n")).collect();
    let written = written.join(", ");
    say(&format!("simulated: {runs} runs, {rows} rows, seed {seed}\n{hidden}written: {written}\n"))
}

/// Rows from which on no trace is written: six frames each would be a gigabyte.
const MOST_TRACED: usize = 2_000_000;

/// The log as it would have been traced on the joint's bus; none of a log of several joints, whose drivers would each
/// have a bus's share of frames.
fn trace(log: &Log, format: TextFormat) -> Result<Option<String>, String> {
    let is_one_joint = log.columns.iter().any(|name| ["torque_nm", "force_n"].contains(&&**name));
    if log.rows() > MOST_TRACED || !is_one_joint {
        return Ok(None);
    }
    let data = &simulated::dataset(log);
    let auxiliary = data.covariates.first().cloned();
    let options = EmitOptions { auxiliary, format, ..EmitOptions::default() };
    let mut trace = Vec::new();
    emit(data, &options, &mut trace).map_err(|error| error.to_string())?;
    String::from_utf8(trace).map(Some).map_err(|error| error.to_string())
}
