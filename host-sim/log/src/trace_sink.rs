//! Export of measured data as a CAN log.
//!
//! Each row becomes the frames that a driver would receive ([`Writer`]). Runs whose times follow each other keep their
//! clock; other runs are placed one second after the previous one. Stamps count from the first row, and are in
//! nanoseconds if microseconds would round them. Values are rounded to `f32`, as in a driver. Run names that are not
//! numbers are replaced by numbers. Covariates are left out, except the selected one.

use super::contract;
use super::dataset::{Dataset, Run};
use compensator_core::can::{Message, NodeId, TraceEntry};
use compensator_core::quantity::Quantity;
use joint_trace::{Fraction, TextFormat, TraceSample, Writer};
use std::collections::HashSet;
use std::io::{self, Write};

/// Pause between runs that overlap in time, ns.
const BETWEEN_RUNS_NS: i64 = 1_000_000_000;

/// Options of the export.
#[derive(Clone, Debug)]
pub struct EmitOptions {
    /// Name of the CAN interface.
    pub interface: String,
    /// Node id of the joint.
    pub node: NodeId,
    /// Stamp of the first row, s.
    pub start_s: u32,
    /// The covariate that is written as the auxiliary quantity.
    pub auxiliary: Option<String>,
    /// The format. Only candump's has an interface name.
    pub format: TextFormat,
}

impl Default for EmitOptions {
    fn default() -> Self {
        Self {
            interface: "vcan0".into(),
            node: NodeId::FIRST,
            start_s: 0,
            auxiliary: None,
            format: TextFormat::Candump,
        }
    }
}

/// Error of the export; one line.
#[derive(Debug, thiserror::Error)]
pub enum EmitError {
    /// Writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The interface name is invalid in a log line.
    #[error("interface {0:?}: expected a name of up to 15 letters and digits, as can0")]
    Interface(String),
    /// The data set has no such covariate.
    #[error("auxiliary column {0:?}: not among the covariates of the data")]
    Auxiliary(String),
    /// A time is too far from the first one for a stamp.
    #[error("run {run}: a time of {time_s} s after the first: expected less than 30 years")]
    Time {
        /// The run.
        run: String,
        /// Its time.
        time_s: f64,
    },
}

/// Writes a data set as the log of one joint.
///
/// # Errors
/// If a name, column or time is invalid in such a log, or if writing fails.
pub fn emit(data: &Dataset, options: &EmitOptions, out: impl Write) -> Result<(), EmitError> {
    let interface = options.interface.as_str();
    let legal = !interface.is_empty()
        && interface.len() <= 15
        && interface.bytes().all(|byte| byte.is_ascii_graphic());
    if !legal {
        return Err(EmitError::Interface(interface.to_owned()));
    }
    let auxiliary = options
        .auxiliary
        .as_ref()
        .map(|name| {
            let at = data.covariates.iter().position(|covariate| covariate == name);
            at.ok_or_else(|| EmitError::Auxiliary(name.clone()))
        })
        .transpose()?;
    let stamps = stamps(data, options.start_s)?;
    let whole = stamps.iter().flatten().all(|stamp| stamp % 1000 == 0);
    let fraction = if whole { Fraction::Microseconds } else { Fraction::Nanoseconds };
    let mut writer = Writer::new(out, interface, options.node, fraction).in_format(options.format);
    let first = stamps.iter().flatten().next().copied().unwrap_or_default();
    writer.message(first, &Message::Entry(options.node, TraceEntry::JointKind(data.joint)))?;
    for ((run, number), stamps) in data.runs.iter().zip(run_numbers(data)).zip(&stamps) {
        let covariate = auxiliary.and_then(|at| run.extra.get(at)).map(Vec::as_slice);
        for (row, time_ns) in stamps.iter().enumerate() {
            writer.sample(&TraceSample {
                time_ns: *time_ns,
                run: Some(number),
                sequence: row as u32,
                ..sample(run, row, covariate)
            })?;
        }
    }
    Ok(writer.finish()?)
}

/// Converts a row to a sample of the bus.
fn sample(run: &Run, row: usize, auxiliary: Option<&[f64]>) -> TraceSample {
    let mut sample = TraceSample::EMPTY;
    let required = [Quantity::Velocity, Quantity::Torque];
    for quantity in required.into_iter().chain(contract::optional()) {
        if let Some(column) = run.get(quantity) {
            sample.set(quantity, column[row] as f32);
        }
    }
    if let Some(column) = auxiliary {
        sample.set(Quantity::Auxiliary, column[row] as f32);
    }
    sample
}

/// Returns the numbers of the runs: their names if all are distinct numbers, else 1, 2, 3.
pub fn run_numbers(data: &Dataset) -> Vec<u32> {
    let parsed: Option<Vec<u32>> = data.runs.iter().map(|run| run.name.parse().ok()).collect();
    let distinct =
        |numbers: &Vec<u32>| numbers.iter().collect::<HashSet<_>>().len() == numbers.len();
    parsed.filter(distinct).unwrap_or_else(|| (1..=data.runs.len() as u32).collect())
}

/// Returns the stamps of each run's rows, ns.
fn stamps(data: &Dataset, start_s: u32) -> Result<Vec<Vec<u64>>, EmitError> {
    const MAX_DURATION_S: f64 = 9e8;
    let firsts = data.runs.iter().flat_map(|run| run.time_s.first());
    let origin = firsts.copied().fold(f64::INFINITY, f64::min);
    let start = i64::from(start_s) * 1_000_000_000;
    let mut end: Option<i64> = None;
    let mut stamps = Vec::with_capacity(data.runs.len());
    for run in &data.runs {
        let late = run.time_s.iter().find(|time| **time - origin > MAX_DURATION_S);
        if let Some(time_s) = late {
            return Err(EmitError::Time { run: run.name.clone(), time_s: time_s - origin });
        }
        let since = |time: f64| start + ((time - origin) * 1e9).round() as i64;
        let first = run.time_s.first().map_or(start, |time| since(*time));
        // If the clock of this run does not follow that of the previous run, it is shifted.
        let shift = end.filter(|end| first <= *end).map_or(0, |end| end + BETWEEN_RUNS_NS - first);
        let stamped = run.time_s.iter().map(|time| (since(*time) + shift).max(0) as u64);
        let stamped: Vec<u64> = stamped.collect();
        end = stamped.last().map(|last| *last as i64).or(end);
        stamps.push(stamped);
    }
    Ok(stamps)
}
