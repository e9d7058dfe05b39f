//! The tasks of a fleet. Rows pass as JSON, the same text as in `row.json`.

use crate::computation::compute;
use crate::error::{in_keywords, refused, to_python};
use crate::log::Log;
use friction_diagnose::prepare::Error;
use friction_fit::spec::Spec;
use friction_results::fleet::statistics::Limit;
use friction_results::fleet::{self, FleetJob, FleetOptions, FleetRow};
use joint_log::SplitRule;
use pyo3::prelude::*;
use std::io;
use std::path::{Path, PathBuf};

/// Returns joint, campaign and files of every log below a folder.
#[pyfunction]
pub fn fleet_jobs(
    py: Python<'_>,
    root: PathBuf,
    out: PathBuf,
) -> PyResult<Vec<(String, String, Vec<PathBuf>)>> {
    let jobs = fleet::find_jobs(&root, &out).map_err(|error| refused(py, &error.to_string()))?;
    Ok(jobs.into_iter().map(|job| (job.joint, job.campaign, job.files)).collect())
}

/// Groups files, as paths below `root`, by joint and campaign. Returns joint, campaign and files of every log. No file is opened.
#[pyfunction]
pub fn fleet_jobs_of(
    py: Python<'_>,
    root: PathBuf,
    files: Vec<PathBuf>,
) -> PyResult<Vec<(String, String, Vec<PathBuf>)>> {
    let jobs =
        fleet::jobs_of_files(&root, files).map_err(|error| refused(py, &error.to_string()))?;
    Ok(jobs.into_iter().map(|job| (job.joint, job.campaign, job.files)).collect())
}

/// Diagnoses the log of one joint and campaign into a folder below `out`, or takes an earlier result. Returns its rows as a JSON
/// list. A log that cannot be diagnosed gives a row with its reason. `earlier` returns the content of an earlier result's
/// `row.json`, or None; it is called with the folder of the result. By default, earlier results are below `out`. `addresses` say
/// where the files come from if they are copies.
#[pyfunction]
#[pyo3(signature = (log, joint, campaign, files, out, *, model=None, fixed_model="lugre", threads=1, addresses=vec![],
    earlier=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
pub fn fleet_task(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    joint: String,
    campaign: String,
    files: Vec<PathBuf>,
    out: PathBuf,
    model: Option<&str>,
    fixed_model: &str,
    threads: usize,
    addresses: Vec<String>,
    earlier: Option<Py<PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let parse = |name| Spec::parse(name).map_err(|error| to_python(py, error.into()));
    let mut options = FleetOptions::new(out);
    options.prepare = log.get().options(SplitRule::LeaveOneRunOut);
    options.model = model.map(parse).transpose()?;
    options.fixed_model = parse(fixed_model)?;
    options.worded = in_keywords;
    let job = FleetJob { joint, campaign, files, addresses };
    compute(py, threads, progress, || {
        std::fs::create_dir_all(&options.out)
            .map_err(|error| format!("{}: {error}", options.out.display()))?;
        let rows = match &earlier {
            None => fleet::run_task(&job, &options),
            Some(earlier) => {
                let read = |folder: &str| {
                    let bytes = |py: Python<'_>| {
                        earlier.call1(py, (folder,))?.extract::<Option<Vec<u8>>>(py)
                    };
                    Python::attach(bytes).map_err(|error| io::Error::other(error.to_string()))
                };
                fleet::run_task_beside(&job, &options, &read)
            }
        };
        serde_json::to_string(&rows).map_err(|error| Error::Request(error.to_string()))
    })
}

/// Writes `fleet.parquet`, `fleet.html` and the script of the reports. `rows` are the rows of all tasks as a JSON list, `limits`
/// names of levels with their limits, `data` the folder of the logs, which may have trends of learnt levels.
#[pyfunction]
#[pyo3(signature = (out, rows, limits, data = None))]
pub fn fleet_write(
    py: Python<'_>,
    out: PathBuf,
    rows: &str,
    limits: Vec<(String, f64)>,
    data: Option<PathBuf>,
) -> PyResult<()> {
    let rows: Vec<FleetRow> =
        serde_json::from_str(rows).map_err(|error| refused(py, &format!("rows: {error}")))?;
    let unknown = limits.iter().find(|(level, _)| !fleet::LEVELS.contains(&level.as_str()));
    if let Some((level, _)) = unknown {
        let expected = fleet::LEVELS.join(", ");
        return Err(refused(py, &format!("limits: found {level:?}, expected one of {expected}")));
    }
    let limits: Vec<Limit> =
        limits.into_iter().map(|(level, value)| Limit { level, value }).collect();
    let folders: Vec<&Path> = data.iter().map(PathBuf::as_path).filter(|of| of.is_dir()).collect();
    let ageing =
        fleet::read_ageing(&folders, &out).map_err(|error| refused(py, &error.to_string()))?;
    compute(py, 1, None, || Ok(fleet::write_fleet(&out, &rows, &ageing, &limits)?))
}
