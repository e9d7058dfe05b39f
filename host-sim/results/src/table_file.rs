//! A table of columns as a file: Parquet or CSV.
//!
//! A column holds numbers, of which NaN stands for a missing value, or texts. Both formats keep every bit of a number.

use crate::ResultError;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{ColumnPath, Type};
use std::fmt::Write as _;
use std::sync::Arc;

/// Format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Apache Parquet, with snappy, which every reader of the format supports.
    Parquet,
    /// Text with commas and a header.
    Csv,
}

/// A column with one value per row.
pub enum TableColumn {
    /// Numbers; NaN for none.
    Numbers(Vec<f64>),
    /// Texts, each row by its index in a list.
    Texts {
        /// The distinct texts.
        texts: Vec<String>,
        /// Index of each row's text.
        indices: Vec<usize>,
    },
}

impl TableColumn {
    /// Creates a column of texts, one for each row.
    pub fn of_texts(texts: Vec<String>) -> Self {
        Self::Texts { indices: (0..texts.len()).collect(), texts }
    }
}

/// A table with named columns of equal length.
pub struct TableFile {
    columns: Vec<(String, TableColumn)>,
    rows: usize,
}

impl TableFile {
    /// Creates a table without columns.
    pub fn new(rows: usize) -> Self {
        Self { columns: Vec::new(), rows }
    }

    /// Adds a column, which must have the table's number of rows.
    pub fn push(&mut self, name: impl Into<String>, column: TableColumn) {
        self.columns.push((name.into(), column));
    }

    /// Returns names and values of the columns.
    pub fn into_columns(self) -> Vec<(String, TableColumn)> {
        self.columns
    }

    /// Returns the content of a file.
    ///
    /// # Errors
    /// One line if the Parquet library fails.
    pub fn emit(&self, format: TableFormat) -> Result<Vec<u8>, ResultError> {
        match format {
            TableFormat::Parquet => Ok(self.emit_parquet()?),
            TableFormat::Csv => Ok(self.emit_csv().into_bytes()),
        }
    }

    fn emit_csv(&self) -> String {
        let names: Vec<String> = self.columns.iter().map(|(name, _)| csv_cell(name)).collect();
        let mut text = names.join(",") + "\n";
        for row in 0..self.rows {
            for (at, (_, column)) in self.columns.iter().enumerate() {
                if at > 0 {
                    text.push(',');
                }
                match column {
                    // Writing to a string does not fail.
                    TableColumn::Numbers(values) if values[row].is_finite() => {
                        let _ = write!(text, "{:?}", values[row]);
                    }
                    TableColumn::Numbers(_) => {}
                    TableColumn::Texts { texts, indices } => {
                        text += &csv_cell(&texts[indices[row]])
                    }
                }
            }
            text.push('\n');
        }
        text
    }

    fn emit_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let field = |(name, column): &(String, TableColumn)| {
            let (physical, logical, repetition) = match column {
                TableColumn::Numbers(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
                TableColumn::Texts { .. } => {
                    (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED)
                }
            };
            let builder = Type::primitive_type_builder(name, physical);
            builder.with_logical_type(logical).with_repetition(repetition).build().map(Arc::new)
        };
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("rows").with_fields(fields).build()?;
        let mut properties = WriterProperties::builder().set_compression(Compression::SNAPPY);
        // Measured numbers hardly repeat: a dictionary would cost half of the time and save nothing.
        for (name, column) in &self.columns {
            if matches!(column, TableColumn::Numbers(_)) {
                let path = ColumnPath::from(name.as_str());
                properties = properties.set_column_dictionary_enabled(path, false);
            }
        }
        let properties = properties.build();
        let mut writer =
            SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
        let mut group = writer.next_row_group()?;
        for (_, column) in &self.columns {
            if let Some(place) = group.next_column()? {
                write_column(place, column)?;
            }
        }
        group.close()?;
        writer.into_inner()
    }
}

fn write_column(
    mut place: SerializedColumnWriter<'_>,
    column: &TableColumn,
) -> Result<(), ParquetError> {
    match column {
        TableColumn::Numbers(values) => {
            let levels: Vec<i16> = values.iter().map(|value| value.is_finite().into()).collect();
            let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            place.typed::<DoubleType>().write_batch(&present, Some(&levels), None)?;
        }
        TableColumn::Texts { texts, indices } => {
            let texts: Vec<ByteArray> = texts.iter().map(|text| text.as_str().into()).collect();
            let values: Vec<ByteArray> =
                indices.iter().map(|index| texts[*index].clone()).collect();
            place.typed::<ByteArrayType>().write_batch(&values, None, None)?;
        }
    }
    place.close()
}

/// Quotes a text where CSV requires it.
fn csv_cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
