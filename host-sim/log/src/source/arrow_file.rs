//! Arrow IPC: files (Feather of version 2) and streams.
//!
//! A null is an empty cell. Numbers, booleans, text, categories and dates are read; lists, structures and decimals are left
//! out by name. Memory holds one batch.

use super::arrow_messages::check_lengths;
use super::format::{
    ARROW_FILE_MARK as FILE_MARK, DAY_NS, Input, LogFormat, SECOND_NS, is_arrow, read_damaged,
};
use crate::error::{DataError, one_line};
use crate::log_table::LogTable;
use crate::mixed_cells::Need;
use crate::table::Cells;
use arrow_array::cast::AsArray;
use arrow_array::types as of;
use arrow_array::{Array, ArrowPrimitiveType, Int64Array};
use arrow_ipc::reader::StreamReader;
use arrow_schema::{ArrowError, DataType, TimeUnit};
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Arrow IPC.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_arrow, read };

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    read_damaged(input.request.path, "an intact Arrow file", || open(&input))
}

fn open(input: &Input) -> Result<LogTable<'static>, DataError> {
    let request = input.request;
    let failed = |error: ArrowError| failed(request.path, &error);
    // A file is a stream between marks, with an index that is not needed here.
    let is_file = input.head.starts_with(FILE_MARK);
    if is_file && !ends_in_mark(&input.file) {
        return Err(DataError::file(request.path, "an Arrow file without its end", EXPECTED));
    }
    let start = if is_file { stream_start(input.head) } else { 0 };
    check_lengths(&input.file, start).map_err(|error| failed(error.into()))?;
    let mut file = BufReader::new(&input.file);
    file.seek(SeekFrom::Start(start)).map_err(|error| failed(error.into()))?;
    let reader = StreamReader::try_new(file, None).map_err(failed)?;
    let schema = reader.schema();
    let fields = schema.fields().iter();
    let unreadable = fields.clone().map(|field| unreadable(field.data_type()).map(str::to_owned));
    let names = fields.map(|field| field.name().clone()).collect();
    let plan = request.plan_columns(names, unreadable.collect())?;
    let mut columns = vec![Cells::NOT_READ; plan.needs.len()];
    let mut rows = 0;
    for batch in reader {
        (request.progress)(input.size * u64::from(rows > 0) / 2);
        let batch = batch.map_err(failed)?;
        rows += batch.num_rows();
        let needed = columns.iter_mut().zip(batch.columns()).zip(&plan.needs);
        for ((column, array), _) in needed.filter(|(_, need)| **need != Need::Skip) {
            column.append(cells(array));
        }
        if rows >= plan.max_rows() {
            break;
        }
    }
    Ok(LogTable::of_columns(&request, plan, columns.into_iter().map(Cow::Owned)))
}

/// Returns the start of the stream in a file: after the mark and zeros for alignment, which writers choose.
fn stream_start(head: &[u8]) -> u64 {
    let zeros = head[FILE_MARK.len()..].iter().take_while(|byte| **byte == 0).count();
    (FILE_MARK.len() + zeros) as u64
}

fn failed(path: &Path, error: &ArrowError) -> DataError {
    DataError::file(path, one_line(&error.to_string()), EXPECTED)
}

/// What is expected instead of a damaged file.
const EXPECTED: &str = "an intact Arrow file, uncompressed or compressed with lz4 or zstd";

/// Returns true if a file ends in its mark, and goes back to its start.
fn ends_in_mark(mut file: &File) -> bool {
    let mut end = [0; FILE_MARK.len()];
    let from_end = SeekFrom::End(-(FILE_MARK.len() as i64));
    let is_read = file.seek(from_end).is_ok() && file.read_exact(&mut end).is_ok();
    file.rewind().is_ok() && is_read && end == *FILE_MARK
}

/// Returns why a column cannot be read, as the end of "it is ..".
fn unreadable(kind: &DataType) -> Option<&'static str> {
    use DataType as Is;
    match kind {
        Is::List(_) | Is::LargeList(_) | Is::FixedSizeList(..) | Is::ListView(_) => Some("a list"),
        Is::Struct(_) | Is::Map(..) | Is::Union(..) => Some("a structure"),
        Is::Decimal32(..) | Is::Decimal64(..) | Is::Decimal128(..) | Is::Decimal256(..) => {
            Some("a decimal number")
        }
        Is::Time32(_) | Is::Time64(_) | Is::Interval(_) => Some("a time of day"),
        Is::Dictionary(_, inside) => match **inside {
            Is::Utf8 | Is::LargeUtf8 => None,
            _ => Some("of a category type"),
        },
        Is::Null | Is::Boolean | Is::Utf8 | Is::LargeUtf8 | Is::Utf8View => None,
        Is::Timestamp(..) | Is::Date32 | Is::Date64 | Is::Duration(_) => None,
        kind if kind.is_numeric() => None,
        _ => Some("of a binary type"),
    }
}

/// Returns the nanoseconds of a unit.
fn unit_ns(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::Second => SECOND_NS,
        TimeUnit::Millisecond => SECOND_NS / 1_000,
        TimeUnit::Microsecond => SECOND_NS / 1_000_000,
        TimeUnit::Nanosecond => 1,
    }
}

/// Returns the cells of a column.
fn cells(array: &dyn Array) -> Cells {
    use DataType as Is;
    match array.data_type() {
        Is::Float64 => numbers::<of::Float64Type>(array, |v| v),
        Is::Float32 => numbers::<of::Float32Type>(array, f64::from),
        Is::Float16 => numbers::<of::Float16Type>(array, f64::from),
        Is::Int64 => Cells::Integers(array.as_primitive::<of::Int64Type>().iter().collect()),
        Is::Int32 => numbers::<of::Int32Type>(array, f64::from),
        Is::Int16 => numbers::<of::Int16Type>(array, f64::from),
        Is::Int8 => numbers::<of::Int8Type>(array, f64::from),
        Is::UInt64 => numbers::<of::UInt64Type>(array, |v| v as f64),
        Is::UInt32 => numbers::<of::UInt32Type>(array, f64::from),
        Is::UInt16 => numbers::<of::UInt16Type>(array, f64::from),
        Is::UInt8 => numbers::<of::UInt8Type>(array, f64::from),
        Is::Duration(unit) => {
            let seconds = unit_ns(*unit) as f64 / 1e9;
            numbers::<of::Int64Type>(&counts(array), |v| v as f64 * seconds)
        }
        Is::Timestamp(unit, _) => dates::<of::Int64Type>(&counts(array), unit_ns(*unit)),
        Is::Null => Cells::NOT_READ,
        Is::Date32 => dates::<of::Date32Type>(array, DAY_NS),
        Is::Date64 => dates::<of::Date64Type>(array, SECOND_NS / 1_000),
        _ => texts(array),
    }
}

/// Returns the numbers of a column of times, which are whole numbers of a unit.
fn counts(array: &dyn Array) -> Int64Array {
    Int64Array::from(
        array.to_data().into_builder().data_type(DataType::Int64).build().expect("i64"),
    )
}

fn numbers<T: ArrowPrimitiveType>(array: &dyn Array, convert: impl Fn(T::Native) -> f64) -> Cells {
    let values = array.as_primitive::<T>().iter();
    Cells::Numbers(values.map(|value| value.map_or(f64::NAN, &convert)).collect())
}

fn dates<T: ArrowPrimitiveType<Native: Into<i64>>>(array: &dyn Array, unit_ns: i64) -> Cells {
    let stamp = |count: Option<T::Native>| count?.into().checked_mul(unit_ns);
    Cells::Stamps(array.as_primitive::<T>().iter().map(stamp).collect())
}

fn texts(array: &dyn Array) -> Cells {
    let owned = |text: Option<&str>| text.unwrap_or_default().to_owned();
    let rows = 0..array.len();
    Cells::Texts(match array.data_type() {
        DataType::Boolean => {
            let word = |v: Option<bool>| v.map_or("", |v| if v { "true" } else { "false" }).into();
            array.as_boolean().iter().map(word).collect()
        }
        DataType::Utf8 => array.as_string::<i32>().iter().map(owned).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(owned).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(owned).collect(),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let Cells::Texts(words) = texts(dictionary.values()) else { return Cells::NOT_READ };
            // An empty dictionary has no keys to normalise.
            let keys = if words.is_empty() { Vec::new() } else { dictionary.normalized_keys() };
            let word = |row| match keys.get(row) {
                Some(key) if !dictionary.is_null(row) => words[*key].clone(),
                _ => String::new(),
            };
            rows.map(word).collect()
        }
        _ => rows.map(|_| String::new()).collect(),
    })
}
