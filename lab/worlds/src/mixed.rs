//! Worlds of the mixed family: further defects of the log, and one or two effects of every cause.
//!
//! The campaign is that of the other families. Then come defects that they do not have: uneven and coarse clocks, covariates with
//! noise, resolution and delay, columns of another joint or of a payload that have no effect, another reading of the torque, and
//! the set-point of the joint's own velocity.

use super::UnkindWorld;
use super::campaign::{AddedColumn, Campaign, RunPlan};
use super::hidden_effect::HiddenEffect;
use super::mechanism::{Along, Coupling, Payload, TravelShape};
use super::motions::{Drive, STYLES, Style, draw_motion};
use super::sensing::Clock;
use super::world::{Target, World};
use super::{draw_rigid_joint, effect, family::Family, mechanism::Mechanism, sensor_kind};
use simulated_machines::conditions::{Extra, Signal};
use simulated_machines::effects::Wave;
use simulated_machines::outside::{Curve, Flavour};
use simulated_machines::sampler::Sampler;
use simulated_machines::sampling::{CovariateErrors, PlannedRun};
use simulated_machines::scenarios::HiddenCause;
use simulated_machines::scenarios::drawn_cause::DrawnCause;
use std::f64::consts::TAU;

/// Shares of the worlds without an effect and with two.
const CLEAN_SHARE: f64 = 0.2;
const TWO_SHARE: f64 = 0.15;

/// Range of an effect's target RMS, as a multiple of the torque noise.
const EFFECT_TO_NOISE: (f64, f64) = (0.2, 60.0);

/// Share of the worlds that have a decoy of one kind.
const DECOY_SHARE: f64 = 0.1;

/// Columns of another joint, as loggers name them.
const OTHER_NAMES: [(&str, &str); 4] = [
    ("joint2_velocity_rad_s", "joint2_acceleration_rad_s2"),
    ("dq_2", "ddq_2"),
    ("qd2_rad_s", "qdd2_rad_s2"),
    ("elbow_speed", "elbow_accel"),
];

/// Columns of a payload.
const PAYLOAD_NAMES: [&str; 3] = ["payload_kg", "tool_mass_kg", "extension_m"];

/// A cause that a world of the family can hide.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    Joint(HiddenCause),
    Encoder,
    Coupling,
    Payload,
}

/// Draws a world of the mixed family.
pub(super) fn draw(seed: u64) -> UnkindWorld {
    let mut sampler = Family::Mixed.sampler(seed);
    let plant = Family::Mixed.draw_plant_kind(&mut sampler);
    let mut campaign = Campaign::draw(&mut sampler, sensor_kind(seed), plant, Family::Mixed);
    disturb_clock(&mut sampler, &mut campaign);
    disturb_covariates(&mut sampler, &mut campaign);
    let share = sampler.between(0.0, 1.0);
    let count = match share {
        share if share < CLEAN_SHARE => 0,
        share if share < CLEAN_SHARE + TWO_SHARE => 2,
        _ => 1,
    };
    let mut causes: Vec<Cause> = Vec::new();
    for _ in 0..count {
        let mut open = possible(&campaign);
        open.retain(|cause| !causes.contains(cause));
        if let Some(cause) = sampler.pick(&open) {
            prepare(&mut sampler, &mut campaign, cause);
            causes.push(cause);
        }
    }
    draw_decoys(&mut sampler, &mut campaign);
    let plain = Mechanism::plain(draw_rigid_joint(&mut sampler, &campaign));
    let mut draw_effect = |cause: &Cause| {
        let effect = draw_effect(&mut sampler, &mut campaign, *cause);
        let ratio = sampler.log_between(EFFECT_TO_NOISE.0, EFFECT_TO_NOISE.1);
        Target { effect, torque_nm: campaign.sensing.noise_nm * ratio }
    };
    let effects = causes.iter().map(&mut draw_effect).collect();
    World { campaign, plain, seed }.simulate(effects)
}

/// Draws a clock with uneven samples, coarse or inexact time stamps.
fn disturb_clock(sampler: &mut Sampler, campaign: &mut Campaign) {
    let row_s = 1.0 / campaign.rate_hz;
    if sampler.chance(0.25) {
        // Samples stay in order, as the campaign's own jitter is at most 0.15 rows.
        let jitter = sampler.between(0.1, 0.7);
        for plan in &mut campaign.runs {
            let times = &mut plan.run.times;
            let first = times[0];
            for time in &mut times[1..] {
                *time =
                    (*time + jitter * row_s * sampler.between(-0.5, 0.5)).max(first + 0.1 * row_s);
            }
        }
    }
    let is_coarse = sampler.chance(0.15);
    let is_inexact = sampler.chance(0.1);
    let error = sampler.between(0.02, 0.3);
    campaign.sensing.clock = Clock {
        step_s: if is_coarse && row_s >= 4e-3 { 1e-3 } else { 0.0 },
        // The samples may be uneven too: both together must not change their order.
        error_s: if is_inexact { 0.3 * error * row_s } else { 0.0 },
    };
}

/// Draws sensors of the covariates with noise, resolution and delay.
fn disturb_covariates(sampler: &mut Sampler, campaign: &mut Campaign) {
    let noise = sampler.log_between(1e-3, 0.1);
    let resolution = sampler.log_between(1e-3, 0.1);
    let delay_rows = sampler.log_between(1.0, 30.0);
    let sensing = &mut campaign.sensing;
    sensing.covariate_errors = CovariateErrors {
        noise: if sampler.chance(0.5) { noise } else { 0.0 },
        resolution: if sampler.chance(0.3) { resolution } else { 0.0 },
    };
    if sampler.chance(0.15) {
        sensing.covariate_delay_s = delay_rows / campaign.rate_hz;
    }
}

/// Returns the causes that a campaign can hide.
fn possible(campaign: &Campaign) -> Vec<Cause> {
    let has_position = campaign.sensing.has_position();
    let mut causes: Vec<Cause> = effect::possible(campaign).into_iter().map(Cause::Joint).collect();
    if has_position && !campaign.sensing.has_angle_error() {
        causes.push(Cause::Encoder);
    }
    causes.extend([Cause::Coupling, Cause::Payload]);
    causes
}

/// Gives a campaign what a cause needs to be seen: motion, rigid-body parts and columns.
fn prepare(sampler: &mut Sampler, campaign: &mut Campaign, cause: Cause) {
    let Campaign { drive, rigid_body, .. } = campaign;
    let mut include = |part: &'static str| {
        if !rigid_body.contains(&part) {
            rigid_body.push(part);
        }
    };
    match cause {
        Cause::Joint(HiddenCause::DwellTimeStatic) => {
            let drive = *drive;
            for RunPlan { run, .. } in &mut campaign.runs {
                if sampler.chance(0.7) {
                    run.motion = draw_motion(sampler, &long(run, &drive), Style::Rests);
                }
            }
        }
        // Only a torque that contains the inertia shows the error of the acceleration.
        Cause::Encoder if sampler.chance(0.8) => include("inertia"),
        Cause::Payload if campaign.sensing.has_position() => {
            include("gravity");
            if sampler.chance(0.5) {
                include("inertia");
            }
            add_payload(sampler, campaign);
        }
        Cause::Payload => {
            include("inertia");
            add_payload(sampler, campaign);
        }
        Cause::Coupling => add_other_joint(sampler, campaign),
        _ => {}
    }
}

/// Returns the drive for the whole motion of a run, which may begin before its first row.
fn long(run: &PlannedRun, drive: &Drive) -> Drive {
    Drive { seconds: run.times.last().copied().unwrap_or(drive.seconds), ..*drive }
}

/// Adds columns that have no effect.
fn draw_decoys(sampler: &mut Sampler, campaign: &mut Campaign) {
    let has = |campaign: &Campaign, column| {
        campaign.added.iter().any(|(_, added_column)| *added_column == column)
    };
    if sampler.chance(DECOY_SHARE) && !has(campaign, AddedColumn::OtherVelocity) {
        add_other_joint(sampler, campaign);
    }
    if sampler.chance(DECOY_SHARE) && !has(campaign, AddedColumn::Payload) {
        add_payload(sampler, campaign);
    }
    if sampler.chance(0.5 * DECOY_SHARE) {
        campaign.added.push(("motor_current_a", AddedColumn::MotorCurrent));
    }
    if sampler.chance(0.5 * DECOY_SHARE) {
        campaign.added.push(("velocity_setpoint", AddedColumn::VelocitySetpoint));
    }
}

/// Adds the motion of another joint and its columns. It may move with the same style of motion at the same times.
fn add_other_joint(sampler: &mut Sampler, campaign: &mut Campaign) {
    let moves_along = sampler.chance(0.25);
    let drive = Drive {
        top_rad_s: campaign.drive.top_rad_s * sampler.log_between(0.3, 2.0),
        ..campaign.drive
    };
    let style = sampler.pick(&STYLES[..6]).unwrap_or(Style::MultiSine);
    for RunPlan { run, beside } in &mut campaign.runs {
        let motion = draw_motion(sampler, &long(run, &drive), style);
        beside.other = Some(if moves_along { run.motion.clone() } else { motion });
    }
    let (velocity, acceleration) = OTHER_NAMES[sampler.below(OTHER_NAMES.len())];
    campaign.added.push((velocity, AddedColumn::OtherVelocity));
    if sampler.chance(0.7) {
        campaign.added.push((acceleration, AddedColumn::OtherAcceleration));
    }
}

/// Adds a payload column: a few levels, or a length that changes within the runs.
fn add_payload(sampler: &mut Sampler, campaign: &mut Campaign) {
    let name = PAYLOAD_NAMES[sampler.below(PAYLOAD_NAMES.len())];
    let levels = 1 + sampler.below(4);
    let swing = if name == "extension_m" { sampler.between(0.05, 0.3) } else { 0.0 };
    let seconds = campaign.drive.seconds;
    for (index, plan) in campaign.runs.iter_mut().enumerate() {
        // The first runs have all levels, so that the column varies.
        let level = if index <= levels { index } else { sampler.below(levels + 1) };
        plan.beside.payload = Signal {
            level: level as f64 / levels as f64,
            per_s: 0.0,
            swing,
            hz: sampler.log_between(0.5, 5.0) / seconds,
            phase: sampler.between(0.0, TAU),
        };
    }
    campaign.added.push((name, AddedColumn::Payload));
}

/// Draws an effect of initial size.
fn draw_effect(sampler: &mut Sampler, campaign: &mut Campaign, cause: Cause) -> HiddenEffect {
    let (level, drive) = (campaign.seal.coulomb_nm, campaign.drive);
    let phase = sampler.between(0.0, TAU);
    match cause {
        Cause::Joint(HiddenCause::OutsideCatalogue) => draw_unknown(sampler, campaign),
        Cause::Joint(cause) => {
            HiddenEffect::Joint(restrained(effect::draw(sampler, campaign, cause)))
        }
        Cause::Encoder => {
            let order = [1.0, 1.0, 2.0, 2.0, 4.0][sampler.below(5)];
            HiddenEffect::Encoder(Wave { size: 1e-3 / order, order, phase })
        }
        Cause::Coupling => {
            let (mut square, mut product) = (0.0, 0.0);
            if sampler.chance(0.5) {
                let share = sampler.between(0.3, 1.0);
                if sampler.below(2) == 0 {
                    square = share;
                } else {
                    product = share;
                }
            }
            HiddenEffect::Coupling(Coupling {
                size: 0.1 * level * sampler.sign(),
                reference_rad_s: drive.top_rad_s,
                reference_rad_s2: 0.3 * drive.steepest_rad_s2,
                acceleration: 1.0,
                square,
                product,
            })
        }
        Cause::Payload => {
            let has = |part: &str| campaign.rigid_body.contains(&part);
            let weight = if has("gravity") { 1.0 } else { 0.0 };
            let inertia = if has("inertia") { sampler.between(0.2, 1.0) } else { 0.0 };
            let reference_rad_s2 = 0.5 * drive.steepest_rad_s2;
            let size = 0.1 * level;
            HiddenEffect::Payload(Payload { size, phase, reference_rad_s2, weight, inertia })
        }
    }
}

/// Returns an effect that its cause alone describes: a mass is positive, and a torque once per turn is gravity.
fn restrained(mut drawn: DrawnCause) -> DrawnCause {
    /// Least order of a torque ripple, per turn.
    const MIN_ORDER: f64 = 2.0;
    match drawn.effect {
        HiddenCause::UnmodelledInertia => drawn.size = drawn.size.abs(),
        HiddenCause::TorqueRipple if drawn.order < MIN_ORDER => {
            let ratio = MIN_ORDER / drawn.order;
            drawn.harmonics.iter_mut().for_each(|wave| wave.order *= ratio);
            drawn.order = MIN_ORDER;
        }
        _ => {}
    }
    drawn
}

/// Draws a structure that no cause of the catalogue describes: an extra column, a place on the travel, or a band of speed.
fn draw_unknown(sampler: &mut Sampler, campaign: &mut Campaign) -> HiddenEffect {
    let curve = [Curve::Straight, Curve::Square, Curve::Step][sampler.below(3)];
    let flavour = match sampler.below(8) {
        3..=6 if campaign.sensing.has_position() => return draw_along(sampler, campaign),
        7 => {
            // Below the Stribeck velocity, the law would fit a band as its own curve.
            let most = 0.7 * campaign.drive.top_rad_s;
            let least = (4.0 * campaign.seal.stribeck_rad_s).min(0.7 * most);
            let speed = sampler.log_between(least, most);
            Flavour::Band { speed, width: speed * sampler.between(0.15, 0.3) }
        }
        _ => {
            let extra = add_extra(sampler, campaign);
            let (least, most) = campaign.range(|condition| condition.extra(extra));
            Flavour::Column { extra, from: least, range: (most - least).max(1e-3), curve }
        }
    };
    let mut drawn: DrawnCause = effect::draw_with_flavour(sampler, campaign, flavour);
    // A level may also fall with a column.
    if matches!(flavour, Flavour::Column { .. }) {
        drawn.size *= sampler.sign();
    }
    HiddenEffect::Joint(drawn)
}

fn draw_along(sampler: &mut Sampler, campaign: &Campaign) -> HiddenEffect {
    let ends = campaign
        .trajectories()
        .iter()
        .flat_map(|trajectory| trajectory.points.clone())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
            (low.min(point.angle), high.max(point.angle))
        });
    let shape = if sampler.chance(0.4) {
        TravelShape::Slope
    } else {
        TravelShape::Dip { at: sampler.between(0.2, 0.8), width: sampler.between(0.05, 0.35) }
    };
    let (from_rad, length_rad) = (ends.0, (ends.1 - ends.0).max(1e-9));
    HiddenEffect::Along(Along { size: 0.1 * sampler.sign(), from_rad, length_rad, shape })
}

/// Returns an extra column of the log, which is added if there is none.
fn add_extra(sampler: &mut Sampler, campaign: &mut Campaign) -> Extra {
    if let Some(extra) = sampler.pick(&campaign.extras) {
        return extra;
    }
    let all = [Extra::Humidity, Extra::SupplyVoltage, Extra::CableTension, Extra::LubricantAge];
    let extra = all[sampler.below(all.len())];
    let (least, most) = extra.range();
    let is_steady = sampler.chance(0.5);
    for plan in &mut campaign.runs {
        let swing = if is_steady { 0.0 } else { sampler.between(0.02, 0.3) * (most - least) };
        let signal = Signal {
            level: sampler.between(least, most),
            per_s: 0.0,
            swing,
            hz: sampler.log_between(0.5, 5.0) / campaign.drive.seconds,
            phase: sampler.between(0.0, TAU),
        };
        plan.run.condition.extras.push((extra, signal));
    }
    campaign.extras.push(extra);
    extra
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeds;
    use std::collections::BTreeSet;

    #[test]
    fn draw_of_same_seed_gives_same_world_in_order_of_time() {
        for seed in seeds(11).take(4) {
            let (one, other) = (draw(seed), draw(seed));
            assert_eq!(one.log, other.log, "{seed}");
            assert_eq!(one.truth.json(), other.truth.json(), "{seed}");
            for run in &one.log.runs {
                assert!(run.columns.iter().flatten().all(|value| value.is_finite()), "{seed}");
                assert!(run.columns[0].windows(2).all(|t| t[0] < t[1]), "{seed}");
            }
        }
    }

    #[test]
    fn possible_over_many_campaigns_has_every_cause() {
        let mut found = BTreeSet::new();
        for seed in seeds(12).take(60) {
            let mut sampler = Family::Mixed.sampler(seed);
            let plant = Family::Mixed.draw_plant_kind(&mut sampler);
            let mut campaign =
                Campaign::draw(&mut sampler, sensor_kind(seed), plant, Family::Mixed);
            for cause in possible(&campaign) {
                prepare(&mut sampler, &mut campaign, cause);
                let effect = draw_effect(&mut sampler, &mut campaign, cause);
                found.insert(effect.cause());
                assert!(effect.size() != 0.0 && effect.size().is_finite(), "{seed}: {effect:?}");
                let columns = effect.columns(&campaign);
                let needs_column = [Cause::Coupling, Cause::Payload].contains(&cause);
                assert!(!needs_column || !columns.is_empty(), "{seed}: {effect:?}");
            }
        }
        let catalogue = HiddenCause::ALL.iter().map(|cause| cause.name());
        let all: BTreeSet<&str> =
            catalogue.chain(["encoder-error", "joint-coupling", "payload"]).collect();
        assert_eq!(found, all);
    }
}
