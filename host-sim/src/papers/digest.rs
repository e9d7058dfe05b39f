//! `summary.md`: a paper's goals, what falls short, sentences and chosen tables, as they stand in the docs.
//!
//! The page in `docs` is this file of the long form, taken as it is: what `paper` found and what is told of it cannot
//! drift apart by hand. Times stand in it, so two runs differ in that line.

use super::{Goal, Outcome, Paper, Request, Row};
use crate::report::{Cell, Table};
use friction_identification::number::significant;
use rustix::time::{ClockId, clock_gettime};
use std::time::{Duration, Instant};

/// Begins to measure what a run takes.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    since: Instant,
    processor: Duration,
}

/// Processor time of this process so far.
fn processor() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

impl Stopwatch {
    /// From now on.
    pub fn start() -> Self {
        Self { since: Instant::now(), processor: processor() }
    }

    /// What it took, in words.
    fn in_words(&self) -> String {
        let of_all = (processor() - self.processor).as_secs_f64();
        let threads = rayon::current_num_threads();
        let wall = self.since.elapsed().as_secs_f64();
        format!("{} on {threads} threads, {} of processor time", minutes(wall), minutes(of_all))
    }
}

/// `2 min 49 s`.
fn minutes(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match (seconds / 60, seconds % 60) {
        (0, rest) => format!("{rest} s"),
        (minutes, rest) => format!("{minutes} min {rest} s"),
    }
}

/// The page as Markdown.
pub fn markdown(
    paper: &dyn Paper,
    request: &Request,
    outcome: &Outcome,
    took: &Stopwatch,
) -> String {
    let form = if request.quick { "short" } else { "long" };
    let name = paper.name();
    let option = if request.quick { " --quick" } else { "" };
    let mut text = format!(
        "# {}\n\n{}\n\nThis page is `summary.md` of `host-sim paper {name}{option} --out DIR`, taken as it is; `report.html` \
         beside it has the charts, `paper.json` every number. The {form} form, seed {}: {}.\n",
        paper.title(),
        paper.preface(),
        request.seed,
        took.in_words(),
    );
    if !outcome.goals.is_empty() {
        let reached = outcome.goals.iter().filter(|goal| goal.reached()).count();
        text += &format!(
            "\n## Goals\n\n{reached} of {} reached.\n\n{}",
            outcome.goals.len(),
            goal_table(&outcome.goals).markdown()
        );
        let short: Vec<&Goal> = outcome
            .goals
            .iter()
            .filter(|goal| !goal.reached() || !goal.remark.is_empty())
            .collect();
        if !short.is_empty() {
            text += "\n## What falls short, and what is to be known\n\n";
        }
        for goal in short {
            text += &format!("- {}: {}.", goal.what, goal.verdict());
            text +=
                &if goal.remark.is_empty() { "\n".into() } else { format!(" {}\n", goal.remark) };
        }
    }
    if !outcome.summary.is_empty() {
        text += "\n## In words\n\n";
        outcome.summary.iter().for_each(|sentence| text += &format!("- {sentence}\n"));
    }
    if !outcome.digest.is_empty() {
        text += "\n## Numbers\n";
    }
    for table in &outcome.digest {
        text += &format!("\n{}", table.markdown());
    }
    text
}

/// The goals as a table.
pub fn goal_table(goals: &[Goal]) -> Table {
    let row = |goal: &Goal| {
        let cells = [&goal.what, &goal.bound_in_words(), &goal.ours_in_words()];
        let words = cells.map(|text| Cell::from(text.as_str()));
        words.into_iter().chain([goal.verdict().into()]).collect()
    };
    Table {
        caption: String::new(),
        header: ["goal", "wanted", "came out", ""].map(str::to_owned).to_vec(),
        rows: goals.iter().map(row).collect(),
        best: Vec::new(),
    }
}

/// Rows as a table of its own: where each stands in it (line, column), `None` for those that do not. A printed number
/// stands behind ours.
pub fn across<'a>(
    caption: &str,
    rows: impl IntoIterator<Item = &'a Row>,
    place: impl Fn(&Row) -> Option<(String, String)>,
) -> Table {
    let (mut lines, mut columns): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    let mut placed = Vec::new();
    for row in rows {
        let Some((line, column)) = place(row) else { continue };
        let at = |names: &mut Vec<String>, name: String| {
            names.iter().position(|own| *own == name).unwrap_or_else(|| {
                names.push(name);
                names.len() - 1
            })
        };
        placed.push((at(&mut lines, line), at(&mut columns, column), in_words(row)));
    }
    let mut cells = vec![vec![Cell::Empty; columns.len()]; lines.len()];
    for (line, column, text) in placed {
        cells[line][column] = text.into();
    }
    let rows = lines.into_iter().zip(cells);
    let rows = rows.map(|(line, cells)| std::iter::once(line.into()).chain(cells).collect());
    Table {
        caption: caption.into(),
        header: std::iter::once(String::new()).chain(columns).collect(),
        rows: rows.collect(),
        best: Vec::new(),
    }
}

/// Share of a mean that the roundings of some tens of sums leave as its spread.
const ROUNDING: f64 = 1e-12;

fn in_words(row: &Row) -> String {
    const DIGITS: usize = 3;
    let ours = significant(row.ours, DIGITS);
    // Less than roundings leave is none.
    let spread = row.spread.map(|of| if of < ROUNDING * row.ours.abs() { 0.0 } else { of });
    let spread = spread.map_or(String::new(), |of| format!(" ± {}", significant(of, 2)));
    let printed =
        row.printed.map_or(String::new(), |of| format!(" (print: {})", significant(of, 4)));
    format!("{ours}{spread}{printed}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_where_they_are_put() {
        let rows = [
            Row::simulated("1", "ours", "error", "%", 1.0).printed(2.0),
            Row::simulated("1", "theirs", "error", "%", 3.0).spread(0.5),
            Row::simulated("2", "ours", "error", "%", 4.0),
        ];
        let place = |row: &Row| {
            (row.table == "1").then(|| (format!("{}, {}", row.column, row.unit), row.row.clone()))
        };
        let table = across("both", &rows, place);
        let text = "**both**\n\n|  | ours | theirs |\n|---|---|---|\n\
                    | error, % | 1.00 (print: 2.000) | 3.00 ± 0.50 |\n";
        assert_eq!(table.markdown(), text);
    }

    #[test]
    fn times_are_told_in_minutes() {
        assert_eq!([minutes(59.4), minutes(169.0)], ["59 s", "2 min 49 s"]);
    }
}
