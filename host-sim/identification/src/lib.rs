//! Identification of friction models from measured logs, and diagnosis of their errors.
//!
//! ```text
//! data -> fit (over compensator-core's own step) -> diagnose -> params
//! ```
//!
//! - [`data`] reads logs by the contract (CSV, Parquet, CAN traces) and splits them by whole runs.
//! - [`mod@motion`] estimates the true motion from the logged motion.
//! - [`spec`] parses the name of a model, such as `lugre+pressure-coulomb`.
//! - [`mod@fit`] fits a model and reports for each parameter whether the data determine it.
//! - [`mod@diagnose`] finds the causes of a model's error ([`diagnose::cause`]) and the gain of a better model on held-out
//!   runs.
//! - [`stochastic`] implements a published method for comparison.
//! - [`prepare`] reads, checks and splits a log as every front end does; [`work`] stops long computations.
//! - [`setting`]: how a front end names the settings that an error refers to.
//! - [`params`] writes the parameters in the driver's format.
//! - [`prediction`] gives the torque of a fitted model on every row of a log.
//!
//! This crate does not print, plot or open a bus.
//!
//! # Example
//!
//! The friction of a joint rises with pressure. The example reads the columns, fits a plain law, and the diagnosis names
//! the missing cause.
//!
//! ```
//! use friction_identification::data::{Dataset, SplitRule, split};
//! use friction_identification::diagnose::{DiagnosisOptions, diagnose};
//! use friction_identification::fit::{FitOptions, Rows, fit, tracks};
//! use friction_identification::spec::Spec;
//!
//! let names = ["time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"].map(String::from);
//! let run = |index: usize| {
//!     let pressure = 1e5 * index as f64;
//!     let row = |row: usize| {
//!         let velocity = (0.02 * row as f64 + index as f64).sin();
//!         let noise = 0.02 * ((row * 7919 % 1000) as f64 / 1000.0 - 0.5);
//!         let torque = (1.0 + 1e-6 * pressure) * velocity.signum() + 0.3 * velocity + noise;
//!         [0.01 * row as f64, velocity, torque, pressure]
//!     };
//!     (format!("run {index}"), (0..4).map(|c| (0..600).map(|r| row(r)[c]).collect()).collect())
//! };
//! let data = Dataset::from_columns(&names, (0..10).map(run))?;
//!
//! let (spec, tracks) = (Spec::parse("linear")?, tracks(&data));
//! let rows = Rows { tracks: &tracks, decimate: 1 };
//! let solution = fit(&spec, &spec.parameters()?, rows, &FitOptions::default());
//! assert!(solution.converged);
//!
//! let parts = split(&data, &SplitRule::default(), 0)?;
//! let found = diagnose(&data, &parts, &DiagnosisOptions::default(), &|_| {})?;
//! assert_eq!(found.cause(), "pressure-coulomb");
//! assert!(found.gain.value > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "fit")]
pub mod clock;
pub mod data;
#[cfg(feature = "fit")]
pub mod diagnose;
#[cfg(feature = "fit")]
pub mod dual;
#[cfg(feature = "fit")]
pub mod fit;
#[cfg(feature = "fit")]
pub mod log_check;
#[cfg(feature = "fit")]
pub mod motion;
pub mod network;
pub mod number;
pub mod params;
#[cfg(feature = "fit")]
pub mod prediction;
#[cfg(feature = "fit")]
pub mod prepare;
pub mod setting;
pub mod spec;
#[cfg(feature = "fit")]
pub mod stochastic;
pub mod work;
