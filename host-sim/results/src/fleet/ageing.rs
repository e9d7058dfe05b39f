//! Which joint's seal ages: the trends of learnt levels that joints keep (`params trend --write`).
//!
//! The slope of a joint's level over the time of learning is robust ([`robust_slope`]). A joint is named if all of this holds:
//! * The slope is significant in the whole fleet, by a level of significance divided by the number of joints (Bonferroni).
//! * It differs from the median slope of the other joints: a lubricant, a season or a load case changes all of them. With at
//!   least [`MIN_JOINTS`] joints the distance is measured in their scatter, by the median absolute deviation, and the
//!   slope's own error. With fewer, the scatter is unknown, and the interval of the slope must exclude the median.
//! * The level has changed by [`MIN_CHANGE`]: the drivers do not follow smaller changes reliably.

use super::FleetError;
use super::comparison::HALF_WIDTH_95;
use super::jobs::find_trends;
use super::statistics::{FLEET_SIGNIFICANCE, middle, natural_key};
use crate::level_trend::{LevelTrend, RobustSlope, robust_slope};
use joint_log::number::significant;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Least change of a level that is called ageing, as a share of the level at the first entry.
pub const MIN_CHANGE: f64 = 0.05;

/// Modified z-score above which a slope stands out (Iglewicz and Hoaglin, 1993).
const OUTLIER_SCORE: f64 = 3.5;

/// Minimum number of joints for a scatter. The median absolute deviation of fewer is too uncertain.
const MIN_JOINTS: usize = 8;

/// Median absolute deviation of a normal distribution, in standard deviations.
const NORMAL_MAD: f64 = 0.6745;

/// Trend of the learnt level of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ageing {
    /// Name of the joint.
    pub joint: String,
    /// Unit of the level.
    pub unit: String,
    /// File of the trend.
    pub file: String,
    /// Number of entries.
    pub entries: usize,
    /// Time of learning from the first to the last entry, h.
    pub learnt_h: f64,
    /// Level of the line at the last entry; `None` with too few entries, as all that follow.
    pub level: Option<f64>,
    /// Change of the level from the first to the last entry, as a share of the first.
    pub change: Option<f64>,
    /// Change per 100 h of learning, as a share of the first level.
    pub change_per_100h: Option<f64>,
    /// Ends of its 95 % interval.
    pub change_per_100h_ci95: Option<[f64; 2]>,
    /// Probability of a change of this size without ageing.
    pub p_value: Option<f64>,
    /// What the joint's seal does, if it ages; `None` if it does not, or if the trend does not show it.
    pub ageing: Option<String>,
    /// Times in h and levels of the entries.
    #[serde(skip)]
    pub points: Vec<(f64, f64)>,
}

/// Reads the trends below some folders, and returns one result for each joint: first those that age, then by their change.
///
/// # Errors
/// One line that names the file, if it is not the trend of a joint, or if a joint has two.
pub fn read_ageing(roots: &[&Path], out: &Path) -> Result<Vec<Ageing>, FleetError> {
    let mut trends: Vec<JointTrend> = Vec::new();
    let found = roots.iter().map(|root| find_trends(root, out)).collect::<Result<Vec<_>, _>>()?;
    for (joint, file) in found.concat() {
        if let Some(first) = trends.iter().find(|known| known.joint == joint) {
            return Err(FleetError::SecondTrend { file, joint, first: first.file.clone() });
        }
        let trend = LevelTrend::read(&file)?;
        trends.push(JointTrend { joint, file, trend });
    }
    Ok(ageing(&trends))
}

/// Trend of a joint with the file that it was read from.
struct JointTrend {
    joint: String,
    file: PathBuf,
    trend: LevelTrend,
}

/// Returns the results of joints.
fn ageing(trends: &[JointTrend]) -> Vec<Ageing> {
    let fits = |confidence: f64| -> Vec<Option<RobustSlope>> {
        let points = trends.iter().map(|joint| joint.trend.points());
        points.map(|points| robust_slope(&points, confidence)).collect()
    };
    let shown = fits(0.95);
    let tests = shown.iter().flatten().count().max(1) as f64;
    let tested = fits(1.0 - FLEET_SIGNIFICANCE / tests);
    let relative = |fit: &Option<RobustSlope>| fit.as_ref().map(RobustSlope::relative);
    let slopes: Vec<Option<RobustSlope>> = tested.iter().map(relative).collect();
    let each = trends.iter().zip(&shown).enumerate().map(|(at, (joint, shown))| {
        let is_ageing = shown.as_ref().is_some_and(|shown| {
            let [low, high] = shown.relative().interval;
            let std_error = (high - low) / (2.0 * HALF_WIDTH_95);
            stands_out(&slopes, at, std_error, FLEET_SIGNIFICANCE / tests)
        });
        result(joint, shown.as_ref(), is_ageing)
    });
    let mut all: Vec<Ageing> = each.collect();
    all.sort_by(|a, b| {
        let size = |of: &Ageing| of.change_per_100h.unwrap_or(f64::NEG_INFINITY);
        let order = (a.ageing.is_none()).cmp(&b.ageing.is_none());
        let names = || natural_key(&a.joint).cmp(&natural_key(&b.joint));
        order.then(size(b).total_cmp(&size(a))).then_with(names)
    });
    all
}

/// Returns true if the slope of this joint, with its standard error, is significant and differs from those of the others. The
/// slopes are shares of the first levels.
fn stands_out(
    slopes: &[Option<RobustSlope>],
    at: usize,
    std_error: f64,
    significance: f64,
) -> bool {
    let Some(slope) = &slopes[at] else { return false };
    let excludes = |value: f64| value < slope.interval[0] || slope.interval[1] < value;
    if slope.p_value >= significance || !excludes(0.0) {
        return false;
    }
    let others = slopes.iter().enumerate().filter(|(other, _)| *other != at);
    let others: Vec<f64> = others.filter_map(|(_, of)| Some(of.as_ref()?.slope)).collect();
    if others.is_empty() {
        return true;
    }
    let centre = middle(others.iter().copied());
    if others.len() + 1 < MIN_JOINTS {
        return excludes(centre);
    }
    let deviations = others.iter().map(|slope| (slope - centre).abs());
    let scatter = (middle(deviations) / NORMAL_MAD).hypot(std_error);
    (slope.slope - centre).abs() > OUTLIER_SCORE * scatter
}

fn result(joint: &JointTrend, fit: Option<&RobustSlope>, stands_out: bool) -> Ageing {
    let JointTrend { joint, file, trend } = joint;
    let points: Vec<(f64, f64)> =
        trend.entries.iter().map(|entry| (entry.learnt_h, entry.level)).collect();
    let span_h = match (points.first(), points.last()) {
        (Some(first), Some(last)) => last.0 - first.0,
        _ => 0.0,
    };
    let change = fit.map(|fit| fit.last / fit.first - 1.0);
    let is_ageing = stands_out && change.is_some_and(|change| change.abs() >= MIN_CHANGE);
    Ageing {
        joint: joint.clone(),
        unit: trend.unit.clone(),
        file: file.display().to_string(),
        entries: points.len(),
        learnt_h: span_h,
        level: fit.map(|fit| fit.last),
        change,
        change_per_100h: fit.map(|fit| fit.relative().slope),
        change_per_100h_ci95: fit.map(|fit| fit.relative().interval),
        p_value: fit.map(|fit| fit.p_value),
        ageing: change.filter(|_| is_ageing).map(|change| in_words(change, span_h)),
        points,
    }
}

fn in_words(change: f64, span_h: f64) -> String {
    let verb = if change > 0.0 { "rose" } else { "fell" };
    let percent = significant(100.0 * change.abs(), 2);
    format!("the seal's friction {verb} {percent} % over {} h", significant(span_h, 3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level_trend::{LevelEntry, SCHEMA};
    use crate::noise::noise;
    use crate::snapshot;

    /// Returns the trend of a joint over 140 h whose level rises by this share of its first level.
    fn trend(joint: &str, rise: f64, noise: &mut impl FnMut() -> f64) -> JointTrend {
        let level_nm = 4.0 + 0.5 * noise();
        let entry = |at: u32, noise: &mut dyn FnMut() -> f64| LevelEntry {
            learnt_h: 3.5 * f64::from(at),
            level: level_nm * (1.0 + rise * f64::from(at) / 40.0 + 0.02 * noise()),
            level_gain: 1.0,
            viscous_gain: 1.0,
            ..LevelEntry::default()
        };
        let entries = (0..41).map(|at| entry(at, noise)).collect();
        let trend = LevelTrend { schema: SCHEMA, unit: "Nm".into(), entries };
        JointTrend { joint: joint.into(), file: format!("{joint}.trend.json").into(), trend }
    }

    fn fleet(rises: &[f64], seed: u64) -> Vec<Ageing> {
        let mut noise = noise(seed);
        let each = rises.iter().zip(1..);
        ageing(
            &each
                .map(|(rise, at)| trend(&format!("joint {at}"), *rise, &mut noise))
                .collect::<Vec<_>>(),
        )
    }

    fn named(found: &[Ageing]) -> Vec<&str> {
        found.iter().filter(|of| of.ageing.is_some()).map(|of| of.joint.as_str()).collect()
    }

    #[test]
    fn ageing_of_one_joint_among_others_is_named() {
        for count in [1, 3, 10] {
            let mut rises = vec![0.0; count];
            rises[count - 1] = 0.23;
            let found = fleet(&rises, 5);
            let last = format!("joint {count}");
            assert_eq!(named(&found), [last.as_str()], "{count} joints");
            assert_eq!(found[0].joint, last, "it is first");
            let [low, high] = found[0].change_per_100h_ci95.unwrap();
            assert!(low < 0.23 / 1.4 && 0.23 / 1.4 < high, "{low} to {high}");
            let words = found[0].ageing.clone().unwrap();
            assert!(words.contains(" 2") && words.contains(" 140 h"), "{words}");
            snapshot::check("fleet", "friction that rose", &words);
        }
        let fallen = fleet(&[0.0, 0.0, -0.3], 5);
        let words = fallen[0].ageing.as_ref().unwrap();
        snapshot::check("fleet", "friction that fell", words);
    }

    #[test]
    fn ageing_without_an_ageing_joint_names_none() {
        for seed in 1..40 {
            assert_eq!(named(&fleet(&[0.0; 10], seed)), Vec::<&str>::new(), "seed {seed}");
        }
        // All joints change alike, such as with the season: the fleet explains each of them.
        let alike = fleet(&[0.2, 0.21, 0.19, 0.2, 0.22, 0.18, 0.2, 0.19, 0.21, 0.2], 3);
        assert_eq!(named(&alike), Vec::<&str>::new());
        assert!(alike.iter().all(|of| of.p_value.unwrap() < 1e-3), "each alone is significant");
    }

    #[test]
    fn ageing_of_a_fleet_that_scatters_needs_more_than_its_scatter() {
        let mut rises = [0.05, -0.08, 0.12, -0.02, 0.09, -0.11, 0.03, 0.07, -0.06, 0.14];
        assert_eq!(named(&fleet(&rises, 9)), Vec::<&str>::new());
        rises[9] = 0.9;
        assert_eq!(named(&fleet(&rises, 9)), ["joint 10"]);
    }

    #[test]
    fn ageing_with_few_entries_or_a_small_change_is_not_named() {
        let mut short = trend("knee", 0.8, &mut noise(3));
        short.trend.entries.truncate(5);
        let found = ageing(&[short]);
        assert_eq!((found[0].change, found[0].ageing.clone(), found[0].entries), (None, None, 5));
        let mut small = trend("knee", 0.03, &mut noise(3));
        let first = small.trend.entries[0].level;
        small.trend.entries.iter_mut().for_each(|entry| {
            entry.level = first * (1.0 + 0.03 * entry.learnt_h / 140.0);
        });
        let found = ageing(&[small]);
        assert!(found[0].p_value.is_some_and(|p| p < 1e-6) && found[0].ageing.is_none());
    }
}
