//! The names of a file's columns after `--columns` is applied.
//!
//! A pair `torque_nm=tau_3` has two effects: the column `tau_3` gets the name `torque_nm`, and a column whose own
//! name is `torque_nm` loses it. With both, a user can read files with other names and files with misleading names,
//! and can swap two columns. The file name may be followed by a unit (`dq_3:deg/s`) and by the element of a list
//! (`velocity[2]`). A column whose own name holds a colon or brackets takes precedence.

mod missing;

use super::cell::CellReader;
use super::clock::is_date;
use super::column_pair::{ColumnPair, STEP_MARK};
use super::contract::{self, POSITIONS, TARGETS, TIME};
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header, listed};
use super::guess;
use super::options::ReadOptions;
use super::other_unit::{OtherUnit, Refusal, other_unit};
use super::servo_torque::ServoTorque;
use super::torque_scale;
use super::unit::{self, Conversion, conversion};
use crate::setting::{Setting, shell_word};
use compensator_core::quantity::{JointKind, Quantity};
use std::path::Path;

/// The names of a file's columns: those in the file and those given with `--columns`.
pub(super) struct Naming<'a> {
    /// The names in the file.
    names: &'a [String],
    /// The pairs of `--columns`.
    mapped: Vec<Mapped<'a>>,
    /// The column of the joint's position that is read as the position, with its names.
    only_joint_position: Option<(&'static str, &'static str)>,
}

/// A pair of `--columns` with its column in the file.
struct Mapped<'a> {
    name: &'a str,
    reading: CellReader,
    /// The unit as given.
    unit: Option<&'a str>,
    /// True if it is a torque in amperes, which the torque constant converts.
    is_current: bool,
    /// True if the column holds the steps between the rows.
    is_step: bool,
}

impl<'a> Naming<'a> {
    /// Applies the pairs of `--columns`.
    ///
    /// # Errors
    /// If the header holds only numbers or a name twice, or if a pair is invalid.
    pub fn new(
        file: &Path,
        names: &'a [String],
        mapping: &'a [(String, String)],
        options: &'a ReadOptions,
    ) -> Result<Self, DataError> {
        check_names(file, names, mapping.is_empty())?;
        let mapped = mapped_columns(file, names, mapping, options)?;
        let mut naming = Naming { names, mapped, only_joint_position: None };
        naming.check_torque_constant(file, options)?;
        naming.read_only_joint_position();
        if let Some(servo) = &options.torque_from {
            let target = naming.servo_target(file, servo, options)?;
            naming.mapped.push(target);
        }
        Ok(naming)
    }

    /// Reads the position of the joint as the position, if the log has no other: then it is the only angle that is known, and
    /// everything that follows an angle follows it.
    fn read_only_joint_position(&mut self) {
        let is_there = |name: &str| self.find(name).is_some();
        if POSITIONS.iter().any(|(name, _)| is_there(name)) {
            return;
        }
        let kinds = [JointKind::Revolute, JointKind::Prismatic];
        let kind = kinds.into_iter().find(|kind| is_there(contract::joint_position(*kind)));
        let Some(kind) = kind else { return };
        let (joint, position) = (contract::joint_position(kind), Quantity::Position.name(kind));
        if let Some(mapped) = self.mapped.iter_mut().find(|mapped| mapped.name == joint) {
            mapped.name = position;
        } else if let Some(reading) = self.find(joint) {
            let mapped =
                Mapped { name: position, reading, unit: None, is_current: false, is_step: false };
            self.mapped.push(mapped);
        }
        self.only_joint_position = Some((joint, position));
    }

    /// Returns the column of the joint's position and the name as which it is read, if the log has no other position.
    pub fn only_joint_position(&self) -> Option<(&'static str, &'static str)> {
        self.only_joint_position
    }

    /// Returns the target of a servo, which takes the place of the torque while the log is read.
    fn servo_target(
        &self,
        file: &Path,
        servo: &'a ServoTorque,
        options: &ReadOptions,
    ) -> Result<Mapped<'a>, DataError> {
        let refuse = |found: String, expected: String| {
            let target = format!("target={}", servo.target);
            let what = format!("{}: {}", file.display(), Setting::TorqueFrom.given(target));
            DataError::request(what, found, expected)
        };
        let is_linear = self.find(POSITIONS[0].0).is_none() && self.find(POSITIONS[1].0).is_some();
        let kind = usize::from(is_linear);
        if let Some((name, _)) = TARGETS.iter().find(|(name, _)| self.find(name).is_some()) {
            let expected = "a log without a torque, which needs no control law";
            return Err(refuse(format!("the column {name}"), expected.into()));
        }
        let Some(ForeignColumn { reading, unit }) = find_foreign(self.names, &servo.target) else {
            let column = without_unit(&servo.target);
            let expected = format!("one of {}", listed(self.names));
            return Err(refuse(format!("no column {column}"), expected));
        };
        let position = POSITIONS[kind].0;
        if self.find(position).is_some_and(|found| found.index == reading.index) {
            let expected = "the commanded position, not the measured one";
            return Err(refuse(format!("the column of {position}"), expected.into()));
        }
        let header = &self.names[reading.index];
        let pair = Pair { name: position, foreign: &servo.target, unit, header };
        let conversion = pair.conversion(options).map_err(|wrong| {
            let Refusal { found, expected } = wrong.refusal;
            refuse(found, expected.replace(&format!("{position}="), "target="))
        })?;
        let reading = CellReader { conversion, ..reading };
        Ok(Mapped { name: TARGETS[kind].0, reading, unit, is_current: false, is_step: false })
    }

    /// Rejects a torque constant if no torque is in amperes.
    fn check_torque_constant(&self, file: &Path, options: &ReadOptions) -> Result<(), DataError> {
        let Some(constant) = options.torque_constant else { return Ok(()) };
        let unit = constant.joint.torque_unit();
        let name = Quantity::Torque.name(constant.joint);
        let mapped = self.mapped.iter().find(|mapped| mapped.name == name);
        if mapped.is_some_and(|mapped| mapped.is_current) {
            return Ok(());
        }
        let free: Vec<&str> = self.columns().map(|(_, name)| name).collect();
        let pair = match mapped {
            Some(mapped) => ColumnPair::new(name, &self.names[mapped.reading.index], Some("A")),
            None => guess::column(name, &free)
                .filter(ColumnPair::is_current)
                .unwrap_or_else(|| ColumnPair::new(name, "NAME", Some("A"))),
        };
        let what = Setting::TorqueConstant.given(format!("{}{unit}/A", constant.value));
        Err(DataError::request(
            format!("{}: {what}", file.display()),
            format!("no {name} in amperes"),
            Setting::Columns.suggested(pair.to_string()),
        ))
    }

    /// Returns the column with a name.
    pub fn find(&self, wanted: &str) -> Option<CellReader> {
        self.columns().find(|(_, name)| *name == wanted).map(|(reading, _)| reading)
    }

    /// Returns true if `--columns` maps this contract name.
    pub fn is_mapped(&self, wanted: &str) -> bool {
        self.mapped.iter().any(|mapped| mapped.name == wanted)
    }

    /// Returns true if `--columns` states that the time column holds the steps between the rows.
    pub fn is_time_in_steps(&self) -> bool {
        self.mapped.iter().any(|mapped| mapped.is_step)
    }

    /// Returns the unit that `--columns` gives for this contract name.
    pub fn unit(&self, wanted: &str) -> Option<&'a str> {
        self.mapped.iter().find(|mapped| mapped.name == wanted)?.unit
    }

    /// Returns every column with its name, in file order. A column with two given names occurs twice. A column whose
    /// name was given to another does not occur.
    pub fn columns(&self) -> impl Iterator<Item = (CellReader, &'a str)> {
        self.names.iter().enumerate().flat_map(|(index, header)| {
            let given = self.mapped.iter().filter(move |mapped| mapped.reading.index == index);
            let is_used_up = given.clone().next().is_some() || self.is_mapped(header);
            let unmapped = (!is_used_up).then_some((CellReader::plain(index), header.as_str()));
            given.map(move |mapped| (mapped.reading, mapped.name)).chain(unmapped)
        })
    }

    /// Returns the columns whose name was given to another column.
    pub fn replaced(&self) -> Vec<LeftOutColumn> {
        let mut replaced = Vec::new();
        for &Mapped { name: contract_name, reading, .. } in &self.mapped {
            let place = self.names.iter().position(|name| name == contract_name);
            let is_read = |at: &usize| self.mapped.iter().any(|of| of.reading.index == *at);
            if let Some(at) = place.filter(|at| !is_read(at)) {
                let from = &self.names[reading.index];
                let why = format!("--columns reads {contract_name} from {from}");
                replaced.push(LeftOutColumn { name: self.names[at].clone(), why });
            }
        }
        replaced
    }
}

/// Rejects a header with duplicate names, and one of numbers if no column is mapped.
fn check_names(file: &Path, names: &[String], is_unmapped: bool) -> Result<(), DataError> {
    if is_unmapped && !names.is_empty() && names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let expected = "the columns' names (time_s, velocity_rad_s, torque_nm ..)";
        return Err(at_header(file, &names[0], "numbers", expected));
    }
    if let Some(date) = names.iter().find(|name| is_date(name.as_bytes())) {
        let expected =
            "a table with the columns' names in its first row, not messages or rows alone";
        return Err(at_header(file, date, "a date or time", expected));
    }
    let mut sorted: Vec<(&str, usize)> =
        names.iter().enumerate().map(|(at, name)| (name.as_str(), at + 1)).collect();
    sorted.sort_unstable();
    for pair in sorted.windows(2) {
        let ((name, first), (next, second)) = (pair[0], pair[1]);
        if name == next && !name.is_empty() {
            let found = format!("the name twice (columns {first} and {second})");
            return Err(at_header(file, name, &found, "each name once"));
        }
    }
    Ok(())
}

/// Stands for a unit that the user must know, in a suggestion.
pub(super) const UNKNOWN_UNIT: &str = "UNIT";

/// Resolves the pairs of `--columns` in the file.
fn mapped_columns<'a>(
    file: &Path,
    names: &[String],
    mapping: &'a [(String, String)],
    options: &ReadOptions,
) -> Result<Vec<Mapped<'a>>, DataError> {
    let mut mapped: Vec<Mapped> = Vec::new();
    for (name, foreign) in mapping {
        let what = || Setting::Columns.given(format!("{name}={foreign}"));
        let refuse =
            |found: String, expected: String| Err(DataError::request(what(), found, expected));
        let in_file = |found: String, expected: String| {
            let what = format!("{}: {}", file.display(), what());
            Err(DataError::request(what, found, expected))
        };
        if !contract::names().any(|known| known == name) {
            let known: Vec<&str> = contract::names().collect();
            return refuse(format!("the name {name}"), format!("one of {}", listed(&known)));
        }
        if mapped.iter().any(|earlier| earlier.name == name) {
            return refuse(format!("{name} twice"), "each contract name once".into());
        }
        let (column, is_step) = match foreign.rsplit_once(':') {
            Some((head, STEP_MARK)) if name == TIME && !names.contains(foreign) => (head, true),
            _ => (foreign.as_str(), false),
        };
        let Some(ForeignColumn { reading, unit }) = find_foreign(names, column) else {
            let column = without_unit(column);
            let expected = format!("one of {}", listed(names));
            return in_file(format!("no column {column}"), expected);
        };
        let is_same = |of: &&Mapped| {
            (of.reading.index, of.reading.element) == (reading.index, reading.element)
        };
        if let Some(earlier) = mapped.iter().find(is_same)
            && unit::has_unit(name)
            && unit::has_unit(earlier.name)
        {
            let found = format!("the column of {}", earlier.name);
            return in_file(found, "a column for each quantity".into());
        }
        let pair = Pair { name, foreign: column, unit, header: &names[reading.index] };
        let conversion = match pair.conversion(options) {
            Ok(conversion) => conversion,
            Err(WrongUnit { refusal: Refusal { found, expected }, is_of_file }) => {
                return if is_of_file { in_file(found, expected) } else { refuse(found, expected) };
            }
        };
        let is_current = pair.symbol().is_some_and(|unit| torque_scale::amperes(unit).is_some());
        let reading = CellReader { conversion, ..reading };
        mapped.push(Mapped { name, reading, unit, is_current, is_step });
    }
    Ok(mapped)
}

/// A pair of `--columns` with its unit.
struct Pair<'a> {
    /// The name of the contract.
    name: &'a str,
    /// The column and its unit, as given.
    foreign: &'a str,
    /// The unit, as given.
    unit: Option<&'a str>,
    /// The column's name in the file.
    header: &'a str,
}

/// Why a unit of `--columns` is refused.
struct WrongUnit {
    refusal: Refusal,
    /// True if the column's name states another unit; false if the unit suits no column of this quantity.
    is_of_file: bool,
}

impl Pair<'_> {
    /// Returns the unit: as given, or that of a name in percent or amperes.
    fn symbol(&self) -> Option<&str> {
        self.unit.or_else(|| other_unit(self.header)?.symbol())
    }

    /// Returns the column without its unit.
    fn column(&self) -> &str {
        match self.unit {
            Some(unit) => self.foreign.trim_end_matches(unit).trim_end().trim_end_matches(':'),
            None => self.foreign,
        }
    }

    /// Returns the conversion to the contract's unit; `None` if the column is in it.
    fn conversion(&self, options: &ReadOptions) -> Result<Option<Conversion>, WrongUnit> {
        let Self { name, header, .. } = *self;
        let scaled = self.symbol().and_then(|unit| torque_scale::scaled(name, unit, options));
        if scaled.is_some() {
            return Ok(scaled);
        }
        let wrong_unit = |other: OtherUnit| {
            let refusal = other.refusal(name, self.column());
            WrongUnit { refusal, is_of_file: true }
        };
        match self.unit {
            Some(unit) => conversion(name, unit).map(Some).map_err(|expected| {
                if let Some(other) = other_unit(header).filter(|_| unit == UNKNOWN_UNIT) {
                    return wrong_unit(other);
                }
                let expected = torque_scale::expected(name, self.column(), unit)
                    .or_else(|| torque_scale::expected_lever(name, self.column(), unit))
                    .unwrap_or_else(|| expected.to_string());
                let refusal = Refusal { found: format!("the unit {unit}"), expected };
                WrongUnit { refusal, is_of_file: false }
            }),
            // ROS always stamps its plain-text logs in nanoseconds.
            None if header == "%time" => Ok(conversion(name, "ns").ok()),
            None if header == name || !unit::has_unit(name) => Ok(None),
            None => {
                if let Some(unit) = unit::in_name(name, header) {
                    let pair = shell_word(&format!("{name}={}:{unit}", self.foreign));
                    let refusal = Refusal {
                        found: format!("a name that ends in {unit}, without a unit"),
                        expected: format!("{pair}, or the unit of the column"),
                    };
                    return Err(WrongUnit { refusal, is_of_file: true });
                }
                other_unit(header).map_or(Ok(None), |other| Err(wrong_unit(other)))
            }
        }
    }
}

/// A file name of `--columns` with its parts resolved.
struct ForeignColumn<'a> {
    /// The column and the element of its lists, without a conversion.
    reading: CellReader,
    unit: Option<&'a str>,
}

/// Resolves a name of `--columns`: as a whole first, then without the unit, then without the element, then without
/// both. A number that is no name is the number of the column, from 1.
fn find_foreign<'a>(names: &[String], foreign: &'a str) -> Option<ForeignColumn<'a>> {
    let by_number = |wanted: &str| {
        let number = wanted.parse::<usize>().ok()?.checked_sub(1)?;
        (number < names.len()).then_some(number)
    };
    let find =
        |wanted: &str| names.iter().position(|name| name == wanted).or_else(|| by_number(wanted));
    let either = |text: &str| {
        let element = || {
            let (head, number) = text.strip_suffix(']')?.rsplit_once('[')?;
            let element = Some(number.trim().parse().ok()?);
            Some(CellReader { element, ..CellReader::plain(find(head)?) })
        };
        find(text).map(CellReader::plain).or_else(element)
    };
    if let Some(reading) = either(foreign) {
        return Some(ForeignColumn { reading, unit: None });
    }
    let (head, unit) = foreign.rsplit_once(':')?;
    Some(ForeignColumn { reading: either(head.trim_end())?, unit: Some(unit.trim()) })
}

/// Returns a name that no column has, without its probable unit.
fn without_unit(foreign: &str) -> &str {
    let split = foreign.rsplit_once(':');
    split.filter(|(_, symbol)| unit::is_symbol(symbol)).map_or(foreign, |(head, _)| head)
}
