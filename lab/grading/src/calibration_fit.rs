//! Fit of a calibration to cases with known truth: boosted trees, then an isotonic step.
//!
//! A fit without a part of the cases gives the log odds of that part; the isotonic step is fitted to these, so that it corrects
//! what the trees promise too much.

pub use crate::boosting::Case;
use crate::boosting::boost;
use friction_diagnose::contest_calibration::ContestCalibration;
use rayon::prelude::*;

/// Fewest cases in a step of the isotonic regression, by weight.
const MIN_STEP_CASES: f64 = 15.0;

/// Returns the log odds of each case by a fit without the cases of its fold.
pub fn out_of_fold(cases: &[Case]) -> Vec<f64> {
    let folds = cases.iter().map(|case| case.fold + 1).max().unwrap_or(0);
    let without = |fold: usize| {
        let seen: Vec<&Case> = cases.iter().filter(|case| case.fold != fold).collect();
        let is_needed = seen.len() < cases.len();
        is_needed.then(|| boost(&seen))
    };
    let models: Vec<Option<ContestCalibration>> = (0..folds).into_par_iter().map(without).collect();
    let odds = |case: &Case| {
        let model = models[case.fold].as_ref();
        model.map_or(0.0, |model| model.log_odds(&case.cause, &case.follows, &case.figures))
    };
    cases.iter().map(odds).collect()
}

/// Fits trees and isotonic step. `odds` are those of [`out_of_fold`] for the same cases.
pub fn fit(name: String, cases: &[Case], odds: &[f64]) -> ContestCalibration {
    let model = boost(&cases.iter().collect::<Vec<_>>());
    ContestCalibration { name, steps: isotonic(cases, odds, |_| true), ..model }
}

/// Returns the calibrated probability of each case, by trees and an isotonic step that have not seen its fold.
///
/// `odds` are those of [`out_of_fold`] for the same cases.
pub fn probabilities_out_of_fold(cases: &[Case], odds: &[f64]) -> Vec<f64> {
    let folds = cases.iter().map(|case| case.fold + 1).max().unwrap_or(0);
    let mut probabilities = vec![0.0; cases.len()];
    for fold in 0..folds {
        let steps = isotonic(cases, odds, |case| case.fold != fold);
        let step = ContestCalibration { steps, ..ContestCalibration::default() };
        let in_fold = (0..cases.len()).filter(|at| cases[*at].fold == fold);
        in_fold.for_each(|at| probabilities[at] = step.calibrated(odds[at]));
    }
    probabilities
}

/// Returns the isotonic regression of cases: log odds and frequency of each step.
///
/// The frequency of a step counts one more real and one more unreal case (Laplace), so that no step is certain. A case counts
/// at most once, whatever its weight, because few cases of large weight would make a step by themselves.
fn isotonic(cases: &[Case], odds: &[f64], is_meant: impl Fn(&Case) -> bool) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(f64, &Case)> =
        odds.iter().copied().zip(cases).filter(|(_, case)| is_meant(case)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    struct Step {
        odds: f64,
        real: f64,
        count: f64,
    }
    let mut steps: Vec<Step> = Vec::new();
    for (odds, case) in sorted {
        let count = case.weight.min(1.0);
        let real = if case.is_real { count } else { 0.0 };
        steps.push(Step { odds, real, count });
        while let [.., before, last] = steps.as_slice() {
            let is_small = before.count < MIN_STEP_CASES;
            if !is_small && before.real / before.count < last.real / last.count {
                break;
            }
            let count = before.count + last.count;
            let odds = (before.odds * before.count + last.odds * last.count) / count;
            let merged = Step { odds, real: before.real + last.real, count };
            steps.truncate(steps.len() - 2);
            steps.push(merged);
        }
    }
    let mut points: Vec<(f64, f64)> =
        steps.iter().map(|step| (step.odds, (step.real + 1.0) / (step.count + 2.0))).collect();
    // The Laplace correction of a small step may break the order.
    for at in 1..points.len() {
        points[at].1 = points[at].1.max(points[at - 1].1);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_diagnose::contest_calibration::FIGURES;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Cases whose log odds are twice the first figure, minus one; the second figure says nothing.
    fn cases(count: usize) -> Vec<Case> {
        let mut random = Pcg64::seed_from_u64(5);
        let case = |at: usize| {
            let mut figures = vec![0.0; FIGURES.len()];
            figures[0] = 4.0 * random.random::<f64>() - 2.0;
            figures[1] = 4.0 * random.random::<f64>() - 2.0;
            let odds = 2.0 * figures[0] - 1.0;
            let is_real = random.random::<f64>() < 1.0 / (1.0 + (-odds).exp());
            let cause = ["backlash", "pressure-coulomb"][at % 2].to_owned();
            Case { cause, follows: String::new(), figures, is_real, weight: 1.0, fold: at % 5 }
        };
        (0..count).map(case).collect()
    }

    #[test]
    fn fit_of_known_odds_is_calibrated_on_cases_it_has_not_seen() {
        let cases = cases(4000);
        let odds = out_of_fold(&cases);
        let probabilities = probabilities_out_of_fold(&cases, &odds);
        for (low, high) in [(0.05, 0.2), (0.4, 0.6), (0.8, 0.95)] {
            let in_bin: Vec<(&Case, &f64)> = cases
                .iter()
                .zip(&probabilities)
                .filter(|(_, p)| (low..high).contains(*p))
                .collect();
            let real = in_bin.iter().filter(|(case, _)| case.is_real).count() as f64;
            let mean = in_bin.iter().map(|(_, p)| **p).sum::<f64>() / in_bin.len() as f64;
            assert!(in_bin.len() > 100, "{} cases from {low} to {high}", in_bin.len());
            assert!(
                (real / in_bin.len() as f64 - mean).abs() < 0.06,
                "{low} to {high}: {real} of {}",
                in_bin.len()
            );
        }
    }

    #[test]
    fn fit_of_a_figure_that_speaks_against_does_not_use_it() {
        let mut cases = cases(1000);
        cases.iter_mut().for_each(|case| case.figures[1] = -f64::from(u8::from(case.is_real)));
        let model = fit("test".into(), &cases, &out_of_fold(&cases));
        let mut figures = vec![0.0; FIGURES.len()];
        let without = model.log_odds("backlash", "", &figures);
        figures[1] = -1.0;
        assert!(model.log_odds("backlash", "", &figures) <= without);
    }
}
