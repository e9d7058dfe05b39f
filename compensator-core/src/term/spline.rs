//! The term of unknown cause: a torque and a change of the level, drawn over one column.
//!
//! Where a diagnosis finds structure that no named cause explains, or a sensor whose error follows a
//! covariate, the driver can still take it out: two broken lines with [`KNOTS`] knots, evenly spread
//! over a range, the end values held outside. Evenly, because then finding the cell is one product.
//! The knots are kept beside the list of terms and not in it: a model has this term at most once, and
//! every place of the list would have to be as large as the largest term.

use super::{KNOTS, UNKNOWN_LEVELS, UNKNOWN_TORQUES};
use crate::effect::Effects;
use crate::model::Sample;
use crate::number::Real;
use crate::parameters::{ParameterId as Id, Parameters};
use crate::quantity::Quantity;

/// Cells between the knots.
const CELLS: usize = KNOTS - 1;

/// The term of unknown cause, built.
#[derive(Clone, Copy, Debug)]
pub struct Spline<T> {
    /// What it follows.
    pub(crate) column: Quantity,
    /// Where the first knot lies, in the column's unit inside.
    lower: T,
    /// From there to the last knot.
    span: T,
    /// Cells in one unit of the column.
    cells_per_unit: T,
    /// Torque at the knots, Nm.
    torque: [T; KNOTS],
    /// Relative change of the level at the knots.
    level: [T; KNOTS],
}

/// The quantity of a column number; of an illegal one the nearest, of one that is not a number the first.
fn column_of(number: f64) -> Quantity {
    // A cast saturates, and so does the range of the parameter.
    let last = Id::UnknownColumn.info().upper;
    Quantity::of_column(number.min(last) as u8).unwrap_or(Quantity::Velocity)
}

impl<T: Real> Spline<T> {
    /// Builds the term from parameters; from illegal ones too, as a fit passes through them.
    pub(crate) fn build(parameters: &Parameters<T::Setting>) -> Self {
        let column = column_of(parameters.get(Id::UnknownColumn).value());
        let scale = T::Setting::from_f64(column.info().inside_scale);
        let lower = parameters.get(Id::UnknownLower) * scale;
        let span = parameters.get(Id::UnknownUpper) * scale - lower;
        let number = |id| T::from_setting(parameters.get(id));
        Self {
            column,
            lower: T::from_setting(lower),
            span: T::from_setting(span),
            cells_per_unit: T::from_setting(T::Setting::from_f64(CELLS as f64) / span),
            torque: UNKNOWN_TORQUES.map(number),
            level: UNKNOWN_LEVELS.map(number),
        }
    }

    /// What must be held to a share of its value: the slope along the column. The rest may be
    /// rounded to a last bit, which is no more than a last bit of torque or level.
    pub(crate) fn coefficient(&self) -> T {
        self.cells_per_unit
    }

    /// The largest magnitude of anything [`Spline::act`] computes.
    pub(crate) fn largest_product(&self) -> f64 {
        let ends = [self.lower, self.span, self.lower + self.span];
        let knots = self.torque.iter().chain(&self.level);
        // A step from knot to knot may be twice as high as a knot; on the level comes a 1.
        let steps = knots.map(|knot| 2.0 * knot.value().abs() + 1.0);
        ends.iter().map(|end| end.value().abs()).chain(steps).fold(CELLS as f64, f64::max)
    }

    /// Lets the term act on one sample. Out of line: within the loop over the terms it would make
    /// each of the others dearer.
    #[inline(never)]
    pub(crate) fn act(&self, sample: &Sample<T>, effects: &mut Effects<T>) {
        let one = T::one();
        let trust = sample.lookup_trust;
        let at = match self.column {
            // The velocity the other terms see: guarded, and delayed where there is a delay.
            Quantity::Velocity => effects.velocity,
            column => column.of_sample(sample).unwrap_or_default(),
        };
        // Limited before it is scaled: fixed point has no room for a column far outside.
        let along = (at - self.lower).at_least(T::zero()).at_most(self.span) * self.cells_per_unit;
        let (cell, share) = along.cell_and_share(CELLS - 1);
        let drawn = |knots: &[T; KNOTS]| knots[cell] + (knots[cell + 1] - knots[cell]) * share;
        effects.torque = effects.torque + drawn(&self.torque) * trust;
        effects.level_scale = effects.level_scale * (one + drawn(&self.level) * trust);
    }
}
