//! Findings of the checks of a log.

named! {
    /// Kind of a measurement defect.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum LogFindingKind {
        /// The velocity has noise, in motion or at rest.
        VelocityNoise = "velocity-noise",
        /// The velocity is late or early relative to the derivative of the position.
        VelocityLag = "velocity-lag",
        /// The torque is late relative to the motion.
        TorqueLag = "torque-lag",
        /// Another column is late or early relative to the torque it follows.
        ChannelLag = "channel-lag",
        /// A column is held over several rows.
        HeldChannel = "held-channel",
        /// A column has coarse quantisation.
        Quantised = "quantised",
        /// A column is clipped at an end of its range.
        Saturated = "saturated",
        /// The clock jumps or repeats stamps, or rows are missing.
        TimeJump = "time-jump",
        /// A column may have another unit or origin than its name states.
        UnitSuspect = "unit-suspect",
        /// The position wraps, for example after each turn.
        WrappedAngle = "wrapped-angle",
        /// The torque was not measured: it is computed by the control law of a servo.
        ComputedTorque = "computed-torque",
        /// The torque may have the wrong sign.
        SignSuspect = "sign-suspect",
        /// The torque holds a share of another channel, whichever way the joint moves.
        ChannelGain = "channel-gain",
        /// A column holds impossible values.
        Outlier = "outlier",
        /// The position jumps farther than any speed allows.
        PositionJump = "position-jump",
        /// A column has a sign bit that is read as a part of the number.
        SignBit = "sign-bit",
        /// The torque is a magnitude without its sign.
        MagnitudeOnly = "magnitude-only",
        /// The drive was off while the joint moved.
        DriveOff = "drive-off",
        /// The joint is pushed against an end stop.
        EndStop = "end-stop",
        /// The offset of the torque differs from run to run.
        OffsetPerRun = "offset-per-run",
        /// The rows are of two sources.
        TwoSources = "two-sources",
        /// The log has too few independent rows.
        TooLittle = "too-little",
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

impl LogFindingKind {
    /// Returns a finding of this kind that nothing is corrected for. The value has a unit.
    pub(super) fn finding(
        self,
        columns: &[&str],
        value: f64,
        unit: &str,
        in_words: String,
    ) -> LogFinding {
        let columns = columns.iter().map(|name| (*name).to_owned()).collect();
        LogFinding { kind: self, columns, value, unit: unit.to_owned(), corrected: false, in_words }
    }
}

impl LogFinding {
    /// Returns the finding of a log that may be corrected for it.
    pub(super) fn corrected(self, corrected: bool) -> Self {
        Self { corrected, ..self }
    }
}
