//! The figures of a grading, beside their goals.

use super::{Case, FaultGrade, GainInterval, Grade, RivalRatio, Start};

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

/// Joints of one kind.
struct Part {
    name: &'static str,
    has_hidden_effect: bool,
    start: Start,
}

const COMMISSIONED: Part = Part {
    name: "hidden effect, as commissioned",
    has_hidden_effect: true,
    start: Start::Commissioned,
};

const APPEARED: Part = Part {
    name: "hidden effect that appeared after tuning",
    has_hidden_effect: true,
    start: Start::TunedBefore,
};

const CLEAN: Part =
    Part { name: "clean and tuned", has_hidden_effect: false, start: Start::TunedBefore };

impl Part {
    fn contains(&self, case: &Case) -> bool {
        case.hidden.is_some() == self.has_hidden_effect && case.start == self.start
    }

    fn grades<'a>(&self, grades: &'a [Grade]) -> Vec<&'a Grade> {
        grades.iter().filter(|grade| self.contains(&grade.case)).collect()
    }

    /// Returns how many of the requested joints have no grade.
    fn not_graded(&self, requested: &[Case], grades: &[Grade]) -> Row {
        let count = requested.iter().filter(|case| self.contains(case)).count();
        not_graded(self.name, count, self.grades(grades).len())
    }
}

fn count_row(what: String, joints: usize, count: usize, goal: &str) -> Row {
    [what, joints.to_string(), count.to_string(), goal.to_owned()]
}

fn not_graded(part: &str, requested: usize, graded: usize) -> Row {
    count_row(format!("{part}: not graded"), requested, requested - graded, "")
}

/// Returns the rows of the summary. A requested joint without a grade counts as not graded, and in no other row.
pub fn rows(
    requested: &[Case],
    grades: &[Grade],
    requested_faults: usize,
    faults: &[FaultGrade],
) -> Vec<Row> {
    let mut all = Vec::new();
    for (part, goals) in [(COMMISSIONED, ["60 %", "40 %", "20 %"]), (APPEARED, ["", "", ""])] {
        all.extend(part_rows(part.name, &part.grades(grades), goals));
        all.push(part.not_graded(requested, grades));
    }
    let clean = CLEAN.grades(grades);
    let unchanged = clean.iter().filter(|grade| !grade.is_saved).count();
    let worse = clean.iter().filter(|grade| grade.is_worse()).count();
    let safe =
        faults.iter().filter(|grade| grade.is_noticed && grade.is_safe && grade.is_former).count();
    let fault = "fault in the middle";
    all.extend([
        count_row(format!("{}: nothing changed", CLEAN.name), clean.len(), unchanged, "90 %"),
        count_row(format!("{}: worse afterwards", CLEAN.name), clean.len(), worse, "0"),
        CLEAN.not_graded(requested, grades),
        count_row(format!("{fault}: safe, former set"), faults.len(), safe, "all"),
        not_graded(fault, requested_faults, faults.len()),
    ]);
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
    fn rows_with_joints_that_have_no_grade_count_them() {
        let case = |seed: u64, hidden| Case { seed, hidden, start: Start::TunedBefore };
        let requested = [case(1, None), case(2, None), case(3, Some("warm-up"))];
        let grade = Grade {
            case: requested[0].clone(),
            family: "Iwan",
            is_saved: false,
            why_not: String::new(),
            cause: "none".to_owned(),
            probability: 0.0,
            claimed: [GainInterval::default(); 2].into(),
            true_gains: [GainInterval::default(); 2].into(),
            former_errors_rad: [0.0; 2].into(),
            final_errors_rad: [0.0; 2].into(),
            rival_ratio: None,
            seconds: 0.0,
        };
        let rows = rows(&requested, &[grade], 4, &[]);
        let figures = |what: &str| {
            let row = rows.iter().find(|row| row[0] == what).unwrap();
            [row[1].as_str(), row[2].as_str()]
        };
        assert_eq!(figures("clean and tuned: nothing changed"), ["1", "1"]);
        assert_eq!(figures("clean and tuned: not graded"), ["2", "1"]);
        assert_eq!(figures("hidden effect that appeared after tuning: not graded"), ["1", "1"]);
        assert_eq!(figures("hidden effect, as commissioned: not graded"), ["0", "0"]);
        assert_eq!(figures("fault in the middle: not graded"), ["4", "4"]);
    }

    #[test]
    fn median_ignores_what_is_not_finite() {
        assert_eq!(median([3.0, f64::NAN, 1.0]), 2.0);
        assert!(median([f64::NAN]).is_nan());
    }
}
