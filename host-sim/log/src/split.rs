//! Split of a data set into training and test data.
//!
//! Two neighbouring samples of a log are nearly the same measurement. If rows are shuffled into a training and a test
//! set, every test row has a close neighbour in the training set, and every model looks good, most of all one that
//! memorises. So only contiguous data are held out, the longer the better: whole files, whole runs, all runs at one
//! setting, the end of each run, or blocks of time if there is only one run. Alternatively each run is evaluated with a
//! fit on the others ([`SplitRule::LeaveOneRunOut`]).
//!
//! Held-out runs are spread over the order of the files. That order is mostly one of speed, load or date, and a test at
//! one end of it would test extrapolation. The seed shifts the pattern; the same seed gives the same split.

use std::ops::Range;
use std::path::PathBuf;

use super::dataset::{Dataset, Run};
use super::error::{DataError, listed};

/// Default share of runs, blocks or rows that is held out.
pub const DEFAULT_TEST_SHARE: f64 = 0.3;

/// Number of blocks of equal length into which a single run is split.
pub const TIME_BLOCKS: usize = 10;

/// Rule that selects the held-out data.
#[derive(Debug, Clone, PartialEq)]
pub enum SplitRule {
    /// Hold out this share (0 to 1, both excluded) of the runs, spread over their order. A single run is split into
    /// blocks of time. Both sides get at least one run or block.
    Spread {
        /// The share to hold out.
        share: f64,
    },
    /// Evaluate each run with a fit on all other runs.
    LeaveOneRunOut,
    /// Hold out the last share (0 to 1, both excluded) of the rows of each run.
    Tail {
        /// The share to hold out.
        share: f64,
    },
    /// Hold out all runs in which `column` holds one of `values`. The column is `run`, a label, or a numeric column
    /// that is constant in each run.
    HoldOut {
        /// The column's name.
        column: String,
        /// The values, as text; numbers are compared as numbers.
        values: Vec<String>,
    },
    /// Hold out all runs of these files, which must be among [`Dataset::files`].
    Files(Vec<PathBuf>),
}

impl Default for SplitRule {
    fn default() -> Self {
        SplitRule::Spread { share: DEFAULT_TEST_SHARE }
    }
}

impl SplitRule {
    /// Parses `COLUMN=VALUE[,VALUE..]`.
    pub fn parse_hold_out(text: &str) -> Result<SplitRule, DataError> {
        let parsed = text.split_once('=').map(|(column, values)| {
            let values: Vec<String> = values.split(',').map(|v| v.trim().to_string()).collect();
            (column.trim().to_string(), values)
        });
        match parsed {
            Some((column, values))
                if !column.is_empty() && values.iter().all(|value| !value.is_empty()) =>
            {
                Ok(SplitRule::HoldOut { column, values })
            }
            _ => Err(DataError::request("hold-out", format!("{text:?}"), "COLUMN=VALUE[,VALUE..]")),
        }
    }
}

/// Consecutive rows of one run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Index into [`Dataset::runs`].
    pub run: usize,
    /// The rows; never empty.
    pub rows: Range<usize>,
}

/// The training and test data. No row is in both, except with [`SplitRule::LeaveOneRunOut`], where all rows are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// The parts to fit on, in the order of the data.
    pub train: Vec<Part>,
    /// The parts to test on, in the order of the data.
    pub test: Vec<Part>,
}

impl Split {
    /// Returns true if each run is to be tested with a fit on the others.
    pub fn is_leave_one_run_out(&self) -> bool {
        self.train == self.test
    }

    /// Returns the names of the runs with training rows.
    pub fn train_runs(&self, data: &Dataset) -> Vec<String> {
        names(data, &self.train)
    }

    /// Returns the names of the runs with test rows.
    pub fn test_runs(&self, data: &Dataset) -> Vec<String> {
        names(data, &self.test)
    }
}

fn names(data: &Dataset, parts: &[Part]) -> Vec<String> {
    let mut names: Vec<String> =
        parts.iter().map(|part| data.runs[part.run].name.clone()).collect();
    names.dedup();
    names
}

impl Dataset {
    /// Returns these parts as a data set in which each part is a run. Parts of one run share its name.
    pub fn select(&self, parts: &[Part]) -> Dataset {
        let slice = |part: &Part| self.runs[part.run].slice(part.rows.clone());
        let runs: Vec<Run> = parts.iter().map(slice).collect();
        let rows = runs.iter().map(Run::len).sum();
        Dataset {
            joint: self.joint,
            runs,
            files: self.files.clone(),
            rows,
            rows_read: self.rows_read,
            bad_rows: self.bad_rows.clone(),
            covariates: self.covariates.clone(),
            left_out_columns: self.left_out_columns.clone(),
            notes: self.notes.clone(),
            torque_law: self.torque_law.clone(),
            torque_constant: self.torque_constant,
            sources: self.sources.clone(),
        }
    }
}

/// Splits a data set.
///
/// # Errors
/// If either side is empty or the rule names something that the data do not contain.
pub fn split(data: &Dataset, rule: &SplitRule, seed: u64) -> Result<Split, DataError> {
    let split = match rule {
        SplitRule::Spread { share } if data.runs.len() == 1 => {
            time_blocks(&data.runs[0], checked(*share)?, seed)
        }
        SplitRule::Spread { share } => {
            let held = spread(data.runs.len(), checked(*share)?, seed);
            whole_runs(data, |at, _| held.contains(&at))
        }
        SplitRule::LeaveOneRunOut => {
            let all = whole_runs(data, |_, _| false).train;
            Split { train: all.clone(), test: all }
        }
        SplitRule::Tail { share } => tail(data, checked(*share)?),
        SplitRule::HoldOut { column, values } => hold_out(data, column, values)?,
        SplitRule::Files(files) => {
            if let Some(file) = files.iter().find(|file| !data.files.contains(file)) {
                let read: Vec<_> = data.files.iter().map(|f| f.to_string_lossy()).collect();
                let found = file.display().to_string();
                return Err(DataError::request(
                    "test files",
                    found,
                    format!("one of {}", listed(&read)),
                ));
            }
            whole_runs(data, |_, run| files.contains(&data.files[run.file]))
        }
    };
    if split.train.is_empty() || split.test.is_empty() {
        let empty = if split.test.is_empty() { "test" } else { "train" };
        let found =
            format!("{} runs, {} rows, and no rows left to {empty} on", data.runs.len(), data.rows);
        return Err(DataError::request("split", found, "rows on either side"));
    }
    Ok(split)
}

/// Returns the share if it is valid.
fn checked(share: f64) -> Result<f64, DataError> {
    if share > 0.0 && share < 1.0 {
        return Ok(share);
    }
    Err(DataError::request("test share", share.to_string(), "a number between 0 and 1"))
}

/// Selects about `share` of `0..n`, evenly spread, at least one and not all. The seed shifts the pattern by less than
/// its period; with seed 0 it is centred.
fn spread(n: usize, share: f64, seed: u64) -> Vec<usize> {
    if n < 2 {
        return Vec::new();
    }
    let held = ((n as f64 * share).round() as usize).clamp(1, n - 1);
    // Multiples of the golden ratio fill the unit interval evenly for any set of seeds.
    let shift = (0.5 + 0.618_033_988_749_894_9 * (seed % 1_000_000) as f64).fract();
    let period = n as f64 / held as f64;
    (0..held).map(|k| (((k as f64 + shift) * period) as usize).min(n - 1)).collect()
}

fn whole_runs(data: &Dataset, is_test: impl Fn(usize, &Run) -> bool) -> Split {
    let mut split = Split { train: Vec::new(), test: Vec::new() };
    for (at, run) in data.runs.iter().enumerate().filter(|(_, run)| !run.is_empty()) {
        let side = if is_test(at, run) { &mut split.test } else { &mut split.train };
        side.push(Part { run: at, rows: 0..run.len() });
    }
    split
}

fn time_blocks(run: &Run, share: f64, seed: u64) -> Split {
    let blocks = TIME_BLOCKS.min(run.len());
    let held = spread(blocks, share, seed);
    let mut split = Split { train: Vec::new(), test: Vec::new() };
    for block in 0..blocks {
        let rows = block * run.len() / blocks..(block + 1) * run.len() / blocks;
        let side = if held.contains(&block) { &mut split.test } else { &mut split.train };
        match side.last_mut() {
            // Adjacent blocks are one part.
            Some(part) if part.rows.end == rows.start => part.rows.end = rows.end,
            _ => side.push(Part { run: 0, rows }),
        }
    }
    split
}

fn tail(data: &Dataset, share: f64) -> Split {
    let mut split = Split { train: Vec::new(), test: Vec::new() };
    for (at, run) in data.runs.iter().enumerate() {
        let cut = (run.len() as f64 * (1.0 - share)) as usize;
        if cut > 0 {
            split.train.push(Part { run: at, rows: 0..cut });
        }
        if cut < run.len() {
            split.test.push(Part { run: at, rows: cut..run.len() });
        }
    }
    split
}

fn hold_out(data: &Dataset, column: &str, values: &[String]) -> Result<Split, DataError> {
    let what = format!("hold-out {column}={}", values.join(","));
    let mut settings = Vec::with_capacity(data.runs.len());
    for run in &data.runs {
        let Some(setting) = data.constant(run, column) else {
            let found = format!("no constant value of {column} in run {}", run.name);
            let there = data.constant_columns();
            return Err(DataError::request(&what, found, format!("one of {}", listed(&there))));
        };
        settings.push(setting);
    }
    for value in values {
        if !settings.iter().any(|setting| are_equal(setting, value)) {
            let mut there = settings.clone();
            there.sort_unstable();
            there.dedup();
            let found = format!("no run with {column}={value}");
            return Err(DataError::request(&what, found, format!("one of {}", listed(&there))));
        }
    }
    Ok(whole_runs(data, |at, _| values.iter().any(|value| are_equal(&settings[at], value))))
}

/// Returns true if the texts are equal, also as numbers: `400` equals `400.0`.
pub(super) fn are_equal(setting: &str, value: &str) -> bool {
    setting == value
        || matches!((setting.parse::<f64>(), value.parse::<f64>()), (Ok(a), Ok(b)) if a == b)
}

#[cfg(test)]
mod tests {
    use super::super::error::BadRows;
    use super::*;
    use crate::message;
    use compensator_core::quantity::JointKind;

    /// Returns `n` runs of ten rows, named by number, in two files; kp is 100 in even runs and 400 in odd ones.
    fn data(n: usize) -> Dataset {
        let run = |at: usize| Run {
            name: at.to_string(),
            file: usize::from(at >= n / 2),
            time_s: (0..10).map(f64::from).collect(),
            velocity: (0..10).map(f64::from).collect(),
            torque: vec![0.0; 10],
            extra: vec![vec![if at.is_multiple_of(2) { 100.0 } else { 400.0 }; 10]],
            labels: vec![("shape".into(), if at < 2 { "sine" } else { "step" }.into())],
            ..Run::default()
        };
        Dataset {
            joint: JointKind::Revolute,
            runs: (0..n).map(run).collect(),
            files: vec!["a.csv".into(), "b.csv".into()],
            rows: 10 * n,
            rows_read: 10 * n,
            bad_rows: BadRows::default(),
            covariates: vec!["kp".into()],
            left_out_columns: vec![],
            notes: vec![],
            torque_law: None,
            torque_constant: None,
            sources: vec![],
        }
    }

    fn test_runs(data: &Dataset, rule: &SplitRule, seed: u64) -> Vec<usize> {
        split(data, rule, seed).unwrap().test.iter().map(|part| part.run).collect()
    }

    #[test]
    fn split_with_default_rule_spreads_held_out_runs() {
        assert_eq!(test_runs(&data(7), &SplitRule::default(), 0), [1, 5]);
        assert_eq!(test_runs(&data(10), &SplitRule::default(), 0), [1, 5, 8]);
        assert_eq!(test_runs(&data(2), &SplitRule::default(), 0), [1]);
        let all: Vec<Vec<usize>> =
            (0..20).map(|seed| test_runs(&data(10), &SplitRule::default(), seed)).collect();
        assert_eq!(all[7], test_runs(&data(10), &SplitRule::default(), 7), "same seed, same split");
        for run in 0..10 {
            assert!(all.iter().any(|held| held.contains(&run)), "some seed holds out run {run}");
        }
        for held in &all {
            assert_eq!(held.len(), 3);
            assert!(held.windows(2).all(|pair| pair[1] - pair[0] >= 3), "{held:?}");
        }
    }

    #[test]
    fn split_with_any_share_puts_every_row_on_one_side() {
        for n in [1, 2, 5, 16] {
            let data = data(n);
            for share in [0.01, 0.3, 0.5, 0.99] {
                for rule in [SplitRule::Spread { share }, SplitRule::Tail { share }] {
                    for seed in 0..5 {
                        let Ok(split) = split(&data, &rule, seed) else { continue };
                        let mut seen = vec![[0; 10]; n];
                        for part in split.train.iter().chain(&split.test) {
                            seen[part.run][part.rows.clone()].iter_mut().for_each(|s| *s += 1);
                        }
                        assert!(seen.iter().all(|run| *run == [1; 10]), "{rule:?} {split:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn split_with_leave_one_run_out_has_all_runs_on_both_sides() {
        let data = data(3);
        let each = split(&data, &SplitRule::LeaveOneRunOut, 0).unwrap();
        assert!(each.is_leave_one_run_out());
        assert_eq!((each.train.len(), each.test_runs(&data).len()), (3, 3));
        assert!(!split(&data, &SplitRule::default(), 0).unwrap().is_leave_one_run_out());
    }

    #[test]
    fn split_with_single_run_holds_out_blocks_of_time() {
        let data = data(1);
        let split = split(&data, &SplitRule::default(), 0).unwrap();
        let rows = |parts: &[Part]| parts.iter().map(|part| part.rows.clone()).collect::<Vec<_>>();
        assert_eq!(rows(&split.test), [1..2, 5..6, 8..9]);
        assert_eq!(rows(&split.train), [0..1, 2..5, 6..8, 9..10]);
        assert_eq!(split.test_runs(&data), ["0"]);
        assert_eq!(data.select(&split.test).rows, 3);
        assert_eq!(data.select(&split.test).runs[1].velocity, [5.0]);
    }

    #[test]
    fn split_with_tail_holds_out_end_of_each_run() {
        let data = data(2);
        let split = split(&data, &SplitRule::Tail { share: 0.3 }, 9).unwrap();
        assert_eq!(split.train, [Part { run: 0, rows: 0..7 }, Part { run: 1, rows: 0..7 }]);
        assert_eq!(split.test, [Part { run: 0, rows: 7..10 }, Part { run: 1, rows: 7..10 }]);
    }

    #[test]
    fn split_with_hold_out_selects_by_name_label_and_setting() {
        let data = data(4);
        let held = |text| test_runs(&data, &SplitRule::parse_hold_out(text).unwrap(), 0);
        assert_eq!(held("run=1,3"), [1, 3]);
        assert_eq!(held("shape=sine"), [0, 1]);
        assert_eq!(held("kp=400.0"), [1, 3]);
    }

    #[test]
    fn split_with_unknown_hold_out_lists_available_values() {
        let data = data(4);
        let refused = |text| {
            let rule = SplitRule::parse_hold_out(text);
            rule.and_then(|rule| split(&data, &rule, 0)).unwrap_err().to_string()
        };
        let parts = ["hold-out kp=200:", "kp=200", "100, 400"];
        message::check("splits", "unknown value", &refused("kp=200"), &parts);
        let parts = ["hold-out velocity_rad_s=3:", "velocity_rad_s", "run 0", "run, shape, kp"];
        message::check("splits", "value that changes", &refused("velocity_rad_s=3"), &parts);
        message::check("splits", "all rows held out", &refused("kp=100,400"), &[]);
        for text in ["kp", "kp="] {
            let parts = ["hold-out", text, "COLUMN=VALUE"];
            message::require(&refused(text), &parts);
        }
        message::check("splits", "no value", &refused("kp"), &[]);
    }

    #[test]
    fn split_with_files_holds_out_their_runs() {
        let data = data(4);
        assert_eq!(test_runs(&data, &SplitRule::Files(vec!["b.csv".into()]), 0), [2, 3]);
        let error = split(&data, &SplitRule::Files(vec!["c.csv".into()]), 0).unwrap_err();
        let parts = ["test files:", "c.csv", "a.csv, b.csv"];
        message::check("splits", "unknown file", &error.to_string(), &parts);
    }

    #[test]
    fn split_with_invalid_share_returns_error() {
        for share in [0.0, 1.0, -0.3, f64::NAN] {
            assert!(split(&data(4), &SplitRule::Tail { share }, 0).is_err());
        }
    }
}
