//! The five sentences: what is wrong, where, why, what the extension gains, what to do next.

use super::finding::Finding;
use super::gram_blocks::LeftOut;
use super::{Diagnosis, Share};
use crate::fit::State;
use crate::number::{figure, significant};

/// What to measure next.
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
                "To tell {} from {}, add slow reversals and rests of different length both ways.",
                finding.cause.name(),
                others.join(" and ")
            );
        }
        return format!(
            "To tell {} from {}, vary {} while {} stays constant, and the other way round.",
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
    let loose: Vec<&str> = diagnosis
        .extended
        .estimates
        .iter()
        .filter(|e| e.state == State::NotDetermined)
        .map(|e| e.id.name())
        .collect();
    if loose.iter().any(|name| ["bristle_stiffness", "bristle_damping"].contains(name)) {
        return "Add small oscillations within the bristles' travel (a few hertz, growing until it breaks away): \
                this log does not determine the bristles."
            .into();
    }
    if loose.iter().any(|name| ["stribeck_velocity", "static_torque"].contains(name)) {
        return "Add slow reversals through zero speed: this log does not determine the Stribeck curve.".into();
    }
    let missing: Vec<&str> = [
        ("radial_force_n", "side load"),
        ("pressure_diff_pa", "pressure"),
        ("temperature_c", "temperature"),
    ]
    .into_iter()
    .filter(|(column, _)| !diagnosis.log.varies(column))
    .map(|(_, name)| name)
    .collect();
    if missing.is_empty() {
        "Repeat one of the held-out runs on another day: what a campaign cannot show is whether it repeats.".into()
    } else {
        format!("Vary and log {}: nothing can be said of what does not change.", missing.join(", "))
    }
}

/// Where in the motion the error lies.
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
    // One regime is all there is: what is left to tell is the direction.
    let harder = diagnosis.by_direction.iter().max_by(|a, b| a.of_error.total_cmp(&b.of_error));
    harder.map_or_else(String::new, |harder| {
        let rows = 100.0 * harder.of_rows;
        let (regime, direction) = (&worst.name, &harder.name);
        format!(
            "All of it is {regime}; {} lies {direction}, which is {rows:.0} % of the rows.",
            share(harder)
        )
    })
}

/// Who came closest where nothing was found, and what stood against it.
fn closest(diagnosis: &Diagnosis) -> String {
    let Some(best) = diagnosis.scores.first() else { return String::new() };
    let of = if best.columns.is_empty() {
        String::new()
    } else {
        format!(" ({})", best.columns.join(", "))
    };
    let against =
        if best.passed { "it did not hold when all were heard again" } else { &best.against };
    format!(
        " Closest came {}{of}, {} ± {} % of the squared error; against it: {against}.",
        best.cause.name(),
        significant(100.0 * best.share, 2),
        significant(200.0 * best.share_error, 2)
    )
}

/// The part of an RMS error that a better model could take away, of a floor that is independent of it.
pub fn above_floor(rmse: f64, floor: f64) -> f64 {
    (rmse * rmse - floor * floor).max(0.0).sqrt()
}

/// What is left above the floor and is too little of the torque to be called a cause.
fn beyond(diagnosis: &Diagnosis) -> String {
    if diagnosis.left_over <= 0.0 {
        return String::new();
    }
    let metrics = &diagnosis.after.metrics;
    format!(
        " What is left is {} times the floor and {} % of the torque's standard deviation, and follows none of the log's \
         columns.",
        significant(metrics.rmse / diagnosis.noise_floor, 2),
        significant(100.0 * metrics.nrmse_std, 2)
    )
}

/// The five sentences.
pub fn story(diagnosis: &Diagnosis) -> Vec<String> {
    let unit = diagnosis.log.train.joint.torque_unit();
    let runs =
        |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let before = diagnosis.before.metrics.rmse;
    let seen = match diagnosis.left_out {
        Some(LeftOut::Runs) => {
            format!(
                "each of {} by a fit on the others",
                runs(diagnosis.log.train.runs.len(), "run")
            )
        }
        Some(LeftOut::Stretches) => format!(
            "each stretch of {} by a fit without it",
            runs(diagnosis.log.train.runs.len(), "run")
        ),
        None => format!(
            "{} by a fit on {}",
            runs(diagnosis.log.test.runs.len(), "run"),
            runs(diagnosis.log.train.runs.len(), "run")
        ),
    };
    let wrong = format!(
        "A {} model misses the torque on rows it has not seen ({seen}) by {} {unit} RMS; the floor, what the best possible \
         model would leave, is {} {unit}.",
        diagnosis.baseline.spec,
        figure(before),
        figure(diagnosis.noise_floor)
    );
    let place = place(diagnosis);
    let why = match diagnosis.findings.as_slice() {
        [] => {
            format!("No cause passed, so none is named.{}{}", beyond(diagnosis), closest(diagnosis))
        }
        [first, others @ ..] => {
            let mut text = format!("The cause is {}: {}", first.cause.name(), first.in_words);
            for other in others {
                text += &format!("; then {} ({})", other.cause.name(), other.in_words);
            }
            text + "."
        }
    };
    let gain = &diagnosis.gain;
    let better = if diagnosis.extended.spec == diagnosis.baseline.spec {
        "No extension is offered, so none is gained.".to_owned()
    } else {
        let [before, after] = [before, diagnosis.after.metrics.rmse]
            .map(|rmse| above_floor(rmse, diagnosis.noise_floor));
        let above = match before > 0.0 {
            true => format!(
                "; above the floor it falls from {} to {} {unit}, by {} %",
                figure(before),
                figure(after),
                significant(100.0 * (1.0 - after / before), 2)
            ),
            false => String::new(),
        };
        format!(
            "With {} the error on unseen rows falls to {} {unit}, by {:.1} % (95 % interval {:.1} to {:.1} %){above}.",
            diagnosis.extended.spec,
            figure(diagnosis.after.metrics.rmse),
            100.0 * gain.value,
            100.0 * gain.ci95[0],
            100.0 * gain.ci95[1]
        )
    };
    vec![wrong, place, why, better, next_experiment(diagnosis)]
}
