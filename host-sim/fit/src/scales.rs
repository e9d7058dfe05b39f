//! Typical magnitudes in a data set, from which starting values and bounds are derived.

use super::track::Track;

/// Typical magnitudes of a data set.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// 95th percentile of the speed, rad/s.
    pub speed: f64,
    /// Root mean square of the torque, Nm.
    pub torque: f64,
    /// Median over the tracks of the distance travelled, rad.
    pub travel: f64,
    /// Duration of the campaign, s.
    pub campaign_s: f64,
    /// Mean temperature, deg C.
    pub temperature_c: f64,
    /// Noise of the torque, Nm, from its second differences, which are small for a smooth torque. If the motion is smooth,
    /// the estimate is at most slightly too large.
    pub noise: f64,
    /// Median sample period, s.
    pub period_s: f64,
}

impl Scales {
    /// Computes the magnitudes of some tracks.
    pub fn of(tracks: &[Track]) -> Self {
        let samples = || tracks.iter().flat_map(|track| &track.samples);
        let rows = samples().count().max(1) as f64;
        let speeds = samples().map(|s| s.velocity_rad_s.abs()).collect();
        let speed = quantile(speeds, 0.95).unwrap_or(1.0);
        let squares: f64 = tracks.iter().flat_map(|t| &t.torque).map(|t| t * t).sum();
        let travels = tracks
            .iter()
            .map(|t| t.samples.iter().map(|s| s.velocity_rad_s.abs()).sum::<f64>() * t.period_s)
            .collect();
        let travel = quantile(travels, 0.5).unwrap_or(1.0);
        Self {
            speed: speed.max(1e-9),
            torque: (squares / rows).sqrt().max(1e-12),
            travel: travel.max(1e-9),
            campaign_s: samples().map(|s| s.campaign_time_h * 3600.0).fold(1.0, f64::max),
            temperature_c: samples().map(|s| s.temperature_c).sum::<f64>() / rows,
            noise: noise(tracks).max(1e-6 * (squares / rows).sqrt()),
            period_s: tracks.first().map_or(1e-3, |t| t.period_s),
        }
    }
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
    quantile(differences, 0.5).unwrap_or_default() / (0.6745 * 6f64.sqrt())
}

/// Returns the value above this share of the others; `None` without values.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let at = ((values.len() as f64 * share) as usize).min(values.len() - 1);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}
