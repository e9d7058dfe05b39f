//! What the columns are called, after `--columns` has had its say.
//!
//! A pair `torque_nm=tau_3` does two things: the column `tau_3` now answers to `torque_nm`, and a
//! column that called itself `torque_nm` no longer does. Both together let a user read a file
//! whose names are foreign as well as one whose names are misleading, and swap two columns.

use std::path::Path;

use super::contract;
use super::dataset::LeftOutColumn;
use super::error::{DataError, at_header, listed};

/// The names of a file's columns, own and given.
pub(super) struct Naming<'a> {
    /// As they are in the file.
    names: &'a [String],
    /// (contract name, column), as `--columns` gives them.
    mapped: Vec<(&'a str, usize)>,
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
    pub fn find(&self, wanted: &str) -> Option<usize> {
        self.columns().find(|(_, name)| *name == wanted).map(|(index, _)| index)
    }

    /// Whether `--columns` gives this contract name.
    pub fn is_mapped(&self, wanted: &str) -> bool {
        self.mapped.iter().any(|(name, _)| *name == wanted)
    }

    /// Every column with the name it answers to, in file order. A column that was given two names
    /// comes twice, one whose name was given to another not at all.
    pub fn columns(&self) -> impl Iterator<Item = (usize, &'a str)> {
        self.names.iter().enumerate().flat_map(|(index, own)| {
            let given = self.mapped.iter().filter(move |(_, at)| *at == index);
            let is_used_up = given.clone().next().is_some() || self.is_mapped(own);
            let own = (!is_used_up).then_some((index, own.as_str()));
            given.map(move |(name, _)| (index, *name)).chain(own)
        })
    }

    /// The columns whose name was given to another.
    pub fn replaced(&self) -> Vec<LeftOutColumn> {
        let mut replaced = Vec::new();
        for &(contract_name, from) in &self.mapped {
            let own = self.names.iter().position(|name| name == contract_name);
            if let Some(own) = own.filter(|own| self.mapped.iter().all(|(_, at)| at != own)) {
                replaced.push(LeftOutColumn {
                    name: self.names[own].clone(),
                    why: format!("--columns reads {contract_name} from {}", self.names[from]),
                });
            }
        }
        replaced
    }

    /// The error for missing columns; `wanted` holds whether each is missing, its name, and an
    /// example of a pair.
    pub fn missing(&self, file: &Path, wanted: &[(bool, &str, &str)]) -> DataError {
        let missing = || wanted.iter().filter(|(is_missing, ..)| *is_missing);
        let names: Vec<&str> = missing().map(|(_, name, _)| *name).collect();
        let pairs: Vec<&str> = missing().map(|(.., pair)| *pair).collect();
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

/// The pairs as (contract name, column index).
fn mapped_columns<'a>(
    file: &Path,
    names: &[String],
    mapping: &'a [(String, String)],
) -> Result<Vec<(&'a str, usize)>, DataError> {
    let mut mapped: Vec<(&str, usize)> = Vec::new();
    for (name, foreign) in mapping {
        let refuse = |found: String, expected: String| {
            Err(DataError::Request { what: format!("--columns {name}={foreign}"), found, expected })
        };
        if !contract::names().any(|known| known == name) {
            let known: Vec<&str> = contract::names().collect();
            return refuse(format!("the name {name}"), format!("one of {}", listed(&known)));
        }
        if mapped.iter().any(|(earlier, _)| earlier == name) {
            return refuse(format!("{name} twice"), "each contract name once".into());
        }
        let Some(index) = names.iter().position(|column| column == foreign) else {
            let what = format!("{}: --columns {name}={foreign}", file.display());
            let found = format!("no column {foreign}");
            let expected = format!("one of {}", listed(names));
            return Err(DataError::Request { what, found, expected });
        };
        mapped.push((name, index));
    }
    Ok(mapped)
}
