//! Is the log what it says? Asked before any model.
//!
//! A model explains what is in its columns, and so it explains a logger's faults as friction: a torque that
//! is late looks like backlash, a velocity that flickers at rest like a bristle. Each file here looks for one
//! family of faults and says how large it is, in the log's own units; `CHECKS` is the list. Two things
//! are corrected and nothing else: rows with a value that cannot be are left out, and the motion is
//! reconstructed ([`crate::motion`]). Both can be switched off ([`Correct`]), and either way the finding says so.
//! Everything else is only told, because a correction would need what the log does not hold: a held channel
//! interpolated has values nobody measured, a late one shifted is a model of the logger.
//!
//! A check must be silent on an exact log, and what it lists must be true: each asks for many standard errors
//! and for a size that matters.

mod channel_lag;
mod column;
mod held;
mod independence;
mod outlier;
mod overview;
mod position_zero;
mod quantised;
mod saturated;
mod sign;
mod time;
mod torque_lag;
mod unit;
mod velocity;

pub use overview::{ColumnOverview, Overview, overview};

use crate::data::Dataset;
use crate::motion::{self, Sensors};
use column::Column;
use compensator_core::quantity::Quantity;

/// What may be wrong with a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The velocity is noisy; at rest it flickers.
    VelocityNoise,
    /// The velocity is late (or early) against the derivative of the position.
    VelocityLag,
    /// The torque is late against the motion.
    TorqueLag,
    /// Another column is late (or early) against the torque it follows.
    ChannelLag,
    /// A column is held over several rows.
    HeldChannel,
    /// A column comes in coarse steps.
    Quantised,
    /// A column stands at its end.
    Saturated,
    /// The clock jumps, repeats or misses rows.
    TimeJump,
    /// A column may be in other units, or count from elsewhere, than its name says.
    UnitSuspect,
    /// The torque may have the other sign.
    SignSuspect,
    /// Values that cannot be.
    Outlier,
    /// Too few rows that tell something of their own.
    TooLittle,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::VelocityNoise,
        Self::VelocityLag,
        Self::TorqueLag,
        Self::ChannelLag,
        Self::HeldChannel,
        Self::Quantised,
        Self::Saturated,
        Self::TimeJump,
        Self::UnitSuspect,
        Self::SignSuspect,
        Self::Outlier,
        Self::TooLittle,
    ];

    /// Its name in files and on the command line.
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
            Self::SignSuspect => "sign-suspect",
            Self::Outlier => "outlier",
            Self::TooLittle => "too-little",
        }
    }

    /// The kind of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Something that is wrong with a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogFinding {
    /// What.
    pub kind: Kind,
    /// Columns that are concerned, by their names in the contract.
    pub columns: Vec<String>,
    /// How large it is.
    pub value: f64,
    /// The unit of `value`.
    pub unit: String,
    /// Whether what follows works on a log in which it was corrected.
    pub corrected: bool,
    /// A sentence.
    pub in_words: String,
}

/// What is corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Correct {
    /// The motion, by [`motion::reconstruct`].
    pub motion: bool,
    /// Rows with values that cannot be, by leaving them out.
    pub outliers: bool,
    /// A torque or a motion that is held over several rows, by leaving out those between.
    pub held: bool,
}

impl Default for Correct {
    fn default() -> Self {
        Self { motion: true, outliers: true, held: true }
    }
}

/// A log as the checks look at it.
struct Log<'a> {
    data: &'a Dataset,
    /// The same with the motion as it was.
    smoothed: &'a Dataset,
    sensors: Sensors,
    columns: Vec<Column<'a>>,
    correct: Correct,
}

impl Log<'_> {
    fn column(&self, name: &str) -> Option<&Column<'_>> {
        self.columns.iter().find(|column| column.name == name)
    }

    fn velocity(&self) -> &'static str {
        Quantity::Velocity.name(self.data.joint)
    }

    fn position(&self) -> &'static str {
        Quantity::Position.name(self.data.joint)
    }

    fn torque(&self) -> &'static str {
        Quantity::Torque.name(self.data.joint)
    }
}

/// The checks, in the order a reader wants them: what makes the rest doubtful first. Outliers were looked for
/// before.
const CHECKS: [fn(&Log) -> Vec<LogFinding>; 12] = [
    independence::too_little,
    unit::units,
    position_zero::position_zero,
    sign::sign,
    time::jumps,
    velocity::noise,
    velocity::lag,
    torque_lag::torque_lag,
    channel_lag::channel_lag,
    held::held,
    quantised::quantised,
    saturated::saturated,
];

/// A log that was looked at.
#[derive(Clone, Debug)]
pub struct Checked {
    /// The log as it is to be used.
    pub data: Dataset,
    /// What is wrong with it.
    pub findings: Vec<LogFinding>,
    /// What was found about the motion's sensors.
    pub sensors: Sensors,
}

/// Looks at a log, and corrects what is to be corrected.
pub fn check(data: Dataset, correct: Correct) -> Checked {
    let (data, mut findings) = outlier::outliers(data, correct.outliers);
    let (smoothed, sensors) = motion::reconstruct(&data);
    let columns = column::all(&data);
    let log = Log { data: &data, smoothed: &smoothed, sensors, columns, correct };
    findings.extend(CHECKS.iter().flat_map(|check| check(&log)));
    let fresh = held::fresh_rows(&log);
    drop(log);
    let (data, smoothed) = match fresh {
        Some(fresh) if fresh.of_motion => {
            let data = fresh.of(&data);
            let (smoothed, _) = motion::reconstruct(&data);
            (data, smoothed)
        }
        Some(fresh) => (fresh.of(&data), fresh.of(&smoothed)),
        None => (data, smoothed),
    };
    let data = if correct.motion { smoothed } else { data };
    Checked { data, findings, sensors }
}
