//! Findings of the checks of a log.

/// Kind of a measurement defect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LogFindingKind {
    /// The velocity has noise, in motion or at rest.
    VelocityNoise,
    /// The velocity is late or early relative to the derivative of the position.
    VelocityLag,
    /// The torque is late relative to the motion.
    TorqueLag,
    /// Another column is late or early relative to the torque it follows.
    ChannelLag,
    /// A column is held over several rows.
    HeldChannel,
    /// A column has coarse quantisation.
    Quantised,
    /// A column is clipped at an end of its range.
    Saturated,
    /// The clock jumps or repeats stamps, or rows are missing.
    TimeJump,
    /// A column may have another unit or origin than its name states.
    UnitSuspect,
    /// The position wraps, for example after each turn.
    WrappedAngle,
    /// The torque may have the wrong sign.
    SignSuspect,
    /// A column holds impossible values.
    Outlier,
    /// The log has too few independent rows.
    TooLittle,
}

impl LogFindingKind {
    /// All kinds.
    pub const ALL: [Self; 13] = [
        Self::VelocityNoise,
        Self::VelocityLag,
        Self::TorqueLag,
        Self::ChannelLag,
        Self::HeldChannel,
        Self::Quantised,
        Self::Saturated,
        Self::TimeJump,
        Self::UnitSuspect,
        Self::WrappedAngle,
        Self::SignSuspect,
        Self::Outlier,
        Self::TooLittle,
    ];

    /// Returns the name used in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::VelocityNoise => "velocity-noise",
            Self::VelocityLag => "velocity-lag",
            Self::TorqueLag => "torque-lag",
            Self::ChannelLag => "channel-lag",
            Self::HeldChannel => "held-channel",
            Self::Quantised => "quantised",
            Self::Saturated => "saturated",
            Self::TimeJump => "time-jump",
            Self::UnitSuspect => "unit-suspect",
            Self::WrappedAngle => "wrapped-angle",
            Self::SignSuspect => "sign-suspect",
            Self::Outlier => "outlier",
            Self::TooLittle => "too-little",
        }
    }

    /// Returns the kind with a name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A measurement defect of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogFinding {
    /// The kind of defect.
    pub kind: LogFindingKind,
    /// The affected columns, by their names in the contract.
    pub columns: Vec<String>,
    /// The size of the defect.
    pub value: f64,
    /// The unit of `value`.
    pub unit: String,
    /// True if the returned log is corrected for it.
    pub corrected: bool,
    /// A description in one sentence.
    pub in_words: String,
}
