//! The figures of a grading, beside their goals.

use crate::drift::{ADAPTIVE, ANEW, ARMS, Drift, FIXED, MomentGrade, OBSERVER, OFF, SteadyGrade};
use crate::lies::{Lie, LieGrade};

/// A row of the summary: what, number of courses, figure, goal.
pub type Row = [String; 4];

/// Returns the value below which this share of the finite values lies; NaN without any.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let at = (share * values.len() as f64).ceil() as usize;
    values.get(at.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

fn row(what: String, count: usize, figure: String, goal: &str) -> Row {
    [what, count.to_string(), figure, goal.to_owned()]
}

/// Returns the rows of the drifts.
pub fn drift_rows(grades: &[MomentGrade]) -> Vec<Row> {
    let mut rows = Vec::new();
    let parts = Drift::ALL.map(|drift| (drift.name(), Some(drift)));
    for (name, drift) in parts.into_iter().chain([("all drifts", None)]) {
        let of_drift: Vec<&MomentGrade> =
            grades.iter().filter(|grade| drift.is_none_or(|drift| grade.drift == drift)).collect();
        for arm in [OFF, FIXED, OBSERVER, ADAPTIVE] {
            let ratio = || of_drift.iter().map(|grade| grade.rms_rad[arm] / grade.rms_rad[ANEW]);
            let goals = if arm == ADAPTIVE { ["≤ 1.2", "≤ 1.5"] } else { ["", ""] };
            for ((text, share), goal) in [("median", 0.5), ("95 %", 0.95)].into_iter().zip(goals) {
                let what = format!("{name}: {} / {}, {text}", ARMS[arm], ARMS[ANEW]);
                rows.push(row(
                    what,
                    of_drift.len(),
                    format!("{:.2}", quantile(ratio(), share)),
                    goal,
                ));
            }
        }
    }
    rows
}

/// Returns the rows of the joints that do not change.
pub fn steady_rows(grades: &[SteadyGrade]) -> Vec<Row> {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let most = |of: fn(&SteadyGrade) -> f64| grades.iter().map(of).fold(0.0, f64::max);
    let figures = [
        (
            "error of the level, median",
            percent(quantile(grades.iter().map(|grade| grade.level_error), 0.5)),
            "",
        ),
        ("error of the level, largest", percent(most(|grade| grade.level_error)), "3 %"),
        (
            "adaptive / fixed, largest of a joint",
            format!("{:.3}", most(|grade| grade.ratio)),
            "≤ 1.02",
        ),
        (
            "adaptive / fixed, largest of ten minutes",
            format!("{:.3}", most(|grade| grade.worst_ratio)),
            "≤ 1.02",
        ),
    ];
    let named = |(what, figure, goal): (&str, String, &str)| {
        row(format!("nothing changes: {what}"), grades.len(), figure, goal)
    };
    figures.into_iter().map(named).collect()
}

/// Returns the rows of the courses that lie.
pub fn lie_rows(grades: &[LieGrade]) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut push = |what: &str, figure: String, goal: &str| {
        rows.push(row(format!("lying inputs: {what}"), grades.len(), figure, goal));
    };
    let beyond = grades.iter().filter(|grade| grade.torque_share > 1.000_001).count();
    push("torque beyond a bound", beyond.to_string(), "0");
    for (what, has) in [
        ("limit cycles", LieGrade::has_limit_cycle as fn(&LieGrade, usize) -> bool),
        ("stopped by a following error, unlike off", LieGrade::stops_by),
    ] {
        let count = |arm: usize| grades.iter().filter(|grade| has(grade, arm)).count().to_string();
        push(what, count(ADAPTIVE), "0");
        push("the same with the tuned set", count(FIXED), "");
    }
    let both = grades.iter().filter(|grade| grade.is_stopped == [true; 3]).count();
    push("stopped in every arm", both.to_string(), "");
    // A course with a stop is a runaway or a blocked joint: its error is that of the stop, and no tracking.
    let all: Vec<&LieGrade> = grades.iter().collect();
    let grades: Vec<&LieGrade> =
        grades.iter().filter(|grade| !grade.is_stopped.contains(&true)).collect();
    let mut push = |what: &str, figure: String, goal: &str| {
        rows.push(row(format!("lying inputs without a stop: {what}"), grades.len(), figure, goal));
    };
    let worse = grades.iter().filter(|grade| grade.ratio() > 1.05).count();
    push("worse than off by more than 5 %", worse.to_string(), "0");
    let fixed =
        grades.iter().filter(|grade| grade.rms_rad[FIXED] / grade.rms_rad[OFF] > 1.05).count();
    push("the same with the tuned set", fixed.to_string(), "");
    let ratio = || grades.iter().map(|grade| grade.ratio());
    push("adaptive / off, median", format!("{:.2}", quantile(ratio(), 0.5)), "");
    push("adaptive / off, largest", format!("{:.2}", quantile(ratio(), 1.0)), "≤ 1.05");
    let by_fixed = || grades.iter().map(|grade| grade.rms_rad[ADAPTIVE] / grade.rms_rad[FIXED]);
    push("adaptive / fixed, median", format!("{:.2}", quantile(by_fixed(), 0.5)), "");
    push("adaptive / fixed, 99 %", format!("{:.2}", quantile(by_fixed(), 0.99)), "");
    for lie in Lie::ALL {
        let of_lie = || grades.iter().filter(|grade| grade.lies[0] == lie);
        let largest = quantile(of_lie().map(|grade| grade.ratio()), 1.0);
        let stops = all.iter().filter(|grade| grade.lies[0] == lie).count() - of_lie().count();
        let what = format!("{}: adaptive / off, largest ({stops} with a stop)", lie.name());
        rows.push(row(what, of_lie().count(), format!("{largest:.2}"), "≤ 1.05"));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantile_ignores_what_is_not_finite() {
        assert_eq!(quantile([3.0, f64::NAN, 1.0], 0.5), 1.0);
        assert_eq!(quantile([3.0, f64::NAN, 1.0], 1.0), 3.0);
        assert!(quantile([f64::NAN], 0.5).is_nan());
    }
}
