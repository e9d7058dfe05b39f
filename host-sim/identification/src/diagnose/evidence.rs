//! Where a cause shows: what a residual is to be drawn over, as values.
//!
//! Each cause has a plane in which the base model's residual must have a shape and the extended model's
//! none: pressure raises the level, so what the base model misses along the motion rises with pressure; a
//! ripple is a wave over the position folded by its order. A cause says which plane; a report draws it.

/// What a residual is drawn over.
#[derive(Clone, Debug, PartialEq)]
pub enum Over {
    /// A column of the log.
    Column(String),
    /// The size of a column, whatever its sign.
    SizeOf(String),
    /// Change of a column per way travelled, where the joint moves.
    ChangePerTravel(String),
    /// The position within a turn, in degrees.
    Turn,
    /// The position times an order, folded to one wave, in degrees.
    Folded(f64),
    /// The speed.
    Speed,
    /// The acceleration.
    Acceleration,
    /// Time at rest before breaking away, for so long a way after it.
    RestBefore(f64),
    /// Travel since the last reversal, up to this.
    SinceReversal(f64),
    /// Time since the campaign began, h.
    CampaignTime,
    /// The rate of the simulated torque.
    TorqueRate,
}

/// As what a residual is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// With its own sign.
    Plain,
    /// Along the motion: positive where the log resists more than the model.
    Along,
    /// Over velocity: what a viscous coefficient misses.
    PerVelocity,
}

/// How wide the bins are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// All the same.
    Even,
    /// Narrow at zero, where friction changes fastest.
    NarrowAtZero,
    /// By the logarithm.
    Logarithmic,
    /// One for each run, where there are several.
    Runs,
}

/// A plane in which a residual has the shape of its cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Title of the chart.
    pub title: String,
    /// What it is drawn over.
    pub over: Over,
    /// As what.
    pub seen: Seen,
    /// How wide the bins are.
    pub spacing: Spacing,
    /// Whether the outermost hundredth on either side is left out, where one row stands for many.
    pub trimmed: bool,
    /// What the cause looks like here, in a sentence.
    pub says: String,
}

impl Plane {
    /// With even bins.
    pub fn new(title: impl Into<String>, over: Over, seen: Seen, says: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            over,
            seen,
            spacing: Spacing::Even,
            trimmed: false,
            says: says.into(),
        }
    }

    /// With other bins.
    #[must_use]
    pub fn spaced(self, spacing: Spacing) -> Self {
        Self { spacing, ..self }
    }

    /// Without its ends.
    #[must_use]
    pub fn trimmed(self) -> Self {
        Self { trimmed: true, ..self }
    }
}

/// Where a finding shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Evidence {
    /// In a plane.
    Plane(Plane),
    /// Over speed, with a line for each direction.
    ByDirection {
        /// As what the residual is looked at.
        seen: Seen,
        /// What the cause looks like, in a sentence.
        says: String,
    },
}

impl From<Plane> for Option<Evidence> {
    fn from(plane: Plane) -> Self {
        Some(Evidence::Plane(plane))
    }
}
