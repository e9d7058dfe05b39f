//! The effects that a drawn joint can hide: which, how large, and the surroundings that show them.

use super::DrawnJoint;
use crate::effects::{Warming, Wave};
use crate::joint_plant::contact::FrictionFamily;
use crate::joint_plant::effects::DRIFT_S;
use crate::joint_plant::surroundings::Course;
use crate::sampler::Sampler;
use crate::scenarios::drawn_cause::DrawnCause;
use crate::scenarios::{HiddenCause, Hide, HideError};
use std::f64::consts::TAU;

/// Effect of a drawn size, per friction level.
const VISIBLE_SHARE: (f64, f64) = (0.15, 0.6);

/// Speed at which an effect of the speed has its drawn size, rad/s, and acceleration of one of the acceleration.
const USUAL_SPEED_RAD_S: f64 = 1.5;
const USUAL_ACCELERATION_RAD_S2: f64 = 5.0;

/// Range of a surrounding quantity, and the smallest swing of a course that shows an effect of it.
#[derive(Clone, Copy)]
pub(super) struct VaryingRange {
    least: f64,
    most: f64,
    least_swing: f64,
}

/// Ranges of the side load, N, of the pressure difference, Pa, and of the water temperature, deg C.
const SIDE_LOAD_N: VaryingRange = VaryingRange { least: 5.0, most: 90.0, least_swing: 40.0 };
pub(super) const PRESSURE_PA: VaryingRange =
    VaryingRange { least: 1e4, most: 2.7e5, least_swing: 1.2e5 };
pub(super) const WATER_C: VaryingRange = VaryingRange { least: 4.0, most: 26.0, least_swing: 10.0 };

/// Swing of the side load for an effect of its rate, N, and its frequency, Hz: waves at a leg.
const WAVE_N: f64 = 15.0;
const WAVE_HZ: (f64, f64) = (0.5, 1.5);

/// Period of a tide, s, and time of a step, s: both within a session.
const TIDE_S: (f64, f64) = (100.0, 300.0);
const STEP_AT_S: (f64, f64) = (40.0, 150.0);

/// Orders of a ripple, periods per turn: several within the usual range of motion, and not faster than presliding.
const RIPPLE_ORDERS: (f64, f64) = (6.0, 60.0);

/// Rest at which an ageing contact has its drawn size, s.
const USUAL_REST_S: f64 = 5.0;

/// Returns the requested causes with their sizes.
pub(super) fn requested(hide: &[Hide]) -> Result<Vec<(HiddenCause, Option<f64>)>, HideError> {
    let effects: Vec<_> = hide.iter().filter_map(|hide| Some((hide.effect?, hide.size))).collect();
    if effects.len() < hide.len() && hide.len() > 1 {
        return Err(HideError::NoneBesideEffect);
    }
    for (at, (cause, _)) in effects.iter().enumerate() {
        if effects[..at].iter().any(|(earlier, _)| earlier == cause) {
            return Err(HideError::GivenTwice { cause: *cause });
        }
        let reason = match cause {
            HiddenCause::ChannelDelay => "a simulated joint has no delay between its own channels",
            HiddenCause::LoadTorqueCoulomb => "a simulated joint carries no load",
            HiddenCause::OutsideCatalogue => "a simulated joint has only effects of the catalogue",
            _ => continue,
        };
        return Err(HideError::NotInPlant { cause: *cause, reason });
    }
    Ok(effects)
}

/// Returns the family of a joint with these effects: the requested one, or else the drawn one if it has them.
pub(super) fn family(
    effects: &[(HiddenCause, Option<f64>)],
    requested: Option<FrictionFamily>,
    drawn: FrictionFamily,
) -> Result<FrictionFamily, HideError> {
    let has_shape = effects.iter().any(|(cause, _)| *cause == HiddenCause::StribeckShape);
    match requested {
        Some(family) if has_shape && family != FrictionFamily::MaxwellSlip => {
            Err(HideError::NoStribeckExponent { family: family.name() })
        }
        Some(family) => Ok(family),
        None if has_shape => Ok(FrictionFamily::MaxwellSlip),
        None => Ok(drawn),
    }
}

/// Draws an effect for a joint. Without a size, it is drawn so that it is visible.
pub(super) fn draw(
    sampler: &mut Sampler,
    cause: HiddenCause,
    size: Option<f64>,
    joint: &DrawnJoint,
) -> Result<DrawnCause, HideError> {
    let order = sampler.log_between(RIPPLE_ORDERS.0, RIPPLE_ORDERS.1).round();
    let phase = sampler.between(0.0, TAU);
    let harmonic = Wave { size: sampler.between(0.2, 0.6), order: 2.0 * order, phase };
    let mut effect = DrawnCause {
        order,
        phase,
        harmonics: vec![harmonic],
        onset_s: sampler.log_between(0.02, 0.5),
        forgetting_rad: sampler.log_between(5e-3, 2e-2),
        warming: Warming {
            energy_j: sampler.log_between(10.0, 60.0),
            cooling_s: sampler.log_between(120.0, 900.0),
            fall: 0.0,
        },
        campaign_s: DRIFT_S,
        ..DrawnCause::of(cause)
    };
    let (least, most) = cause.bounds();
    let drawn = visible_size(&effect, sampler, joint).clamp(least, most);
    effect.size = size.unwrap_or(drawn);
    if cause == HiddenCause::UnmodelledInertia && effect.size < 0.0 {
        let reason = "expected at least 0 kg m^2 at a simulated joint";
        return Err(HideError::NotInPlant { cause, reason });
    }
    Ok(effect)
}

/// Draws a size whose effect is a share of the friction level.
fn visible_size(effect: &DrawnCause, sampler: &mut Sampler, joint: &DrawnJoint) -> f64 {
    let share = sampler.between(VISIBLE_SHARE.0, VISIBLE_SHARE.1);
    let sign = sampler.sign();
    let torque_nm = share * joint.friction_nm;
    match effect.effect {
        HiddenCause::RadialForceCoulomb => torque_nm / SIDE_LOAD_N.least_swing,
        HiddenCause::RadialForceRate => {
            let travel = joint.friction_nm / joint.constants.presliding_stiffness_nm_per_rad;
            // A wave shears the contact beyond presliding, or the motion of the joint would not show it.
            3.0 * share * travel / WAVE_N
        }
        HiddenCause::PressureCoulomb => torque_nm / PRESSURE_PA.least_swing,
        // The viscous torque at the usual speed changes by this share of the level over the swing.
        HiddenCause::TemperatureViscous => {
            2.0 * (share / (2.0 * VISCOUS_SHARE)).asinh() / WATER_C.least_swing
        }
        HiddenCause::TemperatureCoulomb => 2.0 * (0.5 * share).asinh() / WATER_C.least_swing,
        HiddenCause::DirectionAsymmetry => 0.7 * share * sign,
        HiddenCause::TorqueOffset => torque_nm * sign,
        HiddenCause::QuadraticDrag => torque_nm / (USUAL_SPEED_RAD_S * USUAL_SPEED_RAD_S),
        HiddenCause::DwellTimeStatic => torque_nm / (USUAL_REST_S / effect.onset_s).ln_1p(),
        HiddenCause::TimeDrift => share * sign,
        HiddenCause::UnmodelledInertia => {
            // At least half of the known inertia: below, the velocity loop corrects it.
            let known = joint.known.inertia_kg_m2;
            (torque_nm / USUAL_ACCELERATION_RAD_S2).max((0.4 + share) * known)
        }
        HiddenCause::Backlash => 0.02 * share,
        HiddenCause::StribeckShape if sign > 0.0 => 0.5 + 0.5 * share,
        HiddenCause::StribeckShape => 3.0 + 4.0 * share,
        HiddenCause::TorqueRipple => 0.7 * torque_nm,
        HiddenCause::GravityImbalance => torque_nm,
        // Relative to the level.
        _ => share,
    }
}

/// Returns the viscous friction of a joint whose viscosity falls with the temperature, Nm s/rad.
pub(super) fn viscous_nm_s_per_rad(friction_nm: f64) -> f64 {
    VISCOUS_SHARE * friction_nm / USUAL_SPEED_RAD_S
}

/// Viscous torque at the usual speed per friction level, of a joint whose viscosity falls with the temperature.
const VISCOUS_SHARE: f64 = 0.6;

/// Draws a course within a range that swings by at least a given amount: a tide, a step, or both.
pub(super) fn vary(sampler: &mut Sampler, range: VaryingRange) -> Course {
    let VaryingRange { least, most, least_swing } = range;
    let swing = sampler.between(least_swing, most - least);
    let low = sampler.between(least, most - swing);
    let tide_period_s = sampler.log_between(TIDE_S.0, TIDE_S.1);
    let tide_phase_rad = sampler.between(0.0, TAU);
    let step_at_s = sampler.between(STEP_AT_S.0, STEP_AT_S.1);
    let sign = sampler.sign();
    let before_step = if sign > 0.0 { low } else { low + swing };
    let [tide, step] = [
        Course { tide_period_s, tide_phase_rad, ..Course::default() },
        Course { step_at_s, ..Course::default() },
    ];
    match sampler.below(3) {
        0 => Course { base: low + 0.5 * swing, tide: 0.5 * swing, ..tide },
        1 => Course { base: before_step, step: sign * swing, ..step },
        _ => Course {
            base: before_step + 0.2 * sign * swing,
            tide: 0.2 * swing,
            step: 0.6 * sign * swing,
            step_at_s,
            ..tide
        },
    }
}

/// Draws the side load of an effect of it, N.
pub(super) fn side_load(sampler: &mut Sampler, cause: HiddenCause) -> Course {
    if cause == HiddenCause::RadialForceRate {
        let wave_hz = sampler.between(WAVE_HZ.0, WAVE_HZ.1);
        return Course { base: 2.0 * WAVE_N, wave: WAVE_N, wave_hz, ..Course::default() };
    }
    vary(sampler, SIDE_LOAD_N)
}
