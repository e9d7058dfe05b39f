//! Checks of a log for measurement defects, before any model is fitted.
//!
//! A model explains whatever its columns hold, so it explains a logger's defects as friction: a late torque looks like
//! backlash, a noisy velocity at rest like a bristle. Each module here looks for one kind of defect and reports its
//! size in the log's own units; `CHECKS` is the list. Some defects are corrected (`CORRECTIONS`): a position that wraps is
//! unwrapped, a torque whose sign is reversed is turned, impossible values are left out and spikes have weight 0, a run is
//! divided where the position jumps, rows at an end stop or with the drive off are left out, offsets of runs are subtracted, the
//! motion is reconstructed ([`crate::motion`]), and the rows between two readings of a held channel are left out. Each
//! correction can be switched off ([`Corrections`]), and the finding states whether it was applied. Columns that contradict each
//! other refuse the log (`SUSPICIONS`). All other defects are only reported, because a correction would need information that
//! the log does not hold.
//!
//! A check must not report anything on an exact log, and every finding must be true. So each requires many standard
//! errors and a relevant size. A log to which no model can be fitted is refused ([`refuse`]).

mod channel_lag;
mod column;
mod computed_torque;
mod constant_torque;
mod drive_off;
mod end_stop;
mod finding;
mod held;
mod independence;
mod isolated;
mod log;
mod lost_rows;
mod magnitude;
pub(crate) mod nearly_named;
mod outlier;
mod overview;
mod position_jump;
mod position_zero;
mod quantised;
mod rate;
mod register;
mod rows;
mod run_offset;
mod saturated;
mod sign;
mod spike;
mod suspicion;
mod swapped;
mod time;
mod torque_lag;
mod two_sources;
mod unit;
mod velocity;
mod wrap;

pub use finding::{LogFinding, LogFindingKind};
pub use log::Corrections;
pub use overview::{ColumnOverview, Overview, overview};
pub use sign::drives_both_ways;
pub use suspicion::Suspicion;

use crate::motion::{self, Sensors};
use crate::setting::shell_word;
use crate::work::checkpoint;
use crate::{DataError, Dataset};
use log::Log;

/// The checks in the order of the report: first those that make the others doubtful. Wraps, outliers, the sign of the torque
/// and held channels are checked before.
const CHECKS: [fn(&Log) -> Vec<LogFinding>; 10] = [
    independence::too_little,
    unit::units,
    position_zero::position_zero,
    time::jumps,
    velocity::noise,
    velocity::lag,
    torque_lag::torque_lag,
    channel_lag::channel_lag,
    quantised::quantised,
    saturated::saturated,
];

/// The checks of the columns as read that refuse a log unless its kind is kept as logged, the gravest first.
const SUSPICIONS: [fn(&Log) -> Option<Suspicion>; 3] =
    [two_sources::suspicion, register::suspicion, magnitude::suspicion];

/// A correction of the log as read.
type Correction = fn(Dataset, bool) -> (Dataset, Vec<LogFinding>);

/// The corrections before the motion is reconstructed, in their order, each with the kind that keeps the log as it is.
const CORRECTIONS: [(LogFindingKind, Correction); 9] = [
    (LogFindingKind::Outlier, outlier::outliers),
    (LogFindingKind::Outlier, isolated::isolated),
    (LogFindingKind::PositionJump, position_jump::position_jumps),
    (LogFindingKind::TimeJump, lost_rows::lost_rows),
    (LogFindingKind::EndStop, end_stop::end_stop),
    (LogFindingKind::DriveOff, drive_off::drive_off),
    (LogFindingKind::Outlier, spike::spikes),
    (LogFindingKind::SignSuspect, sign::sign),
    (LogFindingKind::OffsetPerRun, run_offset::run_offset),
];

/// The checks that refuse a log, because no model can be fitted to it.
const REFUSALS: [fn(&Dataset) -> Option<DataError>; 3] =
    [rate::impossible, constant_torque::constant_torque, swapped::swapped];

/// A log with its findings.
#[derive(Clone, Debug)]
pub struct CheckedLog {
    /// The log with the corrections applied.
    pub data: Dataset,
    /// The defects.
    pub findings: Vec<LogFinding>,
    /// Set if the log is to be refused.
    pub suspicion: Option<Suspicion>,
    /// Properties of the motion sensors.
    pub sensors: Sensors,
    /// True if the motion is used as logged because the torque follows it more closely.
    pub is_motion_logged: bool,
    /// Summary of the log, after a position was unwrapped and before any other correction.
    pub overview: Overview,
}

const MOTION_AS_LOGGED: &str = "the velocity is used as logged: the torque follows it more closely than the motion that is \
                                reconstructed from position and velocity; --motion smoothed uses that one";

/// Refuses a log to which no model can be fitted: an impossible rate, a constant torque, swapped columns.
///
/// # Errors
/// Returns one line with what was found and what to type.
pub fn refuse(data: &Dataset) -> Result<(), DataError> {
    REFUSALS.iter().find_map(|refusal| refusal(data)).map_or(Ok(()), Err)
}

/// Checks a log and applies the corrections.
pub fn check(data: Dataset, correct: Corrections) -> CheckedLog {
    let (mut data, mut findings) =
        wrap::unwrapped(data, correct.corrects(LogFindingKind::WrappedAngle));
    data.notes.extend(nearly_named::suggestions(&data));
    let overview = overview(&data);
    let as_read = Log::new(&data, &data, Sensors::default(), correct);
    let suspicions = SUSPICIONS.iter().filter_map(|suspicion| suspicion(&as_read));
    let (mut refused, kept): (Vec<_>, Vec<_>) =
        suspicions.partition(|suspicion| correct.corrects(suspicion.kind));
    findings.extend(kept.into_iter().map(Suspicion::finding));
    for (kind, correction) in CORRECTIONS {
        checkpoint();
        let found;
        (data, found) = correction(data, correct.corrects(kind));
        findings.extend(found);
    }
    let (mut smoothed, mut sensors) = motion::reconstruct(&data);
    let log = Log::new(&data, &smoothed, sensors, correct);
    let fresh = held::fresh_rows(&log);
    let held = held::held(&log, fresh.as_ref());
    // The stairs of a held motion look like noise and lag, so the other checks read the rows that are kept.
    if let Some(fresh) = fresh.as_ref().filter(|fresh| fresh.is_motion_held) {
        data = fresh.select(&data);
        (smoothed, sensors) = motion::reconstruct(&data);
    }
    let log = Log::new(&data, &smoothed, sensors, correct);
    findings.extend(computed_torque::computed_torque(&log));
    findings.extend(CHECKS.iter().flat_map(|check| {
        checkpoint();
        check(&log)
    }));
    // A unit that is kept has a finding of its own.
    let is_kept = |suspicion: &Suspicion| !correct.corrects(suspicion.kind);
    refused.extend(unit::suspicion(&log).filter(|suspicion| !is_kept(suspicion)));
    findings.extend(held);
    if let Some(fresh) = fresh.filter(|fresh| !fresh.is_motion_held) {
        (data, smoothed) = (fresh.select(&data), fresh.select(&smoothed));
    }
    let by_evidence = correct.motion && correct.motion_by_evidence;
    let is_motion_logged = by_evidence && motion::logged_is_better(&data, &smoothed);
    let is_reconstructed = correct.motion && !is_motion_logged;
    let mut data = if is_reconstructed { smoothed } else { data };
    if is_motion_logged {
        data.notes.push(MOTION_AS_LOGGED.to_owned());
    }
    let suspicion = refused.into_iter().next();
    CheckedLog { data, findings, suspicion, sensors, overview, is_motion_logged }
}

/// Returns the pair of `--columns` that reads a column in this unit, as a shell takes it.
fn typed(data: &Dataset, name: &str, unit: &str) -> String {
    shell_word(&format!("{name}={}:{unit}", header(data, name)))
}

/// Returns the name of a column in the file.
fn header<'a>(data: &'a Dataset, name: &'a str) -> &'a str {
    data.source(name).map_or(name, |source| source.header.as_str())
}
