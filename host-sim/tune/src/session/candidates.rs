//! The sets that a session tries.

use crate::frequency::LoopGains;
use crate::learn::{Learnt, is_passive};
use crate::trial_set::TunedSet;
use firmware::control::PERIOD_S;
use firmware::parameter_set::ParameterSet;
use friction_fit::Outcome;

/// Shares of the friction that are tried.
const SCALES: [f32; 3] = [0.9, 1.0, 0.7];
/// Share of the held-out error by which a law that can give out energy must err less than a passive one to be offered.
const OFFER_SHARE: f64 = 0.05;

/// Returns the loop gains of a set.
pub(super) fn gains_of(tuned: &TunedSet) -> LoopGains {
    LoopGains {
        velocity_gain: f64::from(tuned.set.motor.velocity_gain_a_s_per_rad),
        integral_s: f64::from(tuned.set.motor.velocity_integral_s),
        position_gain: 1e-3 * f64::from(tuned.position_gain),
    }
}

/// Returns a set with other loop gains.
pub(super) fn with_gains(former: &TunedSet, gains: &LoopGains) -> TunedSet {
    let mut tuned = former.clone();
    tuned.set.motor.velocity_gain_a_s_per_rad = gains.velocity_gain as f32;
    tuned.set.motor.velocity_integral_s = gains.integral_s as f32;
    tuned.position_gain = (1e3 * gains.position_gain).round() as u32;
    tuned
}

/// Returns true if the law of a set can give out energy.
pub(super) fn is_active(set: &ParameterSet) -> bool {
    set.friction.model.choices.allow_active && !is_passive(&set.friction.model.convert())
}

/// The learnt models, as sets with the former loop gains.
#[derive(Default)]
pub(super) struct Laws {
    /// The extended model at each scale, then its static form. Laws that can give out energy stand last, if they are allowed.
    pub sets: Vec<ParameterSet>,
    /// What is lost by passive laws, as a sentence for the user.
    pub offer: Option<String>,
}

impl Laws {
    /// Fits the models in their passive form. `has_active` adds the learnt one as it is.
    pub fn of(former: &ParameterSet, learnt: &Learnt, has_active: bool) -> Self {
        let model = learnt.found.transferable_model();
        let passive = learnt.passive_form(&model);
        let fixed = learnt.static_model().and_then(|model| learnt.passive_form(&model));
        let active = (!is_passive(&model.for_driver().parameters)).then_some(&model);
        let scaled = |model: &Outcome| SCALES.map(|scale| learnt.set_with(model, former, scale));
        let mut sets: Vec<ParameterSet> = passive.iter().flat_map(scaled).collect();
        sets.extend(fixed.map(|model| learnt.set_with(&model, former, 1.0)));
        if has_active {
            sets.extend(active.into_iter().flat_map(scaled));
        }
        sets.retain(is_legal);
        let offer = active.filter(|_| !has_active);
        Self { sets, offer: offer.and_then(|active| offer_of(learnt, active, passive.as_ref())) }
    }
}

/// Returns true if the drive takes a set. The bound of state and torque must be proven before the drive has it.
fn is_legal(set: &ParameterSet) -> bool {
    let bounds = set.friction.model.largest_torques_nm(PERIOD_S);
    set.validate().is_ok()
        && set.check_buildable().is_ok()
        && bounds.is_ok_and(|bounds| bounds.iter().all(|bound| bound.is_finite()))
}

/// Offers a law that can give out energy, if it errs clearly less than one that only dissipates energy.
fn offer_of(learnt: &Learnt, active: &Outcome, passive: Option<&Outcome>) -> Option<String> {
    let active_nm = learnt.held_out_nm(active);
    let passive_nm = passive.map_or(f64::INFINITY, |passive| learnt.held_out_nm(passive));
    (active_nm < (1.0 - OFFER_SHARE) * passive_nm).then(|| {
        let less = match passive {
            Some(_) => format!(
                "errs {:.0} % less on held-out rows than one that only dissipates energy",
                100.0 * (1.0 - active_nm / passive_nm)
            ),
            None => "describes the runs, and none that only dissipates energy does".to_owned(),
        };
        format!("a law that can supply energy {less}; it was not tried: the option allow-active tries it")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn with_gains_of_the_same_set_changes_nothing() {
        for position_gain in [0, 4007, 8001, 10_053] {
            let tuned = TunedSet { set: ParameterSet::default(), position_gain };
            let same = with_gains(&tuned, &gains_of(&tuned));
            assert_eq!(same.position_gain, position_gain);
            assert_eq!(same.set.crc(), tuned.set.crc());
        }
    }
}
