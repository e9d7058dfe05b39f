//! The effect that is hidden in a campaign, and its plausible size range.

use super::campaign::Campaign;
use simulated_machines::conditions::Signal;
use simulated_machines::effects::{Warming, Wave};
use simulated_machines::outside::Flavour;
use simulated_machines::sampler::Sampler;
use simulated_machines::scenarios::HiddenCause;
use simulated_machines::scenarios::drawn_cause::DrawnCause;
use std::f64::consts::TAU;

/// Returns the causes that a campaign can hide.
///
/// The log must have the column of the cause, and the plant must not contain the same rigid-body part.
pub(super) fn possible(campaign: &Campaign) -> Vec<HiddenCause> {
    let has = |part: &str| campaign.rigid_body.contains(&part);
    let late = !campaign.sensing.true_of_the_log().is_empty();
    HiddenCause::ALL
        .into_iter()
        .filter(|cause| match cause {
            HiddenCause::PositionRipple | HiddenCause::TorqueRipple => {
                campaign.sensing.has_position()
            }
            HiddenCause::GravityImbalance => campaign.sensing.has_position() && !has("gravity"),
            HiddenCause::TorqueOffset => !has("offset"),
            HiddenCause::UnmodelledInertia => !has("inertia"),
            // A delay by the sensors cannot be distinguished from a hidden one.
            HiddenCause::ChannelDelay => !late,
            _ => true,
        })
        .collect()
}

/// Draws an effect of initial size for a campaign, and adds the columns it needs to the log.
pub(super) fn draw(
    sampler: &mut Sampler,
    campaign: &mut Campaign,
    effect: HiddenCause,
) -> DrawnCause {
    let flavour =
        (effect == HiddenCause::OutsideCatalogue).then(|| draw_outside(sampler, campaign));
    draw_properties(sampler, campaign, effect, flavour)
}

/// Draws an effect outside the catalogue of initial size.
pub(super) fn draw_with_flavour(
    sampler: &mut Sampler,
    campaign: &mut Campaign,
    flavour: Flavour,
) -> DrawnCause {
    draw_properties(sampler, campaign, HiddenCause::OutsideCatalogue, Some(flavour))
}

fn draw_properties(
    sampler: &mut Sampler,
    campaign: &mut Campaign,
    effect: HiddenCause,
    flavour: Option<Flavour>,
) -> DrawnCause {
    let (least_c, most_c) = campaign.range(|condition| condition.temperature);
    let order = if sampler.chance(0.8) {
        sampler.log_between(1.0, 60.9).floor()
    } else {
        sampler.log_between(1.0, 120.0)
    };
    let count = sampler.below(4);
    let harmonics: Vec<Wave> = (0..count)
        .map(|at| Wave {
            size: sampler.between(0.1, 0.8),
            order: order * (at + 2) as f64,
            phase: sampler.between(0.0, TAU),
        })
        .collect();
    let heat_j = friction_heat_j(campaign);
    let mut drawn = DrawnCause {
        order,
        phase: sampler.between(0.0, TAU),
        harmonics,
        reference_c: sampler.between(least_c, most_c),
        onset_s: sampler.log_between(0.02, 2.0),
        forgetting_rad: sampler.log_between(1.0, 30.0) * campaign.drive.travel_rad,
        run_in_s: sampler.chance(0.5).then(|| sampler.between(0.15, 0.5) * campaign.campaign_s),
        campaign_s: campaign.campaign_s,
        leak: 0.0,
        warming: Warming {
            energy_j: heat_j * sampler.log_between(0.1, 1.0),
            cooling_s: campaign.campaign_s * sampler.log_between(0.1, 10.0),
            fall: 0.0,
        },
        flavour,
        ..DrawnCause::of(effect)
    };
    let (least, most) = limits(&drawn, campaign);
    drawn.size = match effect {
        HiddenCause::StribeckShape if sampler.chance(0.6) => sampler.between(0.4, 1.3),
        HiddenCause::StribeckShape => sampler.between(3.0, 6.0),
        // Both signs are equally likely: an inertia that is missing, or one that was subtracted in excess.
        HiddenCause::DirectionAsymmetry
        | HiddenCause::TorqueOffset
        | HiddenCause::TimeDrift
        | HiddenCause::UnmodelledInertia => (least * most).sqrt() * sampler.sign(),
        _ => (least * most).sqrt(),
    };
    for name in drawn.columns() {
        let known = ["velocity_rad_s", "position_rad", "time_s", "acceleration_rad_s2"];
        let extra = campaign.extras.iter().any(|extra| extra.column() == name);
        if !known.contains(&name) && !extra && !campaign.columns.contains(&name) {
            campaign.columns.push(name);
        }
    }
    drawn
}

/// Returns the friction heat of a whole campaign without cooling, J.
fn friction_heat_j(campaign: &Campaign) -> f64 {
    let travel = campaign.runs.iter().map(|plan| {
        let grid = 200;
        let step = campaign.drive.seconds / f64::from(grid);
        let speed = |at: u32| plan.run.motion.at(f64::from(at) * step).velocity.abs();
        (0..grid).map(speed).sum::<f64>() * step
    });
    (travel.sum::<f64>() * campaign.seal.coulomb_nm).max(1e-6)
}

/// Draws a structure that no cause of the catalogue describes, scaled to the range of its column.
fn draw_outside(sampler: &mut Sampler, campaign: &mut Campaign) -> Flavour {
    match Flavour::draw(sampler) {
        Flavour::Column { extra, curve, .. } if campaign.extras.contains(&extra) => {
            let (least, most) = campaign.range(|condition| condition.extra(extra));
            Flavour::Column { extra, from: least, range: (most - least).max(1e-3), curve }
        }
        Flavour::Scratch { angle, width } if campaign.sensing.has_position() => {
            Flavour::Scratch { angle, width }
        }
        // A level that falls with temperature is excluded: the catalogue contains `temperature-coulomb`.
        // The alternative is a bump above the Stribeck velocity. Below it, the law would fit it as its own curve.
        _ => {
            let most = 0.7 * campaign.drive.top_rad_s;
            let least = (4.0 * campaign.seal.stribeck_rad_s).min(0.7 * most);
            let speed = sampler.log_between(least, most);
            Flavour::Band { speed, width: speed * sampler.between(0.15, 0.3) }
        }
    }
}

/// Returns the smallest and largest magnitude to which a size is scaled in a campaign.
///
/// Larger effects would mean a broken joint, not an incomplete model.
pub(super) fn limits(drawn: &DrawnCause, campaign: &Campaign) -> (f64, f64) {
    let (seal, drive) = (&campaign.seal, &campaign.drive);
    let level = seal.coulomb_nm;
    // A covariate at its maximum adds at most 80 % of the level.
    let max_slope = |largest: f64| 0.8 * level / largest.max(1e-9);
    let most = match drawn.effect {
        HiddenCause::RadialForceCoulomb => max_slope(campaign.largest(|c| c.force)),
        HiddenCause::PressureCoulomb => max_slope(campaign.largest(|c| c.pressure)),
        HiddenCause::LoadTorqueCoulomb => max_slope(campaign.largest(|c| c.load)),
        HiddenCause::RadialForceRate => {
            0.5 * drive.travel_rad / campaign.largest(|c| Signal { level: 0.0, ..c.force }).max(1.0)
        }
        HiddenCause::TemperatureViscous => 0.08,
        HiddenCause::TemperatureCoulomb => 0.05,
        HiddenCause::PositionRipple | HiddenCause::DirectionAsymmetry => 0.6,
        HiddenCause::GravityImbalance | HiddenCause::TorqueOffset => level,
        HiddenCause::TorqueRipple => level,
        HiddenCause::QuadraticDrag => 2.0 * level / (drive.top_rad_s * drive.top_rad_s),
        HiddenCause::DwellTimeStatic => 0.5 * level,
        HiddenCause::TimeDrift | HiddenCause::WarmUp => 0.6,
        HiddenCause::UnmodelledInertia => 2.0 * level / drive.steepest_rad_s2,
        HiddenCause::Backlash => {
            let longest = drive.top_rad_s * drive.top_rad_s / drive.steepest_rad_s2;
            (30.0 * drive.travel_rad).min(0.3 * longest)
        }
        HiddenCause::StribeckShape => return (0.4, 6.0),
        HiddenCause::ChannelDelay => (20.0 / campaign.rate_hz).min(0.1),
        HiddenCause::OutsideCatalogue => {
            let flavour = drawn.flavour.as_ref();
            flavour.map_or(0.1, |flavour| flavour.limits(level).1)
        }
    };
    (1e-3 * most, most)
}
