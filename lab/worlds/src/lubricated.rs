//! A lubricated seal: elasto-plastic contact elements on a film that remembers the speed.
//!
//! ```text
//! film        u' = (|v| - u) / tau, tau = tau_up while |v| > u, tau_down while |v| < u
//! level       g_i = a_i g(curve(u / r_i)): each element has its own Stribeck velocity r_i v_s
//! element     dF_i/dq = k_i (1 - alpha_i F_i / g_i)                       along the motion
//!             alpha_i = 0 up to the share b_i of g_i, 1 from g_i, a sine between them; 0 while F_i opposes the motion
//! viscous     k2 v_ref (|v| / v_ref)^p
//! ```
//!
//! `g` is [`Joint::level_on_curve`]. It contains every effect, so a cause means the same as in the other plants.
//! With `alpha = 0` an element is a spring. Oscillations below the breakaway therefore do not drift, in contrast to
//! bristles (Dupont et al., single state elastoplastic friction models, 2002). A film that lags behind the speed
//! gives a lower level in deceleration than in acceleration.

use simulated_machines::imposed::mean_of_decay;
use simulated_machines::joint::Joint;
use simulated_machines::sampler::Sampler;
use std::f64::consts::PI;

/// Range of the film's time constants, s.
const FILM_S: (f64, f64) = (5e-3, 8e-2);
/// Range of the ratio of the film's time constants. Squeezing out a film takes longer than building it up.
const COLLAPSE_TO_BUILD_UP: (f64, f64) = (1.3, 4.0);
/// Range of the exponent of the viscous torque. Shear-thinning greases have exponents below 1.
const VISCOUS_EXPONENT: (f64, f64) = (0.6, 0.95);
/// Range of the ratio of the largest to the smallest Stribeck velocity of the elements.
const STRIBECK_SPREAD: (f64, f64) = (1.5, 5.0);

/// Share of the level from which an element is integrated as sliding (`alpha = 1`).
const SLIDING_SHARE: f64 = 0.999;
/// Maximum step within the elasto-plastic transition, as a share of the level.
const MAX_STEP_SHARE: f64 = 0.1;

/// An elasto-plastic contact element.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactElement {
    /// Share of the level.
    pub share: f64,
    /// Elastic travel at the Coulomb level, as a share of the joint's presliding travel.
    pub travel: f64,
    /// Stribeck velocity, as a ratio to the joint's.
    pub stribeck_ratio: f64,
    /// Share of the level up to which the element is a spring.
    pub elastic_share: f64,
}

/// Parameters of a lubricated seal that its joint does not contain.
#[derive(Clone, Debug)]
pub(super) struct LubricatedSeal {
    pub elements: Vec<ContactElement>,
    /// Time constant of the film in acceleration, s.
    pub build_up_s: f64,
    /// Time constant of the film in deceleration, s.
    pub collapse_s: f64,
    /// Exponent of the viscous torque over the speed.
    pub viscous_exponent: f64,
    /// Speed at which the viscous torque equals that of a linear law, rad/s.
    pub viscous_reference_rad_s: f64,
}

/// A motion of the contact in one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactStep {
    /// 1 or -1.
    pub direction: f64,
    /// Travel that reaches the contact, rad.
    pub travel: f64,
    /// Deflection by a change of the side load, rad.
    pub bent: f64,
    /// State of the film at the end, as the speed at which it is in equilibrium, rad/s.
    pub film_rad_s: f64,
}

impl LubricatedSeal {
    /// Draws four to eight elements, the film and the viscous law of a joint with this maximum speed.
    pub fn draw(sampler: &mut Sampler, top_rad_s: f64) -> Self {
        let count = 4 + sampler.below(5);
        let narrowest = sampler.log_between(0.05, 0.4);
        let spread = sampler.log_between(STRIBECK_SPREAD.0, STRIBECK_SPREAD.1);
        // The Stribeck velocities are shuffled: a short travel does not imply a low Stribeck velocity.
        let mut places: Vec<usize> = (0..count).collect();
        sampler.shuffle(&mut places);
        let along = |at: usize| at as f64 / (count - 1) as f64;
        let mut elements: Vec<ContactElement> = places
            .iter()
            .enumerate()
            .map(|(at, &place)| ContactElement {
                share: sampler.between(0.3, 1.0),
                travel: narrowest * (2.0 / narrowest).powf(along(at)),
                stribeck_ratio: spread.powf(along(place) - 0.5),
                elastic_share: sampler.between(0.3, 0.85),
            })
            .collect();
        let all: f64 = elements.iter().map(|one| one.share).sum();
        elements.iter_mut().for_each(|one| one.share /= all);
        let build_up_s = sampler.log_between(FILM_S.0, FILM_S.1 / COLLAPSE_TO_BUILD_UP.0);
        let ratio = sampler.log_between(COLLAPSE_TO_BUILD_UP.0, COLLAPSE_TO_BUILD_UP.1);
        Self {
            elements,
            build_up_s,
            collapse_s: (build_up_s * ratio).min(FILM_S.1),
            viscous_exponent: sampler.between(VISCOUS_EXPONENT.0, VISCOUS_EXPONENT.1),
            viscous_reference_rad_s: top_rad_s,
        }
    }

    /// Returns the film after `seconds` at a mean speed, rad/s.
    pub fn film_after(&self, film_rad_s: f64, speed: f64, seconds: f64) -> f64 {
        let lag_s = if speed > film_rad_s { self.build_up_s } else { self.collapse_s };
        film_rad_s - (speed - film_rad_s) * (-seconds / lag_s).exp_m1()
    }

    /// Returns the mean of the elements' Stribeck curves, weighted by their shares of the level.
    ///
    /// The joint's level is linear in the curve. At this mean it is the sum of the elements' levels.
    pub fn mean_curve(&self, joint: &Joint, film_rad_s: f64) -> f64 {
        let curve = |one: &ContactElement| joint.stribeck_curve(film_rad_s / one.stribeck_ratio);
        self.elements.iter().map(|one| one.share * curve(one)).sum()
    }

    /// Returns the velocity at which a linear viscous law gives the torque of the power law, rad/s.
    ///
    /// The effects on the viscous torque are factors of it, so they apply to both laws alike.
    pub fn viscous_velocity(&self, velocity: f64) -> f64 {
        let reference = self.viscous_reference_rad_s;
        let speed = reference * (velocity.abs() / reference).powf(self.viscous_exponent);
        speed.copysign(velocity)
    }

    /// Moves the elements' torques by a step, Nm.
    ///
    /// `level_on_curve` returns the joint's level for a value of the Stribeck curve and a direction, at the end of the
    /// step. The torque of an element is limited to its level at rest.
    pub fn advance(
        &self,
        joint: &Joint,
        step: &ContactStep,
        torques: &mut [f64],
        level_on_curve: impl Fn(f64, f64) -> f64,
    ) {
        let ContactStep { direction, travel, bent, film_rad_s } = *step;
        for (one, torque) in self.elements.iter().zip(torques) {
            let stiffness = joint.seal.k0 * one.share / one.travel;
            let curve = joint.stribeck_curve(film_rad_s / one.stribeck_ratio);
            let level = one.share * level_on_curve(curve, direction);
            let along = direction * (*torque + stiffness * bent);
            *torque = direction * one.torque_after(along, level, stiffness * travel);
            if torque.abs() > level {
                let most = (one.share * level_on_curve(1.0, torque.signum())).max(level);
                *torque = torque.clamp(-most, most);
            }
        }
    }
}

impl ContactElement {
    /// Returns the share of the motion that is plastic at a torque along the motion, as a share of the level.
    fn plastic_share(&self, torque_share: f64) -> f64 {
        if torque_share <= self.elastic_share {
            0.0
        } else if torque_share >= 1.0 {
            1.0
        } else {
            let middle = 0.5 * (1.0 + self.elastic_share);
            0.5 + 0.5 * (PI * (torque_share - middle) / (1.0 - self.elastic_share)).sin()
        }
    }

    /// Returns the torque along the motion after a travel, Nm. `elastic_nm` is the travel times the stiffness.
    ///
    /// The transition is integrated by exponential midpoint steps. They are stable for any travel, and the torque
    /// cannot pass the level.
    fn torque_after(&self, mut torque: f64, level: f64, mut elastic_nm: f64) -> f64 {
        let spring = elastic_nm.min(self.elastic_share * level - torque).max(0.0);
        torque += spring;
        elastic_nm -= spring;
        while elastic_nm > 0.0 {
            if torque >= SLIDING_SHARE * level {
                return level + (torque - level) * (-elastic_nm / level).exp();
            }
            let part = elastic_nm.min(MAX_STEP_SHARE * level);
            let after = |part: f64, plastic_share: f64| {
                let decay = plastic_share * part / level;
                torque * (-decay).exp() + part * mean_of_decay(decay)
            };
            let middle = after(0.5 * part, self.plastic_share(torque / level));
            torque = after(part, self.plastic_share(middle / level)).min(level);
            elastic_nm -= part;
        }
        torque
    }
}
