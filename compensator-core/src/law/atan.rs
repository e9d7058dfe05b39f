//! Coulomb and viscous friction plus `f0 + fa atan(fb v)` (the manipulator paper, eq. 6).

use super::interface::*;
use super::steady::Steady;
use crate::fits::product;
use crate::text;
use core::f32::consts::FRAC_PI_2;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Atan<T> {
    /// Coulomb and viscous friction.
    pub steady: Steady<T>,
    /// `f0`, Nm.
    pub offset: T,
    /// `fa`, Nm.
    pub torque: T,
    /// `fb`, s/rad.
    pub slope: T,
}

impl<T: Real> FrictionLaw<T> for Atan<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::TorqueOffset, Id::CoulombTorque, Id::ViscousFriction, Id::AtanTorque, Id::AtanSlope];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, _: T::Setting) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            steady: Steady::build(written),
            offset: number(Id::TorqueOffset),
            torque: number(Id::AtanTorque),
            slope: number(Id::AtanSlope),
        }
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.steady.scale_levels(level, viscous);
        self.torque = self.torque * level;
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.steady.velocity_limit
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), velocity: T, effect: &E) -> Step<'_, T> {
        let velocity = self.steady.limited(velocity);
        let sliding = self.steady.sliding(effect.coulomb(self.steady.coulomb), velocity, effect);
        Step::Done(sliding + self.offset + self.torque * (self.slope * velocity).atan())
    }

    fn check<N: Real, S: Real>(
        written: &LawParameters<S>,
        range: &LawRange,
    ) -> Result<f32, ParameterError> {
        let value = |id: Id| written.values.single(id);
        product::<N>(text!("atan_slope * velocity_max"), value(Id::AtanSlope) * range.speed_rad_s)?;
        let torque = value(Id::AtanTorque) * FRAC_PI_2;
        product::<N>(Id::AtanTorque.text(), torque)?;
        Ok(value(Id::TorqueOffset).abs() + torque.abs())
    }
}
