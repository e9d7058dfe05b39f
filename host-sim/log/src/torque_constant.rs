//! The torque constant of a motor, as a user gives it.

use super::unit::parse_value;
use compensator_core::quantity::{JointKind, Quantity};

/// Torque (or force) of one ampere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueConstant {
    /// Nm/A, or N/A for a linear motor.
    pub value: f64,
    /// Revolute for Nm/A, prismatic for N/A.
    pub joint: JointKind,
}

/// A text is no torque constant. Displayed as what is expected instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a positive torque of one ampere, such as {EXAMPLE} or 40N/A")]
pub struct NoTorqueConstant;

/// A torque constant as a user may write it, for messages.
pub(super) const EXAMPLE: &str = "0.105Nm/A";

impl TorqueConstant {
    /// Parses a torque constant with its unit: `0.105Nm/A`, `85mNm/A`, `40N/A`.
    ///
    /// # Errors
    /// The expected text, as the end of a message.
    pub fn parse(text: &str) -> Result<Self, NoTorqueConstant> {
        let torque = text.trim().strip_suffix(['A', 'a']).map(str::trim_end);
        let torque = torque.and_then(|torque| torque.strip_suffix('/')).ok_or(NoTorqueConstant)?;
        let kinds = [JointKind::Revolute, JointKind::Prismatic].into_iter();
        let mut parsed = kinds.filter_map(|joint| {
            let value = parse_value(Quantity::Torque.name(joint), torque).ok()?;
            Some(Self { value, joint })
        });
        let positive = |found: &Self| found.value.is_finite() && found.value > 0.0;
        parsed.find(positive).ok_or(NoTorqueConstant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_constant_with_unit_is_parsed() {
        for (text, value, joint) in [
            ("0.105Nm/A", 0.105, JointKind::Revolute),
            ("85 mNm/A", 0.085, JointKind::Revolute),
            ("40N/A", 40.0, JointKind::Prismatic),
        ] {
            assert_eq!(TorqueConstant::parse(text), Ok(TorqueConstant { value, joint }), "{text}");
        }
        for text in ["0.105", "0.105Nm", "-1Nm/A", "Nm/A", "0Nm/A", "1rpm/V", ""] {
            assert!(TorqueConstant::parse(text).is_err(), "{text}");
        }
    }
}
