//! Why the data do not determine a parameter, with its words in a verdict.

use ParameterId as Id;
use compensator_core::ParameterId;

/// Why the data do not determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The log does not have its column, or it is 0.
    NoColumn,
    /// Its effect is a combination of others.
    Combination,
    /// Its error is large.
    Loose,
    /// It does not differ from 0.
    Insignificant,
    /// Its sign would drive the joint.
    ImpossibleSign,
    /// This parameter, which compensates it, is at an end of its range.
    PartnerAtBound(Id),
    /// Its interval exceeds what the log can show.
    BeyondLog,
    /// The log is too slow to show the law beyond its Stribeck curve.
    InsideCurve,
    /// Its part of the torque and that of this parameter cancel.
    Cancels(Id),
    /// Both halves of the log give different values.
    HalvesDisagree,
    /// A simpler law that errs as little on held-out rows gives another value.
    SimplerLawDisagrees,
}

impl Reason {
    /// Returns the words after "not determined".
    pub fn in_words(self) -> String {
        match self {
            Self::NoColumn => ": its column is absent or zero in all rows".to_owned(),
            Self::Combination => {
                ": on these rows its effect is a combination of other parameters".to_owned()
            }
            Self::Loose => " by this data".to_owned(),
            Self::Insignificant => " by this data: not significantly different from 0".to_owned(),
            Self::ImpossibleSign => ": with this sign it would drive the joint".to_owned(),
            Self::PartnerAtBound(id) => {
                format!(": {}, which compensates it, is at its bound", id.name())
            }
            Self::BeyondLog => ": its interval exceeds what the log can show".to_owned(),
            Self::InsideCurve => {
                ": the log is too slow to show the law beyond its Stribeck curve".to_owned()
            }
            Self::Cancels(id) => {
                format!(": it cancels {}, and both exceed the logged torque", id.name())
            }
            Self::HalvesDisagree => {
                ": the two halves of the runs, or of the log, give different values".to_owned()
            }
            Self::SimplerLawDisagrees => {
                ": plain friction errs as little on held-out rows and gives another value"
                    .to_owned()
            }
        }
    }
}
