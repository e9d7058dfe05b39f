//! Coulomb and viscous friction plus `f1 v |v| + f2 v^3` (the manipulator paper, eq. 5).
//!
//! The printed equation has `f1 v sgn v = f1 |v|` instead. This term is even in `v`, so it is not dissipative.

use super::interface::*;
use super::steady::Steady;
use crate::fits::product;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Extended<T> {
    /// Coulomb and viscous friction.
    pub steady: Steady<T>,
    /// `f1`, Nm s^2/rad^2 (printed form: Nm s/rad).
    pub quadratic: T,
    /// `f2`, Nm s^3/rad^3.
    pub cubic: T,
    /// Use eq. 5 as printed, with `f1 |v|`.
    pub printed: bool,
}

impl<T: Real> FrictionLaw<T> for Extended<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::CoulombTorque, Id::ViscousFriction, Id::QuadraticFriction, Id::CubicFriction];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, _: T::Setting) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            steady: Steady::build(written),
            quadratic: number(Id::QuadraticFriction),
            cubic: number(Id::CubicFriction),
            printed: written.choices.printed_extended,
        }
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.steady.scale_levels(level, viscous);
        self.quadratic = self.quadratic * viscous;
        self.cubic = self.cubic * viscous;
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.steady.velocity_limit
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), velocity: T, effect: &E) -> Step<'_, T> {
        let velocity = self.steady.limited(velocity);
        let speed = velocity.abs();
        let sliding = self.steady.sliding(effect.coulomb(self.steady.coulomb), velocity, effect);
        // The coefficient is multiplied first, because fixed point cannot represent the square of a speed.
        let along = if self.printed { self.quadratic } else { self.quadratic * velocity };
        Step::Done(sliding + along * speed + self.cubic * velocity * speed * speed)
    }

    fn check<N: Real, S: Real>(
        written: &LawParameters<S>,
        range: &LawRange,
    ) -> Result<f32, ParameterError> {
        let value = |id: Id| written.values.single(id);
        let square = range.speed_rad_s * range.speed_rad_s;
        let along = if written.choices.printed_extended { range.speed_rad_s } else { square };
        let quadratic = value(Id::QuadraticFriction) * along;
        product::<N>(Id::QuadraticFriction.text(), quadratic)?;
        let cubic = value(Id::CubicFriction) * square * range.speed_rad_s;
        product::<N>(Id::CubicFriction.text(), cubic)?;
        Ok(quadratic.abs() + cubic.abs())
    }
}
