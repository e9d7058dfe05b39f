//! A log with the options of its reading.

use crate::computation::compute;
use crate::error::refused;
use crate::table::Table;
use friction_diagnose::prepare::{Error, PrepareOptions, Prepared, Source, corrections, prepare};
use friction_fit::Loss;
use friction_fit::spec::parse_rigid_body;
use joint_log::log_check::LogFindingKind;
use joint_log::work::{self, Progress};
use joint_log::{
    Cells, Dataset, MAX_BAD_SHARE, Preset, Quantity, ReadOptions, ServoTorque, SplitRule,
    TorqueConstant,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::fmt::Display;
use std::path::PathBuf;

/// Where a log is, and how it is read and split.
#[pyclass(frozen, module = "friction._core")]
pub struct Log {
    source: Source,
    options: PrepareOptions,
    /// Whether the user chose a split.
    has_split: bool,
    /// Kinds of defects that a diagnosis leaves as logged.
    pub as_logged: Vec<LogFindingKind>,
}

#[pymethods]
impl Log {
    #[new]
    #[pyo3(signature = (sources, *, test=vec![], columns=vec![], only=vec![], skip=0, decimate=1, rigid_body="", motion=None,
        as_logged=vec![], seed=0, hold_out=None, tail=None, rated_torque_nm=None,
        torque_constant=None, torque_from=None, bad_rows=None, preset=None, skip_lines=0, loss=None, rate_hz=None,
        join=false))]
    #[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
    fn new(
        py: Python<'_>,
        sources: Vec<Bound<'_, PyAny>>,
        test: Vec<Bound<'_, PyAny>>,
        columns: Vec<(String, String)>,
        only: Vec<(String, Vec<String>)>,
        skip: usize,
        decimate: usize,
        rigid_body: &str,
        motion: Option<&str>,
        as_logged: Vec<String>,
        seed: u64,
        hold_out: Option<(String, Vec<String>)>,
        tail: Option<f64>,
        rated_torque_nm: Option<f64>,
        torque_constant: Option<&str>,
        torque_from: Option<&str>,
        bad_rows: Option<f64>,
        preset: Option<&str>,
        skip_lines: usize,
        loss: Option<&str>,
        rate_hz: Option<f64>,
        join: bool,
    ) -> PyResult<Self> {
        let error = |error: Error| crate::error::to_python(py, error);
        let rigid_body = parse_rigid_body(rigid_body).map_err(|e| error(e.into()))?;
        let motion = parsed(py, "motion", motion, |text| match text {
            "smoothed" => Ok(true),
            "logged" => Ok(false),
            _ => Err("\"smoothed\" or \"logged\""),
        })?;
        let preset = parsed(py, "preset", preset, |name| {
            let known = || Preset::ALL.map(Preset::name).join(", ");
            Preset::parse(name).ok_or_else(|| format!("one of {}", known()))
        })?;
        let loss = parsed(py, "loss", loss, |text| match text {
            "squares" => Ok(Loss::Squares),
            "huber" => Ok(Loss::Huber),
            _ => Err("\"squares\" or \"huber\""),
        })?;
        let corrections = corrections(motion, &as_logged)
            .map_err(|end| refused(py, &format!("as_logged: {end}")))?;
        let texts = columns.iter().map(|(ours, theirs)| format!("{ours}={theirs}")).collect();
        let torque_constant =
            parsed(py, "torque_constant", torque_constant, TorqueConstant::parse)?;
        let torque_from = parsed(py, "torque_from", torque_from, ServoTorque::parse)?;
        let max_bad_share = bad_rows.unwrap_or(MAX_BAD_SHARE);
        if !(0.0..1.0).contains(&max_bad_share) {
            return Err(refused(py, "bad_rows: expected a share of at least 0 and below 1"));
        }
        let (source, held_out) = source(sources, test)?;
        let split = match (held_out.is_empty(), hold_out, tail) {
            (false, ..) => Some(SplitRule::Files(held_out)),
            (true, Some((column, values)), _) => Some(SplitRule::HoldOut { column, values }),
            (true, None, share) => share.map(|share| SplitRule::Tail { share }),
        };
        let has_split = split.is_some();
        let options = PrepareOptions {
            read: ReadOptions {
                columns,
                only,
                skip,
                skip_lines,
                preset,
                rated_torque_nm,
                torque_constant,
                torque_from,
                max_bad_share,
                rate_hz,
                join,
            },
            columns: texts,
            corrections,
            split: split.unwrap_or_default(),
            seed,
            rigid_body,
            decimate: decimate.max(1),
            loss,
        };
        let as_logged = as_logged.iter().filter_map(|name| LogFindingKind::parse(name.trim()));
        Ok(Self { source, options, has_split, as_logged: as_logged.collect() })
    }
}

impl Log {
    /// Reads, checks and splits the log. `default_split` applies if the user chose none.
    pub fn prepare(&self, default_split: &SplitRule) -> Result<Prepared, Error> {
        let split = if self.has_split { self.options.split.clone() } else { default_split.clone() };
        prepare(&self.source, &PrepareOptions { split, ..self.options.clone() })
    }

    /// Reads the log without checks and split.
    pub fn dataset(&self) -> Result<Dataset, Error> {
        let progress = |done, total| work::report(Progress::Reading { done, total });
        Ok(match &self.source {
            Source::Files(files) => joint_log::read(files, &self.options.read, &progress)?,
            Source::Contents(contents) => {
                joint_log::read_contents(contents, &self.options.read, &progress)?
            }
            Source::Tables(tables) => joint_log::read_tables(tables, &self.options.read)?,
        })
    }

    /// Returns how logs of other files are read, checked and split. `default_split` applies if the user chose none.
    pub fn options(&self, default_split: SplitRule) -> PrepareOptions {
        let split = if self.has_split { self.options.split.clone() } else { default_split };
        PrepareOptions { split, ..self.options.clone() }
    }

    /// True if the motion is to be reconstructed.
    pub fn smooths_motion(&self) -> bool {
        self.options.corrections.motion
    }
}

/// Parses the text of a keyword. The error of `parse` ends "expected ..".
fn parsed<T, E: Display>(
    py: Python<'_>,
    name: &str,
    text: Option<&str>,
    parse: impl Fn(&str) -> Result<T, E>,
) -> PyResult<Option<T>> {
    let wrong = |text, end| refused(py, &format!("{name}={text:?}: expected {end}"));
    text.map(|text| parse(text).map_err(|end| wrong(text, end))).transpose()
}

/// Returns the source of a log from paths and tables, and the names of its held-out part.
fn source(
    sources: Vec<Bound<'_, PyAny>>,
    test: Vec<Bound<'_, PyAny>>,
) -> PyResult<(Source, Vec<PathBuf>)> {
    let trained = sources.len();
    let (mut files, mut tables) = (Vec::new(), Vec::new());
    for one in sources.into_iter().chain(test) {
        match one.cast::<Table>() {
            Ok(table) => tables.push(table.get().0.clone()),
            Err(_) => files.push(one.extract::<PathBuf>()?),
        }
    }
    if !files.is_empty() && !tables.is_empty() {
        return Err(PyTypeError::new_err("data: expected either paths or data frames, found both"));
    }
    let names = |tables: &[joint_log::Table]| {
        tables.iter().map(|table| PathBuf::from(&table.name)).collect()
    };
    Ok(if tables.is_empty() {
        let held_out = files[trained..].to_vec();
        (Source::Files(files), held_out)
    } else {
        let held_out = names(&tables[trained..]);
        (Source::Tables(tables), held_out)
    })
}

/// Reads a log without checks, as a table with the names and units of the contract.
#[pyfunction]
#[pyo3(signature = (log, name, threads=0, progress=None))]
pub fn read(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    name: String,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Table> {
    let log = log.get();
    compute(py, threads, progress, || Ok(Table(contract_table(&log.dataset()?, name))))
}

/// Returns all runs of a data set as one table, the run's name first.
fn contract_table(data: &Dataset, name: String) -> joint_log::Table {
    let names = data.runs.iter().flat_map(|run| std::iter::repeat_n(run.name.clone(), run.len()));
    let mut columns = vec![("run".to_owned(), Cells::Texts(names.collect()))];
    let times = data.runs.iter().flat_map(|run| run.time_s.iter().copied()).collect();
    columns.push(("time_s".into(), Cells::Numbers(times)));
    let quantities = Quantity::ALL.iter().map(|quantity| quantity.name(data.joint).to_owned());
    for name in quantities.chain(data.covariates.iter().cloned()) {
        let parts: Option<Vec<&[f64]>> =
            data.runs.iter().map(|run| data.column(run, &name)).collect();
        // The clock is a quantity too.
        let is_new = columns.iter().all(|(known, _)| *known != name);
        if let Some(parts) = parts.filter(|_| is_new) {
            columns.push((name, Cells::Numbers(parts.concat())));
        }
    }
    joint_log::Table { name, columns }
}
