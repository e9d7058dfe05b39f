//! Joints that differ from the others in the size of their cause or in a level.
//!
//! Each joint is compared with the others of the same cause and unit, or of the same fixed model. A joint differs if its
//! distance from their mean is significant by Student's t, with their scatter and its own standard error. The most distant
//! joint is removed and the next one tested, so that two such joints do not hide each other (Rosner's generalized extreme
//! Studentized deviate, 1983). The significance of a fleet is divided by the groups and by the joints (Bonferroni).
//!
//! The distribution of the joints is unknown. Values of one sign must differ on a linear and on a logarithmic scale, and the
//! degrees of freedom are limited ([`MOST_FREEDOM`]), so that skewness or a long tail alone gives few such joints.

use super::FleetRow;
use super::statistics::{FLEET_SIGNIFICANCE, natural_key};
use crate::level_trend::median;
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
const HALF_WIDTH_95: f64 = 1.96;

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

/// A value of a joint and its distance from those of the others; `None` with fewer than [`MIN_COMPARED`] joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Index of the row.
    pub row: usize,
    /// Index of the level in [`LEVELS`](super::LEVELS); `None` for the size of the cause.
    pub level: Option<usize>,
    /// The value.
    pub value: f64,
    /// Its distance.
    pub distance: Option<Distance>,
}

/// Index of the level, model or cause, and unit: what makes values comparable.
type Group<'a> = (Option<usize>, &'a str, &'a str);

/// Returns the rows of each joint, the latest campaign last.
pub(super) fn rows_by_joint(rows: &[FleetRow]) -> BTreeMap<&str, Vec<usize>> {
    let mut by_joint: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    rows.iter().enumerate().for_each(|(at, row)| by_joint.entry(&row.joint).or_default().push(at));
    by_joint.values_mut().for_each(|own| own.sort_by_key(|at| natural_key(&rows[*at].campaign)));
    by_joint
}

/// Returns the cause that most logs of a joint name, `none` without one; in how many; and the latest that agrees.
pub(super) fn main_cause<'a>(
    rows: &'a [FleetRow],
    own: &[usize],
) -> (&'a str, usize, Option<usize>) {
    let mut found: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    let good = own.iter().filter(|at| rows[**at].is_ok() && rows[**at].cause != "none");
    good.for_each(|at| {
        let count = found.get(rows[*at].cause.as_str()).map_or(0, |(count, _)| *count);
        found.insert(&rows[*at].cause, (count + 1, *at));
    });
    let most =
        found.into_iter().max_by_key(|(name, (count, _))| (*count, std::cmp::Reverse(*name)));
    most.map_or(("none", 0, None), |(name, (count, latest))| (name, count, Some(latest)))
}

/// Compares the size of each joint's main cause, and its latest levels, with those of the other joints.
pub fn comparisons(rows: &[FleetRow]) -> Vec<Comparison> {
    let mut groups: BTreeMap<Group, Vec<(usize, f64, f64)>> = BTreeMap::new();
    for own in rows_by_joint(rows).into_values() {
        let sized = main_cause(rows, &own).2.map(|at| (at, &rows[at]));
        if let Some((at, row)) = sized
            && let (Some(size), Some([low, high])) = (row.size, row.size_ci95)
        {
            let error = (high - low) / (2.0 * HALF_WIDTH_95);
            groups.entry((None, &row.cause, &row.size_unit)).or_default().push((at, size, error));
        }
        let Some(&at) = own.iter().rev().find(|at| rows[**at].is_ok()) else { continue };
        for (level, found) in rows[at].levels.iter().enumerate() {
            let Some(found) = found else { continue };
            let key = (Some(level), rows[at].fixed_model.as_str(), rows[at].unit.as_str());
            groups.entry(key).or_default().push((at, found.value, found.std_error));
        }
    }
    // A size that its log does not determine has an infinite interval.
    groups.values_mut().for_each(|own| own.retain(|(_, value, error)| (value + error).is_finite()));
    let tested = groups.values().filter(|own| own.len() >= MIN_COMPARED).count();
    let mut all = Vec::new();
    for ((level, ..), group) in groups {
        let values: Vec<(f64, f64)> =
            group.iter().map(|(_, value, error)| (*value, *error)).collect();
        let found = distances(&values, FLEET_SIGNIFICANCE / tested as f64);
        let each = group.into_iter().enumerate();
        all.extend(each.map(|(at, (row, value, _))| Comparison {
            row,
            level,
            value,
            distance: found.get(at).copied(),
        }));
    }
    all
}

/// Returns the distance of each value with its standard error from the others; empty if there are too few.
pub fn distances(values: &[(f64, f64)], significance: f64) -> Vec<Distance> {
    if values.len() < MIN_COMPARED {
        return Vec::new();
    }
    let has_sign = |sign: f64| values.iter().all(|(value, _)| sign * value > 0.0);
    let has_factor = has_sign(1.0) || has_sign(-1.0);
    let mut differs = differing(values, significance);
    if has_factor {
        let logarithm = |(value, error): &(f64, f64)| (value.abs().ln(), error / value.abs());
        let also = differing(&values.iter().map(logarithm).collect::<Vec<_>>(), significance);
        differs.iter_mut().zip(also).for_each(|(own, also)| *own &= also);
    }
    let alike = values.iter().zip(&differs).filter(|(_, differs)| !**differs).map(|(of, _)| *of);
    let others = middle(alike.clone().map(|(value, _)| value));
    let sums = alike.fold(Sums::default(), |sums, of| sums.with(of, others, 1.0));
    // The standard error of a median of normal values.
    let error = (FRAC_PI_2 * sums.mean_and_variance().1 / sums.count).sqrt();
    let student = StudentsT::new(0.0, 1.0, sums.count - 1.0);
    let reach = student.map_or(f64::INFINITY, |of| of.inverse_cdf(0.975));
    let distance = |(&(value, own), differs): (&(f64, f64), bool)| {
        let (difference, half) = (value - others, reach * error.hypot(own));
        let factor = || {
            let reach = reach * (error / others).hypot(own / value);
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
    fn with(self, (value, error): (f64, f64), middle: f64, sign: f64) -> Self {
        Self {
            count: self.count + sign,
            sum: self.sum + sign * (value - middle),
            squares: self.squares + sign * (value - middle).powi(2),
            errors: self.errors + sign * error.powi(2),
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
fn differing(values: &[(f64, f64)], significance: f64) -> Vec<bool> {
    let middle = middle(values.iter().map(|(value, _)| *value));
    let mut left = values.iter().fold(Sums::default(), |sums, of| sums.with(*of, middle, 1.0));
    let mut kept: Vec<usize> = (0..values.len()).collect();
    let (mut removed, mut significant) = (Vec::new(), 0);
    for _ in 0..(values.len() / MIN_COMPARED).min(MAX_DIFFERING) {
        let score = |at: usize| {
            let others = left.with(values[at], middle, -1.0);
            let (mean, variance) = others.mean_and_variance();
            let error = (variance * (1.0 + 1.0 / others.count)).sqrt().hypot(values[at].1);
            if error > 0.0 { (values[at].0 - middle - mean).abs() / error } else { 0.0 }
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

/// Returns the median.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    median(&sorted)
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
    ) -> Vec<(f64, f64)> {
        let mut sizes: Vec<f64> = (0..count).map(|_| size(name, random())).collect();
        let middle = middle(sizes.iter().copied());
        sizes[..large].fill(factor * middle);
        let measured = sizes.into_iter().map(|size| {
            let error = 0.015 * size * (0.5 + 2.5 * random());
            (Normal::new(size, error).unwrap().inverse_cdf(random()), error)
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
        let mut values: Vec<(f64, f64)> =
            [15.0, 14.2, 15.9, 15.4, 14.6, 15.1, 14.8].map(|value| (value, 0.3)).to_vec();
        values.push((60.0, 1.0));
        let found = distances(&values, FLEET_SIGNIFICANCE);
        let [factor, low, high] = found[7].factor.unwrap();
        assert!(found[7].differs && found[..7].iter().all(|of| !of.differs), "{found:?}");
        assert!((found[7].others, found[7].difference[0]) == (15.0, 45.0), "{:?}", found[7]);
        assert!((3.6..3.95).contains(&low) && factor == 4.0 && (4.05..4.4).contains(&high));
        let [_, low, high] = found[7].difference;
        assert!(40.0 < low && low < 44.0 && 46.0 < high && high < 50.0, "{low} to {high}");
        let mirrored: Vec<(f64, f64)> = values
            .iter()
            .enumerate()
            .map(|(at, of)| (if at % 2 == 0 { of.0 } else { -of.0 }, of.1))
            .collect();
        let found = distances(&mirrored, FLEET_SIGNIFICANCE);
        assert!(found.iter().all(|of| of.factor.is_none()), "{found:?}");
        assert!(distances(&values[5..], FLEET_SIGNIFICANCE).is_empty(), "three joints");
    }
}
