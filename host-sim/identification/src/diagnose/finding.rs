//! A finding: the cause, how large it is, how sure that is, and one sentence for a person.

use super::candidate::Follows;
use super::cause::Cause;
use super::evidence::Evidence;
use super::log::Log;
use super::select::Found;
use crate::data::Joint;
use crate::fit::outcome::Predicted;
use crate::fit::{Estimate, Outcome};
use crate::number::figure;
use crate::params::unit;
use ParameterId as Id;
use compensator_core::ParameterId;

/// Standard errors on either side that hold 95 %.
const NINETY_FIVE: f64 = 1.96;

/// A size with its interval.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Size {
    /// The value, in `unit`.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

impl Size {
    /// A value with its standard error.
    pub fn new(value: f64, error: f64, unit: &str) -> Self {
        let reach = NINETY_FIVE * error;
        Self { value, unit: unit.to_owned(), ci95: [value - reach, value + reach] }
    }

    /// With unit and interval.
    pub fn in_words(&self) -> String {
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        let [low, high] = self.ci95;
        format!("{}{unit} (95 % interval {} to {})", figure(self.value), figure(low), figure(high))
    }
}

/// Another cause that would explain what a finding explains.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log it follows.
    pub columns: Vec<String>,
    /// Share of the finding's effect it can take over.
    pub share: f64,
}

/// One cause of what the model gets wrong.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log it follows.
    pub columns: Vec<String>,
    /// How large it is.
    pub size: Size,
    /// Of a periodic cause, its order with a standard error.
    pub order: Option<(f64, f64)>,
    /// Probability that the best of all causes looks so good where nothing is hidden.
    pub p_value: f64,
    /// Share of resampled logs in which it is the best of all.
    pub stability: f64,
    /// Share of the squared residual that goes when it comes, and that nothing else takes.
    pub share_of_residual: f64,
    /// Causes that would explain the same.
    pub confusable_with: Vec<Rival>,
    /// One sentence.
    pub in_words: String,
    /// Where it shows.
    pub evidence: Option<Evidence>,
}

/// The extended model a finding is read from.
#[derive(Clone, Copy, Debug)]
pub struct Extended<'a> {
    /// The joint fit of everything.
    pub outcome: &'a Outcome,
    /// The log it was fitted on.
    pub log: &'a Log,
    /// The column the finding follows, if its cause may follow any.
    pub follows: Option<&'a Follows>,
}

impl Extended<'_> {
    /// Whether the joint turns or slides.
    pub fn joint(&self) -> Joint {
        self.log.train.joint
    }

    /// Whether the finding is a share of the friction level over a column.
    pub fn follows_level(&self) -> bool {
        self.follows.is_some_and(|follows| follows.level)
    }

    /// What the fit says of a parameter.
    pub fn estimate(&self, id: Id) -> Option<&Estimate> {
        self.outcome.estimates.iter().find(|estimate| estimate.id == id)
    }

    /// Value of a parameter.
    pub fn value(&self, id: Id) -> f64 {
        self.outcome.parameters.get(id)
    }

    /// Its standard error; 0 where it was kept.
    pub fn error(&self, id: Id) -> f64 {
        self.estimate(id).and_then(|e| e.std_error).unwrap_or(0.0)
    }

    /// Its unit on this joint.
    pub fn unit(&self, id: Id) -> &'static str {
        unit(id.info(), self.joint())
    }

    /// A parameter as a size.
    pub fn size(&self, id: Id) -> Size {
        Size::new(self.value(id), self.error(id), self.unit(id))
    }

    /// Length of a pair of coefficients, of the sine and of the cosine.
    pub fn amplitude(&self, sine: Id, cosine: Id) -> Size {
        let (s, c) = (self.value(sine), self.value(cosine));
        let length = s.hypot(c).max(f64::MIN_POSITIVE);
        let spread = (s * self.error(sine)).hypot(c * self.error(cosine)) / length;
        Size::new(length, spread, self.unit(sine))
    }
}

/// What is left when no cause passed, and is more than noise.
#[derive(Clone, Copy, Debug)]
pub struct Unexplained<'a> {
    /// The model on the held-out rows.
    pub after: &'a Predicted,
    /// Error the torque's noise alone would make, Nm.
    pub noise_floor: f64,
    /// An error so many times the noise floor is structure.
    pub times_floor: f64,
    /// The log.
    pub log: &'a Log,
    /// For what is drawn at random.
    pub seed: u64,
}

/// Puts a finding together.
pub fn finding(found: &Found, outcome: &Outcome, log: &Log) -> Finding {
    let extended = Extended { outcome, log, follows: found.follows.as_ref() };
    let cause = found.cause;
    let size = cause.size(&extended);
    let mut in_words = cause.in_words(&size, &extended);
    let rival = |rival: &Rival| {
        let columns = &rival.columns;
        let by =
            if columns.is_empty() { String::new() } else { format!(" ({})", columns.join(", ")) };
        let (name, percent) = (rival.cause.name(), 100.0 * rival.share);
        format!("{name}{by}, which would explain {percent:.0} % of it")
    };
    let rivals: Vec<String> = found.rivals.iter().map(rival).collect();
    if !rivals.is_empty() {
        in_words += &format!("; this log cannot tell it from {}", rivals.join(", or "));
    }
    Finding {
        cause,
        columns: found.columns.clone(),
        in_words,
        size,
        order: cause.order(&extended),
        p_value: found.trial.p_value,
        stability: found.trial.stability,
        share_of_residual: found.share,
        confusable_with: found.rivals.clone(),
        evidence: cause.evidence(&found.columns, &extended),
    }
}
