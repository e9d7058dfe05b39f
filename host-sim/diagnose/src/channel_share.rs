//! A share of another channel in the measured torque.
//!
//! A force that was computed as the reading of a load cell minus pressure times area holds a share of the pressure if the area,
//! or a gain, is a little wrong. It acts whichever way the joint moves, so it is no friction: the torque is corrected for it, and
//! the report says so.

/// A share of a channel in the torque, whichever way the joint moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelShare {
    /// The channel's column.
    pub column: String,
    /// Torque per unit of the column.
    pub torque_per_unit: f64,
    /// Mean of the column, at which the share is taken as 0: a constant torque belongs to the model.
    pub mean: f64,
}
