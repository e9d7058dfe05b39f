//! The log with the corrections of a hypothesis: late channels, a share of another channel in the torque, and the rows that are
//! evaluated.
//!
//! Each correction is a finding of the report, so that its reader knows of which torque the models are.

use crate::DiagnosisOptions;
use crate::contest::{Correction, Finalist, Rows};
use crate::late_channel::LateChannel;
use crate::leading_fault::Corrected;
use crate::left_out::one_step_left_out;
use crate::model::FittedModel;
use crate::train_test::TrainTest;
use friction_fit::{
    COMPARISON_TOLERANCE, ChannelGain, FitOptions, Measurement, Outcome, Predicted, TorqueLowPass,
    Weighting, identify, predict,
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
    /// What lies between the shaft and the torque of the log, whose sign is that of the log here.
    pub(super) measurement: Measurement,
    /// The corrections as faults of the log.
    pub(super) findings: Vec<LogFinding>,
    /// What the correction of a late channel takes.
    pub(super) late: Option<Corrected>,
    /// Autocorrelation time of the residual in rows: so many rows are one observation for a fit.
    pub(super) memory_rows: f64,
}

impl CorrectedRows {
    /// Returns the log with the corrections of a finalist, and with the weights of the contest.
    pub(super) fn new(
        log: &TrainTest,
        rows: &Rows,
        finalist: &Finalist,
        options: &DiagnosisOptions,
    ) -> Self {
        let is_asked = |kind| !options.as_logged.contains(&kind);
        let late = |low_pass, rows_late: f64| {
            let time_s = rows_late * rows.step_s;
            let channel = LateChannel { low_pass, time_s, share_left: finalist.share_left };
            Some(channel).filter(|channel| is_asked(channel.kind()))
        };
        let uncorrected = Self::uncorrected(log);
        let in_time = match finalist.correction {
            Correction::None => uncorrected,
            Correction::TorqueLate(by) if by > 1.0 => {
                Self { delay_s: Some(by * rows.step_s), ..uncorrected }
            }
            Correction::TorqueLate(by) if by >= -1.0 => {
                uncorrected.with_late_torque(by * rows.step_s)
            }
            Correction::TorqueLate(by) => uncorrected.with_late_channel(late(None, -by)),
            Correction::TorqueLowPass(by, shape) => {
                uncorrected.with_late_channel(late(Some(shape), by))
            }
        };
        let shares = finalist.shares.iter().filter(|_| is_asked(LogFindingKind::ChannelGain));
        shares.fold(in_time, Self::without_share).with_weights(rows)
    }

    /// Returns a log as it is.
    pub(super) fn uncorrected(log: &TrainTest) -> Self {
        Self {
            fitted: log.clone(),
            judged: log.clone(),
            delay_s: None,
            measurement: Measurement::default(),
            findings: Vec::new(),
            late: None,
            memory_rows: 1.0,
        }
    }

    /// Returns the rows with the velocity of the time of the torque.
    fn with_late_torque(self, torque_delay_s: f64) -> Self {
        let judged = self.judged.with_later_velocity(-torque_delay_s);
        Self { judged, measurement: Measurement { torque_delay_s, ..self.measurement }, ..self }
    }

    /// Returns the rows with a late channel taken into account, and its finding.
    fn with_late_channel(self, late: Option<LateChannel>) -> Self {
        let Some(channel) = late else { return self };
        let finding = channel.finding(self.judged.train.joint);
        let corrected = match channel.low_pass {
            None => self.with_late_torque(-channel.time_s),
            Some(shape) => {
                let torque_low_pass = TorqueLowPass { time_s: channel.time_s, shape };
                let judged = self.judged.through_low_pass(torque_low_pass);
                let measurement = Measurement { torque_low_pass, ..self.measurement };
                Self { judged, measurement, ..self }
            }
        };
        Self { findings: vec![finding], late: Some(channel.gain()), ..corrected }
    }

    /// Returns the rows without the share of a channel in the torque, and its finding.
    fn without_share(mut self, share: &ChannelGain) -> Self {
        self.findings.push(share_finding(share, self.judged.train.joint));
        self.measurement.channel_gains.push(share.clone());
        Self { judged: self.judged.without_share(share), ..self }
    }

    /// Returns the rows with the weights of the contest in fits.
    fn with_weights(self, rows: &Rows) -> Self {
        let mut fitted = self.judged.clone();
        for track in &mut fitted.train_tracks {
            let first = rows.first_row(track);
            track.scale_weights(|row| rows.weights[first + row].powi(2));
        }
        Self { fitted, ..self }
    }

    /// Returns what lies between the shaft and the log.
    pub(super) fn measurement(&self, is_reversed: bool) -> Measurement {
        let torque_sign = Measurement::of_sign(is_reversed).torque_sign;
        let mut measurement = Measurement { torque_sign, ..self.measurement.clone() };
        measurement.channel_gains.iter_mut().for_each(|share| share.gain *= torque_sign);
        measurement
    }

    /// Fits a model to all rows, from its parameters, until it converges.
    pub(super) fn identify(&self, model: &FittedModel) -> Outcome {
        let log = self.fitted.following(model.follows.as_ref());
        let options = FitOptions {
            fixed: model.fixed.clone(),
            resolution: Some(model.resolution),
            tolerance: COMPARISON_TOLERANCE * self.memory_rows,
            stagnation: STAGNATION,
            ..FitOptions::for_comparison(Some(model.parameters.clone()))
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

    /// Returns the rows with less weight for those that differ from the rows beside them, beside a model.
    pub(super) fn weighed_robustly(self, model: &FittedModel) -> Self {
        let weighed = |mut log: TrainTest| {
            let weigh = Weighting::of(&log.train_tracks, &model.parameters, model.resolution);
            log.train_tracks = weigh.applied(&log.train_tracks);
            log.test_tracks = weigh.applied(&log.test_tracks);
            log.notes.push(format!(
                "the loss is huber: {} rows differ from the rows beside them and count less",
                weigh.reduced
            ));
            log
        };
        Self { fitted: weighed(self.fitted), judged: weighed(self.judged), ..self }
    }

    /// Returns the rows without those at rest in the evaluation, if a model is less accurate there than in motion.
    pub(super) fn without_rest(self, model: &FittedModel) -> Self {
        let errors = |log: &TrainTest| {
            predict(&model.parameters, log.train_rows(), model.resolution).metrics
        };
        match self.judged.worse_at_rest(errors) {
            Some(at_rest) => Self { judged: self.judged.without(&at_rest), ..self },
            None => self,
        }
    }

    /// Returns the rows at the positions of a log whose runs have a common phase.
    pub(super) fn aligned(self, aligned: &TrainTest) -> Self {
        let with_weights_of = |log: &TrainTest| {
            let mut log_at_phase = aligned.clone();
            for (track, weighted) in log_at_phase.train_tracks.iter_mut().zip(&log.train_tracks) {
                track.weights.clone_from(&weighted.weights);
            }
            log_at_phase
        };
        Self {
            fitted: with_weights_of(&self.fitted),
            judged: with_weights_of(&self.judged),
            ..self
        }
    }
}

/// Returns the finding of a torque that holds a share of a channel.
fn share_finding(share: &ChannelGain, joint: JointKind) -> LogFinding {
    let torque = Quantity::Torque.name(joint);
    let ChannelGain { column, gain, .. } = share;
    let quantity = contract::covariates().find(|quantity| quantity.name(joint) == column);
    let unit = match quantity {
        Some(quantity) => format!("{}/{}", joint.torque_unit(), quantity.unit(joint)),
        None => format!("{} per unit of {column}", joint.torque_unit()),
    };
    LogFinding {
        kind: LogFindingKind::ChannelGain,
        columns: vec![torque.into(), column.clone()],
        value: *gain,
        in_words: format!(
            "{torque} holds {gain:.3e} {unit} of {column}, whichever way the joint moves: its gain, its sign or the \
             area that it acts on is wrong. The diagnosis and its models are of the torque without it."
        ),
        unit,
        corrected: true,
    }
}
