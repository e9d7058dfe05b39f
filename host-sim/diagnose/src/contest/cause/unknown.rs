//! `unknown`: a column without a cause of its own, or two known columns together.
//!
//! The friction level may follow a column (straight or with a bend), or the column adds a torque of its own. The shape is part
//! of the variant, so that the report says how the torque follows the column.

use super::{Columns, Context, of_level};
use crate::contest::covariate::Covariate;
use crate::contest::detail::Detail;
use friction_fit::linear::{Factor, Regressor};
use joint_log::Quantity;
use joint_log::statistics::extent;

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
    let is_free =
        |covariate: &&Covariate| covariate.quantity.is_none() && covariate.motion.is_none();
    for covariate in rows.covariates.iter().filter(is_free) {
        let x = covariate.factor();
        let level = of_level(x.clone());
        let mut shapes = vec![(curve(true, ""), vec![level.clone()])];
        if covariate.levels > 2 {
            shapes.push((curve(true, "bent"), vec![level.clone(), level.times(x.clone())]));
        }
        let torque = vec![Regressor::from([x.clone()]), Regressor::from([x, Factor::Velocity])];
        shapes.push((curve(false, ""), torque));
        let follows = || vec![covariate.name.clone()];
        let variant = |(detail, regressors)| Columns { follows: follows(), detail, regressors };
        found.extend(shapes.into_iter().map(variant));
    }
    let pair = |(a, b): &(Quantity, Quantity)| Some((rows.quantity(*a)?, rows.quantity(*b)?));
    found.extend(PAIRS.iter().filter_map(pair).map(|(a, b)| together(a, b)));
    found
}

/// The place on the travel: the friction level, or a torque, as a smooth curve of the position.
fn place(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.has_position {
        return Vec::new();
    }
    let [from, to] = extent(rows.position.iter().copied());
    let curves = [1, 2, 3].map(|degree| Factor::Curve { degree, from, to });
    let name = Quantity::Position.name(rows.joint);
    let variant = |of_level: bool, regressors| Columns {
        follows: vec![name.into()],
        detail: curve(of_level, "curve"),
        regressors,
    };
    let level = curves.clone().map(of_level).to_vec();
    let torque = curves.map(|factor| Regressor::from([factor])).to_vec();
    vec![variant(true, level), variant(false, torque)]
}

fn curve(of_level: bool, shape: &'static str) -> Detail {
    Detail::Curve { of_level, shape }
}

fn together(a: &Covariate, b: &Covariate) -> Columns {
    let regressors = vec![of_level(a.factor()).times(b.factor())];
    Columns { follows: vec![a.name.clone(), b.name.clone()], detail: curve(true, ""), regressors }
}
