//! Formulas of the friction level over a column, which are simpler than a curve of any shape.
//!
//! Most covariates change a friction level in one of three ways:
//!
//! - In proportion, as a load that presses a contact.
//! - With saturation, as a band that is already tight or a film that is full.
//! - Exponentially, as a polymer that stiffens.
//!
//! Two numbers describe a formula: the relative rise from the lowest value in the log to the
//! highest, and the scale of a saturation. The core evaluates the formula at the knots of its table
//! ([`LookupFormula`]). A driver therefore has the same computing time as for any other table.

use super::followed::Followed;
use crate::candidate::{Candidate, InitialGuess, Row, row};
use crate::extended::{Extended, Size};
use crate::train_test::FollowedColumn;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
use compensator_core::{ParameterId as Id, Quantity, TermKind};
use joint_log::number::{figure, significant};

/// Scales of the saturating candidates, as shares of the column's range.
const SCALES: [f64; 2] = [0.1, 0.4];

/// Factors on the level over the column's range for the exponential candidates, one rising and one
/// falling. They are far from 1, because a linear fit cannot distinguish a slight curve from a
/// line.
const FACTORS: [f64; 2] = [4.0, 0.25];

/// Fewest different values of the column for a line. A curve needs one more.
const FEWEST_VALUES: usize = 3;

/// Returns true for a quantity whose named cause already contains a line over it.
fn has_named_line(quantity: Quantity) -> bool {
    use Quantity as Is;
    [Is::RadialForce, Is::Pressure, Is::LoadTorque, Is::Temperature].contains(&quantity)
}

/// Returns true if sorted values contain at least `count` different ones.
fn differ(sorted: &[f64], count: usize) -> bool {
    1 + sorted.windows(2).filter(|pair| pair[0] != pair[1]).count() >= count
}

/// A formula with its numbers.
#[derive(Clone, Copy)]
struct Shape {
    formula: LookupFormula,
    /// Relative rise over the column's range.
    rise: f64,
    /// Scale of a saturation, as a share of the range.
    scale: f64,
}

/// Returns the candidates of all formulas over one column. `values` are some of its values, sorted,
/// in the core's unit.
pub fn candidates(followed: &Followed, values: &[f64]) -> Vec<Candidate> {
    let (Some(least), Some(most)) = (values.first().copied(), values.last().copied()) else {
        return Vec::new();
    };
    if !followed.is_covariate() || !differ(values, FEWEST_VALUES) {
        return Vec::new();
    }
    let line = Shape { formula: LookupFormula::Linear, rise: 1.0, scale: 1.0 };
    let mut shapes: Vec<Shape> = Vec::new();
    if !has_named_line(followed.quantity) {
        shapes.push(line);
    }
    if differ(values, FEWEST_VALUES + 1) {
        let formula = LookupFormula::Saturating;
        shapes.extend(SCALES.map(|scale| Shape { formula, scale, ..line }));
        if followed.quantity != Quantity::Temperature {
            let formula = LookupFormula::Exponential;
            shapes.extend(FACTORS.map(|factor| Shape { formula, rise: factor - 1.0, ..line }));
        }
    }
    let candidate = |Shape { formula, rise, scale }: Shape| {
        let quantity = followed.quantity;
        let along = move |row: &Row| (Followed::read(quantity, row) - least) / (most - least);
        // Change of the torque per unit of the rise.
        let by = row(move |r| r.level * formula.at(along(r), rise, scale) / rise);
        let factor = quantity.info().outside_scale;
        let mut guesses = vec![
            (Id::LookupColumn, InitialGuess::At(followed.number())),
            (Id::LookupLower, InitialGuess::At(least * factor)),
            (Id::LookupUpper, InitialGuess::At(most * factor)),
            (Id::LookupFormula, InitialGuess::At(number(formula))),
            (Id::LookupRise, InitialGuess::first_times(1.0)),
            (Id::LookupScale, InitialGuess::At(scale * (most - least) * factor)),
        ];
        let knots = LOOKUP_TORQUES.into_iter().chain(LOOKUP_LEVELS);
        guesses.extend(knots.clone().map(|id| (id, InitialGuess::At(0.0))));
        let mut fixed = vec![Id::LookupColumn, Id::LookupLower, Id::LookupUpper];
        fixed.extend(knots);
        if formula != LookupFormula::Saturating {
            fixed.push(Id::LookupScale);
        }
        let follows = FollowedColumn {
            column: followed.name.clone(),
            covariate: followed.covariate,
            level: true,
            proportional: false,
            formula,
        };
        Candidate::new(TermKind::LookupTable, &[followed.name.as_str()], vec![by])
            .starting_at(&guesses)
            .keeping(&fixed)
            .following(follows)
    };
    shapes.into_iter().map(candidate).collect()
}

/// Returns the number of a formula in the core.
pub fn number(formula: LookupFormula) -> f64 {
    LookupFormula::ALL.iter().position(|known| *known == formula).unwrap_or_default() as f64
}

/// Returns the formula and its values in a sentence.
pub fn in_words(formula: LookupFormula, size: &Size, extended: &Extended, column: &str) -> String {
    let value = |id: Id| extended.value(id);
    let (lower, upper) = (value(Id::LookupLower), value(Id::LookupUpper));
    let (rise, span) = (value(Id::LookupRise), upper - lower);
    let (from, to) = (significant(lower, 4), significant(upper, 4));
    let along = format!("({column} - {from})");
    let (kind, law) = match formula {
        LookupFormula::Saturating => {
            let scale = value(Id::LookupScale);
            let most = figure(rise * (span + scale) / span);
            ("saturating", format!("1 + {most} {along} / ({along} + {})", significant(scale, 3)))
        }
        LookupFormula::Exponential => {
            ("exponential", format!("exp({} {along})", figure((1.0 + rise).ln() / span)))
        }
        _ => ("linear", format!("1 + {} {along}", figure(rise / span))),
    };
    format!(
        "the friction level follows {column}, {kind}: it is {law} times that at {from}; from {from} to {to} it \
         changes by a share of {}",
        size.in_words()
    )
}
