//! A channel that is late against the others: the torque passed a low-pass before it was logged, or a velocity without a
//! position is the mean of past differences.
//!
//! The contest finds both ([`super::contest::Correction`]). The model's torque then passes the low-pass wherever it is compared
//! with the measured one, and the velocity is that of the later time. The fitted friction is that of the shaft.

use super::leading_fault::Corrected;
use friction_fit::LowPassShape;
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::number::figure;
use joint_log::{JointKind, Quantity};
use std::f64::consts::TAU;

/// A late channel, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LateChannel {
    /// Low-pass of a torque; `None` for a velocity that is that of an earlier time.
    pub(crate) low_pass: Option<LowPassShape>,
    /// How late, s.
    pub(crate) time_s: f64,
    /// Squared error with its correction, as a share of that without.
    pub(crate) share_left: f64,
}

impl LateChannel {
    /// Returns the kind of finding that it is.
    pub(crate) fn kind(&self) -> LogFindingKind {
        match self.low_pass {
            Some(_) => LogFindingKind::TorqueLag,
            None => LogFindingKind::VelocityLag,
        }
    }

    /// Returns what its correction takes of the error.
    pub(crate) fn gain(&self) -> Corrected {
        Corrected { kind: self.kind(), gain: 1.0 - self.share_left.max(0.0).sqrt() }
    }

    /// Returns it as a finding about the log.
    pub(crate) fn finding(&self, joint: JointKind) -> LogFinding {
        let lower = figure(100.0 * (1.0 - self.share_left));
        let milliseconds = figure(1e3 * self.time_s);
        let quantity = self.low_pass.map_or(Quantity::Velocity, |_| Quantity::Torque);
        let column = quantity.name(joint);
        let in_words = match self.low_pass {
            Some(shape) => format!(
                "{column} passed {} before it was logged, with a delay of {milliseconds} ms: with this filter the base model's \
                 squared error is {lower} % lower. The model's torque is filtered in the same way before the comparison, so that \
                 the fitted friction is that of the shaft.",
                low_pass_in_words(shape, self.time_s)
            ),
            None => format!(
                "{column} is {milliseconds} ms late, as filtered differences are: with the velocity advanced by this time the \
                 base model's squared error is {lower} % lower. The advanced velocity is used."
            ),
        };
        LogFinding {
            kind: self.kind(),
            columns: vec![column.into()],
            value: self.time_s,
            unit: "s".into(),
            corrected: true,
            in_words,
        }
    }
}

/// Returns what kind of low-pass it is.
fn low_pass_in_words(shape: LowPassShape, time_s: f64) -> String {
    match shape {
        LowPassShape::FirstOrder => {
            format!("a low-pass filter of about {} Hz", figure(1.0 / (TAU * time_s)))
        }
        LowPassShape::SecondOrder => "a second-order low-pass filter".into(),
        LowPassShape::RunningMean => format!("a moving average over {} ms", figure(2e3 * time_s)),
    }
}
