//! A finding: the cause, how large it is, how sure that is, and one sentence for a person.

use super::log::Log;
use super::model::Fitted;
use super::select::Found;
use crate::data::Joint;
use crate::fit::{Estimate, Outcome, State};
use crate::number::figure;
use crate::params::unit;
use ParameterId as Id;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
use compensator_core::{ParameterId, TermKind};

/// Standard errors on either side that hold 95 %.
const NINETY_FIVE: f64 = 1.96;

/// A size with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Size {
    /// The value, in `unit`.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

impl Size {
    fn new(value: f64, error: f64, unit: &str) -> Self {
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

/// One cause of what the model gets wrong.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The cause.
    pub kind: TermKind,
    /// Columns of the log it follows.
    pub columns: Vec<String>,
    /// How large it is.
    pub size: Size,
    /// Of a ripple, its order with a standard error.
    pub order: Option<(f64, f64)>,
    /// Probability that the best of all causes looks so good where nothing is hidden.
    pub p_value: f64,
    /// Share of resampled logs in which it is the best of all.
    pub stability: f64,
    /// Share of the squared residual that goes when it comes, and that nothing else takes.
    pub share_of_residual: f64,
    /// Causes that would explain the same, each with its columns.
    pub confusable_with: Vec<(TermKind, Vec<String>)>,
    /// One sentence.
    pub in_words: String,
}

fn estimate(outcome: &Outcome, id: Id) -> Option<&Estimate> {
    outcome.estimates.iter().find(|estimate| estimate.id == id)
}

fn plain(outcome: &Outcome, joint: Joint, id: Id) -> Size {
    let value = outcome.parameters.get(id);
    let error = estimate(outcome, id).and_then(|e| e.std_error).unwrap_or(0.0);
    Size::new(value, error, unit(id.info(), joint))
}

/// Length of a pair of coefficients, of the sine and of the cosine.
fn amplitude(outcome: &Outcome, joint: Joint, sine: Id, cosine: Id) -> Size {
    let (s, c) = (outcome.parameters.get(sine), outcome.parameters.get(cosine));
    let error = |id| estimate(outcome, id).and_then(|e| e.std_error).unwrap_or(0.0);
    let length = s.hypot(c).max(f64::MIN_POSITIVE);
    let spread = (s * error(sine)).hypot(c * error(cosine)) / length;
    Size::new(length, spread, unit(sine.info(), joint))
}

/// Relative change of the level from the beginning of the campaign to its end.
fn drift(outcome: &Outcome, log: &Log) -> Size {
    let parameters = &outcome.parameters;
    let get = |id| parameters.get(id);
    let (amplitude, time, rate) = (get(Id::DriftAmplitude), get(Id::DriftTime), get(Id::DriftRate));
    let end = log.campaign_s();
    let at = |t: f64, a: f64, r: f64| 1.0 + a * (-t / time).exp() + r * t;
    let change = |a: f64, r: f64| at(end, a, r) / at(0.0, a, r) - 1.0;
    let error = |id| estimate(outcome, id).and_then(|e| e.std_error).unwrap_or(0.0);
    let value = change(amplitude, rate);
    let by_amplitude = change(amplitude + error(Id::DriftAmplitude), rate) - value;
    let by_rate = change(amplitude, rate + error(Id::DriftRate)) - value;
    Size::new(value, by_amplitude.hypot(by_rate), "1")
}

/// From the lowest to the highest knot.
fn spline(outcome: &Outcome, joint: Joint, level: bool) -> Size {
    let knots = if level { LOOKUP_LEVELS } else { LOOKUP_TORQUES };
    let value = |id: &Id| outcome.parameters.get(*id);
    let error = |id: &Id| estimate(outcome, *id).and_then(|e| e.std_error).unwrap_or(0.0);
    // A knot the log hardly visits may stand anywhere: it does not count. One that was pinned at 0 does.
    let sure = |id: &&Id| {
        estimate(outcome, **id).is_some_and(|e| match e.std_error {
            Some(_) => {
                e.state == State::Determined
                    || e.value.abs() > 3.0 * error(id) && e.state != State::AtBound
            }
            None => e.value == 0.0,
        })
    };
    let by = |a: &&Id, b: &&Id| value(a).total_cmp(&value(b));
    let low = knots.iter().filter(sure).min_by(by).unwrap_or(&knots[0]);
    let high = knots.iter().filter(sure).max_by(by).unwrap_or(&knots[0]);
    let spread = error(low).hypot(error(high));
    Size::new(value(high) - value(low), spread, unit(knots[0].info(), joint))
}

/// How large a cause is, by the parameter that stands for it.
pub fn size(found: &Found, outcome: &Outcome, log: &Log) -> Size {
    use TermKind as Kind;
    let joint = log.train.joint;
    let plain = |id| plain(outcome, joint, id);
    match found.kind {
        Kind::RadialForceCoulomb => plain(Id::RadialForceCoulomb),
        Kind::RadialForceRate => plain(Id::RadialForceRate),
        Kind::PressureCoulomb => plain(Id::PressureCoulomb),
        Kind::TemperatureViscous => plain(Id::TemperatureViscosity),
        Kind::PositionRipple => amplitude(outcome, joint, Id::RippleSine, Id::RippleCosine),
        Kind::GravityImbalance => amplitude(outcome, joint, Id::GravitySine, Id::GravityCosine),
        Kind::DirectionAsymmetry => {
            // Beside an offset, a difference of the levels may not be determined; then the viscous part is.
            let level = estimate(outcome, Id::CoulombAsymmetry).and_then(|e| e.std_error);
            plain(if level.is_some() { Id::CoulombAsymmetry } else { Id::ViscousAsymmetry })
        }
        Kind::TorqueOffset => plain(Id::TorqueOffset),
        Kind::QuadraticDrag => plain(Id::QuadraticDrag),
        Kind::DwellTimeStatic => plain(Id::DwellGain),
        Kind::TimeDrift => drift(outcome, log),
        Kind::LoadTorqueCoulomb => plain(Id::LoadCoulomb),
        Kind::UnmodelledInertia => plain(Id::Inertia),
        Kind::Backlash => plain(Id::BacklashTravel),
        Kind::StribeckShape => plain(Id::StribeckExponent),
        Kind::ChannelDelay => plain(Id::ChannelDelay),
        Kind::LoadGain => plain(Id::LoadGain),
        Kind::LookupTable => {
            let level = found.follows.as_ref().is_some_and(|follows| follows.level);
            spline(outcome, joint, level)
        }
    }
}

/// What a cause means, as the beginning of a sentence.
pub fn meaning(kind: TermKind) -> &'static str {
    use TermKind as Kind;
    match kind {
        Kind::RadialForceCoulomb => "the side load presses the seal, so friction grows with it",
        Kind::RadialForceRate => "a changing side load bends the bristles",
        Kind::PressureCoulomb => "pressure preloads the seal, so friction grows with it",
        Kind::TemperatureViscous => "the viscous part falls as the film warms",
        Kind::PositionRipple => "friction follows the shaft angle",
        Kind::GravityImbalance => "an imbalance adds a torque of the angle, whichever way it turns",
        Kind::DirectionAsymmetry => "one direction rubs harder than the other",
        Kind::TorqueOffset => {
            "the torque reading has a zero error; this is calibration, not friction"
        }
        Kind::QuadraticDrag => "drag grows with the square of the speed",
        Kind::DwellTimeStatic => "the longer the joint rests, the higher it breaks away",
        Kind::TimeDrift => "friction changes over the campaign (run-in or wear)",
        Kind::LoadTorqueCoulomb => {
            "the transmitted torque loads the drive, so friction grows with it"
        }
        Kind::UnmodelledInertia => {
            "a torque proportional to acceleration is left; this is the rigid body, not friction"
        }
        Kind::Backlash => "after a reversal there is travel with little stiffness",
        Kind::StribeckShape => "the Stribeck curve falls with another exponent than 2",
        Kind::ChannelDelay => {
            "torque and velocity are logged at different times; this is the logger, not friction"
        }
        Kind::LoadGain => "the load torque enters the reading",
        Kind::LookupTable => "no named cause explains what is left",
    }
}

/// One sentence about a finding.
fn in_words(
    found: &Found,
    size: &Size,
    order: Option<(f64, f64)>,
    outcome: &Outcome,
    joint: Joint,
) -> String {
    use TermKind as Kind;
    let mut words = match (found.kind, &found.follows) {
        (Kind::LookupTable, Some(follows)) if follows.level => format!(
            "friction follows {}, {}, in a way no named cause describes: its level spans {}",
            follows.column,
            shape(outcome, true),
            size.in_words()
        ),
        (Kind::LookupTable, Some(follows)) => format!(
            "a torque follows {}, {}, whichever way the joint moves: calibration or load, not friction; it spans {}",
            follows.column,
            shape(outcome, false),
            size.in_words()
        ),
        (kind, _) => format!("{}: {}", meaning(kind), size.in_words()),
    };
    if let Some((order, error)) = order {
        let unit = unit(Id::RippleOrder.info(), joint);
        words += &format!(", of order {} ± {} {unit}", figure(order), figure(2.0 * error));
    }
    if found.kind == Kind::DirectionAsymmetry {
        let viscous = outcome.parameters.get(Id::ViscousAsymmetry);
        words += &format!(" of the level, {} of the viscous part", figure(viscous));
    }
    let mut rivals: Vec<String> = Vec::new();
    for (kind, columns, share) in &found.confusable {
        let by =
            if columns.is_empty() { String::new() } else { format!(" ({})", columns.join(", ")) };
        rivals.push(format!(
            "{}{by}, which would explain {:.0} % of it",
            kind.name(),
            100.0 * share
        ));
    }
    if !rivals.is_empty() {
        words += &format!("; this log cannot tell it from {}", rivals.join(", or "));
    }
    words
}

/// The shape of a spline in words.
fn shape(outcome: &Outcome, level: bool) -> &'static str {
    let knots = if level { LOOKUP_LEVELS } else { LOOKUP_TORQUES };
    let values = knots.map(|id| outcome.parameters.get(id));
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let span = values.iter().fold(f64::MIN, |a, b| a.max(*b))
        - values.iter().fold(f64::MAX, |a, b| a.min(*b));
    let small = 0.05 * span;
    if steps.iter().all(|step| *step > -small) {
        "rising"
    } else if steps.iter().all(|step| *step < small) {
        "falling"
    } else {
        let peak = values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |p| p.0);
        let dip = values.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |p| p.0);
        match (peak, dip) {
            (1..=4, 0 | 5) => "with a hump",
            (0 | 5, 1..=4) => "with a dip",
            _ => "up and down",
        }
    }
}

/// Puts a finding together.
pub fn finding(found: &Found, outcome: &Outcome, log: &Log, extended: &Fitted) -> Finding {
    debug_assert!(extended.spec.terms.contains(&found.kind));
    let size = size(found, outcome, log);
    let order = (found.kind == TermKind::PositionRipple).then(|| {
        let error = estimate(outcome, Id::RippleOrder).and_then(|e| e.std_error).unwrap_or(0.0);
        (outcome.parameters.get(Id::RippleOrder), error)
    });
    Finding {
        kind: found.kind,
        columns: found.columns.clone(),
        in_words: in_words(found, &size, order, outcome, log.train.joint),
        size,
        order,
        p_value: found.trial.p_value,
        stability: found.trial.stability,
        share_of_residual: found.share,
        confusable_with: found
            .confusable
            .iter()
            .map(|(kind, columns, _)| (*kind, columns.clone()))
            .collect(),
    }
}
