//! Writes `summary.md`: goals, shortcomings, findings and selected tables of a paper.
//!
//! The documentation takes goals and tables from the `summary.md` of the long form; a test compares the goals.
//! The file states its run time, so that two runs differ in that line.

use super::{Goal, Paper, PaperOutcome, PaperRequest, ResultRow};
use friction_results::report::{Cell, Table};
use joint_log::number::significant;
use rustix::time::{ClockId, clock_gettime};
use std::time::{Duration, Instant};

/// Measures the wall-clock and processor time of a run.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    since: Instant,
    processor: Duration,
}

/// Processor time of this process, until now.
fn processor() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

impl Stopwatch {
    /// Starts the measurement.
    pub fn start() -> Self {
        Self { since: Instant::now(), processor: processor() }
    }

    /// The time since the start, as text.
    fn elapsed_text(&self) -> String {
        let of_all = (processor() - self.processor).as_secs_f64();
        let threads = rayon::current_num_threads();
        let wall = self.since.elapsed().as_secs_f64();
        format!(
            "{} on {threads} threads, {} of processor time",
            format_duration(wall),
            format_duration(of_all)
        )
    }
}

/// Formats a duration, such as `2 min 49 s`.
fn format_duration(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match (seconds / 60, seconds % 60) {
        (0, rest) => format!("{rest} s"),
        (minutes, rest) => format!("{minutes} min {rest} s"),
    }
}

/// Returns `summary.md`.
pub fn summary_markdown(
    paper: &dyn Paper,
    request: &PaperRequest,
    outcome: &PaperOutcome,
    took: &Stopwatch,
) -> String {
    let form = if request.quick { "short" } else { "long" };
    let name = paper.name();
    let option = if request.quick { " --quick" } else { "" };
    let mut text = format!(
        "# {}\n\n{}\n\nThis is `summary.md` of `host-sim paper {name}{option} --out DIR`; `report.html` beside it has the charts, \
         `paper.json` every number. The {form} form, seed {}: {}.\n",
        paper.title(),
        paper.preface(),
        request.seed,
        took.elapsed_text(),
    );
    if !outcome.goals.is_empty() {
        let reached = outcome.goals.iter().filter(|goal| goal.is_reached()).count();
        text += &format!(
            "\n## Goals\n\n{reached} of {} reached.\n\n{}",
            outcome.goals.len(),
            markdown(&goal_table(&outcome.goals))
        );
        let short: Vec<&Goal> = outcome
            .goals
            .iter()
            .filter(|goal| !goal.is_reached() || !goal.remark.is_empty())
            .collect();
        if !short.is_empty() {
            text += "\n## Missed goals and remarks\n\n";
        }
        for goal in short {
            text += &format!("- {}: {}.", goal.what, goal.verdict());
            text +=
                &if goal.remark.is_empty() { "\n".into() } else { format!(" {}\n", goal.remark) };
        }
    }
    if !outcome.summary.is_empty() {
        text += "\n## Findings\n\n";
        outcome.summary.iter().for_each(|sentence| text += &format!("- {sentence}\n"));
    }
    if !outcome.digest.is_empty() {
        text += "\n## Numbers\n";
    }
    for table in &outcome.digest {
        text += &format!("\n{}", markdown(table));
    }
    text
}

/// Returns a table as Markdown with its caption above it and a line break at the end.
fn markdown(table: &Table) -> String {
    let line = |cells: &mut dyn Iterator<Item = String>| {
        let cells: Vec<String> = cells.map(|cell| cell.replace('|', "\\|")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let caption = match table.caption.as_str() {
        "" => String::new(),
        caption => format!("**{caption}**\n\n"),
    };
    let rule = format!("|{}\n", "---|".repeat(table.header.len()));
    let mut text = caption + &line(&mut table.header.iter().cloned()) + &rule;
    for row in &table.rows {
        let cell = |index| row.get(index).map_or_else(|| Cell::Empty.text(), Cell::text);
        text += &line(&mut (0..table.header.len()).map(cell));
    }
    text
}

/// Returns the goals as a table.
pub(crate) fn goal_table(goals: &[Goal]) -> Table {
    let row = |goal: &Goal| {
        let texts = [goal.what.clone(), goal.bound_text(), goal.ours_text()];
        texts.map(Cell::from).into_iter().chain([goal.verdict().into()]).collect()
    };
    Table::new("", "goal|target|result|", goals.iter().map(row))
}

/// Arranges rows as a table. `place` gives a row's line and column, or `None` to leave it out. The printed value follows
/// ours in its cell.
pub fn pivot_table<'a>(
    caption: &str,
    rows: impl IntoIterator<Item = &'a ResultRow>,
    place: impl Fn(&ResultRow) -> Option<(String, String)>,
) -> Table {
    let (mut lines, mut columns): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    let mut placed = Vec::new();
    for row in rows {
        let Some((line, column)) = place(row) else { continue };
        let at = |names: &mut Vec<String>, name: String| {
            names.iter().position(|known| *known == name).unwrap_or_else(|| {
                names.push(name);
                names.len() - 1
            })
        };
        placed.push((at(&mut lines, line), at(&mut columns, column), format_row(row)));
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

/// Relative size of the spread that rounding leaves in a mean of a few dozen values.
const ROUNDING_SPREAD_SHARE: f64 = 1e-12;

fn format_row(row: &ResultRow) -> String {
    const DIGITS: usize = 3;
    let ours = significant(row.ours, DIGITS);
    // A spread of this size is a rounding error.
    let spread =
        row.spread.map(|of| if of < ROUNDING_SPREAD_SHARE * row.ours.abs() { 0.0 } else { of });
    let spread = spread.map_or(String::new(), |of| format!(" ± {}", significant(of, 2)));
    let printed =
        row.printed.map_or(String::new(), |of| format!(" (print: {})", significant(of, 4)));
    format!("{ours}{spread}{printed}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn across_places_rows_by_line_and_column() {
        let rows = [
            ResultRow::simulated("1", "ours", "error", "%", 1.0).printed(2.0),
            ResultRow::simulated("1", "theirs", "error", "%", 3.0).spread(0.5),
            ResultRow::simulated("2", "ours", "error", "%", 4.0),
        ];
        let place = |row: &ResultRow| {
            (row.table == "1").then(|| (format!("{}, {}", row.column, row.unit), row.row.clone()))
        };
        let table = pivot_table("both", &rows, place);
        let text = "**both**\n\n|  | ours | theirs |\n|---|---|---|\n\
                    | error, % | 1.00 (print: 2.000) | 3.00 ± 0.50 |\n";
        assert_eq!(markdown(&table), text);
    }

    #[test]
    fn format_minutes_with_seconds_splits_minutes() {
        assert_eq!([format_duration(59.4), format_duration(169.0)], ["59 s", "2 min 49 s"]);
    }
}
