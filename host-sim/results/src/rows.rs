//! Every row of a log with the prediction of a model, as Parquet or CSV.
//!
//! | column | content |
//! |---|---|
//! | `run` | name of the run |
//! | `time_s`, `velocity_rad_s`, `torque_nm` | the log, after its corrections |
//! | `position_rad`, `pressure_diff_pa`, .. | every other column of the log |
//! | `predicted_torque_nm` | torque of the model; empty for a row without a prediction |
//! | `residual_torque_nm` | measured minus predicted torque |
//! | `bristle_torque_nm` | state of the model at the end of the row |
//! | `flags` | inputs outside the range of the fit, as `velocity-invalid,pressure-invalid` |
//!
//! A prismatic joint has `velocity_m_s`, `force_n`, `predicted_force_n`, `residual_force_n` and `bristle_force_n`. Numbers are
//! `f64` and exact in both formats.

use compensator_core::Quantity;
use friction_identification::data::{Dataset, contract};
use friction_identification::params::ParameterFile;
use friction_identification::prediction::{
    LogPrediction, PredictionOptions, flag_text, predict_log,
};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::Arc;

/// Name of the file that `identify`, `compare` and `diagnose` write.
pub const FILE_NAME: &str = "rows.parquet";

/// The rows of a log with the prediction of a parameter file, as a command writes them.
pub struct PredictedRows {
    /// Content of [`FILE_NAME`].
    pub content: Vec<u8>,
    /// The errors, for the command's JSON document.
    pub summary: Value,
}

impl PredictedRows {
    /// Predicts every row with the model of a parameter file, as `predict` does with the file.
    ///
    /// # Errors
    /// One line if the model cannot be applied to the log.
    pub fn new(file: &ParameterFile, data: &Dataset) -> Result<Self, String> {
        let predicted = predict_log(file, data, &PredictionOptions::default())?;
        let as_exported = predict_log(file, data, &PredictionOptions::AS_EXPORTED)?;
        let summary = json!({
            "file": FILE_NAME,
            "rows": predicted.metrics.rows,
            "rmse": predicted.metrics.rmse,
            "as_exported_rmse": as_exported.metrics.rmse,
            "remarks": predicted.remarks,
        });
        let content = RowTable::new(data, &predicted).emit(RowFormat::Parquet)?;
        Ok(Self { content, summary })
    }
}

/// Format of a table of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowFormat {
    /// Apache Parquet, with zstd.
    Parquet,
    /// Text with commas and a header.
    Csv,
}

/// A column with one value per row.
enum RowColumn {
    /// Numbers; NaN for none.
    Numbers(Vec<f64>),
    /// Indices into a list of texts.
    Texts(Vec<String>, Vec<usize>),
}

/// Every row of a log with the prediction of a model.
pub struct RowTable {
    columns: Vec<(String, RowColumn)>,
    rows: usize,
}

impl RowTable {
    /// Joins a log and its prediction. Both must have the same runs.
    pub fn new(data: &Dataset, prediction: &LogPrediction) -> Self {
        let names = data.runs.iter().map(|run| run.name.clone()).collect();
        let numbers = data.runs.iter().enumerate();
        let of_run = numbers.flat_map(|(at, run)| std::iter::repeat_n(at, run.len())).collect();
        let mut columns = vec![("run".to_owned(), RowColumn::Texts(names, of_run))];
        let mut add = |name: String, values: Vec<f64>| {
            columns.push((name, RowColumn::Numbers(values)));
        };
        let known = [Quantity::CampaignTime, Quantity::Velocity, Quantity::Torque];
        for quantity in known.into_iter().chain(contract::optional()) {
            let of_run = data.runs.iter().map(|run| run.get(quantity));
            let measured: Option<Vec<&[f64]>> = of_run.collect();
            if let Some(measured) = measured {
                add(quantity.name(data.joint).to_owned(), measured.concat());
            }
        }
        for (at, name) in data.covariates.iter().enumerate() {
            let of_run = data.runs.iter().flat_map(|run| run.extra[at].iter().copied());
            add(name.clone(), of_run.collect());
        }
        let target = Quantity::Torque.name(data.joint);
        let torque = || prediction.runs.iter().flat_map(|run| run.torque.iter().copied());
        let measured = data.runs.iter().flat_map(|run| run.torque.iter().copied());
        let residual = measured.zip(torque()).map(|(measured, predicted)| measured - predicted);
        let bristle = prediction.runs.iter().flat_map(|run| run.bristle_torque.iter().copied());
        add(format!("predicted_{target}"), torque().collect());
        add(format!("residual_{target}"), residual.collect());
        add(format!("bristle_{target}"), bristle.collect());
        columns.push(("flags".to_owned(), flag_column(prediction)));
        Self { columns, rows: data.rows }
    }

    /// Returns the content of a file.
    ///
    /// # Errors
    /// One line if the Parquet library fails.
    pub fn emit(&self, format: RowFormat) -> Result<Vec<u8>, String> {
        match format {
            RowFormat::Parquet => self.emit_parquet().map_err(|error| error.to_string()),
            RowFormat::Csv => Ok(self.emit_csv().into_bytes()),
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
                    RowColumn::Numbers(values) if values[row].is_finite() => {
                        let _ = write!(text, "{:?}", values[row]);
                    }
                    RowColumn::Numbers(_) => {}
                    RowColumn::Texts(texts, indices) => text += &csv_cell(&texts[indices[row]]),
                }
            }
            text.push('\n');
        }
        text
    }

    fn emit_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let field = |(name, column): &(String, RowColumn)| {
            let (physical, logical, repetition) = match column {
                RowColumn::Numbers(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
                RowColumn::Texts(..) => {
                    (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED)
                }
            };
            let builder = Type::primitive_type_builder(name, physical);
            builder.with_logical_type(logical).with_repetition(repetition).build().map(Arc::new)
        };
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("rows").with_fields(fields).build()?;
        let zstd = Compression::ZSTD(ZstdLevel::default());
        let properties = WriterProperties::builder().set_compression(zstd).build();
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
    column: &RowColumn,
) -> Result<(), ParquetError> {
    match column {
        RowColumn::Numbers(values) => {
            let levels: Vec<i16> = values.iter().map(|value| value.is_finite().into()).collect();
            let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            place.typed::<DoubleType>().write_batch(&present, Some(&levels), None)?;
        }
        RowColumn::Texts(texts, indices) => {
            let texts: Vec<ByteArray> = texts.iter().map(|text| text.as_str().into()).collect();
            let values: Vec<ByteArray> =
                indices.iter().map(|index| texts[*index].clone()).collect();
            place.typed::<ByteArrayType>().write_batch(&values, None, None)?;
        }
    }
    place.close()
}

fn flag_column(prediction: &LogPrediction) -> RowColumn {
    let mut places: HashMap<u32, usize> = HashMap::new();
    let mut texts = Vec::new();
    let flags = prediction.runs.iter().flat_map(|run| &run.flags);
    let indices = flags.map(|flags| {
        *places.entry(flags.bits()).or_insert_with(|| {
            texts.push(flag_text(*flags));
            texts.len() - 1
        })
    });
    let indices = indices.collect();
    RowColumn::Texts(texts, indices)
}

/// Quotes a text where CSV requires it.
fn csv_cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
