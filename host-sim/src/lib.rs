//! The command line of the workspace, and the parts that combine its crates.
//!
//! `joint-log` reads logs, `friction-fit` fits models to them, and `friction-diagnose` finds the causes of a model's error.
//! `friction-results` writes results as JSON, TOML and HTML, and models in other forms. `joint-rig` runs the firmware's driver on
//! a simulated joint, `joint-bus` connects to a driver on a bus, and `published-experiments` reproduces papers. This crate adds:
//!
//! - [`cli`]: the commands.
//! - [`driver_file`]: reads and writes parameter files with the settings of a joint driver.
//! - [`demo_joint`]: runs a simulated joint with its driver on a bus.
//!
//! The binary only calls [`cli::run`].

#[cfg(feature = "cli")]
pub mod cli;
pub mod demo_joint;
#[cfg(feature = "cli")]
mod moving_joint;
#[cfg(all(test, feature = "network"))]
#[path = "../../tests/reference_network.rs"]
mod reference_network;
#[cfg(all(test, feature = "cli"))]
#[path = "../../tests/snapshot.rs"]
mod snapshot;

/// The examples of the guide.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/how-to/embed-the-compensator.md")]
mod embed_the_compensator {}

pub use joint_rig::simulated;
pub use joint_tuning::driver_file;
