//! A hidden effect with its size and all other drawn properties.

use super::hidden_cause::HiddenCause;
use super::setting::Setting;
use crate::effects::{Drift, Dwell, Thinning, Warming, Wave};
use crate::joint::{Joint, Play};
use crate::outside::{Flavour, Outside};
use crate::sampler::Sampler;
use std::f64::consts::TAU;

/// A hidden effect with all drawn properties.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnCause {
    /// Cause of the effect.
    pub effect: HiddenCause,
    /// Size, by the convention of the cause in the catalogue.
    pub size: f64,
    /// Order of a ripple, periods per turn.
    pub order: f64,
    /// Phase of a ripple at angle 0, rad.
    pub phase: f64,
    /// Further orders of a torque ripple. Their size is a share of the first.
    pub harmonics: Vec<Wave>,
    /// Temperature without a change, deg C.
    pub reference_c: f64,
    /// Contact age from which a dwell-time effect grows, s.
    pub onset_s: f64,
    /// Travel over which the contact age is lost, rad.
    pub forgetting_rad: f64,
    /// Time constant of a run-in, s. `None` for a linear drift.
    pub run_in_s: Option<f64>,
    /// Length of the campaign, s.
    pub campaign_s: f64,
    /// Share of the motion within a backlash that reaches the bristles.
    pub leak: f64,
    /// Heat of the warm-up and time of its cooling; its fall is the size.
    pub warming: Warming,
    /// Kind of an effect outside the catalogue.
    pub flavour: Option<Flavour>,
}

/// Range of the order of a ripple, periods per turn.
const ORDERS: (f64, f64) = (1.0, 250.0);

/// Range of the first order of a torque ripple, periods per turn: poles, slots and teeth.
const COGGING_ORDERS: (f64, f64) = (4.0, 60.0);

/// Maximum delay of a channel, in samples. The delay line of the driver has this length.
const MAX_DELAY_SAMPLES: f64 = 28.0;

impl DrawnCause {
    /// Returns an effect without a size, whose properties are not drawn.
    pub const fn of(effect: HiddenCause) -> Self {
        Self {
            effect,
            size: 0.0,
            order: 1.0,
            phase: 0.0,
            harmonics: Vec::new(),
            reference_c: 20.0,
            onset_s: 0.1,
            forgetting_rad: 1e-2,
            run_in_s: None,
            campaign_s: 1.0,
            leak: 0.02,
            warming: Warming { fall: 0.0, energy_j: 50.0, cooling_s: 300.0 },
            flavour: None,
        }
    }

    /// Draws an effect of initial size for a campaign.
    pub(super) fn draw(
        sampler: &mut Sampler,
        effect: HiddenCause,
        setting: &Setting,
        flavour: Option<Flavour>,
    ) -> Self {
        let is_torque_ripple = effect == HiddenCause::TorqueRipple;
        let orders = if is_torque_ripple { COGGING_ORDERS } else { ORDERS };
        let order = sampler.log_between(orders.0, orders.1);
        let whole = sampler.chance(0.5);
        let order = if whole { order.round() } else { order };
        let levels = setting.runs.iter().map(|run| run.condition.temperature.level);
        let (least_c, most_c) =
            levels.fold((f64::INFINITY, -f64::INFINITY), |(l, m), c| (l.min(c), m.max(c)));
        let run_in = sampler.chance(0.5);
        let time = sampler.between(0.15, 0.5) * setting.campaign_s;
        let mut hidden = Self {
            order,
            phase: sampler.between(0.0, TAU),
            harmonics: if is_torque_ripple { draw_harmonics(sampler, order) } else { Vec::new() },
            reference_c: sampler.between(least_c, most_c),
            onset_s: sampler.log_between(0.02, 0.5),
            forgetting_rad: sampler.log_between(5e-3, 2e-2),
            run_in_s: run_in.then_some(time),
            campaign_s: setting.campaign_s,
            flavour,
            ..Self::of(effect)
        };
        if effect == HiddenCause::WarmUp {
            hidden.warming.energy_j = sampler.log_between(20.0, 150.0);
            hidden.warming.cooling_s = sampler.log_between(60.0, 900.0);
        }
        let (least, most) = hidden.limits(setting);
        // The size is scaled later to the target visibility. The usual sizes must not reveal the cause.
        hidden.size = match effect {
            HiddenCause::StribeckShape if sampler.chance(0.6) => sampler.between(0.5, 1.3),
            HiddenCause::StribeckShape => sampler.between(3.0, 5.0),
            _ => sampler.log_between(least, most) * hidden.draw_sign(sampler),
        };
        hidden
    }

    /// Returns true if the effect has an order.
    pub fn is_periodic(&self) -> bool {
        matches!(self.effect, HiddenCause::PositionRipple | HiddenCause::TorqueRipple)
    }

    /// Draws the sign of the size.
    fn draw_sign(&self, sampler: &mut Sampler) -> f64 {
        match self.effect {
            HiddenCause::DirectionAsymmetry | HiddenCause::TorqueOffset => sampler.sign(),
            // Run-in mostly lowers friction. Wear raises or lowers it with equal probability.
            HiddenCause::TimeDrift if self.run_in_s.is_some() && sampler.chance(0.8) => -1.0,
            HiddenCause::TimeDrift => sampler.sign(),
            _ => 1.0,
        }
    }

    /// Returns true if the effect is proportional to its size, so that it can be scaled.
    pub fn is_scalable(&self) -> bool {
        self.effect != HiddenCause::StribeckShape
    }

    /// Returns the smallest and largest plausible magnitude for this joint.
    pub(super) fn limits(&self, setting: &Setting) -> (f64, f64) {
        let seal = &setting.seal;
        match self.effect {
            HiddenCause::RadialForceCoulomb => (5e-4, 0.05),
            HiddenCause::RadialForceRate => {
                // A full oscillation at rest deflects the bristles by less than half of their travel.
                let swings = setting.runs.iter().map(|run| run.condition.force.swing);
                let widest = swings.fold(1.0, f64::max);
                (1e-8, 0.4 * seal.coulomb_nm / (2.0 * widest * seal.k0))
            }
            HiddenCause::PressureCoulomb => (5e-8, 1e-5),
            HiddenCause::TemperatureViscous => (0.003, 0.09),
            HiddenCause::PositionRipple => (0.005, 0.5),
            HiddenCause::GravityImbalance | HiddenCause::TorqueRipple => (0.01, 1.2),
            HiddenCause::TemperatureCoulomb => (0.001, 0.05),
            HiddenCause::WarmUp => (0.02, 0.7),
            HiddenCause::DirectionAsymmetry => (0.005, 0.4),
            HiddenCause::TorqueOffset => (0.01, 1.0),
            HiddenCause::QuadraticDrag => (1e-4, 0.03),
            HiddenCause::DwellTimeStatic => (0.02, 0.6),
            HiddenCause::TimeDrift => (0.01, 0.5),
            HiddenCause::LoadTorqueCoulomb => (0.002, 0.2),
            HiddenCause::UnmodelledInertia => (1e-3, 0.4),
            HiddenCause::Backlash => {
                let travel = seal.static_nm / seal.k0;
                (0.3 * travel, 5.0 * travel)
            }
            HiddenCause::StribeckShape => (0.5, 5.0),
            HiddenCause::ChannelDelay => {
                let most = (MAX_DELAY_SAMPLES / setting.rate_hz).min(0.03);
                (most.min(0.002), most)
            }
            HiddenCause::OutsideCatalogue => {
                self.flavour.map_or((0.1, 0.1), |flavour| flavour.limits(seal.coulomb_nm))
            }
        }
    }

    /// Applies the effect to a joint.
    pub fn apply_to(&self, joint: &mut Joint) {
        let size = self.size;
        if size == self.effect.neutral() {
            return;
        }
        match self.effect {
            HiddenCause::RadialForceCoulomb => joint.seal.per_force = size,
            HiddenCause::RadialForceRate => joint.seal.eta3 = size,
            HiddenCause::PressureCoulomb => joint.seal.per_pressure = size,
            HiddenCause::TemperatureViscous => {
                joint.thinning = Some(Thinning { per_k: size, reference_c: self.reference_c });
            }
            HiddenCause::PositionRipple => {
                joint.ripple = Some(Wave { size, order: self.order, phase: self.phase });
            }
            HiddenCause::GravityImbalance => {
                joint.gravity = Some(Wave { size, order: 1.0, phase: self.phase });
            }
            HiddenCause::DirectionAsymmetry => joint.asymmetry = size,
            HiddenCause::TorqueOffset => joint.offset_nm = size,
            HiddenCause::QuadraticDrag => joint.drag = size,
            HiddenCause::DwellTimeStatic => {
                joint.dwell = Some(Dwell {
                    gain_nm: size,
                    onset_s: self.onset_s,
                    travel_rad: self.forgetting_rad,
                });
            }
            HiddenCause::TimeDrift => joint.drift = Some(self.drift()),
            HiddenCause::LoadTorqueCoulomb => joint.per_load = size,
            HiddenCause::UnmodelledInertia => joint.inertia = size,
            HiddenCause::Backlash => {
                joint.play = Some(Play { travel_rad: size, leak: self.leak });
            }
            HiddenCause::StribeckShape => joint.stribeck_exponent = size,
            HiddenCause::ChannelDelay => joint.delay_s = size,
            HiddenCause::TorqueRipple => {
                let first = Wave { size, order: self.order, phase: self.phase };
                let rest =
                    self.harmonics.iter().map(|wave| Wave { size: wave.size * size, ..*wave });
                joint.torque_ripple = std::iter::once(first).chain(rest).collect();
            }
            HiddenCause::TemperatureCoulomb => {
                joint.stiffening = Some(Thinning { per_k: size, reference_c: self.reference_c });
            }
            HiddenCause::WarmUp => {
                joint.warming = Some(Warming { fall: size, ..self.warming });
            }
            HiddenCause::OutsideCatalogue => {
                joint.outside = self.flavour.map(|flavour| Outside { flavour, size });
            }
        }
    }

    /// Returns a drift that changes the level by the share `size` from the start to the end of the campaign.
    fn drift(&self) -> Drift {
        match self.run_in_s {
            None => Drift::Wear { per_s: self.size / self.campaign_s },
            Some(time_s) => {
                // (1 + a e) / (1 + a) = 1 + size, where e is the remaining share of the run-in at the end.
                let left = (-self.campaign_s / time_s).exp();
                Drift::RunIn { amplitude: self.size / (left - 1.0 - self.size), time_s }
            }
        }
    }

    /// Returns the columns that the effect depends on.
    pub fn columns(&self) -> Vec<&'static str> {
        let outside = self.flavour.as_ref().map(Flavour::column);
        self.effect.column().or(outside).into_iter().collect()
    }

    /// Returns the unit of the size.
    pub fn unit(&self) -> &'static str {
        self.flavour.as_ref().map_or(self.effect.unit(), Flavour::unit)
    }

    /// Returns further properties, as name and value.
    pub fn details(&self) -> Vec<(&'static str, f64)> {
        match self.effect {
            HiddenCause::PositionRipple | HiddenCause::TorqueRipple => {
                let mut details = vec![("order", self.order), ("phase_rad", self.phase)];
                for (wave, [order, share, phase]) in self.harmonics.iter().zip(HARMONIC_DETAILS) {
                    details.extend([(order, wave.order), (share, wave.size), (phase, wave.phase)]);
                }
                details
            }
            HiddenCause::GravityImbalance => vec![("phase_rad", self.phase)],
            HiddenCause::WarmUp => {
                let Warming { energy_j, cooling_s, .. } = self.warming;
                vec![("energy_j", energy_j), ("cooling_s", cooling_s)]
            }
            HiddenCause::TemperatureViscous | HiddenCause::TemperatureCoulomb => {
                vec![("reference_c", self.reference_c)]
            }
            HiddenCause::DwellTimeStatic => {
                vec![("onset_s", self.onset_s), ("forgetting_travel_rad", self.forgetting_rad)]
            }
            HiddenCause::TimeDrift => self.run_in_s.map(|t| ("run_in_s", t)).into_iter().collect(),
            HiddenCause::Backlash => vec![("motion_within", self.leak)],
            _ => Vec::new(),
        }
    }

    /// Returns a description of the effect.
    pub fn words(&self) -> String {
        let name = self.effect.name();
        match (&self.flavour, self.unit()) {
            (Some(flavour), _) => format!("{name}: {}", flavour.words()),
            (None, "1") => format!("{name} of {:.4}", self.size),
            (None, unit) => format!("{name} of {:.3e} {unit}", self.size),
        }
    }
}

/// Names of the properties of the second and third order.
const HARMONIC_DETAILS: [[&str; 3]; 2] = [
    ["order_2", "share_of_first_2", "phase_2_rad"],
    ["order_3", "share_of_first_3", "phase_3_rad"],
];

/// Draws further orders of a torque ripple, relative to a first order of unit amplitude.
///
/// They are the double order, and the order below the first, which occurs in machines with an eccentric rotor.
fn draw_harmonics(sampler: &mut Sampler, order: f64) -> Vec<Wave> {
    let mut waves = Vec::new();
    for (order, probability) in [(2.0 * order, 0.8), (order - 1.0, 0.6)] {
        let (size, phase) = (sampler.between(0.25, 0.7), sampler.between(0.0, TAU));
        if sampler.chance(probability) {
            waves.push(Wave { size, order, phase });
        }
    }
    waves
}
