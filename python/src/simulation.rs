//! Simulated machines.

use crate::computation::compute;
use crate::error::{refused, unserialised};
use crate::table::Table;
use joint_log::Cells;
use pyo3::prelude::*;
use simulated_machines::scenarios::Hide;
use simulated_machines::{Log, Request, SIMULATIONS, Simulated};

/// Simulates a machine. Returns its log, the text of truth.json, and the text of data.csv.
#[pyfunction]
#[pyo3(signature = (scenario, *, hide=vec![], seed=0, runs=None, seconds=None, rate_hz=None, noise_nm=None, unloaded=false,
    steady=false, threads=0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
pub fn simulate(
    py: Python<'_>,
    scenario: &str,
    hide: Vec<String>,
    seed: u64,
    runs: Option<usize>,
    seconds: Option<f64>,
    rate_hz: Option<f64>,
    noise_nm: Option<f64>,
    unloaded: bool,
    steady: bool,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Table, String, String)> {
    let machines = || SIMULATIONS.iter().chain(paper_machines::SIMULATIONS);
    let Some(machine) = machines().find(|machine| machine.name == scenario) else {
        let known: Vec<&str> = machines().map(|machine| machine.name).collect();
        let known = known.join(", ");
        return Err(refused(py, &format!("scenario={scenario:?}: expected one of {known}")));
    };
    let parsed: Result<Vec<Hide>, _> = hide.iter().map(|text| Hide::parse(text)).collect();
    let hide = parsed.map_err(|error| refused(py, &format!("hide: {error}")))?;
    for (name, number) in [("seconds", seconds), ("rate_hz", rate_hz), ("noise_nm", noise_nm)] {
        // The limits of the command line.
        if number.is_some_and(|number| !(number > 0.0 && number <= 1e6)) {
            let line = format!("{name}: expected a number above 0 and at most 1e6");
            return Err(refused(py, &line));
        }
    }
    if runs.is_some_and(|runs| !(1..=1000).contains(&runs)) {
        return Err(refused(py, "runs: expected 1 to 1000"));
    }
    if !hide.is_empty() && (unloaded || steady) {
        return Err(refused(py, "hide: cannot be used with unloaded or steady"));
    }
    let request = Request { seed, runs, seconds, rate_hz, noise_nm, unloaded, steady, hide };
    let simulated = compute(py, threads, progress, || {
        Ok(machine.simulate(&request).map_err(|error| error.to_string())?)
    })?;
    let Simulated { log, truth, .. } = simulated;
    let truth = serde_json::to_string(&truth).map_err(unserialised)?;
    Ok((Table(table(&log, scenario)), truth, log.csv()))
}

/// Returns all runs as one table, the run's name first.
fn table(log: &Log, name: &str) -> joint_log::Table {
    let names = log.runs.iter().flat_map(|run| std::iter::repeat_n(run.name.clone(), run.rows()));
    let mut columns = vec![("run".to_owned(), Cells::Texts(names.collect()))];
    for (at, column) in log.columns.iter().enumerate() {
        let values = log.runs.iter().flat_map(|run| run.columns[at].iter().copied());
        columns.push((column.clone(), Cells::Numbers(values.collect())));
    }
    joint_log::Table { name: name.to_owned(), columns }
}
