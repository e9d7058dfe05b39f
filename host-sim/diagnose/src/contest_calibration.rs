//! Calibrated probability that a cause is real, from the figures of a contest.
//!
//! The log odds are a sum of small trees ([`Tree`]) over the figures. Each figure is signed so that more of it never speaks against a
//! cause, and the trees keep that. They are boosted (Friedman 2001): each takes what those before it leave. A monotone step
//! (isotonic regression, Zadrozny and Elkan 2002) then gives the observed frequency of cases that the trees were not fitted to.
//!
//! The table is `contest_calibration.toml`. `cargo run --release -p friction-grading --example calibrate_contest` makes it from
//! the evidence on simulated and measured logs with known causes.

mod table;
mod trees;

pub use trees::{Node, Tree, category};

use super::contest::{Figures, Outcome};
use std::sync::OnceLock;
use thiserror::Error;

/// Table in the repository.
const TABLE: &str = include_str!("../contest_calibration.toml");

/// Lowest probability, because no set of logs makes certain.
pub(crate) const LEAST_PROBABILITY: f64 = 0.005;

/// Highest probability, for the same reason.
pub(crate) const MOST_PROBABILITY: f64 = 0.995;

/// A figure of a candidate. More of it never speaks against the cause.
pub struct Figure {
    /// Name in the table and in evidence files.
    pub name: &'static str,
    of: fn(&Outcome, &Figures) -> f64,
}

const fn figure(name: &'static str, of: fn(&Outcome, &Figures) -> f64) -> Figure {
    Figure { name, of }
}

/// Smallest share of an error that a logarithm tells from none.
const LEAST_SHARE: f64 = 1e-4;

fn log_share(share: f64) -> f64 {
    share.max(LEAST_SHARE).ln() - LEAST_SHARE.ln()
}

/// The figures, with the signs and units of the table.
pub const FIGURES: &[Figure] = &[
    figure("inclusion", |_, evidence| {
        let least = 0.01;
        ((evidence.inclusion + least) / (1.0 - evidence.inclusion + least)).ln()
    }),
    figure("in_best", |_, evidence| f64::from(u8::from(evidence.is_in_best))),
    figure("alone", |_, evidence| log_share(evidence.alone)),
    figure("last", |_, evidence| log_share(evidence.last)),
    figure("irreplaceable", |_, evidence| log_share(evidence.irreplaceable)),
    // What the cause takes last, beside what the best hypothesis leaves.
    figure("last_of_left", |outcome, evidence| {
        log_share(evidence.last / outcome.error_ratio.max(1e-9))
    }),
    // RMS of what the cause takes last, in noise floors.
    figure("floors_taken", |outcome, evidence| {
        (evidence.last.max(0.0).sqrt() * outcome.base_floors).max(1e-2).ln()
    }),
    // A model that leaves much more than noise is inaccurate, and causes repair it by chance.
    figure("floors_left", |outcome, _| -outcome.floors.max(1e-2).ln()),
    figure("last_in_errors", |_, evidence| evidence.last_in_errors.clamp(-3.0, 30.0).max(0.1).ln()),
    figure("units_gained", |_, evidence| evidence.units_gained),
    figure("torque_share", |_, evidence| log_share(evidence.torque_share)),
    figure("laws", |_, evidence| evidence.laws),
    // A law with slip of a free shape takes what an inaccurate law misses.
    figure("beside_slip", |_, evidence| log_share(evidence.beside_slip)),
    figure("size_in_errors", |_, evidence| evidence.size_in_errors.clamp(0.1, 100.0).ln()),
    figure("rivals", |_, evidence| -(evidence.confusable_with.len() as f64)),
    // Share of the candidates' materiality that is this one's.
    figure("dominance", |outcome, evidence| {
        let all: f64 = outcome.causes.iter().map(|other| other.materiality().max(0.0)).sum();
        evidence.materiality().max(0.0) / all.max(1e-9)
    }),
    figure("candidates", |outcome, _| -(outcome.causes.len() as f64).ln()),
    figure("runs", |outcome, _| (outcome.runs.max(1) as f64).ln()),
];

/// Returns the figures of a candidate, in the order of [`FIGURES`].
pub fn figures(outcome: &Outcome, evidence: &Figures) -> Vec<f64> {
    FIGURES.iter().map(|figure| (figure.of)(outcome, evidence)).collect()
}

/// Invalid table of a calibration.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrationError {
    /// The text is not TOML.
    #[error("calibration: {0}")]
    Syntax(String),
    /// A key is missing.
    #[error("calibration: `{0}` is missing or no list of the right kind")]
    Missing(String),
    /// The text of a tree is wrong at a word.
    #[error("calibration: found {0} in a tree, expected FIGURE<LIMIT, cause=NAME,.. or a number")]
    Tree(String),
}

/// A calibration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContestCalibration {
    /// Name of the table with the number of logs, as in `data.calibration`.
    pub name: String,
    /// Log odds before all trees.
    pub start: f64,
    /// Trees, whose values add to the start.
    pub trees: Vec<Tree>,
    /// Isotonic step: log odds and probability, both increasing. Empty for the plain logistic function.
    pub steps: Vec<(f64, f64)>,
}

impl ContestCalibration {
    /// Names nothing.
    const NONE: Self = Self {
        name: String::new(),
        start: f64::NEG_INFINITY,
        trees: Vec::new(),
        steps: Vec::new(),
    };

    /// Returns the calibration of the repository. If its table is invalid, no cause has a probability; a test holds it valid.
    pub fn current() -> &'static Self {
        static CURRENT: OnceLock<ContestCalibration> = OnceLock::new();
        CURRENT.get_or_init(|| Self::parse(TABLE).unwrap_or(Self::NONE))
    }

    /// Returns the probability of a candidate of a contest.
    pub fn probability(&self, outcome: &Outcome, evidence: &Figures) -> f64 {
        let key = &evidence.key;
        self.probability_of(key.cause, &key.follows(), &figures(outcome, evidence))
    }

    /// Returns the probability of a cause with given figures.
    pub fn probability_of(&self, cause: &str, follows: &str, figures: &[f64]) -> f64 {
        self.calibrated(self.log_odds(cause, follows, figures))
    }

    /// Returns the log odds before the isotonic step.
    pub fn log_odds(&self, cause: &str, follows: &str, figures: &[f64]) -> f64 {
        let category = category(cause, follows);
        self.start + self.trees.iter().map(|tree| tree.value(category, figures)).sum::<f64>()
    }

    /// Returns the probability for log odds, interpolated between the steps.
    pub fn calibrated(&self, log_odds: f64) -> f64 {
        let steps = self.steps.as_slice();
        let next = steps.partition_point(|(odds, _)| *odds <= log_odds);
        let probability = match (steps, next) {
            ([], _) => 1.0 / (1.0 + (-log_odds).exp()),
            (_, 0) => steps[0].1,
            (_, next) if next == steps.len() => steps[next - 1].1,
            (_, next) => {
                let ((from, low), (to, high)) = (steps[next - 1], steps[next]);
                low + (high - low) * (log_odds - from) / (to - from).max(1e-12)
            }
        };
        probability.clamp(LEAST_PROBABILITY, MOST_PROBABILITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn current_table_is_monotone() {
        let current = ContestCalibration::parse(TABLE).unwrap();
        assert!(!current.trees.is_empty());
        assert!(current.steps.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1));
        let mut random = Pcg64::seed_from_u64(3);
        let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        for _ in 0..2000 {
            let mut figures: Vec<f64> = FIGURES.iter().map(|_| draw(-5.0, 10.0)).collect();
            for cause in ["backlash", "pressure-coulomb", "torque-ripple"] {
                let before = current.log_odds(cause, "", &figures);
                let at = draw(0.0, FIGURES.len() as f64) as usize;
                figures[at] += draw(0.0, 5.0);
                let after = current.log_odds(cause, "", &figures);
                assert!(
                    after >= before - 1e-9,
                    "{cause}: more of {} is against it",
                    FIGURES[at].name
                );
            }
        }
    }

    #[test]
    fn calibrated_between_steps_is_interpolated_and_bounded() {
        let steps = vec![(-1.0, 0.0), (1.0, 0.5), (2.0, 1.0)];
        let calibration = ContestCalibration { steps, ..ContestCalibration::default() };
        assert!((calibration.calibrated(0.0) - 0.25).abs() < 1e-12);
        assert!((calibration.calibrated(1.5) - 0.75).abs() < 1e-12);
        assert_eq!(
            (calibration.calibrated(-9.0), calibration.calibrated(9.0)),
            (LEAST_PROBABILITY, MOST_PROBABILITY)
        );
    }

    #[test]
    fn probability_without_table_names_nothing() {
        let calibration = ContestCalibration::NONE;
        assert_eq!(
            calibration.probability_of("backlash", "", &[9.0; FIGURES.len()]),
            LEAST_PROBABILITY
        );
    }
}
