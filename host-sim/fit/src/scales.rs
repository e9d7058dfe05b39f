//! Typical magnitudes in a data set, from which starting values and bounds are derived.

use super::predict::predict;
use super::simulate::Resolution;
use super::statistics::autocorrelation_time;
use super::track::{Rows, Track};
use compensator_core::Parameters;
use joint_log::statistics::quantile_by_count;

/// Typical magnitudes of a data set.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// 95th percentile of the speed, rad/s.
    pub speed: f64,
    /// Root mean square of the torque, Nm.
    pub torque: f64,
    /// Speed that several moving rows do not exceed, rad/s: the slowest motion that the data show.
    pub slow_speed: f64,
    /// Root mean square of the acceleration, rad/s^2.
    pub acceleration: f64,
    /// Median over the tracks of the distance travelled, rad.
    pub travel: f64,
    /// Median over the tracks of the range of the position, rad.
    pub swing: f64,
    /// Duration of the campaign, s.
    pub campaign_s: f64,
    /// Mean temperature, deg C.
    pub temperature_c: f64,
    /// Noise of the torque, Nm, from its second differences, which are small for a smooth torque. If the motion is smooth,
    /// the estimate is at most slightly too large.
    pub noise: f64,
    /// Error of the prior at one width, Nm. It is the noise until the residual of a model is known ([`Scales::beside`]).
    pub observation: f64,
    /// Median sample period of the first track, s.
    pub period_s: f64,
}

/// Rows that count as several, and their minimum share of the moving rows.
pub(crate) const SEVERAL_ROWS: usize = 10;
const SEVERAL_SHARE: f64 = 5e-3;

/// Weight of the prior in independent observations. A whole one would move laws of logs whose error is a model's, because the
/// number of their observations is uncertain.
const PRIOR_WEIGHT: f64 = 0.1;

/// Motion from row to row that limits the stiffness of a wide range, as a share of the travel.
const STIFFEST_TRAVEL: f64 = 3e-6;

/// Minimum number of independent observations that a log counts as.
const MIN_OBSERVATIONS: f64 = 30.0;

impl Scales {
    /// Computes the magnitudes of some tracks.
    pub fn of(tracks: &[Track]) -> Self {
        let samples = || tracks.iter().flat_map(|track| &track.samples);
        let rows = samples().count().max(1) as f64;
        let speeds = samples().map(|s| s.velocity_rad_s.abs()).collect();
        let speed = quantile_by_count(speeds, 0.95).unwrap_or(1.0);
        let moving: Vec<f64> =
            samples().map(|s| s.velocity_rad_s.abs()).filter(|speed| *speed > 0.0).collect();
        let several = (SEVERAL_ROWS as f64 / moving.len().max(1) as f64).max(SEVERAL_SHARE);
        let slow_speed = quantile_by_count(moving, several).unwrap_or(speed);
        let acceleration = samples().map(|s| s.acceleration_rad_s2.powi(2)).sum::<f64>() / rows;
        let squares: f64 = tracks.iter().flat_map(|t| &t.torque).map(|t| t * t).sum();
        let travels = tracks
            .iter()
            .map(|t| t.samples.iter().map(|s| s.velocity_rad_s.abs()).sum::<f64>() * t.period_s)
            .collect();
        let travel = quantile_by_count(travels, 0.5).unwrap_or(1.0);
        let swing =
            quantile_by_count(tracks.iter().map(position_range).collect(), 0.5).unwrap_or(1.0);
        let noise = noise(tracks).max(1e-6 * (squares / rows).sqrt());
        Self {
            speed: speed.max(1e-9),
            slow_speed: slow_speed.clamp(1e-12, speed.max(1e-9)),
            acceleration: acceleration.sqrt().max(1e-9),
            swing: swing.max(1e-9),
            torque: (squares / rows).sqrt().max(1e-12),
            travel: travel.max(1e-9),
            campaign_s: samples().map(|s| s.campaign_time_h * 3600.0).fold(1.0, f64::max),
            temperature_c: samples().map(|s| s.temperature_c).sum::<f64>() / rows,
            noise,
            observation: noise,
            period_s: tracks.first().map_or(1e-3, |t| t.period_s),
        }
    }

    /// Returns the magnitudes with wider ranges of stiffness and Stribeck velocity, for fits that held-out rows judge.
    #[must_use]
    pub fn widened(self) -> Self {
        let slow_speed = self.slow_speed.min(STIFFEST_TRAVEL * self.travel / self.period_s);
        Self { slow_speed, swing: self.swing.max(self.travel), ..self }
    }

    /// Returns the magnitudes with the error of the prior beside what a model leaves. An independent observation has the
    /// model's RMS error times the square root of the number of rows that count as one.
    #[must_use]
    pub fn beside(self, model: &Parameters<f64>, rows: Rows, resolution: Resolution) -> Self {
        let predicted = predict(model, rows, resolution);
        let time = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
        let longest = (predicted.metrics.rows as f64 / MIN_OBSERVATIONS).max(1.0);
        let time = time.min(longest).max(1.0);
        // A model that errs more than none does not say more.
        let error = predicted.metrics.rmse.min(self.torque) * time.sqrt();
        // Spikes raise the noise of the torque above what a model leaves of rows that count less for it.
        let noise = self.noise.min(predicted.metrics.rmse);
        Self { observation: (PRIOR_WEIGHT.sqrt() * error).max(noise), ..self }
    }
}

/// Returns the range of the position along a track, rad.
fn position_range(track: &Track) -> f64 {
    let (mut at, mut least, mut most) = (0.0, 0.0f64, 0.0f64);
    for sample in &track.samples {
        at += sample.velocity_rad_s * track.period_s;
        (least, most) = (least.min(at), most.max(at));
    }
    most - least
}

/// Returns the noise of the torque, Nm. The median excludes breakaways and reversals. The second difference of white noise
/// has `sqrt 6` times its standard deviation, and 0.6745 of that as median magnitude.
fn noise(tracks: &[Track]) -> f64 {
    white_noise(tracks.iter().map(|track| track.torque.as_slice()))
}

/// Returns the standard deviation of the white noise in some unbroken series, as in [`Scales::noise`].
pub fn white_noise<'a>(series: impl Iterator<Item = &'a [f64]>) -> f64 {
    let second = |w: &[f64]| (w[0] - 2.0 * w[1] + w[2]).abs();
    let differences = series.flat_map(|series| series.windows(3).map(second)).collect();
    quantile_by_count(differences, 0.5).unwrap_or_default() / (0.6745 * 6f64.sqrt())
}
