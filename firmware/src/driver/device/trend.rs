//! Trend of the learnt levels: when the driver adds an entry to its journal in the flash, and what the entry holds.
//!
//! An entry is due if the level has changed, or after [`PERIOD_S`] of learning. The second rule keeps the time: what a joint
//! learns between an entry and the end of its power is not counted. A rule that waits for a multiple of the time learnt
//! so far would stop the clock of a joint that learns for some hours a day.
//!
//! The levels themselves are the pending entry. They stay as they are when the joint is disarmed, and are written then:
//! programming keeps the background waiting for 0.2 ms, and thinning a full journal takes as long as a save. The gains
//! in use start at the set after a restart. The seal may have been replaced meanwhile, and learning takes a minute.

use super::Device;
use crate::node::sdo::Abort;
use crate::store::{LastEntry, TIME_UNIT_S, TrendEntry};
use compensator_core::Real;
use compensator_core::adaptation::{Adaptation, Gains};
use compensator_core::parameter::ParameterId;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Time of learning after which the gains have settled, and least time between two entries, s.
const SETTLED_S: f32 = 180.0;
/// Time of learning after which an entry is due, s.
const PERIOD_S: f32 = 900.0;
/// Change of the level since the last entry for which an entry is due, as a share of the level of the set.
const CHANGE: f32 = 0.05;

/// What is known of the stored trend, and what is learnt beyond it.
#[derive(Debug, Default)]
pub(super) struct StoredTrend {
    /// Newest entry.
    recorded: LastEntry,
    /// Time of learning since that entry, s.
    unrecorded_s: f32,
    /// Time of learning that the learner has reported, s.
    seen_s: f32,
}

impl StoredTrend {
    /// Continues a trend after its newest entry.
    pub(super) const fn after(recorded: LastEntry) -> Self {
        Self { recorded, unrecorded_s: 0.0, seen_s: 0.0 }
    }

    /// Counts the time of learning, which starts at 0 with each set.
    fn count(&mut self, learner: &Adaptation) {
        let learnt_s = learner.learnt_s();
        self.unrecorded_s += (learnt_s - self.seen_s).at_least(0.0);
        self.seen_s = learnt_s;
    }

    /// Returns the entry of the present levels if it is due. `set_level_nm` is the level of the set.
    fn due_entry(&self, learner: &Adaptation, set_level_nm: f32) -> Option<TrendEntry> {
        if learner.learnt_s().at_most(self.unrecorded_s) < SETTLED_S {
            return None;
        }
        let gains = learner.gains();
        let level_nm = gains.level * set_level_nm;
        let last = &self.recorded;
        let change_nm = Real::abs(level_nm - last.level_nm);
        let is_first = last.learnt == 0;
        if !is_first && self.unrecorded_s < PERIOD_S && change_nm < CHANGE * set_level_nm {
            return None;
        }
        let (term, term_gain) = changed_term(gains);
        Some(TrendEntry {
            learnt: last.learnt + rounded(self.unrecorded_s / TIME_UNIT_S),
            deviation_permille: (1000.0 * learner.deviations()[0]) as u8,
            level_nm,
            level_permille: rounded(1000.0 * gains.level) as u16,
            viscous_permille: rounded(1000.0 * gains.viscous) as u16,
            term,
            term_gain: rounded(500.0 * term_gain) as u16,
        })
    }
}

/// Returns place and gain of the term whose gain differs most from 1.
#[inline(never)]
fn changed_term(gains: &Gains<f32>) -> (u8, f32) {
    let mut changed = (0, gains.terms[0]);
    for (place, gain) in (0..).zip(gains.terms) {
        if Real::abs(gain - 1.0) > Real::abs(changed.1 - 1.0) {
            changed = (place, gain);
        }
    }
    changed
}

#[inline(never)]
fn rounded(value: f32) -> u32 {
    (value + 0.5) as u32
}

impl<F: NorFlash> Device<F> {
    /// Adds an entry to the stored trend if it is due and the bridge is not in use. Called once per tick.
    #[inline(never)]
    pub(super) fn record_trend(&mut self) {
        let Some(learner) = self.adaptation.learner() else { return };
        self.trend.count(learner);
        // A joint in HIL repeats the torques of another one.
        if self.base.is_bridge_in_use() || self.base.settings.is_in_hil() {
            return;
        }
        let set_level_nm = self.base.set().friction.model.get(ParameterId::CoulombTorque);
        let Some(entry) = self.trend.due_entry(learner, set_level_nm) else { return };
        let may_erase = !self.memory.is_undone;
        // Without a stored set or with a worn flash, the next attempt follows after more learning.
        let _ = self.memory.store.append_trend(&entry, may_erase);
        self.base.supervisor.set_store_health(self.memory.store.health());
        self.trend.unrecorded_s = 0.0;
        self.trend.recorded = LastEntry { learnt: entry.learnt, level_nm: entry.level_nm };
    }

    /// Returns the length of the stored trend, bytes.
    pub(crate) fn trend_length(&mut self) -> Result<usize, Abort> {
        match self.memory.store.trend_length() {
            0 => {
                Err(self.base.refuse(Abort::Refused, text!("no trend of learnt levels is stored")))
            }
            length => Ok(length),
        }
    }

    /// Reads a part of the stored trend.
    pub(crate) fn read_trend(&mut self, offset: usize, part: &mut [u8]) {
        self.memory.store.read_trend(offset, part);
    }
}
