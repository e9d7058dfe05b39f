//! What the columns are called, after `--columns` has had its say.
//!
//! A pair `torque_nm=tau_3` does two things: the column `tau_3` now answers to `torque_nm`, and a
//! column that called itself `torque_nm` no longer does. Both together let a user read a file
//! whose names are foreign as well as one whose names are misleading, and swap two columns.
//! Behind the foreign name a unit may stand (`dq_3:deg/s`) and before it the element of a list (`velocity[2]`);
//! a column whose own name holds a colon or brackets is found first.

use std::path::Path;

use super::contract;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header, listed};
use super::guess;
use super::reading::Reading;
use super::unit::{self, conversion};

/// The names of a file's columns, own and given.
pub(super) struct Naming<'a> {
    /// As they are in the file.
    names: &'a [String],
    /// As `--columns` gives them.
    mapped: Vec<Mapped<'a>>,
}

/// A pair of `--columns`, found in the file.
struct Mapped<'a> {
    name: &'a str,
    reading: Reading,
    /// The unit as it was given.
    unit: Option<&'a str>,
}

impl<'a> Naming<'a> {
    /// Refuses a header that is none, names that occur twice, and pairs that make no sense.
    pub fn new(
        file: &Path,
        names: &'a [String],
        mapping: &'a [(String, String)],
    ) -> Result<Self, DataError> {
        check_names(file, names)?;
        Ok(Naming { names, mapped: mapped_columns(file, names, mapping)? })
    }

    /// The column that answers to a name.
    pub fn find(&self, wanted: &str) -> Option<Reading> {
        self.columns().find(|(_, name)| *name == wanted).map(|(reading, _)| reading)
    }

    /// Whether `--columns` gives this contract name.
    pub fn is_mapped(&self, wanted: &str) -> bool {
        self.mapped.iter().any(|mapped| mapped.name == wanted)
    }

    /// The unit `--columns` gives with this contract name.
    pub fn unit(&self, wanted: &str) -> Option<&'a str> {
        self.mapped.iter().find(|mapped| mapped.name == wanted)?.unit
    }

    /// Every column with the name it answers to, in file order. A column that was given two names
    /// comes twice, one whose name was given to another not at all.
    pub fn columns(&self) -> impl Iterator<Item = (Reading, &'a str)> {
        self.names.iter().enumerate().flat_map(|(index, own)| {
            let given = self.mapped.iter().filter(move |mapped| mapped.reading.index == index);
            let is_used_up = given.clone().next().is_some() || self.is_mapped(own);
            let own = (!is_used_up).then_some((Reading::plain(index), own.as_str()));
            given.map(move |mapped| (mapped.reading, mapped.name)).chain(own)
        })
    }

    /// Of which columns of the file an optional column may be meant, in other units: words for a reader.
    pub fn hints(&self) -> Vec<String> {
        let own = self.columns().filter(|(reading, name)| self.names[reading.index] == *name);
        own.filter_map(|(_, name)| {
            let (contract_name, unit) = guess::other_unit(name)?;
            let is_there = self.find(contract_name).is_some();
            (!is_there).then(|| {
                format!(
                    "{name} is taken as a column of its own; --columns {contract_name}={name}:{unit} reads it as \
                     {contract_name}"
                )
            })
        })
        .collect()
    }

    /// The columns whose name was given to another.
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

    /// The error for missing columns; `wanted` holds whether each is missing, its names in words, and the one to
    /// be given. Where a column of the file is likely meant, the pair to type is named.
    pub fn missing(&self, file: &Path, wanted: &[(bool, &str, &str)]) -> DataError {
        let missing = || wanted.iter().filter(|(is_missing, ..)| *is_missing);
        let names: Vec<&str> = missing().map(|(_, name, _)| *name).collect();
        let free: Vec<&str> = self.columns().map(|(_, name)| name).collect();
        let pair = |contract_name: &str| match guess::column(contract_name, &free) {
            Some(guess) => format!("{contract_name}={guess}"),
            None => format!("{contract_name}=NAME"),
        };
        let pairs: Vec<String> = missing().map(|(.., of)| pair(of)).collect();
        let (names, pairs) = (names.join(" and "), pairs.join(","));
        DataError::File {
            file: file.into(),
            found: format!("only the columns {}", listed(self.names)),
            expected: format!("{names} in the header, or --columns {pairs}"),
        }
    }
}

/// Refuses a header that cannot be one.
fn check_names(file: &Path, names: &[String]) -> Result<(), DataError> {
    if !names.is_empty() && names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let expected = "the columns' names (time_s, velocity_rad_s, torque_nm ..)";
        return Err(at_header(file, &names[0], "numbers", expected));
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

/// The pairs, found in the file.
fn mapped_columns<'a>(
    file: &Path,
    names: &[String],
    mapping: &'a [(String, String)],
) -> Result<Vec<Mapped<'a>>, DataError> {
    let mut mapped: Vec<Mapped> = Vec::new();
    for (name, foreign) in mapping {
        let what = || format!("--columns {name}={foreign}");
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
        let Some(Source { index, element, unit }) = source(names, foreign) else {
            let column = without_unit(foreign);
            let expected = format!("one of {}", listed(names));
            return in_file(format!("no column {column}"), expected);
        };
        let own = &names[index];
        let conversion = match unit {
            Some(unit) => match conversion(name, unit) {
                Ok(conversion) => Some(conversion),
                Err(expected) => return refuse(format!("the unit {unit}"), expected),
            },
            // ROS stamps its plain-text logs so, always.
            None if own == "%time" => conversion(name, "ns").ok(),
            None => {
                if let Some(unit) = unit::in_name(name, own).filter(|_| own != name) {
                    let found = format!("a name that ends in {unit} and no unit");
                    let expected = format!("{name}={foreign}:{unit}, or the unit it is in");
                    return in_file(found, expected);
                }
                None
            }
        };
        mapped.push(Mapped { name, reading: Reading { index, element, conversion }, unit });
    }
    Ok(mapped)
}

/// What a foreign name of `--columns` means.
struct Source<'a> {
    index: usize,
    element: Option<usize>,
    unit: Option<&'a str>,
}

/// The column, element and unit: as it stands, else with the unit split off, else with the element, else both.
fn source<'a>(names: &[String], foreign: &'a str) -> Option<Source<'a>> {
    let find = |wanted: &str| names.iter().position(|name| name == wanted);
    let either = |text: &str| {
        let element = || {
            let (head, number) = text.strip_suffix(']')?.rsplit_once('[')?;
            Some((find(head)?, Some(number.trim().parse().ok()?)))
        };
        find(text).map(|index| (index, None)).or_else(element)
    };
    if let Some((index, element)) = either(foreign) {
        return Some(Source { index, element, unit: None });
    }
    let (head, unit) = foreign.rsplit_once(':')?;
    let (index, element) = either(head.trim_end())?;
    Some(Source { index, element, unit: Some(unit.trim()) })
}

/// A foreign name that no column has, without what is likely its unit.
fn without_unit(foreign: &str) -> &str {
    let split = foreign.rsplit_once(':');
    split.filter(|(_, symbol)| unit::is_symbol(symbol)).map_or(foreign, |(head, _)| head)
}
