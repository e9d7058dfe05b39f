//! Tables in memory: from Arrow data and from columns, and back to Arrow.

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types as t;
use arrow_array::{
    Array, ArrayRef, ArrowPrimitiveType, Float64Array, Int64Array, RecordBatch,
    RecordBatchIterator, RecordBatchReader, StringArray, TimestampNanosecondArray,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, TimeUnit};
use joint_log::Cells;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyList};
use std::sync::Arc;

const MILLISECOND_NS: i64 = 1_000_000;
const SECOND_NS: i64 = 1000 * MILLISECOND_NS;
const DAY_NS: i64 = 86_400 * SECOND_NS;

/// A log as named columns, held in memory in Rust.
#[pyclass(frozen, module = "friction._core")]
pub struct Table(pub joint_log::Table);

#[pymethods]
impl Table {
    /// Returns a table with the columns of an object with `__arrow_c_stream__`.
    #[staticmethod]
    fn from_arrow(data: &Bound<'_, PyAny>, name: String) -> PyResult<Self> {
        let reader = stream(data)?;
        let fields = reader.schema();
        let names = fields.fields().iter().map(|field| field.name().clone());
        let mut columns: Vec<(String, Option<Cells>)> = names.map(|name| (name, None)).collect();
        for batch in reader {
            let batch = batch.map_err(failed)?;
            for ((_, cells), array) in columns.iter_mut().zip(batch.columns()) {
                let more = cells_of(array);
                *cells = Some(match cells.take() {
                    None => more,
                    Some(cells) => joined(cells, more),
                });
            }
        }
        let columns = columns
            .into_iter()
            .map(|(name, cells)| (name, cells.unwrap_or(Cells::Numbers(vec![]))));
        Ok(Self(joint_log::Table { name, columns: columns.collect() }))
    }

    /// Returns a table of columns, each a name, a kind and values: `numbers` (bytes of float64), `integers` (bytes of
    /// int64), `stamps` (bytes of int64, ns since 1970, the least int64 if missing), or `texts` (a list of str).
    #[staticmethod]
    fn from_columns(
        columns: Vec<(String, String, Bound<'_, PyAny>)>,
        name: String,
    ) -> PyResult<Self> {
        let columns = columns.into_iter().map(|(name, kind, values)| {
            let cells = match kind.as_str() {
                "numbers" => Cells::Numbers(words(&values, f64::from_ne_bytes)?),
                "integers" => Cells::Integers(
                    words(&values, i64::from_ne_bytes)?.into_iter().map(Some).collect(),
                ),
                "stamps" => {
                    let stamps = words(&values, i64::from_ne_bytes)?.into_iter();
                    let present = |stamp| (stamp != i64::MIN).then_some(stamp);
                    Cells::Stamps(stamps.map(present).collect())
                }
                "texts" => Cells::Texts(values.extract()?),
                other => return Err(PyValueError::new_err(format!("unknown kind {other}"))),
            };
            Ok((name, cells))
        });
        Ok(Self(joint_log::Table { name, columns: columns.collect::<PyResult<_>>()? }))
    }

    /// Name of the table in messages and results.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<&str> {
        self.0.columns.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// Returns the columns as lists by name; missing values are None.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for (name, cells) in &self.0.columns {
            columns.set_item(name, list(py, cells)?)?;
        }
        Ok(columns)
    }

    /// Returns the table as an Arrow C stream.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // A producer may ignore the requested schema.
        let _ = requested_schema;
        let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = self
            .0
            .columns
            .iter()
            .map(|(name, cells)| {
                let array = array_of(cells);
                (Field::new(name, array.data_type().clone(), true), array)
            })
            .unzip();
        let schema = Arc::new(Schema::new(fields));
        let batch = RecordBatch::try_new(schema.clone(), arrays).map_err(failed)?;
        let batches = RecordBatchIterator::new([Ok(batch)], schema);
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    fn __len__(&self) -> usize {
        self.0.columns.first().map_or(0, |(_, cells)| cells.len())
    }

    fn __repr__(&self) -> String {
        format!(
            "<Table {}: {} rows, {}>",
            self.0.name,
            self.__len__(),
            self.column_names().join(", ")
        )
    }
}

fn failed(error: ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Takes the Arrow C stream of an object.
#[expect(unsafe_code, reason = "the Arrow C data interface passes pointers")]
fn stream(data: &Bound<'_, PyAny>) -> PyResult<RecordBatchStreamReader> {
    let capsule = data.call_method0("__arrow_c_stream__")?;
    let capsule = capsule.cast::<PyCapsule>().map_err(PyErr::from)?;
    let pointer = capsule.pointer_checked(Some(c"arrow_array_stream"))?;
    // SAFETY: the capsule's name states the type of its content, which lives as long as the capsule. The stream is moved
    // out, and the released one that stays is ignored by the capsule's destructor.
    let stream = unsafe { FFI_ArrowArrayStream::from_raw(pointer.as_ptr().cast()) };
    RecordBatchStreamReader::try_new(stream).map_err(failed)
}

/// Splits bytes into values of eight bytes.
fn words<T>(values: &Bound<'_, PyAny>, of: fn([u8; 8]) -> T) -> PyResult<Vec<T>> {
    let bytes = values.cast::<PyBytes>().map_err(|_| PyTypeError::new_err("expected bytes"))?;
    let (words, rest) = bytes.as_bytes().as_chunks::<8>();
    if !rest.is_empty() {
        return Err(PyValueError::new_err("expected values of eight bytes"));
    }
    Ok(words.iter().copied().map(of).collect())
}

fn list<'py>(py: Python<'py>, cells: &Cells) -> PyResult<Bound<'py, PyList>> {
    match cells {
        Cells::Numbers(cells) => PyList::new(py, cells),
        Cells::Integers(cells) | Cells::Stamps(cells) => PyList::new(py, cells),
        Cells::Texts(_) | Cells::Mixed(_) => PyList::new(py, cell_texts(cells)),
        Cells::Unreadable { rows, .. } => PyList::new(py, vec![None::<f64>; *rows]),
    }
}

/// Returns the cells as texts; `None` for a missing value.
fn cell_texts(cells: &Cells) -> Vec<Option<String>> {
    let texts = (0..cells.len()).map(|row| cells.text_of(row));
    texts.map(|text| (!text.is_empty()).then_some(text)).collect()
}

fn array_of(cells: &Cells) -> ArrayRef {
    match cells {
        Cells::Numbers(cells) => Arc::new(Float64Array::from(cells.clone())),
        Cells::Integers(cells) => Arc::new(Int64Array::from(cells.clone())),
        Cells::Stamps(cells) => {
            Arc::new(TimestampNanosecondArray::from(cells.clone()).with_timezone("UTC"))
        }
        Cells::Texts(_) | Cells::Mixed(_) => Arc::new(StringArray::from_iter(cell_texts(cells))),
        Cells::Unreadable { rows, .. } => Arc::new(Float64Array::from(vec![None; *rows])),
    }
}

fn extended<T>(mut all: Vec<T>, more: Vec<T>) -> Vec<T> {
    all.extend(more);
    all
}

/// Joins the cells of two batches of one column.
fn joined(first: Cells, more: Cells) -> Cells {
    match (first, more) {
        (Cells::Numbers(all), Cells::Numbers(more)) => Cells::Numbers(extended(all, more)),
        (Cells::Integers(all), Cells::Integers(more)) => Cells::Integers(extended(all, more)),
        (Cells::Texts(all), Cells::Texts(more)) => Cells::Texts(extended(all, more)),
        (Cells::Stamps(all), Cells::Stamps(more)) => Cells::Stamps(extended(all, more)),
        // All batches have one schema, so the kinds differ for unreadable types only.
        (first, more) => Cells::Unreadable {
            rows: first.len() + more.len(),
            kind: match first {
                Cells::Unreadable { kind, .. } => kind,
                _ => "of a type that changes".into(),
            },
        },
    }
}

fn numbers<T: ArrowPrimitiveType>(array: &ArrayRef, of: impl Fn(T::Native) -> f64) -> Cells {
    let cells = array.as_primitive::<T>().iter();
    Cells::Numbers(cells.map(|cell| cell.map_or(f64::NAN, &of)).collect())
}

fn stamps<T: ArrowPrimitiveType<Native = i64>>(array: &ArrayRef, unit_ns: i64) -> Cells {
    let cells = array.as_primitive::<T>().iter();
    Cells::Stamps(cells.map(|cell| cell?.checked_mul(unit_ns)).collect())
}

fn texts<'a>(cells: impl Iterator<Item = Option<&'a str>>) -> Cells {
    Cells::Texts(cells.map(|cell| cell.unwrap_or_default().to_owned()).collect())
}

/// Converts an Arrow array. Stamps with a time zone count from 1970 in UTC, as Arrow stores them; those without one are
/// taken as UTC.
fn cells_of(array: &ArrayRef) -> Cells {
    match array.data_type() {
        DataType::Float64 => numbers::<t::Float64Type>(array, |n| n),
        DataType::Float32 => numbers::<t::Float32Type>(array, f64::from),
        DataType::Float16 => numbers::<t::Float16Type>(array, f64::from),
        DataType::Int8 => numbers::<t::Int8Type>(array, f64::from),
        DataType::Int16 => numbers::<t::Int16Type>(array, f64::from),
        DataType::Int32 => numbers::<t::Int32Type>(array, f64::from),
        DataType::UInt8 => numbers::<t::UInt8Type>(array, f64::from),
        DataType::UInt16 => numbers::<t::UInt16Type>(array, f64::from),
        DataType::UInt32 => numbers::<t::UInt32Type>(array, f64::from),
        DataType::UInt64 => numbers::<t::UInt64Type>(array, |n| n as f64),
        DataType::Int64 => Cells::Integers(array.as_primitive::<t::Int64Type>().iter().collect()),
        DataType::Decimal128(_, scale) => {
            let scale = 10f64.powi(i32::from(*scale));
            numbers::<t::Decimal128Type>(array, |n| n as f64 / scale)
        }
        DataType::Timestamp(unit, _) => match unit {
            TimeUnit::Second => stamps::<t::TimestampSecondType>(array, SECOND_NS),
            TimeUnit::Millisecond => stamps::<t::TimestampMillisecondType>(array, MILLISECOND_NS),
            TimeUnit::Microsecond => stamps::<t::TimestampMicrosecondType>(array, 1000),
            TimeUnit::Nanosecond => stamps::<t::TimestampNanosecondType>(array, 1),
        },
        DataType::Date32 => {
            let days = array.as_primitive::<t::Date32Type>().iter();
            Cells::Stamps(days.map(|day| i64::from(day?).checked_mul(DAY_NS)).collect())
        }
        DataType::Date64 => stamps::<t::Date64Type>(array, MILLISECOND_NS),
        DataType::Utf8 => texts(array.as_string::<i32>().iter()),
        DataType::LargeUtf8 => texts(array.as_string::<i64>().iter()),
        DataType::Utf8View => texts(array.as_string_view().iter()),
        DataType::Boolean => {
            let word = |truth| if truth { "true" } else { "false" };
            texts(array.as_boolean().iter().map(|cell| cell.map(word)))
        }
        DataType::Dictionary(..) => of_dictionary(array),
        DataType::Null => Cells::Numbers(vec![f64::NAN; array.len()]),
        other => Cells::Unreadable { rows: array.len(), kind: in_words(other) },
    }
}

/// Describes a type that is no measurement, as the end of "it is ..".
fn in_words(kind: &DataType) -> String {
    match kind {
        DataType::List(_) | DataType::LargeList(_) | DataType::FixedSizeList(..) => "a list".into(),
        DataType::Time32(_) | DataType::Time64(_) => "a time of day".into(),
        other => format!("of the type {other}"),
    }
}

/// Converts categories.
fn of_dictionary(array: &ArrayRef) -> Cells {
    let dictionary = array.as_any_dictionary();
    let values = cells_of(dictionary.values());
    let keys = dictionary.normalized_keys();
    let place = |row: usize| dictionary.is_valid(row).then(|| keys[row]);
    values.select((0..array.len()).map(place))
}
