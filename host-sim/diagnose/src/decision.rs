//! Which causes are proposed: search, choice of the base law and evaluation, until the evaluation withdraws nothing.
//!
//! The search ([`super::select`]) finds causes on the thinned rows. If a richer base law explains the log as well, the search
//! starts again with it. The evaluation ([`super::proposal`]) then fits base and extension anew on held-out runs. A cause
//! that it withdraws may have stood in the way of another, so the search starts again without it.

use super::DiagnosisOptions;
use super::accepted_cause::AcceptedCause;
use super::baseline::reselect_base_law;
use super::calibration::Calibration;
use super::corrected_log::CorrectedLog;
use super::model::{FitCache, FittedModel};
use super::proposal::{self, Proposal};
use super::round::CandidateScore;
use super::rules::RuleDecision;
use super::search::{Extension, Search};
use super::select::{remember, select};
use friction_fit::predict;
use friction_fit::spec::SpecError;

/// Maximum number of causes withdrawn from proposals before the search ends.
const MAX_WITHDRAWN_CAUSES: usize = 4;

/// The proposed extension, and how it was chosen.
#[derive(Clone, Debug)]
pub struct Decision {
    /// The base model.
    pub base: FittedModel,
    /// The extension and its evaluation.
    pub proposal: Proposal,
    /// Every candidate beside the base law, best first.
    pub scores: Vec<CandidateScore>,
    /// Accepted causes as the calibration last weighed them, with those below its threshold.
    pub weighed: Vec<AcceptedCause>,
    /// Causes that a rule rejected after their fit.
    pub decisions: Vec<RuleDecision>,
    /// Notes on the evaluation, one sentence each.
    pub notes: Vec<String>,
}

/// Decides which causes are proposed for a log.
///
/// # Errors
/// Returns an error if a model has more terms than the core accepts.
pub fn decide(
    log: &CorrectedLog,
    options: &DiagnosisOptions,
    progress: &dyn Fn(&str),
) -> Result<Decision, SpecError> {
    let fits = FitCache::new(&log.searched);
    let given = options.given.as_ref();
    let given = given.map(|(_, own)| predict(own, log.whole.test_rows(), log.base.resolution));
    let is_chosen = options.model.is_none() && options.given.is_none();
    let naming_threshold = Calibration::current().naming_threshold;
    let mut base = log.base.clone();
    let (mut scores, mut weighed) = (Vec::new(), Vec::new());
    let (mut refuted, mut decisions, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        let search = Search {
            log: &log.searched,
            fits: &fits,
            base: &base,
            naming_threshold,
            only_weighs: options.only_weighs,
            seed: options.seed,
            progress,
        };
        let selection = select(&search, &refuted)?;
        if is_chosen
            && let Some(richer) = reselect_base_law(&log.searched, &base, &selection.extended)?
        {
            progress("restarting with a richer law");
            base = richer;
            refuted.clear();
            weighed.clear();
            decisions.clear();
            continue;
        }
        progress("evaluating on held-out rows");
        let extension = match options.only_weighs {
            true => Extension { model: base.clone(), found: Vec::new() },
            false => Extension { model: selection.extended, found: selection.found },
        };
        let proposal = proposal::propose(&search, &log.whole, extension, given.clone())?;
        if scores.is_empty() {
            scores = selection.scores;
        }
        remember(&mut weighed, selection.weighed);
        for decision in selection.decisions.into_iter().chain(proposal.decisions.clone()) {
            // A search that starts again repeats its rejections.
            if !decisions.contains(&decision) {
                decisions.push(decision);
            }
        }
        notes.extend(proposal.notes.clone());
        refuted.extend(proposal.taken_back.iter().cloned());
        if proposal.taken_back.is_empty() || refuted.len() > MAX_WITHDRAWN_CAUSES {
            return Ok(Decision { base, proposal, scores, weighed, decisions, notes });
        }
    }
}
