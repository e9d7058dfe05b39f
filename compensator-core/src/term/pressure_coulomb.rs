//! `F_C += k dP`, `F_S` likewise: pressure preloads the seal.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PressureCoulomb<T> {
    /// Increase of `F_C`, Nm/MPa.
    coulomb: T,
    /// Increase of `F_S`, Nm/MPa.
    static_level: T,
}

impl<T: Real> Term<T> for PressureCoulomb<T> {
    const PARAMETERS: &'static [Id] = &[Id::PressureCoulomb, Id::PressureStaticExcess];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::Pressure);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let mega = T::Setting::from_f64(1e6);
        let (coulomb, excess) =
            (values.get(Id::PressureCoulomb), values.get(Id::PressureStaticExcess));
        Self {
            coulomb: T::from_setting(coulomb * mega),
            static_level: T::from_setting((coulomb + excess) * mega),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.coulomb = of.coulomb * gain;
        self.static_level = of.static_level * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let pressure = sample.pressure_diff_mpa;
        effects.seal.coulomb = effects.seal.coulomb + self.coulomb * pressure;
        effects.seal.static_level = effects.seal.static_level + self.static_level * pressure;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coulomb, self.static_level, T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let steeper = self.coulomb.single().abs().max(self.static_level.single().abs());
        steeper * envelope.pressure_diff_max_pa * 1e-6
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.per_pascal.coulomb += values.single(Id::PressureCoulomb);
        bounds.per_pascal.excess += values.single(Id::PressureStaticExcess);
    }
}
