//! Gain of an extension on held-out rows, and the noise floor that limits it.
//!
//! The gain is relative to the RMS error of the base model. The noise floor is the RMS error of the
//! best possible model, in Nm.

use friction_fit::{
    Predicted, Scales, Track, autocorrelation_time, noise_autocorrelation, run_count, white_noise,
};
use joint_log::statistics::quantile_by_count;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Number of bootstrap samples for an interval.
const RESAMPLES: usize = 400;

/// `1 - rmse(after) / rmse(before)` on held-out rows, dimensionless.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gain {
    /// The gain.
    pub value: f64,
    /// 95 % interval from a block bootstrap.
    pub ci95: [f64; 2],
}

impl Gain {
    /// Returns the gain of `after` over `before`. `seed` initialises the random sampler.
    pub fn between(before: &Predicted, after: &Predicted, seed: u64) -> Self {
        gain_of_units(&blocks(before, after), seed)
    }
}

/// Returns the noise floor, the error of the best possible model, in Nm RMS.
///
/// It contains the noise of the torque column and the effect of the uncertain motion on the law
/// ([`super::uncertain_motion`]). The noise is estimated from second differences of the measured
/// torque, which are small for a smooth torque. Their median excludes breakaways and reversals. The
/// estimate assumes white noise. If the logger smooths the torque, it is below the noise of the
/// sensor.
pub fn noise_floor(tracks: &[Track], decimate: usize) -> f64 {
    with_motion(torque_noise(tracks, decimate), tracks)
}

fn torque_noise(tracks: &[Track], decimate: usize) -> f64 {
    let noise = Scales::of(tracks).noise;
    // The anti-alias filter passes 80 % of the remaining band.
    if decimate > 1 { noise * (0.8 / decimate as f64).sqrt() } else { noise }
}

/// Returns the noise floor of torque noise and uncertain motion together, with weighted rows, Nm
/// RMS.
fn with_motion(noise: f64, tracks: &[Track]) -> f64 {
    let rows = tracks.iter().flat_map(|track| {
        let error = |row: usize| track.motion_error.get(row).copied().unwrap_or_default();
        (0..track.len()).map(move |row| (track.weight(row), error(row)))
    });
    let (weights, squares) = rows.fold((0.0, 0.0), |(weights, squares), (weight, error)| {
        (weights + weight, squares + weight * (noise * noise + error * error))
    });
    if weights > 0.0 { (squares / weights).sqrt() } else { noise }
}

/// Returns the lower of two noise floors: the given one, and one from the residual of the extended
/// model, Nm RMS.
///
/// In a slowly sampled log, the torque changes between two rows, and its second differences count
/// this change as noise. The second differences of the residual do not.
pub fn lower_floor(floor: f64, tracks: &[Track], after: &Predicted) -> f64 {
    let noise = white_noise(after.residuals.iter().map(Vec::as_slice));
    if noise > 0.0 { floor.min(with_motion(noise, tracks)) } else { floor }
}

/// Returns the noise floor of a log whose torque and noise passed a low-pass, Nm RMS; 0 for any
/// other log.
///
/// Filtered noise has the autocorrelation of the low-pass: `r1` after one row and `r2` after two
/// rows ([`noise_autocorrelation`]). It contributes little to the second differences. The residual
/// has a white part of variance `w` and a coloured part of variance `c`. Its first differences have
/// the variance `v1 = 2 w + 2 (1 - r1) c`. Its second differences have the variance
/// `v2 = 6 w + (6 - 8 r1 + 2 r2) c`. These equations give `w` and `c`.
pub fn coloured_floor(tracks: &[Track], after: &Predicted) -> f64 {
    let Some(track) = tracks.first() else { return 0.0 };
    let whole = tracks.iter().zip(&after.residuals).all(|(track, r)| track.len() == r.len());
    if track.torque_low_pass.time_s <= 0.0 || !whole {
        return 0.0;
    }
    let [next, second_next] = noise_autocorrelation(track);
    let series = || after.residuals.iter().map(Vec::as_slice);
    let first = variance_by_median(series().flat_map(|r| r.windows(2).map(|w| w[1] - w[0])));
    let second =
        variance_by_median(series().flat_map(|r| r.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2])));
    let rows = series().map(<[f64]>::len).sum::<usize>().max(1) as f64;
    let excess = 6.0 * first - 2.0 * second;
    // White noise causes an excess only by chance.
    if excess < COLOURED * first / rows.sqrt() {
        return 0.0;
    }
    let squares: f64 = series().flatten().map(|r| r * r).sum();
    let coloured = (excess / (4.0 * (next - second_next))).min(squares / rows);
    let white = (0.5 * first - coloured * (1.0 - next)).max(0.0);
    with_motion((white + coloured).sqrt(), tracks)
}

/// Excess variance of the first differences above which noise counts as coloured.
///
/// The excess is relative to white noise. Its unit is the variance divided by the square root of
/// the number of rows. The value corresponds to three standard errors of variances that are
/// estimated from medians.
const COLOURED: f64 = 45.0;

fn variance_by_median(values: impl Iterator<Item = f64>) -> f64 {
    (quantile_by_count(values.map(f64::abs).collect(), 0.5).unwrap_or_default() / 0.6745).powi(2)
}

/// Returns the squared errors of two models on the same blocks of rows, Nm^2.
fn blocks(before: &Predicted, after: &Predicted) -> Vec<[f64; 2]> {
    let rows: usize = before.residuals.iter().map(Vec::len).sum();
    let memory = autocorrelation_time(before.residuals.iter().map(Vec::as_slice));
    let length = ((8.0 * memory) as usize).clamp(4, (rows / 20).max(4));
    let mut blocks = Vec::new();
    for (before, after) in before.residuals.iter().zip(&after.residuals) {
        let count = (before.len() / length).max(1);
        for block in 0..count {
            let part = block * before.len() / count..(block + 1) * before.len() / count;
            let sum = |residual: &[f64]| residual.iter().map(|r| r * r).sum::<f64>();
            blocks.push([sum(&before[part.clone()]), sum(&after[part])]);
        }
    }
    blocks
}

/// Returns the squared errors of two models in each run, Nm^2.
fn of_runs(tracks: &[Track], before: &Predicted, after: &Predicted) -> Vec<[f64; 2]> {
    let mut sums = std::collections::BTreeMap::new();
    let residuals = before.residuals.iter().zip(&after.residuals);
    for (track, (before, after)) in tracks.iter().zip(residuals) {
        let sum: &mut [f64; 2] = sums.entry(track.run).or_default();
        sum[0] += before.iter().map(|r| r * r).sum::<f64>();
        sum[1] += after.iter().map(|r| r * r).sum::<f64>();
    }
    sums.into_values().collect()
}

/// Returns the RMS errors of a model in logs that are drawn block by block from its own, sorted, Nm.
pub fn resampled_errors(model: &Predicted, seed: u64) -> Vec<f64> {
    let blocks = blocks(model, model);
    let total: f64 = blocks.iter().map(|[error, _]| error).sum();
    let mut random = Pcg64::seed_from_u64(seed);
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..blocks.len()).map(|_| blocks[random.random_range(0..blocks.len())][0]);
            model.metrics.rmse * (drawn.sum::<f64>() / total.max(f64::MIN_POSITIVE)).sqrt()
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    drawn
}

/// Fewest runs that are the units of a comparison. What a model misses lasts for a run, so runs are independent, and blocks of
/// one run are not.
const MIN_RUNS: usize = 5;

/// Returns the difference between the squared errors of `before` and `after` along some tracks, in standard errors over runs if
/// there are enough, else over blocks.
pub fn paired(tracks: &[Track], before: &Predicted, after: &Predicted) -> f64 {
    let blocks = match run_count(tracks) >= MIN_RUNS {
        true => of_runs(tracks, before, after),
        false => blocks(before, after),
    };
    let n = blocks.len() as f64;
    let falls = || blocks.iter().map(|[before, after]| before - after);
    let mean = falls().sum::<f64>() / n.max(1.0);
    let variance = falls().map(|fall| (fall - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

/// Returns the gain from the squared errors before and after in independent parts of a log.
pub fn gain_of_units(blocks: &[[f64; 2]], seed: u64) -> Gain {
    let of = |sums: [f64; 2]| {
        if sums[0] > 0.0 { 1.0 - (sums[1] / sums[0]).sqrt() } else { 0.0 }
    };
    let add = |sums: [f64; 2], block: &[f64; 2]| [sums[0] + block[0], sums[1] + block[1]];
    let value = of(blocks.iter().fold([0.0; 2], add));
    let mut random = Pcg64::seed_from_u64(seed);
    let mut resampled: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..blocks.len()).map(|_| &blocks[random.random_range(0..blocks.len())]);
            of(drawn.fold([0.0; 2], add))
        })
        .collect();
    resampled.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * (resampled.len() - 1) as f64).round() as usize;
        resampled.get(index).copied().unwrap_or(value)
    };
    Gain { value, ci95: [at(0.025), at(0.975)] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_fit::Metrics;
    use friction_fit::{LowPassShape, TorqueLowPass};

    fn predicted(scale: f64) -> Predicted {
        let mut random = Pcg64::seed_from_u64(5);
        let residual = (0..4000).map(|_| scale * random.random_range(-1.0..1.0)).collect();
        Predicted {
            torque: Vec::new(),
            residuals: vec![residual],
            metrics: Metrics::default(),
            saturation: 0.0,
            presliding: 0.0,
        }
    }

    #[test]
    fn coloured_floor_with_filtered_and_white_noise_matches_rms() {
        let rows = 20_000;
        let mut random = Pcg64::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let mut track = Track::even(vec![Default::default(); rows], vec![0.0; rows], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.01, shape: LowPassShape::FirstOrder };
        let share = 1.0 - (-0.1f64).exp();
        for (white, coloured) in [(0.02, 0.0), (0.0, 0.1), (0.01, 0.1)] {
            let mut held = 0.0;
            let residual: Vec<f64> = (0..rows)
                .map(|_| {
                    held += (coloured * normal() - held) * share;
                    held + white * normal()
                })
                .collect();
            let rms = (residual.iter().map(|r| r * r).sum::<f64>() / rows as f64).sqrt();
            let after = Predicted { residuals: vec![residual], ..predicted(0.0) };
            let floor = coloured_floor(std::slice::from_ref(&track), &after);
            if coloured > 0.0 {
                assert!((floor / rms - 1.0).abs() < 0.1, "{floor} of {rms}");
            } else {
                assert_eq!(floor, 0.0);
            }
        }
    }

    #[test]
    fn gain_with_half_the_error_is_one_half() {
        let gain = Gain::between(&predicted(1.0), &predicted(0.5), 0);
        assert!((gain.value - 0.5).abs() < 1e-12);
        assert!(gain.ci95[0] <= 0.5 && 0.5 <= gain.ci95[1]);
        let none = Gain::between(&predicted(1.0), &predicted(1.0), 0);
        assert_eq!(none, Gain { value: 0.0, ci95: [0.0, 0.0] });
    }
}
