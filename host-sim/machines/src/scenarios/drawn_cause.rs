//! An effect with its size and everything else that makes it the one it is.

use super::hidden_cause::HiddenCause;
use super::joint::{Drift, Dwell, Joint, Play, Thinning, Warming, Wave};
use super::outside::{Flavour, Outside};
use super::sampler::Sampler;
use super::setting::Setting;
use std::f64::consts::TAU;

/// What is drawn beside the size.
#[derive(Clone, Debug)]
pub(super) struct DrawnCause {
    pub effect: HiddenCause,
    /// By the convention of the catalogue's term.
    pub size: f64,
    /// Of a ripple, 1/rad.
    pub order: f64,
    pub phase: f64,
    /// The other orders of a torque ripple, each as a share of the first.
    pub harmonics: Vec<Wave>,
    pub reference_c: f64,
    pub onset_s: f64,
    pub forgetting_rad: f64,
    /// Time constant of a run-in, s; a straight drift without one.
    pub run_in_s: Option<f64>,
    pub campaign_s: f64,
    pub leak: f64,
    /// Heat after which a seal is warm, J, and the time in which it leaves, s.
    pub warming: (f64, f64),
    pub flavour: Option<Flavour>,
}

/// Highest and lowest order of a ripple, 1/rad.
const ORDERS: (f64, f64) = (1.0, 250.0);

/// Highest and lowest first order of a torque ripple, 1/rad: poles and slots, teeth.
const COGGING_ORDERS: (f64, f64) = (4.0, 60.0);

/// Most samples a channel is late, so that a driver's delay line can hold them.
const LATEST_SAMPLES: f64 = 28.0;

impl DrawnCause {
    /// Draws an effect for a campaign, at a size to begin with.
    pub fn draw(
        sampler: &mut Sampler,
        effect: HiddenCause,
        setting: &Setting,
        flavour: Option<Flavour>,
    ) -> Self {
        let cogs = effect == HiddenCause::TorqueRipple;
        let orders = if cogs { COGGING_ORDERS } else { ORDERS };
        let order = sampler.log_between(orders.0, orders.1);
        let whole = sampler.chance(0.5);
        let order = if whole { order.round() } else { order };
        let levels = setting.runs.iter().map(|run| run.condition.temperature.level);
        let (least_c, most_c) =
            levels.fold((f64::INFINITY, -f64::INFINITY), |(l, m), c| (l.min(c), m.max(c)));
        let run_in = sampler.chance(0.5);
        let time = sampler.between(0.15, 0.5) * setting.campaign_s;
        let mut hidden = Self {
            effect,
            size: 0.0,
            order,
            phase: sampler.between(0.0, TAU),
            harmonics: if cogs { beside(sampler, order) } else { Vec::new() },
            reference_c: sampler.between(least_c, most_c),
            onset_s: sampler.log_between(0.02, 0.5),
            forgetting_rad: sampler.log_between(5e-3, 2e-2),
            run_in_s: run_in.then_some(time),
            campaign_s: setting.campaign_s,
            leak: 0.02,
            warming: (50.0, 300.0),
            flavour,
        };
        if effect == HiddenCause::WarmUp {
            hidden.warming = (sampler.log_between(20.0, 150.0), sampler.log_between(60.0, 900.0));
        }
        let (least, most) = hidden.limits(setting);
        // Scaled later until it shows as wanted; which sizes are usual must tell nothing.
        hidden.size = match effect {
            HiddenCause::StribeckShape if sampler.chance(0.6) => sampler.between(0.5, 1.3),
            HiddenCause::StribeckShape => sampler.between(3.0, 5.0),
            _ => sampler.log_between(least, most) * hidden.side(sampler),
        };
        hidden
    }

    /// Whether it has an order.
    pub fn is_periodic(&self) -> bool {
        matches!(self.effect, HiddenCause::PositionRipple | HiddenCause::TorqueRipple)
    }

    /// Makes a drift a straight one.
    pub fn straighten(&mut self) {
        self.run_in_s = None;
    }

    /// The sign a size is drawn with.
    fn side(&self, sampler: &mut Sampler) -> f64 {
        match self.effect {
            HiddenCause::DirectionAsymmetry | HiddenCause::TorqueOffset => sampler.sign(),
            // Run-in lowers friction more often than not; wear raises it as often as not.
            HiddenCause::TimeDrift if self.run_in_s.is_some() && sampler.chance(0.8) => -1.0,
            HiddenCause::TimeDrift => sampler.sign(),
            _ => 1.0,
        }
    }

    /// Whether a larger size is a larger effect in proportion, so that it can be scaled.
    pub fn scales(&self) -> bool {
        self.effect != HiddenCause::StribeckShape
    }

    /// Smallest and largest magnitude a joint like this may have.
    pub fn limits(&self, setting: &Setting) -> (f64, f64) {
        let seal = &setting.seal;
        match self.effect {
            HiddenCause::RadialForceCoulomb => (5e-4, 0.05),
            HiddenCause::RadialForceRate => {
                // A full swing at rest bends the bristles by less than half their travel.
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
                let most = (LATEST_SAMPLES / setting.rate_hz).min(0.03);
                (most.min(0.002), most)
            }
            HiddenCause::OutsideCatalogue => {
                self.flavour.map_or((0.1, 0.1), |flavour| flavour.limits(seal.coulomb_nm))
            }
        }
    }

    /// Puts the effect into a joint.
    pub fn act_on(&self, joint: &mut Joint) {
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
                let (energy_j, cooling_s) = self.warming;
                joint.warming = Some(Warming { fall: size, energy_j, cooling_s });
            }
            HiddenCause::OutsideCatalogue => {
                joint.outside = self.flavour.map(|flavour| Outside { flavour, size });
            }
        }
    }

    /// A drift whose level changes by the share `size` from the campaign's begin to its end.
    fn drift(&self) -> Drift {
        match self.run_in_s {
            None => Drift::Wear { per_s: self.size / self.campaign_s },
            Some(time_s) => {
                // (1 + a e) / (1 + a) = 1 + size, with e what is left of the run-in at the end.
                let left = (-self.campaign_s / time_s).exp();
                Drift::RunIn { amplitude: self.size / (left - 1.0 - self.size), time_s }
            }
        }
    }

    /// The columns it follows.
    pub fn columns(&self) -> Vec<&'static str> {
        let outside = self.flavour.as_ref().map(Flavour::column);
        self.effect.column().or(outside).into_iter().collect()
    }

    /// Unit of the size.
    pub fn unit(&self) -> &'static str {
        self.flavour.as_ref().map_or(self.effect.unit(), Flavour::unit)
    }

    /// What else there is to know of it, by name and value.
    pub fn details(&self) -> Vec<(&'static str, f64)> {
        match self.effect {
            HiddenCause::PositionRipple | HiddenCause::TorqueRipple => {
                let mut details = vec![("order", self.order), ("phase_rad", self.phase)];
                for (wave, [order, share, phase]) in self.harmonics.iter().zip(BESIDE) {
                    details.extend([(order, wave.order), (share, wave.size), (phase, wave.phase)]);
                }
                details
            }
            HiddenCause::GravityImbalance => vec![("phase_rad", self.phase)],
            HiddenCause::WarmUp => {
                vec![("energy_j", self.warming.0), ("cooling_s", self.warming.1)]
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

    /// In words.
    pub fn words(&self) -> String {
        let name = self.effect.name();
        match (&self.flavour, self.unit()) {
            (Some(flavour), _) => format!("{name}: {}", flavour.words()),
            (None, "1") => format!("{name} of {:.4}", self.size),
            (None, unit) => format!("{name} of {:.3e} {unit}", self.size),
        }
    }
}

/// Names of what is told of the orders beside the first.
const BESIDE: [[&str; 3]; 2] = [
    ["order_2", "share_of_first_2", "phase_2_rad"],
    ["order_3", "share_of_first_3", "phase_3_rad"],
];

/// What goes with a first order, at unit amplitude of that: its double, and a neighbour where the machine
/// is not quite round; each more often than not.
fn beside(sampler: &mut Sampler, order: f64) -> Vec<Wave> {
    let mut waves = Vec::new();
    for (order, often) in [(2.0 * order, 0.8), (order - 1.0, 0.6)] {
        let (size, phase) = (sampler.between(0.25, 0.7), sampler.between(0.0, TAU));
        if sampler.chance(often) {
            waves.push(Wave { size, order, phase });
        }
    }
    waves
}
