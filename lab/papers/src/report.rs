//! The page of a paper, and the tables of its rows for the page and the terminal.

use super::digest::{goal_table, pivot_table};
use super::{Paper, PaperOutcome, PaperRequest, ResultRow};
use friction_results::report::{Answers, Benefit, Block, Cell, Page, Section, Table};
use joint_log::number::{significant, with_error};

/// Maximum number of columns on a page; a wider table is transposed.
const MAX_TABLE_COLUMNS: usize = 8;

/// Returns `report.html` of a paper.
pub fn page(paper: &dyn Paper, request: &PaperRequest, outcome: &PaperOutcome) -> Page {
    let form = if request.quick { "short form, " } else { "" };
    let goals = &outcome.goals;
    let reached = goals.iter().filter(|goal| goal.is_reached()).count();
    let simulated = outcome.rows.iter().filter(|row| row.simulated).count();
    let answers = Answers {
        what: "The experiments of a published paper, repeated with the shipped code.".into(),
        certainty: match outcome.rows.len() {
            all if all == simulated => format!("All {all} values are simulated."),
            all => format!("Of {all} values, {simulated} are simulated and the others measured."),
        },
        benefit: match goals.is_empty() {
            true => Benefit::Purpose("It shows which results of the paper can be repeated.".into()),
            false => Benefit::Gain(format!("{reached} of {} goals are reached.", goals.len())),
        },
        next: match reached < goals.len() {
            true => "Read the remarks on the missed goals.".into(),
            false => "Read the summary, then the tables at the end.".into(),
        },
    };
    let mut page = Page::new(paper.title(), format!("{form}seed {}", request.seed));
    page.push(Block::Paragraph(paper.preface().into())).push(Block::Contents);
    if !goals.is_empty() {
        let remarks = goals.iter().filter(|goal| !goal.remark.is_empty());
        let remarks =
            remarks.map(|goal| format!("{}: {}. {}", goal.what, goal.verdict(), goal.remark));
        let title = format!("Goals: {reached} of {} reached", goals.len());
        page.add(Section::new(title).table(goal_table(goals)).list(remarks));
    }
    page.add(Section::new("Summary").list(&outcome.summary)).add(outcome.blocks.iter().cloned());
    page.add(Section::new("All values: ours and printed").with(tables(&outcome.rows)));
    page.answering(answers)
}

/// Returns one table for each table of the paper, in the order of the rows. A printed value has a column of its own
/// beside ours. A table that is too wide is transposed.
fn tables(rows: &[ResultRow]) -> Vec<Block> {
    distinct(rows, |row| &row.table)
        .into_iter()
        .map(|table| Block::Table(table_of(rows, table)))
        .collect()
}

fn table_of(rows: &[ResultRow], table: &str) -> Table {
    let rows: Vec<&ResultRow> = rows.iter().filter(|row| row.table == table).collect();
    let columns = distinct(rows.iter().copied(), |row| &row.column);
    let mut header = vec![String::new()];
    let mut fields: Vec<(&str, bool)> = Vec::new();
    for column in &columns {
        let here = || rows.iter().filter(|row| row.column == *column);
        let unit = one_unit(here().copied()).map_or(String::new(), |unit| format!(" ({unit})"));
        header.push(format!("{column}{unit}"));
        fields.push((column, false));
        if here().any(|row| row.printed.is_some()) {
            header.push("printed".into());
            fields.push((column, true));
        }
    }
    let origin = match rows.iter().filter(|row| row.simulated).count() {
        0 => "measured",
        all if all == rows.len() => "simulated",
        _ => "measured and simulated",
    };
    let numbered = table.starts_with(|first: char| first.is_ascii_digit());
    let name = if numbered { format!("Table {table}") } else { table.to_owned() };
    let caption = format!("{name} ({origin})");
    let names = distinct(rows.iter().copied(), |row| &row.row);
    if columns.len() > MAX_TABLE_COLUMNS.max(names.len()) {
        return pivot_table(&caption, rows, |row| {
            let unit = if row.unit.is_empty() { String::new() } else { format!(" ({})", row.unit) };
            let marked = if row.simulated && origin != "simulated" { ", simulated" } else { "" };
            Some((format!("{}{unit}{marked}", row.column), row.row.clone()))
        });
    }
    let body = names.into_iter().map(|name| {
        let cell = |(column, printed): &(&str, bool)| {
            let found = rows.iter().find(|row| row.row == name && row.column == *column);
            found.map_or(Cell::Empty, |row| if *printed { row.printed.into() } else { ours(row) })
        };
        // If the units in a column differ, the unit follows the row's name, as in a table of coefficients.
        let mixed = columns.iter().any(|column| {
            one_unit(rows.iter().copied().filter(|row| row.column == *column)).is_none()
        });
        let unit = one_unit(rows.iter().copied().filter(|row| row.row == name));
        let unit = unit.filter(|unit| mixed && !unit.is_empty());
        let name = unit.map_or(name.to_owned(), |unit| format!("{name} ({unit})"));
        std::iter::once(Cell::from(name)).chain(fields.iter().map(cell)).collect()
    });
    Table { caption, header, rows: body.collect(), best: Vec::new() }
}

/// Returns the unit that all rows share; `None` if they differ or are empty.
fn one_unit<'a>(rows: impl Iterator<Item = &'a ResultRow>) -> Option<&'a str> {
    let mut units = rows.map(|row| row.unit.as_str());
    let first = units.next()?;
    (!first.is_empty() && units.all(|unit| unit == first)).then_some(first)
}

fn ours(row: &ResultRow) -> Cell {
    match row.spread {
        Some(std_error) => Cell::Estimate { value: row.ours, std_error },
        None => Cell::Number(row.ours),
    }
}

/// Formats the rows for a terminal, one line each, because the tables are too wide for it.
pub fn format_rows(rows: &[ResultRow]) -> String {
    let mut text = String::new();
    for row in rows {
        let ours = match row.spread {
            Some(spread) => with_error(row.ours, spread),
            None => significant(row.ours, 4),
        };
        let printed = row
            .printed
            .map_or(String::new(), |printed| format!(", printed {}", significant(printed, 4)));
        let ResultRow { table, row: name, column, unit, .. } = row;
        text += &format!("  {table}: {name}, {column}: {ours} {unit}{printed}\n");
    }
    text
}

/// Returns the distinct values of `key`, in the order of first appearance.
fn distinct<'a>(
    rows: impl IntoIterator<Item = &'a ResultRow>,
    key: impl Fn(&'a ResultRow) -> &'a String,
) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        let name = key(row).as_str();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}
