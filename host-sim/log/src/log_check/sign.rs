//! A torque or velocity with inverted sign.
//!
//! In the contract, a positive torque drives positive velocity, so a joint with friction consumes power: the mean of
//! torque times velocity is positive. Inertia and gravity return what they take. If the joint delivers power on average,
//! one of the two columns has the wrong sign.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::typed;

/// Mean power relative to its mean magnitude, below which the sign is doubtful. Friction alone gives +0.9 and more; a
/// gear that a load drives backwards gives about 0.
const MAX_POWER_RATIO: f64 = -0.25;

pub fn sign(log: &Log) -> Vec<LogFinding> {
    let (mut power, mut size) = (0.0, 0.0);
    for run in &log.data.runs {
        for (torque, velocity) in run.torque.iter().zip(&run.velocity) {
            power += torque * velocity;
            size += (torque * velocity).abs();
        }
    }
    if size <= 0.0 || power / size >= MAX_POWER_RATIO {
        return Vec::new();
    }
    let pair = typed(log.data, log.torque(), &format!("-{}", log.data.joint.torque_unit()));
    vec![LogFinding {
        kind: LogFindingKind::SignSuspect,
        columns: vec![log.torque().into(), log.velocity().into()],
        value: power / size,
        unit: "of the power".into(),
        corrected: false,
        in_words: format!(
            "The torque pushes along the motion ({:.0} % of the power comes out of the joint): the torque or the \
             velocity may have the other sign (--columns {pair} turns it). Nothing is changed.",
            -100.0 * power / size
        ),
    }]
}
