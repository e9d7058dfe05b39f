//! A lookup table: a torque and a change of the level, drawn over one column. In files it is "unknown".
//!
//! Where a diagnosis finds structure that no named cause explains, or a sensor whose error follows a
//! covariate, the driver can still take it out: two broken lines, evenly spread over a range, the end
//! values held outside. Evenly, because then finding the cell is one product.
//!
//! The change of the level may follow a formula a person can read instead of knots one by one: from nothing
//! at the first knot to `a`, the rise, at the last, with `u` the share of the range between them,
//!
//! ```text
//! linear a u      saturating a u (1 + s) / (u + s), s the scale over the range      exponential (1 + a)^u - 1
//! ```
//!
//! It is drawn through the knots when the table is built, so that a sample costs the same.

use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::{Bound, ParameterError, refuse};

/// Knots of each of the two lines.
pub const KNOTS: usize = 6;

/// Cells between the knots.
const CELLS: usize = KNOTS - 1;

/// The torques at the knots, in their order.
pub const LOOKUP_TORQUES: [Id; KNOTS] = [
    Id::LookupTorque1,
    Id::LookupTorque2,
    Id::LookupTorque3,
    Id::LookupTorque4,
    Id::LookupTorque5,
    Id::LookupTorque6,
];

/// The changes of the level at the knots, in their order.
pub const LOOKUP_LEVELS: [Id; KNOTS] = [
    Id::LookupLevel1,
    Id::LookupLevel2,
    Id::LookupLevel3,
    Id::LookupLevel4,
    Id::LookupLevel5,
    Id::LookupLevel6,
];

/// How the change of the level follows the column, beside its knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LookupFormula {
    /// By the knots alone.
    None,
    /// `a u`.
    Linear,
    /// `a u (1 + s) / (u + s)`.
    Saturating,
    /// `(1 + a)^u - 1`.
    Exponential,
}

impl LookupFormula {
    /// Every formula, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::None, Self::Linear, Self::Saturating, Self::Exponential];

    /// The formula of a number; of an illegal one none.
    pub fn of_number(number: f64) -> Self {
        // A cast saturates.
        Self::ALL.get(number as usize).copied().unwrap_or(Self::None)
    }

    /// The change of the level at a share of the range, 0..=1, for this rise; `scale` is that of the
    /// saturating formula over the range.
    pub fn at<S: Real>(self, share: S, rise: S, scale: S) -> S {
        match self {
            Self::None => S::zero(),
            Self::Linear => rise * share,
            Self::Saturating => rise * share * (S::one() + scale) / (share + scale),
            Self::Exponential => ((S::one() + rise).ln() * share).exp() - S::one(),
        }
    }
}

/// The change of the level at the knots, formula included.
#[inline(never)]
fn levels<S: Real>(values: &Values<S>) -> [S; KNOTS] {
    let formula = LookupFormula::of_number(values.value(Id::LookupFormula));
    let (rise, scale) = (values.get(Id::LookupRise), values.get(Id::LookupScale));
    let scale = scale / (values.get(Id::LookupUpper) - values.get(Id::LookupLower));
    core::array::from_fn(|knot| {
        let own = LOOKUP_LEVELS.get(knot).map_or(S::zero(), |id| values.get(*id));
        own + formula.at(S::from_f64(knot as f64 / CELLS as f64), rise, scale)
    })
}

/// The quantity of a column number; of an illegal one the nearest, of one that is not a number the first.
fn column_of(number: f64) -> Quantity {
    // A cast saturates, and so does the range of the parameter.
    let last = Id::LookupColumn.info().upper;
    Quantity::of_column(number.min(last) as u8).unwrap_or(Quantity::Velocity)
}

/// Built for a sample period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LookupTable<T> {
    /// What it follows.
    column: Quantity,
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

impl<T: Real> Default for LookupTable<T> {
    fn default() -> Self {
        let (zero, knots) = (T::zero(), [T::zero(); KNOTS]);
        let column = Quantity::Velocity;
        Self { column, lower: zero, span: zero, cells_per_unit: zero, torque: knots, level: knots }
    }
}

impl<T: Real> LookupTable<T> {
    /// What it follows.
    pub(crate) fn column(&self) -> Quantity {
        self.column
    }
}

impl<T: Real> Term<T> for LookupTable<T> {
    const PARAMETERS: &'static [Id] = &[
        Id::LookupColumn,
        Id::LookupLower,
        Id::LookupUpper,
        Id::LookupTorque1,
        Id::LookupTorque2,
        Id::LookupTorque3,
        Id::LookupTorque4,
        Id::LookupTorque5,
        Id::LookupTorque6,
        Id::LookupLevel1,
        Id::LookupLevel2,
        Id::LookupLevel3,
        Id::LookupLevel4,
        Id::LookupLevel5,
        Id::LookupLevel6,
        Id::LookupFormula,
        Id::LookupRise,
        Id::LookupScale,
    ];

    const READS: Option<Quantity> = None;

    type Memory = ();

    fn build(values: &Values<T::Setting>, _: T::Setting) -> Self {
        let column = column_of(values.value(Id::LookupColumn));
        let scale = T::Setting::from_f64(column.info().inside_scale);
        let lower = values.get(Id::LookupLower) * scale;
        let span = values.get(Id::LookupUpper) * scale - lower;
        let number = |id| T::from_setting(values.get(id));
        Self {
            column,
            lower: T::from_setting(lower),
            span: T::from_setting(span),
            cells_per_unit: T::from_setting(T::Setting::from_f64(CELLS as f64) / span),
            torque: LOOKUP_TORQUES.map(number),
            level: levels(values).map(T::from_setting),
        }
    }

    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    // Out of line: within the loop over the terms it would make each of the others dearer.
    #[inline(never)]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
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
        effects.level_scale = effects.level_scale * (T::one() + drawn(&self.level) * trust);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // The slope along the column. The rest may be rounded to a last bit, which is no more than a
        // last bit of torque or level.
        [self.cells_per_unit, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f64 {
        let ends = [self.lower, self.span, self.lower + self.span];
        let knots = self.torque.iter().chain(&self.level);
        // A step from knot to knot may be twice as high as a knot; on the level comes a 1.
        let steps = knots.map(|knot| 2.0 * knot.value().abs() + 1.0);
        ends.iter().map(|end| end.value().abs()).chain(steps).fold(CELLS as f64, f64::max)
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.torque +=
            LOOKUP_TORQUES.iter().map(|id| values.value(*id).abs()).fold(0.0, f64::max);
        // At a knot, or 1 where the column is not believed.
        let levels = levels(values);
        let factors = || levels.iter().map(|level| 1.0 + level.value());
        bounds.scale_level(factors().fold(1.0, f64::min), factors().fold(1.0, f64::max));
    }

    fn validate<S: Real>(values: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        for (id, why) in [
            (Id::LookupColumn, "a column has a number"),
            (Id::LookupFormula, "a formula has a number"),
        ] {
            let number = values.value(id);
            if number != libm::trunc(number) {
                return refuse(id.name(), number, Bound::Whole, why);
            }
        }
        let (lower, upper) = (values.value(Id::LookupLower), values.value(Id::LookupUpper));
        if upper <= lower {
            let why = "the knots are spread over a range";
            return refuse(Id::LookupUpper.name(), upper, Bound::MoreThan(lower), why);
        }
        // Knots alone and a formula alone leave a tenth by their ranges; together they may not.
        let lowest = levels(values).into_iter().map(Real::value).fold(0.0, f64::min);
        let least = Id::LookupRise.info().lower;
        // An exponential of the lowest rise ends a rounding below it.
        if lowest < least - 1e-6 {
            let rise = values.value(Id::LookupRise);
            let why = "knots and formula together must leave a tenth of the level";
            let bound = Bound::AtLeast(rise + least - lowest);
            return refuse(Id::LookupRise.name(), rise, bound, why);
        }
        Ok(())
    }
}
