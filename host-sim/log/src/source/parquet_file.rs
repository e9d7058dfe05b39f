//! Parquet files as a source of rows.
//!
//! Parquet stores columns separately and compressed, but a row is accepted or rejected as a whole. So one reader per
//! needed column advances some thousand rows at a time, and the rows go through the same validation (`clean`) as those
//! of a CSV file. A null is an empty cell. Memory holds one such batch and the pages being decompressed.
//!
//! Supported are the flat columns that pandas, polars and similar tools write: numbers, booleans (as the words `true`
//! and `false`), text, and dates with or without a time of day (as the text of a CSV file, to the nanosecond),
//! uncompressed or compressed with snappy, zstd or brotli. Lists, times of day and decimals are not measurements and are left
//! out by name.

use std::borrow::Cow;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::date_text::{DAY_NS, SECOND_NS, date_text};
use super::format::{Input, LogFormat, is_parquet};
use super::parquet_zstd::ZstdPages;
use crate::clean::{Cleaner, FileData};
use crate::dataset::LeftOutColumn;
use crate::error::{BadCell, DataError, one_line};
use crate::header::layout;
use crate::options::ReadOptions;
use crate::row::LogRow;
use crate::work::Cancelled;

/// Rows that are decompressed at a time.
const BATCH_ROWS: usize = 8 * 1024;

/// How the values of a column are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ColumnType {
    Number {
        unsigned: bool,
    },
    Text,
    /// A point in time: a count of units since 1970, each of `unit_ns` nanoseconds.
    Date {
        unit_ns: i64,
    },
}

/// Consecutive rows of one column.
enum Batch {
    /// Null is NaN.
    Numbers(Vec<f64>),
    /// Null is empty.
    Texts(Vec<ByteArray>),
    /// The column is not needed.
    NotRead,
}

/// One row of the batches of all columns.
struct BatchRow<'a> {
    columns: &'a [Batch],
    row: usize,
}

impl LogRow for BatchRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        match &self.columns[column] {
            Batch::Numbers(values) => values.get(self.row).copied(),
            Batch::Texts(values) => {
                fast_float2::parse(values.get(self.row)?.data().trim_ascii()).ok()
            }
            Batch::NotRead => None,
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
            Batch::NotRead => Cow::Borrowed(&[]),
        }
    }
}

/// Apache Parquet.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_parquet, read };

/// Reads a file.
///
/// The `parquet` crate reports nearly every damaged file as an error, but a few with a panic, for example a page that
/// refers to a missing dictionary. A damaged file must not look like a defect of this program, so a panic becomes an
/// error too.
fn read(input: Input) -> Result<FileData, DataError> {
    let Input { path, file, size, options, progress, .. } = input;
    let share = |share: f64| progress((share * size as f64) as u64);
    let reading = AssertUnwindSafe(|| read_table(path, file, options, &share));
    catch_unwind(reading).unwrap_or_else(|panic| {
        if panic.is::<Cancelled>() {
            resume_unwind(panic);
        }
        Err(DataError::File {
            file: path.into(),
            found: "damaged data".into(),
            expected: "an intact Parquet file".into(),
        })
    })
}

fn read_table(
    path: &Path,
    file: File,
    options: &ReadOptions,
    progress: &dyn Fn(f64),
) -> Result<FileData, DataError> {
    let failed = |error: ParquetError| DataError::File {
        file: path.into(),
        found: one_line(&error.to_string()),
        expected: "a Parquet file, uncompressed or compressed with snappy, zstd or brotli".into(),
    };
    let pages = file.try_clone().map_err(|error| failed(error.into()))?;
    let reader = SerializedFileReader::new(file).map_err(failed)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> =
        schema.columns().iter().map(|column| column.path().parts().join(".")).collect();
    let kinds: Vec<Result<ColumnType, &str>> =
        schema.columns().iter().map(|column| column_type(column)).collect();

    let mut layout = layout(path, names, options)?;
    let required = layout.required.iter().map(|reading| reading.index);
    let required: Vec<usize> = required.chain(layout.run).filter(|_| !layout.is_survey).collect();
    for at in required {
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
    // Row numbers are those of the same table as a CSV file, whose header is row 1.
    let mut number = 1;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(failed)?;
        let mut readers = open_readers(&pages, &*group, &kinds, &needed).map_err(failed)?;
        loop {
            let columns = next_batches(&mut readers).map_err(failed)?;
            let rows = rows_of(&columns).map_err(failed)?;
            if rows == 0 {
                break;
            }
            for row in 0..rows {
                number += 1;
                cleaner.add_row(number, &BatchRow { columns: &columns, row })?;
            }
            progress(((number - 1) as f64 / total).min(1.0));
        }
    }
    cleaner.finish()
}

/// Returns the type of a column, or why it cannot be read, as the end of "it is ..".
fn column_type(column: &ColumnDescriptor) -> Result<ColumnType, &'static str> {
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
            return Ok(ColumnType::Date { unit_ns: unit(&of.unit) });
        }
        (Physical::INT32, Some(LogicalType::Date)) => {
            return Ok(ColumnType::Date { unit_ns: DAY_NS });
        }
        // Spark and old versions of pandas write dates as INT96.
        (Physical::INT96, _) => return Ok(ColumnType::Date { unit_ns: 1 }),
        _ => {}
    }
    match converted {
        Old::TIMESTAMP_MILLIS => return Ok(ColumnType::Date { unit_ns: SECOND_NS / 1_000 }),
        Old::TIMESTAMP_MICROS => return Ok(ColumnType::Date { unit_ns: SECOND_NS / 1_000_000 }),
        Old::DATE => return Ok(ColumnType::Date { unit_ns: DAY_NS }),
        _ => {}
    }
    match (column.physical_type(), logical) {
        (Physical::FLOAT | Physical::DOUBLE, _) => Ok(ColumnType::Number { unsigned: false }),
        (Physical::BOOLEAN | Physical::BYTE_ARRAY, _) => Ok(ColumnType::Text),
        (Physical::INT32 | Physical::INT64, None | Some(LogicalType::Integer { .. })) => {
            match converted {
                Old::UINT_8 | Old::UINT_16 | Old::UINT_32 | Old::UINT_64 => {
                    Ok(ColumnType::Number { unsigned: true })
                }
                Old::NONE | Old::INT_8 | Old::INT_16 | Old::INT_32 | Old::INT_64 => {
                    Ok(ColumnType::Number { unsigned: false })
                }
                _ => Err("a time of day"),
            }
        }
        (Physical::INT32 | Physical::INT64, Some(_)) => Err("a time of day"),
        _ => Err("of a binary type"),
    }
}

/// The reader of a needed column.
struct BatchReader {
    values: ColumnReader,
    kind: ColumnType,
    /// The definition level of a present value; lower levels are nulls.
    value_level: i16,
}

/// Opens readers for the needed columns of a row group.
fn open_readers(
    file: &File,
    group: &dyn RowGroupReader,
    kinds: &[Result<ColumnType, &str>],
    needed: &[bool],
) -> Result<Vec<Option<BatchReader>>, ParquetError> {
    let open = |(at, (kind, needed)): (usize, (&Result<ColumnType, &str>, &bool))| {
        let about = group.metadata().column(at);
        let start = about.dictionary_page_offset().unwrap_or(about.data_page_offset());
        match kind {
            Ok(_) if *needed && (start < 0 || about.compressed_size() < 0) => {
                Err(ParquetError::General("a column that starts before the file".into()))
            }
            Ok(kind) if *needed => Ok(Some(BatchReader {
                values: match about.compression() {
                    Compression::ZSTD(_) => {
                        let pages = ZstdPages::new(file, about)?;
                        get_column_reader(about.column_descr_ptr(), Box::new(pages))
                    }
                    _ => group.get_column_reader(at)?,
                },
                kind: *kind,
                value_level: about.column_descr().max_def_level(),
            })),
            _ => Ok(None),
        }
    };
    kinds.iter().zip(needed).enumerate().map(open).collect()
}

fn next_batches(readers: &mut [Option<BatchReader>]) -> Result<Vec<Batch>, ParquetError> {
    let batch =
        |reader: &mut Option<BatchReader>| reader.as_mut().map_or(Ok(Batch::NotRead), next_batch);
    readers.iter_mut().map(batch).collect()
}

fn next_batch(reader: &mut BatchReader) -> Result<Batch, ParquetError> {
    let BatchReader { values, kind, value_level } = reader;
    let (value_level, unsigned) = (*value_level, *kind == ColumnType::Number { unsigned: true });
    let unit_ns = if let ColumnType::Date { unit_ns } = *kind { Some(unit_ns) } else { None };
    let empty = ByteArray::from("");
    Ok(match (values, unit_ns) {
        (ColumnReader::Int32ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, value_level, empty, |&v| date(i64::from(v), unit_ns))?)
        }
        (ColumnReader::Int64ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, value_level, empty, |&v| date(v, unit_ns))?)
        }
        (ColumnReader::Int96ColumnReader(values), Some(unit_ns)) => {
            Batch::Texts(spread(values, value_level, empty, |v| date(v.to_nanos(), unit_ns))?)
        }
        (values, _) => numbers_or_text(values, unsigned, value_level)?,
    })
}

/// Formats a date as text. Returns an empty text if the calendar does not cover it.
fn date(count: i64, unit_ns: i64) -> ByteArray {
    ByteArray::from(date_text(count, unit_ns).into_bytes())
}

fn numbers_or_text(
    values: &mut ColumnReader,
    unsigned: bool,
    value_level: i16,
) -> Result<Batch, ParquetError> {
    let nan = f64::NAN;
    let empty = ByteArray::from("");
    Ok(match values {
        ColumnReader::DoubleColumnReader(values) => {
            Batch::Numbers(spread(values, value_level, nan, |&v| v)?)
        }
        ColumnReader::FloatColumnReader(values) => {
            Batch::Numbers(spread(values, value_level, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int32ColumnReader(values) if unsigned => {
            Batch::Numbers(spread(values, value_level, nan, |&v| f64::from(v.cast_unsigned()))?)
        }
        ColumnReader::Int32ColumnReader(values) => {
            Batch::Numbers(spread(values, value_level, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int64ColumnReader(values) if unsigned => {
            Batch::Numbers(spread(values, value_level, nan, |&v| v.cast_unsigned() as f64)?)
        }
        ColumnReader::Int64ColumnReader(values) => {
            Batch::Numbers(spread(values, value_level, nan, |&v| v as f64)?)
        }
        ColumnReader::BoolColumnReader(values) => {
            let word = |&v: &bool| ByteArray::from(if v { "true" } else { "false" });
            Batch::Texts(spread(values, value_level, empty, word)?)
        }
        ColumnReader::ByteArrayColumnReader(values) => {
            Batch::Texts(spread(values, value_level, empty, ByteArray::clone)?)
        }
        _ => Batch::NotRead,
    })
}

/// Reads the next rows of a column and inserts `null` for missing values. Parquet stores only the present values, and
/// a definition level per row.
fn spread<T: DataType, V: Clone>(
    reader: &mut ColumnReaderImpl<T>,
    value_level: i16,
    null: V,
    convert: impl Fn(&T::T) -> V,
) -> Result<Vec<V>, ParquetError> {
    let (mut stored, mut levels) = (Vec::with_capacity(BATCH_ROWS), Vec::with_capacity(BATCH_ROWS));
    reader.read_records(BATCH_ROWS, Some(&mut levels), None, &mut stored)?;
    let mut stored = stored.iter().map(convert);
    if value_level == 0 {
        return Ok(stored.collect());
    }
    let next = |&level: &i16| if level == value_level { stored.next() } else { None };
    Ok(levels.iter().map(next).map(|value| value.unwrap_or_else(|| null.clone())).collect())
}

/// Returns the number of rows, which must be the same in all batches.
fn rows_of(columns: &[Batch]) -> Result<usize, ParquetError> {
    let mut rows = None;
    for column in columns {
        let length = match column {
            Batch::Numbers(values) => values.len(),
            Batch::Texts(values) => values.len(),
            Batch::NotRead => continue,
        };
        if *rows.get_or_insert(length) != length {
            return Err(ParquetError::General("columns of different length".into()));
        }
    }
    Ok(rows.unwrap_or(0))
}
