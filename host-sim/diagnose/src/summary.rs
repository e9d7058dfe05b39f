//! Summary of a diagnosis in five sentences: the error, where it occurs, its cause, the gain of the
//! extension, and the next experiment.
//!
//! Errors are RMS values in the joint's torque unit, Nm or N.

use super::cause::Remedy;
use super::experiment::most_informative;
use super::finding::{Finding, probability_in_words};
use super::gravity_load;
use super::left_out::LeftOut;
use super::naming::NAMED;
use super::{Diagnosis, Share};
use compensator_core::{Quantity, TermKind};
use friction_fit::State;
use friction_fit::spec::rigid_body_name;
use joint_log::Dataset;
use joint_log::number::{figure, significant};

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
        let mut vary: Vec<String> = finding.columns.clone();
        let mut hold: Vec<String> = Vec::new();
        for rival in &finding.confusable_with {
            hold.extend(rival.columns.iter().filter(|name| !vary.contains(name)).cloned());
        }
        hold.dedup();
        let motion = |names: &[String]| names.iter().all(|name| name.starts_with("velocity"));
        if motion(&vary) {
            hold.retain(|name| !name.starts_with("velocity"));
            vary.clear();
        }
        let others: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        if hold.is_empty() || vary.is_empty() {
            let is_of_time = others.iter().all(|name| ["time-drift", "warm-up"].contains(name));
            let how = match is_of_time && !vary.is_empty() {
                true => {
                    format!("vary {} in the order A, B, B, A over the campaign", vary.join(" and "))
                }
                false => {
                    "add slow reversals and pauses of different length in both directions".into()
                }
            };
            return format!(
                "To distinguish {} from {}, {how}.",
                finding.cause.name(),
                others.join(" and ")
            );
        }
        return format!(
            "To distinguish {} from {}, vary {} while {} stays constant, and vice versa.",
            finding.cause.name(),
            others.join(" and "),
            vary.join(" and "),
            hold.join(" and ")
        );
    }
    let asked = |finding: &Finding| finding.cause.next_experiment(&finding.columns);
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
    let loose: Vec<&str> = diagnosis
        .extended
        .estimates
        .iter()
        .filter(|e| e.state == State::NotDetermined)
        .map(|e| e.id.name())
        .collect();
    if loose.iter().any(|name| ["bristle_stiffness", "bristle_damping"].contains(name)) {
        return "Add small oscillations within the bristles' travel (a few hertz, with growing amplitude until the joint breaks \
                away): this log does not determine the bristle parameters."
            .into();
    }
    if loose.iter().any(|name| ["stribeck_velocity", "static_torque"].contains(name)) {
        return "Add slow reversals through zero speed: this log does not determine the Stribeck curve.".into();
    }
    // A joint may have no sensor for a quantity that is not in its log.
    let data = &diagnosis.log.train;
    let is_constant = |name: &str| {
        let values = || data.runs.iter().flat_map(|run| data.column(run, name).unwrap_or_default());
        let [least, most] =
            [values().copied().reduce(f64::min), values().copied().reduce(f64::max)];
        let range =
            least.zip(most).map(|(least, most)| (most - least, most.abs().max(least.abs())));
        range.is_some_and(|(range, size)| range <= NEARLY_CONSTANT * size)
    };
    let known =
        COVARIATES.iter().map(|quantity| (name_in(*quantity, diagnosis), quantity.info().label));
    let known = known.chain([("payload_kg", "payload")]);
    let constant: Vec<&str> =
        known.filter(|(name, _)| is_constant(name)).map(|(_, label)| label).collect();
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

/// Lowest probability of a cause that is reported as possible.
const POSSIBLE: f64 = 0.1;

/// A cause that is possible and not named.
#[derive(Debug)]
struct Doubt<'a> {
    cause: &'static str,
    probability: f64,
    /// Why a rule refused it, if one did.
    refusal: Option<&'a str>,
}

/// Returns the causes that are possible and not named, most likely first.
fn doubts(diagnosis: &Diagnosis) -> Vec<Doubt<'_>> {
    let candidates = diagnosis.candidates.iter();
    let candidates = candidates.map(|candidate| {
        (candidate.cause.name(), candidate.probability, candidate.rejection.as_ref())
    });
    let is_named =
        |name: &str| diagnosis.findings.iter().any(|finding| finding.cause.name() == name);
    let mut doubts: Vec<Doubt> = candidates
        .filter(|(cause, probability, _)| *probability >= POSSIBLE && !is_named(cause))
        .map(|(cause, probability, rejection)| {
            let refusal = rejection.map(|rejection| rejection.why.as_str());
            Doubt { cause, probability, refusal }
        })
        .collect();
    doubts.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    doubts
}

/// Returns causes with their probabilities as a list in words.
fn names<'a>(doubts: impl Iterator<Item = &'a Doubt<'a>>) -> String {
    let name = |doubt: &Doubt| {
        format!("{} (probability {})", doubt.cause, probability_in_words(doubt.probability))
    };
    doubts.map(name).collect::<Vec<_>>().join(" or ")
}

/// Why a likely cause without a refusal is not named.
const NO_GAIN: &str = "the extension does not gain by it on held-out rows";

/// Returns sentences on the causes that are not named: below the threshold because they are not likely enough, and from the
/// threshold on because of what refused them. It is empty if there are none.
fn unnamed(doubts: &[Doubt], threshold: f64) -> String {
    let (likely, unlikely): (Vec<&Doubt>, Vec<&Doubt>) =
        doubts.iter().partition(|doubt| doubt.probability >= threshold);
    let mut text = String::new();
    let possible: Vec<&Doubt> =
        unlikely.into_iter().filter(|doubt| doubt.refusal.is_none()).collect();
    if !possible.is_empty() {
        text += &format!(
            " Possible, but not likely enough to be named: {}.",
            names(possible.into_iter())
        );
    }
    for doubt in likely {
        let why = doubt.refusal.unwrap_or(NO_GAIN);
        text += &format!(" Refused: {}, because {why}.", names(std::iter::once(doubt)));
    }
    text
}

/// Returns where in the motion the error lies.
fn place(diagnosis: &Diagnosis) -> String {
    let worst = diagnosis.by_regime.iter().max_by(|a, b| a.of_error.total_cmp(&b.of_error));
    let Some(worst) = worst else { return String::new() };
    let share = |share: &Share| {
        let (error, spread) = (100.0 * share.of_error, 200.0 * share.uncertainty);
        format!("{error:.0} ± {spread:.0} % of the squared error")
    };
    if worst.of_rows < 0.95 {
        let rows = 100.0 * worst.of_rows;
        return format!(
            "{} lies in {}, which is {rows:.0} % of the rows.",
            share(worst),
            worst.name
        );
    }
    // With a single regime, the direction is reported instead.
    let harder = diagnosis.by_direction.iter().max_by(|a, b| a.of_error.total_cmp(&b.of_error));
    harder.map_or_else(String::new, |harder| {
        let rows = 100.0 * harder.of_rows;
        let (regime, direction) = (&worst.name, &harder.name);
        format!(
            "All rows are {regime}; {} lies {direction}, which is {rows:.0} % of the rows.",
            share(harder)
        )
    })
}

/// Returns the best candidate and why it was rejected, for a log without a cause.
fn closest(diagnosis: &Diagnosis) -> String {
    let Some(best) = diagnosis.candidates.first() else { return String::new() };
    let columns = best.columns();
    let of = if columns.is_empty() { String::new() } else { format!(" ({})", columns.join(", ")) };
    format!(
        " The best candidate was {}{of}, with {} ± {} % of the squared error; it was rejected: {}.",
        best.cause.name(),
        significant(100.0 * best.figures.alone, 2),
        significant(200.0 * best.gain_error(), 2),
        best.reason()
    )
}

/// Returns the part of an RMS error that a better model could remove, above an independent floor.
pub fn above_floor(rmse: f64, floor: f64) -> f64 {
    (rmse * rmse - floor * floor).max(0.0).sqrt()
}

/// Errors up to this multiple of the noise floor do not differ from it, because the floor is an estimate.
const AT_FLOOR: f64 = 1.05;

/// Least share of the remaining squared error that trees must predict for the reader to look for its reason.
const WORTHWHILE: f64 = 0.05;

/// Returns sentences on the error that remains: how much of it is noise, whether the logged columns could explain more, what
/// to do, and the share of the removable error that is removed.
pub fn remaining_error(diagnosis: &Diagnosis) -> String {
    let unit = diagnosis.log.train.joint.torque_unit();
    let (after, noise) = (diagnosis.after.metrics.rmse, diagnosis.noise_floor);
    let plain = diagnosis.hand_over.plain.held_out.metrics.rmse;
    let ceiling = &diagnosis.ceiling;
    let least = figure(ceiling.rmse);
    let share = 1.0 - (ceiling.rmse / after).powi(2);
    let percent = |share: f64| significant((100.0 * share).clamp(0.0, 100.0), 2);
    let is_clear = after - ceiling.rmse > 2.0 * ceiling.std_error;
    let trees = "Boosted trees with all logged columns, evaluated on rows that they have not seen,";
    let more = if after <= AT_FLOOR * noise {
        "The rest is noise, so no better model is possible.".to_owned()
    } else if is_clear && share > WORTHWHILE {
        format!(
            "{trees} explain {} % more of its square and leave {least} {unit}. The rest follows a logged column in a way that \
             no cause describes: vary the columns one at a time to find it.",
            percent(share)
        )
    } else {
        format!(
            "{trees} explain no more of it (they leave {least} {unit}). What is above the noise needs a quantity that is not \
             logged, or a better sensor."
        )
    };
    let removable = plain.powi(2) - ceiling.rmse.powi(2);
    let removed = match removable > 0.0 {
        true => format!(
            " Of the squared error that a model could remove, from plain friction ({} {unit}) to boosted trees \
             ({least} {unit}), {} % is removed.",
            figure(plain),
            percent((plain.powi(2) - after.powi(2)) / removable)
        ),
        false => String::new(),
    };
    format!(
        "{} {unit} RMS is left, of which {} {unit} is noise. {more}{removed}",
        figure(after),
        figure(noise.min(after))
    )
}

/// Share of the torque's variance that a model must explain for the torque to depend on the motion.
const MIN_EXPLAINED: f64 = 0.1;

/// Returns a warning if the torque does not depend on the motion.
fn independent_torque(diagnosis: &Diagnosis) -> Option<String> {
    let explained = 1.0 - diagnosis.after.metrics.nrmse_std.powi(2);
    (explained < MIN_EXPLAINED).then(|| {
        format!(
            "The model explains {:.0} % of the torque's variance: the torque hardly depends on the motion. Probably it is an \
             external torque, or friction has been subtracted from it; log the motor current.",
            100.0 * explained.max(0.0)
        )
    })
}

/// Returns what a reader must know before anything else: the leading fault of the log, or that the torque is not friction.
pub fn warning(diagnosis: &Diagnosis) -> Option<String> {
    let fault = diagnosis.leading_fault().map(|fault| fault.in_words.clone());
    fault.or_else(|| independent_torque(diagnosis))
}

/// Returns the five sentences.
pub fn summary(diagnosis: &Diagnosis) -> Vec<String> {
    let unit = diagnosis.log.train.joint.torque_unit();
    let runs =
        |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let before = diagnosis.before.metrics.rmse;
    let seen = match diagnosis.left_out {
        Some(LeftOut::Runs) => {
            format!(
                "each of {} with a fit to the others",
                runs(diagnosis.log.train.runs.len(), "run")
            )
        }
        Some(LeftOut::Stretches) => format!(
            "each stretch of {} with a fit to the other rows",
            runs(diagnosis.log.train.runs.len(), "run")
        ),
        None => format!(
            "{} with a fit to {}",
            runs(diagnosis.log.test.runs.len(), "run"),
            runs(diagnosis.log.train.runs.len(), "run")
        ),
    };
    let first = warning(diagnosis).map(|warning| warning + " ").unwrap_or_default();
    let wrong = format!(
        "{first}The held-out error of a {} model ({seen}) is {} {unit} RMS; the noise floor, the error of the best possible \
         model, is {} {unit}.",
        diagnosis.baseline.spec,
        figure(before),
        figure(diagnosis.noise_floor)
    );
    let place = place(diagnosis);
    let why = why(diagnosis) + &gravity_load::sentence(diagnosis).unwrap_or_default();
    let gain = &diagnosis.gain;
    let better = if let Some(extension) = diagnosis.extension() {
        let [before, after] = [before, diagnosis.after.metrics.rmse]
            .map(|rmse| above_floor(rmse, diagnosis.noise_floor));
        let above = match before > 0.0 {
            true => format!(
                "; the part above the noise floor falls from {} to {} {unit}, by {} %",
                figure(before),
                figure(after),
                significant(100.0 * (1.0 - after / before), 2)
            ),
            false => String::new(),
        };
        format!(
            "With {extension} the held-out error falls to {} {unit}, by {:.1} % (95 % interval {:.1} to {:.1} %){above}.",
            figure(diagnosis.after.metrics.rmse),
            100.0 * gain.value,
            100.0 * gain.ci95[0],
            100.0 * gain.ci95[1]
        )
    } else {
        "No extension is proposed, so the error stays the same.".to_owned()
    };
    // Without a cause, the sentence on the causes has it.
    let better = match diagnosis.findings.is_empty() {
        true => better,
        false => format!("{better} {}", remaining_error(diagnosis)),
    };
    vec![wrong, place, why, better, next_experiment(diagnosis)]
}

/// Returns the causes, or why none is named.
fn why(diagnosis: &Diagnosis) -> String {
    let unnamed = unnamed(&doubts(diagnosis), NAMED);
    let likely = |finding: &Finding| probability_in_words(finding.probability);
    match diagnosis.findings.as_slice() {
        [] => {
            let left = remaining_error(diagnosis);
            format!("No cause is likely enough to be named. {left}{}{unnamed}", closest(diagnosis))
        }
        [first, others @ ..] => {
            let name = first.cause.name();
            let mut text =
                format!("The cause is {name} (probability {}): {}", likely(first), first.in_words);
            for other in others {
                let name = other.cause.name();
                text +=
                    &format!("; then {name} (probability {}: {})", likely(other), other.in_words);
            }
            text + "." + &unnamed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubt(probability: f64, refusal: Option<&str>) -> Doubt<'_> {
        Doubt { cause: "position-ripple", probability, refusal }
    }

    #[test]
    fn unnamed_calls_no_likely_cause_unlikely() {
        for refusal in [None, Some("its order is at its bound")] {
            for probability in [0.1, 0.49, 0.5, 0.94, 1.0] {
                let text = unnamed(&[doubt(probability, refusal)], 0.5);
                let is_likely = probability >= 0.5;
                let why = refusal.unwrap_or(NO_GAIN);
                assert_eq!(text.contains(why), is_likely, "{text}");
                assert_eq!(text.is_empty(), !is_likely && refusal.is_some(), "{text}");
            }
        }
        let parts = ["position-ripple", "0.94", "its order is at its bound"];
        let refused = unnamed(&[doubt(0.94, Some(parts[2]))], 0.5);
        crate::message::check("summaries", "cause refused", &refused, &parts);
        let possible = unnamed(&[doubt(0.49, None)], 0.5);
        crate::message::check(
            "summaries",
            "cause possible",
            &possible,
            &["position-ripple", "0.49"],
        );
    }
}
