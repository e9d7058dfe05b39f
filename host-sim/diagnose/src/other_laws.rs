//! Regressors of friction laws with another shape: a null model for every finding.
//!
//! No joint follows its friction law exactly. A seal may yield in several steps. Its friction may
//! fall with speed along another curve, or with a delay. The residual then has structure wherever
//! the joint reverses, decelerates or accelerates. A cause that depends on the motion explains part
//! of this structure: a load that moves with the joint, an acceleration or a drag.
//!
//! The review therefore computes what a finding still gains beside these regressors: bristles of
//! other stiffnesses, levels that fall at other speeds, delayed levels, and Maxwell-slip elements
//! ([`super::hysteresis`]). A true cause keeps a large part of its gain. A cause that only describes the error of the law loses it.

use super::candidate::{FitContext, Regressor, Row, row};
use super::hysteresis;
use super::sensitivities::Exact;
use super::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};

/// Stiffnesses of the bristles, as multiples of the model's stiffness.
const STIFFNESSES: [f64; 2] = [4.0, 0.25];

/// Speeds above which the levels fall, as shares of the log's top speed. At a larger share, the
/// curve resembles a drag and would take the gain of a true drag.
const SPEEDS: [f64; 2] = [0.05, 0.15];

/// Percentile of the speeds of a log that counts as its top speed.
const TOP_PERCENT: usize = 95;

/// Returns the regressors of other laws beside a model.
pub fn columns(context: &FitContext) -> Vec<Regressor> {
    let stiffness = context.at.parameters.get(Id::BristleStiffness);
    let bristles = |times: f64| {
        let settings = vec![(Id::BacklashTravel, 0.0), (Id::BristleStiffness, times * stiffness)];
        Regressor::Exact(Exact { kind: TermKind::Backlash, settings, derivative: None })
    };
    let falls_off = |speed: f64| {
        row(move |r: &Row| {
            let share = r.sample.velocity_rad_s / speed;
            r.level * (-share * share).exp()
        })
    };
    // Change of the level by a short delay, to first order: friction may depend on the past speed.
    let remembers = |speed: f64| {
        row(move |r: &Row| {
            let share = r.sample.velocity_rad_s / speed;
            let rate = -2.0 * share * r.sample.acceleration_rad_s2 / speed;
            r.level * (-share * share).exp() * rate
        })
    };
    let bristles_of = STIFFNESSES.into_iter().filter(|_| context.spec.law.has_bristles());
    let top = top_speed(context.log);
    let speeds = SPEEDS.into_iter().map(|share| share * top).filter(|speed| *speed > 0.0);
    let of_speed = speeds.flat_map(|speed| [falls_off(speed), remembers(speed)]);
    let elements = hysteresis::columns(context);
    bristles_of.map(bristles).chain(of_speed).chain(elements).collect()
}

fn top_speed(log: &TrainTest) -> f64 {
    let samples = log.train_tracks.iter().flat_map(|track| &track.samples);
    let mut speeds: Vec<f64> = samples.map(|sample| sample.velocity_rad_s.abs()).collect();
    if speeds.is_empty() {
        return 0.0;
    }
    let at = (speeds.len() - 1) * TOP_PERCENT / 100;
    *speeds.select_nth_unstable_by(at, f64::total_cmp).1
}
