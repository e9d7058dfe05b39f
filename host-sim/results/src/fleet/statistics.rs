//! Trends over campaigns.
//!
//! A *trend* is a straight line through the levels of one joint under one law. Its interval comes from the scatter
//! around the line, because the standard error of a single fit leaves out what changes from campaign to campaign:
//! temperature, motion, mounting. The test is two-sided, and its significance is divided by the number of tests in the
//! fleet (Bonferroni), so that a thousand healthy joints do not give fifty trends.

use super::{FleetRow, LEVELS, Level};
use joint_log::statistics::median_of_sorted;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;

/// Probability of reporting any trend in a fleet without trends.
pub const FLEET_SIGNIFICANCE: f64 = 0.05;

/// Minimum number of campaigns of a trend: two for the line, and two to estimate the scatter around it.
pub const MIN_CAMPAIGNS: usize = 4;

/// Unit of the time between campaigns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CampaignUnit {
    /// The names of all campaigns are dates.
    Day,
    /// The campaigns are counted in the order of their names.
    Campaign,
}

impl CampaignUnit {
    /// Returns the unit in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Day => "day",
            Self::Campaign => "campaign",
        }
    }
}

/// Level above which a joint needs service.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// Name of the level, one of [`LEVELS`].
    pub level: String,
    /// The limit, in the unit of the level.
    pub value: f64,
}

/// Law of the levels of a joint, with its name in a sentence.
pub(super) struct LevelLaw {
    pub name: &'static str,
    pub levels: fn(&FleetRow) -> &[Option<Level>; LEVELS.len()],
}

impl LevelLaw {
    /// Returns the law of a joint's trend and limit: the one that determines the level in more logs, or the fixed model. Values
    /// of two laws are not comparable.
    pub fn of(rows: &[&FleetRow], level: usize) -> Self {
        let fixed = Self { name: "the fixed model", levels: |row| &row.levels };
        let linear = Self { name: "the linear law", levels: |row| &row.linear_levels };
        let count =
            |law: &Self| rows.iter().filter(|row| (law.levels)(row)[level].is_some()).count();
        if count(&linear) > count(&fixed) { linear } else { fixed }
    }
}

/// Trend of a level of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Trend {
    /// Name of the joint.
    pub joint: String,
    /// Index of the level in [`LEVELS`].
    pub level: usize,
    /// Law of the levels, in a sentence.
    pub law: &'static str,
    /// Times of the campaigns, in `unit`, from 0.
    pub times: Vec<f64>,
    /// Levels at these times.
    pub values: Vec<f64>,
    /// Unit of the times.
    pub unit: CampaignUnit,
    /// Change per unit of time.
    pub slope: f64,
    /// Ends of the slope's 95 % interval.
    pub slope_ci95: [f64; 2],
    /// Level of the line at the last campaign.
    pub now: f64,
    /// Probability of a slope of this size without a trend.
    pub p_value: f64,
    /// True if the trend is significant in the whole fleet.
    pub is_significant: bool,
    /// Time from the last campaign until the limit is crossed, with the ends of its 95 % interval, in `unit`. `None` without a
    /// limit, or if the level moves away from it. An end is infinite if the interval of the slope contains 0.
    pub until_limit: Option<[f64; 3]>,
}

/// Returns the trends of all joints with enough campaigns, most significant first.
pub fn trends(rows: &[FleetRow], limits: &[Limit]) -> Vec<Trend> {
    let (times, unit) = campaign_times(rows);
    let mut by_joint: BTreeMap<(&str, &str, &str), Vec<&FleetRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.is_ok()) {
        by_joint.entry((&row.joint, &row.fixed_model, &row.unit)).or_default().push(row);
    }
    let mut trends = Vec::new();
    for ((joint, ..), of_joint) in &by_joint {
        for (level, name) in LEVELS.iter().enumerate() {
            let law = LevelLaw::of(of_joint, level);
            let point = |row: &&FleetRow| {
                Some((*times.get(row.campaign.as_str())?, (law.levels)(row)[level]?.value))
            };
            let mut points: Vec<(f64, f64)> = of_joint.iter().filter_map(point).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let limit = limits.iter().find(|limit| limit.level == *name);
            trends.extend(trend(joint, level, law.name, &points, unit, limit));
        }
    }
    let significance = FLEET_SIGNIFICANCE / trends.len().max(1) as f64;
    trends.iter_mut().for_each(|trend| trend.is_significant = trend.p_value < significance);
    trends.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    trends
}

/// Returns the median; of no values NaN.
pub(super) fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    median_of_sorted(&sorted)
}

/// Fits a line to points that are sorted by time; `None` if there are too few.
fn trend(
    joint: &str,
    level: usize,
    law: &'static str,
    points: &[(f64, f64)],
    unit: CampaignUnit,
    limit: Option<&Limit>,
) -> Option<Trend> {
    if points.len() < MIN_CAMPAIGNS {
        return None;
    }
    let count = points.len() as f64;
    let (times, values): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    let mean = |of: &[f64]| of.iter().sum::<f64>() / count;
    let (middle, level_mean) = (mean(&times), mean(&values));
    let spread: f64 = times.iter().map(|time| (time - middle).powi(2)).sum();
    if spread <= 0.0 {
        return None;
    }
    let products = points.iter().map(|(time, value)| (time - middle) * (value - level_mean));
    let slope = products.sum::<f64>() / spread;
    let line = |time: f64| level_mean + slope * (time - middle);
    let squares: f64 = points.iter().map(|(time, value)| (value - line(*time)).powi(2)).sum();
    let freedom = count - 2.0;
    let error = (squares / freedom / spread).sqrt();
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    let p_value = match error > 0.0 {
        true => 2.0 * student.cdf(-(slope / error).abs()),
        // Points exactly on a line: a trend unless the line is level.
        false => f64::from(u8::from(slope == 0.0)),
    };
    let half = student.inverse_cdf(0.975) * error;
    let now = line(times[times.len() - 1]);
    let slope_ci95 = [slope - half, slope + half];
    let until_limit = limit.and_then(|limit| until(limit.value - now, slope, slope_ci95));
    Some(Trend {
        joint: joint.to_owned(),
        level,
        law,
        times,
        values,
        unit,
        slope,
        slope_ci95,
        now,
        p_value,
        is_significant: false,
        until_limit,
    })
}

/// Returns the time until a distance is covered, and the ends of its interval.
fn until(distance: f64, slope: f64, [low, high]: [f64; 2]) -> Option<[f64; 3]> {
    if distance <= 0.0 {
        return Some([0.0; 3]);
    }
    let time = |slope: f64| if slope > 0.0 { distance / slope } else { f64::INFINITY };
    (slope > 0.0).then(|| [time(slope), time(high), time(low)])
}

/// Returns the time of each campaign from the first one: in days if all names are dates, otherwise by the order of the names.
pub fn campaign_times(rows: &[FleetRow]) -> (BTreeMap<&str, f64>, CampaignUnit) {
    // A failed log may lie outside of the folders of campaigns.
    let good = rows.iter().filter(|row| row.is_ok());
    let mut names: Vec<&str> = good.map(|row| row.campaign.as_str()).collect();
    names.sort_by(|a, b| natural_key(a).cmp(&natural_key(b)).then(a.cmp(b)));
    names.dedup();
    let days: Option<Vec<f64>> = names.iter().map(|name| parse_day(name)).collect();
    match days {
        Some(days) if !days.is_empty() => {
            let first = days.iter().copied().fold(f64::INFINITY, f64::min);
            let times = days.into_iter().map(|day| day - first);
            (names.iter().copied().zip(times).collect(), CampaignUnit::Day)
        }
        _ => {
            let times = names.iter().enumerate().map(|(at, name)| (*name, at as f64));
            (times.collect(), CampaignUnit::Campaign)
        }
    }
}

/// Splits a name into texts and numbers, so that `dive 10` comes after `dive 9`.
pub(super) fn natural_key(name: &str) -> Vec<(String, u64)> {
    let mut parts = vec![(String::new(), 0u64)];
    let mut was_digit = false;
    for letter in name.chars() {
        let digit = letter.to_digit(10);
        if digit.is_none() && was_digit {
            parts.push((String::new(), 0));
        }
        was_digit = digit.is_some();
        if let Some((text, number)) = parts.last_mut() {
            match digit {
                Some(digit) => *number = number.saturating_mul(10).saturating_add(digit.into()),
                None => text.push(letter),
            }
        }
    }
    parts
}

/// Days since 1970 of the dates that name campaigns. A number beyond them, such as a serial number, is no date.
const CAMPAIGN_DAYS: std::ops::RangeInclusive<i64> = 0..=84_370;

/// Returns the days since 1970 of a campaign that is named by its date.
fn parse_day(name: &str) -> Option<f64> {
    joint_log::day_number(name).filter(|day| CAMPAIGN_DAYS.contains(day)).map(|day| day as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    fn row(joint: &str, campaign: String, coulomb: f64) -> FleetRow {
        let level = Level { value: coulomb, std_error: 1e-4 };
        FleetRow {
            joint: joint.into(),
            campaign,
            unit: "Nm".into(),
            fixed_model: "lugre".into(),
            levels: [Some(level), None, None],
            ..FleetRow::default()
        }
    }

    #[test]
    fn trends_of_wear_of_one_percent_are_found() {
        let mut noise = noise(3);
        let rows: Vec<FleetRow> = (0..20)
            .map(|at| {
                let level = 1.5 * (1.0 + 0.01 * f64::from(at)) + 0.02 * noise();
                row("a", format!("dive {}", at + 1), level)
            })
            .collect();
        let limit = Limit { level: "coulomb_torque".into(), value: 2.4 };
        let found = trends(&rows, &[limit]);
        assert_eq!(found.len(), 1);
        let [low, high] = found[0].slope_ci95;
        assert!(found[0].is_significant && low < 0.015 && 0.015 < high, "{found:?}");
        assert_eq!(found[0].unit, CampaignUnit::Campaign);
        let [time, soonest, latest] = found[0].until_limit.unwrap();
        assert!(soonest < time && time < latest && (30.0..60.0).contains(&time), "{found:?}");
    }

    #[test]
    fn trends_of_many_healthy_joints_are_not_significant() {
        let mut noise = noise(5);
        let rows: Vec<FleetRow> = (0..200)
            .flat_map(|joint| (0..20).map(move |at| (joint, at)))
            .map(|(joint, at)| row(&format!("{joint}"), format!("{at:02}"), 1.5 + 0.02 * noise()))
            .collect();
        let found = trends(&rows, &[]);
        assert_eq!(found.len(), 200);
        assert!(found.iter().filter(|trend| trend.p_value < 0.05).count() > 2, "a weak test");
        assert!(found.iter().all(|trend| !trend.is_significant), "{:?}", found[0]);
    }

    #[test]
    fn campaign_times_with_dates_are_days() {
        let names = ["2024-02-28", "2024-03-01", "2025-03-01"];
        let rows = names.map(|name| row("a", name.to_owned(), 1.0));
        let (times, unit) = campaign_times(&rows);
        assert_eq!(unit, CampaignUnit::Day);
        assert_eq!(names.map(|name| times[name]), [0.0, 2.0, 367.0]);
        let rows = ["dive 10", "dive 9"].map(|name| row("a", name.to_owned(), 1.0));
        let (times, unit) = campaign_times(&rows);
        assert_eq!((times["dive 9"], times["dive 10"], unit), (0.0, 1.0, CampaignUnit::Campaign));
        assert_eq!(parse_day("1970-01-02"), Some(1.0));
        assert_eq!(parse_day("12345678"), None);
    }
}
