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
mod row;
pub mod signal;

pub use recorder::{Scope, ScopeSettings, ScopeState, TRIGGER_FAULT, Trigger};
pub use row::{MAX_SIGNALS, ScopeOrder, ScopeRow};
pub use signal::Signal;

/// Rows between two visits of the background: 2 ms at 20 kHz.
pub const QUEUE_ROWS: usize = 40;
