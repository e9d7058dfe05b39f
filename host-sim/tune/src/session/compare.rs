//! The trial: rounds of blocks with the former set (A), the new one (B), and the former friction model with the new loop gains (C).

use super::SessionError;
use super::candidates::{gains_of, with_gains};
use super::work::{PAUSE_S, TRIAL_BLOCKS, Work, course};
use crate::gain::order;
use crate::proof::{self, Verdict};
use crate::score::Scored;
use crate::trial_set::TunedSet;
use friction_results::tune::TuneArm;
use joint_bus::bus::Bus;

/// Fewest rounds of a trial with three sets and with two. Two sets need an even number, or a steady drift of the joint would
/// favour one of them.
const LEAST_OF_THREE: usize = 3;
const LEAST_OF_TWO: usize = 4;

/// Returns the sets to compare, in the order of a first round. A part that the new set leaves as it was is not compared.
fn arms(former: &TunedSet, new: &TunedSet) -> Vec<(TuneArm, TunedSet)> {
    let new_loop = with_gains(former, &gains_of(new));
    let is_same = |one: &TunedSet, other: &TunedSet| {
        one.set.crc() == other.set.crc() && one.position_gain == other.position_gain
    };
    let mut arms = vec![(TuneArm::Former, former.clone())];
    if !is_same(&new_loop, former) {
        arms.push((TuneArm::NewLoop, new_loop.clone()));
    }
    if !is_same(&new_loop, new) {
        arms.push((TuneArm::New, new.clone()));
    }
    arms
}

impl<B: Bus> Work<'_, B> {
    /// Runs the session up to its verdict.
    pub(super) fn run(&mut self) -> Result<Verdict, SessionError> {
        match self.search()? {
            Some(chosen) => self.compare(chosen),
            None => {
                let why = "no new set was better than the present one in its first block";
                Ok(Verdict::returned(why))
            }
        }
    }

    /// Compares a new set with the former one, and with its loop gains alone.
    fn compare(&mut self, chosen: TunedSet) -> Result<Verdict, SessionError> {
        let arms = arms(&self.former(), &chosen);
        let left_s = self.options.seconds - self.elapsed_s();
        let round_s = arms.len() as f64 * (self.motion.seconds() + PAUSE_S);
        let possible = (left_s / round_s) as usize;
        let most = TRIAL_BLOCKS / arms.len();
        let rounds = match arms.len() {
            3.. => possible.clamp(LEAST_OF_THREE, most),
            _ => (possible - possible % 2).clamp(LEAST_OF_TWO, most),
        };
        self.user.progress(&format!(
            "trial: {} blocks with {} sets",
            arms.len() * rounds,
            arms.len()
        ));
        let places: Vec<usize> = (0..arms.len()).collect();
        let mut last = None;
        for round in order(&places, rounds) {
            self.trial.push(Vec::new());
            for place in round {
                let (arm, tuned) = &arms[place];
                let scored = self.trial_block(*arm, (last != Some(place)).then_some(tuned))?;
                last = Some(place);
                let former = self.trial[0].first().map(|(_, scored)| *scored);
                if *arm != TuneArm::Former
                    && let Some(why) = proof::oscillates(&former.unwrap_or(scored), &scored)
                {
                    self.tried = Some(chosen);
                    return Ok(Verdict::returned(&why));
                }
            }
        }
        let verdict = proof::verdict(&self.trial, &self.means());
        let kept = arms.into_iter().find(|(arm, _)| verdict.proven == Some(*arm));
        self.tried = Some(kept.map_or(chosen, |(_, tuned)| tuned));
        Ok(verdict)
    }

    /// Performs a block of the trial with a set, or with the active one.
    fn trial_block(
        &mut self,
        arm: TuneArm,
        tuned: Option<&TunedSet>,
    ) -> Result<Scored, SessionError> {
        let (recording, scored) = match tuned {
            Some(tuned) => self.block(tuned, "trial")?,
            None => self.scored_block("trial")?,
        };
        if let Some(round) = self.trial.last_mut() {
            round.push((arm, scored));
        }
        self.courses[arm as usize] = course(&recording, self.nm_per_a());
        Ok(scored)
    }
}
