//! The columns of a file with the quantity that each may hold, for `--columns help` and for the error of a file with many columns.

use super::column_names::ColumnNames;
use super::error::{DataError, listed};
use super::joint_pattern::suggested_map;
use super::options::ReadOptions;
use super::other_unit::other_unit;
use super::preset::Preset;
use super::source::{file_size, read_file};
use super::survey::{ColumnSummary, Survey};
use super::{guess, unit};
use crate::setting::{Setting, shell_word};
use std::path::Path;

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
    let options = ReadOptions { is_survey: true, ..options.clone() };
    let mut survey = read_file(file, size, &options, &|_| {})?.survey;
    let is_time = |name: &str| guess::quantity(name) == Some("time_s");
    let times = survey.columns.iter().filter(|column| is_time(&column.name)).count();
    for column in &mut survey.columns {
        let is_torque = times > 1 && column.name == guess::TORQUE_SYMBOL;
        let quantity = if is_torque { Some("torque_nm") } else { guess::quantity(&column.name) };
        let of_file = column.unit.take();
        let stated = quantity
            .and_then(|quantity| unit::stated(quantity, &column.name))
            .or_else(|| guess::any_unit(&column.name));
        column.unit = stated.map(str::to_owned).or(of_file.clone());
        let is_own = quantity == Some(&*column.name);
        if let Some(quantity) = quantity.filter(|_| {
            (column.is_numeric() || quantity == Some("time_s") && column.is_date) && !is_own
        }) {
            let fitting = of_file.filter(|unit| unit::conversion(quantity, unit).is_ok());
            let unit = unit::in_name(quantity, &column.name).map(str::to_owned).or(fitting);
            let other = || other_unit(&column.name).map(|other| other.suggestion().to_owned());
            let unit = unit.or_else(other);
            let unit = unit.map(|unit| format!(":{unit}"));
            let pair = format!("{quantity}={}{}", column.name, unit.unwrap_or_default());
            column.suggestion = Some(shell_word(&pair));
        }
    }
    suggest_joints(&mut survey.columns);
    suggest_preset(file, &options, &mut survey);
    Ok(survey)
}

/// Replaces the suggestions for the columns of several joints by one for all joints.
fn suggest_joints(columns: &mut [ColumnSummary]) {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let Some(joints) = suggested_map(&names) else { return };
    for column in columns.iter_mut().filter(|column| column.is_numeric()) {
        if let Some(pair) = joints.pair_of(&column.name) {
            column.suggestion = Some(shell_word(&pair));
        }
    }
}

/// Replaces suggestions by those of the preset that the names suggest: it knows the units.
fn suggest_preset(file: &Path, options: &ReadOptions, survey: &mut Survey) {
    let Survey { columns, preset } = survey;
    let names = ColumnNames {
        names: columns.iter().map(|column| column.name.clone()).collect(),
        units: columns.iter().map(|column| column.unit.clone().unwrap_or_default()).collect(),
        is_twincat_scope: *preset == Some(Preset::TwinCatScope),
    };
    let found = preset.and_then(|preset| preset.columns(file, &names, options).ok());
    for (ours, theirs) in found.into_iter().flat_map(|found| found.pairs) {
        let is_it = |name: &str| {
            theirs.strip_prefix(name).is_some_and(|unit| unit.is_empty() || unit.starts_with(':'))
        };
        if let Some(column) = columns.iter_mut().find(|column| is_it(&column.name)) {
            column.suggestion = Some(shell_word(&format!("{ours}={theirs}")));
        }
    }
}

/// Replaces the list of all columns in an error by the likely ones, if there are many.
pub(super) fn with_likely_columns(error: DataError, options: &ReadOptions) -> DataError {
    let DataError::MissingColumns { file, mut found, mut expected, missing, count } = error else {
        return error;
    };
    if count > MANY_COLUMNS
        && let Ok(Survey { columns, .. }) = survey(&file, options)
    {
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
    DataError::MissingColumns { file, found, expected, missing, count }
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
}
