//! Joints that differ from the others in the size of their cause or in a level.
//!
//! Each joint is compared with the others of the same cause and unit, or of the same fixed model. A joint differs if its
//! distance from their mean is significant by Student's t, with their scatter and its own standard error. The most distant
//! joint is removed and the next one tested, so that two such joints do not hide each other (Rosner's generalized extreme
//! Studentized deviate, 1983). The significance of a fleet is divided by the groups and by the joints (Bonferroni).
//!
//! The distribution of the joints is unknown. Values of one sign must differ on a linear and on a logarithmic scale, and the
//! degrees of freedom are limited ([`MOST_FREEDOM`]), so that skewness or a long tail alone gives few such joints.
//!
//! Levels are compared under the linear law, which all logs determine: a richer law divides the same torque among more parameters,
//! and a log without slow motion determines none of them. Signed quantities of mirrored joints are compared with the sign of the
//! others ([`mirror`](super::mirror)).

use super::mirror::{SignedValue, is_turned, mirrored};
use super::statistics::{FLEET_SIGNIFICANCE, middle, natural_key};
use super::{FleetRow, LEVELS, Level, SIGNED};
use crate::page::words::{counted, listed};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Minimum number of joints for a comparison: the scatter of fewer than three others is unknown. One in as many may differ.
pub const MIN_COMPARED: usize = 4;

/// Largest number of joints that may differ in one group, which limits the time of the test.
const MAX_DIFFERING: usize = 200;

/// Largest degrees of freedom of the test: tails as those of a fleet whose joints are not normally distributed.
const MOST_FREEDOM: f64 = 6.0;

/// Half width of a 95 % interval in standard deviations.
pub(super) const HALF_WIDTH_95: f64 = 1.96;

/// Distance of a joint from the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distance {
    /// Median of the joints that do not differ, in the unit of the value.
    pub others: f64,
    /// Value minus median, and the ends of its 95 % interval, with the errors of both.
    pub difference: [f64; 3],
    /// Value over median, and the ends of its 95 % interval; `None` if the values have two signs.
    pub factor: Option<[f64; 3]>,
    /// True if the joint differs by more than errors and scatter explain.
    pub differs: bool,
}

/// What is compared. The order is that of the reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Compared {
    /// The size of the cause.
    Cause,
    /// A level of the fixed model, by its index in [`LEVELS`](super::LEVELS).
    Level(usize),
    /// The same of the linear law.
    LinearLevel(usize),
    /// A signed part of the rigid body, by its index in [`SIGNED`](super::SIGNED).
    Signed(usize),
}

/// A value of a joint and its distance from those of the others; `None` with fewer than [`MIN_COMPARED`] joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Index of the row.
    pub row: usize,
    /// What is compared.
    pub what: Compared,
    /// The value.
    pub value: f64,
    /// Its distance. That of a mirrored joint has the sign of the others.
    pub distance: Option<Distance>,
}

/// The values of a fleet beside each other.
pub struct Comparisons {
    /// One for each joint and quantity.
    pub each: Vec<Comparison>,
    /// How they were compared, one sentence each: mirrored joints, and joints under another model.
    pub notes: Vec<String>,
}

/// What makes values comparable.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Group<'a> {
    what: Compared,
    /// Name of the cause or of the fixed model; empty for a signed part.
    name: &'a str,
    unit: &'a str,
}

/// A value of a joint.
struct Value {
    /// Index of the row.
    row: usize,
    level: Level,
}

/// The cause that most logs of a joint name.
pub(super) struct MainCause<'a> {
    /// Its name.
    pub name: &'a str,
    /// Number of logs that name it.
    pub named: usize,
    /// Index of the latest row that names it.
    pub latest: usize,
}

/// Causes whose size has the sign of the direction.
const SIGNED_CAUSES: [&str; 2] = ["torque-offset", "direction-asymmetry"];

/// Largest number of joints that a note names.
const MAX_NAMED: usize = 8;

/// Returns the rows of each joint, the latest campaign last.
pub(super) fn rows_by_joint(rows: &[FleetRow]) -> BTreeMap<&str, Vec<usize>> {
    let mut by_joint: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    rows.iter().enumerate().for_each(|(at, row)| by_joint.entry(&row.joint).or_default().push(at));
    by_joint
        .values_mut()
        .for_each(|of_joint| of_joint.sort_by_key(|at| natural_key(&rows[*at].campaign)));
    by_joint
}

/// Returns the main cause of a joint with these rows, the latest campaign last; `None` if no log names one.
pub(super) fn main_cause<'a>(rows: &'a [FleetRow], of_joint: &[usize]) -> Option<MainCause<'a>> {
    let mut naming: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let good = of_joint.iter().filter(|at| rows[**at].is_ok() && rows[**at].cause != "none");
    good.for_each(|at| naming.entry(&rows[*at].cause).or_default().push(*at));
    let most = naming.into_iter().max_by_key(|(name, rows)| (rows.len(), std::cmp::Reverse(*name)));
    let (name, rows) = most?;
    Some(MainCause { name, named: rows.len(), latest: *rows.last()? })
}

/// Compares the size of each joint's main cause, its latest levels, and the signed parts of its rigid body, with those of the
/// other joints.
pub fn comparisons(rows: &[FleetRow]) -> Comparisons {
    let latest = latest(rows);
    let groups = groups(rows, &latest);
    let signed_groups = groups.iter().filter_map(|(group, values)| signed(rows, group, values));
    let mirrored = mirrored(&signed_groups.collect::<Vec<_>>());
    let has_enough = |values: &Vec<Value>| values.len() >= MIN_COMPARED;
    let is_tested = |group: &Group| match group.what {
        Compared::Level(level) => {
            let linear = Group { what: Compared::LinearLevel(level), ..*group };
            !groups.get(&linear).is_some_and(has_enough)
        }
        _ => true,
    };
    let tested = groups.iter().filter(|of| has_enough(of.1) && is_tested(of.0)).count();
    let mut each: BTreeMap<(usize, Compared), Comparison> = BTreeMap::new();
    let mut turned = Vec::new();
    for (group, values) in &groups {
        let what = group.what;
        let is_turned = signed(rows, group, values).is_some_and(|of| is_turned(&of, &mirrored));
        let of_one_side = |of: &Value| {
            let is_turned = is_turned && mirrored.contains(&&*rows[of.row].joint);
            let value = if is_turned { -of.level.value } else { of.level.value };
            Level { value, ..of.level }
        };
        let levels: Vec<Level> = values.iter().map(of_one_side).collect();
        if is_turned {
            turned.push(if let Compared::Signed(part) = what { SIGNED[part] } else { group.name });
        }
        let found = distances(&levels, FLEET_SIGNIFICANCE / tested as f64);
        for (at, &Value { row, level }) in values.iter().enumerate() {
            let distance = found.get(at).copied();
            each.insert((row, what), Comparison { row, what, value: level.value, distance });
        }
    }
    of_one_model(&mut each);
    let mut notes = Vec::new();
    if !turned.is_empty() {
        let verb = if mirrored.len() == 1 { "is" } else { "are" };
        notes.push(format!(
            "{} {verb} mirrored, and compared with the other sign of {}",
            listed(&mirrored, MAX_NAMED),
            turned.join(", ")
        ));
    }
    notes.extend(models_in_words(rows, &latest, &each));
    Comparisons { each: each.into_values().collect(), notes }
}

/// Returns the latest row with a result of each joint.
fn latest(rows: &[FleetRow]) -> Vec<usize> {
    let by_joint = rows_by_joint(rows).into_values();
    by_joint
        .filter_map(|of_joint| of_joint.into_iter().rev().find(|at| rows[*at].is_ok()))
        .collect()
}

/// Returns the comparable values.
fn groups<'a>(rows: &'a [FleetRow], latest: &[usize]) -> BTreeMap<Group<'a>, Vec<Value>> {
    let mut groups: BTreeMap<Group, Vec<Value>> = BTreeMap::new();
    for of_joint in rows_by_joint(rows).into_values() {
        let Some(MainCause { latest: at, .. }) = main_cause(rows, &of_joint) else { continue };
        let row = &rows[at];
        if let (Some(value), Some([low, high])) = (row.size, row.size_ci95) {
            let level = Level { value, std_error: (high - low) / (2.0 * HALF_WIDTH_95) };
            let group = Group { what: Compared::Cause, name: &row.cause, unit: &row.size_unit };
            groups.entry(group).or_default().push(Value { row: at, level });
        }
    }
    for &at in latest {
        let row = &rows[at];
        let mut add = |what, name, level: &Option<Level>| {
            let Some(level) = *level else { return };
            let group = Group { what, name, unit: &row.unit };
            groups.entry(group).or_default().push(Value { row: at, level });
        };
        let levels = row.levels.iter().enumerate();
        levels.for_each(|(level, of)| add(Compared::Level(level), &row.fixed_model, of));
        let levels = row.linear_levels.iter().enumerate().filter(|_| !has_linear_model(row));
        levels.for_each(|(level, of)| add(Compared::LinearLevel(level), &row.fixed_model, of));
        let parts = row.signed.iter().enumerate();
        parts.for_each(|(part, of)| add(Compared::Signed(part), "", of));
    }
    // A size that its log does not determine has an infinite interval.
    let is_finite = |of: &Value| (of.level.value + of.level.std_error).is_finite();
    groups.values_mut().for_each(|values| values.retain(is_finite));
    groups
}

/// Returns true if the fixed model is the linear law.
fn has_linear_model(row: &FleetRow) -> bool {
    row.fixed_model.split('+').next() == Some("linear")
}

/// Share of the distance under the linear law that the fixed model must allow.
const MIN_AGREEMENT: f64 = 0.5;

/// Removes, of a level under both models, the comparison under the fixed model. The linear law is the more precise one. It lacks
/// what happens at low speed, so a joint with another motion may have another level. Where the fixed model determines the level
/// and excludes even a part of the distance, the joint does not differ.
fn of_one_model(each: &mut BTreeMap<(usize, Compared), Comparison>) {
    let fixed: BTreeMap<(usize, Compared), Option<Distance>> =
        each.iter().map(|(key, of)| (*key, of.distance)).collect();
    each.retain(|&(row, what), of| match what {
        Compared::Level(level) => {
            fixed.get(&(row, Compared::LinearLevel(level))).is_none_or(Option::is_none)
        }
        Compared::LinearLevel(level) => {
            let under_fixed = fixed.get(&(row, Compared::Level(level))).copied().flatten();
            if let (Some(distance), Some(under_fixed)) = (&mut of.distance, under_fixed) {
                let least = MIN_AGREEMENT * distance.difference[0];
                let [_, low, high] = under_fixed.difference;
                distance.differs &= if least > 0.0 { high >= least } else { low <= least };
            }
            true
        }
        _ => true,
    });
}

/// Returns a sentence for each level that the fixed model does not determine on some of the joints.
fn models_in_words(
    rows: &[FleetRow],
    latest: &[usize],
    each: &BTreeMap<(usize, Compared), Comparison>,
) -> Vec<String> {
    let in_words = |(level, name): (usize, &&str)| {
        let open = latest.iter().filter(|at| rows[**at].levels[level].is_none()).count();
        let is_linear = |at: &usize| {
            let of = each.get(&(*at, Compared::LinearLevel(level)));
            of.is_some_and(|of| of.distance.is_some())
        };
        let how = match latest.iter().any(is_linear) {
            _ if open == 0 => return None,
            true => "all are compared under the linear law",
            false if open == latest.len() => return None,
            false => "these are not compared",
        };
        let model = &rows[*latest.first()?].fixed_model;
        let all = counted(latest.len(), "joint");
        Some(format!("{name}: not determined by {model} on {open} of {all}, {how}"))
    };
    LEVELS.iter().enumerate().filter_map(in_words).collect()
}

/// Returns the values of a signed quantity with the names of their joints; `None` for another quantity, and of too few joints.
fn signed<'a>(
    rows: &'a [FleetRow],
    group: &Group,
    values: &[Value],
) -> Option<Vec<SignedValue<'a>>> {
    let is_signed = match group.what {
        Compared::Cause => SIGNED_CAUSES.contains(&group.name),
        Compared::Signed(_) => true,
        Compared::Level(_) | Compared::LinearLevel(_) => false,
    };
    let named = |of: &Value| SignedValue { joint: &rows[of.row].joint, level: of.level };
    (is_signed && values.len() >= MIN_COMPARED).then(|| values.iter().map(named).collect())
}

/// Returns the distance of each value from the others; empty if there are too few.
pub fn distances(values: &[Level], significance: f64) -> Vec<Distance> {
    if values.len() < MIN_COMPARED {
        return Vec::new();
    }
    let has_sign = |sign: f64| values.iter().all(|of| sign * of.value > 0.0);
    let has_factor = has_sign(1.0) || has_sign(-1.0);
    let mut differs = differing(values, significance);
    if has_factor {
        let logarithm = |of: &Level| Level {
            value: of.value.abs().ln(),
            std_error: of.std_error / of.value.abs(),
        };
        let also = differing(&values.iter().map(logarithm).collect::<Vec<_>>(), significance);
        differs.iter_mut().zip(also).for_each(|(linear, also)| *linear &= also);
    }
    let alike = values.iter().zip(&differs).filter(|(_, differs)| !**differs).map(|(of, _)| *of);
    let others = middle(alike.clone().map(|of| of.value));
    let sums = alike.fold(Sums::default(), |sums, of| sums.with(of, others, 1.0));
    // The standard error of a median of normal values.
    let error = (FRAC_PI_2 * sums.mean_and_variance().1 / sums.count).sqrt();
    let student = StudentsT::new(0.0, 1.0, sums.count - 1.0);
    let reach = student.map_or(f64::INFINITY, |of| of.inverse_cdf(0.975));
    let distance = |(&Level { value, std_error }, differs): (&Level, bool)| {
        let (difference, half) = (value - others, reach * error.hypot(std_error));
        let factor = || {
            let reach = reach * (error / others).hypot(std_error / value);
            [0.0, -reach, reach].map(|end: f64| value / others * end.exp())
        };
        let difference = [difference, difference - half, difference + half];
        Distance { others, difference, factor: has_factor.then(factor), differs }
    };
    values.iter().zip(differs).map(distance).collect()
}

/// Sums of values, and of the squares of their errors.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    sum: f64,
    squares: f64,
    errors: f64,
}

impl Sums {
    /// Adds a value, as its distance from a middle, or takes it away.
    fn with(self, of: Level, middle: f64, sign: f64) -> Self {
        Self {
            count: self.count + sign,
            sum: self.sum + sign * (of.value - middle),
            squares: self.squares + sign * (of.value - middle).powi(2),
            errors: self.errors + sign * of.std_error.powi(2),
        }
    }

    /// Returns mean and variance. The scatter is at least what the errors of the values cause.
    fn mean_and_variance(&self) -> (f64, f64) {
        let mean = self.sum / self.count;
        let variance = (self.squares - self.count * mean * mean) / (self.count - 1.0);
        (mean, variance.max(self.errors / self.count))
    }
}

/// Returns which values differ from the others on one scale.
fn differing(values: &[Level], significance: f64) -> Vec<bool> {
    let middle = middle(values.iter().map(|of| of.value));
    let mut left = values.iter().fold(Sums::default(), |sums, of| sums.with(*of, middle, 1.0));
    let mut kept: Vec<usize> = (0..values.len()).collect();
    let (mut removed, mut significant) = (Vec::new(), 0);
    for _ in 0..(values.len() / MIN_COMPARED).min(MAX_DIFFERING) {
        let score = |at: usize| {
            let others = left.with(values[at], middle, -1.0);
            let (mean, variance) = others.mean_and_variance();
            let Level { value, std_error } = values[at];
            let error = (variance * (1.0 + 1.0 / others.count)).sqrt().hypot(std_error);
            if error > 0.0 { (value - middle - mean).abs() / error } else { 0.0 }
        };
        let scores = kept.iter().enumerate().map(|(place, at)| (place, score(*at)));
        let Some((place, score)) = scores.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let freedom = (kept.len() as f64 - 2.0).min(MOST_FREEDOM);
        let p_value = StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |of| 2.0 * of.cdf(-score));
        let is_significant = p_value < significance / kept.len() as f64;
        let farthest = kept.swap_remove(place);
        left = left.with(values[farthest], middle, -1.0);
        removed.push(farthest);
        significant = if is_significant { removed.len() } else { significant };
    }
    (0..values.len()).map(|at| removed[..significant].contains(&at)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::uniform;
    use statrs::distribution::{Laplace, Normal, Weibull};

    /// How the sizes of a fleet are distributed. The rule knows none of these.
    const FLEETS: [&str; 7] =
        ["narrow", "log-normal", "normal", "uniform", "Weibull", "Laplace", "Student"];

    /// Returns the size at a probability.
    fn size(fleet: &str, share: f64) -> f64 {
        let of = |found: &dyn ContinuousCDF<f64, f64>| found.inverse_cdf(share);
        match fleet {
            "narrow" => of(&Normal::new(1.0, 0.06).unwrap()),
            "log-normal" => of(&Normal::new(0.0, 0.25).unwrap()).exp(),
            "normal" => of(&Normal::new(1.0, 0.25).unwrap()).max(0.05),
            "uniform" => 0.5 + share,
            "Weibull" => of(&Weibull::new(3.0, 1.0).unwrap()),
            "Laplace" => of(&Laplace::new(0.0, 0.12).unwrap()).exp(),
            _ => of(&StudentsT::new(0.0, 0.12, 4.0).unwrap()).exp(),
        }
    }

    /// Draws a fleet whose first joints are `factor` times its middle. Each size has an error of a few per cent.
    fn fleet(
        name: &str,
        [count, large]: [usize; 2],
        factor: f64,
        random: &mut impl FnMut() -> f64,
    ) -> Vec<Level> {
        let mut sizes: Vec<f64> = (0..count).map(|_| size(name, random())).collect();
        let middle = middle(sizes.iter().copied());
        sizes[..large].fill(factor * middle);
        let measured = sizes.into_iter().map(|size| {
            let std_error = 0.015 * size * (0.5 + 2.5 * random());
            let value = Normal::new(size, std_error).unwrap().inverse_cdf(random());
            Level { value, std_error }
        });
        measured.collect()
    }

    const SETS: usize = 400;

    /// Returns in how many of 100 fleets the joints `which` contain one that differs.
    fn rate(name: &str, sizes: [usize; 2], factor: f64, which: std::ops::Range<usize>) -> f64 {
        let mut random = uniform(0x666c_6565 + sizes[0] as u64);
        let found = (0..SETS).filter(|_| {
            let found = distances(&fleet(name, sizes, factor, &mut random), FLEET_SIGNIFICANCE);
            found[which.clone()].iter().any(|of| of.differs)
        });
        100.0 * found.count() as f64 / SETS as f64
    }

    #[test]
    fn distances_of_joints_of_one_distribution_rarely_differ() {
        for name in FLEETS {
            let rates = [4, 6, 10, 30].map(|count| rate(name, [count, 0], 1.0, 0..count));
            println!("{name}: false alarms in 100 fleets of 4, 6, 10, 30 joints: {rates:?}");
            let most = if ["Laplace", "Student"].contains(&name) { 14.0 } else { 6.0 };
            assert!(rates.iter().all(|rate| *rate <= most), "{name}: {rates:?}");
        }
    }

    #[test]
    fn distances_of_one_or_two_larger_joints_differ() {
        for name in FLEETS {
            let rates = [1.5, 2.0, 4.0].map(|factor| rate(name, [10, 1], factor, 0..1));
            let two = rate(name, [10, 2], 4.0, 0..1);
            println!(
                "{name}: found of 100 that are 1.5, 2, 4 times the others: {rates:?}; of two: {two}"
            );
            // The standard deviation of the wide fleets is a fourth to a third of their mean.
            let least = if name == "narrow" { [50.0, 90.0, 98.0] } else { [0.0, 0.0, 25.0] };
            assert!(rates.iter().zip(least).all(|(rate, least)| *rate >= least), "{rates:?}");
            assert!(two > 20.0, "{name}: {two}");
        }
    }

    #[test]
    fn distances_state_difference_and_factor() {
        let mut values = [15.0, 14.2, 15.9, 15.4, 14.6, 15.1, 14.8]
            .map(|value| Level { value, std_error: 0.3 })
            .to_vec();
        values.push(Level { value: 60.0, std_error: 1.0 });
        let found = distances(&values, FLEET_SIGNIFICANCE);
        let [factor, low, high] = found[7].factor.unwrap();
        assert!(found[7].differs && found[..7].iter().all(|of| !of.differs), "{found:?}");
        assert!((found[7].others, found[7].difference[0]) == (15.0, 45.0), "{:?}", found[7]);
        assert!((3.6..3.95).contains(&low) && factor == 4.0 && (4.05..4.4).contains(&high));
        let [_, low, high] = found[7].difference;
        assert!(40.0 < low && low < 44.0 && 46.0 < high && high < 50.0, "{low} to {high}");
        let mut mirrored = values.clone();
        mirrored.iter_mut().skip(1).step_by(2).for_each(|of| of.value = -of.value);
        let found = distances(&mirrored, FLEET_SIGNIFICANCE);
        assert!(found.iter().all(|of| of.factor.is_none()), "{found:?}");
        assert!(distances(&values[5..], FLEET_SIGNIFICANCE).is_empty(), "three joints");
    }
}
