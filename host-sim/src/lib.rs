//! The command line over the house's libraries, and what is shown to a person.
//!
//! [`cli`] is the command line; [`results`] writes JSON files, terminal tables and HTML pages out of what
//! `friction-identification` finds, over the building blocks of [`report`]. Here alone the rooms meet that must not
//! know each other: [`benchmark`] grades a diagnosis on simulated machines, [`simulated`] makes a data set of what a machine
//! logged, [`driver_file`] puts a joint driver's settings into a parameter file, [`demo_joint`] puts a simulated joint
//! on a bus, [`joint_rig`] the shipped driver on the simulated joint, [`loop_cost`] says what a model takes of the driver's time, [`export`] writes a model for other programs, [`papers`] makes published experiments anew. The binary is a thin `main`.

pub mod benchmark;
#[cfg(feature = "cli")]
pub mod cli;
pub mod demo_joint;
pub mod driver_file;
pub mod export;
pub mod joint_rig;
pub mod loop_cost;
#[cfg(feature = "cli")]
pub mod papers;
#[cfg(feature = "cli")]
pub mod report;
#[cfg(feature = "cli")]
pub mod results;
pub mod simulated;
