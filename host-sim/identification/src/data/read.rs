//! Files in, one data set out.
//!
//! Each file is cleaned for itself, so that what is told about a row is told in terms of its own
//! file. Then the files must fit together: one joint kind, distinct run names, and the same
//! columns, because a regressor that exists in some runs only would explain the difference between
//! files. Clocks that say when they count from are set to the earliest, so that a campaign keeps its own. Last, `skip`
//! drops the start of each run (the logger's own filters were still settling).

use std::collections::HashSet;
use std::path::PathBuf;

use compensator_core::quantity::Quantity;

use super::clean::{CleanRun, FileData};
use super::dataset::{Dataset, LeftOutColumn, Run, SourceColumn};
use super::error::{BadRows, DataError};
use super::source::read_file;

/// How files are to be read.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Pairs of contract name and foreign name, the latter with its unit where that is not the contract's
    /// (`dq_3:deg/s`), and an element where its cells are lists (`velocity[2]`).
    pub columns: Vec<(String, String)>,
    /// Only rows in which each of these columns is one of its values.
    pub only: Vec<(String, Vec<String>)>,
    /// How many samples to drop at the start of each run.
    pub skip: usize,
}

/// Reads, cleans and joins the files. `progress` is told the bytes done and the bytes in total.
///
/// Runs are named as in the file (a file without a `run` column is one run of the file's own
/// name), and with several files as `file:run`.
pub fn read(
    files: &[PathBuf],
    options: &ReadOptions,
    progress: &dyn Fn(u64, u64),
) -> Result<Dataset, DataError> {
    let sizes = sizes(files)?;
    let total = sizes.iter().sum();
    let mut done = 0;
    let mut parts = Vec::with_capacity(files.len());
    progress(0, total);
    for (path, size) in files.iter().zip(sizes) {
        let so_far = |bytes: u64| progress(done + bytes.min(size), total);
        parts.push(read_file(path, size, options, &so_far)?);
        done += size;
        progress(done, total);
    }
    let mut data = join(files, parts)?;
    shorten(&mut data, options)?;
    Ok(data)
}

/// The sizes in bytes; fails if a file is not there, is given twice or is no file.
fn sizes(files: &[PathBuf]) -> Result<Vec<u64>, DataError> {
    if files.is_empty() {
        return Err(DataError::Request {
            what: "data".into(),
            found: "no file".into(),
            expected: "one or more CSV or Parquet files".into(),
        });
    }
    let mut seen = HashSet::new();
    let size = |path: &PathBuf| {
        let failed = |source| DataError::Io { file: path.clone(), source };
        let wrong = |found: &str, expected: &str| DataError::File {
            file: path.clone(),
            found: found.into(),
            expected: expected.into(),
        };
        let about = std::fs::metadata(path).map_err(failed)?;
        if about.is_dir() {
            return Err(wrong("a directory", "a CSV or Parquet file"));
        }
        if !seen.insert(path.canonicalize().map_err(failed)?) {
            // The same rows on both sides of a split would make any model look good.
            return Err(wrong("the file given twice", "each file once"));
        }
        Ok(about.len())
    };
    files.iter().map(size).collect()
}

/// An optional column: what it measures, `None` of an extra covariate, and its name.
type Place = (Option<Quantity>, String);

/// Makes one data set of the files.
fn join(files: &[PathBuf], parts: Vec<FileData>) -> Result<Dataset, DataError> {
    let joint = parts[0].joint;
    for (part, file) in parts.iter().zip(files) {
        if part.joint != joint {
            let target = |joint| Quantity::Torque.name(joint);
            return Err(DataError::File {
                file: file.clone(),
                found: target(part.joint).into(),
                expected: format!("{} as in {}", target(joint), files[0].display()),
            });
        }
    }
    let mut data = Dataset {
        joint,
        runs: Vec::new(),
        files: files.to_vec(),
        rows: 0,
        rows_read: 0,
        bad_rows: BadRows::default(),
        covariates: Vec::new(),
        left_out_columns: Vec::new(),
        notes: Vec::new(),
        sources: Vec::new(),
    };
    let shared = shared_columns(files, &parts, &mut data.notes);
    for (quantity, name) in &shared {
        if quantity.is_none() {
            data.covariates.push(name.clone());
        }
    }
    let stems = distinct_stems(files);
    let origins: Option<Vec<i128>> = parts.iter().map(|part| part.origin_ns).collect();
    let earliest = origins.and_then(|origins| origins.into_iter().min());
    for (at, part) in parts.into_iter().enumerate() {
        let later_s = match (part.origin_ns, earliest) {
            (Some(origin), Some(earliest)) => (origin - earliest) as f64 / 1e9,
            _ => 0.0,
        };
        join_sources(&mut data.sources, part.sources, &shared);
        data.rows_read += part.rows;
        data.bad_rows.count += part.bad.count;
        data.bad_rows.first.extend(part.bad.first);
        data.notes.extend(part.notes);
        for column in part.left_out {
            let known = |c: &LeftOutColumn| c == &column;
            if !data.left_out_columns.iter().any(known) {
                data.left_out_columns.push(column);
            }
        }
        let places: Vec<Option<usize>> = part
            .optional
            .iter()
            .map(|column| shared.iter().position(|s| s.0 == column.quantity && s.1 == column.name))
            .collect();
        for mut clean in part.runs {
            if later_s > 0.0 {
                clean.required[0].iter_mut().for_each(|time| *time += later_s);
            }
            let name = match (&clean.name, files.len()) {
                (Some(run), 1) if part.has_runs => run.clone(),
                (Some(run), _) => format!("{}:{run}", stems[at]),
                (None, _) => stems[at].clone(),
            };
            data.runs.push(make_run(name, at, clean, &places, &shared));
        }
    }
    Ok(data)
}

/// Adds where a file's columns come from; only those that all files share.
fn join_sources(sources: &mut Vec<SourceColumn>, of_file: Vec<SourceColumn>, shared: &[Place]) {
    for (at, source) in of_file.into_iter().enumerate() {
        match sources.iter_mut().find(|known| known.name == source.name) {
            Some(known) => {
                known.filled += source.filled;
                known.fill = known.fill.or(source.fill);
            }
            // Time, velocity and torque come first.
            None if at < 3 || shared.iter().any(|(_, name)| *name == source.name) => {
                sources.push(source);
            }
            None => {}
        }
    }
}

/// The optional columns all files have, in the order of the first; the others get a note.
fn shared_columns(files: &[PathBuf], parts: &[FileData], notes: &mut Vec<String>) -> Vec<Place> {
    let has = |part: &FileData, quantity: Option<Quantity>, name: &str| {
        part.optional.iter().any(|column| column.quantity == quantity && column.name == name)
    };
    let mut shared: Vec<Place> = Vec::new();
    let mut told: Vec<&str> = Vec::new();
    for column in parts.iter().flat_map(|part| &part.optional) {
        let lacking = parts.iter().position(|part| !has(part, column.quantity, &column.name));
        match lacking {
            None if !has_pair(&shared, column.quantity, &column.name) => {
                shared.push((column.quantity, column.name.clone()));
            }
            Some(at) if !told.contains(&column.name.as_str()) => {
                told.push(&column.name);
                let (name, file) = (&column.name, files[at].display());
                notes.push(format!("{name} is left out: {file} does not have it"));
            }
            _ => {}
        }
    }
    shared
}

fn has_pair(columns: &[Place], quantity: Option<Quantity>, name: &str) -> bool {
    columns.iter().any(|column| column.0 == quantity && column.1 == name)
}

/// Puts a run's columns where they belong. `places` says for each of them which of the shared
/// columns it is.
fn make_run(
    name: String,
    file: usize,
    clean: CleanRun,
    places: &[Option<usize>],
    shared: &[Place],
) -> Run {
    let [time_s, velocity, torque] = clean.required;
    let mut run =
        Run { name, file, time_s, velocity, torque, labels: clean.labels, ..Run::default() };
    let mut columns: Vec<(usize, Vec<f64>)> = places
        .iter()
        .zip(clean.optional)
        .filter_map(|(place, values)| place.map(|place| (place, values)))
        .collect();
    columns.sort_by_key(|(place, _)| *place);
    for (place, values) in columns {
        match shared[place].0 {
            Some(quantity) => run.set(quantity, values),
            None => run.extra.push(values),
        }
    }
    run
}

/// File names without their endings, numbered where two are the same.
fn distinct_stems(files: &[PathBuf]) -> Vec<String> {
    let mut stems: Vec<String> = Vec::new();
    for file in files {
        let stem =
            file.file_stem().map_or("data".into(), |stem| stem.to_string_lossy().into_owned());
        let mut name = stem.clone();
        let mut number = 2;
        while stems.contains(&name) {
            name = format!("{stem}-{number}");
            number += 1;
        }
        stems.push(name);
    }
    stems
}

/// Skips and decimates, and counts what is left.
fn shorten(data: &mut Dataset, options: &ReadOptions) -> Result<(), DataError> {
    for run in &mut data.runs {
        let start = options.skip.min(run.len());
        if start > 0 {
            *run = run.slice(start..run.len());
        }
    }
    let too_short: Vec<&str> =
        data.runs.iter().filter(|run| run.is_empty()).map(|run| run.name.as_str()).collect();
    if too_short.len() == data.runs.len() {
        return Err(DataError::Request {
            what: format!("--skip {}", options.skip),
            found: "no run with a row left".into(),
            expected: "a smaller number or longer runs".into(),
        });
    }
    if !too_short.is_empty() {
        let names = super::error::listed(&too_short);
        data.notes.push(format!("runs too short to skip are left out: {names}"));
    }
    data.runs.retain(|run| !run.is_empty());
    data.rows = data.runs.iter().map(Run::len).sum();
    Ok(())
}
