//! `F_S += k ln(1 + age/t0)`: the breakaway torque increases with the time at rest.
//!
//! The age of the contact follows Dieterich (1979): `d(age)/dt = 1 - |v| age / travel`. The implicit step keeps
//! the age positive. The age decays within one `travel`.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DwellTimeStatic<T> {
    /// `k`, Nm.
    gain: T,
    /// `1/t0`, 1/s.
    per_time: T,
    /// Sample period, s.
    period: T,
    /// Sample period over the travel that renews the contact, s/rad.
    renewal: T,
}

/// Maximum contact age, s. It keeps fixed point in range; the effect grows only with the logarithm of the age.
const CONTACT_AGE_MAX_S: f64 = 1000.0;

impl<T: Real> Term<T> for DwellTimeStatic<T> {
    const PARAMETERS: &'static [Id] = &[Id::DwellGain, Id::DwellTime, Id::DwellTravel];

    const SIZES: &'static [Id] = &[Id::DwellGain];

    /// Age of the contact, s.
    type Memory = T;

    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self {
        let one = T::Setting::from_f64(1.0);
        Self {
            gain: T::from_setting(values.get(Id::DwellGain)),
            per_time: T::from_setting(one / values.get(Id::DwellTime)),
            period: T::from_setting(period_s),
            renewal: T::from_setting(period_s / values.get(Id::DwellTravel)),
        }
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self { period: self.period * ratio, renewal: self.renewal * ratio, ..*self }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.gain = of.gain * gain;
    }

    #[inline]
    fn act(&self, _: &Sample<T>, contact_age_s: &mut Self::Memory, effects: &mut Effects<T>) {
        let one = T::one();
        let oldest = T::from_f64(CONTACT_AGE_MAX_S);
        let aged = (*contact_age_s + self.period).at_most(oldest);
        // `/` has full precision. In fixed point, the rounding error of `ratio` at a large age would
        // exceed the increase in one sample.
        *contact_age_s = aged / (one + self.renewal * effects.velocity.abs());
        effects.seal.static_level =
            effects.seal.static_level + self.gain * (one + *contact_age_s * self.per_time).ln();
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // The period is not checked: a relative error of the age causes only a similar error of the gain.
        [self.gain, self.per_time, self.renewal, T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let speed = envelope.velocity_max_rad_s;
        let size = |coefficient: T| coefficient.single().abs();
        let aged = size(self.per_time) * CONTACT_AGE_MAX_S as f32;
        (size(self.gain) * libm::logf(1.0 + aged)).max(size(self.renewal) * speed).max(aged)
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        let ages = CONTACT_AGE_MAX_S as f32 / values.single(Id::DwellTime);
        bounds.static_level += values.single(Id::DwellGain) * libm::logf(1.0 + ages);
    }
}
