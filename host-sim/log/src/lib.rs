//! Reading of measured logs: validation, conversion to SI units, and the split into training and test data.
//!
//! Logs have missing cells, clock jumps, several runs in one file and rows of text. This crate reads CSV, JSON, Parquet, Arrow,
//! MCAP and CAN logs under one contract (SI units in the column names). It leaves out invalid rows *and reports each with its
//! reason*, and returns one [`Run`] per experiment. Three rules hold afterwards:
//!
//! - No computation with memory (derivative, filter, bristle state) crosses the border of a run or a gap in it
//!   ([`segments`]).
//! - Decimation is anti-aliased ([`AntiAlias`]).
//! - Training and test data are contiguous parts of runs, never shuffled rows ([`split()`]).
//!
//! A log passes through `source` (one module per format, which reads it to a table), `plan` and `header` (which columns are
//! read, with quantity and unit), `clean` (validation), `close` (missing values, recordings) and `read` (one [`Dataset`] of
//! several files).
//!
//! [`log_check`] then reports and corrects what is wrong with a measurement, and [`motion`] estimates the true motion from the
//! logged motion. [`work`] stops long computations. [`setting`] is how a front end names the settings that an error refers to.

#[macro_use]
mod named;

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

mod acceleration;
mod cell;
mod clean;
mod clock;
mod clock_fault;
mod close;
mod column_guess;
mod column_names;
mod column_pair;
mod columns;
pub mod contract;
mod counter;
mod counter_wrap;
mod dataset;
mod date;
mod decimate;
mod describe;
mod duplicates;
mod error;
mod fill;
mod guess;
mod header;
mod join;
mod joint_pattern;
mod joints;
pub mod log_check;
mod log_table;
mod long_table;
mod mixed_cells;
pub mod motion;
mod name_words;
mod naming;
pub mod number;
mod options;
mod order;
mod other_unit;
mod plan;
mod preset;
mod read;
mod row_clock;
mod segment;
mod servo_torque;
pub mod setting;
mod size;
mod source;
mod split;
mod spread;
pub mod statistics;
mod survey;
mod table;
mod torque_constant;
mod torque_fit;
mod torque_scale;
mod trace_sink;
mod unit;
mod velocity;
pub mod work;
mod zone;

pub use clean::MAX_RUNS;
pub use clock::{day_number, utc_minute};
pub use column_pair::ColumnPair;
pub use compensator_core::quantity::{JointKind, Quantity};
pub use dataset::{ColumnsError, Dataset, LeftOutColumn, Measured, Run, SourceColumn};
pub use decimate::AntiAlias;
pub use describe::survey;
pub use error::{BadCell, BadRows, DataError};
pub use joints::JOINT;
pub use mixed_cells::MixedCells;
pub use options::{MAX_BAD_SHARE, ReadOptions};
pub use plan::SURVEY_ROWS;
pub use preset::Preset;
pub use read::{FileContent, read, read_contents, read_tables};
pub use row_clock::parse_rate_hz;
pub use segment::{GAP_FACTOR, segments};
pub use servo_torque::{ServoTorque, ServoTorqueError};
#[cfg(feature = "parquet")]
pub use source::parquet_table;
pub use split::{DEFAULT_TEST_SHARE, Part, Split, SplitRule, TIME_BLOCKS, split};
pub use survey::{ColumnSummary, Survey};
pub use table::{Cells, Table};
pub use torque_constant::{NoTorqueConstant, TorqueConstant};
pub use trace_sink::{EmitError, EmitOptions, emit, run_numbers};
pub use unit::{UnitError, parse_value};

pub(crate) use unit::any_in_name as unit_of_name;
pub(crate) use unit::in_name as unit_in_name;
pub(crate) use velocity::differences;
