//! What `identify` and `compare` leave behind: JSON for machines, TOML for the core, HTML for people.

pub mod diagnosis;
pub mod diagnosis_page;
pub mod json;
pub mod page;
pub mod provenance;
mod ranking;
pub mod table;

pub use json::{Document, document};
pub use page::{Judged, Study, judged, page};
