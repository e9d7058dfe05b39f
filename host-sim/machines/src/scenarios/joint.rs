//! The joint's physics: a LuGre seal and everything that may act on it unseen.
//!
//! ```text
//! s  = v - k0 |v| z / g + eta3 dF_L/dt
//! z' = s, or within the play of the drive next to nothing of it
//! F  = k0 z + k1 s + k2 e(T) v + what adds to it
//! |z| <= g / k0 at rest
//! g  = (F_C + loads + (F_S - F_C + k ln(1 + age/t0)) exp(-|v/v_s|^delta)) x ripple x drift x side x cold x heat
//! ```
//!
//! Each effect at its neutral size leaves the seal of `z' = v - k0 |v| z / g`, to the last bit.

use super::outside::Outside;
use super::surroundings::{Around, Condition};
use crate::friction::Seal;

/// What falls as it warms: the viscous film, or the level of a seal that stiffens with cold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thinning {
    pub per_k: f64,
    pub reference_c: f64,
}

impl Thinning {
    fn factor(&self, temperature_c: f64) -> f64 {
        (-self.per_k * (temperature_c - self.reference_c)).exp()
    }
}

/// A sine of the angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave {
    pub size: f64,
    /// Periods in one turn.
    pub order: f64,
    pub phase: f64,
}

impl Wave {
    fn at(&self, angle: f64) -> f64 {
        self.size * (self.order * angle + self.phase).sin()
    }
}

/// Contact that grows stronger with rest. Its age grows with time and is lost with travel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dwell {
    pub gain_nm: f64,
    pub onset_s: f64,
    pub travel_rad: f64,
}

/// The level over the campaign; 1 at its beginning.
#[derive(Clone, Copy, Debug)]
pub(super) enum Drift {
    /// `1 + rate t`.
    Wear { per_s: f64 },
    /// `(1 + a exp(-t/T)) / (1 + a)`.
    RunIn { amplitude: f64, time_s: f64 },
}

impl Drift {
    fn factor(&self, campaign_s: f64) -> f64 {
        match *self {
            Drift::Wear { per_s } => 1.0 + per_s * campaign_s,
            Drift::RunIn { amplitude, time_s } => {
                (1.0 + amplitude * (-campaign_s / time_s).exp()) / (1.0 + amplitude)
            }
        }
    }
}

/// What was rubbed warms the seal, and the level falls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warming {
    /// Share of the level that goes in the end.
    pub fall: f64,
    /// Heat at which all but a share of 1/e of that has gone, J.
    pub energy_j: f64,
    /// Time in which the heat is lost, s.
    pub cooling_s: f64,
}

impl Warming {
    fn factor(&self, heat_j: f64) -> f64 {
        1.0 + self.fall * (-heat_j / self.energy_j).exp_m1()
    }
}

/// Play in the drive: within it the bristles take up hardly any motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Play {
    pub travel_rad: f64,
    /// Share of the motion that still reaches the bristles.
    pub leak: f64,
}

/// A joint: its seal and all effects, most of them neutral.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub seal: Seal,
    pub per_load: f64,
    /// Gain on the transmitted torque where the torque column holds it.
    pub load_gain: f64,
    pub thinning: Option<Thinning>,
    pub ripple: Option<Wave>,
    pub gravity: Option<Wave>,
    /// Additive torques of the angle, one of each order.
    pub torque_ripple: Vec<Wave>,
    pub stiffening: Option<Thinning>,
    pub warming: Option<Warming>,
    pub asymmetry: f64,
    pub offset_nm: f64,
    pub drag: f64,
    pub dwell: Option<Dwell>,
    pub drift: Option<Drift>,
    pub inertia: f64,
    pub play: Option<Play>,
    pub stribeck_exponent: f64,
    /// The torque of a row is of so much earlier, s.
    pub delay_s: f64,
    pub outside: Option<Outside>,
}

/// Beyond this many Stribeck velocities the curve of exponent 2 is below 1e-16.
const CURVE_END: f64 = 6.1;

impl Joint {
    /// A seal and nothing else.
    pub fn plain(seal: Seal) -> Self {
        Self {
            seal,
            per_load: 0.0,
            load_gain: 0.0,
            thinning: None,
            ripple: None,
            gravity: None,
            torque_ripple: Vec::new(),
            stiffening: None,
            warming: None,
            asymmetry: 0.0,
            offset_nm: 0.0,
            drag: 0.0,
            dwell: None,
            drift: None,
            inertia: 0.0,
            play: None,
            stribeck_exponent: 2.0,
            delay_s: 0.0,
            outside: None,
        }
    }

    /// What acts at a time of the run. What does not act is not computed: sines are most of the
    /// cost of a step.
    pub fn around(&self, condition: &Condition, t: f64) -> Around {
        let mut around = Around { campaign_s: condition.start_s + t, ..Around::default() };
        if self.seal.per_force != 0.0 || self.seal.eta3 != 0.0 {
            around.force = condition.force.at(t);
        }
        if self.seal.eta3 != 0.0 {
            around.force_rate = condition.force.rate(t);
        }
        if self.seal.per_pressure != 0.0 {
            around.pressure = condition.pressure.at(t);
        }
        if self.per_load != 0.0 || self.load_gain != 0.0 {
            around.load = condition.load.at(t);
        }
        let outside = self.outside.as_ref();
        let warms = self.thinning.is_some() || self.stiffening.is_some();
        if warms || outside.is_some_and(Outside::follows_temperature) {
            around.temperature = condition.temperature.at(t);
        }
        if let Some(extra) = outside.and_then(|outside| outside.flavour.extra()) {
            around.extra = condition.extra(extra).at(t);
        }
        around
    }

    /// The level `g` the bristles slip at when moving at `speed` in `direction` (1 or -1), Nm.
    pub fn level(&self, speed: f64, direction: f64, angle: f64, age_s: f64, now: &Around) -> f64 {
        let seal = &self.seal;
        let ratio = speed / seal.stribeck_rad_s;
        let curve = if self.stribeck_exponent != 2.0 {
            (-ratio.powf(self.stribeck_exponent)).exp()
        } else if ratio < CURVE_END {
            (-ratio * ratio).exp()
        } else {
            0.0
        };
        let loads = seal.per_force * now.force
            + seal.per_pressure * now.pressure
            + self.per_load * now.load.abs();
        let mut excess = seal.static_nm - seal.coulomb_nm;
        if let Some(dwell) = self.dwell {
            excess += dwell.gain_nm * (age_s / dwell.onset_s).ln_1p();
        }
        let mut level = seal.coulomb_nm + loads + excess * curve;
        if let Some(ripple) = self.ripple {
            level *= 1.0 + ripple.at(angle);
        }
        if let Some(drift) = self.drift {
            level *= drift.factor(now.campaign_s);
        }
        if let Some(stiffening) = self.stiffening {
            level *= (-stiffening.per_k * (now.temperature - stiffening.reference_c)).exp();
        }
        if let Some(warming) = self.warming {
            level *= warming.factor(now.heat_j);
        }
        if let Some(outside) = &self.outside {
            level = outside.level(level, speed, angle, now);
        }
        // A level at or below zero would be no friction at all; no effect of a sane size gets here.
        (level * (1.0 + self.asymmetry * direction)).max(0.01 * seal.coulomb_nm)
    }

    /// Viscous torque, Nm.
    pub fn viscous(&self, velocity: f64, direction: f64, now: &Around) -> f64 {
        let film = self.thinning.map_or(1.0, |thinning| thinning.factor(now.temperature));
        self.seal.k2 * film * (1.0 + self.asymmetry * direction) * velocity
    }

    /// Everything that adds to friction, Nm.
    pub fn added(&self, angle: f64, velocity: f64, acceleration: f64, now: &Around) -> f64 {
        self.offset_nm
            + self.gravity.map_or(0.0, |gravity| gravity.at(angle))
            + self.torque_ripple.iter().map(|wave| wave.at(angle)).sum::<f64>()
            + self.drag * velocity * velocity.abs()
            + self.inertia * acceleration
            + self.load_gain * now.load
            + self.outside.as_ref().map_or(0.0, |outside| outside.added(now))
    }

    /// Longest step at which this joint's level changes little from step to step, s.
    pub fn longest_step_s(&self, peak_speed: f64) -> f64 {
        /// Share of a ripple's period, rad, that may go by in a step.
        const PHASE_RAD: f64 = 0.05;
        let order = self.ripple.map_or(0.0, |ripple| ripple.order);
        if order * peak_speed > 0.0 { PHASE_RAD / (order * peak_speed) } else { f64::INFINITY }
    }
}
