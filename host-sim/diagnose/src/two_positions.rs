//! Play of the gear, from the positions on both of its sides.
//!
//! A log may hold the position of the motor's encoder, through the gear, and that of a second encoder at the joint
//! ([`joint_log::contract::joint_position`]). After a reversal the motor moves by the *lost motion* before the joint does. The lost
//! motion is play and torsion under the friction of the load. Only the torque distinguishes both: a gear that winds up has a torque
//! in all of the lost motion, and one with play has none until its flanks meet.
//!
//! - `regression`: the difference of the positions is compared with and without a stop operator of the motion, beside everything
//!   else that it may hold: an offset of each block, an error of the scale, any error that repeats with the angle (an
//!   eccentricity and its harmonics), a delay between the samples (velocity and acceleration), and torsion (the torque behind
//!   a free share of the motor's friction).
//! - `behind`: the torque is compared with one that follows the lag without a dead share, which is the play.
//!
//! Both are compared on blocks that the fit has not seen. The standard error is that over blocks, so residuals may be correlated
//! within a block (`blocks`). A [`Calibration`] of the figures on simulated joints gives the probability.

mod behind;
mod blocks;
mod calibration;
mod held_out;
mod regression;

use super::cause;
use super::contest_calibration::LEAST_PROBABILITY;
use super::extended::Size;
use super::finding::Finding;
use super::naming::{MAY_BE_NONE, NAMED, WeighedCause};
use super::rules::{self, Rejection};
use behind::Behind;
use blocks::{Blocks, Positions};
pub use calibration::Calibration;
use held_out::HeldOut;
use joint_log::number::figure;
use joint_log::{Dataset, contract};
use regression::{Fit, Regression};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Number of parts that are left out at a time.
const FOLDS: usize = 10;

/// Fewest blocks that a verdict needs.
const MIN_BLOCKS: usize = 6;

/// Standard error of the play as a share of the lost motion, where it is half of it. The friction of a real gear has no sharp
/// corners. On simulated joints, 95 % of the intervals hold the play with it.
const SHARE_ERROR: f64 = 0.16;

/// Least part of [`SHARE_ERROR`], where the lost motion is all play.
const LEAST_SHARE_ERROR: f64 = 0.15;

/// Least gain of backlash in the torque on held-out rows, in standard errors, with which it is fitted where the positions show it.
const MIN_GAIN_ERRORS: f64 = 2.0;

/// Number of the figures.
const FIGURE_COUNT: usize = 7;

/// Figures of the evidence for play. More of each speaks for play.
pub const FIGURES: [&str; FIGURE_COUNT] = [
    "errors",
    "over_rest",
    "over_torsion",
    "consistency",
    "lag_errors",
    "lag_share",
    "play_by_lag",
];

/// The evidence for play in the difference of two positions.
#[derive(Clone, Debug)]
pub struct TwoPositions {
    /// Column of the second encoder.
    pub column: &'static str,
    /// Play, rad or m. The value is 0 if the best model has none.
    pub play: Size,
    /// Lost motion, rad or m: play, and torsion under the friction of the load.
    pub lost_motion: f64,
    /// Calibrated probability that the gear has play.
    pub probability: f64,
    /// The figures of [`FIGURES`].
    pub figures: [f64; FIGURE_COUNT],
    /// Probability of the same reduction of the held-out error without play, if the blocks are independent.
    pub p_value: f64,
    /// Share of the folds whose fit has play.
    pub stability: f64,
    /// RMS of what remains of the difference, rad or m.
    pub rest: f64,
}

/// The positions are not compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{column} is not searched for play: {why}")]
pub struct Incomparable {
    /// Column of the second encoder.
    pub column: &'static str,
    /// Why.
    pub why: IncomparableReason,
}

/// Why positions cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IncomparableReason {
    /// The log lacks the position of the motor.
    #[error("it needs {0} beside it")]
    NoPosition(&'static str),
    /// One does not follow the other.
    #[error(
        "it moves by {slope} times {position}, and not with it: correct unit, sign or gear ratio of one of them with --columns"
    )]
    OtherJoint {
        /// Slope over the position of the motor, as a report states it.
        slope: String,
        /// Column of the motor's position.
        position: &'static str,
    },
    /// The joint rests.
    #[error("nothing moves")]
    NoMotion,
    /// The log is too short.
    #[error("the log holds {0} reversals, and {MIN_BLOCKS} are needed")]
    FewReversals(usize),
}

impl TwoPositions {
    /// Evaluates the positions of a log; `None` if it has no second one.
    ///
    /// # Errors
    /// A note on why they are not compared: they are not of one joint, or too few reversals are in the log.
    pub fn of(data: &Dataset) -> Option<Result<Self, Incomparable>> {
        let column = contract::joint_position(data.joint);
        let has_both = data.covariates.iter().any(|name| name == column);
        has_both.then(|| Self::compare(data, column).map_err(|why| Incomparable { column, why }))
    }

    fn compare(data: &Dataset, column: &'static str) -> Result<Self, IncomparableReason> {
        let positions = Positions::new(data, column)?;
        let blocks = Blocks::new(&positions, positions.stops(), None);
        let count = blocks.grams.len();
        if count < MIN_BLOCKS {
            return Err(IncomparableReason::FewReversals(count));
        }
        let folds = FOLDS.min(count);
        let part = |fold: usize| Regression::new(&blocks, move |at| at % folds != fold);
        let parts: Vec<Regression> = (0..folds).map(part).collect();
        let all = Regression::new(&blocks, |_| true);
        let (with_play, lost) = (all.play(), all.lost_motion());
        let with: Vec<Fit> = parts.iter().map(Regression::play).collect();
        let without: Vec<Fit> = parts.iter().map(Regression::torsion).collect();
        let seen = HeldOut::new(&blocks, &without, &with);
        let behind = Behind::new(&positions, &lost, blocks.operators[lost.operator], folds);
        let lost_parts: Vec<f64> = parts.iter().map(|part| part.lost_motion().size).collect();
        let play =
            play(lost.size, &behind, &lost_parts, blocks.quantum, data.joint.position_unit());
        let torsion = blocks.torsion_rms(&with_play.coefficients);
        let travel = blocks.operators[with_play.operator].travel;
        let over =
            |value: f64, unit: f64| (value / unit.max(f64::MIN_POSITIVE)).clamp(1e-2, 1e2).ln();
        let [lag_errors, lag_share] = behind.seen.figures();
        let figures = [
            seen.figures()[0],
            over(play.value, seen.rest),
            over(play.value, torsion),
            -over(travel, with_play.size).abs(),
            lag_errors,
            lag_share,
            behind.by_lag,
        ];
        let is_possible = with_play.size > 0.0 && play.value > 0.0;
        Ok(Self {
            column,
            probability: if is_possible {
                Calibration::current().probability(&figures)
            } else {
                LEAST_PROBABILITY
            },
            play,
            lost_motion: lost.size,
            figures,
            p_value: Normal::standard().sf(seen.errors).clamp(1e-300, 1.0),
            stability: with.iter().filter(|fit| fit.size > 0.0).count() as f64 / folds as f64,
            rest: seen.rest,
        })
    }

    /// Returns true if play is named.
    pub fn is_named(&self) -> bool {
        self.probability >= NAMED
    }

    /// Returns the meaning and the size in one sentence.
    pub fn in_words(&self) -> String {
        let unit = &self.play.unit;
        format!(
            "the gear has play of {}: after a reversal the motor moves by {} {unit} before {} follows, and the rest of that is \
             torsion of the gear",
            self.play.in_words(),
            figure(self.lost_motion),
            self.column
        )
    }

    /// Returns a note on a lag that is not named play; `None` if play is named.
    pub fn note(&self) -> Option<String> {
        let unit = &self.play.unit;
        (!self.is_named()).then(|| {
            format!(
                "{} lags the motor by {} {unit} after a reversal; this log does not show that it is play of the gear and not torsion \
                 (probability of play {:.2})",
                self.column,
                figure(self.lost_motion),
                self.probability
            )
        })
    }

    /// Lowers the probability of backlash in the torque where the positions show no play. Where they show play, raises it if the
    /// torque gains by it on held-out rows, so that its compensation is fitted.
    pub fn weigh(&self, weighed: &mut [WeighedCause]) {
        if self.is_named() {
            let gains = |cause: &&mut WeighedCause| {
                cause.cause.name() == BACKLASH && cause.figures.last_in_errors > MIN_GAIN_ERRORS
            };
            for cause in weighed.iter_mut().filter(gains) {
                cause.probability = cause.probability.max(self.probability);
            }
            return;
        }
        for cause in
            weighed.iter_mut().filter(|cause| cause.is_named() && cause.cause.name() == BACKLASH)
        {
            let why = format!(
                "{} and the motor's position show play with a probability of {:.2} only",
                self.column, self.probability
            );
            let limit = self.probability.min(MAY_BE_NONE);
            cause.reject(limit, Rejection::new(&rules::NO_PLAY_BETWEEN_POSITIONS, why));
        }
    }

    /// Adds the finding of play, or completes that of the torque, and keeps the order by probability.
    pub fn add_to(&self, findings: &mut Vec<Finding>) {
        let Some(backlash) = cause::named(BACKLASH).filter(|_| self.is_named()) else { return };
        let mut finding = Finding {
            columns: vec![self.column.to_owned()],
            size: self.play.clone(),
            p_value: self.p_value,
            probability: self.probability,
            stability: self.stability,
            in_words: self.in_words(),
            ..Finding::of(backlash)
        };
        if let Some(at) = findings.iter().position(|other| other.cause.name() == BACKLASH) {
            let of_torque = findings.remove(at);
            if of_torque.is_in_model {
                let travel = of_torque.size.in_words();
                finding.in_words += &format!("; its compensation has a travel of {travel}");
            }
            finding.probability = finding.probability.max(of_torque.probability);
            finding.share_of_residual = of_torque.share_of_residual;
            finding.is_in_model = of_torque.is_in_model;
            finding.evidence = of_torque.evidence;
        }
        let place = findings.partition_point(|other| other.probability >= finding.probability);
        findings.insert(place, finding);
    }
}

/// Name of the cause.
const BACKLASH: &str = "backlash";

/// Returns the play with its 95 % interval: a share of the lost motion, which the torque shows in two ways. `parts` is the lost
/// motion without each fold, and `unit` that of a position.
fn play(lost: f64, behind: &Behind, parts: &[f64], quantum: f64, unit: &str) -> Size {
    let share = behind.share();
    let value = lost * share;
    let folds: Vec<f64> =
        parts.iter().zip(&behind.parts).map(|(lost, share)| lost * share).collect();
    let count = folds.len() as f64;
    let mean = folds.iter().sum::<f64>() / count;
    let squares = folds.iter().map(|fold| (fold - mean).powi(2)).sum::<f64>();
    // A delete-one jackknife over the folds. A step of the encoder is never resolved.
    let of_folds = (count - 1.0) / count * squares + quantum * quantum / 12.0;
    let open = LEAST_SHARE_ERROR.max(4.0 * share * (1.0 - share));
    let of_share = (SHARE_ERROR * open).hypot(0.5 * behind.disagreement()) * lost;
    let t = StudentsT::new(0.0, 1.0, (count - 1.0).max(1.0));
    let of_folds = t.map_or(2.0, |t| t.inverse_cdf(0.975)).powi(2) * of_folds;
    let reach = (of_folds + (1.96 * of_share).powi(2)).sqrt();
    Size::with_interval(value, [(value - reach).max(0.0), value + reach], unit)
}

#[cfg(test)]
mod tests;
