//! Interpretation of a fit in sentences.

use super::outcome::{Estimate, Outcome, State};
use super::predict::Predicted;
use super::track::Track;
use super::treatment;
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId};

/// Absolute correlation above which two parameters are reported as confounded: the data determine a combination only.
const CONFOUNDED_CORRELATION: f64 = 0.98;

/// Returns the notes that a user should read before using the estimates.
pub(super) fn verdicts(
    outcome: &Outcome,
    unobserved: &[ParameterId],
    predicted: &Predicted,
    tracks: &[Track],
) -> Vec<String> {
    let mut notes = Vec::new();
    if !outcome.converged {
        notes.push("the fit reached its iteration limit before it converged".to_owned());
    }
    if outcome.parameters.law.has_bristles() {
        notes.extend(bristle_note(predicted, tracks));
    }
    for estimate in &outcome.estimates {
        let name = estimate.id.name();
        match estimate.state {
            State::Determined => notes.extend(extrapolated_level(estimate, tracks)),
            State::NotDetermined if unobserved.contains(&estimate.id) => {
                notes.push(format!(
                    "{name}: not determined: its column is absent or zero in all rows"
                ));
            }
            State::NotDetermined if estimate.std_error.is_none() => {
                notes.push(format!(
                    "{name}: not determined: on these rows its effect is a combination of other parameters"
                ));
            }
            State::NotDetermined if is_positive(estimate.id) || is_significant(estimate) => {
                notes.push(format!("{name}: not determined by this data"));
            }
            State::NotDetermined => {
                notes.push(format!(
                    "{name}: not determined by this data: not significantly different from 0"
                ));
            }
            State::AtStart if estimate.std_error.is_none() => {}
            State::AtStart => {
                notes.push(format!("{name}: at its start: no measured row depends on it"));
            }
            State::AtBound => {
                notes.push(format!("{name}: at its bound: {}", treatment::of(estimate.id).at_bound))
            }
        }
    }
    notes.extend(confounded_groups(outcome));
    if outcome.parameters.get(Id::ViscousFriction) < 0.0 && outcome.spec.law != LawKind::Extended {
        notes.push(
            "viscous_friction is negative: friction falls with speed over this range, as on a \
             Stribeck curve"
                .to_owned(),
        );
    }
    if outcome.autocorrelation_time > 3.0 {
        notes.push(format!(
            "the residual is autocorrelated: about {:.0} neighbouring rows count as one observation, and \
             the standard errors are {:.1} times those of white noise",
            outcome.autocorrelation_time,
            outcome.autocorrelation_time.sqrt()
        ));
    }
    notes
}

/// Largest plausible ratio of a static level to the largest logged torque. A level above it is not reached in the log.
const MAX_STATIC_RATIO: f64 = 2.0;

/// Returns a note if a static level is far above every logged torque.
fn extrapolated_level(estimate: &Estimate, tracks: &[Track]) -> Option<String> {
    if estimate.id != Id::StaticTorque {
        return None;
    }
    let included = |track: &'_ Track| {
        let rows = (0..track.len()).filter(|row| track.is_included(*row));
        rows.map(|row| track.torque[row].abs()).fold(0.0, f64::max)
    };
    let largest = tracks.iter().map(included).fold(0.0, f64::max);
    (largest > 0.0 && estimate.value > MAX_STATIC_RATIO * largest).then(|| {
        format!(
            "{}: {:.1} times the largest logged torque: the log does not reach it, and the value is an extrapolation \
             to standstill",
            estimate.id.name(),
            estimate.value / largest
        )
    })
}

/// Returns true if the parameter cannot be 0.
fn is_positive(id: ParameterId) -> bool {
    id.info().lower > 0.0
}

/// Returns true if a value differs from 0 by at least two standard errors.
fn is_significant(estimate: &Estimate) -> bool {
    estimate.std_error.is_none_or(|error| estimate.value.abs() >= 2.0 * error)
}

/// Returns a note if the bristles never saturate, or never move.
fn bristle_note(predicted: &Predicted, tracks: &[Track]) -> Option<String> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    let sliding_rows = predicted.presliding * rows as f64;
    if predicted.saturation < 0.9 {
        return Some(format!(
            "the bristle never saturates: it reaches at most {:.0} % of the Coulomb level and acts as \
             a spring, so the data do not determine the levels",
            100.0 * predicted.saturation
        ));
    }
    (sliding_rows < 10.0).then(|| {
        "the bristle is always fully slipping: steady sliding does not determine its stiffness and \
         damping"
            .to_owned()
    })
}

/// Returns a note for each group of parameters with a high correlation.
fn confounded_groups(outcome: &Outcome) -> Vec<String> {
    let fitted: Vec<_> = outcome.estimates.iter().filter(|e| e.std_error.is_some()).collect();
    // Pairs are merged into groups: one group is easier to read than many pairs.
    let mut groups: Vec<(Vec<usize>, f64)> = Vec::new();
    for (i, first) in fitted.iter().enumerate() {
        for (j, second) in fitted.iter().enumerate().skip(i + 1) {
            let correlation = outcome.correlation[(i, j)];
            let both = [first.state, second.state].contains(&State::AtStart);
            if correlation.abs() <= CONFOUNDED_CORRELATION || both {
                continue;
            }
            let (mut group, mut least) = (vec![i, j], correlation.abs());
            // Groups with a common member are merged.
            groups.retain(|(others, weakest)| {
                let shares = others.iter().any(|other| group.contains(other));
                if shares {
                    group.extend(others);
                    least = least.min(*weakest);
                }
                !shares
            });
            group.sort_unstable();
            group.dedup();
            groups.push((group, least));
        }
    }
    let notes = groups.iter().map(|(group, least)| {
        let names: Vec<&str> = group.iter().map(|at| fitted[*at].id.name()).collect();
        let (last, others) = names.split_last().unwrap_or((&"", &[]));
        format!(
            "{} and {last} are known only together (correlation {least:.3}{}): the data determine a combination of them, \
             but none of them alone",
            others.join(", "),
            if group.len() > 2 { " or more" } else { "" }
        )
    });
    notes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;

    #[test]
    fn extrapolated_level_with_static_torque_above_the_log_returns_note() {
        let track = Track::even(vec![Default::default(); 3], vec![1.0, -2.0, 0.5], 0.01);
        let note = |id, value| {
            let estimate = Estimate { id, value, std_error: Some(0.1), state: State::Determined };
            extrapolated_level(&estimate, std::slice::from_ref(&track))
        };
        assert_eq!(note(Id::StaticTorque, 3.9), None);
        let found = note(Id::StaticTorque, 6.0).unwrap();
        message::check("verdicts", "level above the log", &found, &["static_torque", "3.0 "]);
        assert_eq!(note(Id::CoulombTorque, 6.0), None);
    }
}
