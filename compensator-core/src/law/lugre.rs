//! LuGre: bristles with the Stribeck curve (Ding et al., eq. 1; the damper paper, eq. 12-13); see [`super::bristle`].

use super::bristle;
use super::interface::*;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Lugre<T>(pub Bristles<T>);

impl<T: Real> FrictionLaw<T> for Lugre<T> {
    const PARAMETERS: &'static [Id] = &[
        Id::CoulombTorque,
        Id::StaticTorque,
        Id::StribeckVelocity,
        Id::BristleStiffness,
        Id::BristleDamping,
        Id::ViscousFriction,
    ];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self {
        Self(Bristles::build(written, period_s))
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
        bristle::check::<N, S>(written, range, written.values.single(Id::BristleDamping))
    }
}
