//! How a model was fitted, as far as a prediction with it needs to know.
//!
//! ```toml
//! [fit]                                   # optional
//! substeps = 1                            # steps of the core per sample
//! extrapolated = true                     # two step sizes cancel the first-order error
//! rmse = 0.085                            # of the rows that were fitted, Nm or N
//! auxiliary = "gap_mm"                    # the column of the log that lookup-table follows
//! [log_means]                             # optional: means of the log's covariates, in the columns' units
//! pressure_diff_pa = 120000.0
//! ```
//!
//! With the resolution of the fit, a prediction has the same bits as the fit's own. The means let a simulator's joint, which
//! has no covariates, represent the terms at their usual values.

use super::{ParameterFileErrorKind as Kind, number, section};
use crate::Resolution;
use compensator_core::Quantity;
use joint_log::JointKind;
use joint_log::{Dataset, contract};
use std::fmt::Write;

/// How a model was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct FitRecord {
    /// Steps of the core per sample, at least 1.
    pub substeps: usize,
    /// If true, a second simulation with twice the steps cancels the first-order error.
    pub extrapolated: bool,
    /// RMSE of the fitted rows, Nm or N, if it is known.
    pub rmse: Option<f64>,
    /// Column of the log in the samples' auxiliary field, if the model follows one.
    pub auxiliary: Option<String>,
    /// Mean of each covariate over the rows of the log, in the column's unit. Of a load torque it is the mean magnitude, which
    /// the friction follows.
    pub log_means: Vec<(Quantity, f64)>,
}

impl Default for FitRecord {
    /// One step per sample, as a driver does.
    fn default() -> Self {
        Self {
            substeps: 1,
            extrapolated: false,
            rmse: None,
            auxiliary: None,
            log_means: Vec::new(),
        }
    }
}

/// Largest number of steps per sample that a file may ask for. More would only delay a prediction.
const MAX_SUBSTEPS: usize = 4096;

impl FitRecord {
    /// Creates the record of a fit to `data` with this RMSE, Nm or N.
    pub fn new(resolution: Resolution, rmse: f64, data: &Dataset, auxiliary: Option<&str>) -> Self {
        let Resolution { substeps, extrapolated } = resolution;
        let log_means = contract::covariates().filter_map(|quantity| {
            let columns = data.runs.iter().filter_map(|run| run.get(quantity));
            let (mut sum, mut count) = (0.0, 0usize);
            for column in columns {
                sum += match quantity {
                    Quantity::LoadTorque => column.iter().map(|load| load.abs()).sum::<f64>(),
                    _ => column.iter().sum::<f64>(),
                };
                count += column.len();
            }
            (count > 0).then(|| (quantity, sum / count as f64))
        });
        let log_means = log_means.collect();
        let auxiliary = auxiliary.map(str::to_owned);
        let rmse = Some(rmse).filter(|rmse| rmse.is_finite());
        Self { substeps, extrapolated, rmse, auxiliary, log_means }
    }

    /// Returns the step size of the fit.
    pub fn resolution(&self) -> Resolution {
        Resolution { substeps: self.substeps, extrapolated: self.extrapolated }
    }
}

impl FitRecord {
    /// Returns the mean of a covariate over the rows of the log, in the core's internal unit.
    pub fn internal_mean(&self, quantity: Quantity) -> Option<f64> {
        let mean = self.log_means.iter().find(|(known, _)| *known == quantity);
        mean.map(|(_, mean)| mean * quantity.info().inside_scale)
    }

    /// Appends the sections of the record to a file.
    pub(super) fn emit(&self, joint: JointKind, text: &mut String) {
        let Self { substeps, extrapolated, rmse, auxiliary, log_means } = self;
        // Writing to a string does not fail.
        let _ = write!(text, "\n[fit]\nsubsteps = {substeps}\nextrapolated = {extrapolated}\n");
        if let Some(rmse) = rmse {
            let _ = writeln!(text, "rmse = {rmse:?}");
        }
        if let Some(column) = auxiliary {
            let _ = writeln!(text, "auxiliary = {}", toml_edit::Value::from(column.as_str()));
        }
        if !log_means.is_empty() {
            text.push_str("\n[log_means]\n");
        }
        for (quantity, mean) in log_means {
            let _ = writeln!(text, "{} = {mean:?}", quantity.name(joint));
        }
    }

    /// Parses the sections of the record.
    pub(super) fn parse(root: &toml_edit::Table, joint: JointKind) -> Result<Self, Kind> {
        let mut record = Self::default();
        for (key, item) in section(root, "fit")? {
            match key {
                "substeps" => {
                    let steps = item.as_integer().and_then(|steps| usize::try_from(steps).ok());
                    record.substeps = steps
                        .filter(|steps| (1..=MAX_SUBSTEPS).contains(steps))
                        .ok_or_else(|| {
                            Kind::value(
                                "fit.substeps",
                                format!("an integer of 1 to {MAX_SUBSTEPS}"),
                            )
                        })?;
                }
                "extrapolated" => {
                    record.extrapolated = item
                        .as_bool()
                        .ok_or_else(|| Kind::value("fit.extrapolated", "true or false"))?;
                }
                "rmse" => {
                    let rmse = number(item).filter(|rmse| *rmse >= 0.0);
                    let expected = || Kind::value("fit.rmse", "a number of at least 0");
                    record.rmse = Some(rmse.ok_or_else(expected)?);
                }
                "auxiliary" => {
                    let column =
                        item.as_str().ok_or_else(|| Kind::value("fit.auxiliary", "a text"))?;
                    record.auxiliary = Some(column.to_owned());
                }
                _ => {
                    let known = "substeps, extrapolated, rmse, auxiliary";
                    return Err(Kind::unknown(format!("fit.{key}"), known));
                }
            }
        }
        for (key, item) in section(root, "log_means")? {
            let quantity = Quantity::parse(key)
                .filter(|(_, of)| of.is_none_or(|of| of == joint))
                .ok_or_else(|| Kind::NoCovariate(key.to_owned()))?;
            let mean = number(item)
                .ok_or_else(|| Kind::value(format!("log_means.{key}"), "a finite number"))?;
            record.log_means.push((quantity.0, mean));
        }
        Ok(record)
    }
}
