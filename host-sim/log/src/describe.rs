//! The columns of a file with the quantity that each may hold, for `--columns help` and for the error of a file with many columns.

mod units_by_size;

use super::column_guess::guesses;
use super::column_names::ColumnNames;
use super::column_pair::ColumnPair;
use super::contract::{RUN, TIME};
use super::error::{DataError, listed};
use super::guess::{self, Guess};
use super::header::no_header;
use super::joint_pattern::suggested_map;
use super::naming::UNKNOWN_UNIT;
use super::options::ReadOptions;
use super::other_unit::{OtherUnit, other_unit};
use super::plan::{Purpose, Request};
use super::preset::Preset;
use super::source::{file_size, read_file};
use super::survey::{ColumnSummary, Survey, SurveyedColumn, surveyed_columns};
use super::{torque_constant, unit};
use crate::setting::{Setting, shell_word};
use compensator_core::quantity::{JointKind, Quantity};
use std::path::Path;
use units_by_size::add_units_by_size;

/// Number of columns above which an error names only the likely ones. It is the number that a list shows.
const MANY_COLUMNS: usize = 30;

/// Number of likely columns that an error names for each quantity.
const LIKELY_COLUMNS: usize = 5;

/// The quantities that a log must have, as contract names.
const REQUIRED: [&str; 3] = ["time_s", "velocity_rad_s", "torque_nm"];

/// Describes the columns of a file, with the quantity that each numeric column may hold by its name.
///
/// # Errors
/// If the file cannot be read as a table.
pub fn survey(file: &Path, options: &ReadOptions) -> Result<Survey, DataError> {
    let size = file_size(file)?;
    let request = Request {
        path: file,
        options,
        purpose: Purpose::Survey,
        is_wide: false,
        progress: &|_| {},
    };
    let table = read_file(request, size)?;
    let mut surveyed = surveyed_columns(&table);
    let is_time = |name: &str| guess::quantity(name) == Some("time_s");
    let times = surveyed.iter().filter(|column| is_time(&column.summary.name)).count();
    let mut found: Vec<Option<Guess>> = Vec::new();
    let mut doubts = Vec::new();
    for SurveyedColumn { summary: column, values } in &mut surveyed {
        let is_symbol = times > 1 && column.name == guess::TORQUE_SYMBOL;
        let quantity =
            if is_symbol { Some("torque_nm") } else { named_quantity(column, values, &mut doubts) };
        found.push(guess_of(column, quantity, &mut doubts));
    }
    let is_numbered = table.plan.names.is_numbered;
    if is_numbered {
        let values: Vec<&[f64]> = surveyed.iter().map(|of| of.values.as_slice()).collect();
        found = guesses(&values);
    }
    // In this order: a removed torque is none beside a current, and units by size need one column for each quantity.
    doubts.extend(of_one_kind(&surveyed, &mut found));
    doubts.extend(without_constants(&surveyed, &mut found));
    remove_currents_beside_torque(&surveyed, &mut found);
    doubts.extend(one_of_each(&surveyed, &mut found));
    add_units_by_size(&surveyed, &mut found);
    let mut columns: Vec<ColumnSummary> = surveyed.into_iter().map(|of| of.summary).collect();
    for (column, guess) in columns.iter_mut().zip(&found) {
        let is_other = |guess: &&Guess| guess.quantity != column.name || guess.is_step;
        let Some(guess) = guess.as_ref().filter(is_other) else { continue };
        column.suggestion = Some(guess.pair(&column.name, guess.unit.as_deref()));
        let other = |unit: &Option<&str>| guess.pair(&column.name, *unit);
        column.alternatives = guess.other_units.iter().map(other).collect();
    }
    let preset = Preset::recognise(&table.plan.names);
    let mut notes = if is_numbered { Vec::new() } else { notes(&columns, &found) };
    notes.extend(doubts);
    suggest_joints(&mut columns);
    suggest_preset(file, options, preset, &mut columns);
    let has_units_by_size = found.iter().flatten().any(|guess| guess.is_by_size);
    Ok(Survey { columns, preset, notes, has_units_by_size })
}

/// Returns the quantity that a column may hold by its name and unit. Adds a doubt if they contradict each other.
fn named_quantity(
    column: &ColumnSummary,
    values: &[f64],
    doubts: &mut Vec<String>,
) -> Option<&'static str> {
    let name = &column.name;
    if guess::is_run(name, values) {
        return Some(RUN);
    }
    guess::by_name(name, column.unit.as_deref().unwrap_or_default()).unwrap_or_else(|of| {
        doubts.push(format!("{name}: its words are those of {of}, its unit is not."));
        None
    })
}

/// Returns the guess of a column that may hold a quantity, and sets its unit. Adds a doubt if the case of the unit decides.
fn guess_of(
    column: &mut ColumnSummary,
    quantity: Option<&'static str>,
    doubts: &mut Vec<String>,
) -> Option<Guess> {
    let name = &column.name;
    let is_step = column.is_step && (quantity == Some(TIME) || is_step_name(name));
    let quantity = if is_step { Some(TIME) } else { quantity };
    let stated = quantity.and_then(|of| unit::stated(of, name));
    let of_file = column.unit.take();
    column.unit = stated.or_else(|| guess::any_unit(name)).map(str::to_owned).or(of_file.clone());
    let is_read =
        column.is_numeric() || quantity == Some(TIME) && column.is_date || quantity == Some(RUN);
    let quantity = quantity.filter(|_| is_read)?;
    let fitting = of_file.filter(|unit| unit::conversion(quantity, unit).is_ok());
    let unit = unit::in_name(quantity, name).map(str::to_owned).or(fitting);
    let is_ambiguous = unit.is_none() && unit::is_ambiguous(quantity, name);
    if is_ambiguous {
        doubts.push(format!("{name}: the case of its unit decides, as in mN and MN."));
    }
    let other = other_unit(name).map(OtherUnit::suggestion);
    let other = other.or(is_ambiguous.then_some(UNKNOWN_UNIT)).map(str::to_owned);
    let (unit, is_known) = (unit.or(other), stated.is_some());
    Some(Guess { quantity, unit, is_known, is_step, ..Guess::default() })
}

/// Takes columns without a unit as those of a linear axis, if another column is one of it. Returns a note if the units are those
/// of both kinds of joint.
fn of_one_kind(columns: &[SurveyedColumn], found: &mut [Option<Guess>]) -> Option<String> {
    let is_known = |guess: &&Guess| guess.is_known || guess.quantity == "force_n";
    let known = found.iter().flatten().filter(is_known);
    let kinds: Vec<_> = known.filter_map(|guess| Quantity::parse(guess.quantity)?.1).collect();
    let has = |kind| kinds.contains(&kind);
    if has(JointKind::Revolute) && has(JointKind::Prismatic) {
        return Some(
            "The units are those of a joint and of a linear axis: type those of one.".into(),
        );
    }
    for (guess, column) in found.iter_mut().zip(columns).filter(|_| has(JointKind::Prismatic)) {
        let name = &column.summary.name;
        let open = guess.as_mut().filter(|guess| !guess.is_known && guess.quantity != name);
        open.into_iter().for_each(|guess| guess.quantity = guess::of_both_kinds(guess.quantity)[1]);
    }
    None
}

/// Replaces the suggestions for the columns of several joints by one for all joints.
fn suggest_joints(columns: &mut [ColumnSummary]) {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let Some(joints) = suggested_map(&names) else { return };
    for column in columns.iter_mut().filter(|column| column.is_numeric()) {
        if let Some(pair) = joints.pair_of(&column.name) {
            column.suggestion = Some(pair);
        }
    }
}

/// Removes the guesses for currents beside a measured torque: they are its causes, not other torques.
fn remove_currents_beside_torque(columns: &[SurveyedColumn], found: &mut [Option<Guess>]) {
    let is_torque = |(guess, column): (&Option<Guess>, &SurveyedColumn)| {
        let (Some(guess), name) = (guess, &column.summary.name) else { return false };
        let is_effort = Quantity::parse(guess.quantity).is_some_and(|of| of.0 == Quantity::Torque);
        is_effort && !guess::is_current(name) && guess::score(guess.quantity, name) > 1
    };
    if found.iter().zip(columns).any(is_torque) {
        let pairs = found.iter_mut().zip(columns);
        let currents = pairs.filter(|(_, column)| guess::is_current(&column.summary.name));
        currents.for_each(|(guess, _)| *guess = None);
    }
}

/// Removes the guess for a velocity or torque whose numbers are all equal and not 0: a motor's torque constant is no torque.
/// Returns a note for each.
fn without_constants(columns: &[SurveyedColumn], found: &mut [Option<Guess>]) -> Vec<String> {
    let mut notes = Vec::new();
    for (guess, SurveyedColumn { summary: column, values }) in found.iter_mut().zip(columns) {
        let is_moving = |of: &Guess| {
            let quantity = Quantity::parse(of.quantity).map(|(quantity, _)| quantity);
            matches!(quantity, Some(Quantity::Velocity | Quantity::Torque))
                && of.quantity != column.name
        };
        let mut numbers = values.iter().filter(|value| !value.is_nan());
        let first = numbers.next().copied().unwrap_or_default();
        let is_constant =
            values.len() >= MIN_CONSTANT_ROWS && first != 0.0 && numbers.all(|of| *of == first);
        if let Some(of) = guess.take_if(|guess| is_constant && is_moving(guess)) {
            notes.push(format!(
                "{}: constant, so it is not suggested as {}.",
                column.name, of.quantity
            ));
        }
    }
    notes
}

/// Minimum number of rows for a column to be called constant.
const MIN_CONSTANT_ROWS: usize = 20;

/// Keeps the best guess of each quantity, as `--columns` takes each once. Returns a note for each other column that may hold it.
fn one_of_each(columns: &[SurveyedColumn], found: &mut [Option<Guess>]) -> Vec<String> {
    let names: Vec<&str> = columns.iter().map(|column| column.summary.name.as_str()).collect();
    let mut notes = Vec::new();
    if suggested_map(&names).is_some() {
        return notes;
    }
    let is_target = |of: &str| Quantity::parse(of).is_some_and(|of| of.0 == Quantity::Torque);
    for at in 0..found.len() {
        let Some(guess) = &found[at] else { continue };
        let rank = |at: usize, of: &Guess| {
            let has_unit =
                of.is_known || of.unit.as_deref().is_some_and(|unit| unit != UNKNOWN_UNIT);
            (of.quantity == names[at], guess::score(of.quantity, names[at]), has_unit)
        };
        let rank_here = rank(at, guess);
        let is_same = |of: &Guess| {
            of.quantity == guess.quantity || is_target(of.quantity) && is_target(guess.quantity)
        };
        // Of equal ranks, the first.
        let better = (0..found.len()).find(|other| {
            let is_better = |of: &Guess| {
                let rank = rank(*other, of);
                is_same(of) && (rank > rank_here || rank == rank_here && *other < at)
            };
            *other != at && found[*other].as_ref().is_some_and(is_better)
        });
        if let Some(better) = better {
            let pair = guess.pair(names[at], guess.unit.as_deref());
            let pair = shell_word(&pair.to_string());
            notes.push(format!("In place of {}, {pair} may be the column.", names[better]));
            found[at] = None;
        }
    }
    notes
}

/// Returns what else to type or to check.
fn notes(columns: &[ColumnSummary], found: &[Option<Guess>]) -> Vec<String> {
    let guesses = columns.iter().zip(found).filter_map(|(column, of)| Some((column, of.as_ref()?)));
    let names = |is_it: &dyn Fn(&ColumnSummary, &Guess) -> bool| -> Vec<&str> {
        let those = guesses.clone().filter(|(column, guess)| is_it(column, guess));
        those.map(|(column, _)| column.name.as_str()).collect()
    };
    let by_size = names(&|_, guess| guess.is_by_size);
    let open = names(&|column, guess| {
        let has_unit = guess.is_known || guess.is_by_size || guess.unit.is_some();
        let is_as_named = has_unit || guess.quantity == column.name;
        !is_as_named && !guess.is_step && !column.is_date && unit::has_unit(guess.quantity)
    });
    let current = guesses.clone().find(|(column, _)| guess::is_current(&column.name));
    let by_size = (!by_size.is_empty()).then(|| {
        format!("The units of {} are by the sizes of their values: check them.", listed(&by_size))
    });
    let open = (!open.is_empty()).then(|| {
        format!(
            "No unit is stated of {}: the suggestion takes that of the contract. Type another one after a colon.",
            listed(&open)
        )
    });
    let current = current.map(|(column, _)| {
        let constant = Setting::TorqueConstant.suggested(torque_constant::EXAMPLE);
        format!("{} is a current: add the motor's torque constant, as {constant}.", column.name)
    });
    by_size.into_iter().chain(open).chain(current).collect()
}

/// Words of a column that holds the step between rows.
const STEP_WORDS: [&str; 6] = ["dt", "timestep", "delta", "step", "period", "interval"];

/// Returns true if a name is that of a column of steps.
fn is_step_name(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphabetic());
    words.any(|word| STEP_WORDS.contains(&word))
}

/// Replaces suggestions by those of the preset that the names suggest: it knows the units.
fn suggest_preset(
    file: &Path,
    options: &ReadOptions,
    preset: Option<Preset>,
    columns: &mut [ColumnSummary],
) {
    let names = ColumnNames {
        names: columns.iter().map(|column| column.name.clone()).collect(),
        units: columns.iter().map(|column| column.unit.clone().unwrap_or_default()).collect(),
        is_twincat_scope: preset == Some(Preset::TwinCatScope),
        is_numbered: false,
    };
    let found = preset.and_then(|preset| preset.columns(file, &names, options).ok());
    for pair in found.into_iter().flat_map(|found| found.pairs) {
        if let Some(column) = columns.iter_mut().find(|column| column.name == pair.column) {
            column.suggestion = Some(pair);
        }
    }
}

/// Replaces the list of all columns in an error by the likely ones, if there are many.
pub(super) fn with_likely_columns(error: DataError, options: &ReadOptions) -> DataError {
    let DataError::MissingColumns { file, mut found, mut expected, pairs, missing, count } = error
    else {
        return error;
    };
    if missing.is_empty() {
        let columns = survey(&file, options).map(|found| found.columns).unwrap_or_default();
        let sets = pair_sets(&columns);
        return match sets.iter().all(String::is_empty) {
            true => DataError::MissingColumns { file, found, expected, pairs, missing, count },
            false => no_header(&file, &sets, count),
        };
    }
    if count <= MANY_COLUMNS {
        expected += &pairs_by_size(&file, options);
    } else if let Ok(Survey { columns, .. }) = survey(&file, options) {
        let likely: Vec<&str> = REQUIRED
            .iter()
            .filter(|wanted| missing.iter().any(|of| guess::is_same_quantity(of, wanted)))
            .flat_map(|wanted| likely(wanted, &columns))
            .collect();
        found = match likely.is_empty() {
            true => format!("{count} columns and none with a usual name"),
            false => format!("{count} columns, likely {}", listed(&likely)),
        };
        expected += &format!("; {} lists all", Setting::Columns.given("help"));
    }
    DataError::MissingColumns { file, found, expected, pairs, missing, count }
}

/// Returns the pairs whose units are by the sizes of the values, as the end of what an error expects; else an empty text.
fn pairs_by_size(file: &Path, options: &ReadOptions) -> String {
    let Ok(Survey { columns, has_units_by_size: true, .. }) = survey(file, options) else {
        return String::new();
    };
    let sets = pair_sets(&columns);
    // A name that cannot be typed does not help.
    if sets.iter().any(|pairs| pairs.contains(char::is_control)) {
        return String::new();
    }
    let sets: Vec<String> =
        sets.into_iter().map(|pairs| Setting::Columns.suggested(pairs)).collect();
    format!("; by the sizes of the values, {}", sets.join(" or "))
}

/// Returns the pairs of all columns as one value of `--columns`: the suggestions, and the alternatives in their order.
fn pair_sets(columns: &[ColumnSummary]) -> Vec<String> {
    let count = columns.iter().map(|column| column.alternatives.len()).max().unwrap_or_default();
    let set = |place: usize| {
        let other = |column: &ColumnSummary| {
            let last = column.alternatives.len().min(place);
            let other = last.checked_sub(1).map(|at| &column.alternatives[at]);
            other.or(column.suggestion.as_ref()).map(ColumnPair::to_string)
        };
        let pairs: Vec<String> = columns.iter().filter_map(other).collect();
        pairs.join(",")
    };
    (0..=count).map(set).collect()
}

/// Returns the names of the numeric columns that probably hold a quantity, the most probable first.
fn likely<'a>(contract_name: &str, columns: &'a [ColumnSummary]) -> Vec<&'a str> {
    let scored = columns.iter().filter(|column| column.is_numeric());
    let scored = scored.map(|column| (guess::score(contract_name, &column.name), &*column.name));
    let mut scored: Vec<(u32, &str)> = scored.filter(|(score, _)| *score > 0).collect();
    scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    scored.into_iter().take(LIKELY_COLUMNS).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn likely_with_many_columns_prefers_measured_numbers() {
        let column = |name: &str, numbers| ColumnSummary {
            name: name.into(),
            numbers,
            texts: 10,
            ..ColumnSummary::default()
        };
        let columns = [
            column("/arm/cmd/velocity_des", 100),
            column("/arm/state/velocity", 100),
            column("/arm/state/velocity_mode", 0),
            column("/camera/exposure", 100),
            column("/drive/ActVelo", 100),
        ];
        let expected = ["/arm/state/velocity", "/drive/ActVelo", "/arm/cmd/velocity_des"];
        assert_eq!(likely("velocity_rad_s", &columns), expected);
    }

    #[test]
    fn describe_with_current_beside_what_is_no_measured_torque_suggests_the_current() {
        let folder = std::env::temp_dir().join(format!("current-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for (name, value) in
            [("torque constant", "0.105"), ("torque_mode", "on"), ("torque_cmd", "0.3")]
        {
            let row = |at: i32| format!("{},{at},1,{},{value}\n", f64::from(at) * 0.01, at % 7);
            let rows: String = (0..40).map(row).collect();
            let file = folder.join("log.csv");
            std::fs::write(&file, format!("time_s,angle,speed,i_q,{name}\n{rows}")).unwrap();
            let found = survey(&file, &ReadOptions::default()).unwrap();
            let current = found.columns.iter().find(|column| column.name == "i_q").unwrap();
            let pair = current.suggestion.as_ref().map(ColumnPair::to_string);
            assert_eq!(pair.as_deref(), Some("torque_nm=i_q:A"), "{name}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
