//! The kind of a joint, revolute or prismatic, and the units of each kind.
//!
//! The code uses the terms of a revolute joint. For a [`JointKind::Prismatic`] joint, "torque" means a force in N
//! and "velocity" a speed in m/s. Only text for users depends on the kind.

/// The kind of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// A joint that turns: rad, rad/s, rad/s2, Nm.
    #[default]
    Revolute,
    /// A joint that slides: m, m/s, m/s2, N.
    Prismatic,
}

impl JointKind {
    /// Returns the first item for a revolute joint and the second for a prismatic joint.
    pub const fn choose(self, pair: [&'static str; 2]) -> &'static str {
        match self {
            Self::Revolute => pair[0],
            Self::Prismatic => pair[1],
        }
    }

    /// Returns `"Nm"` or `"N"`.
    pub const fn torque_unit(self) -> &'static str {
        self.choose(["Nm", "N"])
    }

    /// Returns `"rad"` or `"m"`.
    pub const fn position_unit(self) -> &'static str {
        self.choose(["rad", "m"])
    }

    /// Returns `"rad/s"` or `"m/s"`.
    pub const fn velocity_unit(self) -> &'static str {
        self.choose(["rad/s", "m/s"])
    }
}
