//! A channel that is late against the others: the torque passed a low-pass before it was logged, or a velocity without a
//! position is the mean of past differences.
//!
//! The contest finds both ([`super::contest::correction`]). The model's torque then passes the low-pass wherever it is compared
//! with the measured one, and the velocity is that of the later time. The fitted friction is that of the shaft.

use super::leading_fault::Corrected;
use super::train_test::TrainTest;
use friction_fit::{LowPassShape, TorqueLowPass};
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::number::figure;
use joint_log::{JointKind, Quantity};
use std::f64::consts::TAU;

/// Which channel is late, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LateChannelKind {
    /// The torque went through a low-pass.
    LowPassedTorque,
    /// The velocity is that of an earlier time.
    Velocity,
}

impl LateChannelKind {
    /// The kind of finding it is.
    pub fn kind(self) -> LogFindingKind {
        match self {
            Self::LowPassedTorque => LogFindingKind::TorqueLag,
            Self::Velocity => LogFindingKind::VelocityLag,
        }
    }
}

/// A late channel, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateChannel {
    /// Which.
    pub late: LateChannelKind,
    /// How late, s.
    pub time_s: f64,
    /// Of a low-pass, how it answers.
    pub shape: LowPassShape,
    /// Squared error with it, as a share of that without.
    pub share_left: f64,
}

impl LateChannel {
    /// The log with this taken into account.
    pub fn lag_compensated(&self, log: TrainTest) -> TrainTest {
        match self.late {
            LateChannelKind::LowPassedTorque => {
                log.through_low_pass(TorqueLowPass { time_s: self.time_s, shape: self.shape })
            }
            LateChannelKind::Velocity => log.with_later_velocity(self.time_s),
        }
    }

    /// What kind of low-pass.
    fn kind_in_words(&self) -> String {
        match self.shape {
            LowPassShape::FirstOrder => {
                format!("a low-pass filter of about {} Hz", figure(1.0 / (TAU * self.time_s)))
            }
            LowPassShape::SecondOrder => "a second-order low-pass filter".into(),
            LowPassShape::RunningMean => {
                format!("a moving average over {} ms", figure(2e3 * self.time_s))
            }
        }
    }

    /// Returns what its correction takes of the error.
    pub fn gain(&self) -> Corrected {
        Corrected { kind: self.late.kind(), gain: 1.0 - self.share_left.max(0.0).sqrt() }
    }

    /// It as a finding about the log.
    pub fn finding(&self, joint: JointKind) -> LogFinding {
        let lower = figure(100.0 * (1.0 - self.share_left));
        let milliseconds = figure(1e3 * self.time_s);
        let quantity = match self.late {
            LateChannelKind::LowPassedTorque => Quantity::Torque,
            LateChannelKind::Velocity => Quantity::Velocity,
        };
        let column = quantity.name(joint);
        let in_words = match self.late {
            LateChannelKind::LowPassedTorque => format!(
                "{column} passed {} before it was logged, with a delay of {milliseconds} ms: with this filter the base model's \
                 squared error is {lower} % lower. The model's torque is filtered in the same way before the comparison, so that \
                 the fitted friction is that of the shaft.",
                self.kind_in_words()
            ),
            LateChannelKind::Velocity => format!(
                "{column} is {milliseconds} ms late, as filtered differences are: with the velocity advanced by this time the \
                 base model's squared error is {lower} % lower. The advanced velocity is used."
            ),
        };
        LogFinding {
            kind: self.late.kind(),
            columns: vec![column.into()],
            value: self.time_s,
            unit: "s".into(),
            corrected: true,
            in_words,
        }
    }
}
