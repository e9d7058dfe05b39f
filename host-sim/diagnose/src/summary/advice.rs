//! What to do after a diagnosis: correct the log, take more of the rigid body into the model, or record a motion.
//!
//! A fault of the log comes first, because nothing that follows from a faulty log counts. The recording that is proposed is
//! the one that answers the first open question of this list:
//!
//! 1. Which of two causes is it that this log cannot tell apart?
//! 2. What does a cause that is found need to be measured well?
//! 3. Is a cause that is possible, and not named, there?
//! 4. What are the parameters of the law that this log does not determine?
//! 5. What is the effect of a quantity that is constant in this log?

use super::{doubts, names};
use crate::Diagnosis;
use crate::cause::Remedy;
use crate::experiment::most_informative;
use crate::finding::Finding;
use compensator_core::{Quantity, TermKind};
use friction_fit::State;
use friction_fit::spec::rigid_body_name;
use joint_log::Dataset;
use joint_log::number::figure;
use joint_log::statistics::extent;

/// Returns what to do next: what to measure, with the command that writes a motion for it, or what to correct in the log.
pub fn next_experiment(diagnosis: &Diagnosis) -> String {
    if let Some(fault) = diagnosis.leading_fault() {
        let what = format!("{}: {}", fault.kind.name(), fault.columns.join(", "));
        return match fault.corrected {
            true => format!(
                "Mend the log at its source ({what}), so that later logs need no correction."
            ),
            false => format!("Correct the log first ({what}), and diagnose it again."),
        };
    }
    if let Some(load) = unused_load(diagnosis) {
        return load;
    }
    let body = missing_rigid_body(diagnosis).map(|words| words + " ").unwrap_or_default();
    body + &next_recording(diagnosis) + &standard_motion(&diagnosis.log.train)
}

/// Returns the command that writes the standard motion in the range and speed of a log; empty for a log without motion.
fn standard_motion(data: &Dataset) -> String {
    let [mut range, mut speed] = [0.0f64; 2];
    for run in &data.runs {
        let mut stroke = 0.0f64;
        for (time, v) in run.time_s.windows(2).zip(run.velocity.windows(2)) {
            // A stroke ends where the velocity changes its sign. A gap of the log is no motion, and a spike is no speed.
            let way = 0.5 * (v[0] + v[1]) * (time[1] - time[0]).min(MAX_STEP_S);
            stroke = if v[0] * v[1] > 0.0 { stroke + way } else { 0.0 };
            range = range.max(0.5 * stroke.abs());
            speed = speed.max(v[0].abs().min(v[1].abs()));
        }
    }
    let (unit, end) = (Quantity::Position.unit(data.joint), "(how to: record-a-good-log.md)");
    match [range, speed].map(|most| figure(most.min(MAX_BOUND))) {
        _ if range == 0.0 => String::new(),
        [range, speed] => format!(
            " A motion in the range and speed of this log: host-sim move --standard --range ±{range}{unit} --speed \
             {speed}{unit}/s --dry-run --out motion {end}."
        ),
    }
}

/// Longest time between two rows over which a joint is taken to move on, s.
const MAX_STEP_S: f64 = 0.1;

/// Largest range, rad or m, and speed that `move` accepts.
const MAX_BOUND: f64 = 100.0;

/// Returns what to measure next.
fn next_recording(diagnosis: &Diagnosis) -> String {
    let confused = diagnosis.findings.iter().find(|finding| !finding.confusable_with.is_empty());
    if let Some(finding) = confused {
        return to_distinguish(finding);
    }
    let asked = |finding: &Finding| (finding.cause.next_experiment)(&finding.columns);
    if let Some(next) = diagnosis.findings.iter().find_map(asked) {
        return next;
    }
    let doubts = doubts(diagnosis);
    let possible: Vec<(&str, f64)> =
        doubts.iter().map(|doubt| (doubt.cause, doubt.probability)).collect();
    let is_logged = |quantity: Quantity| diagnosis.log.has_column(name_in(quantity, diagnosis));
    if let Some(next) = most_informative(&possible, is_logged) {
        return format!(
            "{}: this log cannot confirm or exclude {}.",
            next.instruction,
            names(doubts.iter())
        );
    }
    to_determine_the_law(diagnosis).unwrap_or_else(|| to_vary_what_is_constant(diagnosis))
}

/// Returns the recording that distinguishes a finding from the causes that this log cannot tell from it.
fn to_distinguish(finding: &Finding) -> String {
    let is_velocity = |name: &String| name.starts_with("velocity");
    let mut vary: Vec<String> = finding.columns.clone();
    let mut hold: Vec<String> = Vec::new();
    for rival in &finding.confusable_with {
        hold.extend(rival.columns.iter().filter(|name| !vary.contains(name)).cloned());
    }
    hold.dedup();
    if vary.iter().all(is_velocity) {
        hold.retain(|name| !is_velocity(name));
        vary.clear();
    }
    let others: Vec<&str> =
        finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
    let is_of_time = others.iter().all(|name| ["time-drift", "warm-up"].contains(name));
    let vary = vary.join(" and ");
    let how = if !hold.is_empty() && !vary.is_empty() {
        format!("vary {vary} while {} stays constant, and vice versa", hold.join(" and "))
    } else if is_of_time && !vary.is_empty() {
        format!("vary {vary} in the order A, B, B, A over the campaign")
    } else {
        "add slow reversals and pauses of different length in both directions".into()
    };
    format!("To distinguish {} from {}, {how}.", finding.cause.name(), others.join(" and "))
}

/// Returns the motion that determines a parameter of the law, if this log leaves one undetermined.
fn to_determine_the_law(diagnosis: &Diagnosis) -> Option<String> {
    let is_loose = |names: [&str; 2]| {
        let mut estimates = diagnosis.extended.estimates.iter();
        estimates.any(|e| e.state == State::NotDetermined && names.contains(&e.id.name()))
    };
    if is_loose(["bristle_stiffness", "bristle_damping"]) {
        let motion = "Add small oscillations within the bristles' travel (a few hertz, with growing amplitude until the joint \
                      breaks away): this log does not determine the bristle parameters.";
        return Some(motion.into());
    }
    is_loose(["stribeck_velocity", "static_torque"]).then(|| {
        "Add slow reversals through zero speed: this log does not determine the Stribeck curve."
            .into()
    })
}

/// Returns the advice to vary the quantities that are constant in this log, or to repeat a run if none is. A quantity that is
/// not logged is none of them, because the joint may have no sensor for it.
fn to_vary_what_is_constant(diagnosis: &Diagnosis) -> String {
    let data = &diagnosis.log.train;
    let is_constant = |name: &str| {
        let values = || data.runs.iter().flat_map(|run| data.column(run, name).unwrap_or_default());
        let [least, most] = extent(values().copied());
        values().next().is_some() && most - least <= NEARLY_CONSTANT * most.abs().max(least.abs())
    };
    let quantities =
        COVARIATES.iter().map(|quantity| (name_in(*quantity, diagnosis), quantity.info().label));
    let quantities = quantities.chain([("payload_kg", "payload")]);
    let constant: Vec<&str> =
        quantities.filter(|(name, _)| is_constant(name)).map(|(_, label)| label).collect();
    if constant.is_empty() {
        "Repeat one of the held-out runs on another day: one campaign cannot show whether its results repeat.".into()
    } else {
        format!(
            "Vary {}: the effect of a constant quantity cannot be identified.",
            constant.join(", ")
        )
    }
}

/// Returns the advice to take the logged load torque into the rigid body, where that may explain the finding.
fn unused_load(diagnosis: &Diagnosis) -> Option<String> {
    let name = name_in(Quantity::LoadTorque, diagnosis);
    let log = &diagnosis.log;
    let is_unused = log.varies(name) && !log.rigid_body.contains(&TermKind::LoadGain);
    let is_body = |finding: &Finding| matches!(finding.cause.remedy(), Remedy::RigidBody(_));
    let asks =
        diagnosis.findings.iter().any(|finding| is_body(finding) || !finding.cause.is_named());
    (is_unused && asks).then(|| {
        let given = log.rigid_body.iter().filter_map(|term| rigid_body_name(*term));
        let parts: Vec<&str> = given.chain(["load"]).collect();
        format!(
            "Diagnose this log once more with --rigid-body {}: it holds the torque of the load, {name}.",
            parts.join(",")
        )
    })
}

/// Returns the advice to take parts of the rigid body that were not requested, unless a cause that is none of them explains more.
fn missing_rigid_body(diagnosis: &Diagnosis) -> Option<String> {
    let hint = diagnosis.rigid_body_hint.as_ref()?;
    let is_body = |finding: &Finding| matches!(finding.cause.remedy(), Remedy::RigidBody(_));
    let is_explained = diagnosis.after.metrics.rmse < hint.rmse_with_parts;
    let is_of_body = diagnosis.findings.iter().any(is_body);
    (is_of_body || !is_explained).then(|| hint.in_words(diagnosis.log.train.joint.torque_unit()))
}

/// Range of a quantity over its size that counts as none: the noise of its sensor.
const NEARLY_CONSTANT: f64 = 0.05;

/// Quantities that a next experiment may vary.
const COVARIATES: [Quantity; 4] =
    [Quantity::RadialForce, Quantity::Pressure, Quantity::Temperature, Quantity::LoadTorque];

/// Returns the name of a quantity's column in the log of this joint.
fn name_in(quantity: Quantity, diagnosis: &Diagnosis) -> &'static str {
    quantity.name(diagnosis.log.train.joint)
}
