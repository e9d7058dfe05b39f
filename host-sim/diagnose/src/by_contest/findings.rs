//! The findings of a diagnosis: the named causes with the size that the extended model gives them, and the checks of sizes that
//! lower a probability.

use super::search::Chosen;
use super::{Models, Offer};
use crate::contest::{DRAWS, FinalistCause, Outcome as ContestOutcome, Rows, share_taken};
use crate::extended::{Extended, Size};
use crate::finalist::Realised;
use crate::finding::Finding;
use crate::naming::{IMPOSSIBLE, WeighedCause, confounded};
use crate::rules::{self, Rejection};
use crate::train_test::TrainTest;
use joint_log::number::figure;

/// Largest p value of a finding that may be likely. The p value is the share of resampled logs without the cause, so that a
/// finding within the limit is stable.
const MAX_P_VALUE: f64 = 0.05;

/// Step of probabilities within which two causes are equally likely: the calibration is not more accurate.
const SAME_PROBABILITY: f64 = 0.05;

/// Highest probability of a finding above [`MAX_P_VALUE`].
const UNSTABLE: f64 = 0.59;

/// Minimum share of the resampled logs that show a cause without a term in the model.
const MIN_STABILITY: f64 = 0.5;

/// Returns a cause in each of the finalists that have it.
fn in_finalists<'o>(
    weighed: &WeighedCause,
    outcome: &'o ContestOutcome,
) -> impl Iterator<Item = &'o FinalistCause> {
    let key = weighed.figures.key.clone();
    let causes = outcome.finalists.iter().flat_map(|finalist| &finalist.causes);
    causes.filter(move |cause| cause.key == key)
}

/// Lowers the probability of causes that make more torque than the log holds in every finalist that has them. In one of several
/// a cause may only cancel another.
pub(super) fn check_torques(weighed: &mut [WeighedCause], outcome: &ContestOutcome, rows: &Rows) {
    let most = rows.torque.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
    for cause in weighed {
        let torques = in_finalists(cause, outcome).map(|finalist| finalist.torque_rms);
        if let Some(least) = torques.reduce(f64::min).filter(|least| *least > most) {
            let (made, held) = (figure(least), figure(most));
            let why = format!("it would make a torque of {made} RMS in a log of {held} at most");
            cause.reject(IMPOSSIBLE, Rejection::new(&rules::UNPHYSICAL, why));
        }
    }
}

/// Lowers the probability of causes whose fitted size is impossible.
pub(super) fn check_sizes(weighed: &mut [WeighedCause], log: &TrainTest, offer: &Offer) {
    for realised in &offer.realised {
        let size = realised.cause.size(&extended_by(realised, offer, log));
        let least = (realised.cause.least_size)(log);
        if let Some(cause) = weighed.iter_mut().find(|cause| realises(realised, cause)) {
            cause.check_size(&size, least);
        }
    }
}

/// Sets what the driver's law keeps less than the linear promise.
pub(super) fn set_shortfall(weighed: &mut [WeighedCause], chosen: &Chosen, models: &Models) {
    let taken = |offer: &Offer| share_taken(models.before.metrics.rmse, offer.after.metrics.rmse);
    let kept = models.offer.as_ref().map_or(0.0, taken);
    let promised = chosen.hypothesis.promised().max(f64::MIN_POSITIVE);
    let shortfall = (1.0 - kept / promised).clamp(0.0, 1.0);
    for cause in weighed.iter_mut().filter(|cause| cause.is_named()) {
        cause.shortfall = Some(shortfall);
    }
}

/// Returns true if a realised cause is this one.
fn realises(realised: &Realised, weighed: &WeighedCause) -> bool {
    let follows = realised.follows.as_ref().map(|follows| follows.column.as_str());
    realised.cause == weighed.cause
        && follows.is_none_or(|column| weighed.figures.key.columns == [column])
}

fn extended_by<'a>(realised: &'a Realised, offer: &'a Offer, log: &'a TrainTest) -> Extended<'a> {
    Extended { outcome: &offer.outcome, log, follows: realised.follows.as_ref() }
}

/// Returns the findings: the named causes, with the size that the extended model gives them.
pub(super) fn findings(
    weighed: &[WeighedCause],
    log: &TrainTest,
    offer: Option<&Offer>,
    outcome: &ContestOutcome,
) -> Vec<Finding> {
    let finding = |cause: &WeighedCause| {
        let in_offer = offer.and_then(|offer| {
            let realised = offer.realised.iter().find(|realised| realises(realised, cause))?;
            Some(in_model(realised, offer, log))
        });
        let sized = in_offer.unwrap_or_else(|| outside_model(cause, outcome, log));
        with_figures(sized, cause, weighed)
    };
    let named = weighed.iter().filter(|cause| cause.is_named());
    let mut findings: Vec<Finding> = named.map(finding).collect();
    // Chance names a cause that most resampled logs do not show.
    findings.retain(|finding| finding.is_in_model || finding.stability >= MIN_STABILITY);
    // Of equally likely causes the more material one stays first.
    let rank = |finding: &Finding| (finding.probability / SAME_PROBABILITY).floor();
    findings.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    findings
}

/// Returns a finding with the figures of its cause in the contest.
fn with_figures(sized: Finding, cause: &WeighedCause, weighed: &[WeighedCause]) -> Finding {
    let figures = &cause.figures;
    let p_value = (1.0 - figures.inclusion).max(1.0 / DRAWS as f64);
    let most = if p_value <= MAX_P_VALUE { 1.0 } else { UNSTABLE };
    let confusable_with = confounded(weighed, figures);
    let rivals: Vec<&str> = confusable_with.iter().map(|rival| rival.cause.name()).collect();
    let rivals = match rivals.is_empty() {
        true => String::new(),
        false => format!("; this log cannot distinguish it from {}", rivals.join(" or ")),
    };
    Finding {
        p_value,
        stability: figures.inclusion,
        probability: cause.probability.min(most),
        share_of_residual: figures.last.clamp(0.0, 1.0),
        gain: figures.gain,
        confusable_with,
        in_words: sized.in_words + &rivals,
        ..sized
    }
}

/// Returns a finding whose term is in the extended model.
fn in_model(realised: &Realised, offer: &Offer, log: &TrainTest) -> Finding {
    let extended = extended_by(realised, offer, log);
    let cause = realised.cause;
    let size = cause.size(&extended);
    Finding {
        in_words: cause.in_words(&size, &extended),
        order: (cause.order)(&extended),
        evidence: (cause.evidence)(&realised.columns, &extended),
        columns: realised.columns.clone(),
        size,
        is_in_model: true,
        ..Finding::of(cause)
    }
}

/// Returns a finding that the extended model has no term for: its size is the torque that it makes.
fn outside_model(weighed: &WeighedCause, outcome: &ContestOutcome, log: &TrainTest) -> Finding {
    let first = in_finalists(weighed, outcome).next();
    let rms = first.map_or(0.0, |cause| cause.torque_rms);
    let error = first.map_or(0.0, |cause| cause.torque_rms_error);
    let size = Size::new(rms, error, log.train.joint.torque_unit());
    let mut in_words =
        format!("{}: it makes a torque of {} RMS", weighed.cause.meaning(), size.in_words());
    if !weighed.figures.detail.is_empty() {
        in_words += &format!(" ({})", weighed.figures.detail);
    }
    Finding { in_words, columns: weighed.columns(), size, ..Finding::of(weighed.cause) }
}
