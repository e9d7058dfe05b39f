//! Tables and texts of the results for the terminal.

use super::words::text_in_options;
use comfy_table::{CellAlignment, Table, presets};
use friction_diagnose::{Diagnosis, probability_in_words};
use friction_fit::params::{unit, unit_in_words};
use friction_fit::{Outcome, State};
use friction_results::fleet::JointSummary;
use friction_results::ranking::{gain, left_out_in_words, ranking};
use friction_results::scope::SignalSummary;
use joint_log::number::{figure, significant};
use joint_log::setting::shell_word;
use joint_log::{Dataset, Survey};
use std::fmt::Display;
use std::path::Path;

/// Number of candidates that are listed if there is no finding.
const LISTED_CANDIDATES: usize = 3;

fn table(header: &[&str], numbers_from: usize) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    for (index, column) in table.column_iter_mut().enumerate() {
        // No padding on the left: with it, the table of models would be 84 columns wide.
        column.set_padding((0, u16::from(index + 1 < header.len())));
        if index >= numbers_from {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// Returns the table as text without lines between its rows.
fn printed(table: &Table) -> String {
    let text = table.to_string();
    let is_rule = |line: &&str| !line.is_empty() && line.chars().all(|letter| letter == '─');
    text.lines().filter(|line| !is_rule(line)).collect::<Vec<_>>().join("\n")
}

/// Returns a table with one row for each model, best on held-out rows first. It is at most 80 columns wide.
pub fn models(fits: &[Outcome], data: &Dataset) -> String {
    let torque = data.joint.torque_unit();
    let (test, train) = (format!("held out, {torque}"), format!("train, {torque}"));
    let header = ["model", &test, "of std", "relative", &train, "BIC", "time"];
    let mut table = table(&header, 1);
    let mut order: Vec<&Outcome> = fits.iter().collect();
    order.sort_by(|a, b| a.test.rmse.total_cmp(&b.test.rmse));
    for fit in order {
        table.add_row(vec![
            fit.spec.to_string(),
            figure(fit.test.rmse),
            format!("{:.1} %", 100.0 * fit.test.nrmse_std),
            format!("{:.1} %", fit.test.relative_error_percent),
            figure(fit.train.rmse),
            format!("{:.0}", fit.bic),
            format!("{:.1} s", fit.seconds),
        ]);
    }
    printed(&table)
}

/// Returns a table with the statistics of each signal of a scope.
pub fn scope(signals: &[SignalSummary]) -> String {
    let mut table = table(&["signal", "min", "mean", "max", "RMS"], 1);
    for of in signals {
        let mut row = vec![of.signal.clone()];
        row.extend([of.min, of.mean, of.max, of.rms].map(figure));
        table.add_row(row);
    }
    printed(&table)
}

/// Largest number of joints in the table of a fleet.
const LISTED_JOINTS: usize = 40;

/// Returns a table with the size of each joint's cause and its distance from the other joints, empty without a size.
pub fn joints(joints: &[JointSummary]) -> String {
    let header = ["joint", "cause", "size", "minus the others", "times the others"];
    let mut table = table(&header, usize::MAX);
    let sized = joints.iter().filter(|joint| joint.size.is_some());
    for joint in sized.clone().take(LISTED_JOINTS) {
        table.add_row(
            [vec![joint.joint.clone(), joint.cause.clone()], joint.sizes().into()].concat(),
        );
    }
    match sized.count() {
        0 => String::new(),
        count if count > LISTED_JOINTS => {
            format!("{}\n{LISTED_JOINTS} of {count} joints; fleet.html has more\n", printed(&table))
        }
        _ => printed(&table) + "\n",
    }
}

/// Returns the description of a file's columns, with the suggested pairs of `--columns`.
pub fn columns(file: &Path, survey: &Survey) -> String {
    let Survey { columns, preset, notes, .. } = survey;
    let mut table = table(&["column", "values", "unit", "suggestion for --columns"], usize::MAX);
    for column in columns {
        let values = match (column.samples.is_empty(), column.is_numeric()) {
            (true, _) => "none".to_owned(),
            (false, true) => column.samples.join(" "),
            (false, false) => format!("text: {}", column.samples.join(", ")),
        };
        let unit = column.unit.clone().unwrap_or_default();
        let pairs = column.suggestion.iter().chain(&column.alternatives);
        let pairs: Vec<String> = pairs.map(|pair| shell_word(&pair.to_string())).collect();
        let suggestion = pairs.join(" or ");
        table.add_row(vec![column.name.clone(), values, unit, suggestion]);
    }
    let hint = preset.map_or_else(String::new, |preset| {
        format!("\nThis looks like a log of {0}: --from {0} names its columns.\n", preset.name())
    });
    let notes: String = notes.iter().map(|note| format!("\n{}", text_in_options(note))).collect();
    let notes = if notes.is_empty() { notes } else { format!("{notes}\n") };
    format!("{}: {} columns\n\n{}\n{notes}{hint}", file.display(), columns.len(), printed(&table))
}

/// Returns a table with one row for each parameter.
pub fn parameters(fit: &Outcome, data: &Dataset) -> String {
    let mut table = table(&["parameter", "value", "std error", "unit", "state"], 1);
    for column in [3, 4] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Left);
        }
    }
    for estimate in &fit.estimates {
        let (error, state) = match estimate.std_error {
            Some(error) => (figure(error), estimate.state.name()),
            None if estimate.state == State::AtStart => ("-".to_owned(), "kept constant"),
            None => ("-".to_owned(), estimate.state.name()),
        };
        table.add_row(vec![
            estimate.id.name().to_owned(),
            figure(estimate.value),
            error,
            unit_in_words(unit(estimate.id, data.joint)).to_owned(),
            state.to_owned(),
        ]);
    }
    printed(&table)
}

/// Describes each finding, strongest first; without findings, the best candidates and why they were rejected.
pub fn findings(found: &Diagnosis) -> String {
    let mut text = String::new();
    let joint = found.log.train.joint;
    for finding in &found.findings {
        let columns = match finding.columns.join(", ") {
            none if none.is_empty() => none,
            columns => format!(" ({columns})"),
        };
        text += &format!("{}{columns}: {}\n", finding.cause.name(), finding.size_in_words(joint));
        text += &format!(
            "  probability {}, p = {}\n  {}, found in {} % of resampled logs\n",
            probability_in_words(finding.probability),
            significant(finding.p_value, 1),
            finding.share_in_words(),
            significant(100.0 * finding.stability, 3),
        );
        let rivals: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        if !rivals.is_empty() {
            text += &format!("  indistinguishable from {}\n", rivals.join(", "));
        }
    }
    if found.findings.is_empty() && !found.candidates.is_empty() {
        text +=
            "Best candidates, with their gain alone on held-out rows (% of the squared error):\n";
        for ranked in ranking(found).iter().take(LISTED_CANDIDATES) {
            let (name, reason) = (&ranked.name, &ranked.rejected_because);
            let gain = gain(ranked.candidate);
            let probability = probability_in_words(ranked.probability);
            text += &format!(
                "- {name}: {gain} %, probability {probability}; rejected because: {reason}\n"
            );
        }
    }
    text + left_out_in_words(found)
}

/// Returns sentences as numbered lines.
pub fn numbered(sentences: &[impl Display]) -> String {
    let numbered = (1..).zip(sentences);
    numbered.map(|(number, sentence)| format!("{number}. {sentence}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_models_fits_into_80_columns() {
        let header = ["model", "held out, Nm", "of std", "relative", "train, Nm", "BIC", "time"];
        let mut table = table(&header, 1);
        let row = [
            "lugre-asymmetric",
            "0.00012345",
            "158.7 %",
            "158.3 %",
            "0.0001234",
            "-1287856",
            "132.2 s",
        ];
        table.add_row(row);
        let widest = printed(&table).lines().map(|line| line.chars().count()).max();
        assert!((60..=80).contains(&widest.unwrap_or(0)), "{widest:?} columns");
    }
}
