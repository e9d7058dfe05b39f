//! A torque or velocity with inverted sign.
//!
//! In the contract, a positive torque drives positive velocity, so a joint with friction consumes power: the mean of
//! torque times velocity is positive. Inertia and gravity return what they take. If the joint delivers power on average,
//! one of the two columns has the wrong sign.
//!
//! Between the two limits a load may drive the joint, so the sign is only reported. Below the lower one, no friction is left
//! that opposes the motion, and the torque is turned.

use super::finding::{LogFinding, LogFindingKind};
use super::typed;
use crate::Dataset;
use compensator_core::quantity::Quantity;

/// Mean power relative to its mean magnitude, below which the sign is doubtful. Friction alone gives +0.9 and more; a
/// gear that a load drives backwards gives about 0.
const MAX_POWER_RATIO: f64 = -0.25;

/// The same, below which the torque is turned.
const TURNED_POWER_RATIO: f64 = -0.5;

/// Finds a torque that drives the motion, and turns its sign if `correct` is true.
pub fn sign(data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let (mut power, mut size) = (0.0, 0.0);
    for run in &data.runs {
        for (torque, velocity) in run.torque.iter().zip(&run.velocity) {
            power += torque * velocity;
            size += (torque * velocity).abs();
        }
    }
    if size <= 0.0 || power / size >= MAX_POWER_RATIO {
        return (data, Vec::new());
    }
    let corrected = correct && power / size < TURNED_POWER_RATIO;
    let (torque, velocity) =
        (Quantity::Torque.name(data.joint), Quantity::Velocity.name(data.joint));
    let pair = typed(&data, torque, &format!("-{}", data.joint.torque_unit()));
    let percent = format!("{:.0}", -100.0 * power / size);
    let in_words = if corrected {
        format!(
            "The sign of {torque} is reversed: it drives the motion ({percent} % of the power comes out of the joint), but \
             friction opposes it. The diagnosis uses the torque with the other sign; --columns {pair} reads it so."
        )
    } else {
        format!(
            "The sign of {torque} may be reversed: it drives the motion ({percent} % of the power comes out of the joint), \
             but friction opposes it. Nothing is changed; --columns {pair} turns it."
        )
    };
    let finding = LogFinding {
        kind: LogFindingKind::SignSuspect,
        columns: vec![torque.into(), velocity.into()],
        value: power / size,
        unit: "of the power".into(),
        corrected,
        in_words,
    };
    let mut data = data;
    if corrected {
        data.runs.iter_mut().flat_map(|run| &mut run.torque).for_each(|torque| *torque = -*torque);
    }
    (data, vec![finding])
}
