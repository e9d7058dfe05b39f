//! Fits the calibration of the contest to the evidence on logs with known causes, and prints how well it holds on others.
//!
//! ```text
//! cargo run --release -p friction-grading --example calibrate_contest -- evidence.tsv           contest_calibration.toml
//! cargo run --release -p friction-grading --example calibrate_contest -- evidence.tsv --fresh worlds.tsv
//!                                                                        and the figures, graded/contest.tsv
//! cargo run --release -p friction-grading --example calibrate_contest -- evidence.tsv --check   writes nothing
//! ```
//!
//! `contest_evidence` makes the evidence; `lab/grading/calibrate` runs all of it. Every figure is out of fold: the trees and the
//! isotonic step have seen neither the world, nor any log of the machine. Fresh worlds are drawn after the last change of the
//! contest and are judged by the whole fit, as a user's log is.

use clap::Parser;
use friction_diagnose::contest_calibration::ContestCalibration;
use friction_grading::calibration_fit::{Case, fit, out_of_fold, probabilities_out_of_fold};
use friction_grading::calibration_tables;
use friction_grading::contest_figures::{self, FigureRow, LOG_GROUPS};
use friction_grading::contest_verdicts::Grades;
use friction_grading::evidence_table::{EvidenceRow, parse};
use friction_grading::{GradingError, end};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Fits the calibration of the contest.
#[derive(Parser)]
struct Arguments {
    /// Tables of evidence
    tables: Vec<PathBuf>,
    /// Share of the weight that the measured logs have
    ///
    /// Out of fold, with 0.05 (their share of the candidates), 0.1, 0.2 and 0.5: of 34 measured logs right first 20, 21, 22 and 20;
    /// Brier score of the measured .183, .159, .160 and .165, of the worlds .073, .075, .077 and .083; clean worlds named wrongly
    /// 3.5, 3.8, 4.3 and 7.5 %. With 0.05, a ripple that takes 95 % of the error of a measured excerpt had a probability of .5.
    #[arg(long, default_value_t = 0.1)]
    measured_share: f64,
    /// Tables of evidence of worlds that the fit does not see: their figures and those of all others are the table of figures
    #[arg(long)]
    fresh: Vec<PathBuf>,
    /// Fits and prints, but does not write the table
    #[arg(long)]
    check: bool,
}

/// Parts of the worlds.
const FOLDS: usize = 5;

/// Probability at and above which a cause is named.
const NAMED: f64 = 0.5;

fn main() -> ExitCode {
    end(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), GradingError> {
    let rows = evidence(&arguments.tables)?;
    let fresh = evidence(&arguments.fresh)?;
    let (places, cases) = cases(&rows, arguments.measured_share);
    let odds = out_of_fold(&cases);
    let held_out = probabilities_out_of_fold(&cases, &odds);
    let logs = |is_measured: bool| {
        let of_origin = rows.iter().filter(|row| row.is_measured == is_measured);
        of_origin.map(|row| &row.log).collect::<BTreeSet<_>>().len()
    };
    let name = format!("{} simulated and {} measured logs", logs(false), logs(true));
    let calibration = fit(name, &cases, &odds);
    // Rows that are no cases have the probability of the whole fit: it decides nothing about them.
    let mut probabilities: Vec<f64> = rows
        .iter()
        .map(|row| calibration.probability_of(&row.cause, &row.follows, &row.figures))
        .collect();
    places.iter().zip(&held_out).for_each(|(at, p)| probabilities[*at] = *p);

    println!("{}\n", calibration.name);
    let pairs = |is_measured: bool| -> Vec<(&Case, f64)> {
        let held_out = places.iter().zip(cases.iter().zip(held_out.iter().copied()));
        held_out
            .filter(|(at, _)| rows[**at].is_measured == is_measured)
            .map(|(_, pair)| pair)
            .collect()
    };
    for (what, pairs) in [("worlds", pairs(false)), ("measured", pairs(true))] {
        if !pairs.is_empty() {
            println!("{what}: {}\n\n{}", brier(&pairs), reliability(&pairs));
        }
    }
    println!("{}", by_cause(&pairs(false)));
    println!(
        "| named from | clean wrong | not detectable wrong | one wrong | two wrong | effects found | measured right | wrong |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for percent in (30..100).step_by(10).chain([95]) {
        println!("{}", threshold(&rows, &probabilities, 0.01 * f64::from(percent)));
    }
    println!("\nat {NAMED}:\n\n{}", Grades::new(&rows, &probabilities, NAMED).tables());
    let table = figures(&calibration, &rows, &probabilities, &fresh);
    for FigureRow { logs, figure, value, .. } in &table {
        println!("{logs}: {figure} {value:.3}");
    }
    if arguments.check {
        return Ok(());
    }
    if !fresh.is_empty() {
        write_figures(&table)?;
    }
    let path =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../host-sim/diagnose/contest_calibration.toml");
    let text = calibration_tables::of_contest(&calibration);
    std::fs::write(path, text).map_err(GradingError::io(path))
}

/// Replaces these rows of the table of figures, and keeps the others.
fn write_figures(table: &[FigureRow]) -> Result<(), GradingError> {
    let path = Path::new(contest_figures::PATH);
    let before = std::fs::read_to_string(path).map_err(GradingError::io(path))?;
    let before =
        contest_figures::parse(&before).map_err(|error| error.of(path.display().to_string()))?;
    let text = contest_figures::emit(table, &before);
    std::fs::write(path, text).map_err(GradingError::io(path))
}

fn evidence(paths: &[PathBuf]) -> Result<Vec<EvidenceRow>, GradingError> {
    let mut rows = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(path).map_err(GradingError::io(path))?;
        rows.extend(parse(&text).map_err(|error| error.of(path.display().to_string()))?);
    }
    Ok(rows)
}

/// Returns the figures of the logs of the fit, out of fold, and of fresh ones.
fn figures(
    calibration: &ContestCalibration,
    rows: &[EvidenceRow],
    probabilities: &[f64],
    fresh: &[EvidenceRow],
) -> Vec<FigureRow> {
    let of_group = |logs: &str, rows: &[EvidenceRow], probabilities: &[f64]| {
        if rows.is_empty() {
            return Vec::new();
        }
        contest_figures::figures(logs, rows, probabilities, NAMED)
    };
    let of_fit = |logs: &str, is_measured: bool| {
        let of_origin =
            rows.iter().zip(probabilities).filter(|(row, _)| row.is_measured == is_measured);
        let (rows, probabilities): (Vec<EvidenceRow>, Vec<f64>) =
            of_origin.map(|(row, p)| (row.clone(), *p)).unzip();
        of_group(logs, &rows, &probabilities)
    };
    let fresh_probabilities: Vec<f64> = fresh
        .iter()
        .map(|row| calibration.probability_of(&row.cause, &row.follows, &row.figures))
        .collect();
    let [measured, worlds, fresh_worlds] = LOG_GROUPS;
    let fresh = of_group(fresh_worlds, fresh, &fresh_probabilities);
    [of_fit(measured, true), of_fit(worlds, false), fresh].concat()
}

/// Returns the cases with their rows. Worlds are divided into folds by their name; each machine is a fold of its own.
fn cases(rows: &[EvidenceRow], measured_share: f64) -> (Vec<usize>, Vec<Case>) {
    let machines: BTreeSet<&str> =
        rows.iter().filter(|row| row.is_measured).map(|row| row.origin.as_str()).collect();
    let fold = |row: &EvidenceRow| {
        if row.is_measured {
            let place = machines.iter().position(|machine| *machine == row.origin);
            return FOLDS + place.unwrap_or_default();
        }
        row.log.bytes().fold(0usize, |sum, byte| (31 * sum + usize::from(byte)) % 1_000_003) % FOLDS
    };
    let weight = |is_measured: bool| {
        let of_origin = rows.iter().filter(|row| row.is_measured == is_measured);
        of_origin.filter_map(|row| row.case(1.0, 0)).map(|case| case.weight).sum::<f64>()
    };
    let (simulated, measured) = (weight(false), weight(true));
    let share = measured_share / (1.0 - measured_share) * simulated / measured.max(1e-9);
    let case = |(at, row): (usize, &EvidenceRow)| {
        let weight = if row.is_measured { share } else { 1.0 };
        Some((at, row.case(weight, fold(row))?))
    };
    rows.iter().enumerate().filter_map(case).unzip()
}

/// Returns the Brier score beside that of the base rate.
fn brier(pairs: &[(&Case, f64)]) -> String {
    let total: f64 = pairs.iter().map(|(case, _)| case.weight).sum::<f64>().max(1e-9);
    let real = |case: &Case| f64::from(u8::from(case.is_real));
    let rate = pairs.iter().map(|(case, _)| case.weight * real(case)).sum::<f64>() / total;
    let score = |of: &dyn Fn(f64) -> f64| {
        let squares = pairs.iter().map(|(case, p)| case.weight * (of(*p) - real(case)).powi(2));
        squares.sum::<f64>() / total
    };
    let likely: Vec<(&Case, f64)> = pairs.iter().copied().filter(|(_, p)| *p >= NAMED).collect();
    let squares = likely.iter().map(|(case, p)| (p - real(case)).powi(2)).sum::<f64>();
    format!(
        "{} candidates, {:.1} % real, Brier score {:.3} (base rate {:.3}); of those named {:.3}",
        pairs.len(),
        100.0 * rate,
        score(&|p| p),
        score(&|_| rate),
        squares / likely.len().max(1) as f64
    )
}

fn reliability(pairs: &[(&Case, f64)]) -> String {
    let edges = [0.0, 0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 1.01];
    let mut text = String::from("| probability | candidates | mean | real |\n|---|---|---|---|\n");
    for edge in edges.windows(2) {
        let of_origin: Vec<&(&Case, f64)> =
            pairs.iter().filter(|(_, p)| (edge[0]..edge[1]).contains(p)).collect();
        let total = of_origin.iter().map(|(case, _)| case.weight).sum::<f64>().max(1e-9);
        let mean = |of: &dyn Fn(&(&Case, f64)) -> f64| {
            of_origin.iter().map(|pair| pair.0.weight * of(pair)).sum::<f64>() / total
        };
        text += &format!(
            "| {:.1} to {:.1} | {} | {:.2} | {:.2} |\n",
            edge[0],
            edge[1].min(1.0),
            of_origin.len(),
            mean(&|pair| pair.1),
            mean(&|pair| f64::from(u8::from(pair.0.is_real)))
        );
    }
    text
}

fn by_cause(pairs: &[(&Case, f64)]) -> String {
    let mut causes: BTreeMap<&str, Vec<(&Case, f64)>> = BTreeMap::new();
    for (case, p) in pairs {
        causes.entry(&case.cause).or_default().push((case, *p));
    }
    let mut text = String::from(
        "| cause | candidates | real | Brier | named | real of named |\n|---|---|---|---|---|---|\n",
    );
    for (cause, pairs) in causes {
        let real = |pairs: &[&(&Case, f64)]| pairs.iter().filter(|(case, _)| case.is_real).count();
        let named: Vec<&(&Case, f64)> = pairs.iter().filter(|(_, p)| *p >= NAMED).collect();
        let squares = pairs.iter().map(|(case, p)| (p - f64::from(u8::from(case.is_real))).powi(2));
        text += &format!(
            "| {cause} | {} | {} | {:.3} | {} | {} |\n",
            pairs.len(),
            real(&pairs.iter().collect::<Vec<_>>()),
            squares.sum::<f64>() / pairs.len() as f64,
            named.len(),
            real(&named)
        );
    }
    text
}

fn threshold(rows: &[EvidenceRow], probabilities: &[f64], least: f64) -> String {
    let grades = Grades::new(rows, probabilities, least);
    let wrong = |kind: &str| {
        let verdicts = grades.sum(|_, other| other == kind);
        let all = verdicts.right + verdicts.abstained + verdicts.wrong;
        format!("{} of {all}", verdicts.wrong)
    };
    let all = grades.sum(|_, _| true);
    let measured = grades.sum(|_, kind| kind == "measured");
    format!(
        "| {least:.2} | {} | {} | {} | {} | {} of {} | {} | {} |",
        wrong("clean"),
        wrong("not detectable"),
        wrong("one"),
        wrong("two"),
        all.found,
        all.effects,
        measured.right,
        measured.wrong
    )
}
