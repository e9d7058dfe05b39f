//! What the product hands over: `diagnose` gets the training rows as a file, `predict` its parameters and the test rows.

use crate::GradingError;
use crate::contest_logs::read_json;
use crate::transfer_log::{Part, TransferLog};
use joint_log::{Cells, Table, parquet_table};
use serde::Deserialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Times of rows are compared in parts of a second.
const TIME_PARTS: f64 = 1e6;

/// Share of the judging rows without a prediction that is reported.
const REPORTED_MISSING: f64 = 0.02;

/// Share of the judging rows without a prediction above which there is no answer.
const MAX_MISSING: f64 = 0.5;

/// The answer of the product.
#[derive(Clone, Debug)]
pub struct Product {
    /// Prediction of each row of the log; NaN without one.
    pub predicted: Vec<f64>,
    /// Share of the judging rows without a prediction.
    missing: f64,
    /// What was handed over, as the diagnosis states it.
    handed_over: String,
    /// Named causes.
    causes: Vec<String>,
}

impl Product {
    /// Returns what was handed over and the causes, one line.
    pub fn describe(&self) -> String {
        let causes = if self.causes.is_empty() { "none".into() } else { self.causes.join(", ") };
        let mut text = format!("{}: {causes}", self.handed_over);
        if self.missing > REPORTED_MISSING {
            text += &format!(" (no prediction for {:.0} % of the rows)", 100.0 * self.missing);
        }
        text
    }
}

/// The keys of `diagnosis.json` that are graded.
#[derive(Deserialize)]
struct HandedOver {
    findings: Vec<Finding>,
    handed_over: String,
}

/// A finding of `diagnosis.json`.
#[derive(Deserialize)]
struct Finding {
    cause: String,
}

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays is no error of the measurement.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Returns the product's predictions for the test rows of a log that it is read from with `arguments`.
///
/// # Errors
/// Returns an error if a command writes no result, or predicts less than half of the judging rows.
pub fn hand_over(
    host_sim: &Path,
    log: &TransferLog,
    arguments: &[String],
) -> Result<Product, GradingError> {
    static FOLDERS: AtomicUsize = AtomicUsize::new(0);
    let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
    let folder =
        Folder(std::env::temp_dir().join(format!("transfer-{}-{number}", std::process::id())));
    let file = |name: &str| folder.0.join(name);
    std::fs::create_dir_all(&folder.0).map_err(GradingError::io(&folder.0))?;
    let (train, test) = (file("train.csv"), file("test.csv"));
    log.write(&train, Part::Training)?;
    log.write(&test, Part::Test)?;
    let [params, rows] = [file("d/params.toml"), file("p.parquet")];
    let mut diagnose = Command::new(host_sim);
    diagnose.arg("diagnose").arg(train).args(arguments).arg("--out").arg(file("d"));
    run(diagnose, &params)?;
    let mut predict = Command::new(host_sim);
    predict.arg("predict").arg(params).arg(test).arg("--out").arg(&rows);
    predict.args(reading(arguments));
    run(predict, &rows)?;
    let table = parquet_table(&rows)?;
    let diagnosis: HandedOver = read_json(&file("d/diagnosis.json"))?;
    let predicted = align(log, &table)?;
    let judging = log.judging_rows();
    let missing = judging.iter().filter(|row| predicted[**row].is_nan()).count();
    let missing = missing as f64 / judging.len().max(1) as f64;
    if missing > MAX_MISSING {
        return Err(GradingError::FewPredictions(missing));
    }
    let HandedOver { findings, handed_over } = diagnosis;
    let causes = findings.into_iter().map(|finding| finding.cause).collect();
    Ok(Product { predicted, missing, handed_over, causes })
}

/// Returns the arguments of the reading, which `predict` has too.
fn reading(arguments: &[String]) -> Vec<&String> {
    arguments.chunks(2).filter(|pair| pair[0] == "--columns").flatten().collect()
}

/// Runs a command on one thread, as the machines share the processor. Fails with the last line of its errors if it does not
/// write `result`.
fn run(mut command: Command, result: &Path) -> Result<(), GradingError> {
    command.args(["--threads", "1"]);
    let output = command.output().map_err(GradingError::io(command.get_program()))?;
    if result.is_file() {
        return Ok(());
    }
    let errors = String::from_utf8_lossy(&output.stderr);
    let last = errors.trim().lines().next_back().unwrap_or("no error");
    Err(GradingError::NoResult(last.to_owned()))
}

/// Returns the prediction of each row of the log, by run and time.
fn align(log: &TransferLog, table: &Table) -> Result<Vec<f64>, GradingError> {
    let column = |start: &'static str| {
        let found = table.columns.iter().find(|(name, _)| name.starts_with(start));
        found.map(|(_, cells)| cells).ok_or_else(|| GradingError::NoColumn(start.to_owned()))
    };
    let numbers = |start: &'static str| match column(start)? {
        Cells::Numbers(numbers) => Ok(numbers),
        _ => Err(GradingError::NotNumbers(start)),
    };
    let part = |time: f64| (time * TIME_PARTS).round() as i64;
    let (runs, times, values) = (column("run")?, numbers("time_s")?, numbers("predicted_")?);
    // Without runs in the log, the name in the result is that of the file.
    let run_of =
        |run: String, row: usize| if log.run[row].is_empty() { String::new() } else { run };
    let mut found = HashMap::new();
    for (row, (time, value)) in times.iter().zip(values).enumerate() {
        found.entry((run_of(runs.text_of(row), 0), part(*time))).or_insert(*value);
    }
    let of = |row: usize| found.get(&(log.run[row].clone(), part(log.time[row]))).copied();
    let predicted = (0..log.run.len()).map(|row| of(row).filter(|_| log.is_test[row]));
    Ok(predicted.map(|value| value.unwrap_or(f64::NAN)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_log::tests::log_of;

    #[test]
    fn align_assigns_predictions_by_run_and_time() {
        let log = log_of(
            "run,time_s,velocity_rad_s,torque_nm\na,0,1,1\nb,0,1,1\nc,0,1,1\nc,0.1,1,1\nc,0.2,1,1\n",
        );
        let texts = |list: &[&str]| Cells::Texts(list.iter().map(|text| (*text).into()).collect());
        let columns = vec![
            ("run".into(), texts(&["a", "c", "c"])),
            ("time_s".into(), Cells::Numbers(vec![0.0, 0.2, 0.000_000_1])),
            ("predicted_torque_nm".into(), Cells::Numbers(vec![1.0, 2.0, 3.0])),
        ];
        let found = align(&log, &Table { name: String::new(), columns }).expect("predictions");
        assert_eq!((found[2], found[4]), (3.0, 2.0));
        assert!(found[0].is_nan() && found[1].is_nan() && found[3].is_nan());
    }
}
