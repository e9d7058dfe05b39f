//! Fit of a calibration to cases with known truth.
//!
//! The weights of a group are drawn to the mean over the groups, and the offsets of causes to 0, by ridges. The fit takes Newton
//! steps in one weight at a time, and a negative weight becomes 0. Figures are scaled to a deviation of one, so that the ridges
//! mean the same for all of them.

use super::{ContestCalibration, FIGURES, Group, GroupWeights};

/// Weight of the squared distance of a group's weight from the mean of the groups, in cases.
const GROUP_RIDGE: f64 = 8.0;

/// Weight of the squared mean weight, in cases.
const SHARED_RIDGE: f64 = 1.0;

/// Weight of a cause's squared offset, in cases.
const OFFSET_RIDGE: f64 = 6.0;

/// Sweeps over all weights.
const SWEEPS: usize = 120;

/// Fewest cases in a step of the isotonic regression, by weight.
const MIN_STEP_CASES: f64 = 15.0;

/// A candidate with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// The cause.
    pub cause: String,
    /// The column that it follows, or empty.
    pub follows: String,
    /// Its figures, in the order of [`FIGURES`].
    pub figures: Vec<f64>,
    /// True if the cause is in the log.
    pub is_real: bool,
    /// Weight of the case.
    pub weight: f64,
    /// Part of the cases that is left out at once: a share of the worlds, or a machine.
    pub fold: usize,
}

/// A fit of the weights alone.
#[derive(Clone, Debug)]
struct Fitted(ContestCalibration);

/// Returns the log odds of each case by a fit without the cases of its fold.
pub fn out_of_fold(cases: &[Case]) -> Vec<f64> {
    let folds = cases.iter().map(|case| case.fold + 1).max().unwrap_or(0);
    let mut odds = vec![0.0; cases.len()];
    for fold in 0..folds {
        if cases.iter().all(|case| case.fold != fold) {
            continue;
        }
        let Fitted(model) = Fitted::new(cases.iter().filter(|case| case.fold != fold));
        for (odds, case) in odds.iter_mut().zip(cases).filter(|(_, case)| case.fold == fold) {
            *odds = model.log_odds(&case.cause, &case.follows, &case.figures);
        }
    }
    odds
}

impl ContestCalibration {
    /// Fits weights and isotonic step. `odds` are those of [`out_of_fold`] for the same cases.
    pub fn fit(name: String, cases: &[Case], odds: &[f64]) -> Self {
        let Fitted(model) = Fitted::new(cases.iter());
        Self { name, steps: isotonic(cases, odds, |_| true), ..model }
    }
}

/// Returns the calibrated probability of each case, by weights and an isotonic step that have not seen its fold.
///
/// `odds` are those of [`out_of_fold`] for the same cases.
pub fn probabilities_out_of_fold(cases: &[Case], odds: &[f64]) -> Vec<f64> {
    let folds = cases.iter().map(|case| case.fold + 1).max().unwrap_or(0);
    let mut probabilities = vec![0.0; cases.len()];
    for fold in 0..folds {
        let steps = isotonic(cases, odds, |case| case.fold != fold);
        let step = ContestCalibration { steps, ..ContestCalibration::default() };
        let own = (0..cases.len()).filter(|at| cases[*at].fold == fold);
        own.for_each(|at| probabilities[at] = step.calibrated(odds[at]));
    }
    probabilities
}

impl Fitted {
    fn new<'a>(cases: impl Iterator<Item = &'a Case>) -> Self {
        let cases: Vec<&Case> = cases.collect();
        let scales = deviations(&cases);
        let mut causes: Vec<&str> = cases.iter().map(|case| case.cause.as_str()).collect();
        causes.sort_unstable();
        causes.dedup();
        let mut groups: Vec<Weigher> =
            Group::ALL.iter().map(|group| Weigher::new(*group, &cases, &scales, &causes)).collect();
        let mut mean = vec![0.0; FIGURES.len()];
        for _ in 0..SWEEPS {
            groups.iter_mut().for_each(|group| group.sweep(&mean));
            for (at, mean) in mean.iter_mut().enumerate() {
                let sum: f64 = groups.iter().map(|group| group.weights[at]).sum();
                *mean = GROUP_RIDGE * sum / (GROUP_RIDGE * groups.len() as f64 + SHARED_RIDGE);
            }
        }
        let offset = |at: usize| groups.iter().map(|group| group.offsets[at]).sum();
        let offsets =
            causes.iter().enumerate().map(|(at, cause)| ((*cause).to_owned(), offset(at)));
        let offsets = offsets.collect();
        let weights = |group: &Weigher| GroupWeights {
            intercept: group.intercept,
            weights: group.weights.iter().zip(&scales).map(|(w, scale)| w / scale).collect(),
        };
        let groups = groups.iter().map(weights).collect();
        Self(ContestCalibration { groups, offsets, ..ContestCalibration::default() })
    }
}

/// Returns the weighted deviation of each figure.
fn deviations(cases: &[&Case]) -> Vec<f64> {
    let total: f64 = cases.iter().map(|case| case.weight).sum::<f64>().max(1e-9);
    let mean = |of: &dyn Fn(&Case) -> f64| {
        cases.iter().map(|case| case.weight * of(case)).sum::<f64>() / total
    };
    (0..FIGURES.len())
        .map(|at| {
            let middle = mean(&|case| case.figures[at]);
            mean(&|case| (case.figures[at] - middle).powi(2)).sqrt().max(1e-6)
        })
        .collect()
}

/// The cases of a group, and its weights so far.
struct Weigher {
    /// Scaled figures, by case.
    figures: Vec<Vec<f64>>,
    /// Weight, truth and cause of each case.
    cases: Vec<(f64, f64, usize)>,
    odds: Vec<f64>,
    intercept: f64,
    weights: Vec<f64>,
    /// Offsets of all causes; those of other groups stay 0.
    offsets: Vec<f64>,
}

impl Weigher {
    fn new(group: Group, all: &[&Case], scales: &[f64], causes: &[&str]) -> Self {
        let own = all.iter().filter(|case| Group::of(&case.cause, &case.follows) == group);
        let own: Vec<&&Case> = own.collect();
        let scaled =
            |case: &&&Case| case.figures.iter().zip(scales).map(|(x, scale)| x / scale).collect();
        let place = |case: &Case| causes.binary_search(&case.cause.as_str()).unwrap_or(0);
        let truth = |case: &&&Case| (case.weight, f64::from(u8::from(case.is_real)), place(case));
        Self {
            figures: own.iter().map(scaled).collect(),
            cases: own.iter().map(truth).collect(),
            odds: vec![0.0; own.len()],
            intercept: 0.0,
            weights: vec![0.0; FIGURES.len()],
            offsets: vec![0.0; causes.len()],
        }
    }

    /// Takes a Newton step in each weight. `mean` holds the mean weights over the groups.
    fn sweep(&mut self, mean: &[f64]) {
        let step = self.step(|_, _| 1.0, 0.0, 0.0);
        self.intercept += step;
        self.shift(|_, _| step);
        for (at, mean) in mean.iter().enumerate() {
            let own = self.weights[at];
            let change = self.step(|figures, _| figures[at], GROUP_RIDGE, own - mean);
            let next = (own + change).max(0.0);
            self.weights[at] = next;
            self.shift(|figures, _| (next - own) * figures[at]);
        }
        for at in 0..self.offsets.len() {
            let is_own = |cause: usize| f64::from(u8::from(cause == at));
            let change = self.step(|_, cause| is_own(cause), OFFSET_RIDGE, self.offsets[at]);
            self.offsets[at] += change;
            self.shift(|_, cause| change * is_own(cause));
        }
    }

    /// Returns the Newton step along a figure, with a ridge on the distance from its centre.
    fn step(&self, of: impl Fn(&[f64], usize) -> f64, ridge: f64, distance: f64) -> f64 {
        let (mut slope, mut curvature) = (-ridge * distance, ridge + 1e-9);
        for ((figures, (weight, real, cause)), odds) in
            self.figures.iter().zip(&self.cases).zip(&self.odds)
        {
            let x = of(figures, *cause);
            if x != 0.0 {
                let p = 1.0 / (1.0 + (-odds).exp());
                slope += weight * (real - p) * x;
                curvature += weight * p * (1.0 - p) * x * x;
            }
        }
        // A limited step, because the curvature is small where all cases are certain.
        (slope / curvature).clamp(-1.0, 1.0)
    }

    fn shift(&mut self, of: impl Fn(&[f64], usize) -> f64) {
        for ((figures, (_, _, cause)), odds) in
            self.figures.iter().zip(&self.cases).zip(&mut self.odds)
        {
            *odds += of(figures, *cause);
        }
    }
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
    fn fit_of_known_odds_returns_their_weights() {
        let cases = cases(4000);
        let odds = out_of_fold(&cases);
        let model = ContestCalibration::fit("test".into(), &cases, &odds);
        for group in [Group::Covariate, Group::Motion] {
            let own = &model.groups[group as usize];
            assert!((own.weights[0] - 2.0).abs() < 0.25, "{own:?}");
            assert!(own.weights[1] < 0.1, "{own:?}");
        }
        let probabilities = probabilities_out_of_fold(&cases, &odds);
        let high: Vec<&Case> =
            cases.iter().zip(&probabilities).filter(|(_, p)| **p > 0.9).map(|(c, _)| c).collect();
        let real = high.iter().filter(|case| case.is_real).count() as f64;
        assert!(high.len() > 200 && real / high.len() as f64 > 0.9, "{real} of {}", high.len());
    }

    #[test]
    fn fit_of_a_figure_that_speaks_against_gives_it_no_weight() {
        let mut cases = cases(1000);
        cases.iter_mut().for_each(|case| case.figures[1] = -f64::from(u8::from(case.is_real)));
        let model = ContestCalibration::fit("test".into(), &cases, &out_of_fold(&cases));
        assert_eq!(model.groups[Group::Motion as usize].weights[1], 0.0);
    }
}
