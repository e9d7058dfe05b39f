//! CAN logs of a joint: what `candump -L`, Vector's and PEAK's tools write, read and written.
//!
//! A joint's samples travel as the process frames of [`compensator_core::can`]. A log of them holds what a
//! CSV file of the contract holds, in `f32`: time is the stamp of the SYNC that ends a sample, a run
//! begins where an SDO download gives its number, a gap in time is a gap. With the driver's answers in it,
//! it also says what a replay must give, bit by bit. The way of a line: [`text`] (which format; [`candump`] and the
//! others, text to frame) -> [`samples`] (frames to samples); [`writer`] goes the other way; [`census`] says what frames
//! there are. What else is on the bus may be in the log, and is passed over and counted.

mod asc;
pub mod candump;
pub mod census;
mod frame;
pub mod samples;
pub mod text;
mod trc;
pub mod writer;

pub use candump::{CanFrame, Direction, Fraction, Line, LineError};
pub use census::Census;
pub use samples::{Assembler, Summary, TraceSample};
pub use text::{Frames, TextFormat, TextReader};
pub use writer::Writer;
