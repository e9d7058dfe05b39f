//! Every row of a log with the prediction of a model, as Parquet or CSV: `rows.parquet`.
//!
//! | column | content |
//! |---|---|
//! | `run` | name of the run |
//! | `time_s`, `velocity_rad_s`, `torque_nm` | the log, after its corrections |
//! | `position_rad`, `pressure_diff_pa`, .. | every other column of the log |
//! | `predicted_torque_nm` | torque of the model; empty for a row without a prediction |
//! | `residual_torque_nm` | measured minus predicted torque; empty for a spike, whose measured torque is replaced |
//! | `bristle_torque_nm` | state of the model at the end of the row |
//! | `flags` | inputs outside the range of the fit, as `velocity-invalid,pressure-invalid` |
//!
//! With gains that follow the log ([`RowTable::adapted`]), further columns are:
//!
//! | column | content |
//! |---|---|
//! | `gain_level`, `gain_viscous`, `gain_pressure_coulomb`, .. | gains of the row's prediction: 1 is the set of the file |
//! | `std_level`, .. | standard deviations of what was learnt |
//! | `frozen` | why nothing is learnt from the row: [`Frozen::name`]; `learning` if it is |
//!
//! A prismatic joint has `velocity_m_s`, `force_n`, `predicted_force_n`, `residual_force_n` and `bristle_force_n`. Numbers are
//! `f64` and exact in both formats.

use crate::ResultError;
use crate::table_file::{TableColumn, TableFile, TableFormat};
use compensator_core::Quantity;
use compensator_core::adaptation::Frozen;
use friction_fit::prediction::{AdaptedPrediction, LogPrediction, RowAdaptation, flag_text};
use joint_log::{Dataset, contract};
use std::collections::HashMap;

/// Every row of a log with the prediction of a model.
pub struct RowTable(TableFile);

impl RowTable {
    /// Joins a log and its prediction. Both must have the same runs.
    pub fn new(data: &Dataset, prediction: &LogPrediction) -> Self {
        let names = data.runs.iter().map(|run| run.name.clone()).collect();
        let numbers = data.runs.iter().enumerate();
        let of_run = numbers.flat_map(|(at, run)| std::iter::repeat_n(at, run.len())).collect();
        let mut table = TableFile::new(data.rows);
        table.push("run", TableColumn::Texts { texts: names, indices: of_run });
        let mut add = |name: String, values: Vec<f64>| {
            table.push(name, TableColumn::Numbers(values));
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
        // The torque of a spike is an estimate.
        let measured = data.runs.iter().flat_map(|run| {
            let torque = |(row, torque)| if run.is_spike(row) { f64::NAN } else { torque };
            run.torque.iter().copied().enumerate().map(torque)
        });
        let residual = measured.zip(torque()).map(|(measured, predicted)| measured - predicted);
        let bristle = prediction.runs.iter().flat_map(|run| run.bristle_torque.iter().copied());
        add(format!("predicted_{target}"), torque().collect());
        add(format!("residual_{target}"), residual.collect());
        add(format!("bristle_{target}"), bristle.collect());
        table.push("flags", flag_column(prediction));
        Self(table)
    }

    /// Joins a log and its prediction with gains that follow it. Both must have the same runs.
    pub fn adapted(data: &Dataset, adapted: &AdaptedPrediction) -> Self {
        let Self(mut table) = Self::new(data, &adapted.prediction);
        let rows = || adapted.rows.iter().flatten();
        let mut add = |name: String, value: &dyn Fn(&RowAdaptation) -> f32| {
            let values = rows().map(|row| row.as_ref().map_or(f64::NAN, |row| value(row).into()));
            table.push(name, TableColumn::Numbers(values.collect()));
        };
        for (at, name) in adapted.names.iter().enumerate() {
            add(format!("gain_{name}"), &|row| row.gains[at]);
        }
        for (at, name) in adapted.names.iter().enumerate() {
            add(format!("std_{name}"), &|row| row.deviations[at]);
        }
        // The last text is that of a row without a prediction.
        let mut texts: Vec<String> =
            Frozen::ALL.iter().map(|reason| reason.name().to_owned()).collect();
        texts.push(String::new());
        let last = Frozen::ALL.len();
        let place = |row: &RowAdaptation| {
            Frozen::ALL.iter().position(|reason| *reason == row.frozen).unwrap_or(last)
        };
        let indices = rows().map(|row| row.as_ref().map_or(last, place)).collect();
        table.push("frozen", TableColumn::Texts { texts, indices });
        Self(table)
    }

    /// Returns the content of a file.
    ///
    /// # Errors
    /// See [`TableFile::emit`].
    pub fn emit(&self, format: TableFormat) -> Result<Vec<u8>, ResultError> {
        self.0.emit(format)
    }
}

fn flag_column(prediction: &LogPrediction) -> TableColumn {
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
    TableColumn::Texts { texts, indices }
}
