//! Physics of the joint: a LuGre seal and all effects that can be hidden.
//!
//! ```text
//! s  = v - k0 |v| z / g + eta3 dF_L/dt
//! z' = s, or a small share of it within the backlash of the drive
//! F  = k0 z + k1 s + k2 e(T) v + additive torques
//! |z| <= g / k0 at rest
//! g  = (F_C + loads + (F_S - F_C + k ln(1 + age/t0)) exp(-|v/v_s|^delta)) x ripple x drift x side x cold x heat
//! ```
//!
//! With all effects at their neutral size, the seal is bit-identical to `z' = v - k0 |v| z / g`.

use crate::conditions::{Condition, Conditions};
use crate::effects::{Drift, Dwell, Thinning, Warming, Wave};
use crate::friction::Seal;
use crate::outside::Outside;

/// Backlash of the drive. Within it, almost no motion reaches the bristles.
#[derive(Clone, Copy, Debug)]
pub struct Play {
    /// Width, rad.
    pub travel_rad: f64,
    /// Share of the motion within the backlash that reaches the bristles.
    pub leak: f64,
}

/// A joint: its seal and all effects. Most effects have their neutral size.
#[derive(Clone, Debug, Default)]
pub struct Joint {
    /// The seal without effects.
    pub seal: Seal,
    /// Increase of the level by the transmitted torque, Nm/Nm.
    pub per_load: f64,
    /// Gain of the transmitted torque, if the torque column contains it.
    pub load_gain: f64,
    /// Decrease of the viscous friction with temperature.
    pub thinning: Option<Thinning>,
    /// Ripple of the level over the angle.
    pub ripple: Option<Wave>,
    /// Additive torque of one period per turn.
    pub gravity: Option<Wave>,
    /// Additive torques that depend on the angle, one per order.
    pub torque_ripple: Vec<Wave>,
    /// Decrease of the level with temperature.
    pub stiffening: Option<Thinning>,
    /// Decrease of the level with the friction heat.
    pub warming: Option<Warming>,
    /// Relative difference of the level between the directions.
    pub asymmetry: f64,
    /// Constant additive torque, Nm.
    pub offset_nm: f64,
    /// Quadratic drag, Nm s^2/rad^2.
    pub drag: f64,
    /// Static friction that grows with the contact age.
    pub dwell: Option<Dwell>,
    /// Change of the level over the campaign.
    pub drift: Option<Drift>,
    /// Inertia in the torque column, kg m^2.
    pub inertia: f64,
    /// Backlash of the drive.
    pub play: Option<Play>,
    /// Exponent of the Stribeck curve.
    pub stribeck_exponent: f64,
    /// Delay of the torque channel, s.
    pub delay_s: f64,
    /// Effect outside the catalogue.
    pub outside: Option<Outside>,
}

/// Ratio to the Stribeck velocity above which the curve of exponent 2 is below 1e-16.
const MAX_STRIBECK_RATIO: f64 = 6.1;

impl Joint {
    /// Returns a joint that consists of the seal only.
    pub fn plain(seal: Seal) -> Self {
        Self { seal, stribeck_exponent: 2.0, ..Self::default() }
    }

    /// Returns the operating conditions at a time of the run.
    ///
    /// Quantities without an effect are not computed, because the sines dominate the cost of a step.
    pub fn conditions_at(&self, condition: &Condition, t: f64) -> Conditions {
        let mut conditions =
            Conditions { campaign_s: condition.start_s + t, ..Conditions::default() };
        if self.seal.per_force != 0.0 || self.seal.eta3 != 0.0 {
            conditions.force = condition.force.at(t);
        }
        if self.seal.eta3 != 0.0 {
            conditions.force_rate = condition.force.rate(t);
        }
        if self.seal.per_pressure != 0.0 {
            conditions.pressure = condition.pressure.at(t);
        }
        if self.per_load != 0.0 || self.load_gain != 0.0 {
            conditions.load = condition.load.at(t);
        }
        let outside = self.outside.as_ref();
        let depends_on_temperature = self.thinning.is_some() || self.stiffening.is_some();
        if depends_on_temperature || outside.is_some_and(Outside::follows_temperature) {
            conditions.temperature = condition.temperature.at(t);
        }
        if let Some(extra) = outside.and_then(|outside| outside.flavour.extra()) {
            conditions.extra = condition.extra(extra).at(t);
        }
        conditions
    }

    /// Returns the Stribeck curve at a speed: 1 at rest, falling towards 0.
    pub fn stribeck_curve(&self, speed: f64) -> f64 {
        let ratio = speed / self.seal.stribeck_rad_s;
        if self.stribeck_exponent != 2.0 {
            (-ratio.powf(self.stribeck_exponent)).exp()
        } else if ratio < MAX_STRIBECK_RATIO {
            (-ratio * ratio).exp()
        } else {
            0.0
        }
    }

    /// Returns the slip level `g` of the bristles at `speed` in `direction` (1 or -1), Nm.
    pub fn level(
        &self,
        speed: f64,
        direction: f64,
        angle: f64,
        age_s: f64,
        now: &Conditions,
    ) -> f64 {
        self.level_on_curve(self.stribeck_curve(speed), speed, direction, angle, age_s, now)
    }

    /// Returns the slip level for a given value of the Stribeck curve, Nm.
    ///
    /// A contact with a lubricant film is on another point of the curve than its speed alone gives.
    pub fn level_on_curve(
        &self,
        curve: f64,
        speed: f64,
        direction: f64,
        angle: f64,
        age_s: f64,
        now: &Conditions,
    ) -> f64 {
        let seal = &self.seal;
        let loads = seal.per_force * now.force
            + seal.per_pressure * now.pressure
            + self.per_load * now.load.abs();
        let mut excess = seal.static_nm - seal.coulomb_nm;
        if let Some(dwell) = self.dwell {
            excess += dwell.raised_nm(age_s);
        }
        let mut level = seal.coulomb_nm + loads + excess * curve;
        if let Some(ripple) = self.ripple {
            level *= 1.0 + ripple.at(angle);
        }
        if let Some(drift) = self.drift {
            level *= drift.factor(now.campaign_s);
        }
        if let Some(stiffening) = self.stiffening {
            level *= stiffening.factor(now.temperature);
        }
        if let Some(warming) = self.warming {
            level *= warming.factor(now.heat_j);
        }
        if let Some(outside) = &self.outside {
            level = outside.level(level, speed, angle, now);
        }
        // Lower bound of the level. Effects of plausible size do not reach it.
        (level * (1.0 + self.asymmetry * direction)).max(0.01 * seal.coulomb_nm)
    }

    /// Returns the viscous torque, Nm.
    pub fn viscous(&self, velocity: f64, direction: f64, now: &Conditions) -> f64 {
        let film = self.thinning.map_or(1.0, |thinning| thinning.factor(now.temperature));
        self.seal.k2 * film * (1.0 + self.asymmetry * direction) * velocity
    }

    /// Returns the sum of all torques besides the friction of the seal, Nm.
    pub fn added(&self, angle: f64, velocity: f64, acceleration: f64, now: &Conditions) -> f64 {
        self.offset_nm
            + self.gravity.map_or(0.0, |gravity| gravity.at(angle))
            + self.torque_ripple.iter().map(|wave| wave.at(angle)).sum::<f64>()
            + self.drag * velocity * velocity.abs()
            + self.inertia * acceleration
            + self.load_gain * now.load
            + self.outside.as_ref().map_or(0.0, |outside| outside.added(now))
    }

    /// Returns the maximum step with a negligible change of the level per step, s.
    pub fn longest_step_s(&self, peak_speed: f64) -> f64 {
        /// Maximum phase change of a ripple in a step, rad.
        const MAX_PHASE_RAD: f64 = 0.05;
        let order = self.ripple.map_or(0.0, |ripple| ripple.order);
        if order * peak_speed > 0.0 { MAX_PHASE_RAD / (order * peak_speed) } else { f64::INFINITY }
    }
}
