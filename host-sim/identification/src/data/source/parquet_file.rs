//! Parquet, made into rows again.
//!
//! Parquet keeps columns apart and packed, but a row is good or bad as a whole. So one reader per
//! needed column walks along, some thousand rows at a time, and the rows go through the same
//! `clean` as those of a CSV file; a null is an empty cell. Nothing larger than such a batch is
//! held beside the pages being unpacked.
//!
//! Read are the flat columns that pandas, polars and their like write: numbers, booleans (as the
//! words `true` and `false`), text, and dates with or without a time of day (as the text a CSV file would have:
//! one way with dates, to the nanosecond), packed by snappy, zstd or not at all. Lists, times of day and
//! decimals are no measurement this tool could use, and are left out by name.

use std::borrow::Cow;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use chrono::DateTime;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::{Input, Source};
use crate::data::clean::{Cleaner, FileData, Row};
use crate::data::dataset::LeftOutColumn;
use crate::data::error::{BadCell, DataError, one_line};
use crate::data::header::layout;
use crate::data::read::ReadOptions;

/// Rows unpacked at a time.
const BATCH: usize = 8 * 1024;

/// What a column is to us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Number {
        unsigned: bool,
    },
    Text,
    /// A point in time: so many nanoseconds a unit, since 1970.
    Date {
        unit_ns: i64,
    },
}

const SECOND_NS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * SECOND_NS;

/// Some rows of one column.
enum Batch {
    /// Null is NaN.
    Numbers(Vec<f64>),
    /// Null is empty.
    Texts(Vec<ByteArray>),
    /// The column is not read.
    Unread,
}

/// One row of the batches.
struct BatchRow<'a> {
    columns: &'a [Batch],
    row: usize,
}

impl Row for BatchRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        match &self.columns[column] {
            Batch::Numbers(values) => values.get(self.row).copied(),
            Batch::Texts(values) => {
                fast_float2::parse(values.get(self.row)?.data().trim_ascii()).ok()
            }
            Batch::Unread => None,
        }
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        match &self.columns[column] {
            Batch::Texts(values) => {
                values.get(self.row).map_or(&[][..], |value| value.data().trim_ascii()).into()
            }
            Batch::Numbers(values) => match values.get(self.row) {
                Some(value) if !value.is_nan() => value.to_string().into_bytes().into(),
                _ => Cow::Borrowed(&[]),
            },
            Batch::Unread => Cow::Borrowed(&[]),
        }
    }
}

/// Apache Parquet.
pub(super) const SOURCE: Source = Source { is_it: |head| head.starts_with(b"PAR1"), read };

/// Reads a file.
///
/// The `parquet` crate answers nearly every damaged file with an error, but a few (a page that
/// refers to a dictionary which is not there) with a panic. A user's file must not look like a
/// bug of this program, so that too becomes an error.
fn read(input: Input) -> Result<FileData, DataError> {
    let Input { path, file, size, options, progress, .. } = input;
    let share = |share: f64| progress((share * size as f64) as u64);
    let reading = AssertUnwindSafe(|| read_undamaged(path, file, options, &share));
    catch_unwind(reading).unwrap_or_else(|_| {
        Err(DataError::File {
            file: path.into(),
            found: "damaged data".into(),
            expected: "an intact Parquet file".into(),
        })
    })
}

fn read_undamaged(
    path: &Path,
    file: File,
    options: &ReadOptions,
    progress: &dyn Fn(f64),
) -> Result<FileData, DataError> {
    let failed = |error: ParquetError| DataError::File {
        file: path.into(),
        found: one_line(&error.to_string()),
        expected: "a Parquet file, packed by snappy, zstd or not at all".into(),
    };
    let reader = SerializedFileReader::new(file).map_err(failed)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> =
        schema.columns().iter().map(|column| column.path().parts().join(".")).collect();
    let kinds: Vec<Result<Kind, &str>> =
        schema.columns().iter().map(|column| kind(column)).collect();

    let mut layout = layout(path, names, options)?;
    let required = layout.required.iter().map(|reading| reading.index);
    for at in required.chain(layout.run) {
        if let Err(why) = kinds[at] {
            return Err(DataError::Cell(BadCell {
                file: path.into(),
                row: 1,
                column: layout.names[at].clone(),
                found: why.into(),
                expected: "a column of plain numbers or text".into(),
            }));
        }
    }
    layout.optional.retain(|column| match kinds[column.reading.index] {
        Ok(_) => true,
        Err(why) => {
            let name = layout.names[column.reading.index].clone();
            layout.left_out.push(LeftOutColumn { name, why: format!("it is {why}") });
            false
        }
    });
    let mut needed = vec![false; kinds.len()];
    layout.needed().for_each(|at| needed[at] = true);

    let total = reader.metadata().file_metadata().num_rows().max(1) as f64;
    let mut cleaner = Cleaner::new(path, layout);
    // As in the CSV file of the same table, whose header is row 1.
    let mut number = 1;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(failed)?;
        let mut readers = open(&*group, &kinds, &needed).map_err(failed)?;
        loop {
            let columns = next_batches(&mut readers).map_err(failed)?;
            let rows = rows_of(&columns).map_err(failed)?;
            if rows == 0 {
                break;
            }
            for row in 0..rows {
                number += 1;
                cleaner.take(number, &BatchRow { columns: &columns, row })?;
            }
            progress(((number - 1) as f64 / total).min(1.0));
        }
    }
    cleaner.finish()
}

/// What a column is, or why it cannot be read, as the end of "it is ..".
fn kind(column: &ColumnDescriptor) -> Result<Kind, &'static str> {
    use ConvertedType as Old;
    if column.max_rep_level() > 0 {
        return Err("a list");
    }
    let (logical, converted) = (column.logical_type_ref(), column.converted_type());
    if matches!(logical, Some(LogicalType::Decimal { .. })) || converted == Old::DECIMAL {
        return Err("a decimal number");
    }
    let unit = |unit: &TimeUnit| match unit {
        TimeUnit::MILLIS => SECOND_NS / 1_000,
        TimeUnit::MICROS => SECOND_NS / 1_000_000,
        TimeUnit::NANOS => 1,
    };
    match (column.physical_type(), logical) {
        (Physical::INT64, Some(LogicalType::Timestamp(of))) => {
            return Ok(Kind::Date { unit_ns: unit(&of.unit) });
        }
        (Physical::INT32, Some(LogicalType::Date)) => return Ok(Kind::Date { unit_ns: DAY_NS }),
        // What Spark and old versions of pandas write for a date.
        (Physical::INT96, _) => return Ok(Kind::Date { unit_ns: 1 }),
        _ => {}
    }
    match converted {
        Old::TIMESTAMP_MILLIS => return Ok(Kind::Date { unit_ns: SECOND_NS / 1_000 }),
        Old::TIMESTAMP_MICROS => return Ok(Kind::Date { unit_ns: SECOND_NS / 1_000_000 }),
        Old::DATE => return Ok(Kind::Date { unit_ns: DAY_NS }),
        _ => {}
    }
    match (column.physical_type(), logical) {
        (Physical::FLOAT | Physical::DOUBLE, _) => Ok(Kind::Number { unsigned: false }),
        (Physical::BOOLEAN | Physical::BYTE_ARRAY, _) => Ok(Kind::Text),
        (Physical::INT32 | Physical::INT64, None | Some(LogicalType::Integer { .. })) => {
            match converted {
                Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64 => {
                    Ok(Kind::Number { unsigned: true })
                }
                Old::NONE | Old::INT_8 | Old::INT_16 | Old::INT_32 | Old::INT_64 => {
                    Ok(Kind::Number { unsigned: false })
                }
                _ => Err("a time of day"),
            }
        }
        (Physical::INT32 | Physical::INT64, Some(_)) => Err("a time of day"),
        _ => Err("of a binary type"),
    }
}

/// A needed column, being read.
struct Reader {
    values: ColumnReader,
    kind: Kind,
    /// The level that says that a value is there; lower ones are nulls.
    there: i16,
}

/// Readers for the needed columns of a row group.
fn open(
    group: &dyn RowGroupReader,
    kinds: &[Result<Kind, &str>],
    needed: &[bool],
) -> Result<Vec<Option<Reader>>, ParquetError> {
    let open = |(at, (kind, needed)): (usize, (&Result<Kind, &str>, &bool))| {
        let about = group.metadata().column(at);
        let start = about.dictionary_page_offset().unwrap_or(about.data_page_offset());
        match kind {
            Ok(_) if *needed && (start < 0 || about.compressed_size() < 0) => {
                Err(ParquetError::General("a column that starts before the file".into()))
            }
            Ok(kind) if *needed => Ok(Some(Reader {
                values: group.get_column_reader(at)?,
                kind: *kind,
                there: about.column_descr().max_def_level(),
            })),
            _ => Ok(None),
        }
    };
    kinds.iter().zip(needed).enumerate().map(open).collect()
}

fn next_batches(readers: &mut [Option<Reader>]) -> Result<Vec<Batch>, ParquetError> {
    let batch = |reader: &mut Option<Reader>| reader.as_mut().map_or(Ok(Batch::Unread), next_batch);
    readers.iter_mut().map(batch).collect()
}

fn next_batch(reader: &mut Reader) -> Result<Batch, ParquetError> {
    let Reader { values, kind, there } = reader;
    let (there, unsigned) = (*there, *kind == Kind::Number { unsigned: true });
    let unit_ns = if let Kind::Date { unit_ns } = *kind { Some(unit_ns) } else { None };
    let empty = ByteArray::from("");
    Ok(match (values, unit_ns) {
        (ColumnReader::Int32ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, there, empty, |&v| date(i64::from(v), unit_ns))?)
        }
        (ColumnReader::Int64ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, there, empty, |&v| date(v, unit_ns))?)
        }
        (ColumnReader::Int96ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, there, empty, |v| date(v.to_nanos(), unit_ns))?)
        }
        (values, _) => numbers_or_text(values, unsigned, there)?,
    })
}

/// A date as text; empty where no calendar has it.
fn date(count: i64, unit_ns: i64) -> ByteArray {
    let ns = i128::from(count) * i128::from(unit_ns);
    let second = i128::from(SECOND_NS);
    let stamp = i64::try_from(ns.div_euclid(second))
        .ok()
        .and_then(|seconds| DateTime::from_timestamp(seconds, ns.rem_euclid(second) as u32));
    let text = stamp.map(|stamp| stamp.format("%Y-%m-%dT%H:%M:%S%.9fZ").to_string());
    ByteArray::from(text.unwrap_or_default().into_bytes())
}

fn numbers_or_text(
    values: &mut ColumnReader,
    unsigned: bool,
    there: i16,
) -> Result<Batch, ParquetError> {
    let nan = f64::NAN;
    let empty = ByteArray::from("");
    Ok(match values {
        ColumnReader::DoubleColumnReader(values) => {
            Batch::Numbers(spread(values, there, nan, |&v| v)?)
        }
        ColumnReader::FloatColumnReader(values) => {
            Batch::Numbers(spread(values, there, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int32ColumnReader(values) if unsigned => {
            Batch::Numbers(spread(values, there, nan, |&v| f64::from(v.cast_unsigned()))?)
        }
        ColumnReader::Int32ColumnReader(values) => {
            Batch::Numbers(spread(values, there, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int64ColumnReader(values) if unsigned => {
            Batch::Numbers(spread(values, there, nan, |&v| v.cast_unsigned() as f64)?)
        }
        ColumnReader::Int64ColumnReader(values) => {
            Batch::Numbers(spread(values, there, nan, |&v| v as f64)?)
        }
        ColumnReader::BoolColumnReader(values) => {
            let word = |&v: &bool| ByteArray::from(if v { "true" } else { "false" });
            Batch::Texts(spread(values, there, empty, word)?)
        }
        ColumnReader::ByteArrayColumnReader(values) => {
            Batch::Texts(spread(values, there, empty, ByteArray::clone)?)
        }
        _ => Batch::Unread,
    })
}

/// The next rows of a column, with `null` in the places that hold none: Parquet itself stores
/// only what is there, and a level per row that says whether it is.
fn spread<T: DataType, V: Clone>(
    reader: &mut ColumnReaderImpl<T>,
    there: i16,
    null: V,
    convert: impl Fn(&T::T) -> V,
) -> Result<Vec<V>, ParquetError> {
    let (mut stored, mut levels) = (Vec::with_capacity(BATCH), Vec::with_capacity(BATCH));
    reader.read_records(BATCH, Some(&mut levels), None, &mut stored)?;
    let mut stored = stored.iter().map(convert);
    if there == 0 {
        return Ok(stored.collect());
    }
    let next = |&level: &i16| if level == there { stored.next() } else { None };
    Ok(levels.iter().map(next).map(|value| value.unwrap_or_else(|| null.clone())).collect())
}

/// The number of rows all batches have.
fn rows_of(columns: &[Batch]) -> Result<usize, ParquetError> {
    let mut rows = None;
    for column in columns {
        let length = match column {
            Batch::Numbers(values) => values.len(),
            Batch::Texts(values) => values.len(),
            Batch::Unread => continue,
        };
        if *rows.get_or_insert(length) != length {
            return Err(ParquetError::General("columns of different length".into()));
        }
    }
    Ok(rows.unwrap_or(0))
}
