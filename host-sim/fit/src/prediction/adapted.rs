//! Prediction with gains that follow the log: what a driver with adaptation would have applied.
//!
//! The core's adaptation processes the rows in the order of time. The prediction of a row uses the gains that were learnt from
//! earlier rows. At a gap and at the start of a run, the adaptation begins a new stretch: it keeps its gains.
//!
//! A log has no arming, so nothing waits for it. It has no speed of sliding and no noise either: `settings` takes the speed
//! from the log, and the noise from the fit.

use super::{
    LogPrediction, PredictionError, PredictionOptions, as_logged, empty, held_at_start, metrics_of,
    predict_tracks, remarks, set_flags, shaft_track,
};
use crate::Track;
use crate::initial_heat::initial_heat;
use crate::params::ParameterFile;
use crate::simulate::simulate_with_gains;
use compensator_core::adaptation::{
    Adaptation, AdaptationParameters, FOLLOWED, FollowedQuantity, Frozen, Gains, MAX_GAINS,
    Observation,
};
use compensator_core::{ModelState, ParameterId, Sample};
use joint_log::Dataset;
use joint_log::statistics::quantile_by_count;
use joint_log::work::checkpoint_at;

/// Least speed of sliding, as a share of the largest speed. Below it, presliding and Stribeck friction prevail.
const SLIDING_SHARE: f64 = 0.05;

/// Quantile of the speed that counts as the largest. Single rows may be outliers.
const LARGEST_QUANTILE: f64 = 0.99;

/// Least noise, as a share of the Coulomb level. No law fits a real joint better.
const LEAST_NOISE_SHARE: f64 = 5e-3;

/// Share of the log whose residual is the noise, if the parameter file has none.
const FIRST_SHARE: f64 = 0.2;

/// How the gains follow a log.
#[derive(Clone, Copy, Debug, Default)]
pub struct AdaptationOptions {
    /// Memory of the regression, s of sliding; `None` for the core's default.
    pub memory_s: Option<f64>,
    /// Least and largest gain; `None` for the core's default.
    pub range: Option<[f64; 2]>,
}

/// What the adaptation did at one row.
#[derive(Clone, Copy, Debug)]
pub struct RowAdaptation {
    /// Gains of the prediction of this row, in the order of [`AdaptedPrediction::names`].
    pub gains: [f32; MAX_GAINS],
    /// Their standard deviations.
    pub deviations: [f32; MAX_GAINS],
    /// Why nothing is learnt from this row.
    pub frozen: Frozen,
}

/// Prediction of a log with gains that follow it.
#[derive(Clone, Debug)]
pub struct AdaptedPrediction {
    /// Prediction with the gains.
    pub prediction: LogPrediction,
    /// Prediction of the fixed set.
    pub fixed: LogPrediction,
    /// The adaptation of each row of each run, in the order of the log; `None` for a row without a prediction.
    pub rows: Vec<Vec<Option<RowAdaptation>>>,
    /// Names of the gains: `level`, `viscous` and the terms.
    pub names: Vec<String>,
    /// Settings of the adaptation.
    pub settings: AdaptationParameters,
    /// Period of the adaptation, s: the median of the log.
    pub period_s: f64,
    /// Gains after the last row.
    pub last: [f32; MAX_GAINS],
    /// Standard deviations of the gains after the last row.
    pub last_deviations: [f32; MAX_GAINS],
    /// Time of sliding that was learnt from, s.
    pub learnt_s: f64,
    /// Quantity that the learnt level follows, and that no term describes.
    pub followed: Option<FollowedQuantity>,
}

/// Predicts a log with gains that follow it, given its tracks.
///
/// # Errors
/// One line if the model has a network, a setting is out of range, or the core refuses the model.
pub fn predict_adapted(
    file: &ParameterFile,
    data: &Dataset,
    tracks: &[Track],
    options: &PredictionOptions,
    adapt: &AdaptationOptions,
) -> Result<AdaptedPrediction, PredictionError> {
    if file.network.is_some() {
        return Err(PredictionError::Network);
    }
    // Gains follow the driver's law.
    let options = &PredictionOptions { of_driver: true, ..*options };
    let fixed = predict_tracks(file, data, tracks, options)?;
    let order = order_of_time(tracks);
    let settings = settings(file, data, tracks, &fixed, &order, adapt);
    let period_s = median_period(tracks).ok_or(PredictionError::SingleRows)?;
    let written = file.parameters.convert::<f32>();
    let mut adaptation = Adaptation::build(&written, &settings, period_s as f32)?;
    let mut runs: Vec<_> = data.runs.iter().map(|run| empty(run.len())).collect();
    let mut rows: Vec<_> = data.runs.iter().map(|run| vec![None; run.len()]).collect();
    for logged in order.into_iter().map(|at| &tracks[at]) {
        let track: &Track = &shaft_track(file, data, logged);
        let learnt = learn_track(&mut adaptation, file, data, track);
        let gains = |row: usize| Gains::from_array(&learnt[row].gains).convert::<f64>();
        let scaled = file.parameters.with_gains(&gains(0));
        let resolution = options.resolution.unwrap_or_else(|| file.fit.resolution());
        let held = held_at_start(&scaled, track, options.start, resolution);
        let run = &mut runs[track.run];
        let first = track.first_row;
        let sink = |row: usize, torque: f64, bristle: f64| {
            run.torque[first + row] = torque;
            run.bristle_torque[first + row] = bristle;
        };
        simulate_with_gains(&file.parameters, track, held, resolution, gains, sink);
        as_logged(file, data, track, run);
        set_flags(file, logged, run);
        let of_track = rows[track.run][first..].iter_mut();
        of_track.zip(learnt).for_each(|(row, learnt)| *row = Some(learnt));
    }
    let metrics = metrics_of(data, &runs);
    Ok(AdaptedPrediction {
        prediction: LogPrediction { metrics, remarks: remarks(file, None, data, &runs), runs },
        fixed,
        rows,
        names: names(file),
        settings,
        period_s,
        last: adaptation.gains().to_array(),
        last_deviations: adaptation.deviations(),
        learnt_s: adaptation.learnt_s().into(),
        followed: adaptation.followed(),
    })
}

/// Learns from the rows of a track. Returns, for each row, what was known before it and why it was not learnt from.
fn learn_track(
    adaptation: &mut Adaptation,
    file: &ParameterFile,
    data: &Dataset,
    track: &Track,
) -> Vec<RowAdaptation> {
    let run = &data.runs[track.run];
    let heat = initial_heat(&file.parameters, track) as f32;
    adaptation.resume(ModelState::default().with_heat(heat));
    let columns = FOLLOWED.map(|quantity| run.get(quantity));
    let mut deviations = adaptation.deviations();
    let mut learnt_s = adaptation.learnt_s();
    let mut learnt = Vec::with_capacity(track.len());
    for (row, sample) in track.samples.iter().enumerate() {
        checkpoint_at(row);
        let place = track.first_row + row;
        let gains = adaptation.gains().to_array();
        let before = deviations;
        adaptation.step(&Observation {
            sample: sample.map(|value| value as f32),
            torque_nm: track.torque[row] as f32,
            followed: columns.map(|column| column.map(|values| values[place] as f32)),
            blocked: run.is_spike(place).then_some(Frozen::Inputs),
        });
        if adaptation.learnt_s() != learnt_s {
            learnt_s = adaptation.learnt_s();
            deviations = adaptation.deviations();
        }
        learnt.push(RowAdaptation { gains, deviations: before, frozen: adaptation.frozen() });
    }
    learnt
}

/// Returns the tracks in the order of the campaign's clock if their times do not overlap, else in that of the log.
fn order_of_time(tracks: &[Track]) -> Vec<usize> {
    let span = |at: usize| {
        let time =
            |sample: Option<&Sample<f64>>| sample.map_or(0.0, |sample| sample.campaign_time_h);
        [time(tracks[at].samples.first()), time(tracks[at].samples.last())]
    };
    let logged: Vec<usize> = (0..tracks.len()).collect();
    let mut sorted = logged.clone();
    sorted.sort_by(|a, b| span(*a)[0].total_cmp(&span(*b)[0]));
    let has_common_clock = sorted.windows(2).all(|pair| span(pair[0])[1] <= span(pair[1])[0]);
    if has_common_clock { sorted } else { logged }
}

/// Returns the median time between rows, s.
fn median_period(tracks: &[Track]) -> Option<f64> {
    let periods = tracks.iter().flat_map(|track| std::iter::repeat_n(track.period_s, track.len()));
    quantile_by_count(periods.collect(), 0.5)
}

/// Returns the settings of the adaptation for a log.
fn settings(
    file: &ParameterFile,
    data: &Dataset,
    tracks: &[Track],
    fixed: &LogPrediction,
    order: &[usize],
    adapt: &AdaptationOptions,
) -> AdaptationParameters {
    let defaults = AdaptationParameters::default();
    let speeds = tracks.iter().flat_map(|track| &track.samples);
    let speeds = speeds.map(|sample| sample.velocity_rad_s.abs()).collect();
    let largest = quantile_by_count(speeds, LARGEST_QUANTILE).unwrap_or_default();
    let least_noise = LEAST_NOISE_SHARE * file.parameters.get(ParameterId::CoulombTorque).abs();
    let noise = file.fit.rmse.unwrap_or_else(|| first_error(data, tracks, fixed, order));
    let [least, most] =
        adapt.range.unwrap_or([defaults.least_gain.into(), defaults.largest_gain.into()]);
    AdaptationParameters {
        least_gain: least as f32,
        largest_gain: most as f32,
        memory_s: adapt.memory_s.map_or(defaults.memory_s, |memory| memory as f32),
        settle_s: 0.0,
        least_velocity_rad_s: (SLIDING_SHARE * largest) as f32,
        noise_nm: noise.max(least_noise).max(1e-6) as f32,
        ..defaults
    }
}

/// Returns the RMSE of the fixed set in the first rows of the log: whole tracks with at least [`FIRST_SHARE`] of the rows.
fn first_error(data: &Dataset, tracks: &[Track], fixed: &LogPrediction, order: &[usize]) -> f64 {
    let (mut squares, mut count) = (0.0, 0usize);
    for track in order.iter().map(|at| &tracks[*at]) {
        if count as f64 > FIRST_SHARE * data.rows as f64 {
            break;
        }
        let (run, predicted) = (&data.runs[track.run], &fixed.runs[track.run].torque);
        let rows = track.first_row..track.first_row + track.len();
        for row in rows.filter(|row| !run.is_spike(*row) && predicted[*row].is_finite()) {
            squares += (run.torque[row] - predicted[row]).powi(2);
            count += 1;
        }
    }
    (squares / count.max(1) as f64).sqrt()
}

/// Returns the names of the gains: `level`, `viscous` and the terms.
fn names(file: &ParameterFile) -> Vec<String> {
    let terms = file.parameters.terms.iter().map(|kind| kind.name().replace('-', "_"));
    ["level", "viscous"].map(str::to_owned).into_iter().chain(terms).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params;
    use crate::prediction::log_tracks;

    const MODEL: &str = "schema = 1\njoint = \"revolute\"\nmodel = \"lugre\"\n[parameters]\n\
        coulomb_torque = 1.2\nstatic_torque = 1.6\nbristle_stiffness = 300\n\
        bristle_damping = 0.5\nviscous_friction = 0.4\n[fit]\nextrapolated = true\n";

    /// Returns a log of runs that begin at these times, s, with 1.5 times the friction of the model.
    fn log(starts_s: [f64; 2]) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(String::from);
        let run = |(index, start_s): (usize, f64)| {
            let mut columns = vec![Vec::new(); 3];
            for row in 0..3000 {
                let time = row as f64 * 0.01;
                let velocity = 0.8 * (1.3 * time).sin();
                let torque = 1.5 * (1.2 * velocity.signum() + 0.4 * velocity);
                for (column, value) in columns.iter_mut().zip([start_s + time, velocity, torque]) {
                    column.push(value);
                }
            }
            (format!("run {index}"), columns)
        };
        Dataset::from_columns(&names, starts_s.into_iter().enumerate().map(run)).expect("a log")
    }

    fn predict(data: &Dataset, adapt: &AdaptationOptions) -> AdaptedPrediction {
        predict_with(MODEL, data, adapt)
    }

    fn predict_with(text: &str, data: &Dataset, adapt: &AdaptationOptions) -> AdaptedPrediction {
        let file = params::parse(text, &[]).expect("a valid file");
        let tracks = log_tracks(&file, data).expect("tracks");
        predict_adapted(&file, data, &tracks, &PredictionOptions::default(), adapt)
            .expect("a prediction")
    }

    #[test]
    fn predict_adapted_with_gains_of_one_returns_the_fixed_prediction() {
        let adapt = AdaptationOptions { range: Some([1.0, 1.0]), ..Default::default() };
        let measured = "\n[measurement]\ntorque_sign = -1\ntorque_delay_s = 0.02\n";
        for text in [MODEL.to_owned(), format!("{MODEL}{measured}")] {
            let found = predict_with(&text, &log([0.0, 40.0]), &adapt);
            assert!(found.learnt_s > 10.0);
            for (adapted, fixed) in found.prediction.runs.iter().zip(&found.fixed.runs) {
                assert_eq!(adapted.torque, fixed.torque);
            }
        }
    }

    #[test]
    fn predict_adapted_learns_the_torque_of_the_shaft() {
        let mut reversed = log([0.0, 40.0]);
        let torques = reversed.runs.iter_mut().flat_map(|run| &mut run.torque);
        torques.for_each(|torque| *torque = -*torque);
        let text = format!("{MODEL}\n[measurement]\ntorque_sign = -1\n");
        let adapt = AdaptationOptions::default();
        let (found, expected) =
            (predict_with(&text, &reversed, &adapt), predict(&log([0.0, 40.0]), &adapt));
        assert_eq!(found.last, expected.last);
        assert!(found.last[0] > 1.3, "{:?}", found.last);
    }

    #[test]
    fn predict_adapted_follows_the_common_clock_or_the_order_of_the_log() {
        let first_gains = |starts_s| {
            let found = predict(&log(starts_s), &AdaptationOptions::default());
            let gain = |run: &Vec<Option<RowAdaptation>>| run[0].map(|row| row.gains[0]);
            [gain(&found.rows[0]), gain(&found.rows[1])].map(|gain| gain.expect("a gain"))
        };
        for (starts_s, first) in [([0.0, 40.0], 0), ([40.0, 0.0], 1), ([10.0, 0.0], 0)] {
            let gains = first_gains(starts_s);
            assert_eq!(gains[first], 1.0, "{starts_s:?}");
            assert!(gains[1 - first] > 1.2, "{starts_s:?}: {gains:?}");
        }
    }

    #[test]
    fn predict_adapted_without_two_rows_in_a_stretch_is_an_error() {
        let file = params::parse(MODEL, &[]).expect("a valid file");
        let result = predict_adapted(
            &file,
            &log([0.0, 40.0]),
            &[],
            &PredictionOptions::default(),
            &AdaptationOptions::default(),
        );
        assert!(result.is_err());
    }
}
