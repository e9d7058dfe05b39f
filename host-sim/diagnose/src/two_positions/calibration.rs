//! Calibrated probability of play, from the figures of the comparison.
//!
//! The log odds are a weighted sum of the figures with weights of at least 0, fitted to simulated joints with and without play
//! (logistic regression). The table is `play_calibration.toml`. `cargo run --release -p friction-grading --example
//! two_positions -- --calibrate` makes it.

use super::{FIGURE_COUNT, FIGURES};
use crate::contest_calibration::{LEAST_PROBABILITY, MOST_PROBABILITY};
use std::sync::OnceLock;
use toml_edit::{DocumentMut, Item};

/// Table in the repository.
const TABLE: &str = include_str!("../../play_calibration.toml");

/// Weights of the figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Name of the table with the number of joints.
    pub name: String,
    /// Log odds where every figure is 0.
    pub start: f64,
    /// Weights of [`FIGURES`].
    pub weights: [f64; FIGURE_COUNT],
}

impl Calibration {
    /// Returns the calibration of the repository. If its table is invalid, play has no probability; a test holds it valid.
    pub fn current() -> &'static Self {
        static CURRENT: OnceLock<Calibration> = OnceLock::new();
        let none =
            || Self { name: String::new(), start: f64::NEG_INFINITY, weights: [0.0; FIGURE_COUNT] };
        CURRENT.get_or_init(|| Self::parse(TABLE).unwrap_or_else(none))
    }

    /// Parses a table; `None` if a key is missing or no number.
    pub fn parse(text: &str) -> Option<Self> {
        let table: DocumentMut = text.parse().ok()?;
        let number = |key: &str| table.get(key).and_then(Item::as_float);
        let mut weights = [0.0; FIGURE_COUNT];
        for (weight, name) in weights.iter_mut().zip(FIGURES) {
            *weight = number(name).filter(|weight| *weight >= 0.0)?;
        }
        let name = table.get("name").and_then(Item::as_str)?.to_owned();
        Some(Self { name, start: number("start")?, weights })
    }

    /// Returns the probability of play.
    pub fn probability(&self, figures: &[f64; FIGURE_COUNT]) -> f64 {
        let sum: f64 =
            self.weights.iter().zip(figures).map(|(weight, figure)| weight * figure).sum();
        (1.0 / (1.0 + (-self.start - sum).exp())).clamp(LEAST_PROBABILITY, MOST_PROBABILITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_the_table_in_the_repository_returns_weights() {
        assert!(
            Calibration::parse(TABLE)
                .is_some_and(|calibration| calibration.weights.iter().any(|w| *w > 0.0))
        );
    }
}
