//! A channel that is late against the others, where the log alone can tell: the torque went through a low-pass before
//! it was logged, or a velocity without a position is the mean of past differences.
//!
//! A filtered torque follows a reversal late. Bristles that are too soft look like it, and so does a delay; but a travel
//! takes less time where the joint turns hard, and a delay leaves the edges sharp. A velocity that comes late makes the
//! torque come *before* the motion, which no friction does. So the base model is fitted through low-passes of several time
//! constants ([`friction_fit::channel`]), and to the velocity of several times later. One is taken if it lowers
//! `n ln(SSE)` by what its choice costs (`n` the number of *independent* rows); a low-pass must be better than a delay in
//! its place as well. Hysteresis that the base law lacks looks like a lag in a log of one speed. So a late channel must
//! keep half of its gain beside Maxwell-slip elements ([`super::hysteresis`]), whose torque depends on the travel and not
//! on the time. A linear test of both comes first, so that most logs need none of these fits. Both are sought beside bristles alone (a linear law's sharp edges are rounded by whatever is slow, on
//! two measured seals by a low-pass as slow as may be), and not taken at the end of their range.
//!
//! From there on the model's torque goes through the low-pass wherever it is held against the measured one, and the
//! velocity is that of the later time. The friction that is fitted is the shaft's; nothing of either is handed to a driver.

use super::baseline::independent_rows;
use super::candidate::{FitContext, FoundSettings, Regressor, row};
use super::hysteresis;
use super::model::{FittedModel, again};
use super::sensitivities::sensitivities;
use super::survey::{block_length, survey};
use super::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::Track;
use friction_fit::spec::SpecError;
use friction_fit::torque_low_pass::{LowPassShape, TorqueLowPass};
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::number::figure;
use joint_log::{JointKind, Quantity};
use std::f64::consts::TAU;

/// Times that are tried: from half a row on, doubled so many times.
const TRIED: i32 = 9;

/// The longest, s: a low-pass of 1.6 Hz. What is slower is taken for what it may be as well, soft bristles.
const LONGEST_S: f64 = 0.1;

/// Halvings of the step around the best one, in its logarithm: to 0.3 %, or a delay or a travel makes up for the rest.
const REFINED: usize = 7;

/// Rows looked at, where a log has more, and of each track at least.
const MOST_ROWS: usize = 6000;

/// See [`MOST_ROWS`].
const FEWEST_ROWS: usize = 100;

/// Which channel is late, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LateChannelKind {
    /// The torque went through a low-pass.
    LowPassedTorque,
    /// The velocity is that of an earlier time.
    Velocity,
}

impl LateChannelKind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::LowPassedTorque, Self::Velocity];

    /// The kind of finding it is.
    pub fn kind(self) -> LogFindingKind {
        match self {
            Self::LowPassedTorque => LogFindingKind::TorqueLag,
            Self::Velocity => LogFindingKind::VelocityLag,
        }
    }

    /// Whether a log may have it. A velocity beside a position has been held against that one.
    fn may_be_in(self, log: &TrainTest) -> bool {
        self == Self::LowPassedTorque || !log.has_position()
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

/// The late channel of a log, if there is one of these; of several the one that explains most.
///
/// # Errors
/// If the model has as many terms as the core takes.
pub fn found(
    log: &TrainTest,
    base: &FittedModel,
    sought: &[LateChannelKind],
) -> Result<Option<LateChannel>, SpecError> {
    if !base.spec.law.has_bristles() {
        return Ok(None);
    }
    let log = &excerpt(log);
    let without = &again(log.train_rows(), base);
    let lags = screening_lags(log);
    let beside_hysteresis = sse_beside(log, without, &[]);
    let rows = independent_rows(log, without);
    let reduction = rows * (beside_hysteresis / sse_beside(log, without, &lags)).ln();
    if reduction.is_nan() || reduction < (lags.len() + 1) as f64 * rows.max(2.0).ln() {
        return Ok(None);
    }
    let mut best: Option<LateChannel> = None;
    for late in sought.iter().copied().filter(|late| late.may_be_in(log)) {
        let Some((channel, fitted)) = best_time(log, (base, without), late) else { continue };
        if late == LateChannelKind::LowPassedTorque
            && delayed(log, without, channel.time_s)?.sse <= fitted.sse
        {
            continue;
        }
        let compensated = channel.lag_compensated(log.clone());
        let kept = (beside_hysteresis / sse_beside(&compensated, &fitted, &[])).ln();
        let is_lag = rows * kept > cost(rows) && kept > -MIN_KEPT * channel.share_left.ln();
        if is_lag && best.is_none_or(|best| channel.share_left < best.share_left) {
            best = Some(channel);
        }
    }
    Ok(best)
}

/// Share of its gain, in `ln(SSE)`, that a late channel must keep beside the elements of hysteresis.
const MIN_KEPT: f64 = 0.5;

/// Time constants of the lags in the linear test, in periods of the log; 0 stands for the derivative at no lag.
const SCREENED_PERIODS: [f64; 4] = [0.0, 4.0, 16.0, 64.0];

/// Returns the time constants of the linear test on this log, s.
fn screening_lags(log: &TrainTest) -> Vec<f64> {
    let period_s = log.train_tracks.first().map_or(0.0, |track| track.period_s);
    let times = SCREENED_PERIODS.map(|periods| periods * period_s);
    times.into_iter().filter(|time_s| *time_s <= LONGEST_S).collect()
}

/// Returns the squared error of a model in a linear fit with the elements of hysteresis and with lags of these time
/// constants, s, in Nm^2.
fn sse_beside(log: &TrainTest, model: &FittedModel, lags_s: &[f64]) -> f64 {
    let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
    let mut columns = hysteresis::columns(&FitContext {
        log,
        spec: &model.spec,
        at: &at,
        found: FoundSettings::default(),
    });
    columns.extend(lags_s.iter().map(|time_s| lag(*time_s)));
    survey(log, &at, &[], &columns, block_length(log, &at)).sse_beside_other_laws()
}

/// Returns the change of the torque by a low-pass of this time constant, s; for 0, its derivative by the time.
fn lag(time_s: f64) -> Regressor {
    if time_s == 0.0 {
        return row(|row| row.slope);
    }
    Regressor::Track(Box::new(move |track, at| {
        let share = 1.0 - (-track.period_s / time_s).exp();
        let mut held = at.shaft_torque.first().copied().unwrap_or_default();
        let follow = |torque: &f64| {
            held += share * (torque - held);
            held - torque
        };
        at.shaft_torque.iter().map(follow).collect()
    }))
}

/// The channel with which the base model, begun from `base`, fits best, if it is worth it against the same `without`.
fn best_time(
    log: &TrainTest,
    (base, without): (&FittedModel, &FittedModel),
    late: LateChannelKind,
) -> Option<(LateChannel, FittedModel)> {
    let period = log.train_tracks.first()?.period_s;
    let at = |time_s: f64, shape: LowPassShape, from: &FittedModel| {
        let channel = LateChannel { late, time_s, shape, share_left: 1.0 };
        again(channel.lag_compensated(log.clone()).train_rows(), from)
    };
    let times = (0..=TRIED).map(|step| 0.5 * period * 2f64.powi(step));
    let mut best: Option<(f64, FittedModel)> = None;
    let mut worse = 0;
    for time in times.filter(|time| *time <= LONGEST_S) {
        let fitted = at(time, LowPassShape::FirstOrder, base);
        if best.as_ref().is_none_or(|(_, best)| fitted.sse < best.sse) {
            (best, worse) = (Some((time, fitted)), 0);
        } else {
            worse += 1;
        }
        // Beyond the best one the error only grows.
        if worse == 2 {
            break;
        }
    }
    let (coarse_s, roughly) = best?;
    let refined = |shape: LowPassShape| {
        let (mut time, mut fitted) = (coarse_s, at(coarse_s, shape, base));
        let mut step = 2f64.sqrt();
        for _ in 0..REFINED {
            for other in [time / step, time * step] {
                let there = at(other, shape, &fitted);
                if there.sse < fitted.sse {
                    (time, fitted) = (other, there);
                    break;
                }
            }
            step = step.sqrt();
        }
        let share_left = fitted.sse / without.sse;
        (LateChannel { late, time_s: time, shape, share_left }, fitted)
    };
    let rows = independent_rows(log, &roughly);
    let is_worth_it = |fitted: &FittedModel| rows * (without.sse / fitted.sse).ln() > cost(rows);
    if !is_worth_it(&roughly) {
        return None;
    }
    let shapes = match late {
        LateChannelKind::LowPassedTorque => LowPassShape::ALL.as_slice(),
        LateChannelKind::Velocity => &[LowPassShape::FirstOrder],
    };
    let all = shapes.iter().map(|shape| refined(*shape));
    let (channel, fitted) = all.min_by(|a, b| a.1.sse.total_cmp(&b.1.sse))?;
    (channel.time_s * 2f64.sqrt() < LONGEST_S).then_some((channel, fitted))
}

/// The beginning of every track: some forty fits are made here, and a lateness shows in every reversal.
fn excerpt(log: &TrainTest) -> TrainTest {
    let rows: usize = log.train_tracks.iter().map(Track::len).sum();
    let mut log = log.clone();
    if rows > MOST_ROWS {
        for track in &mut log.train_tracks {
            let part = (track.len() * MOST_ROWS / rows).max(FEWEST_ROWS);
            *track = track.part(0..part.min(track.len()));
        }
    }
    log
}

/// What a time chosen from all must lower `n ln(SSE)` by.
fn cost(rows: f64) -> f64 {
    2.0 * rows.max(2.0).ln()
}

/// The base with a delay, from about this one on.
fn delayed(log: &TrainTest, base: &FittedModel, delay_s: f64) -> Result<FittedModel, SpecError> {
    if base.spec.rigid_body.contains(&TermKind::ChannelDelay) {
        return Ok(base.clone());
    }
    let mut spec = base.spec.clone();
    spec.terms.push(TermKind::ChannelDelay);
    let mut best = base.clone();
    for share in [0.25, 1.0] {
        let mut parameters = spec.parameters()?;
        parameters.choices = base.parameters.choices;
        for id in base.parameters.active() {
            parameters.set(id, base.parameters.get(id));
        }
        parameters.set(Id::ChannelDelay, share * delay_s);
        let start = FittedModel { spec: spec.clone(), parameters, ..base.clone() };
        let fitted = again(log.train_rows(), &start);
        if fitted.sse < best.sse {
            best = fitted;
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests;
