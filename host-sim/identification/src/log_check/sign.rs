//! A torque that pushes along the motion.
//!
//! The contract counts the torque positive when it drives positive velocity, so a joint with friction takes
//! power: the mean of torque times velocity is positive. Inertia and gravity give back what they take. Where
//! the joint gives power throughout, one of the two columns has the other sign.

use super::{Kind, Log, LogFinding};

/// Mean power over the mean of its size below which the sign is doubted: friction alone gives +0.9 and more, a
/// gear that is back-driven by a load hovers around 0.
const GIVES: f64 = -0.25;

pub fn sign(log: &Log) -> Vec<LogFinding> {
    let (mut power, mut size) = (0.0, 0.0);
    for run in &log.data.runs {
        for (torque, velocity) in run.torque.iter().zip(&run.velocity) {
            power += torque * velocity;
            size += (torque * velocity).abs();
        }
    }
    if size <= 0.0 || power / size >= GIVES {
        return Vec::new();
    }
    let torque = log.torque();
    vec![LogFinding {
        kind: Kind::SignSuspect,
        columns: vec![log.torque().into(), log.velocity().into()],
        value: power / size,
        unit: "of the power".into(),
        corrected: false,
        in_words: format!(
            "The torque pushes along the motion ({:.0} % of the power comes out of the joint): the torque or the \
             velocity may have the other sign (--columns {torque}=NAME:-{} turns it). Nothing is changed.",
            -100.0 * power / size,
            log.data.joint.torque_unit()
        ),
    }]
}
