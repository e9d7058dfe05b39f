//! The torque of a servo without a torque sensor: its control law, evaluated on the logged motion.
//!
//! A position servo commands `kp (target - q) - kd v`. A log of the target and of the encoder with the gains of
//! the servo therefore holds a torque, as long as the drive delivers what it commands. While the log is read, the target
//! takes the place of the torque; [`ServoTorque::apply`] then replaces it.

use crate::error::DataError;
use crate::setting::Setting;
use crate::{Dataset, Quantity};
use compensator_core::quantity::JointKind;

/// A control law as a user may write it, for messages.
const EXAMPLE: &str = "pd,kp=40,kd=1.5,target=q_des";

/// Returns a control law with a target, as a user may write it.
pub(crate) fn example(target: &str) -> String {
    EXAMPLE.replace("q_des", target)
}

/// Why a text is no control law, displayed as what is expected instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ServoTorqueError {
    /// The law is not `pd`.
    #[error("pd, the control law, as in {EXAMPLE}")]
    Law,
    /// The value of this gain is no number.
    #[error("a number of {0}, as in {EXAMPLE}")]
    Number(String),
    /// The law has no such part.
    #[error("no {0:?}, as in {EXAMPLE}")]
    Part(String),
    /// A gain or the target is missing.
    #[error("kp above 0 and target, as in {EXAMPLE}")]
    Incomplete,
}

/// A servo's control law, with the column of its target.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoTorque {
    /// Gain of the position, Nm/rad or N/m.
    pub kp: f64,
    /// Gain of the velocity, Nm s/rad or N s/m.
    pub kd: f64,
    /// The column of the target position, with its unit as in [`ReadOptions::columns`](crate::ReadOptions::columns).
    pub target: String,
    /// Maximum torque or force of the servo, if it has one.
    pub limit: Option<f64>,
}

impl ServoTorque {
    /// Parses `pd,kp=40,kd=1.5,target=q_des`, optionally with `limit=3`.
    ///
    /// # Errors
    /// The expected text, as the end of a message.
    pub fn parse(text: &str) -> Result<Self, ServoTorqueError> {
        let mut parts = text.split(',').map(str::trim);
        if parts.next() != Some("pd") {
            return Err(ServoTorqueError::Law);
        }
        let (mut kp, mut kd, mut target, mut limit) = (None, None, None, None);
        for part in parts {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let number = || value.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
            match (name.trim(), number()) {
                ("kp", Some(gain)) => kp = Some(gain),
                ("kd", Some(gain)) => kd = Some(gain),
                ("limit", Some(most)) => limit = Some(most),
                ("kp" | "kd" | "limit", None) => {
                    return Err(ServoTorqueError::Number(name.to_owned()));
                }
                ("target", _) if !value.is_empty() => target = Some(value.to_owned()),
                _ => return Err(ServoTorqueError::Part(part.to_owned())),
            }
        }
        match (kp, target) {
            (Some(kp), Some(target)) if kp > 0.0 => {
                Ok(Self { kp, kd: kd.unwrap_or(0.0), target, limit })
            }
            _ => Err(ServoTorqueError::Incomplete),
        }
    }

    /// Returns the law in words.
    pub fn in_words(&self, joint: JointKind) -> String {
        let (length, torque) = match joint {
            JointKind::Revolute => ("rad", "Nm"),
            JointKind::Prismatic => ("m", "N"),
        };
        let limit =
            self.limit.map_or_else(String::new, |limit| format!(", at most {limit} {torque}"));
        format!(
            "{} {torque}/{length} (target - q) - {} {torque} s/{length} v{limit}",
            self.kp, self.kd
        )
    }

    /// Replaces the target, which is in the place of the torque, by the torque of the law.
    ///
    /// # Errors
    /// If the log has no position.
    pub(crate) fn apply(&self, data: &mut Dataset) -> Result<(), DataError> {
        let name = Quantity::Position.name(data.joint);
        for run in &mut data.runs {
            let Some(position) = run.get(Quantity::Position) else {
                return Err(DataError::request(
                    Setting::TorqueFrom.alone(),
                    format!("no {name}"),
                    format!(
                        "the position that the servo controls: {}",
                        Setting::Columns.suggested(format!("{name}=NAME"))
                    ),
                ));
            };
            let rows = run.torque.iter().zip(position).zip(&run.velocity);
            let torque = rows.map(|((target, q), v)| {
                let torque = self.kp * (target - q) - self.kd * v;
                self.limit.map_or(torque, |limit| torque.clamp(-limit, limit))
            });
            run.torque = torque.collect();
        }
        data.torque_law = Some(self.in_words(data.joint));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servo_torque_with_gains_and_target_is_parsed() {
        let servo =
            ServoTorque::parse("pd, kp=40, kd=1.5, target=q_des:deg, limit=3").expect("a law");
        assert_eq!((servo.kp, servo.kd, servo.limit), (40.0, 1.5, Some(3.0)));
        assert_eq!(servo.target, "q_des:deg");
        let parts = ["40 Nm/rad", "1.5 Nm s/rad", "3 Nm"];
        crate::message::check(
            "units",
            "law of a servo",
            &servo.in_words(JointKind::Revolute),
            &parts,
        );
        for text in ["pid,kp=1,target=a", "pd,kp=x,target=a", "pd,kp=1", "pd,target=a", "pd,ki=1"] {
            assert!(
                ServoTorque::parse(text).is_err_and(|e| e.to_string().contains(EXAMPLE)),
                "{text}"
            );
        }
    }
}
