//! Whether a joint turns or slides, and the units that follow from it.
//!
//! All code is written in the words of a joint that turns: "torque" means a force in N, and "velocity"
//! m/s, where the joint is [`JointKind::Prismatic`]. Only what a person reads asks for the kind.

/// Whether a joint turns or slides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// It turns: rad, rad/s, rad/s2, Nm.
    #[default]
    Revolute,
    /// It slides: m, m/s, m/s2, N.
    Prismatic,
}

impl JointKind {
    /// The one for a joint that turns, or the other.
    pub const fn choose(self, pair: [&'static str; 2]) -> &'static str {
        match self {
            Self::Revolute => pair[0],
            Self::Prismatic => pair[1],
        }
    }

    /// `"Nm"` or `"N"`.
    pub const fn torque_unit(self) -> &'static str {
        self.choose(["Nm", "N"])
    }

    /// `"rad"` or `"m"`.
    pub const fn position_unit(self) -> &'static str {
        self.choose(["rad", "m"])
    }

    /// `"rad/s"` or `"m/s"`.
    pub const fn velocity_unit(self) -> &'static str {
        self.choose(["rad/s", "m/s"])
    }

    /// `"rad/s2"` or `"m/s2"`.
    pub const fn acceleration_unit(self) -> &'static str {
        self.choose(["rad/s2", "m/s2"])
    }
}
