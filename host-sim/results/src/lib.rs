//! Result files of `identify`, `compare` and `diagnose`: JSON documents, `params.toml`, HTML pages; models in other forms.
//!
//! - `fits` and [`diagnosis`]: all files of a command for one joint, as [`Files`].
//! - `feed_forward`: a model as a table for drives of other makers.
//! - [`json`]: `fit.json` and `compare.json`.
//! - [`export`]: a model in other forms; [`loop_cost`]: its computing time in the driver's current loop.
//! - `level_trend`: the trend of a joint's learnt friction level.
//! - [`provenance`]: the header comments of `params.toml`.
//! - [`ranking`]: the candidates of a diagnosis and why they were rejected.
//! - `page` and `diagnosis_page`: the HTML pages, built from the blocks of `report`.
//! - `scope`: captures of a joint's current loop. [`tune`]: the session that tunes a joint.
//! - [`stochastic`]: the stochastic extension, with the feature of this name.
//! - `rows`: every row of a log with the prediction of a model, as Parquet or CSV.
//! - [`write_atomically`]: writes a file completely or not at all.

pub mod budget;
mod diagnosed_log;
pub mod diagnosis;
#[cfg(feature = "pages")]
pub mod diagnosis_page;
mod error;
pub mod export;
#[cfg(feature = "pages")]
pub mod feed_forward;
mod files;
#[cfg(feature = "pages")]
pub mod fits;
#[cfg(feature = "fleet")]
pub mod fleet;
#[cfg(feature = "pages")]
pub mod joints_page;
pub mod json;
#[cfg(feature = "fleet")]
pub mod level_trend;
pub mod loop_cost;
#[cfg(test)]
mod noise;
#[cfg(feature = "pages")]
pub mod page;
pub mod predicted;
pub mod provenance;
pub mod ranking;
#[cfg(feature = "pages")]
pub mod report;
#[cfg(feature = "rows")]
pub mod rows;
#[cfg(all(feature = "pages", feature = "rows"))]
pub mod scope;
#[cfg(all(test, feature = "fleet"))]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;
mod steady_torque;
pub mod stochastic;
#[cfg(feature = "rows")]
pub mod table_file;
pub mod tune;
mod write;

pub use error::ResultError;
pub use files::{Files, pretty};
pub use json::document;
#[cfg(feature = "pages")]
pub use page::{Comparison, FitReport, compare_fits};
pub use predicted::ROWS_FILE;
pub use write::write_atomically;
