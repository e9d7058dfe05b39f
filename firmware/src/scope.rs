//! A scope: signals of the current loop, period by period, around a trigger.
//!
//! ```text
//! interrupt: values of a period -> row -> queue      every N-th period, only while a capture runs
//! background: queue -> Scope: ring of rows, trigger  -> object 2013h:11, read in blocks
//! ```
//! A bus carries some thousand frames a second, the loop runs 20,000 times. So the rows stay in memory, a fraction of
//! a second, and are read afterwards. Rows before the trigger are kept: a capture shows what led to it. The trigger is a
//! level that one of the signals crosses, a fault of the supervisor, or the start itself.
//!
//! The interrupt only copies the values that are asked for; all decisions are taken here. If the background is away for
//! longer than the queue holds, rows are missing, and the capture has failed: a scope without gaps or none.

mod recorder;
pub mod signal;

pub use recorder::{Scope, ScopeSettings, ScopeState, TRIGGER_FAULT, Trigger};
pub use signal::Signal;

/// Maximum number of signals in a row.
pub const MAX_SIGNALS: usize = 8;

/// Rows between two visits of the background: 2 ms at 20 kHz.
pub const QUEUE_ROWS: usize = 40;

/// What the interrupt records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScopeOrder {
    /// Numbers of the signals, 0 for none.
    pub signals: [u8; MAX_SIGNALS],
    /// Periods from one row to the next; 0 records nothing.
    pub every: u16,
    /// Number of the capture, which the rows repeat: rows of an earlier capture are told apart.
    pub capture: u8,
}

impl ScopeOrder {
    /// Records nothing.
    pub const OFF: Self = Self { signals: [0; MAX_SIGNALS], every: 0, capture: 0 };
}

/// Values of one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScopeRow {
    /// Values of the signals in their order.
    pub values: [f32; MAX_SIGNALS],
    /// Number of the capture.
    pub capture: u8,
    /// Rows before this one are lost: the queue was full.
    pub is_after_gap: bool,
}
