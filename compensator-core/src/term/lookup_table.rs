//! A lookup table of a torque and of a relative change of the level, over one column. Its name in files is
//! "unknown".
//!
//! It compensates structure that no named cause explains, and sensor errors that depend on a covariate. Both
//! lines are piecewise linear with evenly spaced knots, so that one product gives the cell. Outside the range,
//! the end values apply.
//!
//! A formula can describe the change of the level instead of single knots. It rises from 0 at the first knot to
//! `a` at the last. `u` is the share of the range between them:
//!
//! ```text
//! linear a u      saturating a u (1 + s) / (u + s), s the scale over the range      exponential (1 + a)^u - 1
//! ```
//!
//! The build evaluates the formula at the knots, so it adds no cost to a sample.

use super::interface::*;

/// Number of knots of each of the two lines.
pub const LOOKUP_KNOTS: usize = 6;

/// Number of cells between the knots.
const CELLS: usize = LOOKUP_KNOTS - 1;

/// Parameters of the torque at each knot.
pub const LOOKUP_TORQUES: [Id; LOOKUP_KNOTS] = [
    Id::LookupTorque1,
    Id::LookupTorque2,
    Id::LookupTorque3,
    Id::LookupTorque4,
    Id::LookupTorque5,
    Id::LookupTorque6,
];

/// Parameters of the relative change of the level at each knot.
pub const LOOKUP_LEVELS: [Id; LOOKUP_KNOTS] = [
    Id::LookupLevel1,
    Id::LookupLevel2,
    Id::LookupLevel3,
    Id::LookupLevel4,
    Id::LookupLevel5,
    Id::LookupLevel6,
];

/// Formula of the change of the level over the column, added to the knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LookupFormula {
    /// No formula; only the knots.
    None,
    /// `a u`.
    Linear,
    /// `a u (1 + s) / (u + s)`.
    Saturating,
    /// `(1 + a)^u - 1`.
    Exponential,
}

impl LookupFormula {
    /// Every formula, ordered by number.
    pub const ALL: [Self; 4] = [Self::None, Self::Linear, Self::Saturating, Self::Exponential];

    /// Returns the formula with this number, or [`LookupFormula::None`] if the number is illegal.
    pub fn of_number(number: f32) -> Self {
        // The cast saturates.
        Self::ALL.get(number as usize).copied().unwrap_or(Self::None)
    }

    /// Returns the relative change of the level at a share of the range, 0..=1. `scale` is the scale of the
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

/// Returns the relative change of the level at the knots, including the formula.
#[inline(never)]
fn levels<S: Real>(values: &ParameterValues<S>) -> [S; LOOKUP_KNOTS] {
    let formula = LookupFormula::of_number(values.single(Id::LookupFormula));
    let (rise, scale) = (values.get(Id::LookupRise), values.get(Id::LookupScale));
    let scale = scale / (values.get(Id::LookupUpper) - values.get(Id::LookupLower));
    core::array::from_fn(|knot| {
        let at_knot = LOOKUP_LEVELS.get(knot).map_or(S::zero(), |id| values.get(*id));
        at_knot + formula.at(S::from_count(knot as u8) / S::from_count(CELLS as u8), rise, scale)
    })
}

/// Returns the quantity with this column number. An illegal number gives the nearest, and NaN the first.
fn column_of(number: f32) -> Quantity {
    // The cast saturates at 0; the range of the parameter limits the upper end.
    let [_, last] = Id::LookupColumn.range();
    Quantity::from_column_number(number.min(last) as u8).unwrap_or(Quantity::Velocity)
}

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LookupTable<T> {
    /// Input quantity.
    column: Quantity,
    /// Position of the first knot, in the internal unit of the column.
    lower: T,
    /// Distance from the first to the last knot, in the same unit.
    span: T,
    /// Number of cells per internal unit of the column.
    cells_per_unit: T,
    /// Torque at the knots, Nm.
    torque: [T; LOOKUP_KNOTS],
    /// Relative change of the level at the knots.
    level: [T; LOOKUP_KNOTS],
}

impl<T: Real> Default for LookupTable<T> {
    fn default() -> Self {
        let (zero, knots) = (T::zero(), [T::zero(); LOOKUP_KNOTS]);
        let column = Quantity::Velocity;
        Self { column, lower: zero, span: zero, cells_per_unit: zero, torque: knots, level: knots }
    }
}

impl<T: Real> LookupTable<T> {
    /// Returns the input quantity.
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

    const SIZES: &'static [Id] = &[
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
        Id::LookupRise,
    ];

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let column = column_of(values.single(Id::LookupColumn));
        let scale = column.inside_scale::<T::Setting>();
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

    fn set_gain(&mut self, of: &Self, gain: T) {
        let knots = self.torque.iter_mut().zip(&mut self.level);
        for ((torque, level), tuned) in knots.zip(of.torque.iter().zip(&of.level)) {
            (*torque, *level) = (*tuned.0 * gain, *tuned.1 * gain);
        }
    }

    // Out of line, because inlined into the loop over the terms it would slow down the others.
    #[inline(never)]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let weight = sample.lookup_weight;
        let input = match self.column {
            // As the other terms, it uses the guarded and possibly delayed velocity.
            Quantity::Velocity => effects.velocity,
            column => column.value_in(sample).unwrap_or_default(),
        };
        // The limit precedes the scaling, because fixed point cannot represent a value far outside.
        let position =
            (input - self.lower).at_least(T::zero()).at_most(self.span) * self.cells_per_unit;
        let (cell, share) = position.cell_and_share(CELLS - 1);
        let interpolate =
            |knots: &[T; LOOKUP_KNOTS]| knots[cell] + (knots[cell + 1] - knots[cell]) * share;
        effects.torque = effects.torque + interpolate(&self.torque) * weight;
        effects.level_scale = effects.level_scale * (T::one() + interpolate(&self.level) * weight);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // Only the scale of the column. Rounding of the other coefficients changes torque or level by
        // at most one unit of the resolution.
        [self.cells_per_unit, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        let ends = [self.lower, self.span, self.lower + self.span];
        let knots = self.torque.iter().chain(&self.level);
        // The difference of two knots can be twice a knot. The factor of the level adds 1.
        let steps = knots.map(|knot| 2.0 * knot.single().abs() + 1.0);
        ends.iter().map(|end| end.single().abs()).chain(steps).fold(CELLS as f32, f32::max)
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.torque +=
            LOOKUP_TORQUES.iter().map(|id| values.single(*id).abs()).fold(0.0, f32::max);
        // The extremes are at a knot, or 1 if the weight of the column is 0.
        let levels = levels(values);
        let factors = || levels.iter().map(|level| 1.0 + level.single());
        bounds.scale_level(factors().fold(1.0, f32::min), factors().fold(1.0, f32::max));
    }

    fn validate<S: Real>(values: &ParameterValues<S>, _: &Envelope) -> Result<(), ParameterError> {
        for (id, why) in [
            (Id::LookupColumn, text!("a column has a number")),
            (Id::LookupFormula, text!("a formula has a number")),
        ] {
            let number = values.single(id);
            if number != libm::truncf(number) {
                return refuse(id.text(), number, Bound::Whole, why);
            }
        }
        let (lower, upper) = (values.single(Id::LookupLower), values.single(Id::LookupUpper));
        if upper <= lower {
            let why = text!("the knots are spread over a range");
            return refuse(Id::LookupUpper.text(), upper, Bound::MoreThan(lower), why);
        }
        // The range of each parameter leaves a tenth of the level, but knots and formula add up.
        let lowest = levels(values).into_iter().map(Real::single).fold(0.0, f32::min);
        let [least, _] = Id::LookupRise.range();
        // The margin allows for rounding in the exponential formula at the lowest rise.
        if lowest < least - 1e-6 {
            let rise = values.single(Id::LookupRise);
            let why = text!("knots and formula together must leave a tenth of the level");
            let bound = Bound::AtLeast(rise + least - lowest);
            return refuse(Id::LookupRise.text(), rise, bound, why);
        }
        Ok(())
    }
}
