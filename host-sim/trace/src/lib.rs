//! CAN logs of a joint in the formats of `candump -L`, Vector (ASC) and PEAK (TRC), read and written.
//!
//! A joint's samples are transmitted as the process frames of [`compensator_core::can`]. A log of these frames holds
//! the same columns as a CSV log, in `f32`:
//!
//! * The time of a sample is the time stamp of the SYNC that ends it.
//! * A run begins with an SDO download of its number.
//! * The driver's answers are the reference of a replay, bit for bit.
//!
//! A line passes through [`text`] (format detection; [`candump`] and the other parsers) and [`samples`] (frames to
//! samples). [`writer`] is the reverse direction. [`census`] counts the frames of a log. Frames of other devices are
//! counted and skipped; [`drive`] reads those of known makers.

mod asc;
pub mod candump;
pub mod census;
pub mod drive;
mod fields;
mod frame;
pub mod samples;
pub mod text;
mod trc;
pub mod writer;

pub use census::Census;
pub use drive::{DriveProtocol, DriveReading};
pub use fields::Frames;
pub use frame::{CanFrame, Direction, Fraction, Line, LineError, TextFormat};
pub use samples::{Assembler, JointOnBus, Summary, TraceSample};
pub use text::{TextReader, TextWriter};
pub use writer::Writer;
