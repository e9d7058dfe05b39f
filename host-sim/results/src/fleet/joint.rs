//! Each joint over its campaigns: its cause, in how many logs, its trend, and whether it needs attention.

use super::statistics::{Limit, Outlier, Trend, natural_key, outliers, trends};
use super::{Ageing, FleetRow, LEVELS};
use crate::page::words::counted;
use joint_log::number::significant;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A joint over its campaigns.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSummary {
    /// Name of the joint.
    pub joint: String,
    /// Indices of its rows, the latest campaign last.
    pub rows: Vec<usize>,
    /// Number of logs with a diagnosis.
    pub diagnosed: usize,
    /// The cause that most of them name; `none` if no log names one.
    pub cause: String,
    /// Number of logs that name it.
    pub named: usize,
    /// The significant changes of its levels, such as `coulomb_torque +1.2 % per day`; empty without one.
    pub trend: String,
    /// Why the joint needs attention, one phrase each; empty if it does not.
    pub reasons: Vec<String>,
}

/// Returns the joints of a fleet, those that need attention first.
///
/// A joint needs attention if more than half of its logs name the same cause, a level has a significant trend, is far from
/// the other joints or above a limit, the latest log has no result, or its seal ages. A joint may have a trend of its learnt
/// level and no log.
pub fn joints(rows: &[FleetRow], ageing: &[Ageing], limits: &[Limit]) -> Vec<JointSummary> {
    let (trends, outliers) = (trends(rows, limits), outliers(rows));
    let mut by_joint: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    rows.iter().enumerate().for_each(|(at, row)| by_joint.entry(&row.joint).or_default().push(at));
    ageing.iter().for_each(|of| _ = by_joint.entry(&of.joint).or_default());
    let mut found: Vec<JointSummary> = by_joint
        .into_iter()
        .map(|(joint, mut own)| {
            own.sort_by_key(|at| natural_key(&rows[*at].campaign));
            let trends = trends.iter().filter(|of| of.joint == joint && of.is_significant);
            let outliers = outliers.iter().filter(|of| rows[of.row].joint == joint);
            let mut found =
                summary(joint, rows, own, &trends.collect::<Vec<_>>(), outliers, limits);
            let own_ageing = ageing.iter().filter(|of| of.joint == joint);
            found.reasons.extend(own_ageing.filter_map(|of| of.ageing.clone()));
            found
        })
        .collect();
    found.sort_by_cached_key(|of| (of.reasons.is_empty(), natural_key(&of.joint)));
    found
}

/// Returns the first sentence of a fleet: how many of its joints need attention.
pub fn attention_in_words(joints: &[JointSummary]) -> String {
    let needing = joints.iter().filter(|of| !of.reasons.is_empty()).count();
    let verb = if needing == 1 { "needs" } else { "need" };
    format!("{needing} of {} {verb} attention", counted(joints.len(), "joint"))
}

fn summary<'a>(
    joint: &str,
    rows: &[FleetRow],
    own: Vec<usize>,
    trends: &[&Trend],
    outliers: impl Iterator<Item = &'a Outlier>,
    limits: &[Limit],
) -> JointSummary {
    let good: Vec<&FleetRow> = own.iter().map(|at| &rows[*at]).filter(|row| row.is_ok()).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    good.iter()
        .filter(|row| row.cause != "none")
        .for_each(|row| *counts.entry(&row.cause).or_default() += 1);
    let most = counts.into_iter().max_by_key(|(name, count)| (*count, std::cmp::Reverse(*name)));
    let (cause, named) = most.unwrap_or(("none", 0));
    let trend: Vec<String> = trends.iter().map(|trend| trend_in_words(trend)).collect();
    let mut reasons = Vec::new();
    if own.last().is_some_and(|at| !rows[*at].is_ok()) {
        reasons.push("the latest log has no result".to_owned());
    }
    if 2 * named > good.len() {
        reasons.push(format!("{cause} in {named} of {}", counted(good.len(), "log")));
    }
    reasons.extend(trend.iter().cloned());
    reasons.extend(outliers.map(|of| {
        let [value, median] = [of.value, of.median].map(|value| significant(value, 3));
        format!("{} {value}, median of the fleet {median}", LEVELS[of.level])
    }));
    let levels = good.last().map(|row| row.levels).unwrap_or_default();
    for (name, level) in LEVELS.iter().zip(levels) {
        let limit = limits.iter().find(|limit| limit.level == *name);
        let (Some(limit), Some(level)) = (limit, level) else { continue };
        if level.value > limit.value {
            let [value, limit] = [level.value, limit.value].map(|value| significant(value, 3));
            reasons.push(format!("{name} {value} is above the limit {limit}"));
        }
    }
    JointSummary {
        joint: joint.to_owned(),
        diagnosed: good.len(),
        cause: cause.to_owned(),
        named,
        trend: trend.join(", "),
        reasons,
        rows: own,
    }
}

fn trend_in_words(trend: &Trend) -> String {
    let percent = 100.0 * trend.slope / trend.now;
    let mut text = LEVELS[trend.level].to_owned();
    let sign = if percent > 0.0 { "+" } else { "" };
    let _ = write!(text, " {sign}{} % per {}", significant(percent, 2), trend.unit.name());
    text
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;
    use crate::snapshot;

    fn row(joint: &str, campaign: u32, cause: &str, coulomb: f64) -> FleetRow {
        FleetRow {
            joint: joint.into(),
            campaign: format!("dive {campaign}"),
            cause: cause.into(),
            unit: "Nm".into(),
            fixed_model: "lugre".into(),
            levels: [Some(Level { value: coulomb, std_error: 0.01 }), None, None],
            ..FleetRow::default()
        }
    }

    #[test]
    fn joints_that_need_attention_are_first_with_their_reasons() {
        let mut rows = Vec::new();
        for joint in ["a", "b", "c", "d", "e", "f", "g", "h", "i"] {
            for campaign in 1..=5 {
                let wear = if joint == "h" { 0.2 * f64::from(campaign) } else { 0.0 };
                let scatter = 0.01 * f64::from((campaign * 7) % 5);
                let cause = match (joint, campaign) {
                    ("g", 2..) => "pressure-coulomb",
                    // A single log of a healthy joint.
                    ("b", 3) => "backlash",
                    _ => "none",
                };
                rows.push(row(joint, campaign, cause, 1.5 + scatter + wear));
            }
        }
        rows.push(FleetRow {
            joint: "i".into(),
            campaign: "dive 10".into(),
            error: Some("i.csv: found no rows".into()),
            ..FleetRow::default()
        });
        let found = joints(&rows, &[], &[Limit { level: "coulomb_torque".into(), value: 2.4 }]);
        let names: Vec<&str> = found.iter().map(|of| of.joint.as_str()).collect();
        assert_eq!(names, ["g", "h", "i", "a", "b", "c", "d", "e", "f"]);
        let attention = attention_in_words(&found);
        assert!(attention.starts_with("3 of 9 "), "{attention}");
        let reasons: Vec<String> = found.iter().map(|of| of.reasons.join("; ")).collect();
        assert!(reasons[0].contains("pressure-coulomb in 4 of 5"), "{reasons:?}");
        assert!(reasons[1].contains("% per ") && reasons[1].contains(" 2.4"), "{reasons:?}");
        assert_eq!(found[2].reasons.len(), 1, "the latest log has no result");
        assert!(reasons[3..].iter().all(String::is_empty), "{reasons:?}");
        snapshot::check(
            "fleet",
            "reasons for attention",
            &(attention + "\n" + &reasons.join("\n")),
        );
        let single = found.iter().find(|of| of.joint == "b").unwrap();
        assert_eq!((single.named, single.diagnosed, single.cause.as_str()), (1, 5, "backlash"));
    }
}
