//! Documents of JSON, which are no logs, and the command that makes one of each.
//!
//! The command depends on where the rows are: in a list of objects, in a list for each column, or in objects one after another.

use super::json_lines::without_nan;
use serde_json::{Deserializer, Value};

/// Minimum number of rows of a column, and of columns.
const MIN_ROWS: usize = 2;
const MIN_COLUMNS: usize = 2;

/// Maximum nesting of the rows.
const MAX_DEPTH: usize = 4;

/// Makes an object of each row from the lists of the columns.
const OF_COLUMNS: &str = "to_entries | map(select(.value | arrays)) | map(.key) as $names | map(.value) | transpose[] | \
                          [$names, .] | transpose | map({(.[0]): .[1]}) | add";

/// Returns the command that makes a log of a document, with FILE for its path; `None` if a text may be JSON lines. A long text may
/// be cut off.
pub(super) fn command(text: &[u8]) -> Option<String> {
    let text = text.trim_ascii();
    let mut lines = text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.next().unwrap_or_default();
    let is_whole = |line: &[u8]| {
        let line = without_nan(&String::from_utf8_lossy(line));
        serde_json::from_str::<Value>(&line).is_ok()
    };
    let is_object = text.starts_with(b"{");
    if !is_object && !text.starts_with(b"[") {
        return None;
    }
    let values = values(text);
    let shape = values.first().and_then(|value| of_value(value, "", 0)).map(|(_, shape)| shape);
    if is_object && is_whole(first) {
        // JSON lines, unless the only line holds a table.
        return shape.filter(|_| values.len() == 1).map(Shape::command);
    }
    match (shape, values.len()) {
        // `[link]` begins a section of text.
        (_, 0) => None,
        (Some(shape), 1) => Some(shape.command()),
        (_, count) if is_object && count > 1 => Some(Shape::Rows(".".into()).command()),
        _ if is_object => Some("JSON lines, one object a row".into()),
        _ => None,
    }
}

/// Where the rows of a document are.
enum Shape {
    /// In a list of objects, or in lists of columns: the filter of jq.
    Rows(String),
    /// In a list of lists: the filter, for a table.
    Table(String),
}

impl Shape {
    fn command(self) -> String {
        match self {
            Self::Rows(filter) => {
                format!("JSON lines, one object a row: jq -c '{filter}' FILE > log.jsonl")
            }
            Self::Table(filter) => format!("a CSV file: jq -r '{filter} | @csv' FILE > log.csv"),
        }
    }
}

/// Finds the longest list of rows in a value at a path, with its length.
fn of_value(value: &Value, path: &str, depth: usize) -> Option<(usize, Shape)> {
    let here = |filter: &str| {
        if path.is_empty() { filter.to_owned() } else { format!("{path} | {filter}") }
    };
    if let Some(list) = value.as_array() {
        let each = format!("{}[]", if path.is_empty() { "." } else { path });
        let shape = match list.first()? {
            Value::Object(_) => Shape::Rows(each),
            Value::Array(_) => Shape::Table(each),
            _ => return None,
        };
        return Some((list.len(), shape));
    }
    let fields = value.as_object().filter(|_| depth < MAX_DEPTH)?;
    // A table as pandas writes it.
    if let (Some(_), Some(Value::Array(data))) = (fields.get("columns"), fields.get("data"))
        && data.first().is_some_and(Value::is_array)
    {
        return Some((data.len(), Shape::Table(here(".columns, .data[]"))));
    }
    // The number of columns, and of their rows.
    let columns = |rows: &dyn Fn(&Value) -> Option<usize>| {
        let rows = fields.values().filter_map(rows).filter(|rows| *rows >= MIN_ROWS);
        rows.fold((0, 0), |(count, most), rows| (count + 1, most.max(rows)))
    };
    let of_lists = columns(&|value| {
        let list = value.as_array()?;
        list.iter().all(|item| !item.is_object() && !item.is_array()).then_some(list.len())
    });
    // Columns as pandas writes them: objects of numbers, by the number of the row.
    let of_indices = columns(&|value| {
        let rows = value.as_object()?;
        rows.keys().all(|key| key.parse::<f64>().is_ok()).then_some(rows.len())
    });
    let shapes = [
        (of_lists, OF_COLUMNS.to_owned()),
        (of_indices, format!("map_values([.[]]) | {OF_COLUMNS}")),
    ];
    let of_columns = |least: usize| {
        let (found, filter) = shapes.iter().find(|((count, _), _)| *count >= least)?;
        Some((found.1, Shape::Rows(here(filter))))
    };
    let inside = || {
        let inside = fields
            .iter()
            .filter_map(|(name, value)| of_value(value, &step(path, name)?, depth + 1));
        inside.max_by_key(|(rows, _)| *rows)
    };
    // Of a text that is cut off, the first column may be all that is there.
    of_columns(MIN_COLUMNS).or_else(inside).or_else(|| of_columns(1))
}

/// Returns the path of a field; `None` if a shell cannot take its name.
fn step(path: &str, name: &str) -> Option<String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_word = name.chars().all(is_plain) && !name.starts_with(|c: char| c.is_ascii_digit());
    match (is_word, name.contains('\'')) {
        (true, _) => Some(format!("{path}.{name}")),
        (_, true) => None,
        _ if path.is_empty() => Some(format!(".[{name:?}]")),
        _ => Some(format!("{path}[{name:?}]")),
    }
}

/// Returns the values at the beginning of a text. What is cut off is completed.
fn values(text: &[u8]) -> Vec<Value> {
    let text = String::from_utf8_lossy(text);
    let text = without_nan(&text);
    let parse = |text: &str| -> Vec<Value> {
        Deserializer::from_str(text)
            .into_iter::<Value>()
            .take(MIN_ROWS)
            .map_while(Result::ok)
            .collect()
    };
    let whole = parse(&text);
    if !whole.is_empty() {
        return whole;
    }
    // Cut after the last element that is followed by another one, and close what is open there.
    let (mut open, mut is_string, mut is_escaped, mut cut) = (Vec::new(), false, false, None);
    for (at, c) in text.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' if is_string => is_escaped = true,
            '"' => is_string = !is_string,
            _ if is_string => {}
            '{' => open.push('}'),
            '[' => open.push(']'),
            '}' | ']' => _ = open.pop(),
            ',' => cut = Some((at, open.iter().rev().collect::<String>())),
            _ => {}
        }
    }
    cut.map_or_else(Vec::new, |(at, close)| parse(&format!("{}{close}", &text[..at])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_of_document_leads_to_its_rows() {
        for (text, filter) in [
            ("[{\"t\":0},{\"t\":1}]", "'.[]'"),
            ("[\n {\"t\":0, \"q\":[1,2]},\n {\"t\":1", "'.[]'"),
            ("[[0,1],[2,3]]", "'.[] | @csv'"),
            ("{\n\"a\": 1,\n\"log\": {\"of b\": [{\"t\":0},{\"t\":1}]}}", "'.log[\"of b\"][]'"),
            ("{\"t\":[0,1],\"q\":[0,1]}", "'to_entries"),
            ("{\n\"t\":[0,1,2,3],\n\"q\":[0,1", "'to_entries"),
            ("{\"t\":{\"0\":0,\"1\":1},\"q\":{\"0\":0,\"1\":1}}", "'map_values"),
            (
                "{\"columns\":[\"t\",\"q\"],\"index\":[0,1],\"data\":[[0,1],[2,3]]}",
                "'.columns, .data[]",
            ),
            ("{\n\"t\":0\n}\n{\n\"t\":1\n}\n", "'.'"),
        ] {
            let found = command(text.as_bytes()).unwrap_or_default();
            assert!(found.contains(filter), "{text}: {found}");
        }
        for text in [
            "{\"t\":0}\n{\"t\":1}\n",
            "{\"t\":NaN}\n{\"t\":1}\n",
            "{\"q\":[1,2]}\n{\"q\":[1,2]}\n",
            "[a]\n1,2\n",
            "a,b\n1,2\n",
        ] {
            assert_eq!(command(text.as_bytes()), None, "{text}");
        }
    }
}
