//! `g *= 1 - a (1 - exp(-h))`, `dh/dt = P/E0 - h/T`: friction falls with the heat it leaves.
//!
//! What rubs gets warm, and where no temperature is measured the work of the friction itself says how warm:
//! `P` is what the law dissipates, `E0` the energy that takes the level most of the way down, `T` the time in
//! which the heat is lost again. `h` changes over minutes and a driver's sample takes 50 us: added up sample by
//! sample it would be lost in the rounding of an `f32`, so the work of [`STEP_S`] is added up first.

use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::ParameterError;

/// How often the heat is brought up to date, s: short against every warming, and ten thousand samples.
const STEP_S: f64 = 0.5;

/// Heat beyond which nothing changes: `exp(-16)` is 1e-7.
const MOST: f64 = 16.0;

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WarmUp<T> {
    /// `a`.
    fall: T,
    /// The sample period over [`STEP_S`].
    share: T,
    /// [`STEP_S`] over `E0`, 1/W.
    per_power: T,
    /// [`STEP_S`] over `T`.
    cooling: T,
}

/// What it remembers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heat<T> {
    /// What the law dissipated in the last sample, W.
    pub power: T,
    /// `h`.
    pub heat: T,
    /// Mean power since the heat was brought up to date times `waited`, W.
    work: T,
    /// Time since then over [`STEP_S`].
    waited: T,
}

impl<T: Real> Term<T> for WarmUp<T> {
    const PARAMETERS: &'static [Id] = &[Id::WarmUpFall, Id::WarmUpEnergy, Id::WarmUpCooling];

    const READS: Option<Quantity> = None;

    type Memory = Heat<T>;

    fn build(values: &Values<T::Setting>, period_s: T::Setting) -> Self {
        let step = T::Setting::from_f64(STEP_S);
        Self {
            fall: T::from_setting(values.get(Id::WarmUpFall)),
            share: T::from_setting(period_s / step),
            per_power: T::from_setting(step / values.get(Id::WarmUpEnergy)),
            cooling: T::from_setting(step / values.get(Id::WarmUpCooling)),
        }
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self { share: self.share * ratio, ..*self }
    }

    // Out of line, as the lookup table.
    #[inline(never)]
    fn act(&self, _: &Sample<T>, memory: &mut Self::Memory, effects: &mut Effects<T>) {
        let (zero, one) = (T::zero(), T::one());
        memory.work = memory.work + memory.power * self.share;
        memory.waited = memory.waited + self.share;
        if memory.waited >= one {
            let lost = memory.heat * (self.cooling * memory.waited).at_most(one);
            let heat = memory.heat + memory.work * self.per_power - lost;
            memory.heat = heat.at_least(zero).at_most(T::from_f64(MOST));
            (memory.work, memory.waited) = (zero, zero);
        }
        let fallen = self.fall * (one - (-memory.heat).exp());
        effects.level_scale = effects.level_scale * (one - fallen);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // A clock that is a percent wrong is an energy and a time that are.
        [self.fall, self.per_power, self.cooling, T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f64 {
        // The heat; the power is torque times speed, which the law has held already.
        MOST
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        let left = 1.0 - values.value(Id::WarmUpFall);
        bounds.scale_level(left.min(1.0), left.max(1.0));
    }

    fn validate<S: Real>(_: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }
}
