//! The rows of a paper as its tables, on the page and on the terminal.

use super::Row;
use super::digest::across;
use crate::report::{Block, Cell, Table};
use friction_identification::number::{significant, with_error};

/// More columns than this are lines instead: a page holds no more beside each other.
const COLUMNS: usize = 8;

/// Tables of the rows, in their order: one per paper's table, its columns as in print, and beside each of our
/// numbers the printed one in its own column where there is one; one that is too wide is laid on its side.
pub fn tables(rows: &[Row]) -> Vec<Block> {
    in_order(rows, |row| &row.table)
        .into_iter()
        .map(|table| Block::Table(of(rows, table)))
        .collect()
}

fn of(rows: &[Row], table: &str) -> Table {
    let rows: Vec<&Row> = rows.iter().filter(|row| row.table == table).collect();
    let columns = in_order(rows.iter().copied(), |row| &row.column);
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
    let names = in_order(rows.iter().copied(), |row| &row.row);
    if columns.len() > COLUMNS.max(names.len()) {
        return across(&caption, rows, |row| {
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
        // Where a column's units differ, a row's own stands with its name: a table of coefficients.
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

/// The unit some rows share; none where they share none or have none.
fn one_unit<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a str> {
    let mut units = rows.map(|row| row.unit.as_str());
    let first = units.next()?;
    (!first.is_empty() && units.all(|unit| unit == first)).then_some(first)
}

fn ours(row: &Row) -> Cell {
    match row.spread {
        Some(std_error) => Cell::Estimate { value: row.ours, std_error },
        None => Cell::Number(row.ours),
    }
}

/// The rows for a terminal: one line each, as the page's tables are too wide for it.
pub(crate) fn lines(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let ours = match row.spread {
            Some(spread) => with_error(row.ours, spread),
            None => significant(row.ours, 4),
        };
        let printed = row
            .printed
            .map_or(String::new(), |printed| format!(", printed {}", significant(printed, 4)));
        let Row { table, row: name, column, unit, .. } = row;
        text += &format!("  {table}: {name}, {column}: {ours} {unit}{printed}\n");
    }
    text
}

/// What `key` says of the rows, each once, in the order of first appearance.
fn in_order<'a>(
    rows: impl IntoIterator<Item = &'a Row>,
    key: impl Fn(&'a Row) -> &'a String,
) -> Vec<&'a str> {
    let mut seen: Vec<&str> = Vec::new();
    for row in rows {
        let name = key(row).as_str();
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}
