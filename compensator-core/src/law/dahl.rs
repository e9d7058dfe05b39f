//! Dahl (1968): bristles of one level, `F_S = F_C` and `sigma1 = 0`, and a viscous part.

use super::bristle::{self, Bristles};
use super::interface::{FrictionLaw, Step};
use super::written::{Range, Written};
use crate::effect::Effect;
use crate::number::Real;
use crate::parameter::ParameterId as Id;
use crate::refusal::ParameterError;

/// Built for a sample period.
#[derive(Clone, Copy, Debug)]
pub struct Dahl<T>(pub Bristles<T>);

impl<T: Real> FrictionLaw<T> for Dahl<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::CoulombTorque, Id::BristleStiffness, Id::ViscousFriction];

    type Memory = ();

    fn build(written: &Written<T::Setting>, period_s: T::Setting) -> Self {
        Self(Bristles {
            static_level: T::from_setting(written.values.get(Id::CoulombTorque)),
            damping: T::zero(),
            damping_at_rest: T::zero(),
            // At every speed as at rest: the Stribeck velocity is none of this law's
            // parameters and may be anything, NaN too.
            stribeck_end: T::zero(),
            cells_per_velocity: T::zero(),
            ..Bristles::build(written, period_s)
        })
    }

    fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.0.rescale_period(&of.0, ratio);
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.0.velocity_limit
    }

    fn sliding_torque(&self) -> T {
        self.0.coulomb
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), _: T, _: &E) -> Step<'_, T> {
        Step::of(&self.0)
    }

    fn check<N: Real, S: Real>(written: &Written<S>, range: &Range) -> Result<f64, ParameterError> {
        bristle::check::<N, S>(written, range, 0.0)
    }
}
