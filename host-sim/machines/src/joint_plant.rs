//! Simulated underwater joint for the repetition of the published experiments.
//!
//! It is more detailed than any model that is fitted to it.
//!
//! ```text
//! bridge -> winding -> gear -> shaft with its seal -> water, propeller, leg, platform
//!           machine            seal, shaft            load
//! ```
//!
//! The seal is not a LuGre model: its friction is of one of three families ([`contact`]). All constants are in one table with their sources ([`parameters`]).
//! [`machine`] is the plant of a current loop, with noise and quantisation in its measurements.
//!
//! Optional parts are a bus capacitor ([`supply`]), a winding that heats up ([`winding`]), a coupling with compliance
//! and backlash, cogging, and an eccentric encoder magnet. The simulation uses its own equations in double precision.
//! It is independent of the friction law under test.

mod around;
pub mod brake;
mod bridge;
pub mod comparators;
pub mod contact;
pub mod drawn;
mod effects;
pub mod gear;
pub mod load;
pub mod machine;
pub mod orders;
pub mod output_encoder;
pub mod parameters;
pub mod seal;
pub mod serial_encoder;
pub mod shaft;
pub mod shaft_sensors;
pub mod supply;
pub mod surroundings;
pub mod winding;

pub use brake::HoldingBrake;
pub use contact::FrictionFamily;
pub use drawn::DrawnJoint;
pub use gear::Gear;
pub use load::Load;
pub use machine::{JointPlant, Measured, Shown};
pub use orders::OrderAnalyser;
pub use output_encoder::OutputEncoder;
pub use parameters::{Entry, Parameters};
pub use serial_encoder::{SerialEncoder, SerialFault};
pub use shaft_sensors::{HallSensors, LineEncoder};
