//! MCAP files of ROS 2 and Foxglove: messages of several topics as rows.
//!
//! Each message becomes a row that holds only its own numbers; `close` merges the channels. A column is named by topic
//! and field, `/joint_states.velocity[1]`. If the message also lists joint names, the name replaces the index:
//! `/joint_states.velocity[elbow]`. A field with a contract name keeps that name. The time is the header's stamp, or
//! the time at which the message was logged. CDR (the encoding of ROS 2) and JSON are supported. Only columns that
//! the contract or `--columns` names are kept: a robot's log has hundreds.

use super::cdr::Definition;
use super::format::{Input, LogFormat, is_mcap};
use super::json_lines::{FieldNames, ListNames, each_field};
use crate::contract;
use crate::error::{DataError, one_line};
use crate::log_table::{LogTable, TableRows};
use crate::mixed_cells::Need;
use mcap::{McapError, Message, MessageStream};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Read;

/// MCAP.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_mcap, read };

/// Name of the time column, as in the plain-text logs of ROS: nanoseconds.
const TIME: &str = "%time";

/// The numbers of a message.
struct MessageRow {
    time_ns: i128,
    values: Vec<(usize, f64)>,
}

impl MessageRow {
    fn number(&self, column: usize) -> Option<f64> {
        if column == 0 {
            return Some(self.time_ns as f64);
        }
        self.values.iter().find(|(of, _)| *of == column).map(|(_, value)| *value)
    }

    fn text(&self, column: usize) -> Cow<'static, [u8]> {
        let value = || self.number(column).map(|value| value.to_string()).unwrap_or_default();
        let text = if column == 0 { self.time_ns.to_string() } else { value() };
        text.into_bytes().into()
    }
}

/// The messages of a file as a table.
#[derive(Default)]
struct MessageTable {
    fields: FieldNames,
    rows: Vec<MessageRow>,
    definitions: HashMap<u16, Definition>,
    /// Number of messages that are damaged or in an unsupported encoding.
    ignored: usize,
}

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Input { request, mut file, size, .. } = input;
    let path = request.path;
    let io = |source| DataError::Io { file: path.into(), source };
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(io)?;
    let failed = |error: McapError| {
        DataError::file(
            path,
            one_line(&error.to_string()),
            "an intact MCAP file, uncompressed or compressed with zstd or lz4",
        )
    };
    let mut table = MessageTable::default();
    table.fields.place(TIME);
    for message in MessageStream::new(&bytes).map_err(failed)? {
        table.add_message(&message.map_err(failed)?);
    }
    drop(bytes);
    (request.progress)(size);
    let MessageTable { fields, mut rows, ignored, .. } = table;
    rows.sort_by_key(|row| row.time_ns);
    let plan = request.plan_named(fields.names, 1)?;
    let needs = plan.needs.clone();
    let mut table = TableRows::new(path, plan);
    for (number, row) in rows.into_iter().enumerate() {
        // A message without a needed column makes no row.
        if row.values.iter().any(|(column, _)| needs[*column] != Need::Skip) {
            table.add_row(number as u64 + 1, |at| row.number(at), |at| row.text(at));
        }
    }
    let mut table = table.finish();
    if ignored > 0 {
        table.notes.push(format!(
            "{}: {ignored} messages are ignored: they are damaged, or neither CDR nor JSON",
            path.display()
        ));
    }
    Ok(table)
}

impl MessageTable {
    fn add_message(&mut self, message: &Message) {
        let channel = &message.channel;
        let value = match channel.message_encoding.as_str() {
            "json" => serde_json::from_slice(&message.data).ok(),
            "cdr" => channel.schema.as_ref().and_then(|schema| {
                let definition = self
                    .definitions
                    .entry(schema.id)
                    .or_insert_with(|| Definition::parse(&String::from_utf8_lossy(&schema.data)));
                definition.decode(&message.data)
            }),
            _ => None,
        };
        let Some(value) = value else {
            self.ignored += 1;
            return;
        };
        let time_ns = header_stamp_ns(&value).unwrap_or_else(|| i128::from(message.log_time));
        let mut row = MessageRow { time_ns, values: Vec::new() };
        each_field("", &value, 0, ListNames::Joints, &mut |path, value| {
            let Some(value) = value.as_f64() else { return };
            let is_contract = contract::names().any(|name| name == path && name != contract::TIME);
            let column = match is_contract {
                true => self.fields.place(path),
                false => self.fields.place(&format!("{}.{path}", channel.topic)),
            };
            row.values.push((column, value));
        });
        self.rows.push(row);
    }
}

/// Returns the stamp in a message's header, ns, if it is set.
fn header_stamp_ns(value: &Value) -> Option<i128> {
    let stamp = value.pointer("/header/stamp")?;
    let seconds = stamp.get("sec").or_else(|| stamp.get("secs"))?.as_i64()?;
    let rest = ["nanosec", "nsec", "nsecs"].iter().find_map(|name| stamp.get(name))?.as_i64()?;
    let stamp = i128::from(seconds) * 1_000_000_000 + i128::from(rest);
    (stamp > 0).then_some(stamp)
}
