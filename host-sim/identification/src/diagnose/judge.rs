//! How much an extension gains, on runs no fit has seen, and how much there was to gain.

use crate::fit::Track;
use crate::fit::channel::autocorrelation;
use crate::fit::predict::Predicted;
use crate::fit::scales::{Scales, white_noise};
use crate::fit::statistics::autocorrelation_time;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Resampled logs an interval is counted over.
const RESAMPLES: usize = 400;

/// `1 - rmse(after) / rmse(before)` on held-out rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gain {
    /// The gain.
    pub value: f64,
    /// Its 95 % interval, by resampling blocks of rows.
    pub ci95: [f64; 2],
}

/// What the best possible model would leave, Nm RMS: the torque column's noise, and what the uncertain motion does to
/// the law ([`super::uncertain_motion`]). The noise comes from second differences of the measured torque, which no
/// smooth torque has. Their median keeps breakaways and reversals out. It is a floor for white noise; a logger
/// that smooths shows less than its sensor makes.
pub fn noise_floor(tracks: &[Track], decimate: usize) -> f64 {
    with_motion(torque_noise(tracks, decimate), tracks)
}

fn torque_noise(tracks: &[Track], decimate: usize) -> f64 {
    let noise = Scales::of(tracks).noise;
    // The anti-alias filter passes 80 % of the band that is left.
    if decimate > 1 { noise * (0.8 / decimate as f64).sqrt() } else { noise }
}

/// The floor that a noise of the torque makes together with the uncertain motion, rows weighed as they are.
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

/// A slowly logged torque turns between two rows, and second differences take that for noise; those of
/// the extended model's residual do not. The lower of the two.
pub fn lower_floor(floor: f64, tracks: &[Track], after: &Predicted) -> f64 {
    let own = white_noise(after.residuals.iter().map(Vec::as_slice));
    if own > 0.0 { floor.min(with_motion(own, tracks)) } else { floor }
}

/// The floor of a log whose torque went through a low-pass, where its noise did as well; 0 of any other.
///
/// Such noise has the low-pass' own memory: `r1` of it from one row to the next, `r2` two rows on ([`autocorrelation`]), and
/// its second differences show little of it. Beside a white part `w` a coloured one `c` makes differences of the residual
/// with the variances `v1 = 2 w + 2 (1 - r1) c` and `v2 = 6 w + (6 - 8 r1 + 2 r2) c`, which are solved for both.
pub fn coloured_floor(tracks: &[Track], after: &Predicted) -> f64 {
    let Some(track) = tracks.first() else { return 0.0 };
    let whole = tracks.iter().zip(&after.residuals).all(|(track, r)| track.len() == r.len());
    if track.torque_low_pass.time_s <= 0.0 || !whole {
        return 0.0;
    }
    let [next, second_next] = autocorrelation(track);
    let series = || after.residuals.iter().map(Vec::as_slice);
    let first = variance_by_median(series().flat_map(|r| r.windows(2).map(|w| w[1] - w[0])));
    let second =
        variance_by_median(series().flat_map(|r| r.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2])));
    let rows = series().map(<[f64]>::len).sum::<usize>().max(1) as f64;
    let excess = 6.0 * first - 2.0 * second;
    // White noise makes none but by chance.
    if excess < COLOURED * first / rows.sqrt() {
        return 0.0;
    }
    let squares: f64 = series().flatten().map(|r| r * r).sum();
    let coloured = (excess / (4.0 * (next - second_next))).min(squares / rows);
    let white = (0.5 * first - coloured * (1.0 - next)).max(0.0);
    with_motion((white + coloured).sqrt(), tracks)
}

/// Excess of the first differences' variance over that of white noise, in units of the variance over the root of the
/// rows, from which noise is coloured: three standard errors, of variances found by medians.
const COLOURED: f64 = 45.0;

fn variance_by_median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or_default();
    (median / 0.6745).powi(2)
}

/// Squared errors of two models on the same blocks of rows.
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

/// By how many standard errors the squared error of `after` is lower than that of `before`, block by
/// block.
pub fn paired(before: &Predicted, after: &Predicted) -> f64 {
    let blocks = blocks(before, after);
    let n = blocks.len() as f64;
    let falls = || blocks.iter().map(|[before, after]| before - after);
    let mean = falls().sum::<f64>() / n.max(1.0);
    let variance = falls().map(|fall| (fall - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    if variance > 0.0 { mean / (variance / n).sqrt() } else { 0.0 }
}

/// The gain of `after` over `before`.
pub fn gain(before: &Predicted, after: &Predicted, seed: u64) -> Gain {
    let blocks = blocks(before, after);
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
    use crate::fit::Metrics;
    use crate::fit::channel::{Shape, TorqueLowPass};

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
    fn noise_behind_and_before_a_low_pass_makes_the_floor_it_is() {
        let rows = 20_000;
        let mut random = Pcg64::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let mut track = Track::even(vec![Default::default(); rows], vec![0.0; rows], 1e-3);
        track.torque_low_pass = TorqueLowPass { time_s: 0.01, shape: Shape::FirstOrder };
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
    fn half_the_error_is_a_gain_of_a_half() {
        let gain = gain(&predicted(1.0), &predicted(0.5), 0);
        assert!((gain.value - 0.5).abs() < 1e-12);
        assert!(gain.ci95[0] <= 0.5 && 0.5 <= gain.ci95[1]);
        let none = super::gain(&predicted(1.0), &predicted(1.0), 0);
        assert_eq!(none, Gain { value: 0.0, ci95: [0.0, 0.0] });
    }
}
