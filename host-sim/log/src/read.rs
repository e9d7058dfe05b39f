//! Reading of several files into one data set.
//!
//! Each file is validated separately, so that messages refer to the rows of that file. Then the files are joined. They
//! must have one joint kind, distinct run names and the same columns: a regressor that exists in some runs only would
//! explain the difference between files. Clocks with a known origin are set to the earliest one, so that the files of
//! a campaign keep a common clock. Finally `skip` drops the start of each run, while the logger's filters settle.

use std::borrow::Cow;
use std::collections::HashSet;
use std::mem::take;
use std::path::{Path, PathBuf};

use compensator_core::quantity::Quantity;

use super::clean::{FileData, clean};
use super::dataset::{Dataset, LeftOutColumn, Run, SourceColumn};
use super::describe::with_likely_columns;
use super::error::DataError;
use super::join;
use super::log_table::LogTable;
use super::options::ReadOptions;
use super::plan::{Purpose, Request};
use super::source::{file_size, read_content, read_file};
use super::table::Table;
use crate::setting::Setting;
use crate::work::checkpoint;

/// A file in memory.
#[derive(Clone, Debug)]
pub struct FileContent {
    /// Its name, for messages and reports.
    pub name: PathBuf,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Reads, validates and joins the files. `progress` is called with the bytes done and the bytes in total.
///
/// Runs keep their names in the file; a file without a `run` column is one run with the file's name. With several
/// files, runs are named `file:run`.
///
/// # Errors
/// If a file cannot be read, is misread (too many bad rows), or does not fit the others.
pub fn read(
    files: &[PathBuf],
    options: &ReadOptions,
    progress: &dyn Fn(u64, u64),
) -> Result<Dataset, DataError> {
    let sizes = sizes(files)?;
    let read = |at: usize, request: Request| read_file(request, sizes[at]);
    read_logs(files, &sizes, options, progress, &read).map_err(|error| match options.join {
        true => error,
        false => with_join(with_likely_columns(error, options), files, options),
    })
}

/// Reads each log with `read`, which gets its place, and makes one data set of them. `sizes` are in bytes.
fn read_logs(
    names: &[PathBuf],
    sizes: &[u64],
    options: &ReadOptions,
    progress: &dyn Fn(u64, u64),
    read: &dyn Fn(usize, Request) -> Result<LogTable<'static>, DataError>,
) -> Result<Dataset, DataError> {
    let purpose = if options.join { Purpose::Join } else { Purpose::Data };
    let (total, mut done) = (sizes.iter().sum(), 0);
    let (mut parts, mut channels) = (Vec::new(), Vec::new());
    progress(0, total);
    for (at, (path, size)) in names.iter().zip(sizes).enumerate() {
        let so_far = |bytes: u64| {
            checkpoint();
            progress(done + bytes.min(*size), total);
        };
        let request = Request { path, options, purpose, is_wide: false, progress: &so_far };
        let table = read(at, request)?;
        match purpose {
            Purpose::Join => channels.push(table.into_table().0),
            _ => parts.push(clean(table)?),
        }
        done += size;
        progress(done, total);
    }
    match purpose {
        Purpose::Join => join_recordings(names, channels, options),
        _ => finish(merge(names, names.iter().map(stem), parts)?, options),
    }
}

/// Validates a table in memory.
fn read_table(table: &Table, options: &ReadOptions) -> Result<FileData, DataError> {
    let (path, purpose) = (Path::new(&table.name), Purpose::Data);
    let request = Request { path, options, purpose, is_wide: false, progress: &|_| {} };
    let columns = table.columns.iter().map(|(name, of)| (name.clone(), Cow::Borrowed(of)));
    clean(LogTable::of_table(&request, columns)?.widen(request)?)
}

/// Joins the tables of the channels of each recording, and validates the results as runs.
fn join_recordings(
    files: &[PathBuf],
    tables: Vec<Table>,
    options: &ReadOptions,
) -> Result<Dataset, DataError> {
    let recordings = join::recordings(files)?;
    let mut tables: Vec<Option<Table>> = tables.into_iter().map(Some).collect();
    let (mut parts, mut names, mut firsts, mut joined_notes) = (vec![], vec![], vec![], vec![]);
    for recording in recordings {
        let channels = recording.files.iter();
        let channels = channels.filter_map(|of| Some((of.word.clone(), tables[of.index].take()?)));
        let joined = join::join_tables(&recording.name, channels.collect(), options)?;
        parts.push(read_table(&joined.table, options)?);
        names.push(joined.table.name.clone());
        firsts.push(recording.files[0].index);
        joined_notes.push(format!("{} are joined by {}", joined.files, joined.in_words));
    }
    let first_files: Vec<PathBuf> = firsts.iter().map(|at| files[*at].clone()).collect();
    let mut data = merge(&first_files, names.into_iter(), parts)?;
    for run in &mut data.runs {
        run.file = firsts[run.file];
    }
    data.files = files.to_vec();
    let others = joined_notes.len().saturating_sub(JOIN_NOTES);
    joined_notes.truncate(JOIN_NOTES);
    if others > 0 {
        joined_notes.push(format!("{others} more recordings are joined alike"));
    }
    data.notes.splice(..0, joined_notes);
    finish(data, options)
}

/// Number of joined recordings that are reported one by one.
const JOIN_NOTES: usize = 3;

/// Replaces the error of a file that lacks columns by the option that joins it with the others, if they hold them.
fn with_join(error: DataError, files: &[PathBuf], options: &ReadOptions) -> DataError {
    let DataError::MissingColumns { file, found, .. } = &error else { return error };
    let recordings = join::recordings(files);
    if !recordings.is_ok_and(|all| all.iter().all(join::Recording::has_channels)) {
        return error;
    }
    let option = Setting::Join.alone();
    let pairs = match read(files, &ReadOptions { join: true, ..options.clone() }, &|_, _| {}) {
        Ok(_) => String::new(),
        Err(DataError::MissingColumns { pairs, .. }) => format!(" with {pairs}"),
        Err(_) => return error,
    };
    DataError::file(
        file.clone(),
        format!("{found}; the files hold one channel each"),
        format!("{option}{pairs}, which joins the files by their times"),
    )
}

/// Validates and joins tables in memory as [`read`] does with files. Their names take the place of the files' names.
///
/// # Errors
/// As [`read`], and if the columns of a table differ in length.
pub fn read_tables(tables: &[Table], options: &ReadOptions) -> Result<Dataset, DataError> {
    let names: Vec<PathBuf> = tables.iter().map(|table| PathBuf::from(&table.name)).collect();
    validate_names(&names, "two tables of this name")?;
    if options.join {
        return join_recordings(&names, tables.to_vec(), options);
    }
    let parts = tables.iter().map(|table| read_table(table, options));
    finish(merge(&names, names.iter().map(stem), parts.collect::<Result<_, _>>()?)?, options)
}

/// Validates and joins the contents of files as [`read`] does with the files. `progress` is called with the bytes done and
/// the bytes in total.
///
/// # Errors
/// As [`read`], and if a content is not a table as text: other formats are read from files only.
pub fn read_contents(
    contents: &[FileContent],
    options: &ReadOptions,
    progress: &dyn Fn(u64, u64),
) -> Result<Dataset, DataError> {
    let names: Vec<PathBuf> = contents.iter().map(|content| content.name.clone()).collect();
    validate_names(&names, "two files of this name")?;
    let sizes: Vec<u64> = contents.iter().map(|content| content.bytes.len() as u64).collect();
    let read = |at: usize, request: Request| read_content(request, &contents[at].bytes);
    read_logs(&names, &sizes, options, progress, &read)
}

/// Fails if there is no name, or one is given twice.
fn validate_names(names: &[PathBuf], twice_in_words: &str) -> Result<(), DataError> {
    if names.is_empty() {
        return Err(no_data());
    }
    let mut seen = HashSet::new();
    let Some(twice) = names.iter().find(|name| !seen.insert(*name)) else { return Ok(()) };
    Err(DataError::file(twice.clone(), twice_in_words, "distinct names"))
}

fn no_data() -> DataError {
    DataError::request("data", "no file", "one or more CSV or Parquet files")
}

/// Returns the sizes, bytes. Fails if a file does not exist, is given twice or is a directory.
fn sizes(files: &[PathBuf]) -> Result<Vec<u64>, DataError> {
    if files.is_empty() {
        return Err(no_data());
    }
    let mut seen = HashSet::new();
    let size = |path: &PathBuf| {
        let size = file_size(path)?;
        let failed = |source| DataError::Io { file: path.clone(), source };
        if !seen.insert(path.canonicalize().map_err(failed)?) {
            // The same rows on both sides of a split would understate the held-out error.
            return Err(DataError::file(path.clone(), "the file given twice", "each file once"));
        }
        Ok(size)
    };
    files.iter().map(size).collect()
}

/// An optional column: its quantity (`None` for an extra covariate) and its name.
type ColumnKey = (Option<Quantity>, String);

/// Joins the files to one data set. Runs without a name take those of their file in `names`.
fn merge(
    files: &[PathBuf],
    names: impl Iterator<Item = String>,
    parts: Vec<FileData>,
) -> Result<Dataset, DataError> {
    let names = distinct(names);
    let joint = parts[0].layout.joint;
    for (part, file) in parts.iter().zip(files) {
        if part.layout.joint != joint {
            let target = |joint| Quantity::Torque.name(joint);
            return Err(DataError::file(
                file.clone(),
                target(part.layout.joint),
                format!("{} as in {}", target(joint), files[0].display()),
            ));
        }
    }
    let mut data = Dataset { joint, files: files.to_vec(), ..Dataset::default() };
    let shared = shared_columns(files, &parts, &mut data.notes);
    for (quantity, name) in &shared {
        if quantity.is_none() {
            data.covariates.push(name.clone());
        }
    }
    let origins: Option<Vec<i128>> = parts.iter().map(|part| part.origin_ns).collect();
    let earliest = origins.and_then(|origins| origins.into_iter().min());
    for (at, part) in parts.into_iter().enumerate() {
        let offset_s = match (part.origin_ns, earliest) {
            (Some(origin), Some(earliest)) => (origin - earliest) as f64 / 1e9,
            _ => 0.0,
        };
        join_sources(&mut data.sources, part.layout.sources, &shared);
        data.rows_read += part.rows;
        data.bad_rows.count += part.bad.count;
        data.bad_rows.first.extend(part.bad.first);
        data.notes.extend(part.layout.notes);
        for column in part.layout.left_out {
            let known = |c: &LeftOutColumn| c == &column;
            if !data.left_out_columns.iter().any(known) {
                data.left_out_columns.push(column);
            }
        }
        let places: Vec<Option<usize>> = part
            .layout
            .optional
            .iter()
            .map(|column| shared.iter().position(|s| s.0 == column.quantity && s.1 == column.name))
            .collect();
        for mut run in part.runs {
            if offset_s > 0.0 {
                run.time_s.iter_mut().for_each(|time| *time += offset_s);
            }
            run.file = at;
            run.name = match (run.name.as_str(), files.len()) {
                ("", _) => names[at].clone(),
                (name, 1) if part.layout.run.is_some() => name.to_owned(),
                (name, _) => format!("{}:{name}", names[at]),
            };
            set_columns(&mut run, &places, &shared);
            data.runs.push(run);
        }
    }
    Ok(data)
}

/// Sets the optional columns of a run. `places` holds the index of each among the shared columns.
fn set_columns(run: &mut Run, places: &[Option<usize>], shared: &[ColumnKey]) {
    let mut columns: Vec<(usize, Vec<f64>)> = places
        .iter()
        .zip(take(&mut run.extra))
        .filter_map(|(place, values)| place.map(|place| (place, values)))
        .collect();
    columns.sort_by_key(|(place, _)| *place);
    for (place, values) in columns {
        match shared[place].0 {
            Some(quantity) => run.set(quantity, values),
            None => run.extra.push(values),
        }
    }
}

/// Adds the origins of a file's columns, for the columns that all files share.
fn join_sources(sources: &mut Vec<SourceColumn>, of_file: Vec<SourceColumn>, shared: &[ColumnKey]) {
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

/// Returns the optional columns that all files have, in the order of the first file. The others get a note.
fn shared_columns(
    files: &[PathBuf],
    parts: &[FileData],
    notes: &mut Vec<String>,
) -> Vec<ColumnKey> {
    let has = |part: &FileData, quantity: Option<Quantity>, name: &str| {
        part.layout.optional.iter().any(|column| column.quantity == quantity && column.name == name)
    };
    let mut shared: Vec<ColumnKey> = Vec::new();
    let mut reported: Vec<&str> = Vec::new();
    for column in parts.iter().flat_map(|part| &part.layout.optional) {
        let lacking = parts.iter().position(|part| !has(part, column.quantity, &column.name));
        match lacking {
            None => {
                let key = (column.quantity, column.name.clone());
                shared.extend((!shared.contains(&key)).then_some(key));
            }
            Some(at) if !reported.contains(&column.name.as_str()) => {
                reported.push(&column.name);
                let (name, file) = (&column.name, files[at].display());
                notes.push(format!("{name} is left out: {file} does not have it"));
            }
            _ => {}
        }
    }
    shared
}

/// Returns the name of a file without its extension.
fn stem(file: impl AsRef<Path>) -> String {
    file.as_ref().file_stem().map_or("data".into(), |stem| stem.to_string_lossy().into_owned())
}

/// Returns names that differ: equal ones are numbered.
fn distinct(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for name in names {
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        let free = std::iter::once(name.clone()).chain(numbered).find(|name| !found.contains(name));
        found.extend(free);
    }
    found
}

/// Drops the first samples of each run, and computes the torque by a servo's law if the options give one.
fn finish(mut data: Dataset, options: &ReadOptions) -> Result<Dataset, DataError> {
    shorten(&mut data, options)?;
    data.torque_constant = options.torque_constant.map(|constant| constant.value);
    if let Some(servo) = &options.torque_from {
        servo.apply(&mut data)?;
    }
    Ok(data)
}

/// Drops the first samples of each run and counts the remaining rows.
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
        return Err(DataError::request(
            Setting::Skip.given(options.skip),
            "no run with a row left",
            "a smaller number or longer runs",
        ));
    }
    if !too_short.is_empty() {
        let names = super::error::listed(&too_short);
        data.notes.push(format!("runs with no row after --skip are left out: {names}"));
    }
    data.runs.retain(|run| !run.is_empty());
    data.rows = data.runs.iter().map(Run::len).sum();
    Ok(())
}
