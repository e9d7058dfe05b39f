//! Which causes, one after the other.
//!
//! Each round asks all candidates at once ([`super::survey`]) and lets those that pass be fitted with
//! everything else by the core's own simulation; the one that explains most stays. Then the next round
//! looks at what is left. What only correlated with a cause that was not yet in falls when it is:
//! in the end every finding is taken out once and has to win its place again, against all others.
//!
//! A candidate passes if its blocks agree better than chance lets the best of all candidates agree
//! ([`super::panel`]), it lowers the error on rows left out of the fit, and by a share that matters.

use super::candidate::{Candidate, Follows, Seed, catalogue};
use super::judge::{noise_floor, paired};
use super::log::Log;
use super::panel::{Panel, Trial};
use super::survey::survey;
use super::tangent::{Tangent, tangent};
use crate::fit::outcome::predict;
use crate::fit::simulate::Resolution;
use crate::fit::statistics::autocorrelation_time;
use crate::fit::{FitOptions, fit};
use crate::spec::{Spec, SpecError};
use compensator_core::{ParameterId, Parameters, TermKind};

/// Probability under nothing hidden below which a candidate passes.
pub const SIGNIFICANT: f64 = 0.005;

/// The same for whole runs as observations, which a finding has to pass with all others in. There are
/// few runs, and one candidate left.
const SIGNIFICANT_BY_RUNS: f64 = 0.03;

/// Share of the squared residual a candidate must explain on rows left out of the fit.
pub const MATERIAL: f64 = 0.004;

/// Share of the base model's squared residual that a finding beside others must take alone.
const MATERIAL_BESIDE: f64 = 0.01;

/// What a curve of any shape must add to what named causes explain, as a share of it: the last bend of
/// their own effect is not another one.
const ANY_SHAPE: f64 = 0.2;

/// A curve that may have any shape has to explain this much more than a named cause.
const UNKNOWN_WEIGHT: f64 = 0.8;

/// A gain error of a covariate is as simple as a cause, but no cause of friction.
const GAIN_ERROR_WEIGHT: f64 = 0.9;

/// Most causes that are sought.
const MOST_FINDINGS: usize = 5;

/// Most candidates of a round that are fitted.
const MOST_FITTED: usize = 6;

/// Resampled logs the stability is counted over.
const RESAMPLES: usize = 60;

/// Share of the squared residual beyond the noise above which causes the panel may underrate are
/// fitted too: where a cause bends the base model's own parameters, its column at size 0 says little.
const STRUCTURE: f64 = 0.15;

/// Unless one that passed explains this share of what is beyond the noise.
const EXPLAINS: f64 = 0.5;

/// What such a fit must take off the squared residual, and by how many standard errors of blocks.
const SECOND_CHANCE: f64 = 0.05;
const CLEARLY: f64 = 3.0;

/// Simulations per parameter of a fit that only has to tell causes apart; what is reported is fitted to
/// the end.
const PATIENCE: usize = 3;

/// A fit goes on, so many times, while it gains less than this share of what the panel promised.
const MORE_FITS: usize = 4;
const PROMISED: f64 = 0.95;

/// How often the search goes on after the review has taken out what does not hold.
const SEARCHES: usize = 3;

/// A model on its way.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Law, terms, rigid body.
    pub spec: Spec,
    /// Values.
    pub parameters: Parameters<f64>,
    /// Parameters that were fitted.
    pub free: Vec<ParameterId>,
    /// Parameters that are kept.
    pub fixed: Vec<ParameterId>,
    /// How finely it was stepped.
    pub resolution: Resolution,
    /// Sum of squares on the training rows.
    pub sse: f64,
    /// What `unknown` follows, if it is among the terms.
    pub follows: Option<Follows>,
}

/// A cause that has been found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The term.
    pub kind: TermKind,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// What it follows, for `unknown`.
    pub follows: Option<Follows>,
    /// Parameters kept in its fit.
    pub fixed: Vec<ParameterId>,
    /// What the last review said.
    pub trial: Trial,
    /// Share of the residual it explains that nothing else does.
    pub share: f64,
    /// Other causes that would explain the same.
    pub confusable: Vec<(TermKind, Vec<String>, f64)>,
}

/// What a candidate got in a round, for the report.
#[derive(Clone, Debug)]
pub struct Hearing {
    /// The term.
    pub kind: TermKind,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// For `unknown`: as a share of the level.
    pub level: bool,
    /// The order, for a ripple.
    pub order: Option<f64>,
    /// What the panel says.
    pub trial: Trial,
    /// Gain as a share of the residual's squares.
    pub share: f64,
    /// Whether it passed.
    pub passed: bool,
}

/// The result of the search.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The base law fitted.
    pub base: Fitted,
    /// The extended model.
    pub extended: Fitted,
    /// The causes, strongest first.
    pub found: Vec<Found>,
    /// All candidates beside the base law, best first.
    pub hearing: Vec<Hearing>,
}

/// Fits a model from a start, at a resolution known to do.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn refit(
    log: &Log,
    spec: &Spec,
    start: &Parameters<f64>,
    fixed: &[ParameterId],
    resolution: Option<Resolution>,
) -> Fitted {
    let options = FitOptions {
        starts: 1,
        start: Some(start.clone()),
        fixed: fixed.to_vec(),
        resolution,
        patience: PATIENCE,
        ..FitOptions::default()
    };
    let solution = fit(spec, start, log.train_rows(), &options);
    Fitted {
        spec: spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: fixed.to_vec(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: None,
    }
}

/// A fitted model with all its candidates.
struct Round {
    candidates: Vec<Candidate>,
    panel: Panel,
    trials: Vec<Trial>,
    sse: f64,
}

fn weight(candidate: &Candidate) -> f64 {
    match &candidate.follows {
        None => 1.0,
        Some(follows) if follows.proportional => GAIN_ERROR_WEIGHT,
        Some(_) => UNKNOWN_WEIGHT,
    }
}

impl Round {
    fn new(log: &Log, model: &Fitted, seed: u64) -> (Tangent, Self) {
        let at = tangent(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let candidates = catalogue(log, &model.spec, &at);
        let panel = survey(log, &at, &candidates);
        let looks: Vec<f64> = candidates
            .iter()
            .map(|candidate| candidate.peak.map_or(1.0, |peak| peak.independent))
            .collect();
        let trials = panel.try_all(&looks, seed);
        let sse = panel.sse();
        (at, Self { candidates, panel, trials, sse })
    }

    fn passes(&self, trial: &Trial) -> bool {
        trial.p_value < SIGNIFICANT && trial.gain_unseen > MATERIAL * self.sse
    }

    /// Gain on unseen rows with the handicap of `unknown`.
    fn merit(&self, trial: &Trial) -> f64 {
        trial.gain_unseen * weight(&self.candidates[trial.candidate])
    }

    /// The best setting of each cause that enters crookedly and did not pass.
    fn second_chances(&self, heard: &[TermKind]) -> Vec<Trial> {
        let mut chances: Vec<Trial> = Vec::new();
        let mut order: Vec<&Trial> = self.trials.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for trial in order {
            let kind = self.candidates[trial.candidate].kind;
            let had = |t: &Trial| self.candidates[t.candidate].kind == kind;
            let is_crooked = is_crooked(kind) || kind == TermKind::PositionRipple;
            if is_crooked && !heard.contains(&kind) && !chances.iter().any(had) {
                chances.push(trial.clone());
            }
        }
        chances
    }

    /// Candidates that passed, the best first.
    fn passed(&self) -> Vec<&Trial> {
        let mut passed: Vec<&Trial> = self.trials.iter().filter(|t| self.passes(t)).collect();
        passed.sort_by(|a, b| self.merit(b).total_cmp(&self.merit(a)));
        passed
    }

    fn hearing(&self) -> Vec<Hearing> {
        let mut hearing: Vec<Hearing> = self
            .trials
            .iter()
            .map(|trial| {
                let candidate = &self.candidates[trial.candidate];
                Hearing {
                    kind: candidate.kind,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.peak.map(|peak| peak.order),
                    share: trial.gain_unseen / self.sse.max(f64::MIN_POSITIVE),
                    passed: self.passes(trial),
                    trial: trial.clone(),
                }
            })
            .collect();
        hearing.sort_by(|a, b| b.share.total_cmp(&a.share));
        hearing
    }
}

/// Whether a cause enters the model so crookedly that its column at size 0 may say too little.
fn is_crooked(kind: TermKind) -> bool {
    use TermKind as Kind;
    matches!(
        kind,
        Kind::Backlash
            | Kind::StribeckShape
            | Kind::ChannelDelay
            | Kind::DwellTimeStatic
            | Kind::TimeDrift
    )
}

/// Puts a candidate's term into a model and fits everything again.
fn with_candidate(
    log: &mut Log,
    model: &Fitted,
    candidate: &Candidate,
    trial: &Trial,
) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.push(candidate.kind);
    let mut start = spec.parameters()?;
    for id in model.parameters.active() {
        start.set(id, model.parameters.get(id));
    }
    start.choices = model.parameters.choices;
    for (id, seed) in &candidate.seeds {
        let value = match seed {
            Seed::At(value) => *value,
            Seed::Times(column, factor) => trial.coefficients[*column] * factor,
        };
        let info = id.info();
        start.set(*id, value.clamp(info.lower, info.upper));
    }
    let mut fixed = model.fixed.clone();
    fixed.extend(&candidate.fixed);
    if let Some(follows) = candidate.follows.as_ref().filter(|follows| follows.extra) {
        log.follow(Some(&follows.column));
    }
    let mut fitted = refit(log, &spec, &start, &fixed, Some(model.resolution));
    // A short fit may stop on its way: what the linear panel promised should at least be kept.
    for _ in 0..MORE_FITS {
        if model.sse - fitted.sse > PROMISED * trial.gain {
            break;
        }
        let before = fitted.sse;
        fitted = refit(log, &spec, &fitted.parameters, &fixed, Some(model.resolution));
        if fitted.sse > 0.999 * before {
            break;
        }
    }
    fitted.follows = candidate.follows.clone().or_else(|| model.follows.clone());
    Ok(fitted)
}

/// Searches for causes beside a base law.
///
/// # Errors
/// If the base already has as many terms as the core takes.
pub fn select(
    log: &mut Log,
    base: Fitted,
    seed: u64,
    progress: &dyn Fn(&str),
) -> Result<Selection, SpecError> {
    let mut model = base.clone();
    let mut found: Vec<Found> = Vec::new();
    let mut hearing = Vec::new();
    let mut refuted: Vec<Claim> = Vec::new();
    // Named causes have their say first; a curve of any shape may then have what is left, and shows in
    // the review which of them only stood in for it.
    for allow_unknown in [false, true] {
        for _ in 0..SEARCHES {
            let before = found.len();
            let heard = Heard { refuted: &refuted, allow_unknown, seed };
            extend(log, &base, &mut model, &mut found, &mut hearing, &heard, progress)?;
            if found.len() == before {
                break;
            }
            let lost = review(log, &base, &mut model, &mut found, seed, progress)?;
            if lost.is_empty() {
                break;
            }
            refuted.extend(lost);
        }
    }
    Ok(Selection { base, extended: model, found, hearing })
}

/// A cause and what it follows, whatever its settings.
type Claim = (TermKind, Option<(String, bool)>);

fn claim(kind: TermKind, follows: Option<&Follows>) -> Claim {
    (kind, follows.map(|follows| (follows.column.clone(), follows.level)))
}

/// Whom a round hears.
struct Heard<'a> {
    /// Not these: a review has taken them out.
    refuted: &'a [Claim],
    /// Curves of any shape.
    allow_unknown: bool,
    seed: u64,
}

impl Heard<'_> {
    fn is_heard(&self, candidate: &Candidate) -> bool {
        let any_shape = candidate.follows.as_ref().is_some_and(|follows| !follows.proportional);
        let refuted = self.refuted.contains(&claim(candidate.kind, candidate.follows.as_ref()));
        !refuted && (self.allow_unknown || !any_shape)
    }
}

/// Adds causes as long as there are any that pass.
fn extend(
    log: &mut Log,
    base: &Fitted,
    model: &mut Fitted,
    found: &mut Vec<Found>,
    hearing: &mut Vec<Hearing>,
    heard: &Heard,
    progress: &dyn Fn(&str),
) -> Result<(), SpecError> {
    while found.len() < MOST_FINDINGS {
        let turn = found.len();
        progress(&format!("weighing all causes (round {})", turn + 1));
        let (_, mut round) = Round::new(log, model, heard.seed + turn as u64);
        if hearing.is_empty() {
            *hearing = round.hearing();
        }
        let (trials, candidates) = (&mut round.trials, &round.candidates);
        trials.retain(|trial| heard.is_heard(&candidates[trial.candidate]));
        let least = if found.is_empty() { 0.0 } else { MATERIAL_BESIDE * base.sse };
        let Some((chosen, fitted)) = choose(log, model, &round, least, progress)? else { break };
        let candidate = &round.candidates[chosen.candidate];
        found.push(Found {
            kind: candidate.kind,
            columns: candidate.columns.clone(),
            follows: candidate.follows.clone(),
            fixed: candidate.fixed.clone(),
            trial: chosen,
            share: 0.0,
            confusable: Vec::new(),
        });
        *model = fitted;
    }
    Ok(())
}

/// Fits the candidates that passed and takes the one that explains most.
fn choose(
    log: &mut Log,
    model: &Fitted,
    round: &Round,
    least: f64,
    progress: &dyn Fn(&str),
) -> Result<Option<(Trial, Fitted)>, SpecError> {
    let passed = round.passed();
    let best = passed.first().map_or(0.0, |trial| round.merit(trial));
    let mut variants: Vec<TermKind> = Vec::new();
    let mut shortlist: Vec<Trial> = Vec::new();
    for trial in passed {
        let candidate = &round.candidates[trial.candidate];
        let enough = if is_crooked(candidate.kind) { 0.2 } else { 0.5 };
        let same = variants.iter().filter(|kind| **kind == candidate.kind).count();
        if round.merit(trial) >= enough * best && same < 2 && shortlist.len() < MOST_FITTED {
            variants.push(candidate.kind);
            shortlist.push(trial.clone());
        }
    }
    if shortlist.len() > 1 && round.merit(&shortlist[0]) > 50.0 * round.merit(&shortlist[1]) {
        shortlist.truncate(1);
    }
    if !model.spec.law.has_bristles() {
        prefer_friction(round, &mut shortlist);
    }
    let straight = shortlist.len();
    let noise = noise_floor(&log.train_tracks, log.decimate);
    let excess = model.sse - noise * noise * round.panel.rows as f64;
    if excess > STRUCTURE * model.sse && best < EXPLAINS * excess {
        shortlist.extend(round.second_chances(&variants));
    }
    let mut winner: Option<(f64, Trial, Fitted)> = None;
    let mut before = None;
    for (place, trial) in shortlist.into_iter().enumerate() {
        let candidate = &round.candidates[trial.candidate];
        progress(&format!("fitting {}+{}", model.spec, candidate.kind.name()));
        let fitted = with_candidate(log, model, candidate, &trial)?;
        // What the panel's left-out rows cost beside its fitted ones, the fit's own gain pays too.
        let optimism = (trial.gain - trial.gain_unseen).max(0.0);
        let merit = (model.sse - fitted.sse - optimism) * weight(candidate);
        if place >= straight {
            let model_now = before.get_or_insert_with(|| {
                predict(&model.parameters, log.train_rows(), model.resolution)
            });
            let then = predict(&fitted.parameters, log.train_rows(), fitted.resolution);
            let fall = model.sse - fitted.sse;
            if fall < SECOND_CHANCE * model.sse || paired(model_now, &then) < CLEARLY {
                continue;
            }
        }
        if winner.as_ref().is_none_or(|(best, ..)| merit > *best) {
            winner = Some((merit, trial, fitted));
        }
    }
    let Some((merit, trial, fitted)) = winner else { return Ok(None) };
    if merit < (MATERIAL * model.sse).max(least) {
        return Ok(None);
    }
    let follows = fitted.follows.as_ref().filter(|follows| follows.extra).map(|f| f.column.clone());
    log.follow(follows.as_deref());
    Ok(Some((trial, fitted)))
}

/// In pure sliding an offset of the sensor and a difference between the directions are one and the same.
/// Where this log cannot tell them apart, the one that is friction is named, and the other as not told
/// apart from it.
fn prefer_friction(round: &Round, shortlist: &mut Vec<Trial>) {
    let place = |shortlist: &[Trial], kind: TermKind| {
        shortlist.iter().position(|trial| round.candidates[trial.candidate].kind == kind)
    };
    let Some(offset) = place(shortlist, TermKind::TorqueOffset) else { return };
    let Some(asymmetry) = place(shortlist, TermKind::DirectionAsymmetry) else { return };
    let (share, better) =
        round.panel.confusion(shortlist[offset].candidate, shortlist[asymmetry].candidate);
    if share > 0.95 && (better < 3.0 || share > 0.995) {
        shortlist.remove(offset);
    }
}

/// The model without one of its terms, everything else fitted again.
fn without(log: &Log, model: &Fitted, kind: TermKind) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.retain(|term| *term != kind);
    let mut start = spec.parameters()?;
    for id in start.clone().active() {
        start.set(id, model.parameters.get(id));
    }
    start.choices = model.parameters.choices;
    let fixed: Vec<ParameterId> = model
        .fixed
        .iter()
        .copied()
        .filter(|id| start.active().any(|own| own == *id) || !kind.parameters().contains(id))
        .collect();
    let mut fitted = refit(log, &spec, &start, &fixed, Some(model.resolution));
    fitted.follows = model.follows.clone().filter(|_| kind != TermKind::Unknown);
    Ok(fitted)
}

fn is_any_shape(found: &Found) -> bool {
    found.follows.as_ref().is_some_and(|follows| !follows.proportional)
}

/// Takes every finding out once, the last one first, and hears all candidates in its place; returns what
/// did not hold.
fn review(
    log: &mut Log,
    base: &Fitted,
    model: &mut Fitted,
    found: &mut Vec<Found>,
    seed: u64,
    progress: &dyn Fn(&str),
) -> Result<Vec<Claim>, SpecError> {
    let mut lost_claims = Vec::new();
    let mut left = found.len();
    while left > 0 {
        let index = left - 1;
        let kind = found[index].kind;
        progress(&format!("hearing {} against all others", kind.name()));
        let rest = if found.len() == 1 { base.clone() } else { without(log, model, kind)? };
        let (_, mut round) = Round::new(log, &rest, seed + 100 + index as u64);
        let same = |candidate: &Candidate| {
            claim(candidate.kind, candidate.follows.as_ref())
                == claim(kind, found[index].follows.as_ref())
        };
        let own = round
            .trials
            .iter()
            .filter(|trial| same(&round.candidates[trial.candidate]))
            .max_by(|a, b| a.gain_unseen.total_cmp(&b.gain_unseen))
            .cloned();
        let unique = rest.sse - model.sse;
        let judged = |model: &Fitted, log: &Log| {
            predict(&model.parameters, log.test_rows(), model.resolution).metrics.sse
        };
        let helps = judged(model, log) < judged(&rest, log);
        let lost = own.as_ref().is_none_or(|trial| {
            let by_runs = round.panel.probability_by_runs(trial.candidate);
            !helps
                || by_runs > SIGNIFICANT_BY_RUNS
                || (found.len() > 1 && unique < MATERIAL_BESIDE * base.sse)
                || (is_any_shape(&found[index]) && unique < ANY_SHAPE * (base.sse - rest.sse))
                || (found.len() > 1 && !round.passes(trial) && unique < 4.0 * MATERIAL * rest.sse)
        });
        if lost {
            // It was in the place of another: gone, and the others are reviewed anew.
            let follows = rest.follows.as_ref().filter(|f| f.extra).map(|f| f.column.clone());
            *model = rest;
            let gone = found.remove(index);
            lost_claims.push(claim(gone.kind, gone.follows.as_ref()));
            log.follow(follows.as_deref());
            left = found.len();
            continue;
        }
        left -= 1;
        let Some(mut trial) = own else { continue };
        let candidates = &round.candidates;
        let wins = round.panel.stability(RESAMPLES, seed + 7, |c| weight(&candidates[c]));
        // Two settings of one cause's grid are the same cause.
        trial.stability = (0..candidates.len())
            .filter(|c| same(&candidates[*c]))
            .map(|c| wins[c])
            .sum::<f64>()
            .min(1.0);
        let confusable = confusions(&mut round, &trial, kind);
        found[index].share = (unique / base.sse.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        found[index].confusable = confusable;
        found[index].trial = trial;
    }
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    // A gain error of a column after the friction that follows the same column.
    let is_gain_error = |f: &Found| f.follows.as_ref().is_some_and(|follows| !follows.level);
    for index in 0..found.len() {
        let friction = (index + 1..found.len()).find(|other| {
            found[*other].columns == found[index].columns && !is_gain_error(&found[*other])
        });
        if let Some(other) = friction.filter(|_| is_gain_error(&found[index])) {
            let friction = found.remove(other);
            found.insert(index, friction);
        }
    }
    Ok(lost_claims)
}

/// Causes that would explain what a finding explains.
fn confusions(
    round: &mut Round,
    trial: &Trial,
    kind: TermKind,
) -> Vec<(TermKind, Vec<String>, f64)> {
    /// Nothing could tell two causes apart that share this much of their effect.
    const THE_SAME: f64 = 0.995;
    /// Nor, in practice, these, where the better one is not better by so many standard errors.
    const ALIKE: f64 = 0.8;
    const BETTER: f64 = 3.0;
    let mut named: Vec<(TermKind, Vec<String>, f64)> = Vec::new();
    for (other, candidate) in round.candidates.iter().enumerate() {
        let flexible = candidate.kind == TermKind::Unknown && kind != TermKind::Unknown;
        if candidate.kind == kind && candidate.kind != TermKind::Unknown || flexible {
            continue;
        }
        if other == trial.candidate
            || candidate.follows.is_some()
                && candidate.columns == round.candidates[trial.candidate].columns
        {
            continue;
        }
        let (share, better) = round.panel.confusion(trial.candidate, other);
        if share > THE_SAME || (share > ALIKE && better < BETTER) {
            match named.iter_mut().find(|(kind, ..)| *kind == candidate.kind) {
                Some(known) => known.2 = known.2.max(share),
                None => named.push((candidate.kind, candidate.columns.clone(), share)),
            }
        }
    }
    named.sort_by(|a, b| b.2.total_cmp(&a.2));
    named
}

/// Autocorrelation time of a model's residual on the training rows.
pub fn memory(log: &Log, model: &Fitted) -> f64 {
    let predicted = predict(&model.parameters, log.train_rows(), model.resolution);
    autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice))
}
