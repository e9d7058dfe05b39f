//! The names of a file's columns after `--columns` is applied.
//!
//! A pair `torque_nm=tau_3` has two effects: the column `tau_3` gets the name `torque_nm`, and a column whose own
//! name is `torque_nm` loses it. With both, a user can read files with other names and files with misleading names,
//! and can swap two columns. The file name may be followed by a unit (`dq_3:deg/s`) and by the element of a list
//! (`velocity[2]`). A column whose own name holds a colon or brackets takes precedence.

use std::path::Path;

use super::cell::CellReader;
use super::clock::is_date;
use super::contract;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header, listed};
use super::guess;
use super::joint_pattern::suggested_map;
use super::other_unit::other_unit;
use super::unit::{self, conversion};
use crate::setting::{Setting, shell_word};

/// The names of a file's columns: those in the file and those given with `--columns`.
pub(super) struct Naming<'a> {
    /// The names in the file.
    names: &'a [String],
    /// The pairs of `--columns`.
    mapped: Vec<Mapped<'a>>,
}

/// A pair of `--columns` with its column in the file.
struct Mapped<'a> {
    name: &'a str,
    reading: CellReader,
    /// The unit as given.
    unit: Option<&'a str>,
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
    ) -> Result<Self, DataError> {
        check_names(file, names)?;
        Ok(Naming { names, mapped: mapped_columns(file, names, mapping)? })
    }

    /// Returns the column with a name.
    pub fn find(&self, wanted: &str) -> Option<CellReader> {
        self.columns().find(|(_, name)| *name == wanted).map(|(reading, _)| reading)
    }

    /// Returns true if `--columns` maps this contract name.
    pub fn is_mapped(&self, wanted: &str) -> bool {
        self.mapped.iter().any(|mapped| mapped.name == wanted)
    }

    /// Returns the unit that `--columns` gives for this contract name.
    pub fn unit(&self, wanted: &str) -> Option<&'a str> {
        self.mapped.iter().find(|mapped| mapped.name == wanted)?.unit
    }

    /// Returns every column with its name, in file order. A column with two given names occurs twice. A column whose
    /// name was given to another does not occur.
    pub fn columns(&self) -> impl Iterator<Item = (CellReader, &'a str)> {
        self.names.iter().enumerate().flat_map(|(index, own)| {
            let given = self.mapped.iter().filter(move |mapped| mapped.reading.index == index);
            let is_used_up = given.clone().next().is_some() || self.is_mapped(own);
            let own = (!is_used_up).then_some((CellReader::plain(index), own.as_str()));
            given.map(move |mapped| (mapped.reading, mapped.name)).chain(own)
        })
    }

    /// Returns a note for each covariate that may be an optional quantity in another unit.
    pub fn hints(&self) -> Vec<String> {
        let own = self.columns().filter(|(reading, name)| self.names[reading.index] == *name);
        own.filter_map(|(_, name)| {
            let (contract_name, unit) = guess::quantity_in_unit(name)?;
            let is_there = self.find(contract_name).is_some();
            (!is_there).then(|| {
                let pair = shell_word(&format!("{contract_name}={name}:{unit}"));
                format!(
                    "{name} is read as a covariate; --columns {pair} reads it as {contract_name}"
                )
            })
        })
        .collect()
    }

    /// Returns the columns whose name was given to another column.
    pub fn replaced(&self) -> Vec<LeftOutColumn> {
        let mut replaced = Vec::new();
        for &Mapped { name: contract_name, reading, .. } in &self.mapped {
            let own = self.names.iter().position(|name| name == contract_name);
            let is_read = |own: &usize| self.mapped.iter().any(|of| of.reading.index == *own);
            if let Some(own) = own.filter(|own| !is_read(own)) {
                let from = &self.names[reading.index];
                let why = format!("--columns reads {contract_name} from {from}");
                replaced.push(LeftOutColumn { name: self.names[own].clone(), why });
            }
        }
        replaced
    }

    /// Returns the error for missing columns. `wanted` holds for each: is it missing, its name in the message, and
    /// its contract name. If a column of the file probably matches, the message suggests the pair.
    pub fn missing(&self, file: &Path, wanted: &[(bool, &str, &str)]) -> DataError {
        let missing = || wanted.iter().filter(|(is_missing, ..)| *is_missing);
        let names: Vec<&str> = missing().map(|(_, name, _)| *name).collect();
        let free: Vec<&str> = self.columns().map(|(_, name)| name).collect();
        let joints = suggested_map(&free).unwrap_or_default();
        let pair = |contract_name: &str| {
            let of_all = joints.pattern(contract_name);
            match of_all.or_else(|| guess::column(contract_name, &free)) {
                Some(guess) => format!("{contract_name}={guess}"),
                None => format!("{contract_name}=NAME"),
            }
        };
        let mut pairs: Vec<String> = missing().map(|(.., of)| pair(of)).collect();
        let position =
            joints.pattern("position_rad").map(|theirs| format!("position_rad={theirs}"));
        pairs.extend(position.filter(|pair| !pairs.contains(pair)));
        let (names, pairs) = (names.join(" and "), Setting::Columns.suggested(pairs.join(",")));
        DataError::MissingColumns {
            file: file.into(),
            found: format!("only the columns {}", listed(self.names)),
            expected: match joints.joints.len() {
                0 => format!("{names} in the header, or {pairs}"),
                count => format!(
                    "{names} in the header, or, for {count} joints ({}), {pairs}",
                    listed(&joints.joints)
                ),
            },
            missing: missing().map(|(.., of)| (*of).to_owned()).collect(),
            count: self.names.len(),
        }
    }
}

/// Rejects a header of numbers, or with duplicate names.
fn check_names(file: &Path, names: &[String]) -> Result<(), DataError> {
    if !names.is_empty() && names.iter().all(|name| name.parse::<f64>().is_ok()) {
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
const UNKNOWN_UNIT: &str = "UNIT";

/// Resolves the pairs of `--columns` in the file.
fn mapped_columns<'a>(
    file: &Path,
    names: &[String],
    mapping: &'a [(String, String)],
) -> Result<Vec<Mapped<'a>>, DataError> {
    let mut mapped: Vec<Mapped> = Vec::new();
    for (name, foreign) in mapping {
        let what = || Setting::Columns.given(format!("{name}={foreign}"));
        let refuse = |found: String, expected: String| {
            Err(DataError::Request { what: what(), found, expected })
        };
        let in_file = |found: String, expected: String| {
            let what = format!("{}: {}", file.display(), what());
            Err(DataError::Request { what, found, expected })
        };
        if !contract::names().any(|known| known == name) {
            let known: Vec<&str> = contract::names().collect();
            return refuse(format!("the name {name}"), format!("one of {}", listed(&known)));
        }
        if mapped.iter().any(|earlier| earlier.name == name) {
            return refuse(format!("{name} twice"), "each contract name once".into());
        }
        let Some(ForeignColumn { index, element, unit }) = find_foreign(names, foreign) else {
            let column = without_unit(foreign);
            let expected = format!("one of {}", listed(names));
            return in_file(format!("no column {column}"), expected);
        };
        let own = &names[index];
        let is_same = |of: &&Mapped| (of.reading.index, of.reading.element) == (index, element);
        if let Some(earlier) = mapped.iter().find(is_same)
            && unit::has_unit(name)
            && unit::has_unit(earlier.name)
        {
            let found = format!("the column of {}", earlier.name);
            return in_file(found, "a column for each quantity".into());
        }
        let conversion = match unit {
            Some(unit) => match conversion(name, unit) {
                Ok(conversion) => Some(conversion),
                Err(expected) => match other_unit(own).filter(|_| unit == UNKNOWN_UNIT) {
                    Some(other) => {
                        let column = foreign.trim_end_matches(unit).trim_end_matches(':');
                        let (found, expected) = other.refusal(name, column);
                        return in_file(found, expected);
                    }
                    None => return refuse(format!("the unit {unit}"), expected),
                },
            },
            // ROS always stamps its plain-text logs in nanoseconds.
            None if own == "%time" => conversion(name, "ns").ok(),
            None => {
                if let Some(unit) = unit::in_name(name, own).filter(|_| own != name) {
                    let found = format!("a name that ends in {unit}, without a unit");
                    let pair = shell_word(&format!("{name}={foreign}:{unit}"));
                    let expected = format!("{pair}, or the unit of the column");
                    return in_file(found, expected);
                }
                if let Some(other) = other_unit(own).filter(|_| own != name && unit::has_unit(name))
                {
                    let (found, expected) = other.refusal(name, foreign);
                    return in_file(found, expected);
                }
                None
            }
        };
        mapped.push(Mapped { name, reading: CellReader { index, element, conversion }, unit });
    }
    Ok(mapped)
}

/// A file name of `--columns` with its parts resolved.
struct ForeignColumn<'a> {
    index: usize,
    element: Option<usize>,
    unit: Option<&'a str>,
}

/// Resolves a name of `--columns`: as a whole first, then without the unit, then without the element, then without
/// both.
fn find_foreign<'a>(names: &[String], foreign: &'a str) -> Option<ForeignColumn<'a>> {
    let find = |wanted: &str| names.iter().position(|name| name == wanted);
    let either = |text: &str| {
        let element = || {
            let (head, number) = text.strip_suffix(']')?.rsplit_once('[')?;
            Some((find(head)?, Some(number.trim().parse().ok()?)))
        };
        find(text).map(|index| (index, None)).or_else(element)
    };
    if let Some((index, element)) = either(foreign) {
        return Some(ForeignColumn { index, element, unit: None });
    }
    let (head, unit) = foreign.rsplit_once(':')?;
    let (index, element) = either(head.trim_end())?;
    Some(ForeignColumn { index, element, unit: Some(unit.trim()) })
}

/// Returns a name that no column has, without its probable unit.
fn without_unit(foreign: &str) -> &str {
    let split = foreign.rsplit_once(':');
    split.filter(|(_, symbol)| unit::is_symbol(symbol)).map_or(foreign, |(head, _)| head)
}
