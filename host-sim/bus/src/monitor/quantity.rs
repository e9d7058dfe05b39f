//! The quantities of a joint that the monitor shows.

use compensator_core::can::JointKind;

/// A quantity with a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Velocity of the joint.
    Velocity,
    /// Friction torque of the model.
    Friction,
    /// Current of the compensation.
    FeedForward,
    /// Total commanded current.
    Current,
    /// Residual torque that the model does not explain.
    Residual,
}

impl Quantity {
    /// Every quantity, in the order of the charts.
    pub const ALL: [Self; 5] =
        [Self::Velocity, Self::Friction, Self::FeedForward, Self::Current, Self::Residual];

    /// Returns the name, short enough for a narrow screen.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Friction => "friction",
            Self::FeedForward => "feed-fwd",
            Self::Current => "current",
            Self::Residual => "residual",
        }
    }

    /// Returns the unit for this kind of joint.
    pub const fn unit(self, kind: JointKind) -> &'static str {
        match (self, kind) {
            (Self::FeedForward | Self::Current, _) => "A",
            (Self::Velocity, JointKind::Revolute) => "rad/s",
            (Self::Velocity, JointKind::Prismatic) => "m/s",
            (_, JointKind::Revolute) => "Nm",
            (_, JointKind::Prismatic) => "N",
        }
    }

    /// Returns the name in a line of JSON.
    pub(super) const fn key(self) -> &'static str {
        match self {
            Self::Velocity => "velocity_rad_s",
            Self::Friction => "friction_torque_nm",
            Self::FeedForward => "feed_forward_current_a",
            Self::Current => "current_a",
            Self::Residual => "residual_torque_nm",
        }
    }
}
