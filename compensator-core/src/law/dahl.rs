//! Dahl (1968): bristles with one level (`F_S = F_C`, `sigma1 = 0`) and viscous friction.

use super::bristle;
use super::interface::*;
use crate::effect::StribeckAxis;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Dahl<T>(pub Bristles<T>);

impl<T: Real> FrictionLaw<T> for Dahl<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::CoulombTorque, Id::BristleStiffness, Id::ViscousFriction];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self {
        Self(Bristles {
            static_level: T::from_setting(written.values.get(Id::CoulombTorque)),
            damping: T::zero(),
            damping_at_rest: T::zero(),
            // The level does not depend on speed. The Stribeck velocity is not a parameter of
            // this law, so its value must not be used: it may be NaN.
            stribeck_axis: StribeckAxis::default(),
            ..Bristles::build(written, period_s)
        })
    }

    fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.0.rescale_period(&of.0, ratio);
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.0.scale_levels(level, viscous);
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

    fn check<N: Real, S: Real>(
        written: &LawParameters<S>,
        range: &LawRange,
    ) -> Result<f32, ParameterError> {
        bristle::check::<N, S>(written, range, 0.0)
    }
}
