//! Published experiments made anew: one list, which `host-sim paper` offers.
//!
//! A paper's tables are repeated with the shipped code, and each number stands beside the printed one. A [`Row`]
//! is one such number: in which table, row and column it stands, in what unit, ours with its spread, the printed
//! one where there is one, and whether ours was simulated or measured. The rows make `paper.json`, and with text and
//! charts around them `report.html`. What was to be reached are [`Goal`]s, and one that is missed says so; with the
//! summary and chosen tables they make `summary.md`, which stands in `docs` as it is.
//!
//! A new paper is a file here with a [`Paper`] and its line in the list.

mod damper;
mod digest;
mod goal;
mod manipulator;
mod report;
mod row;
mod underwater_joint;

pub(crate) use digest::{Stopwatch, across, goal_table, markdown};
pub use goal::{Goal, Wanted};
pub(crate) use manipulator::coupled;
pub(crate) use report::lines;
pub use report::tables;
pub use row::Row;

use crate::report::{Block, Table};
use std::path::PathBuf;

/// Every paper there is.
pub const PAPERS: &[&dyn Paper] =
    &[&underwater_joint::UnderwaterJoint, &damper::Damper, &manipulator::Manipulator];

/// What is asked of a paper.
pub struct Request<'a> {
    /// The short form: fewer repeats, seconds instead of minutes.
    pub quick: bool,
    /// The same seed, the same numbers.
    pub seed: u64,
    /// Folder of the measured logs.
    pub data: PathBuf,
    /// Told what is being done, a few words each time.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

/// What became of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Every number, in the order of its table.
    pub rows: Vec<Row>,
    /// What was to be reached, and what was.
    pub goals: Vec<Goal>,
    /// What came out, a sentence each, most important first: also what falls short and what was left out.
    pub summary: Vec<String>,
    /// The page below the summary.
    pub blocks: Vec<Block>,
    /// Tables of chosen rows, for the page in `docs`.
    pub digest: Vec<Table>,
    /// Further files by name.
    pub files: Vec<(String, Vec<u8>)>,
}

/// A paper whose experiments can be made anew.
pub trait Paper: Sync {
    /// Its name on the command line and in `paper.json`.
    fn name(&self) -> &'static str;

    /// What it is, in a sentence without its end.
    fn about(&self) -> &'static str;

    /// Title of the page.
    fn title(&self) -> &'static str;

    /// What a reader has to know before the numbers: whose paper, what is simulated or measured. Whole sentences.
    fn preface(&self) -> &'static str;

    /// Makes its experiments anew.
    ///
    /// # Errors
    /// One line: what could not be done.
    fn run(&self, request: &Request) -> Result<Outcome, String>;
}
