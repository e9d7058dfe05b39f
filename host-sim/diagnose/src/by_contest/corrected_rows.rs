//! The log with the corrections of a hypothesis: late channels, a share of another channel in the torque, and the rows that are
//! evaluated.
//!
//! Each correction is a finding of the report, so that its reader knows of which torque the models are.

use crate::DiagnosisOptions;
use crate::channel_share::ChannelShare;
use crate::contest::{Correction, Finalist, Rows};
use crate::late_channel::{LateChannel, LateChannelKind};
use crate::leading_fault::Corrected;
use crate::left_out::one_step_left_out;
use crate::model::FittedModel;
use crate::train_test::TrainTest;
use friction_fit::spec::SpecError;
use friction_fit::{
    COMPARISON_TOLERANCE, ChannelGain, FitOptions, LowPassShape, Measurement, Outcome, Predicted,
    TorqueLowPass, Weighting, identify, predict,
};
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::{JointKind, Quantity, contract};

/// Progress at which a fit to all rows ends, as a share of the squared error. It begins at the optimum of an excerpt.
const STAGNATION: f64 = 1e-3;

/// The log with the correction of a hypothesis.
#[derive(Clone, Debug)]
pub(super) struct CorrectedRows {
    /// With the weights of the contest, for fits.
    pub(super) fitted: TrainTest,
    /// As it is judged.
    pub(super) judged: TrainTest,
    /// Delay of the torque that the model has as a cause, s.
    pub(super) delay_s: Option<f64>,
    /// Time by which the torque is late beside what is fitted, s.
    torque_delay_s: f64,
    /// Low-pass of the torque channel.
    low_pass: TorqueLowPass,
    /// Shares of other channels in the torque.
    shares: Vec<ChannelShare>,
    /// The corrections as faults of the log.
    pub(super) findings: Vec<LogFinding>,
    /// What the correction of a late channel takes.
    pub(super) late: Option<Corrected>,
    /// Autocorrelation time of the residual in rows: so many rows are one observation for a fit.
    pub(super) memory_rows: f64,
}

impl CorrectedRows {
    /// Returns the log with the corrections of a finalist.
    pub(super) fn new(
        log: &TrainTest,
        rows: &Rows,
        finalist: &Finalist,
        options: &DiagnosisOptions,
    ) -> Self {
        let joint = log.train.joint;
        let step_s = rows.step_s;
        let (mut judged, mut delay_s, mut findings) = (log.clone(), None, Vec::new());
        let (mut torque_delay_s, mut low_pass) = (0.0, TorqueLowPass::default());
        let mut late = None;
        let (mut late_channel, mut shape) = (None, LowPassShape::FirstOrder);
        match finalist.correction {
            Correction::None => {}
            Correction::TorqueLate(late) if late > 1.0 => delay_s = Some(late * step_s),
            Correction::TorqueLate(late) if late >= -1.0 => {
                torque_delay_s = late * step_s;
                judged = judged.with_later_velocity(-torque_delay_s);
            }
            Correction::TorqueLate(late) => late_channel = Some((LateChannelKind::Velocity, -late)),
            Correction::TorqueLowPass(late, own) => {
                (late_channel, shape) = (Some((LateChannelKind::LowPassedTorque, late)), own);
            }
        }
        if let Some((which, rows)) =
            late_channel.filter(|(which, _)| !options.as_logged.contains(&which.kind()))
        {
            let share_left = finalist.share_left;
            let channel = LateChannel { late: which, time_s: rows * step_s, shape, share_left };
            judged = channel.lag_compensated(judged);
            match which {
                LateChannelKind::Velocity => torque_delay_s = -channel.time_s,
                LateChannelKind::LowPassedTorque => {
                    low_pass = TorqueLowPass { time_s: channel.time_s, shape };
                }
            }
            findings.push(channel.finding(joint));
            late = Some(channel.gain());
        }
        let mut shares = Vec::new();
        if !options.as_logged.contains(&LogFindingKind::ChannelGain) {
            shares.clone_from(&finalist.shares);
            for share in &shares {
                judged = judged.without_share(share);
                findings.push(share_finding(share, joint));
            }
        }
        let mut fitted = judged.clone();
        for track in &mut fitted.train_tracks {
            let first = rows.runs[track.run].start + track.first_row;
            track.scale_weights(|row| rows.weights[first + row].powi(2));
        }
        let memory_rows = 1.0;
        Self {
            fitted,
            judged,
            delay_s,
            torque_delay_s,
            low_pass,
            shares,
            findings,
            late,
            memory_rows,
        }
    }

    /// Returns what lies between the shaft and the log.
    pub(super) fn measurement(&self, is_reversed: bool) -> Measurement {
        let signed = Measurement::of_sign(is_reversed);
        let torque_sign = signed.torque_sign;
        let gain = |share: &ChannelShare| ChannelGain {
            column: share.column.clone(),
            gain: torque_sign * share.torque_per_unit,
            mean: share.mean,
        };
        Measurement {
            torque_delay_s: self.torque_delay_s,
            torque_low_pass: self.low_pass,
            channel_gains: self.shares.iter().map(gain).collect(),
            ..signed
        }
    }

    /// Returns a log as it is.
    pub(super) fn uncorrected(log: &TrainTest) -> Self {
        Self {
            fitted: log.clone(),
            judged: log.clone(),
            delay_s: None,
            torque_delay_s: 0.0,
            low_pass: TorqueLowPass::default(),
            shares: Vec::new(),
            findings: Vec::new(),
            late: None,
            memory_rows: 1.0,
        }
    }

    /// Fits a model to all rows, from its parameters, until it converges.
    pub(super) fn identify(&self, model: &FittedModel) -> Result<Outcome, SpecError> {
        let log = self.fitted.following(model.follows.as_ref());
        let options = FitOptions {
            starts: 1,
            start: Some(model.parameters.clone()),
            fixed: model.fixed.clone(),
            resolution: Some(model.resolution),
            has_weak_prior: true,
            tolerance: COMPARISON_TOLERANCE * self.memory_rows,
            stagnation: STAGNATION,
            ..FitOptions::default()
        };
        identify(&model.spec, &model.parameters, log.train_rows(), log.test_rows(), &options)
    }

    /// Returns the model on held-out rows.
    pub(super) fn held_out(&self, model: &FittedModel) -> Predicted {
        match self.judged.leaves_each_out {
            true => one_step_left_out(&self.fitted, &self.judged, model),
            false => model.on_test(&self.judged),
        }
    }

    /// Weighs rows that differ from those beside them less, beside a model.
    pub(super) fn weigh_robustly(&mut self, model: &FittedModel) {
        for log in [&mut self.fitted, &mut self.judged] {
            let weigh = Weighting::of(&log.train_tracks, &model.parameters, model.resolution);
            log.train_tracks = weigh.applied(&log.train_tracks);
            log.test_tracks = weigh.applied(&log.test_tracks);
            log.notes.push(format!(
                "the loss is huber: {} rows differ from the rows beside them and count less",
                weigh.reduced
            ));
        }
    }

    /// Leaves the rows at rest out of the evaluation if a model is less accurate there than in motion.
    pub(super) fn leave_out_rest(&mut self, model: &FittedModel) {
        let squares = |log: &TrainTest| {
            let metrics = predict(&model.parameters, log.train_rows(), model.resolution).metrics;
            (metrics.sse, metrics.rows)
        };
        if let Some(at_rest) = self.judged.worse_at_rest(squares) {
            self.judged = self.judged.clone().without(&at_rest);
        }
    }

    /// Takes the positions of a log whose runs have a common phase.
    pub(super) fn align(&mut self, aligned: &TrainTest) {
        for log in [&mut self.fitted, &mut self.judged] {
            let weights: Vec<Vec<f64>> =
                log.train_tracks.iter().map(|track| track.weights.clone()).collect();
            *log = aligned.clone();
            for (track, weights) in log.train_tracks.iter_mut().zip(weights) {
                track.weights = weights;
            }
        }
    }
}

/// Returns the finding of a torque that holds a share of a channel.
fn share_finding(share: &ChannelShare, joint: JointKind) -> LogFinding {
    let torque = Quantity::Torque.name(joint);
    let ChannelShare { column, torque_per_unit, .. } = share;
    let quantity = contract::covariates().find(|quantity| quantity.name(joint) == column);
    let unit = match quantity {
        Some(quantity) => format!("{}/{}", joint.torque_unit(), quantity.unit(joint)),
        None => format!("{} per unit of {column}", joint.torque_unit()),
    };
    LogFinding {
        kind: LogFindingKind::ChannelGain,
        columns: vec![torque.into(), column.clone()],
        value: *torque_per_unit,
        in_words: format!(
            "{torque} holds {torque_per_unit:.3e} {unit} of {column}, whichever way the joint moves: its gain, its sign or the \
             area that it acts on is wrong. The diagnosis and its models are of the torque without it."
        ),
        unit,
        corrected: true,
    }
}
