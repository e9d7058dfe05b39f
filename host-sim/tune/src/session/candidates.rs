//! The sets that a session tries.

use crate::frequency::LoopGains;
use crate::learn::Learnt;
use crate::trial_set::TunedSet;
use firmware::control::PERIOD_S;
use firmware::parameter_set::ParameterSet;

/// Shares of the friction that are tried.
const SCALES: [f32; 3] = [0.9, 1.0, 0.7];

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
    tuned.position_gain = (1e3 * gains.position_gain) as u32;
    tuned
}

/// Returns the sets with a learnt model, with these loop gains: the extended model at each scale, then its static form.
pub(super) fn candidates(former: &TunedSet, learnt: &Learnt, gains: &LoopGains) -> Vec<TunedSet> {
    // The bound of state and torque must be proven before the drive has the set.
    let is_legal = |set: &ParameterSet| {
        let bounds = set.friction.model.largest_torques_nm(PERIOD_S);
        set.validate().is_ok()
            && set.check_buildable().is_ok()
            && bounds.is_ok_and(|bounds| bounds.iter().all(|own| own.is_finite()))
    };
    let extended = SCALES.iter().map(|scale| learnt.set(&former.set, *scale));
    let is_static = learnt.static_model().map(|model| learnt.set_with(&model, &former.set, 1.0));
    let legal = extended.chain(is_static).filter(is_legal);
    let with = |set| with_gains(&TunedSet { set, position_gain: former.position_gain }, gains);
    legal.map(with).collect()
}
