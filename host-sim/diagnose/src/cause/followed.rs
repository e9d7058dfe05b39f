//! A column that an unknown effect may follow.

use crate::candidate::Row;
use compensator_core::Quantity;

/// A column that the curve may follow.
pub struct Followed {
    /// Name in the log.
    pub name: String,
    /// Measured quantity; [`Quantity::Auxiliary`] for one of the log's extra covariates.
    pub quantity: Quantity,
    /// Index among the log's extra covariates, if it is one.
    pub covariate: Option<usize>,
}

impl Followed {
    /// Returns the value of a quantity in a row, in the core's unit.
    pub fn read(quantity: Quantity, row: &Row) -> f64 {
        match quantity {
            Quantity::Auxiliary => row.extra,
            known => known.value_in(row.sample).unwrap_or_default(),
        }
    }

    /// Returns the number of the column in the core.
    pub fn number(&self) -> f64 {
        self.quantity.info().column.map_or(0.0, f64::from)
    }

    /// Returns true if the column is neither the joint's motion nor the time.
    pub fn is_covariate(&self) -> bool {
        use Quantity as Is;
        ![Is::Velocity, Is::Position, Is::CampaignTime].contains(&self.quantity)
    }
}
