//! Checks of a log for measurement defects, before any model is fitted.
//!
//! A model explains whatever its columns hold, so it explains a logger's defects as friction: a late torque looks like
//! backlash, a noisy velocity at rest like a bristle. Each module here looks for one kind of defect and reports its
//! size in the log's own units; `CHECKS` is the list. Only three defects are corrected: rows with impossible values
//! are left out, the motion is reconstructed ([`crate::motion`]), and the rows between two readings of a held channel
//! are left out. Each correction can be switched off ([`Corrections`]), and the finding states whether it was applied.
//! All other defects are only reported, because a correction would need information that the log does not hold.
//!
//! A check must not report anything on an exact log, and every finding must be true. So each requires many standard
//! errors and a relevant size.

mod channel_lag;
mod column;
mod finding;
mod held;
mod independence;
mod log;
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

pub use finding::{LogFinding, LogFindingKind};
pub use log::Corrections;
pub use overview::{ColumnOverview, Overview, overview};

use crate::data::Dataset;
use crate::motion::{self, Sensors};
use crate::work::checkpoint;
use log::Log;

/// The checks in the order of the report: first those that make the others doubtful. Outliers are checked before.
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

/// A log with its findings.
#[derive(Clone, Debug)]
pub struct CheckedLog {
    /// The log with the corrections applied.
    pub data: Dataset,
    /// The defects.
    pub findings: Vec<LogFinding>,
    /// Properties of the motion sensors.
    pub sensors: Sensors,
}

/// Checks a log and applies the corrections.
pub fn check(data: Dataset, correct: Corrections) -> CheckedLog {
    let (data, mut findings) = outlier::outliers(data, correct.outliers);
    let (smoothed, sensors) = motion::reconstruct(&data);
    let columns = column::all(&data);
    let log = Log { data: &data, smoothed: &smoothed, sensors, columns, correct };
    findings.extend(CHECKS.iter().flat_map(|check| {
        checkpoint();
        check(&log)
    }));
    let fresh = held::fresh_rows(&log);
    drop(log);
    let (data, smoothed) = match fresh {
        Some(fresh) if fresh.is_motion_held => {
            let data = fresh.select(&data);
            let (smoothed, _) = motion::reconstruct(&data);
            (data, smoothed)
        }
        Some(fresh) => (fresh.select(&data), fresh.select(&smoothed)),
        None => (data, smoothed),
    };
    let data = if correct.motion { smoothed } else { data };
    CheckedLog { data, findings, sensors }
}
