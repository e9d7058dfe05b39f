//! Tracks of a data set: its runs cut at gaps and converted to the core's units.
//!
//! If the log's spacing is even to `EVEN_SPACING_TOLERANCE`, a track has one period and a model is built once. Otherwise
//! each sample carries its own period.

use super::initial_heat::record_earlier_stretches;
use super::torque_low_pass::TorqueLowPass;
use super::track::{Track, row_range};
use compensator_core::Sample;
use joint_log::statistics::quantile_by_count;
use joint_log::work::checkpoint;
use joint_log::{Dataset, Quantity, Run, contract, segments};
use std::ops::Range;
use std::sync::Arc;

/// Largest deviation of a sample's period from the median that counts as even, as a share of the median. The clock of a
/// logger rounds.
const EVEN_SPACING_TOLERANCE: f64 = 0.02;

/// Cuts every run into tracks. Segments of a single row contain no motion and are left out.
pub fn tracks(data: &Dataset) -> Vec<Track> {
    tracks_with(data, None)
}

/// Cuts every run into tracks with one of [`Dataset::covariates`] as the samples' auxiliary column. The column is 0 if
/// the data set does not have this covariate.
pub fn tracks_with(data: &Dataset, auxiliary: Option<&str>) -> Vec<Track> {
    tracks_since(data, auxiliary, campaign_start(data))
}

/// Returns the earliest time stamp of all runs, s.
pub fn campaign_start(data: &Dataset) -> f64 {
    let all_times = data.runs.iter().flat_map(|run| run.time_s.first());
    all_times.copied().fold(f64::INFINITY, f64::min)
}

/// Cuts runs of a campaign that began at `campaign_start` (s) into tracks, so that training and test runs share one
/// clock.
pub fn tracks_since(data: &Dataset, auxiliary: Option<&str>, campaign_start: f64) -> Vec<Track> {
    let auxiliary =
        auxiliary.and_then(|name| data.covariates.iter().position(|covariate| covariate == name));
    let mut tracks = Vec::new();
    for (index, run) in data.runs.iter().enumerate() {
        let acceleration = run.acceleration_or_derived();
        for rows in segments(run) {
            checkpoint();
            if rows.len() > 1 {
                let track = segment_track(run, index, rows, &acceleration, campaign_start);
                tracks.push(if auxiliary.is_some() { track.following(auxiliary) } else { track });
            }
        }
    }
    record_earlier_stretches(tracks.iter_mut());
    tracks
}

/// Converts one segment of a run.
fn segment_track(
    run: &Run,
    index: usize,
    rows: Range<usize>,
    acceleration: &[f64],
    campaign_start: f64,
) -> Track {
    let columns: Vec<(Quantity, &[f64])> = contract::optional()
        .filter_map(|quantity| run.get(quantity).map(|column| (quantity, column)))
        .collect();
    let force = run.get(Quantity::RadialForce);
    let samples = rows
        .clone()
        .map(|row| {
            let mut sample = Sample::default();
            for (quantity, column) in &columns {
                let inside = column[row] * quantity.info().inside_scale;
                quantity.set_in_sample(&mut sample, inside);
            }
            let before = row.saturating_sub(1).max(rows.start);
            Sample {
                velocity_rad_s: run.velocity[row],
                acceleration_rad_s2: acceleration[row],
                radial_force_change_n: force.map_or(0.0, |force| force[row] - force[before]),
                campaign_time_h: (run.time_s[row] - campaign_start) / 3600.0,
                ..sample
            }
        })
        .collect();
    let Periods { period_s, period_ratio } = Periods::of(&run.time_s[rows.clone()]);
    let spikes = run.torque_spikes.iter().take(rows.end).skip(rows.start);
    Track {
        run: index,
        first_row: rows.start,
        samples,
        torque: run.torque[rows.clone()].to_vec(),
        period_s,
        period_ratio,
        weights: Vec::new(),
        torque_spikes: spikes.map(|spike| *spike > 0.0).collect(),
        velocity_is_exact: run.velocity_is_smooth && run.velocity_draws.is_empty(),
        covariates: run.extra.iter().map(|column| column[rows.clone()].to_vec()).collect(),
        velocity_draws: row_range(&run.velocity_draws, &rows),
        motion_error: Vec::new(),
        torque_low_pass: TorqueLowPass::default(),
        earlier_stretches: Arc::default(),
    }
}

/// Spacing of the rows of a segment.
struct Periods {
    /// Median period.
    period_s: f64,
    /// Ratio of each row's period to it; `None` if the spacing is even.
    period_ratio: Option<Vec<f64>>,
}

impl Periods {
    fn of(time_s: &[f64]) -> Self {
        let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let period_s = quantile_by_count(steps.clone(), 0.5).unwrap_or_default().max(1e-9);
        let is_uneven =
            steps.iter().any(|step| (step / period_s - 1.0).abs() > EVEN_SPACING_TOLERANCE);
        let period_ratio = is_uneven.then(|| {
            // A coarse clock may repeat a time stamp: the step is small, not 0.
            steps.insert(0, period_s);
            steps.iter().map(|step| (step / period_s).max(0.01)).collect()
        });
        Self { period_s, period_ratio }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_log::{BadRows, JointKind};

    #[test]
    fn tracks_with_covariate_fill_auxiliary_column() {
        let run = Run {
            time_s: vec![0.0, 1.0, 2.0],
            velocity: vec![1.0; 3],
            torque: vec![2.0; 3],
            extra: vec![vec![0.0; 3], vec![7.0, 8.0, 9.0]],
            ..Run::default()
        };
        let data = Dataset {
            joint: JointKind::Revolute,
            runs: vec![run],
            files: vec![],
            rows: 3,
            rows_read: 3,
            bad_rows: BadRows::default(),
            covariates: vec!["kp".into(), "gap".into()],
            left_out_columns: vec![],
            notes: vec![],
            torque_law: None,
            torque_constant: None,
            sources: vec![],
        };
        let auxiliary = |name| -> Vec<f64> {
            tracks_with(&data, name)[0].samples.iter().map(|sample| sample.auxiliary).collect()
        };
        assert_eq!(auxiliary(Some("gap")), [7.0, 8.0, 9.0]);
        assert_eq!(auxiliary(Some("humidity")), [0.0; 3]);
        assert_eq!(auxiliary(None), [0.0; 3]);
    }
}
