//! With `f1 v |v| + f2 v^3` besides (the manipulator paper, eq. 5), or as printed with the even `f1 v sgn v = f1 |v|`,
//! which does not dissipate.

use super::interface::{FrictionLaw, Step};
use super::steady::Steady;
use super::written::{Range, Written};
use crate::effect::Effect;
use crate::fits::product;
use crate::number::Real;
use crate::parameter::ParameterId as Id;
use crate::refusal::ParameterError;

/// Built for a sample period.
#[derive(Clone, Copy, Debug)]
pub struct Extended<T> {
    /// Coulomb and viscous friction.
    pub steady: Steady<T>,
    /// `f1`, Nm s^2/rad^2 (printed form: Nm s/rad).
    pub quadratic: T,
    /// `f2`, Nm s^3/rad^3.
    pub cubic: T,
    /// Take eq. 5 as it is printed.
    pub printed: bool,
}

impl<T: Real> FrictionLaw<T> for Extended<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::CoulombTorque, Id::ViscousFriction, Id::QuadraticFriction, Id::CubicFriction];

    type Memory = ();

    fn build(written: &Written<T::Setting>, _: T::Setting) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            steady: Steady::build(written),
            quadratic: number(Id::QuadraticFriction),
            cubic: number(Id::CubicFriction),
            printed: written.choices.printed_extended,
        }
    }

    fn rescale_period(&mut self, _: &Self, _: T) {}

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.steady.velocity_limit
    }

    fn sliding_torque(&self) -> T {
        T::zero()
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), velocity: T, effect: &E) -> Step<'_, T> {
        let velocity = self.steady.limited(velocity);
        let speed = velocity.abs();
        let sliding = self.steady.sliding(effect.coulomb(self.steady.coulomb), velocity, effect);
        // The coefficient goes first: fixed point could not hold the square of a speed.
        let along = if self.printed { self.quadratic } else { self.quadratic * velocity };
        Step::Done(sliding + along * speed + self.cubic * velocity * speed * speed)
    }

    fn check<N: Real, S: Real>(written: &Written<S>, range: &Range) -> Result<f64, ParameterError> {
        let value = |id: Id| written.values.value(id);
        let square = range.speed * range.speed;
        product::<N>(Id::QuadraticFriction.name(), value(Id::QuadraticFriction) * square)?;
        product::<N>(Id::CubicFriction.name(), value(Id::CubicFriction) * square * range.speed)?;
        Ok(0.0)
    }
}
