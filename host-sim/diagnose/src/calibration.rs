//! Calibrated probability that a cause is real, from its evidence.
//!
//! The probability is a logistic function of the figures of the evidence ([`super::cause_evidence`]),
//! with weights that are not negative: more evidence for a cause never lowers its probability. A
//! monotone step (isotonic regression, Zadrozny and Elkan 2002) then corrects the probability with
//! the observed frequencies of cases that the weights were not fitted to.
//!
//! The weights are a table, `calibration.toml`. `cargo run --release -p friction-grading --example calibrate`
//! regenerates it from simulated logs with known causes. There are two models: one for causes that
//! were fitted and reviewed, and one for candidates of the first round, from their linear fit.

use super::cause_evidence::{CauseEvidence, FIGURES};
use std::fmt::Write;
use std::sync::OnceLock;
use thiserror::Error;
use toml_edit::{DocumentMut, Item};

/// Number of figures of the evidence.
const N: usize = FIGURES.len();

/// Table in the repository.
const TABLE: &str = include_str!("../calibration.toml");

/// Lowest and highest probability, because no simulated log is certain.
const BOUNDS: (f64, f64) = (0.005, 0.995);

/// Weight of the squared weights in the fit, in cases. It keeps figures without information at 0.
const RIDGE: f64 = 1.0;

/// Sweeps over all weights in a fit. Each is a Newton step in one weight, and the fit converges in a few dozen.
const SWEEPS: usize = 300;

/// Parts of the cases for probabilities that the weights were not fitted to.
const FOLDS: u64 = 5;

/// Fewest cases in a step of the isotonic regression.
const MIN_STEP_CASES: f64 = 12.0;

/// Invalid table of a calibration.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// The text is not TOML.
    #[error("calibration: {0}")]
    Syntax(String),
    /// A number is missing.
    #[error("calibration: expected a number for `{0}`")]
    Missing(String),
}

/// A case for a fit: evidence with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// Signed figures of the evidence ([`CauseEvidence::figures`]).
    pub figures: [f64; N],
    /// True if the cause is in the log.
    pub is_real: bool,
    /// Log of the case. Cases of one log share a fold.
    pub log: u64,
}

/// Logistic model with an isotonic step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Logistic {
    /// Log odds of evidence whose figures are all 0.
    pub intercept: f64,
    /// Weights of the figures, 0 or positive.
    pub weights: [f64; N],
    /// Isotonic step: log odds and probability, both increasing. Empty for the plain logistic function.
    pub steps: Vec<(f64, f64)>,
}

/// A calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Name of the table with the number of logs, as in `data.calibration`.
    pub name: String,
    /// Probability at and above which a cause is named.
    pub naming_threshold: f64,
    /// Model for causes that were fitted and reviewed.
    pub finding: Logistic,
    /// Model for candidates of the first round.
    pub candidate: Logistic,
}

impl Logistic {
    /// Returns the log odds before the isotonic step.
    pub fn log_odds(&self, figures: &[f64; N]) -> f64 {
        self.intercept + self.weights.iter().zip(figures).map(|(w, f)| w * f).sum::<f64>()
    }

    /// Returns the calibrated probability, 0.005 to 0.995.
    pub fn probability(&self, evidence: &CauseEvidence) -> f64 {
        self.calibrated(self.log_odds(&evidence.figures()))
    }

    /// Returns the probability for log odds, interpolated between the steps.
    pub fn calibrated(&self, log_odds: f64) -> f64 {
        let after = self.steps.iter().position(|(odds, _)| *odds > log_odds);
        let probability = match (self.steps.as_slice(), after) {
            ([], _) => expit(log_odds),
            (steps, None) => steps[steps.len() - 1].1,
            (steps, Some(0)) => steps[0].1,
            (steps, Some(next)) => {
                let ((from, low), (to, high)) = (steps[next - 1], steps[next]);
                low + (high - low) * (log_odds - from) / (to - from)
            }
        };
        probability.clamp(BOUNDS.0, BOUNDS.1)
    }

    /// Fits weights and isotonic step to cases.
    pub fn fit(cases: &[Case]) -> Self {
        let mut model = fit_weights(cases.iter());
        let mut odds = out_of_fold(cases);
        odds.sort_by(|a, b| a.0.total_cmp(&b.0));
        model.steps = isotonic(&odds);
        model
    }
}

/// Returns log odds and truth of each case, by a fit without the cases of its fold.
pub fn out_of_fold(cases: &[Case]) -> Vec<(f64, bool)> {
    let fold = |case: &Case| case.log % FOLDS;
    let models: Vec<Logistic> =
        (0..FOLDS).map(|own| fit_weights(cases.iter().filter(|case| fold(case) != own))).collect();
    let odds = |case: &Case| models[fold(case) as usize].log_odds(&case.figures);
    cases.iter().map(|case| (odds(case), case.is_real)).collect()
}

fn expit(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// Fits the weights by Newton steps in one weight at a time. A negative weight becomes 0.
fn fit_weights<'a>(cases: impl Iterator<Item = &'a Case>) -> Logistic {
    let cases: Vec<&Case> = cases.collect();
    let mut model = Logistic::default();
    let mut odds = vec![0.0; cases.len()];
    for _ in 0..SWEEPS {
        for at in 0..=N {
            let value = |case: &Case| if at == N { 1.0 } else { case.figures[at] };
            let own = if at == N { model.intercept } else { model.weights[at] };
            let ridge = if at == N { 0.0 } else { RIDGE };
            let (mut slope, mut curvature) = (-ridge * own, ridge + 1e-9);
            for (case, odds) in cases.iter().zip(&odds) {
                let (x, p) = (value(case), expit(*odds));
                slope += (f64::from(u8::from(case.is_real)) - p) * x;
                curvature += p * (1.0 - p) * x * x;
            }
            // A limited step, because the curvature is small where all cases are certain.
            let step = (slope / curvature).clamp(-1.0, 1.0);
            let next = if at == N { own + step } else { (own + step).max(0.0) };
            for (case, odds) in cases.iter().zip(&mut odds) {
                *odds += (next - own) * value(case);
            }
            if at == N {
                model.intercept = next;
            } else {
                model.weights[at] = next;
            }
        }
    }
    model
}

/// Returns the isotonic regression of sorted cases: log odds and frequency of each step.
///
/// The frequency of a step counts one more real and one more unreal case (Laplace), so that no step
/// is certain.
fn isotonic(sorted: &[(f64, bool)]) -> Vec<(f64, f64)> {
    struct Step {
        odds: f64,
        real: f64,
        count: f64,
    }
    let frequency = |step: &Step| (step.real + 1.0) / (step.count + 2.0);
    let mut steps: Vec<Step> = Vec::new();
    for (odds, is_real) in sorted {
        steps.push(Step { odds: *odds, real: f64::from(u8::from(*is_real)), count: 1.0 });
        while let [.., before, last] = steps.as_slice() {
            let is_small = before.count < MIN_STEP_CASES;
            if !is_small && before.real / before.count < last.real / last.count {
                break;
            }
            let (odds, real, count) = (
                (before.odds * before.count + last.odds * last.count) / (before.count + last.count),
                before.real + last.real,
                before.count + last.count,
            );
            steps.truncate(steps.len() - 2);
            steps.push(Step { odds, real, count });
        }
    }
    let mut points: Vec<(f64, f64)> = steps.iter().map(|s| (s.odds, frequency(s))).collect();
    // The Laplace correction of a small step may break the order.
    for at in 1..points.len() {
        points[at].1 = points[at].1.max(points[at - 1].1);
    }
    points
}

impl Calibration {
    /// Returns the calibration of the repository. If its table is invalid, the plain logistic function of no
    /// weights is returned, which names no cause; a test holds the table valid.
    pub fn current() -> &'static Self {
        static CURRENT: OnceLock<Calibration> = OnceLock::new();
        CURRENT.get_or_init(|| {
            Self::parse(TABLE).unwrap_or_else(|_| Self {
                name: "none".into(),
                naming_threshold: 1.0,
                finding: Logistic::default(),
                candidate: Logistic::default(),
            })
        })
    }

    /// Parses a table.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML or a number is missing.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let table: DocumentMut = text
            .parse()
            .map_err(|e: toml_edit::TomlError| CalibrationError::Syntax(e.to_string()))?;
        let name = table.get("name").and_then(Item::as_str).unwrap_or("calibration");
        Ok(Self {
            name: name.to_owned(),
            naming_threshold: number(table.get("naming_threshold"), "naming_threshold")?,
            finding: logistic(&table, "finding")?,
            candidate: logistic(&table, "candidate")?,
        })
    }

    /// Emits the table.
    pub fn emit(&self) -> String {
        let mut text = format!(
            "# Weights of the evidence for a cause. Made by\n#   cargo run --release -p friction-grading --example calibrate\n\n\
             name = \"{}\"\nnaming_threshold = {:.3}\n",
            self.name, self.naming_threshold
        );
        for (name, model) in [("finding", &self.finding), ("candidate", &self.candidate)] {
            let _ = write!(text, "\n[{name}]\nintercept = {:.4}\n", model.intercept);
            let steps: Vec<String> =
                model.steps.iter().map(|(odds, p)| format!("[{odds:.4}, {p:.4}]")).collect();
            let _ = write!(text, "steps = [{}]\n\n[{name}.weights]\n", steps.join(", "));
            for (figure, weight) in FIGURES.iter().zip(model.weights) {
                let _ = writeln!(text, "\"{}\" = {weight:.4}", figure.name);
            }
        }
        text
    }
}

fn number(item: Option<&Item>, name: &str) -> Result<f64, CalibrationError> {
    let value = item.and_then(|item| item.as_float().or(item.as_integer().map(|i| i as f64)));
    value.ok_or_else(|| CalibrationError::Missing(name.to_owned()))
}

fn logistic(table: &DocumentMut, name: &str) -> Result<Logistic, CalibrationError> {
    let own = table.get(name).ok_or_else(|| CalibrationError::Missing(name.to_owned()))?;
    let mut weights = [0.0; N];
    for (weight, figure) in weights.iter_mut().zip(&FIGURES) {
        let item = own.get("weights").and_then(|weights| weights.get(figure.name));
        *weight = number(item, &format!("{name}.weights.{}", figure.name))?;
    }
    let steps = own.get("steps").and_then(Item::as_array);
    let pair = |value: &toml_edit::Value| {
        let pair = value.as_array()?;
        Some((pair.get(0)?.as_float()?, pair.get(1)?.as_float()?))
    };
    let steps = steps.into_iter().flat_map(toml_edit::Array::iter).map(pair);
    let steps: Option<Vec<(f64, f64)>> = steps.collect();
    let steps = steps.ok_or_else(|| CalibrationError::Missing(format!("{name}.steps")))?;
    Ok(Logistic {
        intercept: number(own.get("intercept"), &format!("{name}.intercept"))?,
        weights,
        steps,
    })
}

#[cfg(test)]
mod tests;
