//! The data that every check of a log reads.

use super::column::{self, Column};
use super::finding::LogFindingKind;
use crate::Dataset;
use crate::motion::Sensors;
use compensator_core::quantity::Quantity;

/// The corrections to apply to a log, and the kinds for which a log is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corrections {
    /// Reconstruct the motion ([`crate::motion::reconstruct`]).
    pub motion: bool,
    /// Keep the logged motion if the torque follows it more closely.
    pub motion_by_evidence: bool,
    /// One bit for each kind that is kept as logged.
    kept: u32,
}

impl Default for Corrections {
    fn default() -> Self {
        Self::of_motion(None)
    }
}

impl Corrections {
    /// Returns all corrections, with the reconstructed motion or the logged one; `None` selects that to which the torque is
    /// closer.
    pub fn of_motion(is_reconstructed: Option<bool>) -> Self {
        let motion_by_evidence = is_reconstructed.is_none();
        Self { motion: is_reconstructed.unwrap_or(true), motion_by_evidence, kept: 0 }
    }

    /// Returns the corrections without those of some kinds, which are kept as logged.
    #[must_use]
    pub fn without(mut self, kinds: &[LogFindingKind]) -> Self {
        kinds.iter().for_each(|kind| self.kept |= 1 << *kind as u32);
        self
    }

    /// Returns the corrections that leave no row out and change no torque, for a prediction of every row.
    #[must_use]
    pub fn of_every_row(self) -> Self {
        use LogFindingKind as Kind;
        let left_out = [Kind::Outlier, Kind::HeldChannel, Kind::DriveOff, Kind::EndStop];
        self.without(&left_out).without(&[Kind::OffsetPerRun])
    }

    /// Returns true if a kind is corrected, or refused.
    pub fn corrects(self, kind: LogFindingKind) -> bool {
        self.kept & 1 << kind as u32 == 0
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
