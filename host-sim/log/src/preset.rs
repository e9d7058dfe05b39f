//! Presets: names and units of the columns that known tools write.
//!
//! A preset supplies the pairs of `--columns` for the contract names that the user did not map. It takes a column only
//! if its name determines the joint: with two candidates the user is asked. A unit that the log does not state (a
//! current, a drive's own velocity unit) is asked for as well. The pairs that were used become a note.

pub(super) mod kind;
mod table;

use std::collections::BTreeSet;
use std::path::Path;

use super::column_names::ColumnNames;
use super::column_pair::ColumnPair;
use super::contract::TIME;
use super::error::{DataError, listed};
use super::options::ReadOptions;
use super::torque_scale;
use super::unit;
use crate::setting::{Setting, shell_word};
pub use kind::Preset;
use table::{PresetUnit, Rule};

/// The pairs of `--columns` that a preset supplies.
pub(super) struct PresetColumns {
    pub pairs: Vec<ColumnPair>,
    /// What was assumed, for the report.
    pub note: Option<String>,
}

/// A column of the file that may hold a quantity.
#[derive(Debug, Clone)]
struct Candidate {
    index: usize,
    /// The words of its name without those of the pattern: they name the joint.
    joint: String,
    unit: PresetUnit,
}

impl Preset {
    /// Returns the preset whose logs have such columns.
    pub(super) fn recognise(names: &ColumnNames) -> Option<Self> {
        if names.is_twincat_scope {
            return Some(Self::TwinCatScope);
        }
        let has = |preset: &Self| preset.marks().iter().any(|marks| has_all(marks, &names.names));
        Self::ALL.into_iter().find(has)
    }

    /// Returns the pairs of `--columns` for the contract names that `options` does not map.
    ///
    /// # Errors
    /// If a required column is missing, if there are several, or if its unit is not known.
    pub(super) fn columns(
        self,
        file: &Path,
        names: &ColumnNames,
        options: &ReadOptions,
    ) -> Result<PresetColumns, DataError> {
        let search = Search { preset: self, file, names, options };
        let joint = search.joint()?;
        let (mut pairs, mut unknown) = (Vec::new(), Vec::new());
        for rule in self.rules() {
            let is_counted = rule.column == TIME && options.rate_hz.is_some();
            if is_counted || search.is_mapped(rule) || search.is_named_by_contract(rule) {
                continue;
            }
            let found = search.candidates(rule);
            let of_joint = |candidate: &&Candidate| {
                !rule.is_of_joint || joint.as_ref().is_none_or(|joint| *joint == candidate.joint)
            };
            let mut fitting = found.iter().filter(of_joint);
            match (fitting.next(), fitting.next()) {
                (Some(candidate), None) => match search.pair(rule, candidate) {
                    Ok(pair) => pairs.push(pair),
                    Err(error) if rule.is_required => return Err(error),
                    Err(_) => unknown.push(format!(
                        "{} is not read: its unit is not in the log; --columns {}",
                        names.names[candidate.index],
                        shell_word(&format!(
                            "{}={}:UNIT",
                            rule.column, names.names[candidate.index]
                        ))
                    )),
                },
                (None, _) if rule.is_required => return Err(search.none(rule)),
                (Some(_), Some(_)) if rule.is_required => {
                    return Err(search.several(rule, &found, None, &[]));
                }
                _ => {}
            }
        }
        let read = |pair: &ColumnPair| format!("{} from {}", pair.quantity, pair.column_in_unit());
        let read: Vec<String> = pairs.iter().map(read).collect();
        let mut notes = Vec::new();
        if !read.is_empty() {
            notes.push(format!("--from {} reads {}", self.name(), read.join(", ")));
        }
        notes.extend(unknown);
        let note = (!notes.is_empty()).then(|| format!("{}: {}", file.display(), notes.join("; ")));
        Ok(PresetColumns { pairs, note })
    }
}

/// Returns true if each mark is in the words of a name.
fn has_all(marks: &[&str], names: &[String]) -> bool {
    marks.iter().all(|mark| {
        names.iter().any(|name| match mark.strip_prefix('=') {
            Some(exact) => name == exact,
            None => format!(" {} ", words(name).join(" ")).contains(&format!(" {mark} ")),
        })
    })
}

/// Returns the words of a name in lower case, without a unit in brackets.
fn words(name: &str) -> Vec<String> {
    let bare = match name.trim_end().strip_suffix([']', ')']) {
        Some(inside) => match inside.rfind(['[', '(']) {
            Some(at) if unit::is_symbol(&inside[at + 1..]) => &inside[..at],
            _ => name,
        },
        None => name,
    };
    let parts = bare.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty());
    parts.map(str::to_lowercase).collect()
}

/// Returns the words of a name that a name of a preset does not cover, if it ends in that. Numbers may follow.
fn remainder(of_preset: &str, name: &str) -> Option<String> {
    if let Some(exact) = of_preset.strip_prefix('=') {
        return name.eq_ignore_ascii_case(exact).then(String::new);
    }
    let mut words = words(name);
    let wanted: Vec<&str> = of_preset.split(' ').collect();
    let is_number = |word: &String| word.bytes().all(|byte| byte.is_ascii_digit());
    let numbers = words.iter().rev().take_while(|word| is_number(word)).count();
    let end = words.len() - numbers;
    let start = end.checked_sub(wanted.len())?;
    if words[start..end].iter().zip(&wanted).any(|(word, wanted)| word != wanted) {
        return None;
    }
    words.drain(start..end);
    Some(words.join(" "))
}

/// The search for a preset's columns in a file.
struct Search<'a> {
    preset: Preset,
    file: &'a Path,
    names: &'a ColumnNames,
    options: &'a ReadOptions,
}

impl Search<'_> {
    fn name(&self, candidate: &Candidate) -> &str {
        &self.names.names[candidate.index]
    }

    /// Returns true if `--columns` maps the rule's quantity, in either joint kind.
    fn is_mapped(&self, rule: &Rule) -> bool {
        self.options.columns.iter().any(|(ours, _)| rule.covers(ours))
    }

    /// Returns true if the file has a column with a contract name of the quantity.
    fn is_named_by_contract(&self, rule: &Rule) -> bool {
        self.names.names.iter().any(|name| rule.covers(name))
    }

    /// Returns the columns that match a rule: those of the first pattern with a unit that is known, else those of the
    /// first pattern that matches.
    fn candidates(&self, rule: &Rule) -> Vec<Candidate> {
        let of = |(of_preset, unit): (&str, PresetUnit)| -> Vec<Candidate> {
            let names = self.names.names.iter().enumerate();
            let matching = names.filter_map(|(index, name)| {
                let joint = remainder(of_preset, name)?;
                let is_other = self.options.columns.iter().any(|(_, theirs)| {
                    theirs == name || theirs.rsplit_once(':').is_some_and(|(head, _)| head == name)
                });
                (!is_other).then_some(Candidate { index, joint, unit })
            });
            matching.collect()
        };
        let all: Vec<Vec<Candidate>> =
            rule.names().map(of).filter(|found| !found.is_empty()).collect();
        let is_known = |found: &&Vec<Candidate>| self.unit(rule, &found[0]).is_ok();
        all.iter().find(is_known).or(all.first()).cloned().unwrap_or_default()
    }

    /// Returns the words that name the joint, if there are several candidates; `None` if no choice is necessary.
    fn joint(&self) -> Result<Option<String>, DataError> {
        let rules: Vec<&Rule> =
            self.preset.rules().iter().filter(|rule| rule.is_of_joint).collect();
        let found: Vec<(&Rule, Vec<Candidate>)> = rules
            .into_iter()
            .filter(|rule| !self.is_mapped(rule) && !self.is_named_by_contract(rule))
            .map(|rule| (rule, self.candidates(rule)))
            .filter(|(rule, found)| rule.is_required && !found.is_empty())
            .collect();
        let joints = |found: &[Candidate]| -> BTreeSet<String> {
            found.iter().map(|candidate| candidate.joint.clone()).collect()
        };
        let Some((rule, most)) = found.iter().rev().max_by_key(|(_, found)| found.len()) else {
            return Ok(None);
        };
        if most.len() == 1 {
            // Their names may differ in words of their own, such as the sensor's.
            return Ok(None);
        }
        let shared = found.iter().map(|(_, found)| joints(found));
        let shared =
            shared.reduce(|a, b| a.intersection(&b).cloned().collect()).unwrap_or_default();
        let mapped_joint = self.mapped_joint().filter(|joint| shared.contains(joint));
        match (mapped_joint, shared.len()) {
            (Some(joint), _) => Ok(Some(joint)),
            (None, 1) => Ok(shared.into_iter().next()),
            _ => Err(self.several(rule, most, shared.iter().next(), &found)),
        }
    }

    /// Returns the joint of a column that `--columns` maps.
    fn mapped_joint(&self) -> Option<String> {
        let rules = self.preset.rules().iter().filter(|rule| rule.is_of_joint);
        rules.flat_map(|rule| rule.names().map(move |(of_preset, _)| (rule, of_preset))).find_map(
            |(rule, of_preset)| {
                let (_, theirs) =
                    self.options.columns.iter().find(|(ours, _)| rule.covers(ours))?;
                let head = theirs.rsplit_once(':').map(|(head, _)| head);
                head.into_iter().chain([&**theirs]).find_map(|name| remainder(of_preset, name))
            },
        )
    }

    /// Returns the unit of a column: that in its name, that in the file, or that of the preset.
    fn unit(&self, rule: &Rule, candidate: &Candidate) -> Result<Option<String>, DataError> {
        let name = self.name(candidate);
        let column = rule.column;
        if let Some(unit) = unit::stated(column, name) {
            return Ok(Some(unit.into()));
        }
        let below = self.names.units.get(candidate.index).cloned().unwrap_or_default();
        if !below.is_empty() && rule.in_kind(&below).is_some() {
            return Ok(Some(below));
        }
        match (candidate.unit, self.options.rated_torque_nm) {
            (PresetUnit::Si, _) => Ok(None),
            (PresetUnit::Fixed(unit), _) => Ok(Some(unit.into())),
            (PresetUnit::Rated(percent), Some(rated_nm)) => {
                Ok(Some(format!("{}Nm", percent * rated_nm / 100.0)))
            }
            (PresetUnit::Rated(percent), None) => Err(self.request(
                format!("{column} in {name}, in {percent} % of a torque that is not in the log"),
                format!(
                    "{}, such as {}",
                    Setting::RatedTorque.alone(),
                    Setting::RatedTorque.suggested("1.2Nm")
                ),
            )),
            (PresetUnit::Current, _) if self.options.torque_constant.is_some() => {
                Ok(Some("A".into()))
            }
            (PresetUnit::Current, _) => Err(self.request(
                format!("{column} in {name}, in amperes"),
                torque_scale::expected_constant(column, name, "A"),
            )),
            (PresetUnit::Unknown(example), _) => Err(self.request(
                format!("{column} in {name}, whose unit is not in the log"),
                format!(
                    "{}, with UNIT such as {example}",
                    Setting::Columns.suggested(format!("{column}={name}:UNIT"))
                ),
            )),
        }
    }

    /// Returns the pair of `--columns` for a column.
    fn pair(&self, rule: &Rule, candidate: &Candidate) -> Result<ColumnPair, DataError> {
        let unit = self.unit(rule, candidate)?;
        let name = self.name(candidate);
        let column = unit.as_deref().and_then(|unit| rule.in_kind(unit)).unwrap_or(rule.column);
        Ok(ColumnPair::new(column, name, unit.as_deref()))
    }

    fn request(&self, found: String, expected: String) -> DataError {
        let preset = Setting::Preset.given(self.preset.name());
        let what = format!("{}: {preset}", self.file.display());
        DataError::request(what, found, expected)
    }

    fn none(&self, rule: &Rule) -> DataError {
        let example = rule.names().next().map_or("", |(name, _)| name.trim_start_matches('='));
        self.request(
            format!("no column for {}, such as \"{example}\"", rule.column),
            format!(
                "{}, or another preset",
                Setting::Columns.suggested(format!("{}=NAME", rule.column))
            ),
        )
    }

    /// Asks for one of several candidates, with the pairs to type for the first joint.
    fn several(
        &self,
        rule: &Rule,
        candidates: &[Candidate],
        joint: Option<&String>,
        found: &[(&Rule, Vec<Candidate>)],
    ) -> DataError {
        let names: Vec<&str> = candidates.iter().map(|candidate| self.name(candidate)).collect();
        let pair = |(rule, found): &(&Rule, Vec<Candidate>)| {
            let of_joint = found.iter().find(|of| Some(&of.joint) == joint).unwrap_or(&found[0]);
            match self.pair(rule, of_joint) {
                Ok(pair) => pair.to_string(),
                Err(_) => format!("{}={}:UNIT", rule.column, self.name(of_joint)),
            }
        };
        let alone = [(rule, candidates.to_vec())];
        let found = if found.is_empty() { &alone } else { found };
        let pairs: Vec<String> = found.iter().map(pair).collect();
        self.request(
            format!("{} columns for {} ({})", names.len(), rule.column, listed(&names)),
            format!("one: {}", Setting::Columns.suggested(pairs.join(","))),
        )
    }
}

#[cfg(test)]
mod tests;
