//! Friction models fitted to measured logs, and what they get wrong named.
//!
//! ```text
//! data -> fit (over compensator-core's own step) -> diagnose -> params
//! ```
//!
//! [`data`] reads logs by the contract (CSV, Parquet, CAN traces) and splits them by whole runs; [`mod@motion`] finds
//! the motion as it was behind what was logged of it; [`spec`] names
//! a model, as `lugre+pressure-coulomb`; [`mod@fit`] fits it and says of each parameter whether the data
//! determine it; [`mod@diagnose`] says what a model gets wrong, why ([`diagnose::cause`]), and what a better
//! one gains on runs no fit has seen; [`stochastic`] sets the published method beside that; [`params`] writes
//! the parameters as a driver reads them. Nothing here prints, plots or opens a bus.
//!
//! # Example
//!
//! A joint whose friction rises with pressure: columns are read, the plain law is fitted, and the
//! diagnosis names what it lacks.
//!
//! ```
//! use friction_identification::data::{Dataset, SplitRule, split};
//! use friction_identification::diagnose::{Question, diagnose};
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
//! let data = Dataset::of_columns(&names, (0..10).map(run))?;
//!
//! let (spec, tracks) = (Spec::parse("linear")?, tracks(&data));
//! let rows = Rows { tracks: &tracks, decimate: 1 };
//! let solution = fit(&spec, &spec.parameters()?, rows, &FitOptions::default());
//! assert!(solution.converged);
//!
//! let parts = split(&data, &SplitRule::default(), 0)?;
//! let found = diagnose(&data, &parts, &Question::default(), &|_| {})?;
//! assert_eq!(found.cause(), "pressure-coulomb");
//! assert!(found.gain.value > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
pub mod spec;
#[cfg(feature = "fit")]
pub mod stochastic;
