//! The same results on a terminal.

use super::ranking::{gain, left_out_in_words, ranking};
use comfy_table::{CellAlignment, Table, presets};
use friction_identification::data::Dataset;
use friction_identification::diagnose::Diagnosis;
use friction_identification::fit::{Outcome, State};
use friction_identification::number::{figure, significant};
use friction_identification::params::{unit, unit_in_words};

/// How many candidates are told where nothing was found.
const CLOSEST: usize = 3;

fn table(header: &[&str], numbers_from: usize) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    for (index, column) in table.column_iter_mut().enumerate() {
        // With a space on either side the table of models is 84 columns wide.
        column.set_padding((0, u16::from(index + 1 < header.len())));
        if index >= numbers_from {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// The table without lines between its rows, of which a screen then holds twice as many.
fn printed(table: &Table) -> String {
    let text = table.to_string();
    let is_rule = |line: &&str| !line.is_empty() && line.chars().all(|letter| letter == '─');
    text.lines().filter(|line| !is_rule(line)).collect::<Vec<_>>().join("\n")
}

/// One row a model, best on the held-out rows first; 80 columns hold it.
pub fn models(fits: &[Outcome], data: &Dataset) -> String {
    let torque = data.joint.torque_unit();
    let (test, train) = (format!("held out, {torque}"), format!("fitted, {torque}"));
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

/// One row a parameter.
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
            None if estimate.state == State::AtStart => ("-".to_owned(), "kept"),
            None => ("-".to_owned(), estimate.state.name()),
        };
        table.add_row(vec![
            estimate.id.name().to_owned(),
            figure(estimate.value),
            error,
            unit_in_words(unit(estimate.id.info(), data.joint)).to_owned(),
            state.to_owned(),
        ]);
    }
    printed(&table)
}

/// Each finding, the strongest first; where there is none, the candidates that came closest.
pub fn findings(found: &Diagnosis) -> String {
    let mut text = String::new();
    for finding in &found.findings {
        let follows = match finding.columns.join(", ") {
            none if none.is_empty() => none,
            columns => format!(" ({columns})"),
        };
        text += &format!("{}{follows}: {}\n", finding.cause.name(), finding.size.in_words());
        text += &format!(
            "  takes {} % of the squared error, seen in {} % of resampled logs, p = {}\n",
            significant(100.0 * finding.share_of_residual, 3),
            significant(100.0 * finding.stability, 3),
            significant(finding.p_value, 1),
        );
        let rivals: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        if !rivals.is_empty() {
            text += &format!("  not told apart from {}\n", rivals.join(", "));
        }
    }
    if found.findings.is_empty() {
        text += "Who came closest, % of the squared error on rows left out of the fit:\n";
        for ranked in ranking(found).iter().take(CLOSEST) {
            text += &format!("- {}: {}; {}\n", ranked.name, gain(ranked.score), ranked.against);
        }
    }
    text + left_out_in_words(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_models_fit_into_80_columns() {
        let header = ["model", "held out, Nm", "of std", "relative", "fitted, Nm", "BIC", "time"];
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
