//! Experiments of published papers, repeated with the shipped code. `host-sim paper` runs them.
//!
//! Each paper's tables are repeated, and each result stands beside the printed one as a [`ResultRow`]: its table, row, column and
//! unit, our value with its spread, and the printed value. A row also states whether our value was simulated or measured.
//!
//! The rows become `paper.json`, and `report.html` with text and charts. Targets are [`Goal`]s, reached or missed. Goals,
//! summary sentences and selected tables become `summary.md`, from which the documentation takes goals and tables.
//!
//! To add a paper, write a module that implements [`Paper`] and add it to [`PAPERS`].

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

mod damper;
mod digest;
mod error;
mod goal;
mod manipulator;
mod report;
mod row;
mod underwater_joint;

pub(crate) use digest::pivot_table;
pub use digest::{Stopwatch, summary_markdown};
pub use error::PaperError;
pub use goal::{BoundSide, Goal};
pub use manipulator::coupled;
pub use report::{format_rows, page};
pub use row::ResultRow;

use friction_results::report::{Block, Table};
use std::path::{Path, PathBuf};

/// All papers.
pub const PAPERS: &[&dyn Paper] =
    &[&underwater_joint::UnderwaterJoint, &damper::Damper, &manipulator::Manipulator];

/// Settings for running a paper.
pub struct PaperRequest<'a> {
    /// Runs the short form: fewer repeats, seconds instead of minutes.
    pub quick: bool,
    /// Seed of the random sampler; equal seeds give equal results.
    pub seed: u64,
    /// Folder of the measured logs.
    pub data: PathBuf,
    /// Receives short progress messages.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

/// Results of a paper.
#[derive(Clone, Debug, Default)]
pub struct PaperOutcome {
    /// All results, in the order of their tables.
    pub rows: Vec<ResultRow>,
    /// Targets and whether they were reached.
    pub goals: Vec<Goal>,
    /// Findings, one sentence each, most important first; includes shortcomings and what was left out.
    pub summary: Vec<String>,
    /// Sections of the page below the summary.
    pub blocks: Vec<Block>,
    /// Tables of selected rows, for `summary.md`.
    pub digest: Vec<Table>,
    /// Further files: name and content.
    pub files: Vec<(String, Vec<u8>)>,
}

/// A paper whose experiments can be repeated.
pub trait Paper: Sync {
    /// Name on the command line and in `paper.json`.
    fn name(&self) -> &'static str;

    /// Description for `--help`, without a full stop.
    fn about(&self) -> &'static str;

    /// Usual duration on two cores, minutes, for the message before a run.
    fn usual_minutes(&self, quick: bool) -> f64;

    /// Title of the page.
    fn title(&self) -> &'static str;

    /// Introduction: which paper, and what is simulated or measured. Whole sentences.
    fn preface(&self) -> &'static str;

    /// Repeats the experiments.
    ///
    /// # Errors
    /// Returns one line that states what could not be done.
    fn run(&self, request: &PaperRequest) -> Result<PaperOutcome, PaperError>;
}

/// Returns the path of a measured log: the CSV file of this name, or an excerpt of it in Parquet. `None` if neither exists.
pub(crate) fn measured_file(folder: &Path, name: &str) -> Option<PathBuf> {
    let full = folder.join(name);
    [full.with_extension("parquet"), full].into_iter().rfind(|path| path.is_file())
}
