//! The figures of a grading, beside their goals.

use super::{FaultGrade, GainInterval, Grade, RivalRatio, Start};

/// A row of the summary: what, number of joints, figure, goal.
pub type Row = [String; 4];

/// Returns the median of finite values; NaN without any.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        even if even % 2 == 0 => 0.5 * (values[middle - 1] + values[middle]),
        _ => values[middle],
    }
}

fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { "\u{2013}".to_owned() }
}

/// Returns the rows of the summary.
pub fn rows(grades: &[Grade], faults: &[FaultGrade]) -> Vec<Row> {
    let part = |hidden: bool, start: Start| -> Vec<&Grade> {
        let is =
            |grade: &&Grade| grade.case.hidden.is_some() == hidden && grade.case.start == start;
        grades.iter().filter(is).collect()
    };
    let mut all = Vec::new();
    for (name, of_part, goals) in [
        (
            "hidden effect, as commissioned",
            part(true, Start::Commissioned),
            ["60 %", "40 %", "20 %"],
        ),
        ("hidden effect that appeared after tuning", part(true, Start::TunedBefore), ["", "", ""]),
    ] {
        all.extend(part_rows(name, &of_part, goals));
    }
    let clean = part(false, Start::TunedBefore);
    let count = clean.len();
    let unchanged = clean.iter().filter(|grade| !grade.is_saved).count();
    let worse = clean.iter().filter(|grade| grade.is_worse()).count();
    let mut push = |what: &str, joints: usize, figure: String, goal: &str| {
        all.push([what.to_owned(), joints.to_string(), figure, goal.to_owned()]);
    };
    push("clean and tuned: nothing changed", count, unchanged.to_string(), "90 %");
    push("clean and tuned: worse afterwards", count, worse.to_string(), "0");
    let safe =
        faults.iter().filter(|grade| grade.is_noticed && grade.is_safe && grade.is_former).count();
    push("fault in the middle: safe, former set", faults.len(), safe.to_string(), "all");
    all
}

fn part_rows(name: &str, grades: &[&Grade], [reversal, rms, ahead]: [&str; 3]) -> Vec<Row> {
    let saved = grades.iter().filter(|grade| grade.is_saved);
    let worse = grades.iter().filter(|grade| grade.is_worse()).count();
    let gain = |of: fn(&Grade) -> GainInterval| median(grades.iter().map(|grade| of(grade).gain));
    let lead = |of: fn(&RivalRatio) -> f64| {
        let ratios = grades.iter().filter_map(|grade| grade.rival_ratio.as_ref());
        1.0 - 1.0 / median(ratios.map(of))
    };
    let named = grades.iter().filter(|grade| grade.is_named()).count();
    let figures = [
        ("new set saved", saved.count().to_string(), ""),
        (
            "error at reversals less, median",
            percent(gain(|grade| grade.true_gains.reversal)),
            reversal,
        ),
        ("tracking error less, median", percent(gain(|grade| grade.true_gains.rms)), rms),
        ("worse than before", worse.to_string(), "0"),
        (
            "error at reversals less than with a table over speed, median",
            percent(lead(|ratio| ratio.by_truth.reversal)),
            ahead,
        ),
        (
            "the same by the encoder's position",
            percent(lead(|ratio| ratio.by_encoder.reversal)),
            "",
        ),
        (
            "tracking error less than with a table over speed, median",
            percent(lead(|ratio| ratio.by_truth.rms)),
            "",
        ),
        ("the same by the encoder's position", percent(lead(|ratio| ratio.by_encoder.rms)), ""),
        ("hidden effect named first", named.to_string(), ""),
    ];
    let row = |(what, figure, goal): (&str, String, &str)| {
        [format!("{name}: {what}"), grades.len().to_string(), figure, goal.to_owned()]
    };
    figures.into_iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_ignores_what_is_not_finite() {
        assert_eq!(median([3.0, f64::NAN, 1.0]), 2.0);
        assert!(median([f64::NAN]).is_nan());
    }
}
