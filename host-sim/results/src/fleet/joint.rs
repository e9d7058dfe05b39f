//! Each joint over its campaigns: its cause, the distance to the others, its trend, and whether it needs attention; and the
//! causes that the joints share.

use super::comparison::{
    Compared, Comparison, Comparisons, Distance, comparisons, main_cause, rows_by_joint,
};
use super::statistics::{LevelLaw, Limit, Trend, natural_key, trends};
use super::{Ageing, FleetRow, LEVELS, SIGNED};
use crate::page::words::counted;
use friction_diagnose::NEGLIGIBLE;
use joint_log::number::significant;
use joint_log::statistics::median_of_sorted;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// A joint over its campaigns.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointSummary {
    /// Name of the joint.
    pub joint: String,
    /// Indices of its rows, the latest campaign last.
    #[serde(skip)]
    pub rows: Vec<usize>,
    /// Number of logs with a diagnosis.
    pub diagnosed: usize,
    /// The cause that most of them name; `none` if no log names one.
    pub cause: String,
    /// Number of logs that name it.
    pub named: usize,
    /// Size of the cause in the latest log that names it, in `size_unit`.
    pub size: Option<f64>,
    /// Ends of its 95 % interval.
    pub size_ci95: Option<[f64; 2]>,
    /// Unit of the size.
    pub size_unit: String,
    /// Distance of the size from the other joints with this cause; `None` with too few.
    pub distance: Option<Distance>,
    /// The significant changes of its levels, such as `coulomb_torque +1.2 % per day`; empty without one.
    pub trend: String,
    /// Why the joint needs attention, one phrase each; empty if it does not.
    pub reasons: Vec<String>,
}

impl JointSummary {
    /// Returns the size of the cause, its difference from the other joints and its factor, each with its 95 % interval.
    pub fn sizes(&self) -> [String; 3] {
        let unit = &self.size_unit;
        let ends = self.size_ci95.unwrap_or([f64::INFINITY; 2]);
        let size = self.size.map(|size| with_interval([size, ends[0], ends[1]], unit));
        let difference = self.distance.map(|of| with_interval(of.difference, unit));
        let factor = self.distance.and_then(|of| of.factor).map(|of| with_interval(of, ""));
        [size, difference, factor].map(Option::unwrap_or_default)
    }
}

/// Returns a value with its unit and the ends of its interval; a share in per cent.
fn with_interval([value, ends @ ..]: [f64; 3], unit: &str) -> String {
    let scale = if unit == "1" { 100.0 } else { 1.0 };
    let digits = if unit.is_empty() { 2 } else { 3 };
    let words = |value: f64| significant(scale * value, digits);
    let unit = if unit == "1" { "%" } else { unit };
    let interval = match ends.iter().all(|end| end.is_finite()) {
        true => format!(" ({})", ends.map(words).join(" to ")),
        false => String::new(),
    };
    format!("{} {unit}", words(value)).trim_end().to_owned() + &interval
}

/// A cause of more than half of the joints of a fleet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SharedCause {
    /// Name of the cause.
    pub cause: String,
    /// Number of joints with it.
    pub joints: usize,
    /// Number of joints with a diagnosis.
    pub of: usize,
    /// Median, smallest and largest size of those that do not differ from the others, in `unit`.
    pub size: Option<[f64; 3]>,
    /// Unit of the size.
    pub unit: String,
    /// RMS of what the cause takes, as a share of the torque's standard deviation: the median of the joints.
    pub effect: Option<f64>,
    /// True if all these joints need attention: the effect is unknown or at least [`NEGLIGIBLE`].
    pub is_serious: bool,
}

impl SharedCause {
    /// Returns one line.
    pub fn in_words(&self) -> String {
        let all = if self.joints == self.of { "all" } else { &format!("{} of", self.joints) };
        let size = self.size.map_or_else(String::new, |of| {
            with_interval(of, &self.unit).replacen(')', " from joint to joint), ", 1)
        });
        let effect = self.effect.map(|share| significant(100.0 * share, 2) + " %");
        let effect = effect.unwrap_or_else(|| "an unknown share".to_owned());
        let verdict = if self.is_serious { "serious" } else { "small" };
        format!(
            "{all} {}: {}, {size}{effect} of the torque's standard deviation: {verdict}",
            self.of, self.cause
        )
    }
}

/// The joints of a fleet beside each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FleetSummary {
    /// The causes that joints share.
    pub shared: Vec<SharedCause>,
    /// The joints, those that need attention first.
    pub joints: Vec<JointSummary>,
    /// How they were compared, one sentence each: mirrored joints, and levels that the fixed model does not determine.
    pub notes: Vec<String>,
}

impl FleetSummary {
    /// Returns the first lines of a fleet: how many of its joints need attention, what they share, and how they were compared.
    pub fn in_words(&self) -> String {
        let needing = self.joints.iter().filter(|of| !of.reasons.is_empty()).count();
        let verb = if needing == 1 { "needs" } else { "need" };
        let first =
            format!("{needing} of {} {verb} attention", counted(self.joints.len(), "joint"));
        std::iter::once(first)
            .chain(self.shared.iter().map(SharedCause::in_words))
            .chain(self.notes.iter().cloned())
            .collect::<Vec<_>>()
            .join("\n")
    }
}

/// Compares the joints of a fleet.
///
/// A joint needs attention if one of these holds:
/// * More than half of its logs name the same cause, unless more than half of the joints share that and its effect is small.
/// * The size of its cause, or a level, differs from the other joints (`comparisons`), or the level is above a limit.
/// * A level has a significant trend, the latest log has no result, or its seal ages.
///
/// A joint may have a trend of its learnt level and no log.
pub fn summarise(rows: &[FleetRow], ageing: &[Ageing], limits: &[Limit]) -> FleetSummary {
    let trends = trends(rows, limits);
    let mut compared: BTreeMap<&str, Vec<Comparison>> = BTreeMap::new();
    let Comparisons { each, notes } = comparisons(rows);
    each.into_iter().for_each(|of| compared.entry(&rows[of.row].joint).or_default().push(of));
    let mut by_joint = rows_by_joint(rows);
    ageing.iter().for_each(|of| _ = by_joint.entry(&of.joint).or_default());
    let summarise = |(joint, of_joint): (&str, Vec<usize>)| {
        let trends = trends.iter().filter(|of| of.joint == joint && of.is_significant);
        let compared = compared.get(joint).map_or(&[][..], Vec::as_slice);
        let mut found =
            summary(joint, rows, of_joint, &trends.collect::<Vec<_>>(), compared, limits);
        let ageing_of_joint = ageing.iter().filter(|of| of.joint == joint);
        found.reasons.extend(ageing_of_joint.filter_map(|of| of.ageing.clone()));
        found
    };
    let mut found: Vec<JointSummary> = by_joint.into_iter().map(summarise).collect();
    let shared = shared(rows, &found);
    for joint in found.iter_mut().filter(|of| 2 * of.named > of.diagnosed) {
        let known = shared.iter().find(|of| of.cause == joint.cause);
        if known.is_none_or(|of| of.is_serious) {
            let logs = counted(joint.diagnosed, "log");
            joint.reasons.insert(0, format!("{} in {} of {logs}", joint.cause, joint.named));
        }
    }
    found.sort_by_cached_key(|of| (of.reasons.is_empty(), natural_key(&of.joint)));
    FleetSummary { shared, joints: found, notes }
}

/// Returns the causes of more than half of the joints; none for a single joint.
fn shared(rows: &[FleetRow], joints: &[JointSummary]) -> Vec<SharedCause> {
    let of = joints.iter().filter(|joint| joint.diagnosed > 0).count();
    let mut groups: BTreeMap<&str, Vec<&JointSummary>> = BTreeMap::new();
    let named = joints.iter().filter(|joint| 2 * joint.named > joint.diagnosed);
    named.for_each(|joint| groups.entry(&joint.cause).or_default().push(joint));
    groups.retain(|_, sharing| sharing.len() > 1 && 2 * sharing.len() > of);
    let range = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let (first, last) = (*values.first()?, *values.last()?);
        Some([median_of_sorted(&values), first, last])
    };
    let describe = |(cause, sharing): (&str, Vec<&JointSummary>)| {
        let unit = &sharing[0].size_unit;
        let differs = |joint: &JointSummary| joint.distance.is_some_and(|of| of.differs);
        let alike = sharing.iter().filter(|joint| !differs(joint) && joint.size_unit == *unit);
        let effect =
            sharing.iter().filter_map(|joint| rows[main_cause(rows, &joint.rows)?.latest].effect);
        let effect = range(effect.collect()).map(|[middle, ..]| middle);
        SharedCause {
            cause: cause.to_owned(),
            joints: sharing.len(),
            of,
            size: range(alike.filter_map(|joint| joint.size).collect()),
            unit: unit.clone(),
            effect,
            is_serious: effect.is_none_or(|share| share >= NEGLIGIBLE),
        }
    };
    groups.into_iter().map(describe).collect()
}

fn summary(
    joint: &str,
    rows: &[FleetRow],
    of_joint: Vec<usize>,
    trends: &[&Trend],
    compared: &[Comparison],
    limits: &[Limit],
) -> JointSummary {
    let good: Vec<&FleetRow> =
        of_joint.iter().map(|at| &rows[*at]).filter(|row| row.is_ok()).collect();
    let main = main_cause(rows, &of_joint);
    let trend: Vec<String> = trends.iter().map(|trend| trend_in_words(trend)).collect();
    let mut reasons = Vec::new();
    if of_joint.last().is_some_and(|at| !rows[*at].is_ok()) {
        reasons.push("the latest log has no result".to_owned());
    }
    reasons.extend(trend.iter().cloned());
    for of in compared {
        let Some(distance) = of.distance.filter(|distance| distance.differs) else { continue };
        let row = &rows[of.row];
        let (name, unit) = match of.what {
            Compared::Cause => (row.cause.as_str(), row.size_unit.as_str()),
            Compared::Signed(part) => (SIGNED[part], row.unit.as_str()),
            Compared::Level(level) | Compared::LinearLevel(level) => {
                (LEVELS[level], level_unit(level, &row.unit))
            }
        };
        let far =
            distance.factor.map(|of| with_interval(of, "").replacen(' ', " times the others ", 1));
        let far =
            far.unwrap_or_else(|| with_interval(distance.difference, unit) + " from the others");
        let value = with_interval([of.value, f64::INFINITY, f64::INFINITY], unit);
        reasons.push(format!("{name} {value}, {far}"));
    }
    for (at, name) in LEVELS.iter().enumerate() {
        let law = LevelLaw::of(&good, at);
        let level = good.last().and_then(|row| (law.levels)(row)[at]);
        let limit = limits.iter().find(|limit| limit.level == *name);
        let (Some(limit), Some(level)) = (limit, level) else { continue };
        if level.value > limit.value {
            let [value, limit] = [level.value, limit.value].map(|value| significant(value, 3));
            let law = law.name;
            reasons.push(format!("{name} {value} under {law} is above the limit {limit}"));
        }
    }
    let sized = main.as_ref().map(|main| &rows[main.latest]);
    JointSummary {
        joint: joint.to_owned(),
        diagnosed: good.len(),
        cause: main.as_ref().map_or("none", |main| main.name).to_owned(),
        named: main.as_ref().map_or(0, |main| main.named),
        size: sized.and_then(|row| row.size),
        size_ci95: sized.and_then(|row| row.size_ci95),
        size_unit: sized.map(|row| row.size_unit.clone()).unwrap_or_default(),
        distance: compared.iter().find(|of| of.what == Compared::Cause).and_then(|of| of.distance),
        trend: trend.join(", "),
        reasons,
        rows: of_joint,
    }
}

/// Returns the unit of a level of a joint whose torque or force has this unit.
pub(super) fn level_unit(level: usize, unit: &str) -> &str {
    match (LEVELS[level], unit) {
        ("viscous_friction", "N") => "N s/m",
        ("viscous_friction", _) => "Nm s/rad",
        _ => unit,
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
mod tests;
