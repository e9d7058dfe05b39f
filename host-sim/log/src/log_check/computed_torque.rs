//! A torque that is computed by the control law of a servo.

use super::finding::{LogFinding, LogFindingKind};
use super::header;
use super::log::Log;

pub fn computed_torque(log: &Log) -> Option<LogFinding> {
    let law = log.data.torque_law.as_ref()?;
    let name = log.torque();
    let words = format!(
        "{name} was not measured. It is computed from the target {} by the law of the servo, {law}. It is right if these \
             are the gains of the drive, target and position have one clock, and the drive delivers what it commands: a \
             saturation, or friction that the drive compensates itself, is part of every result.",
        header(log.data, name)
    );
    Some(LogFindingKind::ComputedTorque.finding(&[name], log.data.rows as f64, "rows", words))
}
