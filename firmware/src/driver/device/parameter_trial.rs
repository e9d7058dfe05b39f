//! The trial of a parameter set (2042h), and the record of the tuning (2043h).
//!
//! While a trial is open, active set, settings of the drive and record are those of the master. Only the order that ends
//! the trial saves them. The master renews the deadline. Without it, after a fault or if the connection is lost, the joint
//! stops and returns to what its flash holds. There is no other copy, so a trial begins only with the stored values in use,
//! and a reset ends it by itself.

use super::Device;
use crate::control::PERIOD_S;
use crate::driver::profile::stop::{StopCause, fault_cause};
use crate::joint_node::StoredBlock;
use crate::loop_parts::LoopParts;
use crate::node::dictionary::records::{TrialObject, TuningObject};
use crate::node::sdo::Abort;
use crate::node_settings::{SET_BEFORE, TuningRecord};
use crate::parameter_set::ParameterSet;
use crate::store::StoreHealth;
use crate::supervisor::ParameterSource;
use compensator_core::refusal;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Orders of 2042h:2.
const KEEP: u8 = 1;
const RETURN: u8 = 2;
const KEEP_AND_SAVE: u8 = 3;
/// Order of 2043h:7.
const UNDO: u8 = 1;

/// State of a trial, as 2042h:3 reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
enum TrialState {
    /// None since the start.
    #[default]
    None = 0,
    Open = 1,
    Kept = 2,
    /// Returned by request.
    Requested = 3,
    /// Returned because the deadline passed.
    Expired = 4,
    /// Returned after a fault.
    Fault = 5,
    /// Returned because the connection was lost or the network stopped.
    ConnectionLost = 6,
    /// The joint stops, then the stored values return.
    Returning = 7,
}

/// The trial of a parameter set.
#[derive(Debug, Default)]
pub(super) struct ParameterTrial {
    state: TrialState,
    /// State after the return.
    cause: TrialState,
    deadline_us: u64,
    /// CRC of the stored set.
    stored_crc: u32,
    /// Sequence number of the newest block before a save that failed.
    sequence: Option<u32>,
    has_failed_save: bool,
}

impl ParameterTrial {
    /// Returns true while what is in use may be that of a trial.
    pub(super) const fn is_open(&self) -> bool {
        matches!(self.state, TrialState::Open | TrialState::Returning)
    }

    fn end(&mut self, cause: TrialState) {
        if self.state == TrialState::Open {
            self.state = TrialState::Returning;
            self.cause = cause;
        }
    }

    /// Ends the trial because the network stops. The return follows when the bridge is not in use.
    pub(super) fn lose_connection(&mut self) {
        self.end(TrialState::ConnectionLost);
    }
}

impl<F: NorFlash> Device<F> {
    /// Returns the present values.
    pub(crate) fn trial_object(&self) -> TrialObject {
        let left_us = match self.trial.state {
            TrialState::Open => self.trial.deadline_us.saturating_sub(self.base.now_us),
            _ => 0,
        };
        TrialObject {
            deadline_ms: (left_us as u32).div_ceil(1000),
            order: 0,
            state: self.trial.state as u32,
            returning_crc: self.trial.stored_crc,
        }
    }

    pub(crate) fn write_trial(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        if place == TrialObject::DEADLINE {
            return self.open_trial(number as u16);
        }
        match (number as u8, self.trial.state) {
            (KEEP, TrialState::Open) => self.trial.state = TrialState::Kept,
            (KEEP_AND_SAVE, TrialState::Open) => return self.keep_and_save(),
            (RETURN, TrialState::Open) => self.end_trial(TrialState::Requested),
            (RETURN, TrialState::Returning) => {}
            (KEEP | RETURN | KEEP_AND_SAVE, _) => {
                let why = text!("no parameter set is on trial");
                return Err(self.base.refuse(Abort::State, why));
            }
            (order, _) => {
                let why = refusal!(
                    "order = {u32}: must be 1 (keep), 2 (return) or 3 (keep and save)",
                    order
                );
                return Err(self.base.refuse(Abort::Value, why));
            }
        }
        Ok(())
    }

    /// Stores what is on trial, and ends the trial. If the store refuses, the trial stays open: a host that is lost then
    /// leaves the stored values.
    fn keep_and_save(&mut self) -> Result<(), Abort> {
        if self.base.is_bridge_in_use() {
            return Err(self.base.refuse_armed());
        }
        if !self.trial.has_failed_save {
            self.trial.sequence = self.memory.store.newest_sequence();
        }
        let saved = self.save();
        self.trial.has_failed_save = saved.is_err();
        if saved.is_ok() {
            self.trial.state = TrialState::Kept;
        }
        saved
    }

    /// Opens the trial, or renews it.
    fn open_trial(&mut self, deadline_ms: u16) -> Result<(), Abort> {
        if !(100..=60_000).contains(&deadline_ms) {
            return Err(self.base.refuse_setting(text!("deadline_ms"), text!("100 to 60000")));
        }
        if self.trial.state != TrialState::Open {
            self.begin_trial()?;
        }
        self.trial.deadline_us = self.base.now_us.saturating_add(u64::from(deadline_ms) * 1000);
        Ok(())
    }

    fn begin_trial(&mut self) -> Result<(), Abort> {
        if self.base.is_bridge_in_use() {
            return Err(self.base.refuse_armed());
        }
        self.finish_trial();
        if let Some(why) = self.update_blocks_arming() {
            return Err(self.base.refuse(Abort::State, why));
        }
        let faults = self.base.supervisor.faults();
        if !faults.is_empty() {
            return Err(self.base.refuse_blocked(faults));
        }
        if !self.is_newest_in_use() {
            let why = text!(
                "parameters or drive settings are not those in the flash: save them first (1010h:1)"
            );
            return Err(self.base.refuse(Abort::State, why));
        }
        let stored_crc = self.base.staging.active_crc();
        self.trial =
            ParameterTrial { state: TrialState::Open, stored_crc, ..ParameterTrial::default() };
        Ok(())
    }

    /// Returns true if the active set and the settings of the drive are those that a start would load.
    #[inline(never)]
    fn is_newest_in_use(&mut self) -> bool {
        let mut set = ParameterSet::default();
        let stored = self.memory.recall(StoredBlock::Newest, &mut set);
        stored.is_some_and(|stored| {
            set.crc() == self.base.staging.active_crc() && stored.drive == self.base.settings.drive
        })
    }

    /// Refuses what would bring a trial into the flash, or interrupt it.
    #[inline(never)]
    pub(crate) fn refuse_in_trial(&mut self) -> Result<(), Abort> {
        if self.trial.is_open() {
            let why = text!("a parameter set is on trial: keep it or return first (2042h:2)");
            return Err(self.base.refuse(Abort::State, why));
        }
        Ok(())
    }

    /// Ends the trial by its deadline, a fault or a lost connection. Called once per tick.
    #[inline(never)]
    pub(super) fn watch_trial(&mut self, heartbeat_lost: bool) {
        let faults = self.base.supervisor.faults();
        let has_fault = !faults.is_empty();
        // A lost heartbeat is no fault of a joint that is not armed.
        let cause =
            if heartbeat_lost || has_fault && fault_cause(faults) == StopCause::ConnectionLost {
                TrialState::ConnectionLost
            } else if has_fault {
                TrialState::Fault
            } else if self.base.now_us >= self.trial.deadline_us {
                TrialState::Expired
            } else {
                return self.finish_trial();
            };
        self.end_trial(cause);
    }

    /// Stops the joint, as if its connection were lost, and returns to the stored values.
    fn end_trial(&mut self, cause: TrialState) {
        let is_open = self.trial.state == TrialState::Open;
        self.trial.end(cause);
        if is_open && self.base.is_bridge_in_use() {
            self.stop_connection();
        }
        self.finish_trial();
    }

    /// Returns to the stored values if a return is due and the bridge is not in use.
    pub(super) fn finish_trial(&mut self) {
        if self.trial.state != TrialState::Returning || self.base.is_bridge_in_use() {
            return;
        }
        self.trial.state = self.trial.cause;
        // A save that failed late has written the values on trial: the stored ones are in the former block.
        let is_newest_on_trial = self.trial.has_failed_save
            && self.memory.store.newest_sequence() != self.trial.sequence;
        let block = if is_newest_on_trial { StoredBlock::Former } else { StoredBlock::Newest };
        if self.adopt(block, self.trial.stored_crc) {
            if is_newest_on_trial {
                self.memory.is_undone = true;
            }
            if self.memory.store.health() == StoreHealth::Empty {
                self.base.supervisor.set_parameter_source(ParameterSource::Default);
            }
            return;
        }
        // The flash has lost the set since the trial began: the defaults, as at a start.
        let _ = self.base.staging.load(&[]);
        self.base.settings.drive = self.memory.defaults.drive;
        self.base.settings.tuning = TuningRecord::default();
        self.build_hil();
        let _ = self.base.supervisor.configure(&self.base.staging.active().thresholds);
        self.base.supervisor.set_parameter_source(ParameterSource::DefaultRefused);
        self.follow_set();
        let built = LoopParts::build(self.base.set(), self.base.identity.stage, PERIOD_S);
        self.base.start.set_refused(built.err());
    }

    /// Makes a stored set active, with the settings of the drive and the record of the tuning beside it, if it has this CRC.
    /// Otherwise nothing changes but the staged set. Returns true if it is active.
    #[inline(never)]
    fn adopt(&mut self, from: StoredBlock, crc: u32) -> bool {
        let before = self.base.settings;
        let is_adopted = match self.memory.recall(from, self.base.staging.staged_mut()) {
            Some(stored) => {
                let wiring = self.base.staging.staged().wiring_crc();
                (self.base.settings.drive, self.base.settings.tuning) =
                    (stored.drive, stored.tuning);
                // A confirmation of this wiring since the save stays.
                if before.commissioned != wiring {
                    self.base.settings.commissioned = stored.commissioned;
                }
                if before.proven != wiring {
                    self.base.settings.proven = stored.proven;
                }
                self.commit(crc).is_ok()
            }
            None => false,
        };
        self.base.supervisor.set_store_health(self.memory.store.health());
        if !is_adopted {
            self.base.settings = before;
            self.base.staging.discard();
        }
        is_adopted
    }

    /// Writes the record of the tuning, or undoes it.
    pub(crate) fn write_tuning(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        if place != TuningObject::UNDO {
            let word = self.base.settings.tuning.get_mut(usize::from(place).wrapping_sub(1));
            *word.ok_or(Abort::NoSubIndex)? = number;
            return Ok(());
        }
        if number as u8 != UNDO {
            return Err(self.base.refuse_setting(text!("undo"), text!("1")));
        }
        self.refuse_in_trial()?;
        if !self.adopt(StoredBlock::Former, self.base.settings.tuning[SET_BEFORE]) {
            let why = text!("the flash does not hold the set from before the tuning (2043h:3)");
            return Err(self.base.refuse(Abort::State, why));
        }
        self.base.settings.tuning = TuningRecord::default();
        self.memory.is_undone = true;
        Ok(())
    }
}
