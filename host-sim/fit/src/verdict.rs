//! Interpretation of a fit in sentences.

use super::outcome::{Outcome, State};
use super::predict::Predicted;
use super::reason::Reason;
use super::track::Track;
use super::treatment::treatment_of;

/// Absolute correlation above which two parameters are reported as confounded: the data determine a combination only.
const CONFOUNDED_CORRELATION: f64 = 0.98;

/// Fewest presliding rows that determine the bristles.
const MIN_PRESLIDING_ROWS: f64 = 10.0;

/// Returns the notes that a user should read before using the estimates.
pub(super) fn verdicts(outcome: &Outcome, predicted: &Predicted, tracks: &[Track]) -> Vec<String> {
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
            State::Determined => {}
            State::NotDetermined => {
                let why = estimate.reason.unwrap_or(Reason::Loose).in_words();
                notes.push(format!("{name}: not determined{why}"));
            }
            State::AtStart if estimate.std_error.is_none() => {}
            State::AtStart => {
                notes.push(format!("{name}: at its start: no measured row depends on it"));
            }
            State::AtBound => {
                notes.push(format!("{name}: at its bound: {}", treatment_of(estimate.id).at_bound))
            }
        }
    }
    notes.extend(confounded_groups(outcome));
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

/// Returns a note if the bristles never saturate, or never move.
fn bristle_note(predicted: &Predicted, tracks: &[Track]) -> Option<String> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    let presliding_rows = predicted.presliding * rows as f64;
    if predicted.saturation < 0.9 {
        return Some(format!(
            "the bristle never saturates: it reaches at most {:.0} % of the Coulomb level and acts as \
             a spring, so the data do not determine the levels",
            100.0 * predicted.saturation
        ));
    }
    (presliding_rows < MIN_PRESLIDING_ROWS).then(|| {
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
