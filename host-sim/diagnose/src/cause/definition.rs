//! What a cause is: its name, what it means, what is to be done, how it is found and how it is reported.

use crate::candidate::{Candidate, FitContext};
use crate::evidence::Evidence;
use crate::extended::{Extended, Observation, Size, Unexplained};
use crate::train_test::TrainTest;
use compensator_core::{ParameterId, TermKind};
use std::fmt;

/// The friction levels of a law, in both directions.
pub const LEVELS: &[ParameterId] = &[
    ParameterId::CoulombTorque,
    ParameterId::StaticTorque,
    ParameterId::CoulombTorqueNegative,
    ParameterId::StaticTorqueNegative,
];

/// What is to be done about a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// The driver's model takes this term: it is friction.
    Term(TermKind),
    /// A column of the log is to be corrected: it is the sensor or the logger. A term may stand in for the
    /// correction until that is done.
    CorrectColumn(Option<TermKind>),
    /// The rigid body is to be known better: the term, if there is one, is a part of it, not friction.
    RigidBody(Option<TermKind>),
}

impl Remedy {
    /// The term that takes the cause into the model, if there is one.
    pub fn term(self) -> Option<TermKind> {
        match self {
            Self::Term(term) => Some(term),
            Self::CorrectColumn(term) | Self::RigidBody(term) => term,
        }
    }

    /// The name in `diagnosis.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Term(_) => "compensate",
            Self::CorrectColumn(_) => "correct-column",
            Self::RigidBody(_) => "rigid-body",
        }
    }
}

/// One thing a residual can be blamed on.
pub trait Cause: Sync {
    /// The name used in files and findings.
    fn name(&self) -> &'static str;

    /// What it means, as the beginning of a sentence.
    fn meaning(&self) -> &'static str;

    /// Returns the meaning for a size of this sign. A cause whose meaning has a direction has another sentence for a
    /// negative size.
    fn meaning_of(&self, _size: f64) -> &'static str {
        self.meaning()
    }

    /// What it does to a model, for a list of models.
    fn effect(&self) -> &'static str;

    /// What is to be done about it.
    fn remedy(&self) -> Remedy;

    /// The parameters of a law it acts through.
    fn acts_on(&self) -> &'static [ParameterId] {
        &[]
    }

    /// The covariate this cause is the first to be thought of for.
    fn covariate(&self) -> Option<&'static str> {
        None
    }

    /// Whether it has a name for what happens; one that has not comes when no other explains it.
    fn is_named(&self) -> bool {
        true
    }

    /// Returns the least size that is physically possible on this log; `None` if any size is.
    fn least_size(&self, _log: &TrainTest) -> Option<f64> {
        None
    }

    /// Returns the size at which the cause has no effect.
    fn no_effect_size(&self) -> f64 {
        0.0
    }

    /// The ways in which it may enter the driver's law beside a fitted model; none where its columns are not in the log.
    fn candidates(&self, _context: &FitContext) -> Vec<Candidate> {
        Vec::new()
    }

    /// What is seen of it, where the log shows it without a model.
    fn in_log(&self, _log: &TrainTest) -> Option<Observation> {
        None
    }

    /// What is seen of it, where structure is left that no candidate explains.
    fn in_rest(&self, _rest: &Unexplained) -> Option<Observation> {
        None
    }

    /// How large it is in the extended model: the first parameter of its term, unless it knows better.
    fn size(&self, extended: &Extended) -> Size {
        let first = self.remedy().term().and_then(|term| term.parameters().first());
        first.map_or_else(Size::default, |id| extended.size(*id))
    }

    /// Of a periodic cause, its order with a standard error.
    fn order(&self, _extended: &Extended) -> Option<(f64, f64)> {
        None
    }

    /// Meaning and size in a sentence.
    fn in_words(&self, size: &Size, _extended: &Extended) -> String {
        format!("{}: {}", self.meaning_of(size.value), size.in_words())
    }

    /// Where it shows.
    fn evidence(&self, _columns: &[String], _extended: &Extended) -> Option<Evidence> {
        None
    }

    /// What to measure next where it was found, following these columns; nothing, where the model decides.
    fn next_experiment(&self, _columns: &[String]) -> Option<String> {
        None
    }
}

impl PartialEq for dyn Cause {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Debug for dyn Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
