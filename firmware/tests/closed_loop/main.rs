//! Tests of the current loop in closed loop with an independent model of motor, bridge and seal.
//!
//! - `plant` is the model. It has its own equations and shares no code with the loop or the core.
//! - `rig` connects the loop to the model, with quantised sensors and the delay of the PWM.
//! - `current`, `joint`, `swap` and `faults` test the loop on this rig.
//! - `background` tests the whole driver, from CAN frames to switches.
//!
//! Measured figures have a lower and an upper limit. A figure that improves without reason usually means that a
//! part of the loop is inactive.

mod background;
mod current;
mod faults;
mod joint;
mod plant;
mod rig;
mod swap;
