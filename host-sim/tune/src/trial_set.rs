//! A parameter set on trial: the drive itself returns to its stored set if the host does not renew the trial in time.
//!
//! The set is committed as any other, but it is in RAM only. A fault, a lost connection, a reset and a passed deadline end the
//! trial on the drive, without the host.

use crate::master::{Master, MasterError, TRIAL_DEADLINE_MS};
use canopen_rs::Address;
use firmware::node::dictionary::records::TrialObject;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::parameters::{ParametersError, write_set};
use std::time::Duration;

pub use firmware::node::dictionary::index::TRIAL;
/// Order that returns to the stored set.
const RETURN: u8 = 2;
/// Order that keeps and stores what is active. If the flash fails, the trial stays open.
pub const KEEP_AND_SAVE: u8 = 3;

/// State of a trial that is open.
const OPEN: u32 = 1;
/// State after a set was kept.
const KEPT: u32 = 2;
/// State of a joint that still stops before the stored set returns.
const RETURNING: u32 = 7;
/// Time between two questions whether the stored set is back.
const RETURN_POLL: Duration = Duration::from_millis(20);
/// Longest time until the stored set is back, ns.
const RETURN_NS: u64 = 12_000_000_000;

/// Reason why a set is not on trial; one line.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The set or its drive was refused.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
    /// Error of the master.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// The drive has ended the trial.
    #[error("the drive has returned to its stored parameters: {0}")]
    Returned(&'static str),
    /// The order was executed, and its answer was lost.
    #[error("the drive has kept and saved the new parameters")]
    Kept,
}

impl From<SdoError> for TrialError {
    fn from(error: SdoError) -> Self {
        Self::Parameters(error.into())
    }
}

/// A set with the gain of the position loop that belongs to it.
#[derive(Clone, Debug)]
pub struct TunedSet {
    /// The parameters.
    pub set: ParameterSet,
    /// Gain of the position loop (60FBh:1), 1e-3 1/s.
    pub position_gain: u32,
}

/// Opens a trial, or renews it. The joint must be disarmed, and its active set the stored one.
///
/// # Errors
/// The drive refuses it, with its reason.
pub fn open<B: Bus>(master: &mut Master<B>) -> Result<(), TrialError> {
    let at = Address::new(TRIAL, TrialObject::DEADLINE);
    // Longer than a change of the set takes on a slow bus; the next renewal shortens it.
    master.client().write(at, &(5 * TRIAL_DEADLINE_MS).to_le_bytes())?;
    master.set_trial(true);
    Ok(())
}

/// Makes a set the active one while the trial is open. The joint must be disarmed.
///
/// # Errors
/// The drive refuses the set or has ended the trial.
pub fn apply<B: Bus>(master: &mut Master<B>, tuned: &TunedSet) -> Result<(), TrialError> {
    open(master)?;
    write(master, tuned)?;
    match master.client().read_number(Address::new(TRIAL, TrialObject::STATE))? {
        OPEN => Ok(()),
        state => Err(TrialError::Returned(reason(state))),
    }
}

/// Makes a set the active one, in RAM, without a trial. The joint must be disarmed.
///
/// # Errors
/// The drive refuses the set.
pub fn write<B: Bus>(master: &mut Master<B>, tuned: &TunedSet) -> Result<(), TrialError> {
    write_set(master.client(), &tuned.set)?;
    let gain = tuned.position_gain.to_le_bytes();
    Ok(master.client().write(Address::new(index::POSITION_LOOP, 1), &gain)?)
}

/// Ends the trial, and waits until the stored set is active again. Does nothing if no trial is open.
///
/// # Errors
/// The drive does not answer, or still has another set after some seconds.
pub fn give_back<B: Bus>(master: &mut Master<B>) -> Result<(), TrialError> {
    let state = Address::new(TRIAL, TrialObject::STATE);
    if master.client().read_number(state)? == OPEN {
        master.client().write(Address::new(TRIAL, TrialObject::ORDER), &[RETURN])?;
    }
    let until_ns = master.client().bus().now_ns() + RETURN_NS;
    loop {
        match master.client().read_number(state)? {
            OPEN | RETURNING if master.client().bus().now_ns() < until_ns => {
                master.client().bus().discard_within(RETURN_POLL).map_err(MasterError::from)?;
            }
            OPEN | RETURNING => return Err(TrialError::Returned("not yet: the joint still moves")),
            KEPT => return Err(TrialError::Kept),
            _ => break,
        }
    }
    master.set_trial(false);
    Ok(())
}

/// Returns why a trial has ended.
const fn reason(state: u32) -> &'static str {
    match state {
        0 => "no trial is open",
        KEPT => "it was kept",
        3 => "as requested",
        4 => "the host was late",
        5 => "a fault",
        6 => "the connection was lost",
        RETURNING => "the joint still stops",
        _ => "for a reason of another firmware",
    }
}

/// The record of a tuning, in the flash of the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Unix time, s.
    pub time_s: u32,
    /// Identity of the recorded runs: the first bytes of their hash.
    pub runs: u32,
    /// CRC of the former set.
    pub before_crc: u32,
    /// CRC of the tuned set.
    pub tuned_crc: u32,
    /// Gain of the tracking error, thousandths.
    pub gain_permille: i16,
    /// Number of the cause: 0 for none, otherwise that of its term plus one.
    pub cause: u8,
}

/// Ends the trial: writes the record, and keeps and stores it with the active set in one order. The joint must be disarmed. Until
/// the drive has stored everything, the trial stays open, so that a host that ends in between leaves the stored set.
///
/// # Errors
/// The drive cannot store it, has ended the trial, or does not answer.
pub fn keep_and_save<B: Bus>(master: &mut Master<B>, record: &Record) -> Result<(), TrialError> {
    let client = master.client();
    let words = [record.time_s, record.runs, record.before_crc, record.tuned_crc];
    for (place, word) in (1u8..).zip(words) {
        client.write(Address::new(index::TUNING, place), &word.to_le_bytes())?;
    }
    client.write(Address::new(index::TUNING, 5), &record.gain_permille.to_le_bytes())?;
    client.write(Address::new(index::TUNING, 6), &[record.cause])?;
    let order = Address::new(TRIAL, TrialObject::ORDER);
    let ordered = client.write(order, &[KEEP_AND_SAVE]);
    // The answer alone may be lost.
    let state = Address::new(TRIAL, TrialObject::STATE);
    if ordered.is_err() && !matches!(client.read_number(state), Ok(KEPT)) {
        return Ok(ordered?);
    }
    master.set_trial(false);
    Ok(())
}

/// Reads the record; `None` if the active set was not tuned.
///
/// # Errors
/// The joint does not answer.
pub fn record<B: Bus>(client: &mut Client<B>) -> Result<Option<Record>, SdoError> {
    let mut word = |place: u8| client.read_number(Address::new(index::TUNING, place));
    let record = Record {
        time_s: word(1)?,
        runs: word(2)?,
        before_crc: word(3)?,
        tuned_crc: word(4)?,
        gain_permille: word(5)? as u16 as i16,
        cause: word(6)? as u8,
    };
    Ok((record.tuned_crc != 0).then_some(record))
}

/// Reason why a tuning is not undone; one line.
#[derive(Debug, thiserror::Error)]
pub enum UndoError {
    /// The joint holds no former set.
    #[error("nothing to undo: its parameters are not those of a tuning")]
    NotTuned,
    /// The joint refuses, or does not answer.
    #[error(transparent)]
    Object(#[from] SdoError),
}

/// Brings the former set of the last tuning back, and stores it. The joint must be disarmed. Returns the record of the tuning.
///
/// # Errors
/// The joint does not hold the former set any more, with its reason, or does not answer.
pub fn undo<B: Bus>(client: &mut Client<B>) -> Result<Record, UndoError> {
    let record = record(client)?.ok_or(UndoError::NotTuned)?;
    client.write(Address::new(index::TUNING, 7), &[1])?;
    client.write(Address::new(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes())?;
    Ok(record)
}
