//! Measured logs in, clean runs out.
//!
//! A friction law is only as good as the rows it is fitted on, and logs are never clean: cells
//! are missing, clocks jump, runs follow each other in one file, and a row of text sits in the
//! middle. This module reads CSV, Parquet and CAN logs by one contract (SI units in the column name),
//! leaves out what cannot be believed *and says which row and why*, and hands back one [`Run`]
//! per experiment. Three rules hold everywhere after that: nothing that has a memory (a
//! derivative, a filter, a bristle state) ever crosses the border of a run or a gap inside it
//! ([`segments`]); thinning out is anti-aliased ([`AntiAlias`]); and training and test data
//! are whole stretches of time, never shuffled rows ([`split()`]).
//!
//! The way of a row: `source` (one of the formats) -> `header` (which column is what, in which unit) ->
//! `clean` (may this row stay?) -> `close` (what do holes mean, where does a start begin?) -> `read`
//! (several files become one [`Dataset`]).

mod acceleration;
mod clean;
mod clock;
mod close;
mod columns;
pub mod contract;
mod dataset;
mod decimate;
mod error;
mod fill;
mod guess;
mod header;
mod joints;
mod naming;
mod order;
mod read;
mod reading;
mod segment;
mod source;
mod split;
mod trace_sink;
mod unit;
mod velocity;

pub use acceleration::{DERIVATIVE_WINDOW, derivative};
pub use clean::{MAX_BAD_SHARE, MAX_RUNS};
pub use compensator_core::quantity::{JointKind, Quantity};
pub use dataset::{Dataset, LeftOutColumn, Measured, Run, SourceColumn};
pub use decimate::AntiAlias;
pub use error::{BadCell, BadRows, DataError};
pub use read::{ReadOptions, read};
pub use segment::{GAP_FACTOR, segments};
pub use split::{DEFAULT_TEST_SHARE, Part, Split, SplitRule, TIME_BLOCKS, split};
pub use trace_sink::{EmitError, EmitOptions, emit, run_numbers};
