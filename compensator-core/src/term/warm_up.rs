//! `g *= 1 - a (1 - exp(-h))`, `dh/dt = P/E0 - h/T`: friction decreases as it heats the seal.
//!
//! The term estimates the heat from the friction power, for joints without a temperature sensor. `P` is the power
//! that the law dissipates, `E0` the energy that causes 63 % of the decrease, and `T` the time constant of the
//! cooling. `h` changes over minutes, but a sample of a driver takes only 50 us. In `f32`, its change in one
//! sample would be lost in rounding. The term therefore updates `h` every [`HEAT_UPDATE_PERIOD_S`], from the work
//! accumulated since the last update.

use super::interface::*;

/// Update period of the heat, s. It is much shorter than any warming, and long compared with a sample.
const HEAT_UPDATE_PERIOD_S: f64 = 0.5;

/// Maximum heat `h`, dimensionless. Above it the level is constant: `exp(-16)` is 1e-7.
const MAX_HEAT: f64 = 16.0;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WarmUp<T> {
    /// `a`, share of the level that is lost by warming.
    fall: T,
    /// Sample period over [`HEAT_UPDATE_PERIOD_S`].
    share: T,
    /// [`HEAT_UPDATE_PERIOD_S`] over `E0`, 1/W.
    per_power: T,
    /// [`HEAT_UPDATE_PERIOD_S`] over `T`.
    cooling: T,
}

/// Memory of the term.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heat<T> {
    /// Power that the law dissipated in the last sample, W.
    pub power: T,
    /// `h`, heat, dimensionless.
    pub heat: T,
    /// Work since the last update over [`HEAT_UPDATE_PERIOD_S`], W.
    work: T,
    /// Time since the last update over [`HEAT_UPDATE_PERIOD_S`].
    waited: T,
}

impl<T: Real> Term<T> for WarmUp<T> {
    const PARAMETERS: &'static [Id] = &[Id::WarmUpFall, Id::WarmUpEnergy, Id::WarmUpCooling];

    const SIZES: &'static [Id] = &[Id::WarmUpFall];

    type Memory = Heat<T>;

    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self {
        let step = T::Setting::from_f64(HEAT_UPDATE_PERIOD_S);
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

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.fall = of.fall * gain;
    }

    // Out of line, because inlined into the loop over the terms it would slow down the others.
    #[inline(never)]
    fn act(&self, _: &Sample<T>, memory: &mut Self::Memory, effects: &mut Effects<T>) {
        let (zero, one) = (T::zero(), T::one());
        memory.work = memory.work + memory.power * self.share;
        memory.waited = memory.waited + self.share;
        if memory.waited >= one {
            let lost = memory.heat * (self.cooling * memory.waited).at_most(one);
            let heat = memory.heat + memory.work * self.per_power - lost;
            memory.heat = heat.at_least(zero).at_most(T::from_f64(MAX_HEAT));
            (memory.work, memory.waited) = (zero, zero);
        }
        let fallen = self.fall * (one - (-memory.heat).exp());
        effects.level_scale = effects.level_scale * (one - fallen);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        // The sample period is not checked: a relative error acts like the same error of `E0` and `T`.
        [self.fall, self.per_power, self.cooling, T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        // The heat. The law has already checked the power, torque times speed.
        MAX_HEAT as f32
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        let left = 1.0 - values.single(Id::WarmUpFall);
        bounds.scale_level(left.min(1.0), left.max(1.0));
    }
}
