//! Regressors of the reference regression: the data in long columns, and the base model on them.

use super::stop_operator::{displacements, stop};
use compensator_core::TermKind;
use joint_log::{Dataset, Quantity, Run};
use std::ops::Range;

/// Values of a regressor in all rows of the data.
pub(super) type Regressor = Vec<f64>;

/// Data of all runs in long columns.
pub(super) struct LongData<'a> {
    pub data: &'a Dataset,
    /// Rows of each run.
    pub runs: Vec<Range<usize>>,
    pub velocity: Regressor,
    pub torque: Regressor,
    /// Displacement since the row before; 0 in a run's first row.
    pub displacement: Regressor,
    /// Median displacement span of a run.
    pub span: f64,
    /// 95th percentile of speed.
    pub speed: f64,
}

impl<'a> LongData<'a> {
    pub fn new(data: &'a Dataset) -> Self {
        let mut at = 0;
        let runs = data.runs.iter().map(|run| {
            at += run.len();
            at - run.len()..at
        });
        let runs: Vec<Range<usize>> = runs.collect();
        let long =
            |of: &dyn Fn(&Run) -> Vec<f64>| data.runs.iter().flat_map(of).collect::<Regressor>();
        let displacement = long(&displacements);
        let mut spans: Vec<f64> = runs
            .iter()
            .map(|run| {
                let (mut place, mut least, mut most) = (0.0f64, 0.0f64, 0.0f64);
                for step in &displacement[run.clone()] {
                    place += step;
                    (least, most) = (least.min(place), most.max(place));
                }
                most - least
            })
            .collect();
        spans.sort_by(f64::total_cmp);
        let velocity = long(&|run| run.velocity.clone());
        let mut speeds: Vec<f64> = velocity.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let speed = speeds.get(speeds.len() * 95 / 100).copied().unwrap_or(1.0);
        Self {
            data,
            torque: long(&|run| run.torque.clone()),
            displacement,
            span: spans.get(spans.len() / 2).copied().unwrap_or(1.0).max(1e-12),
            speed: speed.max(1e-12),
            velocity,
            runs,
        }
    }

    /// Returns a quantity in all rows; `None` unless every run has it.
    pub fn quantity(&self, quantity: Quantity) -> Option<Regressor> {
        let runs = self.data.runs.iter().map(|run| run.get(quantity));
        Some(runs.collect::<Option<Vec<&[f64]>>>()?.concat())
    }

    /// Returns the elastic sign with this travel and gap.
    pub fn stop(&self, travel: f64, gap: f64) -> Regressor {
        let runs = self.runs.iter();
        runs.flat_map(|run| stop(&self.displacement[run.clone()], travel, gap)).collect()
    }

    /// Returns the acceleration, measured or derived.
    pub fn acceleration(&self) -> Regressor {
        self.data.runs.iter().flat_map(|run| run.acceleration_or_derived().into_owned()).collect()
    }

    /// Returns a function of each row's index.
    pub fn map(&self, of: impl FnMut(usize) -> f64) -> Regressor {
        (0..self.velocity.len()).map(of).collect()
    }

    /// Returns the time derivative of a regressor within runs.
    pub fn derivative(&self, column: &[f64]) -> Regressor {
        let mut slopes = vec![0.0; column.len()];
        for (run, rows) in self.data.runs.iter().zip(&self.runs) {
            for at in 1..rows.len().saturating_sub(1) {
                let row = rows.start + at;
                let seconds = run.time_s[at + 1] - run.time_s[at - 1];
                slopes[row] =
                    if seconds > 0.0 { (column[row + 1] - column[row - 1]) / seconds } else { 0.0 };
            }
        }
        slopes
    }
}

/// Regressors of the base for a travel and a Stribeck velocity.
pub(super) struct BaseModel {
    pub travel: f64,
    pub sign: Regressor,
    pub regressors: Vec<Regressor>,
    pub description: String,
}

/// Builds the base for a travel and a Stribeck velocity; no Stribeck term if `peak` is 0.
pub(super) fn base_model(
    rows: &LongData,
    rigid_body: &[TermKind],
    travel: f64,
    peak: f64,
) -> BaseModel {
    let sign = rows.stop(travel, 0.0);
    let mut regressors = vec![sign.clone(), rows.velocity.clone()];
    if peak > 0.0 {
        regressors.push(rows.map(|at| sign[at] * (-(rows.velocity[at] / peak).powi(2)).exp()));
    }
    for part in rigid_body {
        match part {
            TermKind::UnmodelledInertia => regressors.push(rows.acceleration()),
            TermKind::GravityImbalance => {
                if let Some(angle) = rows.quantity(Quantity::Position) {
                    regressors.push(angle.iter().map(|q| q.sin()).collect());
                    regressors.push(angle.iter().map(|q| q.cos()).collect());
                }
            }
            TermKind::LoadGain => regressors.extend(rows.quantity(Quantity::LoadTorque)),
            TermKind::TorqueOffset => regressors.push(vec![1.0; rows.velocity.len()]),
            // A delay is not linear; no other term is a part of the rigid body.
            _ => {}
        }
    }
    let description = format!(
        "travel {:.1e} of the span, Stribeck {:.2e} of the speed",
        travel / rows.span,
        peak / rows.speed
    );
    BaseModel { travel, sign, regressors, description }
}
