//! Captures of a joint's scope over the bus: set up, wait for the trigger, read the rows in blocks.
//!
//! The joint records its current loop at 20 kHz into its memory, because the bus is too slow for that; see
//! `firmware::scope`. A capture is therefore a fraction of a second long. Rows that the joint could not store make it
//! fail, and it is repeated once.

use crate::bus::Bus;
use crate::canopen::{Client, SdoError};
use canopen_rs::Address;
use firmware::control::PERIOD_S;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::ScopeObject;
use firmware::scope::{MAX_SIGNALS, ScopeState, Signal, TRIGGER_FAULT};
use std::time::Duration;

/// States of a capture on the bus.
const FILLING: u32 = ScopeState::Filling as u32;
const WAITING: u32 = ScopeState::Waiting as u32;
const COMPLETE: u32 = ScopeState::Complete as u32;
const FAILED: u32 = ScopeState::Failed as u32;

/// Time between two looks at the state.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// What triggers a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScopeTrigger {
    /// The start.
    Now,
    /// A fault of the supervisor.
    Fault,
    /// A signal crosses a level, in its unit.
    Level {
        /// The signal, one of the recorded ones.
        signal: Signal,
        /// Level.
        level: f32,
        /// True for a signal that falls.
        is_falling: bool,
    },
}

/// A capture to make.
#[derive(Clone, Debug, PartialEq)]
pub struct ScopeRequest {
    /// Signals, 1 to 8.
    pub signals: Vec<Signal>,
    /// Periods of the current loop from one row to the next.
    pub every: u16,
    /// What triggers it.
    pub trigger: ScopeTrigger,
    /// Share of the rows before the trigger, from 0 to below 1.
    pub before: f64,
    /// Time to wait for the trigger.
    pub timeout: Duration,
}

impl ScopeRequest {
    /// Returns the time from one row to the next, s.
    pub fn period_s(&self) -> f64 {
        f64::from(PERIOD_S) * f64::from(self.every)
    }
}

/// The rows of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Values of each signal, in the order of the request.
    pub columns: Vec<Vec<f64>>,
    /// Row of the trigger.
    pub trigger_row: usize,
}

/// Reason why there is no capture.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// An object was not read or written.
    #[error(transparent)]
    Object(#[from] SdoError),
    /// The trigger did not occur.
    #[error("no trigger within {0:.1} s; check --trigger, or wait longer by --timeout")]
    NoTrigger(f64),
    /// No rows came.
    #[error("the joint records nothing: it has no current loop, as in HIL (2001h:1 = 1)")]
    NoRows,
    /// The joint has no memory for a capture.
    #[error("the joint has no memory for captures, as `host-sim node` without --motor")]
    NoMemory,
    /// Rows were lost twice.
    #[error("the joint lost rows of the capture; record fewer signals, or less often")]
    Lost,
    /// The joint does not record any more.
    #[error("the joint has ended the capture: a reset, or another tool")]
    Ended,
    /// The rows do not fit together.
    #[error(
        "the joint sent {bytes} bytes with the trigger in row {trigger_row}, expected rows of {row_bytes}"
    )]
    #[expect(missing_docs, reason = "the message names the fields")]
    Rows { bytes: usize, trigger_row: usize, row_bytes: usize },
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

const fn at(sub_index: u8) -> Address {
    Address::new(index::SCOPE, sub_index)
}

/// Makes a capture. `is_stopped` is asked while it waits.
///
/// # Errors
/// See [`ScopeError`].
pub fn capture<B: Bus>(
    client: &mut Client<B>,
    request: &ScopeRequest,
    mut is_stopped: impl FnMut() -> bool,
) -> Result<Capture, ScopeError> {
    set_up(client, request)?;
    for _ in 0..2 {
        client.write(at(ScopeObject::ORDER), &[1])?;
        let outcome = wait(client, request, &mut is_stopped);
        if !matches!(outcome, Ok(ScopeState::Complete)) {
            client.write(at(ScopeObject::ORDER), &[0])?;
        }
        if outcome? == ScopeState::Complete {
            return read(client, request.signals.len());
        }
    }
    Err(ScopeError::Lost)
}

fn set_up<B: Bus>(client: &mut Client<B>, request: &ScopeRequest) -> Result<(), ScopeError> {
    for place in 0..MAX_SIGNALS {
        let number = request.signals.get(place).map_or(0, |signal| signal.number());
        client.write(Address::new(index::SCOPE_SIGNALS, place as u8 + 1), &[number])?;
    }
    client.write(at(ScopeObject::EVERY), &request.every.to_le_bytes())?;
    let values = client.read_number(at(ScopeObject::MEMORY_VALUES))?;
    if values == 0 {
        return Err(ScopeError::NoMemory);
    }
    let rows = f64::from(values) / request.signals.len().max(1) as f64;
    let before = (request.before * rows) as u16;
    client.write(at(ScopeObject::ROWS_BEFORE), &before.to_le_bytes())?;
    let (signal, level, is_falling) = match request.trigger {
        ScopeTrigger::Now => (0, 0.0, false),
        ScopeTrigger::Fault => (TRIGGER_FAULT, 0.0, false),
        ScopeTrigger::Level { signal, level, is_falling } => (signal.number(), level, is_falling),
    };
    client.write(at(ScopeObject::TRIGGER_SIGNAL), &[signal])?;
    client.write(at(ScopeObject::TRIGGER_LEVEL), &level.to_le_bytes())?;
    client.write(at(ScopeObject::IS_FALLING), &[u8::from(is_falling)])?;
    Ok(())
}

/// Waits until the capture is complete or has failed.
fn wait<B: Bus>(
    client: &mut Client<B>,
    request: &ScopeRequest,
    is_stopped: &mut impl FnMut() -> bool,
) -> Result<ScopeState, ScopeError> {
    let begin_ns = client.bus().now_ns();
    // The whole memory at this rate, and some time for the joint to begin.
    let values = client.read_number(at(ScopeObject::MEMORY_VALUES))?;
    let longest_s = f64::from(values) * request.period_s() + 0.5;
    let timeout_s = request.timeout.as_secs_f64();
    loop {
        client.bus().discard_within(POLL_PERIOD).map_err(SdoError::from)?;
        let elapsed_s = (client.bus().now_ns() - begin_ns) as f64 * 1e-9;
        match client.read_number(at(ScopeObject::STATE))? {
            COMPLETE => return Ok(ScopeState::Complete),
            FAILED => return Ok(ScopeState::Failed),
            FILLING if elapsed_s > longest_s => return Err(ScopeError::NoRows),
            WAITING if elapsed_s > longest_s + timeout_s => {
                return Err(ScopeError::NoTrigger(timeout_s));
            }
            // The rows after the trigger follow, unless the joint was reset.
            _ if elapsed_s > 2.0 * longest_s + timeout_s => return Err(ScopeError::Ended),
            _ => {}
        }
        if is_stopped() {
            return Err(ScopeError::Stopped);
        }
    }
}

fn read<B: Bus>(client: &mut Client<B>, signals: usize) -> Result<Capture, ScopeError> {
    let trigger_row = client.read_number(at(ScopeObject::TRIGGER_ROW))? as usize;
    let bytes = client.read_blocks(at(ScopeObject::DATA), |_| ())?;
    columns(&bytes, signals, trigger_row)
}

/// Returns the columns of rows of this number of signals.
fn columns(bytes: &[u8], signals: usize, trigger_row: usize) -> Result<Capture, ScopeError> {
    let row_bytes = 4 * signals;
    if !bytes.len().is_multiple_of(row_bytes) || trigger_row * row_bytes >= bytes.len() {
        return Err(ScopeError::Rows { bytes: bytes.len(), trigger_row, row_bytes });
    }
    let words = bytes.as_chunks::<4>().0.iter();
    let values: Vec<f64> = words.map(|word| f64::from(f32::from_le_bytes(*word))).collect();
    let column = |place: usize| values.iter().skip(place).step_by(signals).copied().collect();
    Ok(Capture { columns: (0..signals).map(column).collect(), trigger_row })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::Hub;
    use crate::joint::JointNode;
    use compensator_core::can::NodeId;

    #[test]
    fn columns_of_rows_that_do_not_fit_are_refused() {
        let bytes: Vec<u8> = [1.0f32, 2.0, 3.0, 4.0].map(f32::to_le_bytes).concat();
        let capture = columns(&bytes, 2, 1).expect("two rows");
        assert_eq!(capture.columns, [[1.0, 3.0], [2.0, 4.0]]);
        for (bytes, trigger_row) in [(&bytes[..12], 0), (&bytes[..15], 0), (&bytes[..], 2)] {
            let error = columns(bytes, 2, trigger_row).expect_err("no whole rows");
            assert!(matches!(error, ScopeError::Rows { .. }), "{error}");
        }
    }

    #[test]
    fn capture_of_a_joint_without_memory_reports_it() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("starts without a file"));
        let request = ScopeRequest {
            signals: vec![Signal::from_number(1).expect("a signal")],
            every: 1,
            trigger: ScopeTrigger::Now,
            before: 0.0,
            timeout: Duration::from_secs(1),
        };
        let mut client = Client::new(hub.port(), NodeId::FIRST);
        let error = capture(&mut client, &request, || false).expect_err("no memory");
        assert!(matches!(error, ScopeError::NoMemory), "{error}");
    }
}
