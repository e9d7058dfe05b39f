//! JSON lines: one object a line.
//!
//! A field of a nested object is a column with a dotted name, `data.velocity`; an element of a list is `q[1]`. Objects
//! need not have the same fields: a logger of several channels writes an object for each. Only the columns that the
//! contract or `--columns` names are then kept, and an object without any of them is no row. The file is read twice:
//! first for the columns, then for the rows.

use super::encoding::without_mark;
use super::format::{Input, LogFormat};
use super::lines::LineFile;
use crate::error::{DataError, quoted};
use crate::log_table::{LogTable, TableRows};
use crate::plan::Request;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;

/// Maximum nesting of a field. Deeper fields do not describe a joint.
const MAX_FIELD_DEPTH: usize = 16;

/// Maximum number of columns. More indicate that the names hold values.
const MAX_COLUMNS: usize = 10_000;

/// JSON lines.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_json_lines, read };

/// Returns true if the first line is an object, or the start of a long one.
fn is_json_lines(head: &[u8]) -> bool {
    let text = without_mark(head).trim_ascii_start();
    let line = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let is_whole = line.len() < text.len() || head.len() < super::format::HEAD_BYTES as usize;
    text.starts_with(b"{") && (parse(line).is_some() || !is_whole)
}

/// Parses a line as an object. Python writes `NaN` and `Infinity`, which JSON does not have; they become null.
fn parse(line: &[u8]) -> Option<Value> {
    let value = serde_json::from_slice(line).ok().or_else(|| {
        let text = std::str::from_utf8(line).ok()?;
        serde_json::from_str(&without_nan(text)).ok()
    });
    value.filter(Value::is_object)
}

/// Replaces `NaN`, `Infinity` and `-Infinity` outside of strings by `null`.
pub(super) fn without_nan(text: &str) -> String {
    let parts = text.split('"').collect::<Vec<_>>();
    let mut out = String::with_capacity(text.len());
    let mut is_string = false;
    for (at, part) in parts.iter().enumerate() {
        if is_string {
            out += part;
        } else {
            out += &part
                .replace("-Infinity", "null")
                .replace("Infinity", "null")
                .replace("NaN", "null");
        }
        if at + 1 < parts.len() {
            out.push('"');
            let escapes = part.bytes().rev().take_while(|byte| *byte == b'\\').count();
            is_string = !is_string || escapes % 2 == 1;
        }
    }
    out
}

/// How the elements of a list are named.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum ListNames {
    /// By their places: `q[1]`.
    Places,
    /// By the joints in the list `name` beside it, if it has as many: `position[elbow]`.
    Joints,
}

/// Calls `add` with the name and value of each field that is not an object or a list.
pub(super) fn each_field(
    name: &str,
    value: &Value,
    depth: usize,
    lists: ListNames,
    add: &mut dyn FnMut(&str, &Value),
) {
    if depth > MAX_FIELD_DEPTH {
        return;
    }
    match value {
        Value::Object(fields) => {
            let joints = fields.get("name").and_then(Value::as_array);
            let joints = joints.filter(|_| lists == ListNames::Joints);
            for (field, value) in fields {
                let name = if name.is_empty() { field.clone() } else { format!("{name}.{field}") };
                match (joints, value.as_array()) {
                    (Some(joints), Some(list)) if joints.len() == list.len() => {
                        for (joint, value) in joints.iter().zip(list) {
                            let joint = joint.as_str().unwrap_or_default();
                            each_field(&format!("{name}[{joint}]"), value, depth + 1, lists, add);
                        }
                    }
                    _ => each_field(&name, value, depth + 1, lists, add),
                }
            }
        }
        Value::Array(elements) => {
            for (at, value) in elements.iter().enumerate() {
                each_field(&format!("{name}[{at}]"), value, depth + 1, lists, add);
            }
        }
        value => add(name, value),
    }
}

/// The names of fields in the order of their first occurrence.
#[derive(Default)]
pub(super) struct FieldNames {
    pub names: Vec<String>,
    places: HashMap<String, usize>,
}

impl FieldNames {
    /// Returns the place of a name, which it adds if it is new.
    pub fn place(&mut self, name: &str) -> usize {
        if let Some(place) = self.places.get(name) {
            return *place;
        }
        self.places.insert(name.to_owned(), self.names.len());
        self.names.push(name.to_owned());
        self.names.len() - 1
    }
}

/// Returns a field as a number.
fn number(value: Option<&Value>) -> Option<f64> {
    match value? {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => fast_float2::parse(text.trim()).ok(),
        _ => None,
    }
}

/// Returns a field as text.
fn text(value: Option<&Value>) -> Cow<'_, [u8]> {
    match value {
        Some(Value::String(text)) => text.as_bytes().trim_ascii().into(),
        Some(Value::Null) | None => Cow::Borrowed(&[]),
        Some(value) => value.to_string().into_bytes().into(),
    }
}

/// Returns the fields of all objects, and the smallest number of fields of an object.
fn fields(input: &Input) -> Result<(FieldNames, usize), DataError> {
    let (mut columns, mut fewest) = (FieldNames::default(), usize::MAX);
    each_line(input, &|bytes| (input.request.progress)(bytes / 2), |_, line| {
        if let Some(object) = parse(line) {
            let mut fields = 0;
            each_field("", &object, 0, ListNames::Places, &mut |name, _| {
                fields += 1;
                columns.place(name);
            });
            fewest = fewest.min(fields);
        }
        if columns.names.len() <= MAX_COLUMNS {
            return Ok(());
        }
        let found = format!("more than {MAX_COLUMNS} fields");
        Err(DataError::file(input.request.path, found, "objects with the same fields"))
    })?;
    Ok((columns, fewest))
}

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Request { path, progress, .. } = input.request;
    let (mut columns, fewest) = fields(&input)?;
    let names = columns.names.clone();
    let count = names.len();
    let has_channels = fewest < count;
    let plan = match has_channels {
        true => input.request.plan_named(names, 0)?,
        false => input.request.plan(names.into())?,
    };
    let is_measured = plan.measured();
    let mut table = TableRows::new(path, plan);
    let mut ignored = 0_u64;
    let mut values = vec![None; count];
    let half = input.size / 2;
    each_line(&input, &|bytes| progress(half + bytes / 2), |line_number, line| {
        let Some(object) = parse(line) else {
            table.reject_row(line_number, None, quoted(line), "a JSON object");
            return Ok(());
        };
        values.fill(None);
        each_field("", &object, 0, ListNames::Places, &mut |name, value| {
            if let Some(place) = values.get_mut(columns.place(name)) {
                *place = Some(value.clone());
            }
        });
        let has_values = values.iter().zip(&is_measured).any(|(value, of)| *of && value.is_some());
        if has_channels && !has_values {
            ignored += 1;
            return Ok(());
        }
        table.add_row(
            line_number,
            |at| number(values[at].as_ref()),
            |at| text(values[at].as_ref()),
        );
        Ok(())
    })?;
    let mut table = table.finish();
    if ignored > 0 {
        let file = path.display();
        table
            .notes
            .push(format!("{file}: {ignored} objects have none of these columns and are no rows"));
    }
    Ok(table)
}

/// Calls `add` with the number and text of each line that is not blank.
fn each_line(
    input: &Input,
    progress: &dyn Fn(u64),
    mut add: impl FnMut(u64, &[u8]) -> Result<(), DataError>,
) -> Result<(), DataError> {
    let (path, file, max_bytes) = (input.request.path, &input.file, u64::MAX);
    LineFile { path, file, max_bytes }.each_line(progress, |number, line| {
        let text = without_mark(line).trim_ascii();
        if text.is_empty() { Ok(()) } else { add(number, text) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_field_with_nested_object_returns_dotted_names() {
        let object =
            parse(br#"{"t": 1, "data": {"q": [0.5, NaN], "note": "NaN \" NaN"}}"#).unwrap();
        let mut fields = Vec::new();
        each_field("", &object, 0, ListNames::Places, &mut |name, value| {
            fields.push(format!("{name}={value}"));
        });
        let expected = ["t=1", "data.q[0]=0.5", "data.q[1]=null", r#"data.note="NaN \" NaN""#];
        assert_eq!(fields, expected);
    }

    #[test]
    fn is_json_lines_with_object_in_first_line_returns_true() {
        assert!(is_json_lines(b"{\"t\": 0}\n{\"t\": 1}\n"));
        assert!(is_json_lines(b"\xef\xbb\xbf{\"t\": -Infinity}\n"));
        for text in ["{\n\"t\": 0}", "[{\"t\": 0}]", "{t},v\n", ""] {
            assert!(!is_json_lines(text.as_bytes()), "{text}");
        }
    }
}
