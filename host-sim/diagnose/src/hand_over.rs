//! What a diagnosis hands over: the model that errs least on rows that its fit has not seen, and of those that err as little the
//! simplest.
//!
//! ```text
//! plain      Coulomb and viscous friction and the rigid-body parts, by least squares
//! baseline   the base law
//! extended   the base law with causes, or, on a PC, the linear model of the contest with all of its causes
//! ```
//!
//! A driver takes the best of the first three. On a PC the linear model competes as well: `params.toml` then has both.

use super::Diagnosis;
use super::contest::LinearAnswer;
use super::evaluation::paired;
use super::prepare::Prepared;
use super::train_test::TrainTest;
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{
    FitOptions, Measurement, Metrics, Outcome, Predicted, Rows, Scales, Track, identify_robustly,
    predict,
};
use joint_log::Run;
use joint_log::number::significant;

/// Difference of the squared errors, in standard errors, within which the simpler of two models is handed over.
const AS_GOOD: f64 = 1.0;

/// Difference of the squared errors, in standard errors, above which plain friction is handed over in place of a model that was
/// asked for.
const CLEARLY_LESS: f64 = 2.0;

/// Held-out rows, as a share of the fitted ones, below which a model that was asked for is not compared.
const MIN_HELD_OUT: f64 = 0.05;

/// Share of the error that a model must take from a simpler one.
const MIN_GAIN: f64 = 0.03;

/// Which model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HandedOver {
    /// Coulomb and viscous friction with the rigid-body parts.
    Plain,
    /// The base model.
    #[default]
    Baseline,
    /// The base model with causes.
    Extended,
    /// The linear model of the contest with all its causes, on a PC.
    Linear,
}

impl HandedOver {
    /// Returns the name in a report: the linear model is an extended one.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Baseline => "baseline",
            Self::Extended | Self::Linear => "extended",
        }
    }
}

/// A linear model with its errors on held-out rows.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The model.
    pub model: LinearAnswer,
    /// It on held-out rows.
    pub held_out: Predicted,
}

/// The choice of a diagnosis.
#[derive(Clone, Debug)]
pub struct HandOver {
    /// What `predict` computes from `params.toml`.
    pub on_pc: HandedOver,
    /// What a driver gets.
    pub in_driver: HandedOver,
    /// The plain model.
    pub plain: Judged,
    /// The plain model as a driver's law, if a driver gets it.
    pub driver_plain: Option<Outcome>,
    /// The linear model, if there is one.
    pub linear: Option<Judged>,
    /// What lies between the shaft and the log for the laws of the diagnosis.
    pub measurement: Measurement,
    /// The driver's model on held-out rows.
    pub held_out_of_driver: Metrics,
    /// True if the linear model stands for the base law with causes: it is handed over, and a cause is found.
    pub linear_extends: bool,
    /// The law of the linear model, and each of its causes, the one that takes most first.
    pub steps: Vec<HandOverStep>,
}

/// A step on the way from the law of the linear model to all its causes.
#[derive(Clone, Debug)]
pub struct HandOverStep {
    /// Name of the law, or of the cause that is added last.
    pub added: &'static str,
    /// RMS error on held-out rows, Nm or N.
    pub rmse: f64,
}

impl HandOver {
    /// Returns the linear model if it is handed over.
    pub fn linear_model(&self) -> Option<&Judged> {
        self.linear.as_ref().filter(|_| self.on_pc == HandedOver::Linear)
    }

    /// Returns the linear model if it stands for the base law with causes.
    pub fn extending(&self) -> Option<&Judged> {
        self.linear_model().filter(|_| self.linear_extends)
    }

    /// Returns what lies between the shaft and the log for the driver's law.
    pub fn measurement_of_driver(&self) -> &Measurement {
        match self.in_driver {
            HandedOver::Plain => &self.plain.model.measurement,
            _ => &self.measurement,
        }
    }

    /// Returns what `params.toml` has for a PC beside the driver's law.
    pub fn for_pc(&self) -> Option<&LinearAnswer> {
        match self.on_pc {
            HandedOver::Plain => Some(&self.plain.model),
            _ => self.linear_model().map(|linear| &linear.model),
        }
    }
}

/// Describes what `params.toml` holds for a PC and for a driver, with the held-out errors.
pub fn in_words(found: &Diagnosis) -> String {
    let choice = &found.hand_over;
    let unit = found.log.train.joint.torque_unit();
    let rmse = |predicted: &Predicted| format!("{} {unit}", significant(predicted.metrics.rmse, 3));
    let driver = found.transferable_model().spec;
    let plain = rmse(&choice.plain.held_out);
    let on_pc = match choice.on_pc {
        HandedOver::Plain => {
            return format!(
                "params.toml has plain friction ({driver} for a driver): on held-out rows no other possible model errs clearly \
                 less than its {plain}."
            );
        }
        HandedOver::Baseline | HandedOver::Extended => format!("params.toml has {driver}"),
        HandedOver::Linear => format!(
            "params.toml has {} for predict on a PC, and {driver} for a driver",
            choice.linear.as_ref().map(|linear| linear.model.model.name()).unwrap_or_default()
        ),
    };
    let error = match choice.linear_model() {
        Some(linear) => &linear.held_out,
        None if choice.on_pc == HandedOver::Baseline => &found.before,
        None => &found.after,
    };
    format!("{on_pc}: {} on held-out rows, plain friction {plain}.", rmse(error))
}

/// A fitted model beside plain friction on the same rows.
#[derive(Clone, Debug)]
pub struct BesidePlain {
    /// Coulomb and viscous friction with the rigid-body parts of the log.
    pub plain: Outcome,
    /// What a parameter file holds: the fitted model, unless plain friction errs clearly less on held-out rows.
    pub handed_over: HandedOver,
}

impl BesidePlain {
    /// Fits plain friction to the rows of a fit and compares. With hardly any held-out rows the fitted model is handed over.
    ///
    /// # Errors
    /// If the model has more terms than the core takes.
    pub fn of(fit: &Outcome, input: &Prepared) -> Result<Self, SpecError> {
        let spec = Spec::law(LawKind::Linear).on(&input.rigid_body);
        if fit.spec == spec {
            return Ok(Self { plain: fit.clone(), handed_over: HandedOver::Baseline });
        }
        let base = spec.parameters()?;
        let options = FitOptions { passive: true, ..FitOptions::default() };
        let (train, test) = (input.train_rows(), input.test_rows());
        let plain = identify_robustly(input.loss, &spec, &base, train, test, &options);
        // What a file holds is the form for a driver.
        let on_test =
            |outcome: &Outcome| predict(&outcome.for_driver().parameters, test, outcome.resolution);
        let is_judged = fit.test.rows as f64 >= MIN_HELD_OUT * fit.train.rows as f64;
        let gains = is_judged && plain.test.rmse <= (1.0 - MIN_GAIN) * fit.for_driver().test.rmse;
        let is_better =
            gains && paired(test.tracks, &on_test(fit), &on_test(&plain)) >= CLEARLY_LESS;
        let handed_over = if is_better { HandedOver::Plain } else { HandedOver::Baseline };
        Ok(Self { plain, handed_over })
    }

    /// Returns the model that is handed over.
    pub fn model<'a>(&'a self, fit: &'a Outcome) -> &'a Outcome {
        if self.handed_over == HandedOver::Plain { &self.plain } else { fit }
    }

    /// Describes the choice in a sentence.
    pub fn in_words(&self, fit: &Outcome, unit: &str) -> String {
        let rmse = |outcome: &Outcome| {
            format!("{} {unit}", significant(outcome.for_driver().test.rmse, 3))
        };
        let (plain, fitted) = (rmse(&self.plain), rmse(fit));
        match self.handed_over {
            HandedOver::Plain => format!(
                "params.toml has plain friction ({}): {plain} on held-out rows, {} {fitted}.",
                self.plain.spec, fit.spec
            ),
            _ => format!(
                "params.toml has {}: {fitted} on held-out rows, plain friction {plain}.",
                fit.spec
            ),
        }
    }
}

/// Largest ratio of the static level to the level in sliding that a seal or a bearing has.
const MAX_STATIC_RATIO: f64 = 5.0;

/// Excess of the static level, as a share of the level in sliding, that needs no slow rows to show it.
const SMALL_EXCESS: f64 = 0.2;

/// Largest ratio of a level to the largest torque of the log.
const MAX_LEVEL_RATIO: f64 = 1.5;

/// Columns that carry the level in sliding beside the Coulomb torque.
const CARRYING: [Id; 3] = [Id::PressureCoulomb, Id::RadialForceCoulomb, Id::LoadCoulomb];

/// Returns true if a law has levels that the log can show and no friction that drives.
///
/// A static level is shown at speeds up to the Stribeck velocity, which several rows must have. Where a column carries the level
/// in sliding, the Coulomb torque is no measure of it, and the RMS torque of the log is.
pub(super) fn is_possible(law: &Parameters<f64>, log: &TrainTest) -> bool {
    let torques = || log.train_tracks.iter().flat_map(|track| &track.torque);
    let most = torques().fold(0.0f64, |most, torque| most.max(torque.abs()));
    let scales = Scales::of(&log.train_tracks);
    let value = |id| law.get(id);
    let levels = [
        (Id::CoulombTorque, Id::StaticTorque),
        (Id::CoulombTorqueNegative, Id::StaticTorqueNegative),
    ];
    let is_active = |id| law.active().any(|active| active == id);
    let carried = if CARRYING.into_iter().any(is_active) { scales.torque } else { 0.0 };
    let is_shown = value(Id::StribeckVelocity) >= scales.slow_speed;
    let has_possible_level = |(coulomb, breakaway): (Id, Id)| {
        let level = value(if is_active(breakaway) { breakaway } else { coulomb });
        let (sliding, excess) = (value(coulomb).max(carried), level - value(coulomb));
        let is_small = excess <= SMALL_EXCESS * sliding;
        !is_active(coulomb)
            || (level <= MAX_LEVEL_RATIO * most
                && (is_small || (is_shown && excess <= (MAX_STATIC_RATIO - 1.0) * sliding)))
    };
    value(Id::ViscousFriction) >= 0.0 && levels.into_iter().all(has_possible_level)
}

/// Returns the simplest candidate that errs no more than the best one within a standard error, or that errs little more. The
/// simplest stands first.
pub(super) fn simplest_of_best(
    tracks: &[Track],
    candidates: &[(HandedOver, &Predicted)],
) -> HandedOver {
    let error = |held_out: &Predicted| held_out.metrics.rmse;
    let best = candidates.iter().min_by(|a, b| error(a.1).total_cmp(&error(b.1)));
    let Some((_, best)) = best else { return HandedOver::default() };
    let is_as_good = |held_out: &Predicted| {
        error(best) >= (1.0 - MIN_GAIN) * error(held_out)
            || paired(tracks, held_out, best) < AS_GOOD
    };
    let simplest = candidates.iter().find(|(_, held_out)| is_as_good(held_out));
    simplest.map_or(HandedOver::default(), |(what, _)| *what)
}

/// Returns the linear model on the held-out rows of a log. `original` is the log before its torque was corrected.
pub(super) fn linear_on(
    judged: &TrainTest,
    original: &TrainTest,
    answer: &LinearAnswer,
) -> Predicted {
    let (data, tracks, residual) = if judged.leaves_each_out {
        (&judged.train, &judged.train_tracks, answer.held_out.clone())
    } else {
        let data = &original.test;
        let measured = data.runs.iter().flat_map(|run| run.torque.iter());
        let predicted = answer.model.predict(data, &answer.measurement);
        let sign = answer.measurement.torque_sign;
        let residual = measured
            .zip(predicted)
            .map(|(torque, predicted)| sign * (torque - predicted))
            .collect();
        (data, &judged.test_tracks, residual)
    };
    let mut rest = residual.as_slice();
    let of_run = |run: &Run| {
        let (of_run, others) = rest.split_at(run.len());
        rest = others;
        of_run
    };
    let by_run: Vec<&[f64]> = data.runs.iter().map(of_run).collect();
    let torque = |track: &Track| -> Vec<f64> {
        let left = &by_run[track.run][track.first_row..];
        track.torque.iter().zip(left).map(|(torque, left)| torque - left).collect()
    };
    let torques = tracks.iter().map(torque).collect();
    Predicted::of_torque(Rows { tracks, decimate: judged.decimate }, torques)
}
