//! A hypothesis of the contest, fitted with the driver's law.
//!
//! The contest is linear in its columns; a driver runs a law that is not. A fit of the law begins at the linear solution: the
//! law has the values of its columns, and one linear fit beside the law at this point gives all terms their values jointly
//! (`LinearFit`). Then all parameters are fitted. What the law leaves beyond the linear promise, the shortfall, is evidence
//! against the hypothesis.
//!
//! Finalists are compared on an excerpt of the log; only the best one is fitted to all rows.

use super::candidate::{Candidate, FitContext, FoundSettings};
use super::cause::{self, Cause};
use super::columns::columns;
use super::contest::{Detail, Finalist, FinalistCause, Gap, LawStart};
use super::left_out::one_step_left_out;
use super::model::FittedModel;
use super::sensitivities::{Sensitivities, sensitivities};
use super::train_test::{FollowedColumn, TrainTest};
use ParameterId as Id;
use compensator_core::term::MAX_TERMS;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{
    COMPARISON_TOLERANCE, FitOptions, Predicted, Resolution, Scales, fit, treatment_of,
    typical_value, unobserved_parameters,
};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

/// Rows of an excerpt on which finalists are compared.
const MOST_ROWS: usize = 15_000;

/// Fewest rows of a track in an excerpt: some strokes.
const FEWEST_ROWS: usize = 700;

/// Simulations per parameter in the fit of a finalist.
const PATIENCE: usize = 3;

/// Progress at which such a fit ends, as a share of the squared error.
const STAGNATION: f64 = 2e-3;

/// Share of the squared error that a candidate must remove for each coefficient that it has more than another one.
const MIN_GAIN_PER_COEFFICIENT: f64 = 0.01;

/// Largest ratio by which the linear fit changes a positive parameter of the law.
const MAX_CHANGE: f64 = 3.0;

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

/// Returns the law of the core that is nearest to a law of the contest. A gap, an age of the contact and a changing side load
/// act through bristles.
pub fn law_kind(start: &LawStart, causes: &[FinalistCause]) -> LawKind {
    let needs_bristles = causes
        .iter()
        .any(|own| ["backlash", "dwell-time-static", "radial-force-rate"].contains(&own.key.cause));
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
    // A backlash has a stop of its own, behind the gap.
    let gap = gap(causes);
    let behind: f64 =
        causes.iter().filter(|own| own.key.cause == "backlash").map(|own| own.sizes[0]).sum();
    let coulomb = (start.coulomb + behind).max(0.02 * scales.torque);
    let level = coulomb + start.static_excess;
    set(Id::CoulombTorque, coulomb);
    set(Id::CoulombTorqueNegative, coulomb);
    set(Id::StaticTorque, level);
    set(Id::StaticTorqueNegative, level);
    set(Id::StribeckVelocity, start.stribeck_velocity);
    set(Id::ViscousFriction, start.viscous);
    set(Id::BristleStiffness, level / gap.map_or(start.travel, |gap| gap.travel).max(1e-12));
    set(Id::BristleDamping, 0.01 * typical_value(Id::BristleDamping, &scales));
    set(Id::TemperatureReference, scales.temperature_c);
    Ok(parameters)
}

/// Returns the parameters that a fit varies.
pub fn free_parameters(spec: &Spec, parameters: &Parameters<f64>, log: &TrainTest) -> Vec<Id> {
    let unobserved = unobserved_parameters(spec, &log.train_tracks);
    parameters
        .active()
        .filter(|id| !treatment_of(*id).is_fixed_by_default && !unobserved.contains(id))
        .collect()
}

/// Returns a model refitted at the resolution of the simulation that its rows need.
pub fn resolved(log: &TrainTest, model: &FittedModel) -> FittedModel {
    if !model.spec.law.has_bristles() {
        return model.clone();
    }
    let log = &*log.following(model.follows.as_ref());
    let options = FitOptions {
        starts: 1,
        start: Some(model.parameters.clone()),
        fixed: model.fixed.clone(),
        patience: PATIENCE,
        has_weak_prior: true,
        tolerance: COMPARISON_TOLERANCE,
        stagnation: STAGNATION,
        ..FitOptions::default()
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
        starts: 1,
        start: start.cloned(),
        fixed: fixed.to_vec(),
        resolution: Some(Resolution::PLAIN),
        patience: PATIENCE,
        has_weak_prior: true,
        tolerance: COMPARISON_TOLERANCE,
        stagnation: STAGNATION,
        ..FitOptions::default()
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
    let error = |own: &FittedFinalist| own.held_out.metrics.rmse.powi(2);
    let before = one_step_left_out(log, log, base).metrics.rmse.powi(2);
    let promised = 1.0 - (finalist.rmse / finalist.law_rmse.max(f64::MIN_POSITIVE)).powi(2);
    if meant.is_empty() || 1.0 - error(&at_once) / before >= KEPT * promised {
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
    let torque = |at: &usize| finalist.causes[*at].torque_rms.0;
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
    let free: Vec<Id> = free_parameters(spec, parameters, log)
        .into_iter()
        .filter(|id| !from.fixed.contains(id))
        .collect();
    let at = sensitivities(parameters, &free, &log.train_tracks, Resolution::PLAIN);
    let ways = ways(log, finalist, (from, &at), meant);
    let linear = LinearFit::new(log, &at, &ways);
    let chosen = linear.choose(&ways);
    let places: Vec<_> = chosen.iter().map(|(way, own)| linear.columns_of(*way, *own)).collect();
    let solution = linear.solve(&places);
    let mut next = from.clone();
    for (way, own) in &chosen {
        let candidate = &ways[*way].candidates[*own];
        next.spec.terms.push(candidate.term);
        next.follows = next.follows.or_else(|| candidate.follows.clone());
        next.fixed.extend(&candidate.fixed);
        next.realised.push(Realised {
            cause: ways[*way].cause,
            columns: candidate.columns.clone(),
            follows: candidate.follows.clone(),
        });
    }
    next.parameters = next.spec.parameters()?;
    next.parameters.choices = parameters.choices;
    for id in parameters.active() {
        next.parameters.set(id, parameters.get(id));
    }
    for (id, change) in free.iter().zip(&solution.base) {
        next.parameters.set(*id, changed(*id, parameters.get(*id), *change));
    }
    for ((way, own), sizes) in chosen.iter().zip(&solution.candidates) {
        ways[*way].candidates[*own].set(&mut next.parameters, sizes);
    }
    Ok(next)
}

/// Returns the candidates of some causes of a hypothesis, of each term at most one cause.
fn ways(
    log: &TrainTest,
    finalist: &Finalist,
    (from, at): (&Start, &Sensitivities),
    meant: &[usize],
) -> Vec<Way> {
    let spec = &from.spec;
    let mut ways: Vec<Way> = Vec::new();
    for place in meant {
        let own = &finalist.causes[*place];
        let Some(cause) = cause::named(own.key.cause) else { continue };
        let Some(term) = cause.remedy().term() else { continue };
        let found = FoundSettings {
            orders: own.detail.orders().to_vec(),
            gap: gap(std::slice::from_ref(own)),
        };
        let context = FitContext { log, spec, at, found };
        let is_used = context.has(term) || ways.iter().any(|way| way.candidates[0].term == term);
        if is_used || spec.terms.len() + spec.rigid_body.len() + ways.len() >= MAX_TERMS {
            continue;
        }
        let candidates = cause.candidates(&context).into_iter();
        let candidates = candidates.filter(|candidate| is_variant(candidate, own));
        let way = Way { cause, candidates: candidates.collect() };
        if !way.candidates.is_empty() {
            ways.push(way);
        }
    }
    ways
}

/// Returns a parameter of the law after the change of the linear fit.
fn changed(id: Id, value: f64, change: f64) -> f64 {
    let info = id.info();
    let mut next = value + change;
    if value > 0.0 && info.lower >= 0.0 {
        next = next.clamp(value / MAX_CHANGE, value * MAX_CHANGE);
    }
    next.clamp(info.lower, info.upper)
}

/// Returns true if a candidate is the variant that the contest has found.
fn is_variant(candidate: &Candidate, own: &FinalistCause) -> bool {
    let Some(follows) = &candidate.follows else { return true };
    let of_level = matches!(own.detail, Detail::Curve { of_level: true, .. });
    own.key.columns == [follows.column.as_str()] && follows.level == of_level
}

/// Returns gap and travel of a backlash among the causes.
fn gap(causes: &[FinalistCause]) -> Option<Gap> {
    let backlash = causes.iter().find(|cause| cause.key.cause == "backlash")?;
    match backlash.detail {
        Detail::Gap(gap) => Some(gap),
        _ => None,
    }
}

/// A cause with the ways in which it may enter the model.
struct Way {
    cause: &'static Cause,
    candidates: Vec<Candidate>,
}

/// Products of the columns of a law and of candidates with the residual.
struct LinearFit {
    products: DMatrix<f64>,
    scale: Vec<f64>,
    base: usize,
    /// First column of each candidate of each way, and their number.
    places: Vec<Vec<(usize, usize)>>,
}

/// Solution of a linear fit.
struct LinearSolution {
    base: Vec<f64>,
    candidates: Vec<Vec<f64>>,
    sse: f64,
}

/// Ridge of the linear fit, relative to columns of unit length.
const RIDGE: f64 = 1e-6;

impl LinearFit {
    fn new(log: &TrainTest, at: &Sensitivities, ways: &[Way]) -> Self {
        let mut places = Vec::new();
        let mut first = at.free.len();
        let mut regressors = Vec::new();
        for way in ways {
            let mut own = Vec::new();
            for candidate in &way.candidates {
                own.push((first, candidate.regressors.len()));
                first += candidate.regressors.len();
                regressors.extend(candidate.regressors.iter().map(|by| (by, candidate.extra)));
            }
            places.push(own);
        }
        let tracks: Vec<_> = log.train_tracks.iter().zip(&at.tracks).collect();
        let product = |(track, own): &(&friction_fit::Track, &_)| {
            let columns = columns(log, at, (track, own), &regressors);
            let wide = DMatrix::from_fn(columns[0].len(), columns.len(), |row, column| {
                let value = columns[column][row];
                if value.is_finite() { value } else { 0.0 }
            });
            wide.transpose() * &wide
        };
        let parts: Vec<DMatrix<f64>> = tracks.par_iter().map(product).collect();
        let size = first + 1;
        let products = parts.into_iter().fold(DMatrix::zeros(size, size), |sum, part| sum + part);
        let scale = (0..size).map(|at| products[(at, at)].sqrt().max(f64::MIN_POSITIVE)).collect();
        Self { products, scale, base: at.free.len(), places }
    }

    fn columns_of(&self, way: usize, candidate: usize) -> std::ops::Range<usize> {
        let (first, count) = self.places[way][candidate];
        first..first + count
    }

    /// Solves for the law and some candidates.
    fn solve(&self, candidates: &[std::ops::Range<usize>]) -> LinearSolution {
        let all: Vec<usize> = (0..self.base).chain(candidates.iter().cloned().flatten()).collect();
        let last = self.products.nrows() - 1;
        let scaled = |a: usize, b: usize| self.products[(a, b)] / (self.scale[a] * self.scale[b]);
        let ridge = |i: usize, j: usize| if i == j { RIDGE } else { 0.0 };
        let system =
            DMatrix::from_fn(all.len(), all.len(), |i, j| scaled(all[i], all[j]) + ridge(i, j));
        let right = DVector::from_fn(all.len(), |i, _| scaled(all[i], last));
        let solution = Cholesky::new(system)
            .map_or_else(|| DVector::zeros(all.len()), |own| own.solve(&right));
        let square = self.products[(last, last)];
        let sse = square * (1.0 - solution.dot(&right));
        let mut sizes =
            all.iter().zip(solution.iter()).map(|(at, x)| x * self.scale[last] / self.scale[*at]);
        let base = sizes.by_ref().take(self.base).collect();
        let candidates =
            candidates.iter().map(|own| sizes.by_ref().take(own.len()).collect()).collect();
        LinearSolution { base, candidates, sse }
    }

    /// Chooses the candidate of each way, one way after the other.
    fn choose(&self, ways: &[Way]) -> Vec<(usize, usize)> {
        let mut chosen: Vec<(usize, usize)> = Vec::new();
        for (way, own) in ways.iter().enumerate() {
            let so_far: Vec<_> =
                chosen.iter().map(|(way, own)| self.columns_of(*way, *own)).collect();
            let cost = |candidate: &usize| {
                let columns = self.columns_of(way, *candidate);
                let count = columns.len() as f64;
                let all: Vec<_> = so_far.iter().cloned().chain([columns]).collect();
                self.solve(&all).sse * (MIN_GAIN_PER_COEFFICIENT * count).exp()
            };
            let costs = (0..own.candidates.len()).map(|candidate| (cost(&candidate), candidate));
            chosen.extend(costs.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, best)| (way, best)));
        }
        chosen
    }
}
