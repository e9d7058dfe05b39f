//! `v(t - d)`: velocity and torque are logged at different times.
//!
//! It acts before all others, which are to see the delayed velocity.

use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::{Bound, ParameterError, refuse};

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ChannelDelay<T> {
    /// Whole samples, at most [`DELAY_LINE`] - 2. Split when built, because taking a whole number out of a
    /// float pulls soft double arithmetic into every sample.
    whole: u8,
    /// What is left, 0..=1.
    fraction: T,
}

/// Samples a delay line holds: the longest delay is one less.
const DELAY_LINE: usize = 32;

/// Past velocities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DelayLine<T> {
    velocities: [T; DELAY_LINE],
    /// The index of the last.
    newest: u8,
    filled: bool,
}

impl<T: Real> Default for DelayLine<T> {
    fn default() -> Self {
        Self { velocities: [T::zero(); DELAY_LINE], newest: 0, filled: false }
    }
}

impl<T: Real> DelayLine<T> {
    /// The velocity `delay` samples ago, between samples by a straight line. Before the line has
    /// filled, the first velocity stands for all earlier ones.
    fn delayed(&mut self, velocity: T, whole: u8, fraction: T) -> T {
        if !self.filled {
            self.velocities = [velocity; DELAY_LINE];
            self.filled = true;
        }
        self.newest = (self.newest + 1) % DELAY_LINE as u8;
        self.velocities[usize::from(self.newest) % DELAY_LINE] = velocity;
        let whole = usize::from(whole).min(DELAY_LINE - 2);
        let back = |samples: usize| {
            self.velocities[(usize::from(self.newest) + DELAY_LINE - samples) % DELAY_LINE]
        };
        back(whole) + (back(whole + 1) - back(whole)) * fraction
    }
}

impl<T: Real> ChannelDelay<T> {
    /// A delay of so many samples, split; a longer one than the line holds is the longest.
    fn of_samples(samples: T) -> Self {
        let whole = (samples.value() as usize).min(DELAY_LINE - 2);
        Self { whole: whole as u8, fraction: samples - T::from_f64(whole as f64) }
    }
}

impl<T: Real> Term<T> for ChannelDelay<T> {
    const PARAMETERS: &'static [Id] = &[Id::ChannelDelay];

    const READS: Option<Quantity> = None;

    const ACTS_FIRST: bool = true;

    type Memory = DelayLine<T>;

    fn build(values: &Values<T::Setting>, period_s: T::Setting) -> Self {
        Self::of_samples(T::from_setting(values.get(Id::ChannelDelay) / period_s))
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self::of_samples((self.fraction + T::from_f64(f64::from(self.whole))) / ratio)
    }

    #[inline]
    fn act(&self, _: &Sample<T>, line: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.velocity = line.delayed(effects.velocity, self.whole, self.fraction);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.fraction, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f64 {
        1.0
    }

    fn widen<S: Real>(_: &Values<S>, _: &Envelope, _: &mut Bounds) {
        // A velocity of before is within the envelope as well.
    }

    fn validate<S: Real>(_: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }

    fn validate_period<S: Real>(values: &Values<S>, period_s: f64) -> Result<(), ParameterError> {
        let longest = (DELAY_LINE - 1) as f64 * period_s;
        let delay = values.value(Id::ChannelDelay);
        if delay > longest {
            let why = "the delay line holds 31 samples";
            return refuse(Id::ChannelDelay.name(), delay, Bound::AtMost(longest), why);
        }
        Ok(())
    }
}
