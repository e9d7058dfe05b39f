//! The files of a tuning session.

use super::TuneReport;
use crate::files::pretty;
use crate::report::Page;
use crate::table_file::{TableColumn, TableFile, TableFormat};
use crate::{Files, ResultError};
use compensator_core::Quantity;
use joint_log::{JointKind, contract};

/// File with the recorded rows.
const ROWS_FILE: &str = "runs.parquet";

/// The recorded rows of a motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TuneRun {
    /// Name of the run.
    pub name: String,
    /// Columns by their names in a log: `time_s`, `velocity_rad_s`. NaN stands for a missing value.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl TuneRun {
    /// Returns the number of rows: the length of the longest column.
    fn rows(&self) -> usize {
        self.columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0)
    }
}

impl TuneReport {
    /// Returns the files of the session: `tune.html`, `tune.json`, `runs.parquet` if a row was recorded, and the given texts
    /// by their names. `diagnosis` is the page of what the runs show.
    ///
    /// The table of the rows is a log: runs with their names, the columns of a log first. Runs of the same name are numbered.
    /// A column that a run does not have, or that ends early, has no values there.
    ///
    /// # Errors
    /// One line, if a file cannot be written in its format.
    pub fn files(
        &self,
        runs: &[TuneRun],
        diagnosis: Option<Page>,
        texts: Vec<(&'static str, String)>,
    ) -> Result<Files, ResultError> {
        let page = self.page(diagnosis).render().into_bytes();
        let mut others = vec![("tune.html", page)];
        if runs.iter().any(|run| run.rows() > 0) {
            others.push((ROWS_FILE, table(runs).emit(TableFormat::Parquet)?));
        }
        others.extend(texts.into_iter().map(|(name, text)| (name, text.into_bytes())));
        Ok(Files { document: ("tune.json", pretty(&self.document())?), others })
    }
}

/// Returns the rows of all runs as one table: the content of `runs.parquet`.
pub fn table(runs: &[TuneRun]) -> TableFile {
    let rows: Vec<usize> = runs.iter().map(TuneRun::rows).collect();
    let mut table = TableFile::new(rows.iter().sum());
    let indices = rows.iter().enumerate();
    let indices = indices.flat_map(|(run, rows)| std::iter::repeat_n(run, *rows)).collect();
    table.push("run", TableColumn::Texts { texts: distinct_names(runs), indices });
    for name in column_names(runs) {
        let of_run = |(run, rows): (&TuneRun, &usize)| {
            let column = run.columns.iter().find(|(known, _)| *known == name);
            let mut values = column.map_or_else(Vec::new, |(_, values)| values.clone());
            values.resize(*rows, f64::NAN);
            values
        };
        let values: Vec<f64> = runs.iter().zip(&rows).flat_map(of_run).collect();
        if values.iter().any(|value| value.is_finite()) {
            table.push(name, TableColumn::Numbers(values));
        }
    }
    table
}

/// Returns the names of the runs. A log joins rows with the same name, so a repeated name is numbered.
fn distinct_names(runs: &[TuneRun]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for run in runs {
        let numbered = (2..).map(|number| format!("{} ({number})", run.name));
        let free = std::iter::once(run.name.clone()).chain(numbered);
        names.extend(free.into_iter().find(|name| !names.contains(name)));
    }
    names
}

/// Returns the names of all columns, each once: those of a log in its order, then the others in order of appearance.
fn column_names(runs: &[TuneRun]) -> Vec<String> {
    let known = [Quantity::CampaignTime, Quantity::Velocity, Quantity::Torque];
    let known: Vec<&str> = known
        .into_iter()
        .chain(contract::optional())
        .map(|quantity| quantity.name(JointKind::Revolute))
        .collect();
    let mut names: Vec<String> = Vec::new();
    for (name, _) in runs.iter().flat_map(|run| &run.columns) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    names.sort_by_key(|name| known.iter().position(|known| known == name).unwrap_or(known.len()));
    names
}
