//! The tables of the page.

use super::Scene;
use crate::page::tables::value_and_state;
use crate::ranking::{RankedCandidate, gain};
use crate::report::{Cell, Table};
use compensator_core::ParameterId;
use friction_diagnose::{Diagnosis, Share, probability_in_words};
use friction_fit::Outcome;
use friction_fit::params::unit;
use joint_log::JointKind;
use joint_log::number::significant;

/// A share in percent with two digits.
fn percent(share: f64) -> Cell {
    Cell::ShortNumber(100.0 * share, 2)
}

/// Replaces blanks so that a number is not split at the end of a line.
fn unbroken(number: String) -> String {
    number.replace(' ', "\u{a0}")
}

/// Formats a probability; 0 means that it is too small to be represented.
pub(super) fn probability(p: f64) -> String {
    if p > 0.0 { unbroken(significant(p, 2)) } else { "–".into() }
}

/// Returns the table of the base model's error by state of motion and direction.
pub(super) fn shares(scene: &Scene) -> Table {
    let found = scene.about.found;
    let row = |share: &Share| {
        vec![
            share.name.as_str().into(),
            percent(share.of_rows),
            Cell::Text(format!(
                "{} ± {}",
                significant(100.0 * share.of_error, 2),
                significant(200.0 * share.uncertainty, 2)
            )),
            Cell::ShortNumber(share.rmse, 3),
            Cell::ShortNumber(share.mean, 2),
        ]
    };
    let unit = scene.unit();
    let header = format!(
        "|share of rows (%)|share of squared error (%, ± 2 standard errors)|RMSE ({unit})|mean error ({unit})"
    );
    let caption = match found.log.leaves_each_out {
        true => "Base model fitted to all runs",
        false => "Base model on held-out rows",
    };
    Table::new(caption, &header, found.by_regime.iter().chain(&found.by_direction).map(row))
}

/// Returns the table of the findings, strongest first.
pub(super) fn findings(scene: &Scene) -> Table {
    let found = scene.about.found;
    let rows = found.findings.iter().map(|finding| {
        let interval = finding.size.bounds().map_or_else(
            || "not determined".to_owned(),
            |[low, high]| {
                format!("{} to {}", unbroken(significant(low, 3)), unbroken(significant(high, 3)))
            },
        );
        let unit = if finding.size.unit == "1" { "" } else { finding.size.unit.as_str() };
        let rivals: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        let order = finding.order.map_or_else(String::new, |order| {
            let reach = significant(2.0 * order.std_error, 1);
            format!(", order {} ± {reach}", significant(order.value, 4))
        });
        vec![
            finding.cause.name().into(),
            finding.columns.join(", ").into(),
            format!("{} {unit}{order}", unbroken(significant(finding.size.value, 4))).into(),
            interval.into(),
            percent(finding.share_of_residual),
            Cell::Text(probability_in_words(finding.probability)),
            Cell::Text(probability(finding.p_value)),
            Cell::Text(format!("{:.2}", finding.stability)),
            rivals.join(", ").into(),
        ]
    });
    let header =
        "cause|columns|size|95 % interval|share (%)|probability|p|stability|indistinguishable from";
    Table::new("Findings, strongest first", header, rows)
}

/// Returns the table of the candidates, best first, with their rejection reasons.
pub(super) fn ranking(caption: impl Into<String>, ranking: &[RankedCandidate]) -> Table {
    let row = |ranked: &RankedCandidate| {
        let verdict =
            if ranked.is_finding { "(finding)" } else { ranked.rejected_because.as_str() };
        vec![
            ranked.name.as_str().into(),
            Cell::Text(unbroken(gain(ranked.candidate))),
            Cell::Text(probability_in_words(ranked.probability)),
            verdict.into(),
        ]
    };
    let gain = "gain alone on held-out rows (% of the squared error, ± 2 standard errors)";
    let header = format!("candidate|{gain}|probability|rejected because");
    Table::new(caption, &header, ranking.iter().map(row))
}

/// Returns the table of the parameters before and after.
pub(super) fn parameters(scene: &Scene) -> Table {
    let found = scene.about.found;
    let joint = scene.about.input.data.joint;
    let mut ids: Vec<ParameterId> = found.baseline.estimates.iter().map(|e| e.id).collect();
    let added = found.extended.estimates.iter().map(|e| e.id).filter(|id| !ids.contains(id));
    ids.extend(added.collect::<Vec<_>>());
    ids.retain(|id| !is_unused(&found.baseline, *id) || !is_unused(&found.extended, *id));
    let row = |id: &ParameterId| row(found, *id, joint, scene.is_extended());
    let mut header = "parameter|unit|before ± standard error|state".to_owned();
    if scene.is_extended() {
        header += "|after ± standard error|state";
    }
    let caption = match scene.is_extended() {
        true => format!("Before: {}. After: {}.", found.baseline.spec, found.extended.spec),
        false => format!("{}.", found.baseline.spec),
    };
    Table::new(caption, &header, ids.iter().map(row))
}

fn row(found: &Diagnosis, id: ParameterId, joint: JointKind, extended: bool) -> Vec<Cell> {
    let mut cells = vec![id.name().into(), unit(id, joint).into()];
    let outcomes = [&found.baseline, &found.extended];
    for outcome in &outcomes[..if extended { 2 } else { 1 }] {
        match outcome.estimates.iter().find(|estimate| estimate.id == id) {
            Some(estimate) => cells.extend(value_and_state(estimate)),
            None => cells.extend([Cell::Empty, "".into()]),
        }
    }
    cells
}

/// Returns true for a knot of the free curve that was kept at zero, and for a parameter that the model does not have.
fn is_unused(outcome: &Outcome, id: ParameterId) -> bool {
    outcome.estimates.iter().find(|estimate| estimate.id == id).is_none_or(|estimate| {
        estimate.std_error.is_none() && estimate.value == 0.0 && id.name().starts_with("unknown_")
    })
}
