//! What a fit means, in words.

use super::outcome::{Estimate, Outcome, State};
use super::predict::Predicted;
use super::track::Track;
use super::treatment;
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId};

/// Correlations beyond this are told: the data know a combination, not the two.
const TIED: f64 = 0.98;

/// Sentences a person should read before using the numbers.
pub(super) fn verdicts(
    outcome: &Outcome,
    unseen: &[ParameterId],
    predicted: &Predicted,
    tracks: &[Track],
) -> Vec<String> {
    let mut said = Vec::new();
    if !outcome.converged {
        said.push("the fit stopped at its limit before it converged".to_owned());
    }
    if outcome.parameters.law.has_bristles() {
        said.extend(bristles(predicted, tracks));
    }
    for estimate in &outcome.estimates {
        let name = estimate.id.name();
        match estimate.state {
            State::Determined => {}
            State::NotDetermined if unseen.contains(&estimate.id) => {
                said.push(format!(
                    "{name}: not determined: its column is absent or zero throughout"
                ));
            }
            State::NotDetermined if estimate.std_error.is_none() => {
                said.push(format!(
                    "{name}: not determined: on these rows it does nothing that other parameters do not"
                ));
            }
            State::NotDetermined if is_positive(estimate.id) || told_from_nothing(estimate) => {
                said.push(format!("{name}: not determined by this data"));
            }
            State::NotDetermined => {
                said.push(format!("{name}: not determined by this data: not told from 0"));
            }
            State::AtStart if estimate.std_error.is_none() => {}
            State::AtStart => {
                said.push(format!("{name}: at its start: nothing measured depends on it"));
            }
            State::AtBound => {
                said.push(format!("{name}: at its bound: {}", treatment::of(estimate.id).at_bound))
            }
        }
    }
    said.extend(tied(outcome));
    if outcome.parameters.get(Id::ViscousFriction) < 0.0 && outcome.spec.law != LawKind::Extended {
        said.push(
            "viscous_friction is negative: over this range of speeds friction falls, as on a \
             Stribeck curve"
                .to_owned(),
        );
    }
    if outcome.autocorrelation_time > 3.0 {
        said.push(format!(
            "the residual is not noise: about {:.0} neighbouring rows count as one observation, and \
             the standard errors are {:.1} times those of white noise",
            outcome.autocorrelation_time,
            outcome.autocorrelation_time.sqrt()
        ));
    }
    said
}

/// Whether it cannot be 0.
fn is_positive(id: ParameterId) -> bool {
    id.info().lower > 0.0
}

/// Whether a value is two standard errors away from 0.
fn told_from_nothing(estimate: &Estimate) -> bool {
    estimate.std_error.is_none_or(|error| estimate.value.abs() >= 2.0 * error)
}

fn bristles(predicted: &Predicted, tracks: &[Track]) -> Option<String> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    let sliding_rows = predicted.presliding * rows as f64;
    if predicted.saturation < 0.9 {
        return Some(format!(
            "the bristle never saturates: it reaches {:.0} % of the Coulomb level at most and acts as \
             a spring, so the levels mean nothing",
            100.0 * predicted.saturation
        ));
    }
    (sliding_rows < 10.0).then(|| {
        "the bristle is always fully slipping: steady sliding tells nothing of its stiffness and \
         damping"
            .to_owned()
    })
}

fn tied(outcome: &Outcome) -> Vec<String> {
    let fitted: Vec<_> = outcome.estimates.iter().filter(|e| e.std_error.is_some()).collect();
    // Who is tied to whom, as groups: of seven pairs a reader learns less than of one group.
    let mut groups: Vec<(Vec<usize>, f64)> = Vec::new();
    for (i, first) in fitted.iter().enumerate() {
        for (j, second) in fitted.iter().enumerate().skip(i + 1) {
            let correlation = outcome.correlation[(i, j)];
            let both = [first.state, second.state].contains(&State::AtStart);
            if correlation.abs() <= TIED || both {
                continue;
            }
            let (mut group, mut least) = (vec![i, j], correlation.abs());
            // Groups that share a member are one.
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
    let said = groups.iter().map(|(group, least)| {
        let names: Vec<&str> = group.iter().map(|at| fitted[*at].id.name()).collect();
        let (last, others) = names.split_last().unwrap_or((&"", &[]));
        format!(
            "{} and {last} are known only together (correlation {least:.3}{}): some combination of them is determined, \
             each by itself is not",
            others.join(", "),
            if group.len() > 2 { " or more" } else { "" }
        )
    });
    said.collect()
}
