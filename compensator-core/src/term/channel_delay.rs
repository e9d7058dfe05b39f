//! `v(t - d)`: velocity and torque are logged with a time offset.
//!
//! The term acts before all others, because they use the delayed velocity.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ChannelDelay<T> {
    /// Integer part of the delay, samples; at most [`DELAY_LINE_SAMPLES`] - 2.
    ///
    /// The delay is split at build time. A split in every sample would need emulated `f32` arithmetic.
    whole: u8,
    /// Fractional part of the delay, samples, 0..=1.
    fraction: T,
}

/// Length of the delay line, samples. The longest delay is one sample less.
const DELAY_LINE_SAMPLES: usize = 32;

/// Ring buffer of past velocities, rad/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DelayLine<T> {
    velocities: [T; DELAY_LINE_SAMPLES],
    /// Index of the newest velocity.
    newest: u8,
    filled: bool,
}

impl<T: Real> Default for DelayLine<T> {
    fn default() -> Self {
        Self { velocities: [T::zero(); DELAY_LINE_SAMPLES], newest: 0, filled: false }
    }
}

impl<T: Real> DelayLine<T> {
    /// Stores `velocity` and returns the velocity `whole + fraction` samples ago, by linear interpolation.
    ///
    /// Velocities before the first sample equal that of the first sample.
    fn delayed(&mut self, velocity: T, whole: u8, fraction: T) -> T {
        if !self.filled {
            self.velocities = [velocity; DELAY_LINE_SAMPLES];
            self.filled = true;
        }
        self.newest = (self.newest + 1) % DELAY_LINE_SAMPLES as u8;
        self.velocities[usize::from(self.newest) % DELAY_LINE_SAMPLES] = velocity;
        let whole = usize::from(whole).min(DELAY_LINE_SAMPLES - 2);
        let back = |samples: usize| {
            self.velocities
                [(usize::from(self.newest) + DELAY_LINE_SAMPLES - samples) % DELAY_LINE_SAMPLES]
        };
        back(whole) + (back(whole + 1) - back(whole)) * fraction
    }
}

impl<T: Real> ChannelDelay<T> {
    /// Splits a delay in samples into its parts. One beyond the line, by a rescaled period, becomes the longest.
    fn from_samples(samples: T) -> Self {
        let whole = (samples.single() as usize).min(DELAY_LINE_SAMPLES - 2) as u8;
        Self { whole, fraction: (samples - T::from_count(whole)).at_most(T::one()) }
    }
}

impl<T: Real> Term<T> for ChannelDelay<T> {
    const PARAMETERS: &'static [Id] = &[Id::ChannelDelay];

    const IS_APPLIED_FIRST: bool = true;

    type Memory = DelayLine<T>;

    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self {
        Self::from_samples(T::from_setting(values.get(Id::ChannelDelay) / period_s))
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self::from_samples((self.fraction + T::from_f64(f64::from(self.whole))) / ratio)
    }

    #[inline]
    fn act(&self, _: &Sample<T>, line: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.velocity = line.delayed(effects.velocity, self.whole, self.fraction);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.fraction, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        1.0
    }

    fn widen<S: Real>(_: &ParameterValues<S>, _: &Envelope, _: &mut Bounds) {
        // A past velocity is also within the envelope.
    }

    fn validate_period<S: Real>(
        values: &ParameterValues<S>,
        period_s: f32,
    ) -> Result<(), ParameterError> {
        let longest = (DELAY_LINE_SAMPLES - 1) as f32 * period_s;
        let delay = values.single(Id::ChannelDelay);
        if delay > longest {
            let why = text!("the delay line holds 31 samples");
            return refuse(Id::ChannelDelay.text(), delay, Bound::AtMost(longest), why);
        }
        Ok(())
    }
}
