//! A hypothesis of the contest, fitted with the driver's law.
//!
//! The contest is linear in its columns; a driver runs a law that is not. A fit of the law begins at the linear solution: the
//! law has the values of its columns, and one linear fit beside the law at this point gives all terms their values jointly
//! (`linear_fit`). Then all parameters are fitted. What the law leaves beyond the linear promise, the shortfall, is evidence
//! against the hypothesis.
//!
//! Finalists are compared on an excerpt of the log; only the best one is fitted to all rows.

mod linear_fit;

use super::candidate::{Candidate, FitContext};
use super::cause::{self, Cause};
use super::contest::{
    Detail, Finalist, FinalistCause, Gap, LawStart, SMALLEST_LEVEL, WaveKind, acts_through_bristles,
};
use super::left_out::one_step_left_out;
use super::model::{FittedModel, changed};
use super::sensitivities::{Sensitivities, sensitivities};
use super::train_test::{FollowedColumn, TrainTest};
use ParameterId as Id;
use compensator_core::term::MAX_TERMS;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{
    FitOptions, Predicted, Resolution, Scales, fit, free_parameters, typical_value,
};
use linear_fit::{Entrant, LinearFit};

/// Rows of an excerpt on which finalists are compared.
const MOST_ROWS: usize = 15_000;

/// Fewest rows of a track in an excerpt: some strokes.
const FEWEST_ROWS: usize = 700;

/// Simulations per parameter in the fit of a finalist.
const PATIENCE: usize = 3;

/// Progress at which such a fit ends, as a share of the squared error.
const STAGNATION: f64 = 2e-3;

/// Damping of the bristles at the start of a fit, as a share of the typical one. The columns of the contest know no damping.
const LITTLE_DAMPING: f64 = 0.01;

/// A cause with the term that takes it into the model.
#[derive(Clone, Debug)]
pub struct Realised {
    /// The cause.
    pub cause: &'static Cause,
    /// Columns of the log that it needs.
    pub columns: Vec<String>,
    /// What it follows, for a cause that may follow any column.
    pub follows: Option<FollowedColumn>,
}

/// A hypothesis fitted with the driver's law.
#[derive(Clone, Debug)]
pub struct FittedFinalist {
    /// The model.
    pub model: FittedModel,
    /// The causes that have a term in it.
    pub realised: Vec<Realised>,
    /// The model on held-out rows of the excerpt.
    pub held_out: Predicted,
}

/// Returns the law of the core that is nearest to a law of the contest.
pub fn law_kind(start: &LawStart, causes: &[FinalistCause]) -> LawKind {
    let needs_bristles = causes.iter().any(|cause| acts_through_bristles(cause.key.cause));
    let has_curve = start.static_excess > 0.0;
    match start.name {
        "linear" if !needs_bristles => LawKind::Linear,
        "stribeck" if !needs_bristles => LawKind::Stribeck,
        _ if has_curve => LawKind::Lugre,
        _ => LawKind::Dahl,
    }
}

/// Returns the parameters of a law with the values of its columns.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn law_parameters(
    spec: &Spec,
    start: &LawStart,
    causes: &[FinalistCause],
    log: &TrainTest,
) -> Result<Parameters<f64>, SpecError> {
    let scales = Scales::of(&log.train_tracks);
    let mut parameters = spec.parameters()?;
    let mut set = |id: Id, value: f64| {
        let info = id.info();
        parameters.set(id, value.clamp(info.lower, info.upper));
    };
    // A gap has a stop of its own behind it. A simulated backlash has none: its coefficient is no torque.
    let with_gap = causes.iter().find(|cause| gap(&cause.detail).is_some());
    let behind = with_gap.map_or(0.0, |cause| cause.sizes[0]);
    let travel =
        with_gap.and_then(|cause| gap(&cause.detail)).map_or(start.travel, |gap| gap.travel);
    let coulomb = (start.coulomb + behind).max(SMALLEST_LEVEL * scales.torque);
    let level = coulomb + start.static_excess;
    set(Id::CoulombTorque, coulomb);
    set(Id::CoulombTorqueNegative, coulomb);
    set(Id::StaticTorque, level);
    set(Id::StaticTorqueNegative, level);
    set(Id::StribeckVelocity, start.stribeck_velocity);
    set(Id::ViscousFriction, start.viscous);
    set(Id::BristleStiffness, level / travel.max(1e-12));
    set(Id::BristleDamping, LITTLE_DAMPING * typical_value(Id::BristleDamping, &scales));
    set(Id::TemperatureReference, scales.temperature_c);
    Ok(parameters)
}

/// Returns a model refitted at the resolution of the simulation that its rows need.
pub fn resolved(log: &TrainTest, model: &FittedModel) -> FittedModel {
    if !model.spec.law.has_bristles() {
        return model.clone();
    }
    let log = &*log.following(model.follows.as_ref());
    let options = FitOptions {
        fixed: model.fixed.clone(),
        patience: PATIENCE,
        stagnation: STAGNATION,
        ..FitOptions::for_comparison(Some(model.parameters.clone()))
    };
    let solution = fit(&model.spec, &model.parameters, log.train_rows(), &options);
    FittedModel {
        parameters: solution.parameters(),
        resolution: solution.resolution,
        ..model.clone()
    }
}

/// Returns the model fitted to the training rows from a start, in few steps.
pub fn fitted(
    log: &TrainTest,
    spec: &Spec,
    start: Option<&Parameters<f64>>,
    fixed: &[Id],
    follows: Option<&FollowedColumn>,
) -> Result<FittedModel, SpecError> {
    let log = &*log.following(follows);
    let options = FitOptions {
        fixed: fixed.to_vec(),
        resolution: Some(Resolution::PLAIN),
        patience: PATIENCE,
        stagnation: STAGNATION,
        ..FitOptions::for_comparison(start.cloned())
    };
    let base = match start {
        Some(start) => start.clone(),
        None => spec.parameters()?,
    };
    let solution = fit(spec, &base, log.train_rows(), &options);
    Ok(FittedModel {
        spec: spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: fixed.to_vec(),
        resolution: solution.resolution,
        follows: follows.cloned(),
    })
}

/// Returns the log with at most about `MOST_ROWS` training rows: the middle of each track.
///
/// Finalists are compared on rows of runs that are left out, so every run stays. The contest's own fit of the driver's law only
/// needs a point to linearise at, and takes the heads of some tracks.
pub fn excerpt(log: &TrainTest) -> TrainTest {
    let rows: usize = log.train_tracks.iter().map(|track| track.len()).sum();
    let mut excerpt = log.clone();
    if rows <= MOST_ROWS {
        return excerpt;
    }
    let share = MOST_ROWS as f64 / rows as f64;
    for track in &mut excerpt.train_tracks {
        let most = ((track.len() as f64 * share) as usize).max(FEWEST_ROWS).min(track.len());
        let from = (track.len() - most) / 2;
        *track = track.part(from..from + most);
    }
    excerpt
}

/// A point from which a fit begins.
#[derive(Clone)]
struct Start {
    spec: Spec,
    parameters: Parameters<f64>,
    fixed: Vec<Id>,
    follows: Option<FollowedColumn>,
    realised: Vec<Realised>,
}

/// The law that a hypothesis is fitted with.
pub struct LawFit<'a> {
    /// The base model, which a finalist without a cause cannot fall behind.
    pub base: &'a FittedModel,
    /// The law and the rigid-body parts.
    pub spec: &'a Spec,
    /// Delay of the hypothesis' correction, s, if the model has it as a cause.
    pub delay_s: Option<f64>,
}

/// Fits a hypothesis with a law, with those of its causes that are meant and have a term, and evaluates it on held-out rows.
///
/// All causes are fitted at once. If the law then keeps too little of the linear promise, they are added one by one, the most
/// material first, each from the fit with those before it.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn fit_finalist(
    log: &TrainTest,
    finalist: &Finalist,
    law: LawFit,
    is_meant: &dyn Fn(&FinalistCause) -> bool,
) -> Result<FittedFinalist, SpecError> {
    let base = law.base;
    let meant: Vec<usize> =
        (0..finalist.causes.len()).filter(|at| is_meant(&finalist.causes[*at])).collect();
    let first = law_start(log, finalist, &law)?;
    let at_once = fit_start(log, with_causes(log, finalist, &first, &meant)?)?;
    let error = |fitted: &FittedFinalist| fitted.held_out.metrics.rmse.powi(2);
    let before = one_step_left_out(log, log, base).metrics.rmse.powi(2);
    if meant.is_empty() || 1.0 - error(&at_once) / before >= KEPT * finalist.promised() {
        return Ok(at_once);
    }
    let mut from = fit_start(log, first)?;
    if base.spec == from.model.spec && before < error(&from) {
        let held_out = one_step_left_out(log, log, base);
        from = FittedFinalist { model: base.clone(), realised: Vec::new(), held_out };
    }
    let by_one = one_by_one(log, finalist, from, &meant)?;
    Ok(if error(&by_one) < error(&at_once) { by_one } else { at_once })
}

/// Share of the linear promise below which causes are added one by one.
const KEPT: f64 = 0.7;

/// Adds causes one by one and keeps those that reduce the held-out error.
fn one_by_one(
    log: &TrainTest,
    finalist: &Finalist,
    mut best: FittedFinalist,
    meant: &[usize],
) -> Result<FittedFinalist, SpecError> {
    let mut order = meant.to_vec();
    let torque = |at: &usize| finalist.causes[*at].torque_rms;
    order.sort_by(|a, b| torque(b).total_cmp(&torque(a)));
    for at in order {
        let model = &best.model;
        let from = Start {
            spec: model.spec.clone(),
            parameters: model.parameters.clone(),
            fixed: model.fixed.clone(),
            follows: model.follows.clone(),
            realised: best.realised.clone(),
        };
        let next = fit_start(log, with_causes(log, finalist, &from, &[at])?)?;
        if next.held_out.metrics.rmse < best.held_out.metrics.rmse {
            best = next;
        }
    }
    Ok(best)
}

fn fit_start(log: &TrainTest, start: Start) -> Result<FittedFinalist, SpecError> {
    let Start { spec, parameters, fixed, follows, realised } = start;
    let model = fitted(log, &spec, Some(&parameters), &fixed, follows.as_ref())?;
    let held_out = one_step_left_out(log, log, &model);
    Ok(FittedFinalist { model, realised, held_out })
}

/// Returns the law of a hypothesis with the delay of its correction.
fn law_start(log: &TrainTest, finalist: &Finalist, law: &LawFit) -> Result<Start, SpecError> {
    let mut spec = law.spec.clone();
    let mut realised = Vec::new();
    let delay = law.delay_s.zip(cause::of_term(TermKind::ChannelDelay));
    let delay = delay.filter(|_| !spec.rigid_body.contains(&TermKind::ChannelDelay));
    if let Some((_, cause)) = delay {
        let term = TermKind::ChannelDelay;
        spec.terms.push(term);
        let columns = vec![log.velocity_name().to_owned()];
        realised.push(Realised { cause, columns, follows: None });
    }
    let mut parameters = law_parameters(&spec, &finalist.law, &finalist.causes, log)?;
    if let Some((delay_s, _)) = delay {
        parameters.set(Id::ChannelDelay, delay_s);
    }
    Ok(Start { spec, parameters, fixed: Vec::new(), follows: None, realised })
}

/// Returns a start with some causes of a hypothesis, whose values one linear fit gives jointly with those of the model.
fn with_causes(
    log: &TrainTest,
    finalist: &Finalist,
    from: &Start,
    meant: &[usize],
) -> Result<Start, SpecError> {
    let log = &*log.following(from.follows.as_ref());
    let Start { spec, parameters, .. } = from;
    let options = FitOptions { fixed: from.fixed.clone(), ..FitOptions::default() };
    let free = free_parameters(spec, parameters, &log.train_tracks, &options);
    let at = sensitivities(parameters, &free, &log.train_tracks, Resolution::PLAIN);
    let entrants = entrants(log, finalist, spec, &at, meant);
    let linear = LinearFit::new(log, &at, &entrants);
    let chosen = linear.choose();
    let solution = linear.solve(&chosen);
    let chosen: Vec<(&'static Cause, &Candidate)> = chosen
        .iter()
        .map(|choice| {
            let entrant = &entrants[choice.entrant];
            (entrant.cause, &entrant.candidates[choice.candidate])
        })
        .collect();
    let mut next = from.clone();
    for (cause, candidate) in &chosen {
        let follows = candidate.follows.clone();
        next.spec.terms.push(candidate.term);
        next.follows = next.follows.or_else(|| follows.clone());
        next.fixed.extend(&candidate.fixed);
        next.realised.push(Realised { cause, columns: candidate.columns.clone(), follows });
    }
    next.parameters = next.spec.parameters()?;
    next.parameters.choices = parameters.choices;
    for id in parameters.active() {
        next.parameters.set(id, parameters.get(id));
    }
    for (id, change) in free.iter().zip(&solution.law) {
        next.parameters.set(*id, changed(*id, parameters.get(*id), *change));
    }
    for ((_, candidate), sizes) in chosen.iter().zip(&solution.candidates) {
        candidate.set(&mut next.parameters, sizes);
    }
    Ok(next)
}

/// Returns the candidates of some causes of a hypothesis, of each term at most one cause.
fn entrants(
    log: &TrainTest,
    finalist: &Finalist,
    spec: &Spec,
    at: &Sensitivities,
    meant: &[usize],
) -> Vec<Entrant> {
    let mut entrants: Vec<Entrant> = Vec::new();
    for found in meant.iter().map(|place| &finalist.causes[*place]) {
        let Some(cause) = cause::named(found.key.cause) else { continue };
        let Some(term) = cause.remedy().term() else { continue };
        let context = FitContext { log, spec, at, found: &found.detail };
        let is_used =
            context.has(term) || entrants.iter().any(|entrant| entrant.candidates[0].term == term);
        if is_used || spec.terms.len() + spec.rigid_body.len() + entrants.len() >= MAX_TERMS {
            continue;
        }
        let candidates = (cause.candidates)(&context).into_iter();
        let has_phase = has_common_phase(log, &found.detail);
        let candidates = candidates.filter(|candidate| has_phase && is_variant(candidate, found));
        let entrant = Entrant { cause, candidates: candidates.collect() };
        if !entrant.candidates.is_empty() {
            entrants.push(entrant);
        }
    }
    entrants
}

/// Returns true if a candidate is the variant that the contest has found.
fn is_variant(candidate: &Candidate, found: &FinalistCause) -> bool {
    let Some(follows) = &candidate.follows else { return true };
    let of_level = matches!(found.detail, Detail::Curve { of_level: true, .. });
    found.key.columns == [follows.column.as_str()] && follows.level == of_level
}

/// Returns false for waves with another phase in each run, unless the runs were shifted to a common one.
fn has_common_phase(log: &TrainTest, detail: &Detail) -> bool {
    let is_free = matches!(detail, Detail::Waves { kind: WaveKind::FreePhase, .. });
    !is_free || log.aligned_order.is_some()
}

/// Returns the gap of a backlash that was found as a shape.
fn gap(detail: &Detail) -> Option<Gap> {
    match detail {
        Detail::Gap(gap) => Some(*gap),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::CauseKey;
    use crate::fixtures::{HandMadeLog, bristle_torque};

    #[test]
    fn law_parameters_beside_simulated_backlash_keep_the_coulomb_torque() {
        let log = HandMadeLog::new(bristle_torque).train_test();
        let start = LawStart { name: "lugre", coulomb: 0.4, travel: 0.01, ..LawStart::default() };
        let coulomb = |detail: Detail| {
            let cause = FinalistCause {
                key: CauseKey { cause: "backlash", columns: Vec::new() },
                detail,
                sizes: vec![0.9],
                torque_rms: 0.1,
                torque_rms_error: 0.0,
            };
            let spec = Spec::law(LawKind::Lugre);
            law_parameters(&spec, &start, &[cause], &log).unwrap().get(Id::CoulombTorque)
        };
        assert_eq!(coulomb(Detail::Form("gap 1e-3 after the reversal".into())), 0.4);
        assert_eq!(coulomb(Detail::Gap(Gap { gap: 1e-3, travel: 0.01 })), 1.3);
    }
}
