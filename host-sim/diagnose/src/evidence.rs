//! Planes in which a residual shows the shape of its cause.
//!
//! In the plane of a cause, the residual of the base model has a characteristic shape, and that of
//! the extended model has none. Pressure, for example, raises the friction level, so the residual
//! along the motion rises with pressure. A ripple is a wave over the position, folded by its order.
//! A cause selects its plane. The report draws the plot.

/// Quantity on the horizontal axis of a residual plot.
#[derive(Clone, Debug, PartialEq)]
pub enum PlaneAxis {
    /// Value of a column of the log.
    Column(String),
    /// Absolute value of a column.
    SizeOf(String),
    /// Change of a column per travel, on rows in motion.
    ChangePerTravel(String),
    /// Position within a turn, in degrees.
    Turn,
    /// Position times an order, folded to one period, in degrees.
    Folded(f64),
    /// Speed.
    Speed,
    /// Acceleration.
    Acceleration,
    /// Time at rest before breakaway, for rows within this travel after it.
    RestBefore(f64),
    /// Travel since the last reversal, up to this limit.
    SinceReversal(f64),
    /// Time since the start of the campaign, h.
    CampaignTime,
    /// Rate of the simulated torque.
    TorqueRate,
}

/// Representation of a residual in a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResidualView {
    /// With its own sign.
    Plain,
    /// Along the motion: positive if the log resists more than the model.
    Along,
    /// Divided by velocity: the error of the viscous coefficient.
    PerVelocity,
}

/// Spacing of the bins of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// Equal widths.
    Even,
    /// Narrow at zero, because friction changes fastest there.
    NarrowAtZero,
    /// Logarithmic widths.
    Logarithmic,
    /// One bin for each run, if there are several runs.
    Runs,
}

/// A plane in which a residual has the shape of its cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Title of the chart.
    pub title: String,
    /// Horizontal axis.
    pub axis: PlaneAxis,
    /// Representation of the residual.
    pub view: ResidualView,
    /// Spacing of the bins.
    pub spacing: Spacing,
    /// True if the outermost hundredth on either side is excluded, because its bins contain few
    /// rows.
    pub trimmed: bool,
    /// Description of the cause's shape in this plot, in one sentence.
    pub description: String,
}

impl Plane {
    /// Creates a plane with even bins that is not trimmed.
    pub fn new(
        title: impl Into<String>,
        axis: PlaneAxis,
        view: ResidualView,
        description: impl Into<String>,
    ) -> Self {
        Self {
            title: title.into(),
            axis,
            view,
            spacing: Spacing::Even,
            trimmed: false,
            description: description.into(),
        }
    }

    /// Returns the plane with this spacing of its bins.
    #[must_use]
    pub fn spaced(self, spacing: Spacing) -> Self {
        Self { spacing, ..self }
    }

    /// Returns the plane without the outermost hundredth on either side.
    #[must_use]
    pub fn trimmed(self) -> Self {
        Self { trimmed: true, ..self }
    }
}

/// Plot that shows a finding.
#[derive(Clone, Debug, PartialEq)]
pub enum Evidence {
    /// Residual in a plane.
    Plane(Plane),
    /// Residual over speed, with one line for each direction.
    ByDirection {
        /// Representation of the residual.
        view: ResidualView,
        /// Description of the cause's shape, in one sentence.
        description: String,
    },
}

impl From<Plane> for Option<Evidence> {
    fn from(plane: Plane) -> Self {
        Some(Evidence::Plane(plane))
    }
}
