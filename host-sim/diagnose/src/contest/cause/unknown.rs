//! `unknown`: a column without a cause of its own, or two known columns together.
//!
//! The friction level may follow a column (straight or with a bend), or the column adds a torque of its own. The shape is part
//! of the variant, so that the report says how the torque follows the column.

use super::{Columns, Context};
use crate::contest::covariate::Covariate;
use crate::contest::law::product;
use joint_log::Quantity;

/// Pairs of quantities whose product may scale the friction level.
const PAIRS: [(Quantity, Quantity); 3] = [
    (Quantity::Pressure, Quantity::Temperature),
    (Quantity::Pressure, Quantity::RadialForce),
    (Quantity::RadialForce, Quantity::Temperature),
];

pub(super) fn columns(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let mut found = place(context);
    // Motions of other joints are a cause of their own.
    let is_free = |own: &&Covariate| own.quantity.is_none() && own.motion.is_none();
    for covariate in rows.covariates.iter().filter(is_free) {
        let x = &covariate.scaled;
        let level = product(x, context.level);
        let bent = product(x, &level);
        let mut shapes = vec![("level", vec![level.clone()])];
        if covariate.levels > 2 {
            shapes.push(("level, bent", vec![level, bent]));
        }
        shapes.push(("torque", vec![x.clone(), product(x, &rows.smooth_velocity)]));
        let variant = |(detail, columns): (&str, Vec<Vec<f64>>)| Columns {
            follows: covariate.name.clone(),
            detail: detail.into(),
            columns,
        };
        found.extend(shapes.into_iter().map(variant));
    }
    let pair = |(a, b): &(Quantity, Quantity)| Some((rows.quantity(*a)?, rows.quantity(*b)?));
    found.extend(PAIRS.iter().filter_map(pair).map(|(a, b)| together(context, a, b)));
    found
}

/// The place on the travel: the friction level, or a torque, as a smooth curve of the position.
fn place(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.has_position {
        return Vec::new();
    }
    let ends = rows
        .position
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| (a.min(*q), b.max(*q)));
    let half = (0.5 * (ends.1 - ends.0)).max(1e-12);
    let at = rows.map(|row| (rows.position[row] - ends.0) / half - 1.0);
    // Legendre polynomials, which are nearly independent over the travel.
    let square: Vec<f64> = at.iter().map(|x| 1.5 * x * x - 0.5).collect();
    let cube: Vec<f64> = at.iter().map(|x| 2.5 * x.powi(3) - 1.5 * x).collect();
    let curve = [at, square, cube];
    let level = curve.each_ref().map(|column| product(column, context.level)).to_vec();
    let name = Quantity::Position.name(rows.joint);
    let variant =
        |detail: &str, columns| Columns { follows: name.into(), detail: detail.into(), columns };
    vec![variant("level, curve", level), variant("torque, curve", curve.to_vec())]
}

fn together(context: &Context, a: &Covariate, b: &Covariate) -> Columns {
    let columns = vec![context.with_level(|row| a.scaled[row] * b.scaled[row])];
    Columns { follows: format!("{} x {}", a.name, b.name), detail: "level".into(), columns }
}
