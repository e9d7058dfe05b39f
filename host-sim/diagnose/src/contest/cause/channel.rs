//! Causes that follow a known column: pressure, side load, load torque, temperature, payload, other joints.
//!
//! A covariate may be logged late or early. The delay in rows that explains most of what the law leaves is a variant of its
//! own beside the column as logged.

use super::{Columns, Context};
use crate::contest::covariate::{Covariate, OtherMotion, correlation};
use crate::contest::law::product;
use crate::contest::operator::{low_pass, shift};
use joint_log::Quantity;

/// Delays of a covariate that are tried, rows.
const DELAYS: [i32; 10] = [-20, -10, -5, -3, -1, 1, 3, 5, 10, 20];

/// Ratio of the squared correlations above which a delay is a variant.
const MIN_DELAY_GAIN: f64 = 1.1;

/// Most columns of other joints.
const MOST_COUPLED: usize = 8;

/// Returns a known covariate, with the delay that explains most in the given form.
fn forms(context: &Context, quantity: Quantity, form: impl Fn(&[f64]) -> Vec<f64>) -> Vec<Columns> {
    let Some(covariate) = context.rows.quantity(quantity) else { return Vec::new() };
    with_delays(context, covariate, form)
}

fn with_delays(
    context: &Context,
    covariate: &Covariate,
    form: impl Fn(&[f64]) -> Vec<f64>,
) -> Vec<Columns> {
    let variant = |detail: String, column| Columns {
        follows: covariate.name.clone(),
        detail,
        columns: vec![column],
    };
    let own = form(&covariate.scaled);
    let explains = |column: &[f64]| correlation(column, context.residual).powi(2);
    let base = explains(&own);
    let mut found = vec![variant(String::new(), own)];
    // A column with a few levels does not say when it changed within a level.
    if covariate.levels < 12 {
        return found;
    }
    let late = |rows: i32| form(&shift(&covariate.scaled, &context.rows.runs, -rows));
    let best = DELAYS
        .into_iter()
        .map(|rows| (explains(&late(rows)), rows))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((gain, rows)) =
        best.filter(|(gain, _)| *gain > MIN_DELAY_GAIN * base && *gain > 0.01)
    {
        let _ = gain;
        found.push(variant(format!("column {rows} rows late"), late(rows)));
    }
    found
}

pub(super) fn pressure_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Pressure, |p| product(p, context.level))
}

pub(super) fn radial_force_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::RadialForce, |f| product(f, context.level))
}

pub(super) fn radial_force_rate(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    forms(context, Quantity::RadialForce, |force| {
        let rate = rows.slope(force);
        let bends = rows.map(|row| rate[row] * (1.0 - context.stop()[row].abs()));
        low_pass(&bends, &rows.runs, 3.0)
    })
    .into_iter()
    .take(1)
    .collect()
}

pub(super) fn load_torque_coulomb(context: &Context) -> Vec<Columns> {
    let Some(load) = context.rows.quantity(Quantity::LoadTorque) else { return Vec::new() };
    let column = context.with_level(|row| load.values[row].abs());
    vec![Columns { follows: load.name.clone(), columns: vec![column], ..Columns::default() }]
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
    let columns = |channel: &Covariate| Columns {
        follows: channel.name.clone(),
        columns: vec![channel.scaled.clone()],
        ..Columns::default()
    };
    channels.map(columns).collect()
}

pub(super) fn temperature_viscous(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Temperature, |t| product(t, &context.rows.smooth_velocity))
}

pub(super) fn temperature_coulomb(context: &Context) -> Vec<Columns> {
    forms(context, Quantity::Temperature, |t| product(t, context.level))
}

/// A column that scales gravity or inertia, such as the mass that the joint carries.
pub(super) fn payload(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let is_load = |own: &&Covariate| own.quantity.is_none() && own.motion.is_none();
    let extras = rows.covariates.iter().filter(is_load);
    let scales = |covariate: &Covariate| {
        let mut columns = Vec::new();
        if rows.rigid_body.gravity {
            columns.push(rows.map(|row| covariate.scaled[row] * rows.position[row].sin()));
            columns.push(rows.map(|row| covariate.scaled[row] * rows.position[row].cos()));
        }
        if rows.rigid_body.inertia {
            columns.push(product(&covariate.scaled, &rows.acceleration));
        }
        Columns { follows: covariate.name.clone(), columns, ..Columns::default() }
    };
    extras.map(scales).collect()
}

/// Velocities and accelerations of other joints, and products of two velocities. A joint without an acceleration in the log has
/// the slope of its velocity.
pub(super) fn joint_coupling(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let of = |wanted: OtherMotion| {
        let own = rows.covariates.iter().filter(move |own| own.motion == Some(wanted));
        own.take(MOST_COUPLED).collect::<Vec<&Covariate>>()
    };
    let (velocities, accelerations) = (of(OtherMotion::Velocity), of(OtherMotion::Acceleration));
    let all: Vec<&Covariate> = velocities.iter().chain(&accelerations).copied().collect();
    if all.is_empty() {
        return Vec::new();
    }
    let follows = all.iter().map(|other| other.name.as_str()).collect::<Vec<_>>().join(", ");
    let values = |own: &[&Covariate]| own.iter().map(|one| one.values.clone()).collect();
    let speeds: Vec<Vec<f64>> = values(&velocities);
    let mut inertial: Vec<Vec<f64>> = values(&accelerations);
    if inertial.is_empty() {
        inertial = speeds.iter().map(|speed| rows.slope(speed)).collect();
    }
    let mut products = Vec::new();
    for (at, a) in speeds.iter().enumerate() {
        products.extend(speeds[at..].iter().map(|b| product(a, b)));
        products.push(product(a, &rows.velocity));
    }
    let linear: Vec<Vec<f64>> = speeds.iter().chain(&inertial).cloned().collect();
    let quadratic = inertial.iter().chain(&products).cloned().collect();
    let variant = |detail: &str, columns: Vec<Vec<f64>>| Columns {
        follows: follows.clone(),
        detail: detail.into(),
        columns,
    };
    let found = [
        ("accelerations", inertial),
        ("velocities", speeds),
        ("velocities and accelerations", linear),
        ("accelerations and products", quadratic),
    ];
    found.map(|(detail, columns)| variant(detail, columns)).into()
}
