//! Adverse worlds: simulated logs with imperfect sensors, unplanned motions and different plants.
//!
//! The scenarios of [`simulated_machines::scenarios`] test whether a diagnosis finds an effect in a well-planned log.
//! These worlds test it on logs with the defects of field data: a velocity differentiated
//! from an encoder, no angle, a low-pass filtered torque, correlated covariates, a contact stiffer than
//! the log can resolve, or an effect far below the noise.
//!
//! [`draw`] creates a world from its seed alone. [`draw_family`] also creates worlds of other families: [`Family::Mixed`] has all
//! plants, sensors and causes, also two at once. [`SensorKind`] selects the sensor defect.
//! [`UnkindTruth`] holds the hidden effects and their detectability, so that a score can be plotted over
//! the effect's size.
//!
//! ```text
//! seed ─► campaign (plant, motions, covariates, sensors) ─► scaled effects ─► torque ─► sensors ─► log
//!                                                                 └─► visible (gain of a refit with the true structure) ─► truth
//! ```

mod bristle_fit;
mod campaign;
mod column_relation;
mod devices;
mod effect;
mod family;
mod filters;
mod hidden_effect;
mod logging;
mod lubricated;
#[cfg(test)]
mod lubricated_tests;
mod mechanism;
mod mixed;
mod motions;
pub mod planned;
mod plant;
mod reading;
mod sensing;
mod trajectory;
mod truth;
pub mod two_sided_joint;
mod visible;
mod world;

pub use family::Family;
pub use sensing::SensorKind;
pub use truth::{HiddenEffect as TrueEffect, MIN_DETECTABLE_GAIN, UnkindTruth};

use campaign::Campaign;
use hidden_effect::HiddenEffect;
use mechanism::Mechanism;
use simulated_machines::Log;
use simulated_machines::effects::Wave;
use simulated_machines::joint::Joint;
use simulated_machines::sampler::{Sampler, mixed as mix};
use world::{Target, World};

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct UnkindWorld {
    /// The log of the machine.
    pub log: Log,
    /// The ground truth of the log.
    pub truth: UnkindTruth,
}

/// Share of worlds without a hidden effect.
const CLEAN_SHARE: f64 = 0.2;
/// Range of the effect's target RMS, as a multiple of the torque noise. It extends from far below to far above
/// the noise.
const EFFECT_TO_NOISE: (f64, f64) = (0.05, 30.0);

/// Returns an endless sequence of world seeds. Different bases give different sequences.
pub fn seeds(base: u64) -> impl Iterator<Item = u64> {
    // 32 bits, so that a seed is short enough to be typed.
    (0u64..).map(move |index| mix(mix(base) ^ index) >> 32)
}

/// Returns the sensor kind of the world with this seed.
pub fn sensor_kind(seed: u64) -> SensorKind {
    let kinds = SensorKind::ALL;
    kinds[(mix(seed ^ 0x5EED) % kinds.len() as u64) as usize]
}

/// Draws a world of the training family. The same seed gives bit-identical results.
pub fn draw(seed: u64) -> UnkindWorld {
    draw_family(seed, Family::Training)
}

/// Draws a world of a family. The same seed and family give bit-identical results.
pub fn draw_family(seed: u64, family: Family) -> UnkindWorld {
    if family == Family::Mixed {
        return mixed::draw(seed);
    }
    let mut sampler = family.sampler(seed);
    let plant = family.draw_plant_kind(&mut sampler);
    let mut campaign = Campaign::draw(&mut sampler, sensor_kind(seed), plant, family);
    let plain = Mechanism::plain(draw_rigid_joint(&mut sampler, &campaign));
    let clean = sampler.chance(CLEAN_SHARE);
    let cause = sampler.pick(&effect::possible(&campaign)).filter(|_| !clean);
    let hidden = cause.map(|cause| effect::draw(&mut sampler, &mut campaign, cause));
    let target_nm =
        campaign.sensing.noise_nm * sampler.log_between(EFFECT_TO_NOISE.0, EFFECT_TO_NOISE.1);
    let effect = hidden.map(HiddenEffect::Joint);
    let target = effect.map(|effect| Target { effect, torque_nm: target_nm });
    World { campaign, plain, seed }.simulate(target.into_iter().collect())
}

/// Draws the joint with its rigid-body parts and without a hidden effect.
fn draw_rigid_joint(sampler: &mut Sampler, campaign: &Campaign) -> Joint {
    let mut joint = Joint::plain(campaign.seal);
    let level = campaign.seal.coulomb_nm;
    for part in &campaign.rigid_body {
        let torque_nm = level * sampler.log_between(0.1, 3.0);
        match *part {
            "inertia" => joint.inertia = torque_nm / campaign.drive.steepest_rad_s2,
            "gravity" => {
                let phase = sampler.between(0.0, std::f64::consts::TAU);
                joint.gravity = Some(Wave { size: torque_nm, order: 1.0, phase });
            }
            "load" => joint.load_gain = sampler.between(0.2, 1.2),
            _ => joint.offset_nm = sampler.sign() * torque_nm,
        }
    }
    joint
}
