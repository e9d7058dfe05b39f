//! Result files of `identify`, `compare` and `diagnose`: JSON documents, header comments of `params.toml`, HTML pages.
//!
//! - [`json`]: `fit.json` and `compare.json`; [`diagnosis`]: `diagnosis.json`.
//! - [`provenance`]: the header comments of `params.toml`.
//! - [`ranking`]: the candidates of a diagnosis and why they were rejected.
//! - `page` and `diagnosis_page`: the HTML pages, built from the blocks of `report`.
//! - `rows`: every row of a log with the prediction of a model, as Parquet or CSV.
//! - [`write_atomically`]: writes a file completely or not at all.

pub mod diagnosis;
#[cfg(feature = "pages")]
pub mod diagnosis_page;
#[cfg(feature = "fleet")]
pub mod fleet;
pub mod json;
#[cfg(feature = "pages")]
pub mod page;
pub mod provenance;
pub mod ranking;
#[cfg(feature = "pages")]
pub mod report;
#[cfg(feature = "rows")]
pub mod rows;
#[cfg(feature = "rows")]
pub mod table_file;
mod write;

pub use json::{FitDocument, document};
#[cfg(feature = "pages")]
pub use page::{Comparison, FitReport, compare_fits, page};
pub use write::write_atomically;
