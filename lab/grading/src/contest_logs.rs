//! Logs with known causes for a contest: a folder of written worlds, and the measured logs.

use crate::GradingError;
use crate::evidence_table::{EvidenceRow, Truth};
use crate::measured::MEASURED_LOGS;
use friction_diagnose::contest::{Figures, Outcome, RigidBody, Rows, contest};
use friction_diagnose::contest_calibration::{FIGURES, figures};
use friction_diagnose::prepare::{PrepareOptions, Source, prepare};
use friction_fit::spec::parse_rigid_body;
use joint_log::SplitRule;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
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
    /// Hidden effects.
    pub hidden: Vec<KnownEffect>,
    /// Causes that hold for the log whatever is hidden, or answers that count as right for a measured log.
    pub of_log: Vec<String>,
    /// Answers that a measured log must not have.
    pub never: Vec<String>,
    options: PrepareOptions,
}

/// An effect that a world hides.
#[derive(Clone, Debug, Deserialize)]
pub struct KnownEffect {
    /// Its cause.
    pub cause: String,
    /// True if a refit of the true structure shows it.
    #[serde(rename = "detectable")]
    pub is_detectable: bool,
}

/// The parts of a world's truth that a contest needs. A missing key is an error: without it, the world would count as one that
/// hides nothing.
#[derive(Deserialize)]
struct WorldTruth {
    plant: String,
    hidden: Vec<KnownEffect>,
    rigid_body: Vec<String>,
    true_of_the_log: Vec<String>,
}

/// What is known of a measured log, and the arguments of the command line with which it is read.
#[derive(Deserialize)]
struct MeasuredTruth {
    accept: Vec<String>,
    never: Vec<String>,
    args: Vec<String>,
}

/// Returns the worlds of a folder, in the order of their names.
///
/// # Errors
/// Returns an error if the folder or a truth cannot be read.
pub fn worlds(folder: &Path) -> Result<Vec<KnownLog>, GradingError> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(GradingError::io(folder))? {
        let path = entry.map_err(GradingError::io(folder))?.path();
        if path.extension().is_some_and(|end| end == "json") {
            paths.push(path);
        }
    }
    paths.sort();
    paths.iter().map(|path| world(path)).collect()
}

fn world(path: &Path) -> Result<KnownLog, GradingError> {
    let truth: WorldTruth = read_json(path)?;
    let mut log = KnownLog::new(path.with_extension("csv"), false);
    log.options.rigid_body = parse_rigid_body(&truth.rigid_body.join(","))?;
    Ok(KnownLog { hidden: truth.hidden, of_log: truth.true_of_the_log, origin: truth.plant, ..log })
}

/// Returns the measured logs of a folder, with the arguments and answers of its `right-answers.json` or `answers.json`, and
/// those logs of [`MEASURED_LOGS`] that are missing there.
///
/// # Errors
/// Returns an error if the answers cannot be read.
pub fn measured(folder: &Path) -> Result<Vec<KnownLog>, GradingError> {
    let names = ["right-answers.json", "answers.json"].map(|name| folder.join(name));
    let path = names.iter().find(|path| path.is_file()).unwrap_or(&names[0]);
    let answers: Map<String, Value> = read_json(path)?;
    let mut logs = Vec::new();
    for (file, answer) in &answers {
        let truth = MeasuredTruth::deserialize(answer)
            .map_err(|error| GradingError::Json { path: path.clone(), error }.of(file))?;
        let mut log = KnownLog::new(folder.join(file), true);
        log.set(&truth.args).map_err(|error| error.of(file))?;
        logs.push(KnownLog { of_log: truth.accept, never: truth.never, ..log });
    }
    for known in MEASURED_LOGS.iter().filter(|log| !answers.contains_key(log.file)) {
        let log = KnownLog::new(folder.join(known.file), true);
        if known.known.is_empty() || !log.path.is_file() {
            continue;
        }
        let of_log = known.known.iter().map(|cause| (*cause).to_owned()).collect();
        logs.push(KnownLog { of_log, options: known.options(), ..log });
    }
    Ok(logs)
}

impl KnownLog {
    fn new(path: PathBuf, is_measured: bool) -> Self {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let options =
            PrepareOptions { split: SplitRule::LeaveOneRunOut, ..PrepareOptions::default() };
        Self {
            origin: machine(&name),
            name,
            path,
            is_measured,
            hidden: Vec::new(),
            of_log: Vec::new(),
            never: Vec::new(),
            options,
        }
    }

    /// Sets the arguments of the command line.
    fn set(&mut self, arguments: &[String]) -> Result<(), GradingError> {
        for pair in arguments.chunks(2) {
            let [name, value] = pair else { return Err(GradingError::NoValue(pair[0].clone())) };
            let wrong = |expected: &'static str| GradingError::Value {
                name: name.clone(),
                found: value.clone(),
                expected,
            };
            let number = || value.parse::<usize>().map_err(|_| wrong("a whole number"));
            match name.as_str() {
                "--rigid-body" => self.options.rigid_body = parse_rigid_body(value)?,
                "--columns" => {
                    let pairs = value.split(',').map(|pair| pair.split_once('='));
                    let pairs = pairs.map(|pair| pair.ok_or_else(|| wrong("a=b,c=d")));
                    let pairs: Vec<(&str, &str)> = pairs.collect::<Result<_, _>>()?;
                    let owned = |(ours, theirs): (&str, &str)| (ours.to_owned(), theirs.to_owned());
                    self.options.read.columns = pairs.into_iter().map(owned).collect();
                }
                "--skip" => self.options.read.skip = number()?,
                "--decimate" => self.options.decimate = number()?,
                _ => return Err(GradingError::UnknownArgument(name.clone())),
            }
        }
        Ok(())
    }

    /// Runs the contest and returns its evidence.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read, or the product refuses it.
    pub fn evidence(&self) -> Result<Vec<EvidenceRow>, GradingError> {
        let input = prepare(&Source::Files(vec![self.path.clone()]), &self.options)
            .map_err(|error| GradingError::from(error).of(&self.name))?;
        let rigid_body = RigidBody::of(&input.rigid_body);
        let mut rows = Rows::new(&input.data, rigid_body, input.decimate);
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
        let missing = self.hidden.iter().filter(|effect| !is_candidate(&effect.cause));
        rows.extend(missing.map(|effect| row(&effect.cause)));
        let candidate = |fitted: &Figures| EvidenceRow {
            follows: fitted.key.follows(),
            is_candidate: true,
            confusable_with: fitted.confusable_with.iter().map(|key| key.cause.into()).collect(),
            inclusion: fitted.inclusion,
            materiality: fitted.materiality(),
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
        let hidden = self.hidden.iter().find(|effect| effect.cause == cause);
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
            is_detectable: hidden.is_some_and(|effect| effect.is_detectable),
            is_candidate: false,
            confusable_with: Vec::new(),
            law: String::new(),
            inclusion: 0.0,
            materiality: 0.0,
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

/// Reads a file of JSON.
///
/// # Errors
/// Returns an error with the path if the file cannot be read, is not JSON, or lacks a key.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, GradingError> {
    let text = std::fs::read_to_string(path).map_err(GradingError::io(path))?;
    serde_json::from_str(&text).map_err(|error| GradingError::Json { path: path.to_owned(), error })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_with(name: &str, text: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join(name), text).expect("a file");
        folder
    }

    #[test]
    fn worlds_with_a_truth_that_lacks_what_is_hidden_returns_error() {
        let folder = folder_with(
            "a.json",
            r#"{"plant": "bristles", "rigid_body": [], "true_of_the_log": []}"#,
        );
        let error = worlds(folder.path()).expect_err("no key").to_string();
        assert!(error.contains("a.json: missing field `hidden`"), "{error}");
    }

    #[test]
    fn measured_with_a_column_that_is_no_pair_returns_error() {
        let answer = r#"{"accept": [], "never": [], "args": ["--columns", "torque_nm"]}"#;
        let folder = folder_with("answers.json", &format!(r#"{{"a.csv": {answer}}}"#));
        let error = measured(folder.path()).expect_err("no pair").to_string();
        assert_eq!(error, r#"a.csv: --columns: found "torque_nm", expected a=b,c=d"#);
    }

    #[test]
    fn evidence_of_a_log_that_the_product_refuses_returns_error() {
        let rows: String =
            (0..400).map(|row| format!("{},{},1.0\n", 0.01 * f64::from(row), row % 7)).collect();
        let folder = folder_with("a.csv", &format!("time_s,velocity_rad_s,torque_nm\n{rows}"));
        let log = KnownLog::new(folder.path().join("a.csv"), true);
        let error = log.evidence().expect_err("a constant torque").to_string();
        assert!(error.starts_with("a: ") && error.contains("torque_nm"), "{error}");
    }

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
