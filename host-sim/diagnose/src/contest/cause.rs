//! Causes as a table: a name, and the columns that the cause adds to a law.
//!
//! Most causes are one line: a covariate times the friction level, a power of the speed, the acceleration. A cause may have
//! several variants, of which a hypothesis holds one: another covariate, a covariate that is logged some rows late, other
//! orders of a ripple. What needs a search of its own is in [`backlash`] and [`ripple`].
//!
//! The friction level is the torque of the law's friction part, scaled to an RMS of one: +1 in forward sliding, -1 in reverse,
//! and between them as the law has it.

pub mod backlash;
pub(crate) mod channel;
mod motion;
pub mod ripple;
pub mod simulated;
mod unknown;

use super::cause_key::CauseKey;
use super::detail::Detail;
use super::law::Shapes;
use super::orders::RippleOrders;
use super::rows::Rows;
use backlash::GapGrid;
use friction_fit::linear::{Factor, Regressor};
use joint_log::work::checkpoint;
use rayon::prelude::*;
use std::sync::Arc;

/// A way in which a cause may enter a model.
#[derive(Clone, Debug)]
pub struct Variant {
    /// The cause, with its columns.
    pub key: CauseKey,
    /// What distinguishes the variant: orders, rows of delay, shape.
    pub detail: Detail,
    /// What its columns are.
    pub source: ColumnSource,
    /// Prior cost: the share of the error that the variant must take to be worth its place.
    pub price: f64,
    /// Sign of its first coefficient that is physically possible; 0 if both are.
    pub sign: f64,
}

/// What the columns of a variant are.
#[derive(Clone, Debug)]
pub enum ColumnSource {
    /// Regressors, which mean the same on another log.
    Regressors(Vec<Regressor>),
    /// A simulation of the driver's law: its column in all rows.
    Simulated(Arc<[f64]>),
}

impl Variant {
    /// Returns the number of its columns.
    pub fn width(&self) -> usize {
        match &self.source {
            ColumnSource::Regressors(regressors) => regressors.len(),
            ColumnSource::Simulated(_) => 1,
        }
    }

    /// Returns its regressors; none for a simulation.
    pub(crate) fn regressors(&self) -> &[Regressor] {
        match &self.source {
            ColumnSource::Regressors(regressors) => regressors,
            ColumnSource::Simulated(_) => &[],
        }
    }

    /// Returns its columns in all rows, beside a friction level; `None` if the log lacks one that it needs.
    pub(crate) fn columns(&self, rows: &Rows, level: &[f64]) -> Option<Vec<Vec<f64>>> {
        match &self.source {
            ColumnSource::Regressors(regressors) => {
                regressors.iter().map(|regressor| rows.values(regressor, level)).collect()
            }
            ColumnSource::Simulated(column) => Some(vec![column.to_vec()]),
        }
    }

    /// Returns true if the variant is a cause of friction, and not a fault of the log.
    pub fn is_cause(&self) -> bool {
        self.key.cause != CHANNEL_GAIN
    }

    /// Returns true if it is a wave or a curve over the position.
    pub(crate) fn is_of_position(&self) -> bool {
        let is_of_place = |name: &String| name.starts_with("position");
        let is_curve = self.key.cause == "unknown" && self.key.columns.iter().any(is_of_place);
        is_curve
            || ["torque-ripple", "position-ripple", "gravity-imbalance"].contains(&self.key.cause)
    }
}

/// A variant with its columns in all rows.
pub(crate) struct Built {
    pub(crate) variant: Variant,
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Built {
    /// Computes the columns; `None` if one of them is missing or unusable.
    fn new(variant: Variant, rows: &Rows, level: &[f64]) -> Option<Self> {
        let columns = variant.columns(rows, level)?;
        let is_built = !columns.is_empty() && columns.iter().all(|column| is_usable(column));
        is_built.then_some(Self { variant, columns })
    }
}

/// Returns true if a column is finite and not 0 everywhere.
fn is_usable(column: &[f64]) -> bool {
    column.iter().all(|v| v.is_finite()) && column.iter().any(|v| *v != 0.0)
}

/// Returns true if a cause acts through the bristles of a law: a gap, an age of the contact and a changing side load. A law
/// without bristles has no column for it but one of shape, and the driver's law simulates it.
pub(crate) fn acts_through_bristles(cause: &str) -> bool {
    ["backlash", "dwell-time-static", "radial-force-rate"].contains(&cause)
}

/// What the columns of the causes are made of.
pub struct Context<'a> {
    /// The log.
    pub rows: &'a Rows,
    /// The columns of the laws.
    pub shapes: &'a Shapes,
    /// Index of the law's main travel.
    pub travel: usize,
    /// Friction level of the law.
    pub level: &'a [f64],
    /// What the law leaves of the log as it is.
    pub residual: &'a [f64],
    /// What the nonlinear causes are chosen from.
    pub(crate) waves: &'a Waves,
}

/// What the nonlinear causes are chosen from.
pub(crate) struct Waves {
    /// Orders of the waves that are tried, in lists that were found in different residuals.
    pub(crate) orders: Vec<RippleOrders>,
    /// Gaps of a backlash, for a log with a position.
    pub(crate) gaps: Option<GapGrid>,
}

/// A row of the table.
struct CauseRow {
    name: &'static str,
    price: f64,
    /// Sign of the coefficient that is physically possible, beside friction that is positive; 0 if both are.
    sign: f64,
    build: Build,
}

/// Columns of one variant.
#[derive(Default)]
pub(crate) struct Columns {
    follows: Vec<String>,
    detail: Detail,
    regressors: Vec<Regressor>,
}

/// Name of the variants that correct the gain or the sign of a channel: an added torque in proportion to it. They are faults of
/// the log and no cause.
pub const CHANNEL_GAIN: &str = "channel-gain";

/// Price of a cause with a column of its own.
const COLUMN: f64 = 0.02;

/// Price of each column of a variant after the first.
const COLUMN_PRICE: f64 = 0.004;

/// Price of a cause of motion or time alone, which an inaccurate law resembles.
const MIMIC: f64 = 0.04;

/// Sign of a coefficient of which both signs are possible.
const ANY_SIGN: f64 = 0.0;

const POSITIVE: f64 = 1.0;
const NEGATIVE: f64 = -1.0;

type Build = fn(&Context) -> Vec<Columns>;

const fn cause(name: &'static str, price: f64, sign: f64, build: Build) -> CauseRow {
    CauseRow { name, price, sign, build }
}

/// The causes: name, prior cost, possible sign of the coefficient, and columns.
const CAUSES: &[CauseRow] = &[
    cause("pressure-coulomb", COLUMN, POSITIVE, channel::pressure_coulomb),
    cause("radial-force-coulomb", COLUMN, POSITIVE, channel::radial_force_coulomb),
    cause("radial-force-rate", MIMIC, ANY_SIGN, channel::radial_force_rate),
    cause("load-torque-coulomb", COLUMN, POSITIVE, channel::load_torque_coulomb),
    cause(CHANNEL_GAIN, COLUMN, ANY_SIGN, channel::gain),
    cause("temperature-viscous", COLUMN, NEGATIVE, channel::temperature_viscous),
    cause("temperature-coulomb", COLUMN, NEGATIVE, channel::temperature_coulomb),
    cause("payload", MIMIC, ANY_SIGN, channel::payload),
    cause("joint-coupling", MIMIC, ANY_SIGN, channel::joint_coupling),
    cause("unknown", MIMIC, ANY_SIGN, unknown::columns),
    cause("direction-asymmetry", MIMIC, ANY_SIGN, motion::direction_asymmetry),
    cause("torque-offset", COLUMN, ANY_SIGN, motion::torque_offset),
    cause("quadratic-drag", MIMIC, POSITIVE, motion::quadratic_drag),
    cause("unmodelled-inertia", MIMIC, POSITIVE, motion::unmodelled_inertia),
    cause("gravity-imbalance", COLUMN, ANY_SIGN, motion::gravity_imbalance),
    cause("dwell-time-static", MIMIC, POSITIVE, motion::dwell_time_static),
    cause("time-drift", MIMIC, ANY_SIGN, motion::time_drift),
    cause("warm-up", MIMIC, NEGATIVE, motion::warm_up),
    cause("backlash", MIMIC, ANY_SIGN, backlash::backlash),
    cause("torque-ripple", MIMIC, ANY_SIGN, ripple::torque_ripple),
    cause("position-ripple", MIMIC, ANY_SIGN, ripple::position_ripple),
    cause("encoder-error", MIMIC, ANY_SIGN, ripple::encoder_error),
];

/// Returns the variants of all causes beside a law: those of the table, and those that the law simulates in place of their shapes.
pub(crate) fn variants(context: &Context, simulated: &[Variant]) -> Vec<Built> {
    let rows = context.rows;
    let of_cause = |row: &CauseRow| -> Vec<Built> {
        checkpoint();
        if !simulated.is_empty() && acts_through_bristles(row.name) {
            return Vec::new();
        }
        let variant = |form: Columns| Variant {
            key: CauseKey { cause: row.name, columns: form.follows },
            detail: form.detail,
            price: row.price + COLUMN_PRICE * form.regressors.len().saturating_sub(1) as f64,
            source: ColumnSource::Regressors(form.regressors),
            sign: row.sign,
        };
        let built = (row.build)(context).into_iter().map(variant);
        built.filter_map(|variant| Built::new(variant, rows, context.level)).collect()
    };
    let mut built: Vec<Built> = CAUSES.par_iter().flat_map_iter(of_cause).collect();
    built.extend(simulated.iter().cloned().filter_map(|variant| Built::new(variant, rows, &[])));
    built
}

impl Context<'_> {
    /// Returns the travel of the main stop.
    fn travel(&self) -> f64 {
        self.shapes.travels[self.travel]
    }
}

/// Returns the friction level times another factor.
fn of_level(factor: Factor) -> Regressor {
    Regressor::from([Factor::Level, factor])
}

/// Returns regressors without a covariate.
fn plain(detail: Detail, regressors: Vec<Regressor>) -> Columns {
    Columns { detail, regressors, ..Columns::default() }
}

/// Returns a detail in words.
fn form(words: impl Into<String>) -> Detail {
    Detail::Form(words.into())
}
