//! The shipped current loop against an independent motor, bridge and seal.
//!
//! `plant` has its own equations and shares no line with the loop or the core; `rig` puts the loop at its
//! bridge, with quantised sensors and the PWM's delay; `background` is the whole driver, frames to switches.
//! Limits stand on both sides wherever a number was measured: a loop that has become better overnight has
//! usually stopped doing something.

mod background;
mod current;
mod faults;
mod joint;
mod plant;
mod rig;
mod swap;
