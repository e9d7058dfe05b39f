//! The tables of the page.

use super::{View, fitted};
use crate::report::{Best, Block, Cell, Table};
use friction_identification::fit::{Estimate, Metrics, Outcome, State};
use friction_identification::params::{unit, unit_in_words};
use std::ops::Range;

/// More runs than this are only counted.
const MOST_RUNS: usize = 200;

fn header<const N: usize>(names: [&str; N]) -> Vec<String> {
    names.map(str::to_owned).to_vec()
}

fn errors(metrics: &Metrics) -> [Cell; 5] {
    [
        Cell::Number(metrics.rmse),
        Cell::Number(metrics.sse),
        Cell::Digits(100.0 * metrics.nrmse_std, 3),
        Cell::Digits(100.0 * metrics.nrmse_range, 3),
        Cell::Number(metrics.relative_error_percent),
    ]
}

/// One row a model, best first, with `more` behind the errors.
fn metrics(
    view: &View,
    caption: String,
    of: fn(&Outcome) -> &Metrics,
    names: &[&str],
    more: fn(&Outcome) -> Vec<Cell>,
) -> Table {
    let unit = view.unit();
    let mut header = header(["model", "", "", "NRMSE, of std (%)", "of range (%)", "relative (%)"]);
    header[1] = format!("RMSE ({unit})");
    header[2] = format!("SSE ({unit}²)");
    header.extend(names.iter().map(|name| (*name).to_owned()));
    let row = |&index: &usize| {
        let fit = view.fit(index);
        let mut cells = vec![Cell::Text(view.name(index))];
        cells.extend(errors(of(fit)));
        cells.extend(more(fit));
        cells
    };
    // Of a single model every number is the best.
    let best = if view.study.fits.len() > 1 { 1..header.len() } else { 1..1 };
    Table {
        caption,
        rows: view.ranking.iter().map(row).collect(),
        best: best.map(|column| (column, Best::Smallest)).collect(),
        header,
    }
}

pub(in crate::results) fn held_out_metrics(view: &View) -> Table {
    let rows = friction_identification::number::count(view.fit(view.best()).test.rows as u64);
    let more = |fit: &Outcome| vec![Cell::Digits(fit.seconds, 2)];
    let marked = if view.study.fits.len() > 1 { "; the best of each column is marked" } else { "" };
    let caption = format!("On {rows} held-out rows{marked}");
    metrics(view, caption, |fit| &fit.test, &["time of fit (s)"], more)
}

pub(in crate::results) fn train_metrics(view: &View) -> Table {
    let rows = friction_identification::number::count(view.fit(view.best()).train.rows as u64);
    let more = |fit: &Outcome| {
        // To the unit, however large: only differences count.
        let digits = fit.bic.abs().max(1.0).log10() as usize + 1;
        vec![Cell::Digits(fit.bic, digits), Cell::Count(fitted(fit).count() as u64)]
    };
    let caption = format!("On the {rows} rows fitted to");
    metrics(view, caption, |fit| &fit.train, &["BIC", "fitted parameters"], more)
}

/// A model's parameters, what is to be known of them, and how they hang together.
pub(in crate::results) fn parameters(view: &View, index: usize) -> Vec<Block> {
    let fit = view.fit(index);
    let mut blocks = vec![Block::Table(values(view, index))];
    if !fit.verdicts.is_empty() {
        blocks.push(Block::List(fit.verdicts.iter().map(|verdict| sentence(verdict)).collect()));
    }
    if let Some(table) = correlation(fit) {
        let summary = format!("{}: correlation of the estimates", view.name(index));
        blocks.push(Block::Details { summary, blocks: vec![Block::Table(table)] });
    }
    blocks
}

/// A verdict with a full stop.
fn sentence(verdict: &str) -> String {
    format!("{}.", verdict.trim_end_matches('.'))
}

fn values(view: &View, index: usize) -> Table {
    let row = |estimate: &Estimate| {
        let Estimate { id, value, std_error, state } = estimate;
        let (value, state) = match std_error {
            Some(std_error) => {
                (Cell::Estimate { value: *value, std_error: *std_error }, state.name())
            }
            // Neither fitted nor of any effect the data could show.
            None if *state == State::NotDetermined => (Cell::Empty, "not determined, not fitted"),
            None if *state == State::AtBound => (Cell::Number(*value), state.name()),
            None => (Cell::Number(*value), "kept"),
        };
        let unit = unit_in_words(unit(id.info(), view.study.data.joint));
        vec![id.name().into(), value, unit.into(), state.replace('-', " ").into()]
    };
    Table {
        caption: format!("Parameters of {}", view.name(index)),
        header: header(["parameter", "value ± standard error", "unit", "state"]),
        rows: view.fit(index).estimates.iter().map(row).collect(),
        best: Vec::new(),
    }
}

/// The lower triangle of the matrix; columns are numbered as the rows are.
pub(in crate::results) fn correlation(fit: &Outcome) -> Option<Table> {
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
    (estimates.len() > 1).then(|| Table {
        caption:
            "Correlation of the estimates; beyond ±0.98 only a combination of the two is known"
                .into(),
        header,
        rows: estimates.iter().enumerate().map(row).collect(),
        best: Vec::new(),
    })
}

pub(in crate::results) fn files(view: &View) -> Table {
    let files = view.study.data.files.iter().zip(view.study.hashes);
    Table {
        caption: "Files, as they were named".into(),
        header: header(["file", "SHA-256"]),
        rows: files
            .map(|(file, hash)| vec![file.display().to_string().into(), hash.as_str().into()])
            .collect(),
        best: Vec::new(),
    }
}

pub(in crate::results) fn runs(view: &View) -> Table {
    let (data, split) = (view.study.data, view.study.split);
    let rows_of = |parts: &[friction_identification::data::Part], run: usize| -> Cell {
        let own = parts.iter().filter(|part| part.run == run);
        Cell::Count(own.map(|part| Range::len(&part.rows) as u64).sum())
    };
    let row = |(index, run): (usize, &friction_identification::data::Run)| {
        let seconds = run.time_s[run.len() - 1] - run.time_s[0];
        let rate = (run.len() - 1) as f64 / seconds;
        vec![
            run.name.as_str().into(),
            rows_of(&split.train, index),
            rows_of(&split.test, index),
            Cell::Digits(seconds, 4),
            if rate.is_finite() { Cell::Digits(rate, 3) } else { Cell::Empty },
        ]
    };
    let caption = match data.runs.len().saturating_sub(MOST_RUNS) {
        0 => "All runs".to_owned(),
        more => format!("The first {MOST_RUNS} runs; {more} more are not shown"),
    };
    Table {
        caption,
        header: header(["run", "rows fitted to", "rows held out", "length (s)", "rows per second"]),
        rows: data.runs.iter().take(MOST_RUNS).enumerate().map(row).collect(),
        best: Vec::new(),
    }
}
