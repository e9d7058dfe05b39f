//! The same results on a terminal.

use super::ranking::{gain, left_out_in_words, ranking};
use comfy_table::{CellAlignment, Table, presets};
use friction_identification::data::Dataset;
use friction_identification::diagnose::Diagnosis;
use friction_identification::fit::Outcome;
use friction_identification::number::figure;
use friction_identification::params::unit;

/// How many candidates are told where nothing was found.
const CLOSEST: usize = 3;

fn table(header: &[&str], numbers_from: usize) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    for (index, column) in table.column_iter_mut().enumerate() {
        if index >= numbers_from {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// One row a model, best on the held-out rows first.
pub fn models(fits: &[Outcome], data: &Dataset) -> String {
    let torque = data.joint.torque_unit();
    let rmse = format!("test RMSE, {torque}");
    let mut table = table(
        &[
            "model",
            &rmse,
            "of std",
            "of range",
            "relative",
            "train RMSE",
            "relative",
            "BIC",
            "time, s",
        ],
        1,
    );
    let mut order: Vec<&Outcome> = fits.iter().collect();
    order.sort_by(|a, b| a.test.rmse.total_cmp(&b.test.rmse));
    for fit in order {
        table.add_row(vec![
            fit.spec.to_string(),
            figure(fit.test.rmse),
            format!("{:.1} %", 100.0 * fit.test.nrmse_std),
            format!("{:.1} %", 100.0 * fit.test.nrmse_range),
            format!("{:.4} %", fit.test.relative_error_percent),
            figure(fit.train.rmse),
            format!("{:.4} %", fit.train.relative_error_percent),
            format!("{:.0}", fit.bic),
            format!("{:.2}", fit.seconds),
        ]);
    }
    table.to_string()
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
            None => ("-".to_owned(), "kept"),
        };
        table.add_row(vec![
            estimate.id.name().to_owned(),
            figure(estimate.value),
            error,
            unit(estimate.id.info(), data.joint).to_owned(),
            state.to_owned(),
        ]);
    }
    table.to_string()
}

/// One row a finding, the strongest first; where there is none, the candidates that came closest.
pub fn findings(found: &Diagnosis) -> String {
    let header = [
        "cause",
        "follows",
        "size",
        "95 % interval",
        "of the error",
        "stability",
        "p",
        "not told from",
    ];
    let mut table = table(&header, 2);
    for finding in &found.findings {
        let [low, high] = finding.size.ci95;
        let rivals: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        table.add_row([
            finding.cause.name().to_owned(),
            finding.columns.join(", "),
            format!("{} {}", figure(finding.size.value), finding.size.unit),
            format!("{} .. {}", figure(low), figure(high)),
            format!("{:.1} %", 100.0 * finding.share_of_residual),
            format!("{:.2}", finding.stability),
            format!("{:.0e}", finding.p_value),
            rivals.join(", "),
        ]);
    }
    if found.findings.is_empty() {
        table.add_row(["none"]);
    }
    let mut text = format!("{table}\n{}", left_out_in_words(found));
    if found.findings.is_empty() {
        text += "\nWho came closest, % of the squared error on rows left out of the fit:";
        for ranked in ranking(found).iter().take(CLOSEST) {
            text += &format!("\n  {}: {}; {}", ranked.name, gain(ranked.score), ranked.against);
        }
    }
    text
}
