//! Possible causes of a residual, in one table.
//!
//! A [`Cause`] has a name, a meaning, a remedy, a size in words, and a plane in which it shows. The remedy may be a term of the
//! driver's model, a corrected column, or nothing. A contest of hypotheses ([`super::contest`]) finds a cause, and its
//! candidates take it into the driver's law. `unknown` is also found in the remaining residual, if no cause is named.
//!
//! Finalists, summary and report use only the table. A new cause needs a row in [`ALL`], and its columns in the contest. Rows
//! stand in the files below this one: causes that follow a column, the motion, a wave of the position, or the time.

mod backlash;
mod channel;
mod followed;
mod formula;
mod motion;
mod ripple;
mod time;
mod unknown;
mod without_term;

use super::candidate::{Candidate, FitContext};
use super::evidence::Evidence;
use super::extended::{Extended, Size, WaveOrder};
use super::train_test::TrainTest;
use compensator_core::{ParameterId, TermKind};
use std::fmt;

/// All causes.
pub static ALL: [Cause; 23] = [
    channel::RADIAL_FORCE_COULOMB,
    channel::PRESSURE_COULOMB,
    channel::LOAD_TORQUE_COULOMB,
    channel::TEMPERATURE_VISCOUS,
    channel::TEMPERATURE_COULOMB,
    motion::DIRECTION_ASYMMETRY,
    motion::TORQUE_OFFSET,
    motion::QUADRATIC_DRAG,
    motion::UNMODELLED_INERTIA,
    motion::CHANNEL_DELAY,
    motion::STRIBECK_SHAPE,
    channel::RADIAL_FORCE_RATE,
    time::DWELL_TIME_STATIC,
    backlash::BACKLASH,
    motion::GRAVITY_IMBALANCE,
    ripple::POSITION_RIPPLE,
    ripple::TORQUE_RIPPLE,
    time::TIME_DRIFT,
    time::WARM_UP,
    without_term::ENCODER_ERROR,
    without_term::JOINT_COUPLING,
    without_term::PAYLOAD,
    unknown::UNKNOWN,
];

/// Returns the cause that a term represents; `None` for a part of the rigid body that is known
/// beforehand.
pub fn of_term(term: TermKind) -> Option<&'static Cause> {
    ALL.iter().find(|cause| cause.remedy.term() == Some(term))
}

/// Returns the cause of this name.
pub fn named(name: &str) -> Option<&'static Cause> {
    ALL.iter().find(|cause| cause.name == name)
}

/// The friction levels of a law, in both directions.
const LEVELS: &[ParameterId] = &[
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
    pub const fn term(self) -> Option<TermKind> {
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
pub struct Cause {
    name: &'static str,
    /// What it means, as the beginning of a sentence.
    meaning: &'static str,
    /// Its meaning for a size of this sign, of a cause whose meaning has a direction.
    meaning_of: fn(f64) -> Option<&'static str>,
    effect: &'static str,
    remedy: Remedy,
    acts_on: &'static [ParameterId],
    covariate: Option<&'static str>,
    is_named: bool,
    /// The least size that is physically possible on a log; `None` if any size is.
    pub(crate) least_size: fn(&TrainTest) -> Option<f64>,
    /// The size at which the cause has no effect; NaN if no size tells that.
    pub(crate) no_effect_size: f64,
    /// The ways in which it may enter the driver's law beside a fitted model; none where its columns are not in the log.
    pub(crate) candidates: fn(&FitContext) -> Vec<Candidate>,
    /// How large it is in the extended model; `None` for the first parameter of its term.
    size: Option<fn(&Extended) -> Size>,
    /// Of a periodic cause, its order.
    pub(crate) order: fn(&Extended) -> Option<WaveOrder>,
    /// A sentence of the meaning and the size.
    words: fn(&str, &Size, &Extended) -> String,
    /// Where it shows, for the columns that it follows.
    pub(crate) evidence: fn(&[String], &Extended) -> Option<Evidence>,
    /// What to measure next where it was found, following these columns; nothing, where the model decides.
    pub(crate) next_experiment: fn(&[String]) -> Option<String>,
}

impl Cause {
    /// Returns a row without a meaning, to be completed.
    const fn new(name: &'static str, remedy: Remedy) -> Self {
        Self {
            name,
            meaning: "",
            meaning_of: |_| None,
            effect: "",
            remedy,
            acts_on: &[],
            covariate: None,
            is_named: true,
            least_size: |_| None,
            no_effect_size: 0.0,
            candidates: |_| Vec::new(),
            size: None,
            order: |_| None,
            words: |meaning, size, _| format!("{meaning}: {}", size.in_words()),
            evidence: |_, _| None,
            next_experiment: |_| None,
        }
    }

    /// Returns the name used in files and findings.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns what it means, as the beginning of a sentence.
    pub fn meaning(&self) -> &'static str {
        self.meaning
    }

    /// Returns the meaning for a size of this sign.
    pub fn meaning_of(&self, size: f64) -> &'static str {
        (self.meaning_of)(size).unwrap_or(self.meaning)
    }

    /// Returns what it does to a model, for a list of models.
    pub fn effect(&self) -> &'static str {
        self.effect
    }

    /// Returns what is to be done about it.
    pub fn remedy(&self) -> Remedy {
        self.remedy
    }

    /// Returns the parameters of a law that it acts through.
    pub fn acts_on(&self) -> &'static [ParameterId] {
        self.acts_on
    }

    /// Returns the covariate that this cause is the first to be thought of for.
    pub fn covariate(&self) -> Option<&'static str> {
        self.covariate
    }

    /// Returns false for a cause without a name for what happens, which comes when no other explains it.
    pub fn is_named(&self) -> bool {
        self.is_named
    }

    /// Returns how large it is in the extended model.
    pub(crate) fn size(&self, extended: &Extended) -> Size {
        let first = || self.remedy.term().and_then(|term| term.parameters().first());
        let of_term = || first().map_or_else(Size::default, |id| extended.size(*id));
        self.size.map_or_else(of_term, |size| size(extended))
    }

    /// Returns a sentence of its meaning and a size.
    pub(crate) fn in_words(&self, size: &Size, extended: &Extended) -> String {
        (self.words)(self.meaning_of(size.value), size, extended)
    }
}

impl PartialEq for Cause {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_with_term_have_name_of_term() {
        for cause in &ALL {
            if let Some(term) = cause.remedy().term() {
                assert_eq!(cause.name(), term.name());
                assert_eq!(of_term(term).map(|cause| cause.name()), Some(cause.name()));
            }
        }
        assert!(of_term(TermKind::LoadGain).is_none());
    }

    #[test]
    fn meaning_of_size_follows_its_sign() {
        let of = |name: &str, size: f64| {
            let cause = ALL.iter().find(|cause| cause.name() == name).expect("a cause");
            cause.meaning_of(size)
        };
        for (name, positive, negative) in [
            ("time-drift", "rises", "falls"),
            ("pressure-coulomb", "grows", "falls"),
            ("radial-force-coulomb", "grows", "falls"),
            ("temperature-coulomb", "falls", "rises"),
            ("temperature-viscous", "falls", "rises"),
            ("warm-up", "falls", "rises"),
        ] {
            assert!(of(name, 0.25).contains(positive), "{name}: {}", of(name, 0.25));
            assert!(of(name, -0.25).contains(negative), "{name}: {}", of(name, -0.25));
        }
        assert_eq!(of("torque-offset", -1.0), of("torque-offset", 1.0));
    }

    #[test]
    fn cause_names_are_unique() {
        let mut names: Vec<&str> = ALL.iter().map(|cause| cause.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }

    #[test]
    fn acts_on_names_the_parameters_of_a_cause() {
        let through = |id: ParameterId| -> Vec<&str> {
            ALL.iter().filter(|cause| cause.acts_on().contains(&id)).map(Cause::name).collect()
        };
        assert_eq!(
            through(ParameterId::ViscousFriction),
            ["temperature-viscous", "quadratic-drag"]
        );
        assert!(through(ParameterId::TorqueOffset).is_empty());
    }
}
