//! The tables of the page.

use super::{View, fitted};
use crate::report::{Block, Cell, Table};
use friction_diagnose::prepare::Prepared;
use friction_fit::params::{unit, unit_in_words};
use friction_fit::{Estimate, Metrics, Outcome, State};
use std::ops::Range;
use std::path::PathBuf;

/// Maximum number of runs in the table of runs.
const MAX_RUNS: usize = 200;

fn errors(metrics: &Metrics) -> [Cell; 5] {
    [
        Cell::Number(metrics.rmse),
        Cell::Number(metrics.sse),
        Cell::ShortNumber(100.0 * metrics.nrmse_std, 3),
        Cell::ShortNumber(100.0 * metrics.nrmse_range, 3),
        Cell::Number(metrics.relative_error_percent),
    ]
}

/// Returns a table with one row for each model, best first; `more` gives the columns after the errors.
fn metrics(
    view: &View,
    caption: String,
    of: fn(&Outcome) -> &Metrics,
    names: &str,
    more: fn(&Outcome) -> Vec<Cell>,
) -> Table {
    let unit = view.unit();
    let header = format!(
        "model|RMSE ({unit})|SSE ({unit}²)|NRMSE, of std (%)|of range (%)|relative (%)|{names}"
    );
    let row = |&index: &usize| {
        let fit = view.fit(index);
        let mut cells = vec![Cell::Text(view.name(index))];
        cells.extend(errors(of(fit)));
        cells.extend(more(fit));
        cells
    };
    // With a single model, no value is marked.
    let table = Table::new(caption, &header, view.ranking.iter().map(row));
    let best = if view.study.fits.len() > 1 { 1..table.header.len() } else { 1..1 };
    Table { best: best.collect(), ..table }
}

pub(crate) fn held_out_metrics(view: &View) -> Table {
    let rows = joint_log::number::count(view.fit(view.best()).test.rows as u64);
    let more = |fit: &Outcome| vec![Cell::ShortNumber(fit.seconds, 2)];
    let marked = if view.study.fits.len() > 1 { "; the best of each column is marked" } else { "" };
    let caption = format!("On {rows} held-out rows{marked}");
    metrics(view, caption, |fit| &fit.test, "time of fit (s)", more)
}

pub(crate) fn train_metrics(view: &View) -> Table {
    let rows = joint_log::number::count(view.fit(view.best()).train.rows as u64);
    let more = |fit: &Outcome| {
        // Show all digits, because only differences of the BIC are meaningful.
        let digits = fit.bic.abs().max(1.0).log10() as usize + 1;
        vec![Cell::ShortNumber(fit.bic, digits), Cell::Count(fitted(fit).count() as u64)]
    };
    let caption = format!("On {rows} training rows");
    metrics(view, caption, |fit| &fit.train, "BIC|fitted parameters", more)
}

/// Returns the parameters of a model, their verdicts and their correlations.
pub(crate) fn parameters(view: &View, index: usize) -> Vec<Block> {
    let fit = view.fit(index);
    let mut blocks = vec![Block::Table(values(view, index))];
    if !fit.verdicts.is_empty() {
        blocks.push(Block::List(fit.verdicts.iter().map(|verdict| sentence(verdict)).collect()));
    }
    blocks.extend(correlation(fit));
    blocks
}

/// Returns a verdict with a full stop.
fn sentence(verdict: &str) -> String {
    format!("{}.", verdict.trim_end_matches('.'))
}

fn values(view: &View, index: usize) -> Table {
    let row = |estimate: &Estimate| {
        let [value, state] = value_and_state(estimate);
        let unit = unit_in_words(unit(estimate.id, view.study.input.data.joint));
        vec![estimate.id.name().into(), value, unit.into(), state]
    };
    let rows = view.fit(index).estimates.iter().map(row);
    let caption = format!("Parameters of {}", view.name(index));
    Table::new(caption, "parameter|value ± standard error|unit|state", rows)
}

/// Returns the value of a parameter with its standard error, and its state.
pub(crate) fn value_and_state(estimate: &Estimate) -> [Cell; 2] {
    let Estimate { value, std_error, state, .. } = *estimate;
    let name = state.name().replace('-', " ").into();
    match std_error {
        Some(std_error) => [Cell::Estimate { value, std_error }, name],
        // Not fitted, because it has no effect in this data.
        None if state == State::NotDetermined => [Cell::Empty, "not determined, not fitted".into()],
        None if state == State::AtBound => [Cell::Number(value), name],
        None => [Cell::Number(value), "kept constant".into()],
    }
}

/// Returns the lower triangle of the correlation matrix in a collapsed block; columns have the numbers of the rows.
pub(crate) fn correlation(fit: &Outcome) -> Option<Block> {
    let estimates: Vec<&Estimate> = fitted(fit).collect();
    let row = |(i, estimate): (usize, &&Estimate)| {
        let mut cells = vec![Cell::Text(format!("{} {}", i + 1, estimate.id.name()))];
        let text = |j: usize| format!("{:+.2}", fit.correlation[(i, j)]).replace('-', "−");
        cells.extend((0..i).map(|j| Cell::Text(text(j))));
        cells.push("1".into());
        cells.extend((i + 1..estimates.len()).map(|_| "".into()));
        cells
    };
    let mut header = vec![String::new()];
    header.extend((1..=estimates.len()).map(|number| number.to_string()));
    let caption = "Correlation of the estimates; beyond ±0.98, the data determine only a combination of the two parameters";
    let rows = estimates.iter().enumerate().map(row).collect();
    let table = Table { caption: caption.into(), header, rows, best: Vec::new() };
    let summary = format!("{}: correlation of the estimates", fit.spec);
    (estimates.len() > 1).then(|| Block::details(summary, vec![table.into()]))
}

pub(crate) fn files(view: &View) -> Table {
    let files = view.study.input.data.files.iter().zip(&view.study.input.hashes);
    let row = |(file, hash): (&PathBuf, &String)| {
        vec![file.display().to_string().into(), hash.as_str().into()]
    };
    Table::new("Files", "file|SHA-256", files.map(row))
}

pub(crate) fn runs(view: &View) -> Table {
    let Prepared { data, split, .. } = view.study.input;
    let rows_of = |parts: &[joint_log::Part], run: usize| -> Cell {
        let of_run = parts.iter().filter(|part| part.run == run);
        Cell::Count(of_run.map(|part| Range::len(&part.rows) as u64).sum())
    };
    let row = |(index, run): (usize, &joint_log::Run)| {
        let seconds = run.time_s[run.len() - 1] - run.time_s[0];
        let rate = (run.len() - 1) as f64 / seconds;
        vec![
            run.name.as_str().into(),
            rows_of(&split.train, index),
            rows_of(&split.test, index),
            Cell::ShortNumber(seconds, 4),
            if rate.is_finite() { Cell::ShortNumber(rate, 3) } else { Cell::Empty },
        ]
    };
    let caption = match data.runs.len().saturating_sub(MAX_RUNS) {
        0 => "All runs".to_owned(),
        more => format!("The first {MAX_RUNS} runs; {more} more are not shown"),
    };
    let rows = data.runs.iter().take(MAX_RUNS).enumerate().map(row);
    Table::new(caption, "run|training rows|held-out rows|length (s)|rows per second", rows)
}
