//! Summary of a diagnosis in five sentences: the error, where it occurs, its cause, the gain of the
//! extension, and the next experiment.
//!
//! Errors are RMS values in the joint's torque unit, Nm or N.

mod advice;

pub use advice::next_experiment;

use super::finding::{Finding, probability_in_words};
use super::gravity_load;
use super::left_out::LeftOut;
use super::naming::NAMED;
use super::{Diagnosis, Share};
use joint_log::Dataset;
use joint_log::number::{figure, significant};

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
    let why = why(diagnosis) + &gravity_load::sentence(diagnosis).unwrap_or_default();
    let better = better(diagnosis);
    // Without a cause, the sentence on the causes has the remaining error.
    let better = match diagnosis.findings.is_empty() {
        true => better,
        false => format!("{better} {}", remaining_error(diagnosis)),
    };
    vec![error(diagnosis), place(diagnosis), why, better, next_experiment(diagnosis)]
}

/// Returns the error without an extension, how it was evaluated, and the noise floor, after a warning if there is one.
fn error(diagnosis: &Diagnosis) -> String {
    let unit = diagnosis.log.train.joint.torque_unit();
    let runs = |data: &Dataset| match data.runs.len() {
        1 => "1 run".to_owned(),
        count => format!("{count} runs"),
    };
    let fitted = runs(&diagnosis.log.train);
    let seen = match diagnosis.left_out {
        Some(LeftOut::Runs) => format!("each of {fitted} with a fit to the others"),
        Some(LeftOut::Stretches) => {
            format!("each stretch of {fitted} with a fit to the other rows")
        }
        None => format!("{} with a fit to {fitted}", runs(&diagnosis.log.test)),
    };
    let warning = warning(diagnosis).map(|warning| warning + " ").unwrap_or_default();
    format!(
        "{warning}The held-out error of a {} model ({seen}) is {} {unit} RMS; the noise floor, the error of the best possible \
         model, is {} {unit}.",
        diagnosis.baseline.spec,
        figure(diagnosis.before.metrics.rmse),
        figure(diagnosis.noise_floor)
    )
}

/// Returns what the extension gains on held-out rows.
fn better(diagnosis: &Diagnosis) -> String {
    let Some(extension) = diagnosis.extension() else {
        return "No extension is proposed, so the error stays the same.".to_owned();
    };
    let unit = diagnosis.log.train.joint.torque_unit();
    let gain = &diagnosis.gain;
    let [before, after] = [&diagnosis.before, &diagnosis.after]
        .map(|held_out| above_floor(held_out.metrics.rmse, diagnosis.noise_floor));
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
