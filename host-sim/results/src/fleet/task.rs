//! One joint and campaign: its diagnosis, its levels under the fixed model, and its folder of results.
//!
//! A task writes into a folder of its own, which gets its final name only when it is complete. A second call of the same task
//! finds it there and computes nothing. The key of a result names the version of the program, the options and the hashes of
//! the files: a changed log or option is computed again.

use super::statistics::Limit;
use super::{Ageing, FleetJob, FleetRow, LEVELS, Level, SIGNED};
use crate::diagnosis::DiagnosedLog;
use crate::stochastic::StochasticExtension;
use crate::table_file::TableFormat;
use crate::{ResultError, write_atomically};
use compensator_core::{LawKind, ParameterId};
use friction_diagnose::prepare::{Error, PrepareOptions, Prepared, Source, file_sha256, prepare};
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, State, identify};
use joint_log::DataError;
use joint_log::setting::Message;
use joint_log::work::{self, Cancelled};
use serde::{Deserialize, Serialize};
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How the tasks of a fleet are computed.
#[derive(Clone, Debug)]
pub struct FleetOptions {
    /// How each log is read, checked and split.
    pub prepare: PrepareOptions,
    /// Base model of the diagnoses; `None` to select it for each log.
    pub model: Option<Spec>,
    /// Model of the levels, the same for all joints and campaigns.
    pub fixed_model: Spec,
    /// Folder of the results.
    pub out: PathBuf,
    /// Words for a setting in an error message, as of the front end.
    pub worded: fn(Error) -> String,
}

impl FleetOptions {
    /// Creates options with the defaults of the command `fleet`.
    pub fn new(out: PathBuf) -> Self {
        let fixed_model = Spec::law(LawKind::Lugre);
        let worded = |error: Error| error.marked();
        Self { prepare: PrepareOptions::default(), model: None, fixed_model, out, worded }
    }
}

/// Writes `fleet.parquet` and `fleet.html`, each completely or not at all.
///
/// # Errors
/// One line that names the file.
pub fn write_fleet(
    out: &Path,
    rows: &[FleetRow],
    ageing: &[Ageing],
    limits: &[Limit],
) -> Result<(), ResultError> {
    let parquet = super::table(rows).emit(TableFormat::Parquet)?;
    let html = super::page(rows, ageing, limits).render();
    for (name, content) in [("fleet.parquet", &parquet[..]), ("fleet.html", html.as_bytes())] {
        let file = out.join(name);
        write_atomically(&file, content).map_err(ResultError::of_file(&file))?;
    }
    Ok(())
}

/// Name of the file with the row of a task, in its folder.
pub const ROW_FILE: &str = "row.json";

/// Content of [`ROW_FILE`].
#[derive(Serialize, Deserialize)]
struct StoredRow {
    key: String,
    row: FleetRow,
}

/// Reads [`ROW_FILE`] of an earlier call from a result's folder, which is named relative to the folder of the fleet; `None` if
/// there is none.
pub type ReadEarlierRow<'a> = &'a (dyn Fn(&str) -> io::Result<Option<Vec<u8>>> + Sync);

/// Diagnoses the log of one joint and campaign, or takes an earlier result of the same log. A log of several joints gives a row
/// for each. A failure gives a row with its reason and leaves no folder.
pub fn run_task(job: &FleetJob, options: &FleetOptions) -> Vec<FleetRow> {
    let read = |folder: &str| match std::fs::read(options.out.join(folder).join(ROW_FILE)) {
        Ok(row) => Ok(Some(row)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    };
    run_task_beside(job, options, &read)
}

/// Runs a task as [`run_task`] does, with earlier results that are not in the folder `out`, for example in an object store.
pub fn run_task_beside(
    job: &FleetJob,
    options: &FleetOptions,
    earlier: ReadEarlierRow,
) -> Vec<FleetRow> {
    let begin = Instant::now();
    // A defect in one log must not end the others. Cancelling must.
    let outcome = catch_unwind(AssertUnwindSafe(|| try_task(job, options, earlier)));
    let failure = match outcome {
        Ok(Ok(rows)) => return rows,
        Ok(Err(error)) => (options.worded)(error),
        Err(panic) if panic.is::<Cancelled>() => resume_unwind(panic),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            let text = text.unwrap_or("unknown");
            format!("defect of the program: {text}; a diagnosis of this log alone shows its place")
        }
    };
    let copies = job.files.iter().zip(&job.addresses);
    let failure = copies
        .fold(failure, |line, (copy, address)| line.replace(&copy.display().to_string(), address));
    let seconds = Some(begin.elapsed().as_secs_f64());
    vec![FleetRow { error: Some(failure), seconds, ..empty_row(job, &job.joint) }]
}

fn empty_row(job: &FleetJob, joint: &str) -> FleetRow {
    let files = match job.addresses.is_empty() {
        true => job.files.iter().map(|file| file.display().to_string()).collect(),
        false => job.addresses.clone(),
    };
    FleetRow { joint: joint.into(), campaign: job.campaign.clone(), files, ..FleetRow::default() }
}

fn try_task(
    job: &FleetJob,
    options: &FleetOptions,
    earlier: ReadEarlierRow,
) -> Result<Vec<FleetRow>, Error> {
    match one_joint(job, options, &options.prepare, &job.joint, earlier) {
        Err(Error::Data(DataError::SeveralJoints { column, joints, .. })) => {
            let each = joints.iter().map(|name| {
                let mut alone = options.prepare.clone();
                alone.read.only.push((column.clone(), vec![name.clone()]));
                let joint = format!("{}/{name}", job.joint);
                one_joint(job, options, &alone, &joint, earlier)
            });
            each.collect()
        }
        other => other.map(|row| vec![row]),
    }
}

fn one_joint(
    job: &FleetJob,
    options: &FleetOptions,
    read: &PrepareOptions,
    joint: &str,
    earlier: ReadEarlierRow,
) -> Result<FleetRow, Error> {
    let begin = Instant::now();
    let folder = folder_name(joint, &job.campaign);
    let key = key(job, options, read)?;
    if let Some(row) =
        earlier(&folder).map_err(|error| error.to_string())?.and_then(|bytes| stored(&bytes, &key))
    {
        return Ok(row);
    }
    let mut input = prepare(&Source::Files(job.files.clone()), read)?;
    if !job.addresses.is_empty() {
        input.data.files = job.addresses.iter().map(PathBuf::from).collect();
    }
    let question = DiagnosisOptions { model: options.model.clone(), ..input.question() };
    let found = diagnose(&input.data, &input.split, &question, &|_| work::checkpoint())?;
    let mut row = row(job, joint, &input, &found);
    row.fixed_model = options.fixed_model.to_string();
    let fit = fit(&input, &options.fixed_model)?;
    row.levels = determined(&fit, LEVELS);
    let linear = Spec { law: LawKind::Linear, ..options.fixed_model.clone() };
    let linear = if linear == options.fixed_model { fit } else { self::fit(&input, &linear)? };
    row.linear_levels = determined(&linear, LEVELS);
    row.signed = determined(&linear, SIGNED);
    row.seconds = Some(begin.elapsed().as_secs_f64());
    row.report = format!("{folder}/report.html");
    let stored = serde_json::to_vec_pretty(&StoredRow { key, row: row.clone() });
    let stochastic = StochasticExtension::new(&found, input.seed, &|_| work::checkpoint());
    let diagnosed = DiagnosedLog { found: &found, stochastic: &stochastic, input: &input };
    let mut files = diagnosed.short_files()?;
    files.others.push((ROW_FILE, stored.map_err(ResultError::from)?));
    let temporary = tempfile::Builder::new().prefix(".unfinished-").tempdir_in(&options.out);
    let place = options.out.join(&folder);
    let failed = ResultError::of_file(&place);
    let temporary = temporary.map_err(&failed)?;
    let complete = temporary.path().join("new");
    files.write(&complete).map_err(&failed)?;
    publish(&complete, &place, temporary.path()).map_err(failed)?;
    Ok(row)
}

/// Moves a complete folder to its place. An earlier folder there is moved into `temporary`, which the caller removes.
fn publish(complete: &Path, place: &Path, temporary: &Path) -> io::Result<()> {
    if let Some(parent) = place.parent() {
        std::fs::create_dir_all(parent)?;
    }
    if place.exists() {
        std::fs::rename(place, temporary.join("old"))?;
    }
    std::fs::rename(complete, place)
}

/// Returns the row of an earlier call if it has the same key.
fn stored(bytes: &[u8], key: &str) -> Option<FleetRow> {
    let stored: StoredRow = serde_json::from_slice(bytes).ok()?;
    (stored.key == key).then_some(stored.row)
}

fn key(job: &FleetJob, options: &FleetOptions, read: &PrepareOptions) -> Result<String, Error> {
    let hashes: Vec<String> =
        job.files.iter().map(|file| file_sha256(file)).collect::<Result<_, _>>()?;
    let model = options.model.as_ref().map(ToString::to_string).unwrap_or_default();
    Ok(format!(
        "{} | {model} | {} and linear | {read:?} | {}",
        env!("CARGO_PKG_VERSION"),
        options.fixed_model,
        hashes.join(" ")
    ))
}

/// Returns the folder of a result below that of the fleet. Letters that a file system or a link may reject are replaced, and
/// a checksum keeps such names apart.
fn folder_name(joint: &str, campaign: &str) -> String {
    let joint = format!("joint={}", safe_name(joint));
    match campaign {
        "" => joint,
        campaign => format!("{joint}/campaign={}", safe_name(campaign)),
    }
}

fn safe_name(name: &str) -> String {
    let is_safe = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    let is_plain = !name.is_empty() && !name.starts_with('.') && name.chars().all(is_safe);
    if is_plain && name.len() <= MAX_NAME_BYTES {
        return name.to_owned();
    }
    let kept: String = name
        .trim_start_matches('.')
        .chars()
        .map(|letter| if is_safe(letter) { letter } else { '-' })
        .take(MAX_NAME_BYTES)
        .collect();
    format!("{kept}-{}", friction_fit::params::checksum(name.as_bytes()))
}

/// Longest name of a folder without a checksum; file systems permit 255 bytes.
const MAX_NAME_BYTES: usize = 100;

fn row(job: &FleetJob, joint: &str, input: &Prepared, found: &Diagnosis) -> FleetRow {
    let finding = found.findings.first();
    FleetRow {
        model: found.extension().unwrap_or_else(|| found.baseline.spec.to_string()),
        cause: found.cause().into(),
        leading_fault: found.leading_fault().map_or("", |fault| fault.kind.name()).into(),
        columns: finding.map(|finding| finding.columns.clone()).unwrap_or_default(),
        probability: finding.map(|finding| finding.probability),
        size: finding.map(|finding| finding.size.value),
        size_unit: finding.map(|finding| finding.size.unit.to_string()).unwrap_or_default(),
        size_ci95: finding.map(|finding| finding.size.ci95()),
        effect: finding.map(|finding| {
            found.before.metrics.nrmse_std * finding.share_of_residual.max(0.0).sqrt()
        }),
        gain: Some(found.gain.value),
        gain_ci95: Some(found.gain.ci95),
        test_rmse: Some(found.after.metrics.rmse),
        noise_floor: Some(found.noise_floor),
        unit: input.data.joint.torque_unit().into(),
        rows: Some(input.data.rows as u64),
        ..empty_row(job, joint)
    }
}

/// Fits a model of the levels, which is the same for all logs.
fn fit(input: &Prepared, model: &Spec) -> Result<Outcome, Error> {
    let spec = model.clone().on(&input.rigid_body);
    let base = spec.parameters()?;
    let options = FitOptions { passive: true, ..FitOptions::default() };
    Ok(identify(&spec, &base, input.train_rows(), input.test_rows(), &options))
}

/// Returns the parameters of these names that the data determine.
fn determined<const COUNT: usize>(fit: &Outcome, names: [&str; COUNT]) -> [Option<Level>; COUNT] {
    names.map(|name| {
        let id = ParameterId::parse(name)?;
        let estimate = fit.estimates.iter().find(|estimate| estimate.id == id)?;
        let std_error = estimate.std_error.filter(|_| estimate.state == State::Determined)?;
        Some(Level { value: estimate.value, std_error })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folder_name_of_unsafe_name_is_safe_and_distinct() {
        assert_eq!(folder_name("hip_1", "2026-03-01"), "joint=hip_1/campaign=2026-03-01");
        assert_eq!(folder_name("hip", ""), "joint=hip");
        let names = ["a/b", "a b", "../x", "", "a?b#c"].map(|name| folder_name(name, ""));
        for name in &names {
            let letters = name.strip_prefix("joint=").unwrap();
            assert!(
                letters.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)),
                "{name}"
            );
            assert!(!letters.starts_with('.'), "{name}");
        }
        let mut distinct = names.to_vec();
        distinct.sort();
        distinct.dedup();
        assert_eq!(distinct.len(), names.len());
    }

    #[test]
    fn stored_row_has_the_bits_of_the_first_call() {
        // The parser of serde_json is exact to the last bit only with its feature `float_roundtrip`.
        let seconds = Some(-3.9533703000000004);
        let row = FleetRow { seconds, ..FleetRow::default() };
        let bytes = serde_json::to_vec_pretty(&StoredRow { key: "a".into(), row }).unwrap();
        assert_eq!(stored(&bytes, "a").and_then(|row| row.seconds), seconds);
        assert_eq!(stored(&bytes, "b"), None);
    }

    #[test]
    fn publish_replaces_an_earlier_folder_as_a_whole() {
        let root = tempfile::tempdir().unwrap();
        let (new, place) = (root.path().join("new"), root.path().join("a/b"));
        for content in ["one", "two"] {
            let temporary = tempfile::tempdir_in(root.path()).unwrap();
            std::fs::create_dir_all(&new).unwrap();
            std::fs::write(new.join(content), content).unwrap();
            publish(&new, &place, temporary.path()).unwrap();
        }
        assert!(place.join("two").exists() && !place.join("one").exists());
    }
}
