//! Logs with known causes for a contest: a folder of written worlds, and the measured logs.

use crate::evidence_table::{EvidenceRow, Truth};
use crate::measured::MEASURED_LOGS;
use friction_diagnose::contest::{Figures, Outcome, RigidBody, Rows, contest};
use friction_diagnose::contest_calibration::{FIGURES, figures};
use joint_log::log_check::{self, Corrections};
use joint_log::{ReadOptions, read};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A log with its arguments and known causes.
#[derive(Clone, Debug)]
pub struct KnownLog {
    /// Name of the file without its ending.
    pub name: String,
    /// The CSV file.
    pub path: PathBuf,
    /// Plant of a world, or machine of a measured log.
    pub origin: String,
    /// True if the log is measured.
    pub is_measured: bool,
    /// Hidden effects, each with its detectability.
    pub hidden: Vec<(String, bool)>,
    /// Causes that hold for the log whatever is hidden, or answers that count as right for a measured log.
    pub of_log: Vec<String>,
    /// Answers that a measured log must not have.
    pub never: Vec<String>,
    options: ReadOptions,
    rigid_body: RigidBody,
    decimate: usize,
}

/// Returns the worlds of a folder, in the order of their names.
///
/// # Errors
/// Returns one line if the folder or a truth cannot be read.
pub fn worlds(folder: &Path) -> Result<Vec<KnownLog>, String> {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|end| end == "json") {
            paths.push(path);
        }
    }
    paths.sort();
    paths.iter().map(|path| world(path)).collect()
}

fn world(path: &Path) -> Result<KnownLog, String> {
    let truth = json(path)?;
    let effects = truth["hidden"].as_array().into_iter().flatten();
    let effect = |effect: &Value| {
        let cause = effect["cause"].as_str().unwrap_or_default().to_owned();
        (cause, effect["detectable"].as_bool().unwrap_or_default())
    };
    Ok(KnownLog {
        hidden: effects.map(effect).collect(),
        of_log: strings(&truth["true_of_the_log"]),
        rigid_body: rigid_body(&strings(&truth["rigid_body"]))?,
        origin: truth["plant"].as_str().unwrap_or_default().into(),
        ..KnownLog::new(path.with_extension("csv"), false)
    })
}

/// Returns the measured logs of a folder, with the arguments and answers of its `right-answers.json` or `answers.json`, and
/// those logs of [`MEASURED_LOGS`] that are missing there.
///
/// # Errors
/// Returns one line if the answers cannot be read.
pub fn measured(folder: &Path) -> Result<Vec<KnownLog>, String> {
    let names = ["right-answers.json", "answers.json"].map(|name| folder.join(name));
    let path = names.iter().find(|path| path.is_file()).unwrap_or(&names[0]);
    let answers = json(path)?;
    let mut logs = Vec::new();
    for (file, answer) in answers.as_object().into_iter().flatten() {
        let mut log = KnownLog {
            of_log: strings(&answer["accept"]),
            never: strings(&answer["never"]),
            ..KnownLog::new(folder.join(file), true)
        };
        log.set(&strings(&answer["args"]))?;
        logs.push(log);
    }
    for known in MEASURED_LOGS.iter().filter(|log| answers.get(log.file).is_none()) {
        if known.known.is_empty() {
            continue;
        }
        let mut log = KnownLog {
            of_log: known.known.iter().map(|cause| (*cause).to_owned()).collect(),
            ..KnownLog::new(folder.join(known.file), true)
        };
        log.set(&known.arguments())?;
        logs.push(log);
    }
    logs.retain(|log| log.path.is_file());
    Ok(logs)
}

impl KnownLog {
    fn new(path: PathBuf, is_measured: bool) -> Self {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Self {
            origin: machine(&name),
            name,
            path,
            is_measured,
            hidden: Vec::new(),
            of_log: Vec::new(),
            never: Vec::new(),
            options: ReadOptions::default(),
            rigid_body: RigidBody::default(),
            decimate: 1,
        }
    }

    /// Sets the arguments of the command line.
    fn set(&mut self, arguments: &[String]) -> Result<(), String> {
        for pair in arguments.chunks(2) {
            let [name, value] = pair else { return Err(format!("{}: missing value", pair[0])) };
            let number = || value.parse::<usize>().map_err(|e| format!("{name}: {e}"));
            match name.as_str() {
                "--rigid-body" => {
                    let parts: Vec<String> = value.split(',').map(str::to_owned).collect();
                    self.rigid_body = rigid_body(&parts)?;
                }
                "--columns" => {
                    let pairs = value.split(',').filter_map(|pair| pair.split_once('='));
                    self.options.columns =
                        pairs.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned())).collect();
                }
                "--skip" => self.options.skip = number()?,
                "--decimate" => self.decimate = number()?,
                _ => return Err(format!("{}: unknown argument {name}", self.name)),
            }
        }
        Ok(())
    }

    /// Runs the contest and returns its evidence.
    ///
    /// # Errors
    /// Returns one line if the log cannot be read.
    pub fn evidence(&self) -> Result<Vec<EvidenceRow>, String> {
        let failed = |e: &dyn std::fmt::Display| format!("{}: {e}", self.name);
        let data = read(std::slice::from_ref(&self.path), &self.options, &|_, _| {})
            .map_err(|e| failed(&e))?;
        let data = log_check::check(data, Corrections::default()).data;
        let mut rows = Rows::new(&data, self.rigid_body, self.decimate);
        Ok(self.rows(&contest(&mut rows)))
    }

    fn rows(&self, outcome: &Outcome) -> Vec<EvidenceRow> {
        let best = outcome.finalists.first();
        let correction = best.map(|best| best.correction).unwrap_or_default();
        let row = |cause: &str| EvidenceRow {
            law: format!("{}, {correction:?}", outcome.law),
            floors: outcome.floors,
            rmse: [outcome.base_rmse, outcome.rmse],
            ..self.row(cause)
        };
        let mut rows = vec![row("none")];
        let is_candidate =
            |cause: &str| outcome.causes.iter().any(|fitted| fitted.key.cause == cause);
        let missing = self.hidden.iter().filter(|(cause, _)| !is_candidate(cause));
        rows.extend(missing.map(|(cause, _)| row(cause)));
        let candidate = |fitted: &Figures| EvidenceRow {
            follows: fitted.key.follows(),
            is_candidate: true,
            confusable_with: fitted.confusable_with.iter().map(|key| key.cause.into()).collect(),
            plain: [fitted.inclusion, fitted.materiality()],
            figures: figures(outcome, fitted),
            ..row(fitted.key.cause)
        };
        rows.extend(outcome.causes.iter().map(candidate));
        if self.is_measured {
            // At least one of the accepted answers is in the log; the strongest candidate among them counts.
            let accepted =
                rows.iter_mut().filter(|row| row.is_candidate && row.truth == Truth::Real);
            accepted.skip(1).for_each(|row| row.truth = Truth::Accepted);
        }
        rows
    }

    /// Returns a row of a cause without evidence.
    fn row(&self, cause: &str) -> EvidenceRow {
        let hidden = self.hidden.iter().find(|(listed, _)| listed == cause);
        let is_listed = |list: &[String]| list.iter().any(|listed| listed == cause);
        let is_real = hidden.is_some() || is_listed(&self.of_log);
        let truth = match (is_real, self.is_measured && !is_listed(&self.never)) {
            (true, _) => Truth::Real,
            (false, true) => Truth::Unknown,
            (false, false) => Truth::False,
        };
        EvidenceRow {
            log: self.name.clone(),
            origin: self.origin.clone(),
            is_measured: self.is_measured,
            hidden: self.hidden.len(),
            cause: cause.into(),
            follows: String::new(),
            truth,
            is_of_log: !self.is_measured && is_listed(&self.of_log),
            is_detectable: hidden.is_some_and(|(_, is_detectable)| *is_detectable),
            is_candidate: false,
            confusable_with: Vec::new(),
            law: String::new(),
            plain: [0.0; 2],
            floors: 0.0,
            rmse: [0.0; 2],
            figures: vec![0.0; FIGURES.len()],
        }
    }
}

/// Returns the machine of a measured log: the first word of its name, for the robots the first two without a number.
fn machine(name: &str) -> String {
    let words: Vec<&str> = name.split('-').collect();
    match words.as_slice() {
        ["robot", kind, ..] => format!("robot-{}", kind.trim_end_matches(char::is_numeric)),
        [first, ..] => (*first).to_owned(),
        [] => String::new(),
    }
}

fn json(path: &Path) -> Result<Value, String> {
    let failed = |why: String| format!("{}: {why}", path.display());
    let text = std::fs::read_to_string(path).map_err(|e| failed(e.to_string()))?;
    serde_json::from_str(&text).map_err(|e| failed(e.to_string()))
}

fn strings(value: &Value) -> Vec<String> {
    let list = value.as_array().into_iter().flatten();
    list.filter_map(Value::as_str).map(str::to_owned).collect()
}

fn rigid_body(parts: &[String]) -> Result<RigidBody, String> {
    let mut rigid_body = RigidBody::default();
    for part in parts.iter().filter(|part| !part.is_empty()) {
        match part.as_str() {
            "inertia" => rigid_body.inertia = true,
            "gravity" => rigid_body.gravity = true,
            "load" => rigid_body.load = true,
            "offset" => rigid_body.offset = true,
            _ => return Err(format!("unknown rigid-body part {part}")),
        }
    }
    Ok(rigid_body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machine_of_logs_of_one_machine_is_the_same() {
        assert_eq!(machine("robot-axis1"), machine("robot-axis3"));
        assert_ne!(machine("robot-axis1"), machine("robot-current-j3"));
        assert_eq!(machine("damper-1-actuators"), machine("damper-quakes"));
    }

    #[test]
    fn row_of_measured_log_separates_known_forbidden_and_open_causes() {
        let log = KnownLog {
            of_log: vec!["backlash".into()],
            never: vec!["unmodelled-inertia".into()],
            ..KnownLog::new("damper-1.csv".into(), true)
        };
        let truths =
            ["backlash", "unmodelled-inertia", "time-drift"].map(|cause| log.row(cause).truth);
        assert_eq!(truths, [Truth::Real, Truth::False, Truth::Unknown]);
    }
}
