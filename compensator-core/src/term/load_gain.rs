//! `+ k tau_L`: the known load in the scale of the torque channel. It is a rigid-body part, not a cause.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LoadGain<T> {
    /// Factor of the load torque.
    gain: T,
}

impl<T: Real> Term<T> for LoadGain<T> {
    const PARAMETERS: &'static [Id] = &[Id::LoadGain];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::LoadTorque);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self { gain: T::from_setting(values.get(Id::LoadGain)) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.gain = of.gain * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.torque = effects.torque + self.gain * sample.load_torque_nm;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.gain, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.gain.single().abs() * envelope.load_torque_max_nm
    }

    fn widen<S: Real>(values: &ParameterValues<S>, envelope: &Envelope, bounds: &mut Bounds) {
        let largest = envelope.load_torque_max_nm;
        bounds.torque += values.single(Id::LoadGain).abs() * largest;
    }
}
