//! Arrow IPC as a source of rows: files (Feather of version 2) and streams.
//!
//! Rows go through the same validation (`clean`) as those of a CSV file. A null is an empty cell. Numbers, booleans,
//! text, categories and dates are read; lists, structures and decimals are left out by name. Memory holds one batch.

use super::arrow_messages::check_lengths;
use super::date_text::{DAY_NS, SECOND_NS, date_text};
use super::format::{ARROW_FILE_MARK as FILE_MARK, Input, LogFormat, is_arrow};
use crate::clean::{Cleaner, FileData};
use crate::dataset::LeftOutColumn;
use crate::error::{BadCell, DataError, one_line};
use crate::header::layout;
use crate::row::LogRow;
use arrow_array::cast::AsArray;
use arrow_array::types as of;
use arrow_array::{Array, ArrowPrimitiveType, RecordBatch};
use arrow_ipc::reader::StreamReader;
use arrow_schema::{ArrowError, DataType, SchemaRef, TimeUnit};
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Arrow IPC.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_arrow, read };

/// The values of a column in one batch.
enum Values {
    /// Null is NaN.
    Numbers(Vec<f64>),
    /// Null is empty.
    Texts(Vec<String>),
    /// The column is not needed.
    NotRead,
}

/// One row of a batch.
struct ArrowRow<'a> {
    columns: &'a [Values],
    row: usize,
}

impl LogRow for ArrowRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        match &self.columns[column] {
            Values::Numbers(values) => values.get(self.row).copied(),
            Values::Texts(values) => fast_float2::parse(values.get(self.row)?.trim()).ok(),
            Values::NotRead => None,
        }
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        match &self.columns[column] {
            Values::Texts(values) => {
                values.get(self.row).map_or(&[][..], |text| text.as_bytes().trim_ascii()).into()
            }
            Values::Numbers(values) => match values.get(self.row) {
                Some(value) if !value.is_nan() => value.to_string().into_bytes().into(),
                _ => Cow::Borrowed(&[]),
            },
            Values::NotRead => Cow::Borrowed(&[]),
        }
    }
}

/// Reads a file. As for Parquet, a damaged file that makes the library panic becomes an error.
fn read(input: Input) -> Result<FileData, DataError> {
    let path = input.path;
    catch_unwind(AssertUnwindSafe(|| open(input))).unwrap_or_else(|_| {
        Err(DataError::File {
            file: path.into(),
            found: "damaged data".into(),
            expected: "an intact Arrow file".into(),
        })
    })
}

fn open(input: Input) -> Result<FileData, DataError> {
    let failed = |error: ArrowError| failed(input.path, &error);
    let file = BufReader::new(
        input
            .file
            .try_clone()
            .map_err(|source| DataError::Io { file: input.path.into(), source })?,
    );
    // A file is a stream between marks, with an index that is not needed here.
    let is_file = input.head.starts_with(FILE_MARK);
    if is_file && !ends_in_mark(&input.file) {
        return Err(DataError::File {
            file: input.path.into(),
            found: "an Arrow file without its end".into(),
            expected: EXPECTED.into(),
        });
    }
    let start = if is_file { stream_start(input.head) } else { 0 };
    check_lengths(&input.file, start).map_err(|error| failed(error.into()))?;
    let mut file = BufReader::new(file);
    file.seek(SeekFrom::Start(start)).map_err(|error| failed(error.into()))?;
    let reader = StreamReader::try_new(file, None).map_err(failed)?;
    let schema = reader.schema();
    read_batches(&input, &schema, reader)
}

/// Returns the start of the stream in a file: after the mark and zeros for alignment, which writers choose.
fn stream_start(head: &[u8]) -> u64 {
    let zeros = head[FILE_MARK.len()..].iter().take_while(|byte| **byte == 0).count();
    (FILE_MARK.len() + zeros) as u64
}

fn failed(path: &Path, error: &ArrowError) -> DataError {
    DataError::File {
        file: path.into(),
        found: one_line(&error.to_string()),
        expected: EXPECTED.into(),
    }
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

fn read_batches(
    input: &Input,
    schema: &SchemaRef,
    batches: impl Iterator<Item = Result<RecordBatch, ArrowError>>,
) -> Result<FileData, DataError> {
    let path = input.path;
    let names: Vec<String> = schema.fields().iter().map(|field| field.name().clone()).collect();
    let refusals: Vec<Option<&str>> =
        schema.fields().iter().map(|field| unreadable(field.data_type())).collect();
    let mut layout = layout(path, names, input.options)?;
    let required = layout.required.iter().map(|reading| reading.index);
    let required: Vec<usize> = required.chain(layout.run).filter(|_| !layout.is_survey).collect();
    for at in required {
        if let Some(why) = refusals[at] {
            return Err(DataError::Cell(BadCell {
                file: path.into(),
                row: 1,
                column: layout.names[at].clone(),
                found: why.into(),
                expected: "a column of plain numbers or text".into(),
            }));
        }
    }
    layout.optional.retain(|column| match refusals[column.reading.index] {
        None => true,
        Some(why) => {
            let name = layout.names[column.reading.index].clone();
            layout.left_out.push(LeftOutColumn { name, why: format!("it is {why}") });
            false
        }
    });
    let mut needed = vec![false; refusals.len()];
    layout.needed().filter(|at| *at < refusals.len()).for_each(|at| needed[at] = true);
    let mut cleaner = Cleaner::new(path, layout);
    // Row numbers are those of the same table as a CSV file, whose header is row 1.
    let mut number = 1;
    for batch in batches {
        let batch = batch.map_err(|error| failed(path, &error))?;
        let columns = batch.columns().iter().zip(needed.iter().zip(&refusals));
        let read =
            |(array, (needed, refusal)): (&arrow_array::ArrayRef, (&bool, &Option<&str>))| {
                if *needed && refusal.is_none() { values(array) } else { Values::NotRead }
            };
        let columns: Vec<Values> = columns.map(read).collect();
        for row in 0..batch.num_rows() {
            number += 1;
            cleaner.add_row(number, &ArrowRow { columns: &columns, row })?;
        }
    }
    (input.progress)(input.size);
    cleaner.finish()
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

/// Returns the values of a column.
fn values(array: &dyn Array) -> Values {
    use DataType as Is;
    match array.data_type() {
        Is::Float64 => numbers::<of::Float64Type>(array, |v| v),
        Is::Float32 => numbers::<of::Float32Type>(array, f64::from),
        Is::Float16 => numbers::<of::Float16Type>(array, f64::from),
        Is::Int64 => numbers::<of::Int64Type>(array, |v| v as f64),
        Is::Int32 => numbers::<of::Int32Type>(array, f64::from),
        Is::Int16 => numbers::<of::Int16Type>(array, f64::from),
        Is::Int8 => numbers::<of::Int8Type>(array, f64::from),
        Is::UInt64 => numbers::<of::UInt64Type>(array, |v| v as f64),
        Is::UInt32 => numbers::<of::UInt32Type>(array, f64::from),
        Is::UInt16 => numbers::<of::UInt16Type>(array, f64::from),
        Is::UInt8 => numbers::<of::UInt8Type>(array, f64::from),
        Is::Duration(unit) => {
            let seconds = unit_ns(*unit) as f64 / 1e9;
            match unit {
                TimeUnit::Second => numbers::<of::DurationSecondType>(array, |v| v as f64),
                TimeUnit::Millisecond => {
                    numbers::<of::DurationMillisecondType>(array, |v| v as f64 * seconds)
                }
                TimeUnit::Microsecond => {
                    numbers::<of::DurationMicrosecondType>(array, |v| v as f64 * seconds)
                }
                TimeUnit::Nanosecond => {
                    numbers::<of::DurationNanosecondType>(array, |v| v as f64 * seconds)
                }
            }
        }
        Is::Timestamp(unit, _) => {
            let ns = unit_ns(*unit);
            match unit {
                TimeUnit::Second => dates::<of::TimestampSecondType>(array, ns),
                TimeUnit::Millisecond => dates::<of::TimestampMillisecondType>(array, ns),
                TimeUnit::Microsecond => dates::<of::TimestampMicrosecondType>(array, ns),
                TimeUnit::Nanosecond => dates::<of::TimestampNanosecondType>(array, ns),
            }
        }
        Is::Null => Values::NotRead,
        Is::Date32 => dates::<of::Date32Type>(array, DAY_NS),
        Is::Date64 => dates::<of::Date64Type>(array, SECOND_NS / 1_000),
        _ => texts(array),
    }
}

fn numbers<T: ArrowPrimitiveType>(array: &dyn Array, convert: impl Fn(T::Native) -> f64) -> Values {
    let values = array.as_primitive::<T>().iter();
    Values::Numbers(values.map(|value| value.map_or(f64::NAN, &convert)).collect())
}

fn dates<T: ArrowPrimitiveType<Native: Into<i64>>>(array: &dyn Array, unit_ns: i64) -> Values {
    let text = |count: Option<T::Native>| {
        count.map(|count| date_text(count.into(), unit_ns)).unwrap_or_default()
    };
    Values::Texts(array.as_primitive::<T>().iter().map(text).collect())
}

fn texts(array: &dyn Array) -> Values {
    let owned = |text: Option<&str>| text.unwrap_or_default().to_owned();
    let rows = 0..array.len();
    Values::Texts(match array.data_type() {
        DataType::Boolean => {
            let word = |v: Option<bool>| v.map_or("", |v| if v { "true" } else { "false" }).into();
            array.as_boolean().iter().map(word).collect()
        }
        DataType::Utf8 => array.as_string::<i32>().iter().map(owned).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(owned).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(owned).collect(),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let Values::Texts(words) = texts(dictionary.values()) else { return Values::NotRead };
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
