//! Tests of the current loop in closed loop with an independent model of motor, bridge and seal.
//!
//! - `plant` is the model. It has its own equations and shares no code with the loop or the core.
//! - `rig` connects the loop to the model, with quantised sensors and the delay of the PWM.
//! - `current`, `current_vector`, `braking`, `frozen_encoder`, `joint`, `swap` and `faults` test the loop on this rig.
//! - `driver` is the whole driver on this rig, from CAN frames to switches; `background`, `lost_master`,
//!   `held_load`, `enclosure`, `stop_reaction` and `trial_in_motion` test it.
//!
//! Measured figures have a lower and an upper limit. A figure that improves without reason usually means that a
//! part of the loop is inactive.

mod background;
mod braking;
mod current;
mod current_vector;
mod driver;
mod enclosure;
mod faults;
mod frozen_encoder;
mod held_load;
mod joint;
mod lost_master;
mod no_compensation;
mod plant;
mod ramps;
mod rig;
mod stop_reaction;
mod swap;
mod trial_in_motion;
