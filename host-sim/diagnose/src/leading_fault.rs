//! The fault of the log that explains most of the error.
//!
//! If no model follows the torque, a wrong sign or unit is more likely than a cause. Such a fault leads the report, and no
//! cause is named with certainty beside it.

use friction_fit::Metrics;
use joint_log::log_check::{LogFinding, LogFindingKind as Kind};

/// Faults that keep any model from following the torque, the gravest first.
const KINDS: [Kind; 8] = [
    Kind::SignSuspect,
    Kind::UnitSuspect,
    Kind::TimeJump,
    Kind::WrappedAngle,
    Kind::HeldChannel,
    Kind::TorqueLag,
    Kind::VelocityLag,
    Kind::Saturated,
];

/// Share of the torque's variance that the model leaves, above which a fault of the log explains most of the error.
const MIN_LEFT: f64 = 0.5;

/// Least share of the error that a corrected channel takes to lead: what a step of a law takes too.
const MIN_GAIN: f64 = 0.1;

/// Highest probability of a cause beside a fault that explains the error too.
pub const UNDECIDED: f64 = 0.5;

/// A late channel that a diagnosis has corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected {
    /// What was wrong with the channel.
    pub kind: Kind,
    /// Share of the held-out error that the correction takes, beside all causes.
    pub gain: f64,
}

/// Returns the fault that leads the report, if there is one. A sign that was turned leads too, because the sizes of all
/// findings depend on it, and a late channel whose correction takes more of the error than any cause does, `most_of_causes`.
pub fn leading_fault<'a>(
    log: &'a [LogFinding],
    after: &Metrics,
    corrected: Option<Corrected>,
    most_of_causes: f64,
) -> Option<&'a LogFinding> {
    let fails = after.nrmse_std * after.nrmse_std > MIN_LEFT;
    let takes_most = |kind: Kind| {
        corrected.is_some_and(|corrected| {
            corrected.kind == kind && corrected.gain > most_of_causes.max(MIN_GAIN)
        })
    };
    let leads = |fault: &&LogFinding| match fault.corrected {
        true => fault.kind == Kind::SignSuspect || takes_most(fault.kind),
        false => fails,
    };
    KINDS.iter().find_map(|kind| log.iter().filter(leads).find(|fault| fault.kind == *kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(kind: Kind, corrected: bool) -> LogFinding {
        LogFinding {
            kind,
            columns: Vec::new(),
            value: 0.0,
            unit: String::new(),
            corrected,
            in_words: String::new(),
        }
    }

    #[test]
    fn leading_fault_is_the_gravest_that_the_model_does_not_overcome() {
        let log = [
            fault(Kind::TooLittle, false),
            fault(Kind::TimeJump, false),
            fault(Kind::SignSuspect, false),
        ];
        let error = |nrmse_std| Metrics { nrmse_std, ..Metrics::default() };
        let leading = |nrmse| leading_fault(&log, &error(nrmse), None, 0.0).map(|fault| fault.kind);
        assert_eq!(leading(1.0), Some(Kind::SignSuspect));
        assert_eq!(leading(0.3), None);
        assert_eq!(leading_fault(&log[..1], &error(1.0), None, 0.0), None);
    }

    #[test]
    fn leading_fault_with_turned_sign_leads_whatever_the_error() {
        let log = [fault(Kind::HeldChannel, true), fault(Kind::SignSuspect, true)];
        let small = Metrics { nrmse_std: 0.1, ..Metrics::default() };
        assert_eq!(
            leading_fault(&log, &small, None, 0.0).map(|fault| fault.kind),
            Some(Kind::SignSuspect)
        );
    }

    #[test]
    fn leading_fault_with_corrected_lag_leads_if_it_takes_more_than_the_causes() {
        let log = [fault(Kind::TorqueLag, true)];
        let small = Metrics { nrmse_std: 0.1, ..Metrics::default() };
        let leads = |gain, most_of_causes| {
            let corrected = Some(Corrected { kind: Kind::TorqueLag, gain });
            leading_fault(&log, &small, corrected, most_of_causes).is_some()
        };
        assert!(leads(0.4, 0.3));
        assert!(!leads(0.4, 0.5));
        assert!(!leads(0.05, 0.0));
    }
}
