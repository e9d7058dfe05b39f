//! Summary of a diagnosis in five sentences: the error, where it occurs, its cause, the gain of the
//! extension, and the next experiment.
//!
//! Errors are RMS values in the joint's torque unit, Nm or N.

use super::experiment::most_informative;
use super::finding::Finding;
use super::gram_blocks::LeftOut;
use super::{Diagnosis, Share};
use compensator_core::Quantity;
use friction_fit::State;
use joint_log::number::{figure, significant};

/// Returns what to measure next.
pub fn next_experiment(diagnosis: &Diagnosis) -> String {
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
            return format!(
                "To distinguish {} from {}, add slow reversals and pauses of different length in both directions.",
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
    let possible = possible(diagnosis);
    let is_logged = |quantity: Quantity| diagnosis.log.has_column(name_in(quantity, diagnosis));
    if let Some(next) = most_informative(&possible, is_logged) {
        return format!(
            "{}: this log cannot confirm or exclude {}.",
            next.instruction,
            names(&possible)
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
    let constant = COVARIATES.iter().filter(|quantity| {
        let name = name_in(**quantity, diagnosis);
        diagnosis.log.has_column(name) && !diagnosis.log.varies(name)
    });
    let constant: Vec<&str> = constant.map(|quantity| quantity.info().label).collect();
    if constant.is_empty() {
        "Repeat one of the held-out runs on another day: one campaign cannot show whether its results repeat.".into()
    } else {
        format!(
            "Vary {}: the effect of a constant quantity cannot be identified.",
            constant.join(", ")
        )
    }
}

/// Quantities that a next experiment may vary.
const COVARIATES: [Quantity; 4] =
    [Quantity::RadialForce, Quantity::Pressure, Quantity::Temperature, Quantity::LoadTorque];

/// Returns the name of a quantity's column in the log of this joint.
fn name_in(quantity: Quantity, diagnosis: &Diagnosis) -> &'static str {
    quantity.name(diagnosis.log.train.joint)
}

/// Lowest probability of a cause that is reported as possible.
const POSSIBLE: f64 = 0.1;

/// Returns the causes below the naming threshold that remain possible, most likely first, with their probabilities.
fn possible(diagnosis: &Diagnosis) -> Vec<(&'static str, f64)> {
    let is_named = |name: &str| diagnosis.findings.iter().any(|own| own.cause.name() == name);
    let weighed = diagnosis.weighed.iter().map(|own| (own.cause.name(), own.probability));
    let mut possible: Vec<(&str, f64)> =
        weighed.filter(|(name, p)| *p >= POSSIBLE && !is_named(name)).collect();
    possible.sort_by(|a, b| b.1.total_cmp(&a.1));
    possible
}

/// Returns causes with their probabilities as a list in words.
fn names(possible: &[(&str, f64)]) -> String {
    let names = possible.iter().map(|(name, p)| format!("{name} (probability {p:.2})"));
    names.collect::<Vec<_>>().join(" or ")
}

/// Returns a sentence on the causes that remain possible; empty if there are none.
fn remaining(diagnosis: &Diagnosis) -> String {
    match possible(diagnosis).as_slice() {
        [] => String::new(),
        possible => format!(" Possible, but not likely enough to be named: {}.", names(possible)),
    }
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
    let Some(best) = diagnosis.scores.first() else { return String::new() };
    let of = if best.columns.is_empty() {
        String::new()
    } else {
        format!(" ({})", best.columns.join(", "))
    };
    let reason = best
        .rejection
        .as_ref()
        .map_or("it failed the review of all candidates", |r| r.why.as_str());
    format!(
        " The best candidate was {}{of}, with {} ± {} % of the squared error; it was rejected: {reason}.",
        best.cause.name(),
        significant(100.0 * best.share, 2),
        significant(200.0 * best.share_error, 2)
    )
}

/// Returns the part of an RMS error that a better model could remove, above an independent floor.
pub fn above_floor(rmse: f64, floor: f64) -> f64 {
    (rmse * rmse - floor * floor).max(0.0).sqrt()
}

/// Returns a sentence on an error above the noise floor that is too small a part of the torque to
/// count as a cause. It is empty if there is no such error.
fn beyond(diagnosis: &Diagnosis) -> String {
    if diagnosis.unexplained_memory_rows <= 0.0 {
        return String::new();
    }
    let metrics = &diagnosis.after.metrics;
    format!(
        " The remaining error is {} times the noise floor and {} % of the torque's standard deviation, and correlates with \
         none of the log's columns.",
        significant(metrics.rmse / diagnosis.noise_floor, 2),
        significant(100.0 * metrics.nrmse_std, 2)
    )
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
    let wrong = format!(
        "The held-out error of a {} model ({seen}) is {} {unit} RMS; the noise floor, the error of the best possible \
         model, is {} {unit}.",
        diagnosis.baseline.spec,
        figure(before),
        figure(diagnosis.noise_floor)
    );
    let place = place(diagnosis);
    let why = match diagnosis.findings.as_slice() {
        [] => {
            let (beyond, closest) = (beyond(diagnosis), closest(diagnosis));
            format!("No cause passed all criteria.{beyond}{closest}{}", remaining(diagnosis))
        }
        [first, others @ ..] => {
            let mut text = format!("The cause is {}: {}", first.cause.name(), first.in_words);
            for other in others {
                text += &format!("; then {} ({})", other.cause.name(), other.in_words);
            }
            text + "." + &remaining(diagnosis)
        }
    };
    let gain = &diagnosis.gain;
    let better = if diagnosis.extended.spec == diagnosis.baseline.spec {
        "No extension is proposed, so the error stays the same.".to_owned()
    } else {
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
            "With {} the held-out error falls to {} {unit}, by {:.1} % (95 % interval {:.1} to {:.1} %){above}.",
            diagnosis.extended.spec,
            figure(diagnosis.after.metrics.rmse),
            100.0 * gain.value,
            100.0 * gain.ci95[0],
            100.0 * gain.ci95[1]
        )
    };
    vec![wrong, place, why, better, next_experiment(diagnosis)]
}
