//! Causes that follow a known column: pressure, side load, load torque, temperature, payload, other joints.
//!
//! A covariate may be logged late or early. The delay in rows that explains most of what the law leaves is a variant of its
//! own beside the column as logged.

use super::{Columns, Context, form, of_level};
use crate::contest::covariate::{Covariate, MOST_LEVELS, OtherMotion};
use crate::contest::detail::Detail;
use friction_fit::ChannelGain;
use friction_fit::linear::{Factor, Regressor};
use joint_log::Quantity;
use joint_log::statistics::correlation;

/// Delays of a covariate that are tried, rows.
const DELAYS: [i32; 10] = [-20, -10, -5, -3, -1, 1, 3, 5, 10, 20];

/// Ratio of the squared correlations above which a delay is a variant.
const MIN_DELAY_GAIN: f64 = 1.1;

/// Most columns of other joints.
const MOST_COUPLED: usize = 8;

/// Rows over which the bristles follow a changing side load.
const RATE_ROWS: f64 = 3.0;

/// Returns a known covariate in the given form, as logged and with the delay that explains most.
fn forms(
    context: &Context,
    quantity: Quantity,
    regressor: impl Fn(Factor) -> Regressor,
) -> Vec<Columns> {
    let rows = context.rows;
    let Some(covariate) = rows.quantity(quantity) else { return Vec::new() };
    let variant = |detail: Detail, late_s: f64| Columns {
        follows: vec![covariate.name.clone()],
        detail,
        regressors: vec![regressor(covariate.late(late_s))],
    };
    let explains = |late_s: f64| {
        let column = rows.values(&regressor(covariate.late(late_s)), context.level);
        let residual = context.residual.iter().copied();
        correlation(column.unwrap_or_default().into_iter().zip(residual)).powi(2)
    };
    let mut found = vec![variant(Detail::Only, 0.0)];
    // A column with a few levels does not say when it changed within a level.
    if covariate.levels < MOST_LEVELS {
        return found;
    }
    let base = explains(0.0);
    let late = DELAYS.map(|rows_late| (explains(f64::from(rows_late) * rows.step_s), rows_late));
    let best = late.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, rows_late)) =
        best.filter(|(gain, _)| *gain > MIN_DELAY_GAIN * base && *gain > 0.01)
    {
        let detail = form(format!("column {rows_late} rows late"));
        found.push(variant(detail, f64::from(rows_late) * rows.step_s));
    }
    found
}

pub(super) fn pressure_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Pressure, of_level)
}

pub(super) fn radial_force_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::RadialForce, of_level)
}

pub(super) fn radial_force_rate(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let Some(force) = rows.quantity(Quantity::RadialForce) else { return Vec::new() };
    let factor = Factor::BendingRate {
        name: force.name.clone(),
        spread: force.mean_and_spread().1,
        travel: context.travel(),
        time_constant_s: RATE_ROWS * rows.step_s,
    };
    vec![following(force, vec![Regressor::from([factor])])]
}

/// Returns regressors that follow a covariate.
fn following(covariate: &Covariate, regressors: Vec<Regressor>) -> Columns {
    Columns { follows: vec![covariate.name.clone()], regressors, ..Columns::default() }
}

pub(super) fn load_torque_coulomb(context: &Context) -> Vec<Columns> {
    let Some(load) = context.rows.quantity(Quantity::LoadTorque) else { return Vec::new() };
    let magnitude = Factor::ColumnMagnitude { name: load.name.clone() };
    vec![following(load, vec![of_level(magnitude)])]
}

/// A torque in proportion to a known channel: its gain or sign is wrong where it was used to compute the torque.
pub(super) fn gain(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let known = [Quantity::Pressure, Quantity::RadialForce, Quantity::LoadTorque];
    let is_free = |quantity: &Quantity| *quantity != Quantity::LoadTorque || !rows.rigid_body.load;
    let channels = known
        .iter()
        .filter(|quantity| is_free(quantity))
        .filter_map(|quantity| rows.quantity(*quantity));
    channels.map(|channel| following(channel, vec![Regressor::from([channel.factor()])])).collect()
}

/// Returns the share of a channel in the torque from the coefficient of its regressor; `None` for a regressor without a channel.
pub(crate) fn channel_gain(regressor: &Regressor, size: f64) -> Option<ChannelGain> {
    match regressor.factors.first()? {
        Factor::Column { name, mean, spread, .. } => {
            Some(ChannelGain { column: name.clone(), gain: size / spread, mean: *mean })
        }
        _ => None,
    }
}

pub(super) fn temperature_viscous(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Temperature, |t| Regressor::from([t, Factor::Velocity]))
}

pub(super) fn temperature_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Temperature, of_level)
}

/// A column that scales gravity or inertia, such as the mass that the joint carries.
pub(super) fn payload(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let is_load =
        |covariate: &&Covariate| covariate.quantity.is_none() && covariate.motion.is_none();
    let extras = rows.covariates.iter().filter(is_load);
    let scales = |covariate: &Covariate| {
        let mut scaled = Vec::new();
        if rows.rigid_body.gravity {
            scaled.extend([Factor::Sine { order: 1.0 }, Factor::Cosine { order: 1.0 }]);
        }
        if rows.rigid_body.inertia {
            scaled.push(Factor::Acceleration);
        }
        let times = |factor| Regressor::from([covariate.factor(), factor]);
        following(covariate, scaled.into_iter().map(times).collect())
    };
    extras.map(scales).collect()
}

/// Velocities and accelerations of other joints, and products of two velocities. A joint without an acceleration in the log has
/// the slope of its velocity.
pub(super) fn joint_coupling(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let of = |wanted: OtherMotion| {
        let moving =
            rows.covariates.iter().filter(move |covariate| covariate.motion == Some(wanted));
        moving.take(MOST_COUPLED).collect::<Vec<&Covariate>>()
    };
    let (velocities, accelerations) = (of(OtherMotion::Velocity), of(OtherMotion::Acceleration));
    let all: Vec<&Covariate> = velocities.iter().chain(&accelerations).copied().collect();
    if all.is_empty() {
        return Vec::new();
    }
    let follows: Vec<String> = all.iter().map(|other| other.name.clone()).collect();
    let factor = |covariate: &&Covariate| Factor::of_column(&covariate.name);
    let speeds: Vec<Factor> = velocities.iter().map(factor).collect();
    let inertial: Vec<Factor> = match accelerations.is_empty() {
        true => {
            let slope =
                |covariate: &&Covariate| Factor::ColumnSlope { name: covariate.name.clone() };
            velocities.iter().map(slope).collect()
        }
        false => accelerations.iter().map(factor).collect(),
    };
    let mut products: Vec<Regressor> = Vec::new();
    for (at, a) in speeds.iter().enumerate() {
        products.extend(speeds[at..].iter().map(|b| Regressor::from([a.clone(), b.clone()])));
        products.push(Regressor::from([a.clone(), Factor::Velocity]));
    }
    let single = |factors: &[Factor]| -> Vec<Regressor> {
        factors.iter().map(|factor| Regressor::from([factor.clone()])).collect()
    };
    let variant = |detail: &str, regressors: Vec<Regressor>| Columns {
        follows: follows.clone(),
        detail: form(detail),
        regressors,
    };
    let found = [
        ("accelerations", single(&inertial)),
        ("velocities", single(&speeds)),
        ("velocities and accelerations", [single(&speeds), single(&inertial)].concat()),
        ("accelerations and products", [single(&inertial), products].concat()),
    ];
    found.map(|(detail, regressors)| variant(detail, regressors)).into()
}
