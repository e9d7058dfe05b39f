//! The data that every check of a log reads.

use super::column::{self, Column};
use crate::Dataset;
use crate::motion::Sensors;
use compensator_core::quantity::Quantity;

/// The corrections to apply to a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corrections {
    /// Reconstruct the motion ([`crate::motion::reconstruct`]).
    pub motion: bool,
    /// Keep the logged motion if the torque follows it more closely ([`crate::motion::choice`]).
    pub motion_by_evidence: bool,
    /// Unwrap a position that wraps.
    pub wrapped: bool,
    /// Leave out rows with impossible values, and give weight 0 to spikes of the torque.
    pub outliers: bool,
    /// Turn a torque that drives the motion.
    pub sign: bool,
    /// Refuse a log whose units contradict each other.
    pub units: bool,
    /// Leave out the rows between two readings of a held torque or motion.
    pub held: bool,
}

impl Default for Corrections {
    fn default() -> Self {
        Self {
            motion: true,
            motion_by_evidence: true,
            wrapped: true,
            outliers: true,
            sign: true,
            units: true,
            held: true,
        }
    }
}

/// A log with what the checks need to know of it.
pub struct Log<'a> {
    pub data: &'a Dataset,
    /// The same log with the reconstructed motion.
    pub smoothed: &'a Dataset,
    pub sensors: Sensors,
    pub columns: Vec<Column<'a>>,
    pub correct: Corrections,
}

impl<'a> Log<'a> {
    pub fn new(
        data: &'a Dataset,
        smoothed: &'a Dataset,
        sensors: Sensors,
        correct: Corrections,
    ) -> Self {
        Self { data, smoothed, sensors, columns: column::all(data), correct }
    }
}

impl Log<'_> {
    /// Returns the column with a name.
    pub fn column(&self, name: &str) -> Option<&Column<'_>> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Returns the name of the velocity column.
    pub fn velocity(&self) -> &'static str {
        Quantity::Velocity.name(self.data.joint)
    }

    /// Returns the name of the position column.
    pub fn position(&self) -> &'static str {
        Quantity::Position.name(self.data.joint)
    }

    /// Returns the name of the torque column.
    pub fn torque(&self) -> &'static str {
        Quantity::Torque.name(self.data.joint)
    }
}
