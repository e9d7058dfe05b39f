//! `unknown`: a column without a cause of its own, or two known columns together.
//!
//! The friction level may follow a column (straight or with a bend), or the column adds a torque of its own. The shape is part
//! of the variant, so that the report says how the torque follows the column.

use super::{Columns, Context};
use crate::covariate::Covariate;
use crate::law::product;
use joint_log::Quantity;

/// Pairs of quantities whose product may scale the friction level.
const PAIRS: [(Quantity, Quantity); 3] = [
    (Quantity::Pressure, Quantity::Temperature),
    (Quantity::Pressure, Quantity::RadialForce),
    (Quantity::RadialForce, Quantity::Temperature),
];

pub(super) fn columns(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    let mut found = Vec::new();
    for covariate in rows.covariates.iter().filter(|covariate| covariate.quantity.is_none()) {
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

fn together(context: &Context, a: &Covariate, b: &Covariate) -> Columns {
    let columns = vec![context.with_level(|row| a.scaled[row] * b.scaled[row])];
    Columns { follows: format!("{} x {}", a.name, b.name), detail: "level".into(), columns }
}
