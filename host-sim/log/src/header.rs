//! Interpretation of a header: which column holds which quantity.
//!
//! The contract puts the unit into the name, so the header states everything that is needed. `torque_nm` or `force_n`
//! is the target and sets the joint kind. The velocity must be of that kind. A name that the contract does not define
//! is an extra covariate under its own name. Logs with other names are mapped by pairs of contract name and file name
//! (`--columns torque_nm=tau_3`), which take precedence over the column's own name.
//!
//! Joints side by side are read one at a time (`joints`). An ambiguous header is an error, not a guess: two columns
//! of one name, two targets, or a linear velocity with a torque (unless the pairs say so).

mod required;

use std::collections::HashSet;
use std::fmt;
use std::path::Path;

use compensator_core::quantity::{JointKind, Quantity};

use super::cell::CellReader;
use super::column_names::ColumnNames;
use super::columns::is_missing_value;
use super::contract::{self, DEMANDS, RUN, TARGETS, TIME, is_joint_position, parse_optional};
use super::dataset::{LeftOutColumn, SourceColumn};
use super::error::{DataError, asked_rows, listed};
use super::joints::{JOINT, OneJoint, one_joint};
use super::name_words::{DATE_NAMES, JOINT_NAMES};
use super::naming::Naming;
use super::options::ReadOptions;
use super::other_unit::{Refusal, other_unit};
use super::preset::{Preset, PresetColumns};
use super::row_clock::Timing;
use super::unit::{self, UnitError, conversion};
use crate::setting::Setting;
use required::RequiredColumns;

/// A column other than time, velocity and torque.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OptionalColumn {
    /// Its quantity; `None` for an extra covariate.
    pub quantity: Option<Quantity>,
    /// Its name in the contract, or its own name.
    pub name: String,
    /// Its position in the file.
    pub reading: CellReader,
    /// True if `--columns` names it.
    pub is_mapped: bool,
}

/// A row selection: rows in which a column holds one of some values.
#[derive(Debug, Clone)]
pub(super) struct RowSelection {
    /// The column in the file.
    pub index: usize,
    /// The values, as given with `--where`.
    pub values: Vec<String>,
    /// True if the column names joints.
    pub is_joint: bool,
}

/// A column whose values may name joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct JointNameColumn {
    /// The column in the file.
    pub index: usize,
    /// True if it names joints whatever it holds. Otherwise it does so only if it changes inside a run.
    pub is_certain: bool,
}

/// The interpreted header.
#[derive(Debug, Clone, Default)]
pub(super) struct Layout {
    pub joint: JointKind,
    /// All names as in the file, for messages.
    pub names: Vec<String>,
    /// The column of the run's name.
    pub run: Option<usize>,
    /// Origin of the times.
    pub timing: Timing,
    /// The columns of time, velocity and torque. Without a velocity, the position takes its place; without a time, the motion
    /// does.
    pub required: [CellReader; 3],
    /// The column that may hold the dates, if time holds only times of day.
    pub dates: Option<usize>,
    /// Whether the velocity must be derived from the position.
    pub is_position: bool,
    /// The joint kind of the velocity's (or position's) unit. It mostly equals that of the target.
    velocity_kind: JointKind,
    pub optional: Vec<OptionalColumn>,
    pub only: Vec<RowSelection>,
    pub joint_names: Vec<JointNameColumn>,
    pub left_out: Vec<LeftOutColumn>,
    pub notes: Vec<String>,
    /// The origin of each column of the data.
    pub sources: Vec<SourceColumn>,
    /// Maximum share of bad rows.
    pub max_bad_share: f64,
}

impl Layout {
    /// Returns the columns of the file that must be read.
    pub fn needed(&self) -> impl Iterator<Item = usize> {
        let required = self.required.iter().map(|reading| reading.index).chain(self.run);
        let optional = self.optional.iter().map(|column| column.reading.index);
        let names = self.joint_names.iter().map(|column| column.index).chain(self.dates);
        required.chain(optional).chain(names).chain(self.only.iter().map(|only| only.index))
    }

    /// Keeps only the columns that the contract or `--columns` names, of a file with many others. `added` is the number of columns that
    /// the file itself does not have.
    pub fn keep_named_columns(&mut self, file: &Path, added: usize) {
        self.optional.retain(|column| {
            column.is_mapped || column.quantity.is_some() || is_joint_position(&column.name)
        });
        let optional = &self.optional;
        self.sources.retain(|source| {
            contract::names().any(|name| name == source.name)
                || optional.iter().any(|column| column.name == source.name)
        });
        let used = self.needed().collect::<HashSet<usize>>().len() - added;
        let count = self.names.len() - added;
        self.notes.push(format!(
            "{}: {used} of {count} columns are read: those with a name of the contract",
            file.display()
        ));
    }

    /// Reads units from a row `place` (above or below) the header and returns true, if that row holds units instead of values. This is so if at
    /// least two of time, velocity and torque have a valid unit there, and no cell is a number. Units given with
    /// `--columns` take precedence.
    ///
    /// # Errors
    /// If another quantity has a unit there that is none of its own.
    pub fn take_units(
        &mut self,
        file: &Path,
        cells: &[&[u8]],
        place: &str,
    ) -> Result<bool, DataError> {
        let text = |reading: &CellReader| {
            unit::in_cell(cells.get(reading.index).copied().unwrap_or_default())
        };
        if cells.iter().any(|cell| fast_float2::parse::<f64, _>(cell).is_ok()) {
            return Ok(false);
        }
        let kind = if self.is_position { Quantity::Position } else { Quantity::Velocity };
        let names = [TIME, kind.name(self.velocity_kind), Quantity::Torque.name(self.joint)];
        let required = self.required.iter_mut().zip(names);
        let required = required.skip(usize::from(matches!(self.timing, Timing::Rate(_))));
        let mut required: Vec<(&mut CellReader, &str)> = required.collect();
        let is_unit =
            |(reading, name): &&(&mut CellReader, &str)| conversion(name, &text(reading)).is_ok();
        if required.iter().filter(is_unit).count() < 2 {
            return Ok(false);
        }
        let has_unit = |column: &&mut OptionalColumn| {
            column.quantity.is_some() || is_joint_position(&column.name)
        };
        let known = self.optional.iter_mut().filter(has_unit);
        required.extend(known.map(|column| (&mut column.reading, &*column.name)));
        for (reading, name) in
            required.into_iter().filter(|(reading, _)| reading.conversion.is_none())
        {
            let symbol = text(reading);
            if is_missing_value(symbol.as_bytes()) {
                continue;
            }
            let conversion = conversion(name, &symbol);
            reading.conversion = Some(conversion.map_err(|expected| {
                wrong_unit(file, &self.names[reading.index], name, &symbol, expected)
            })?);
            let source = self.sources.iter_mut().find(|source| source.name == name);
            source.into_iter().for_each(|source| source.unit = Some(symbol.clone()));
        }
        self.notes.push(format!("the row {place} the header is read as units"));
        Ok(true)
    }
}

/// Returns the error of a column whose unit in the file is none of its quantity.
fn wrong_unit(file: &Path, column: &str, name: &str, unit: &str, expected: UnitError) -> DataError {
    let Refusal { found, expected } = match other_unit(&format!("{column} [{unit}]")) {
        Some(other) => other.refusal(name, column),
        None => Refusal { found: format!("the unit {unit}"), expected: expected.to_string() },
    };
    DataError::request(format!("{}: column {column}", file.display()), found, expected)
}

/// Returns the column that may hold the dates of the times in `time`.
fn date_column(names: &[String], time: usize) -> Option<usize> {
    let is_date = |name: &String| DATE_NAMES.contains(&&*name.trim().to_lowercase());
    names.iter().position(is_date).filter(|at| *at != time)
}

/// Interprets a header, with the columns of a preset if one is given.
///
/// # Errors
/// If a required column is missing or the header is ambiguous. The message names the preset that the names suggest.
pub(super) fn layout(
    file: &Path,
    names: impl Into<ColumnNames>,
    options: &ReadOptions,
) -> Result<Layout, DataError> {
    let names = names.into();
    if names.is_numbered && options.columns.is_empty() {
        return Err(no_header(file, &[NUMBERED_EXAMPLE], names.names.len()));
    }
    let options = &with_contract_names_first(options);
    if let Some(rate_hz) = options.rate_hz {
        check_rate(rate_hz, options)?;
    }
    let Some(preset) = options.preset else {
        let suggested = Preset::recognise(&names);
        return interpret(file, names.names, options).map_err(|error| match suggested {
            Some(preset) => {
                let name = preset.name();
                let add = Setting::Preset.suggested(name);
                error.with_hint(&format!("this looks like a log of {name}: add {add}"))
            }
            None => error,
        });
    };
    let PresetColumns { pairs, note } = preset.columns(file, &names, options)?;
    let mut options = options.clone();
    let of_preset = pairs.iter().map(|pair| (pair.quantity.to_owned(), pair.column_in_unit()));
    options.columns.extend(of_preset);
    let mut layout = interpret(file, names.names, &options)?;
    layout.notes.extend(note);
    Ok(layout)
}

/// Pairs of a file without a header, for an example.
const NUMBERED_EXAMPLE: &str = "1=time_s,2=velocity_rad_s,3=torque_nm";

/// Returns the error of a file without a header. Each of `sets` names its columns.
pub(super) fn no_header(file: &Path, sets: &[impl fmt::Display], count: usize) -> DataError {
    let sets: Vec<String> = sets.iter().map(|pairs| Setting::Columns.suggested(pairs)).collect();
    let (pairs, help) = (sets.join(" or "), Setting::Columns.given("help"));
    DataError::MissingColumns {
        file: file.into(),
        found: "numbers in the first row and no header".into(),
        expected: format!(
            "the columns' names (time_s, velocity_rad_s, torque_nm ..), or {pairs} with the number of each column; {help} \
             shows them"
        ),
        pairs: format!("{pairs} with the number of each column").into(),
        missing: Box::default(),
        count,
    }
}

/// Returns the options with every pair `2=velocity_rad_s:deg/s` as `velocity_rad_s=2:deg/s`.
fn with_contract_names_first(options: &ReadOptions) -> ReadOptions {
    let mut options = options.clone();
    for (ours, theirs) in &mut options.columns {
        let (name, unit) = match theirs.split_once(':') {
            Some((name, unit)) => (name, format!(":{unit}")),
            None => (theirs.as_str(), String::new()),
        };
        let is_number = ours.bytes().all(|byte| byte.is_ascii_digit());
        if is_number && contract::names().any(|known| known == name) {
            let name = name.to_owned();
            *theirs = std::mem::replace(ours, name) + &unit;
        }
    }
    options
}

/// Refuses a rate that is none, and one beside a column of the time.
fn check_rate(rate_hz: f64, options: &ReadOptions) -> Result<(), DataError> {
    let refused = |found: &str, expected: &str| {
        DataError::request(Setting::Rate.given(format!("{rate_hz}Hz")), found, expected)
    };
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(refused("no rate", "a positive number of rows a second"));
    }
    match options.columns.iter().find(|(ours, _)| ours == TIME) {
        Some((_, theirs)) => {
            let column = Setting::Columns.given(format!("{TIME}={theirs}"));
            Err(refused(&format!("{column} as well"), "one of the two"))
        }
        None => Ok(()),
    }
}

/// Interprets the names of the columns.
fn interpret(file: &Path, names: Vec<String>, options: &ReadOptions) -> Result<Layout, DataError> {
    let one = one_joint(file, &names, options)?;
    let naming = Naming::new(file, &one.names, &one.pairs, options)?;
    let timing = match options.rate_hz {
        Some(rate_hz) => Timing::Rate(rate_hz),
        None if naming.is_time_in_steps() => Timing::Steps,
        None => Timing::Stamps,
    };
    let required = RequiredColumns::find(file, &naming, timing)?;
    let kind_note = required.check_kinds(file, &naming)?;
    let required_columns = [required.time, required.motion.reading, required.target.reading];
    let is_free = |at: &usize| required_columns.iter().all(|reading| reading.index != *at);
    let other_case = || {
        let mut columns = naming.columns().filter(|(_, name)| name.eq_ignore_ascii_case(RUN));
        columns.next().filter(|_| columns.next().is_none()).map(|(reading, _)| reading)
    };
    let run = naming.find(RUN).or_else(other_case).map(|reading| reading.index).filter(is_free);
    let only = row_selections(file, &naming, &names, options, one.is_chosen)?;
    let RequiredColumns { time, motion, is_position, target } = required;
    let mut layout = Layout {
        joint: target.kind,
        run,
        timing,
        required: [time, motion.reading, target.reading],
        dates: date_column(&names, time.index).filter(|_| timing == Timing::Stamps),
        is_position,
        velocity_kind: motion.kind,
        joint_names: joint_name_columns(&names, &only, run),
        only,
        max_bad_share: options.max_bad_share,
        left_out: naming.replaced(),
        notes: one.note.iter().cloned().chain(kind_note).collect(),
        ..Layout::default()
    };
    let sources = [
        (options.rate_hz.is_none()).then_some((TIME, time)),
        (!is_position).then_some((Quantity::Velocity.name(motion.kind), motion.reading)),
        Some((target.name, target.reading)),
    ];
    let sources = sources.into_iter().flatten();
    layout.sources = sources.map(|(name, of)| source_column(&names, &naming, name, of)).collect();
    add_optional_columns(&mut layout, &names, &naming, &one, &required);
    let unread_time = naming.find(TIME).filter(|_| options.rate_hz.is_some());
    layout.left_out.extend(unread_time.map(|time| LeftOutColumn {
        name: names[time.index].clone(),
        why: "the times are those of --rate".into(),
    }));
    layout.notes.extend(naming.only_joint_position().map(|(joint, position)| {
        format!("{}: {joint} is read as {position}, because the log has no other", file.display())
    }));
    if let Some(name) =
        run.map(|run| &names[run]).filter(|name| naming.find(RUN).is_none() && *name != RUN)
    {
        layout.notes.push(format!("{}: the column {name} is read as {RUN}", file.display()));
    }
    layout.names = names;
    Ok(layout)
}

/// Returns the origin of a column.
fn source_column(
    names: &[String],
    naming: &Naming,
    name: &str,
    reading: CellReader,
) -> SourceColumn {
    SourceColumn {
        name: name.into(),
        header: names[reading.index].clone(),
        unit: naming.unit(name).map(str::to_owned),
        ..SourceColumn::default()
    }
}

/// Adds every column that is not required, as an optional column or with the reason why it is left out.
fn add_optional_columns(
    layout: &mut Layout,
    names: &[String],
    naming: &Naming,
    one: &OneJoint,
    required: &RequiredColumns,
) {
    let RequiredColumns { time, motion, is_position, target } = required;
    let used = [time.index, motion.reading.index, target.reading.index];
    let velocity_name = Quantity::Velocity.name(motion.kind);
    for (reading, name) in naming.columns() {
        let index = reading.index;
        let is_used = used.contains(&index) && !naming.is_mapped(name) || layout.run == Some(index);
        let is_required = [TIME, velocity_name, target.name].contains(&name);
        if one.others.contains(&index) {
            continue;
        }
        if (is_used || is_required) && !(*is_position && name == motion.name) {
            continue;
        }
        match covariate_error(name) {
            None => {
                // A position in the unit of the other joint kind is an extra covariate.
                let quantity = parse_optional(name, motion.kind);
                let is_mapped = naming.is_mapped(name);
                layout.sources.push(source_column(names, naming, name, reading));
                let name = name.into();
                layout.optional.push(OptionalColumn { quantity, name, reading, is_mapped });
            }
            Some(why) => {
                let nameless = || format!("number {}", index + 1);
                let name = if name.is_empty() { nameless() } else { name.into() };
                layout.left_out.push(LeftOutColumn { name, why: why.into() });
            }
        }
    }
}

/// Resolves the columns of `--where`: by contract name first, then by the file's own name.
fn row_selections(
    file: &Path,
    naming: &Naming,
    names: &[String],
    options: &ReadOptions,
    joint_is_chosen: bool,
) -> Result<Vec<RowSelection>, DataError> {
    let find = |(column, values): &(String, Vec<String>)| {
        let by_header = || names.iter().position(|name| name == column);
        let joint = || names.iter().position(|name| column == JOINT && is_joint_name(name));
        let index =
            naming.find(column).map(|reading| reading.index).or_else(by_header).or_else(joint);
        let is_joint = is_joint_name(column) || column == "name";
        index.map(|index| RowSelection { index, values: values.clone(), is_joint }).ok_or_else(
            || {
                DataError::request(
                    format!("{}: {}", file.display(), asked_rows(column, values)),
                    format!("no column {column}"),
                    format!("one of {}", listed(names)),
                )
            },
        )
    };
    let by_row = options.only.iter().filter(|(column, _)| !(joint_is_chosen && column == JOINT));
    by_row.map(find).collect()
}

/// Returns true if a column of this name names joints.
fn is_joint_name(name: &str) -> bool {
    let name = name.trim_start_matches('#').trim().to_lowercase();
    JOINT_NAMES.split(' ').any(|of| of == name)
}

/// Returns the columns that may name several joints, except those that select rows or name the run.
fn joint_name_columns(
    names: &[String],
    only: &[RowSelection],
    run: Option<usize>,
) -> Vec<JointNameColumn> {
    let suspect = |(index, name): (usize, &String)| {
        let is_certain = is_joint_name(name);
        let is_free = run != Some(index) && only.iter().all(|only| only.index != index);
        let is_name = name.trim_start_matches('#').trim().eq_ignore_ascii_case("name");
        (is_free && (is_certain || is_name)).then_some(JointNameColumn { index, is_certain })
    };
    names.iter().enumerate().filter_map(suspect).collect()
}

/// Returns why a column cannot be a covariate, or `None` if it can.
fn covariate_error(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("it has no name")
    } else if name.starts_with("Unnamed: ") || name == "__index_level_0__" {
        Some("it is the row index of a pandas table")
    } else if TARGETS.iter().any(|(target, _)| *target == name) {
        Some("it is a second target, and --columns names the other one")
    } else if DEMANDS.contains(&name) {
        Some("a demand is no cause of friction")
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
