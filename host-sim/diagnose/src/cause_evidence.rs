//! Evidence for one cause: the figures from which its probability is calculated.
//!
//! Each figure is dimensionless and has a direction: a larger value makes the cause more likely, or less
//! likely. [`FIGURES`] lists name, direction and meaning. [`super::calibration`] weighs the figures.
//!
//! The reductions are those of the squared error on rows that the fit has not seen. They are evaluated
//! three times: on held-out stretches, on held-out runs, and on held-out stretches beside laws of
//! other shapes and Maxwell-slip elements ([`super::other_laws`]). A cause that gains beside the base law alone
//! is an error of that law.

/// Direction in which a figure changes the probability.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// A larger figure makes the cause more likely.
    For,
    /// A larger figure makes the cause less likely.
    Against,
}

/// Evidence for one cause.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CauseEvidence {
    /// Reduction on held-out stretches, in standard errors.
    pub reduction_in_errors: f64,
    /// Reduction on held-out runs, in standard errors; `None` if the log cannot show it.
    pub runs_in_errors: Option<f64>,
    /// Reduction on held-out stretches as a share of the error above the noise floor.
    pub share_beyond_floor: f64,
    /// Share of the reduction that remains beside laws of other shapes.
    pub independent_share: f64,
    /// Reduction beside laws of other shapes, in standard errors.
    pub independent_in_errors: f64,
    /// Share of resampled logs in which it, or a cause that the log cannot distinguish from it, reduces the error most.
    pub stability: f64,
    /// Largest share of its effect that another cause also explains; 0 if the log distinguishes it from all others.
    pub confused_share: f64,
    /// Largest reduction that another cause promises in its place, relative to its own.
    pub rival_promise: f64,
    /// RMS error of the model with all accepted causes, relative to the noise floor.
    pub error_over_floor: f64,
    /// Number of candidates and settings it was chosen from.
    pub comparisons: f64,
    /// Share of the noise floor, as variance, that comes from the uncertain motion; 1 for a cause that depends on the
    /// velocity alone in a log without a position.
    pub motion_share: f64,
    /// True if an inaccurate friction law leaves an error of its shape.
    pub is_confounded_with_law: bool,
    /// True if its effect depends nonlinearly on its parameters.
    pub is_nonlinear: bool,
    /// True for a cause without a name: a curve over a column.
    pub is_curve: bool,
}

/// A figure of the evidence.
pub struct Figure {
    /// Name in the table of the calibration.
    pub name: &'static str,
    /// Direction.
    pub direction: Direction,
    /// Value of the figure, scaled so that most values lie between -3 and 3.
    pub of: fn(&CauseEvidence) -> f64,
}

/// Returns `ln(1 + x)` of a positive figure, 0 for a negative one and NaN.
fn log_of(value: f64) -> f64 {
    // `max` first: it replaces NaN by 0.
    let positive = value.max(0.0);
    positive.min(1e6).ln_1p()
}

/// All figures.
pub const FIGURES: [Figure; 14] = [
    Figure { name: "reduction", direction: Direction::For, of: |e| log_of(e.reduction_in_errors) },
    Figure {
        name: "extrapolation",
        direction: Direction::For,
        of: |e| e.runs_in_errors.map_or(0.0, |errors| errors.clamp(-2.0, 4.0)),
    },
    Figure {
        name: "extrapolation unknown",
        direction: Direction::Against,
        of: |e| f64::from(u8::from(e.runs_in_errors.is_none())),
    },
    Figure {
        name: "share beyond floor",
        direction: Direction::For,
        of: |e| e.share_beyond_floor.clamp(0.01, 1.0).ln(),
    },
    Figure {
        name: "independent share",
        direction: Direction::For,
        of: |e| e.independent_share.clamp(0.0, 1.0),
    },
    Figure {
        name: "independent reduction",
        direction: Direction::For,
        of: |e| log_of(e.independent_in_errors),
    },
    Figure { name: "stability", direction: Direction::For, of: |e| e.stability.clamp(0.0, 1.0) },
    Figure {
        name: "confused share",
        direction: Direction::Against,
        of: |e| e.confused_share.clamp(0.0, 1.0),
    },
    Figure {
        name: "rival promise",
        direction: Direction::Against,
        of: |e| log_of(e.rival_promise),
    },
    Figure {
        name: "error over floor",
        direction: Direction::Against,
        of: |e| e.error_over_floor.clamp(1.0, 1e3).ln(),
    },
    Figure {
        name: "comparisons",
        direction: Direction::Against,
        of: |e| 0.2 * e.comparisons.max(1.0).ln(),
    },
    Figure {
        name: "uncertain motion",
        direction: Direction::Against,
        of: |e| e.motion_share.clamp(0.0, 1.0),
    },
    Figure {
        name: "confounded with law",
        direction: Direction::Against,
        of: |e| f64::from(u8::from(e.is_confounded_with_law)),
    },
    Figure {
        name: "nonlinear or curve",
        direction: Direction::Against,
        of: |e| f64::from(u8::from(e.is_nonlinear || e.is_curve)),
    },
];

impl CauseEvidence {
    /// Returns all figures in the order of [`FIGURES`], each with the sign that makes a larger one speak for the cause.
    pub fn figures(&self) -> [f64; FIGURES.len()] {
        FIGURES.each_ref().map(|figure| {
            let value = (figure.of)(self);
            let value = if value.is_finite() { value } else { 0.0 };
            if figure.direction == Direction::For { value } else { -value }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_any_evidence_are_finite() {
        let odd = CauseEvidence {
            reduction_in_errors: f64::NAN,
            share_beyond_floor: f64::INFINITY,
            error_over_floor: f64::NAN,
            rival_promise: f64::INFINITY,
            ..CauseEvidence::default()
        };
        assert!(odd.figures().iter().all(|figure| figure.is_finite()));
        assert!(CauseEvidence::default().figures().iter().all(|figure| figure.is_finite()));
    }

    #[test]
    fn figures_against_a_cause_are_negative() {
        let confused = CauseEvidence { confused_share: 0.9, ..CauseEvidence::default() };
        let place = FIGURES.iter().position(|figure| figure.name == "confused share").unwrap();
        assert_eq!(confused.figures()[place], -0.9);
    }
}
