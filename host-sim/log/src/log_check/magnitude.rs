//! A torque without its sign: a magnitude, or a register whose sign bit is read as a part of the number.
//!
//! Friction changes its sign with the direction. If a torque is never negative while the joint moves both ways, and the torque
//! times the direction follows the motion much better than the torque, the column holds a magnitude. A load that is held against
//! gravity is never negative either, but its torque follows the motion as it stands.

use super::log::Log;
use super::register;
use super::suspicion::Suspicion;
use super::{LogFindingKind, header};
use crate::torque_fit::{MovingRow, fit, moves_both_ways, moving_rows};

/// Maximum error of the law with the sign, relative to that without.
const MAX_SCATTER_RATIO: f64 = 0.7;

/// Minimum share of the moving rows in which a sign bit tells the direction.
const MIN_DIRECTION_SHARE: f64 = 0.75;

/// Minimum torque of a magnitude, as a share of the largest: its noise.
const MIN_TORQUE_SHARE: f64 = -0.02;

/// Returns the reason to refuse a torque without its sign.
pub fn suspicion(log: &Log) -> Option<Suspicion> {
    let torques = || log.data.runs.iter().flat_map(|run| run.torque.iter().copied());
    let largest = torques().fold(0.0, f64::max);
    if torques().any(|torque| torque < MIN_TORQUE_SHARE * largest) {
        return None;
    }
    let rows = moving_rows(log.data);
    if !moves_both_ways(rows.iter()) {
        return None;
    }
    let name = log.torque();
    let as_logged = fit(rows.iter().map(|row| (row.regressors, row.torque)))?.scatter;
    if let Some(bit) = log.column(name).and_then(|column| register::sign_bit(log, column)) {
        let signed = |row: &MovingRow| bit.values[row.place.run][row.place.row];
        let scatter = fit(rows.iter().map(|row| (row.regressors, signed(row))))?.scatter;
        let follows = scatter * bit.size < MAX_SCATTER_RATIO * as_logged;
        if follows || bit.begins_anew() && tells_direction(&rows, &signed) {
            return Some(register::refusal(log, vec![bit], "is never negative"));
        }
    }
    let signed = |torque: f64, is_back: bool| if is_back { -torque } else { torque };
    let pairs = rows.iter().map(|row| (row.regressors, signed(row.torque, row.is_back)));
    if fit(pairs)?.scatter > MAX_SCATTER_RATIO * as_logged {
        return None;
    }
    let found = format!(
        "a {name} that is never negative, though the joint moves both ways: it is a magnitude (the column {})",
        header(log.data, name)
    );
    let expected = "a torque with its sign".to_owned();
    Some(Suspicion::new(LogFindingKind::MagnitudeOnly, &[name], found, expected))
}

/// Returns true if the sign of a torque is mostly that of the motion, or mostly the other.
fn tells_direction(rows: &[MovingRow], torque: &dyn Fn(&MovingRow) -> f64) -> bool {
    let agrees = rows.iter().filter(|row| (torque(row) < 0.0) == row.is_back).count() as f64;
    let share = agrees / rows.len() as f64;
    share.max(1.0 - share) > MIN_DIRECTION_SHARE
}
