//! `g *= 1 + a exp(-t/T) + r t`: run-in and wear.

use super::bounds::LEAST_SHARE;
use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TimeDrift<T> {
    /// `a`, relative amplitude of the run-in.
    amplitude: T,
    /// `-1/T`, 1/h.
    per_time: T,
    /// `r`, relative wear rate, 1/h.
    rate: T,
}

/// Returns the smallest and largest factor of the level, including 1, over the campaign.
fn range<S: Real>(values: &ParameterValues<S>, envelope: &Envelope) -> (f32, f32) {
    let end_s = envelope.campaign_max_h * 3600.0;
    let amplitude = values.single(Id::DriftAmplitude);
    let start = 1.0 + amplitude;
    let end = 1.0
        + amplitude * libm::expf(-end_s / values.single(Id::DriftTime))
        + values.single(Id::DriftRate) * end_s;
    (start.min(end).min(1.0), start.max(end).max(1.0))
}

impl<T: Real> Term<T> for TimeDrift<T> {
    const PARAMETERS: &'static [Id] = &[Id::DriftAmplitude, Id::DriftTime, Id::DriftRate];

    const SIZES: &'static [Id] = &[Id::DriftAmplitude, Id::DriftRate];

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let hour = T::Setting::from_f64(3600.0);
        Self {
            amplitude: T::from_setting(values.get(Id::DriftAmplitude)),
            per_time: T::from_setting(-hour / values.get(Id::DriftTime)),
            rate: T::from_setting(values.get(Id::DriftRate) * hour),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.amplitude = of.amplitude * gain;
        self.rate = of.rate * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let time = sample.campaign_time_h;
        let run_in = self.amplitude * (self.per_time * time).exp();
        let wear = self.rate * time;
        effects.level_scale = effects.level_scale * (T::one() + run_in + wear);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.amplitude, self.per_time, self.rate, T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let faster = self.per_time.single().abs().max(self.rate.single().abs());
        faster * envelope.campaign_max_h
    }

    fn widen<S: Real>(values: &ParameterValues<S>, envelope: &Envelope, bounds: &mut Bounds) {
        let (least, most) = range(values, envelope);
        bounds.scale_level(least, most);
    }

    fn validate<S: Real>(
        values: &ParameterValues<S>,
        envelope: &Envelope,
    ) -> Result<(), ParameterError> {
        let (least, _) = range(values, envelope);
        if least < LEAST_SHARE {
            // The run-in alone leaves at least 1 % of the level, so the wear rate is the cause.
            let end_s = envelope.campaign_max_h * 3600.0;
            let why = text!("the level must stay positive to the end of the campaign");
            let rate = values.single(Id::DriftRate);
            let bound = Bound::AtLeast(rate + (LEAST_SHARE - least) / end_s);
            return refuse(Id::DriftRate.text(), rate, bound, why);
        }
        Ok(())
    }
}
