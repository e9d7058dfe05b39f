//! Traces that CODESYS, and tools made with it such as ctrlX PLC Engineering, save as `.trace.csv`.
//!
//! Lines `key; value` describe the trace. Each variable has a number: `0.Variable; PLC_PRG.velocity`. After its line
//! `0.Data;` come its samples, one a line: `; time in ms; value`. The samples of all variables are joined by their times.

use super::encoding::without_mark;
use super::format::{Input, LogFormat};
use super::lines::LineFile;
use crate::contract::TIME;
use crate::error::DataError;
use crate::join::join_tables;
use crate::log_table::LogTable;
use crate::options::ReadOptions;
use crate::plan::Request;
use crate::table::{Cells, Table};

/// The first line of a file.
const FIRST_LINE: &[u8] = b"[key]; [value]";

pub(super) const FORMAT: LogFormat = LogFormat { matches: is_trace, read };

fn is_trace(head: &[u8]) -> bool {
    without_mark(head).starts_with(FIRST_LINE)
}

/// The samples of a variable.
#[derive(Debug, Default)]
struct Variable {
    name: String,
    time_s: Vec<f64>,
    values: Vec<f64>,
}

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Input { request, file, .. } = input;
    let path = request.path;
    let mut variables: Vec<Variable> = Vec::new();
    let mut bad = None;
    let file = LineFile { path, file: &file, max_bytes: u64::MAX };
    file.each_line(request.progress, |number, line| {
        let text = String::from_utf8_lossy(line);
        if !add_line(&text, &mut variables) {
            bad.get_or_insert((number, text.trim().to_owned()));
        }
        Ok(())
    })?;
    variables.retain(|variable| !variable.time_s.is_empty());
    if let Some((row, found)) = bad {
        return Err(DataError::file(path, format!("{found:?} in line {row}"), "; TIME; VALUE"));
    }
    if variables.is_empty() {
        return Err(DataError::file(path, "no variable with samples", "a trace with data"));
    }
    read_variables(request, variables)
}

/// Adds a line. Returns false if it begins like a sample and is none.
fn add_line(line: &str, variables: &mut Vec<Variable>) -> bool {
    let mut cells = line.split(';').map(str::trim);
    let key = cells.next().unwrap_or_default();
    if key.ends_with(".Variable") {
        let name = cells.next().unwrap_or_default().to_owned();
        variables.push(Variable { name, ..Variable::default() });
        return true;
    }
    if !key.is_empty() || line.trim().is_empty() {
        return true;
    }
    // Truth values are written as words.
    let number = |text: &str| match text {
        "TRUE" | "True" => Some(1.0),
        "FALSE" | "False" => Some(0.0),
        text => text.parse::<f64>().ok(),
    };
    let (time_ms, value) = (cells.next().and_then(number), cells.next().and_then(number));
    match (variables.last_mut(), time_ms, value) {
        (Some(variable), Some(time_ms), Some(value)) => {
            variable.time_s.push(time_ms / 1e3);
            variable.values.push(value);
            true
        }
        _ => false,
    }
}

/// Joins the variables to a table.
fn read_variables(
    request: Request,
    variables: Vec<Variable>,
) -> Result<LogTable<'static>, DataError> {
    let name = request.path.display().to_string();
    let count = variables.len();
    let tables = variables.into_iter().map(|Variable { name: variable, time_s, values }| {
        let columns = vec![
            (TIME.to_owned(), Cells::Numbers(time_s)),
            (variable.clone(), Cells::Numbers(values)),
        ];
        (variable, Table { name: name.clone(), columns })
    });
    // The samples of a trace have times in each mode of reading.
    let joined = join_tables(&name, tables.collect(), &ReadOptions::default())?;
    let mut table = LogTable::of_table(&request, joined.table.into_columns())?;
    table.notes.push(format!(
        "{name}: a trace of CODESYS: {count} variables, joined by {}, with times in ms",
        joined.in_words
    ));
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn add_line_with_trace_returns_its_variables() {
        let text = "[key]; [value]\r\nName; Application.Trace\r\nComment; \r\n0.Variable; PLC_PRG.v\r\n0.Class; 14\r\n\
                    0.Data; \r\n; 10; 0.5\r\n; 20.5; -1e-3\r\n1.Variable; PLC_PRG.on\r\n1.Data; \r\n; 10; TRUE\r\n\r\n";
        let mut variables = Vec::new();
        assert!(text.lines().all(|line| add_line(line, &mut variables)));
        assert_eq!(variables[0].name, "PLC_PRG.v");
        assert_eq!(
            (&*variables[0].time_s, &*variables[0].values),
            (&[0.01, 0.0205][..], &[0.5, -1e-3][..])
        );
        assert_eq!((&*variables[1].name, &*variables[1].values), ("PLC_PRG.on", &[1.0][..]));
        assert!(!add_line("; 10; x", &mut variables));
        assert!(is_trace(text.as_bytes()) && !is_trace(b"key;value\n"));
    }
}
