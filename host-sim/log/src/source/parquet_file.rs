//! Parquet files.
//!
//! Parquet stores columns separately and compressed. One reader per needed column advances some thousand rows at a time, so that
//! columns of different length are noticed. A null is an empty cell.
//!
//! Supported are the flat columns that pandas, polars and similar tools write: numbers, booleans (as the words `true`
//! and `false`), text, and dates with or without a time of day (as the text of a CSV file, to the nanosecond),
//! uncompressed or compressed with snappy, zstd or brotli. Lists, times of day and decimals are not measurements and are left
//! out by name.

use std::borrow::Cow;
use std::fs::File;
use std::path::Path;

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::format::{DAY_NS, Input, LogFormat, SECOND_NS, is_parquet, read_damaged};
use super::parquet_zstd::{ZstdPages, damaged};
use crate::error::{DataError, one_line};
use crate::log_table::LogTable;
use crate::mixed_cells::Need;
use crate::table::{Cells, Table};

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

/// What is expected instead of a file that cannot be read.
const EXPECTED: &str = "a Parquet file, uncompressed or compressed with snappy, zstd or brotli";

/// Apache Parquet.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_parquet, read };

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Input { request, file, size, .. } = input;
    read_damaged(request.path, "an intact Parquet file", || {
        let parquet =
            ParquetFile::open(file).map_err(|error| failed(request.path, error, EXPECTED))?;
        let unreadable = parquet.kinds.iter().map(|kind| kind.err().map(str::to_owned));
        let plan = request.plan_columns(parquet.names.clone(), unreadable.collect())?;
        let is_needed = plan.needs.iter().map(|need| *need != Need::Skip);
        let progress = |share: f64| (request.progress)((share * size as f64) as u64);
        let cells = parquet.cells(is_needed.collect(), plan.max_rows(), &progress);
        let cells = cells.map_err(|error| failed(request.path, error, EXPECTED))?;
        Ok(LogTable::of_columns(&request, plan, cells.into_iter().map(Cow::Owned)))
    })
}

fn failed(path: &Path, error: ParquetError, expected: &str) -> DataError {
    let found = one_line(&error.to_string());
    DataError::file(path, found, expected)
}

/// Reads all columns of a Parquet file into memory. A column that is no measurement has no cells.
///
/// # Errors
/// If the file is damaged or compressed in another way.
pub fn parquet_table(path: &Path) -> Result<Table, DataError> {
    let expected = "an intact Parquet file";
    let open = || -> Result<Table, ParquetError> {
        let parquet = ParquetFile::open(File::open(path)?)?;
        let cells = parquet.cells(vec![true; parquet.kinds.len()], usize::MAX, &|_| {})?;
        let columns = parquet.names.into_iter().zip(cells).collect();
        Ok(Table { name: path.display().to_string(), columns })
    };
    read_damaged(path, expected, || open().map_err(|error| failed(path, error, expected)))
}

/// An open file.
struct ParquetFile {
    file: File,
    reader: SerializedFileReader<File>,
    names: Vec<String>,
    /// How each column is read, or why it is not, as the end of "it is ..".
    kinds: Vec<Result<ColumnType, &'static str>>,
}

impl ParquetFile {
    fn open(file: File) -> Result<Self, ParquetError> {
        let reader = SerializedFileReader::new(file.try_clone()?)?;
        let columns = reader.metadata().file_metadata().schema_descr().columns();
        let kinds = columns.iter().map(|column| column_type(column)).collect();
        let names = columns.iter().map(|column| column.path().parts().join(".")).collect();
        Ok(Self { file, reader, names, kinds })
    }

    /// Reads the cells of the needed columns, at least the first `rows`. `progress` is called with the share that is read.
    fn cells(
        &self,
        is_needed: Vec<bool>,
        rows: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Vec<Cells>, ParquetError> {
        let total = self.reader.metadata().file_metadata().num_rows().max(1) as f64;
        let mut cells = vec![Cells::NOT_READ; self.kinds.len()];
        let mut done = 0;
        for group in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(group)?;
            let mut readers = open_readers(&self.file, &*group, &self.kinds, &is_needed)?;
            while done < rows {
                progress((done as f64 / total).min(1.0));
                let next = |reader: &mut Option<BatchReader>| {
                    reader.as_mut().map_or(Ok(Cells::NOT_READ), next_batch)
                };
                let batch: Vec<Cells> = readers.iter_mut().map(next).collect::<Result<_, _>>()?;
                let count = rows_of(&batch)?;
                if count == 0 {
                    break;
                }
                done += count;
                cells.iter_mut().zip(batch).for_each(|(all, batch)| all.append(batch));
            }
        }
        Ok(cells)
    }
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
                Err(damaged("a column that starts before the file"))
            }
            Ok(kind) if *needed => Ok(Some(BatchReader {
                values: match about.compression() {
                    Compression::ZSTD(_) => {
                        let rows = group.metadata().num_rows();
                        let pages = ZstdPages::new(file, about, rows as usize)?;
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

fn next_batch(reader: &mut BatchReader) -> Result<Cells, ParquetError> {
    let BatchReader { values, kind, value_level } = reader;
    let (value_level, unsigned) = (*value_level, *kind == ColumnType::Number { unsigned: true });
    let unit_ns = if let ColumnType::Date { unit_ns } = *kind { Some(unit_ns) } else { None };
    Ok(match (values, unit_ns) {
        (ColumnReader::Int32ColumnReader(values), Some(unit_ns)) => {
            let stamp = |count: &i32| i64::from(*count).checked_mul(unit_ns);
            Cells::Stamps(spread(values, value_level, None, stamp)?)
        }
        (ColumnReader::Int64ColumnReader(values), Some(unit_ns)) => {
            Cells::Stamps(spread(values, value_level, None, |count| count.checked_mul(unit_ns))?)
        }
        (ColumnReader::Int96ColumnReader(values), Some(_)) => {
            Cells::Stamps(spread(values, value_level, None, |stamp| Some(stamp.to_nanos()))?)
        }
        (values, _) => numbers_or_text(values, unsigned, value_level)?,
    })
}

fn numbers_or_text(
    values: &mut ColumnReader,
    unsigned: bool,
    value_level: i16,
) -> Result<Cells, ParquetError> {
    let nan = f64::NAN;
    let empty = String::new();
    Ok(match values {
        ColumnReader::DoubleColumnReader(values) => {
            Cells::Numbers(spread(values, value_level, nan, |&v| v)?)
        }
        ColumnReader::FloatColumnReader(values) => {
            Cells::Numbers(spread(values, value_level, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int32ColumnReader(values) if unsigned => {
            Cells::Numbers(spread(values, value_level, nan, |&v| f64::from(v.cast_unsigned()))?)
        }
        ColumnReader::Int32ColumnReader(values) => {
            Cells::Numbers(spread(values, value_level, nan, |&v| f64::from(v))?)
        }
        ColumnReader::Int64ColumnReader(values) if unsigned => {
            Cells::Numbers(spread(values, value_level, nan, |&v| v.cast_unsigned() as f64)?)
        }
        ColumnReader::Int64ColumnReader(values) => {
            Cells::Integers(spread(values, value_level, None, |&v| Some(v))?)
        }
        ColumnReader::BoolColumnReader(values) => {
            let word = |&v: &bool| if v { "true" } else { "false" }.to_owned();
            Cells::Texts(spread(values, value_level, empty, word)?)
        }
        ColumnReader::ByteArrayColumnReader(values) => {
            let text = |v: &ByteArray| String::from_utf8_lossy(v.data()).into_owned();
            Cells::Texts(spread(values, value_level, empty, text)?)
        }
        _ => Cells::NOT_READ,
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

/// Returns the number of rows, which must be the same in all columns that are read.
fn rows_of(columns: &[Cells]) -> Result<usize, ParquetError> {
    let mut lengths = columns.iter().filter(|cells| **cells != Cells::NOT_READ).map(Cells::len);
    let rows = lengths.next().unwrap_or(0);
    if lengths.any(|length| length != rows) {
        return Err(damaged("columns of different length"));
    }
    Ok(rows)
}
