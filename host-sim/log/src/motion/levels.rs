//! Estimation of the sensors' noise and of the roughness of the motion.
//!
//! Three variances are estimated: of the position, of the velocity, and of the jumps of the acceleration. The likelihood
//! of the filter's prediction errors separates them: noise reverses its sign at once, motion persists. It is maximised
//! over a few parts of the log. The variance due to rounding ([`super::quantum`]) is known and added.
//!
//! The roughness of a motion is not uniform: a joint slides, then reverses. A single roughness would either smooth the
//! reversals or keep the noise of the sliding. So each row has its own ([`adapt`]): a heavy-tailed jump, modelled as
//! normal with a random variance, whose expectation is estimated (the EM algorithm of Student's t). Neighbouring rows
//! are included, because a reversal lasts a few rows.

use super::filter::{Noise, Series, Smoothed, log_likelihood, smooth};
use crate::statistics::median;

/// Maximum number of rows on which the likelihood is evaluated.
const MAX_EVALUATED_ROWS: usize = 4000;

/// Number of parts of the log that these rows come from.
const EVALUATED_PARTS: usize = 8;

/// Initial step of the search in the logarithm of a variance.
const FIRST_STEP: f64 = 3.0;

/// Step at which the search ends.
const LAST_STEP: f64 = 0.1;

/// Weight of the usual roughness against a row's own, rows: 3 as in a Student's t of three degrees of freedom, the
/// heaviest tail with a finite variance.
const USUAL_WEIGHT: f64 = 3.0;

/// Rows on either side that share a roughness.
const NEIGHBOURS: usize = 2;

/// Rounds of [`adapt`]. The fifth changes the result by less than the noise.
const ROUNDS: usize = 5;

/// Minimum usual roughness, as a share of the most likely uniform one. Otherwise a log with much rest would suppress
/// the starts of the motion.
const MIN_USUAL_ROUGHNESS: f64 = 1e-3;

/// Percentile of the accelerations that is used for starts and stops.
const EDGE_PERCENTILE: usize = 99;

/// Minimum variance of the noise, as a share of the mean square of a row's travel. Smaller values exceed the
/// numerical precision of the filter.
const MIN_NOISE_VARIANCE: f64 = 1e-10;

/// Estimated noise and roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Noise of the sensors.
    pub noise: Noise,
    /// Variance of a jump of the acceleration per median step.
    pub jump: f64,
}

/// A variance that is searched, and its least value.
struct Searched {
    of: fn(&mut Levels) -> &mut f64,
    least: f64,
}

/// Returns the most likely levels for all series together.
pub fn likeliest(all: &[Series]) -> Levels {
    let judged = judged(all);
    let scale = mean_square_travel(&judged).max(f64::MIN_POSITIVE);
    let least = MIN_NOISE_VARIANCE * scale;
    // The median of the squares of fourth differences, which contains few reversals.
    let noise = |column: fn(&Series) -> Option<&Vec<f64>>| {
        let fourth = |s: &Series| column(s).map(|values| differences(values, 4));
        (median_square(&judged, fourth) / FOURTH).max(least)
    };
    let noise = Noise {
        position: noise(|s| s.position.as_ref()),
        velocity: noise(|s| s.velocity.as_ref()),
    };
    let mut searched = vec![Searched { of: |levels| &mut levels.jump, least: f64::MIN_POSITIVE }];
    if judged.iter().any(|s| s.velocity.is_some()) {
        searched.push(Searched { of: |levels| &mut levels.noise.velocity, least });
    }
    if judged.iter().any(|s| s.position.is_some()) {
        searched.push(Searched { of: |levels| &mut levels.noise.position, least });
    }
    let likelihood = |levels: &Levels| -> f64 {
        let of = |s: &Series| {
            log_likelihood(s, &levels.noise, &vec![levels.jump; s.len().saturating_sub(1)])
        };
        judged.iter().map(of).sum()
    };
    climb(Levels { noise, jump: 1e-6 * scale }, &searched, likelihood)
}

/// Returns the mean square of a row's travel, by the velocity or else by the position.
fn mean_square_travel(all: &[Series]) -> f64 {
    let travel =
        |s: &Series| s.velocity.clone().or_else(|| s.position.as_ref().map(|q| differences(q, 1)));
    let (mut sum, mut count) = (0.0, 0usize);
    for value in all.iter().filter_map(travel).flatten() {
        sum += value * value;
        count += 1;
    }
    sum / count.max(1) as f64
}

/// Multiplies the searched variances by ever smaller factors while that makes the levels more likely.
fn climb(mut levels: Levels, searched: &[Searched], likelihood: impl Fn(&Levels) -> f64) -> Levels {
    let mut best = likelihood(&levels);
    let mut step = FIRST_STEP;
    while step > LAST_STEP {
        let before = levels;
        for Searched { of, least } in searched {
            for factor in [step.exp(), (-step).exp()] {
                loop {
                    let mut tried = levels;
                    let value = of(&mut tried);
                    *value = (*value * factor).max(*least);
                    let value = likelihood(&tried);
                    if value.is_nan() || value <= best + 1e-3 {
                        break;
                    }
                    (levels, best) = (tried, value);
                }
            }
        }
        if levels == before {
            step /= 2.0;
        }
    }
    levels
}

/// Returns the standard deviation of the velocities' noise per median step, from the velocities alone.
pub fn noise_alone(all: &[Series]) -> f64 {
    let fourth = |s: &Series| s.velocity.as_ref().map(|values| differences(values, 4));
    (median_square(&judged(all), fourth) / FOURTH).sqrt()
}

/// Ratio of the variance of the fourth difference of white noise to its own: 1 + 16 + 36 + 16 + 1.
const FOURTH: f64 = 70.0;

fn differences(values: &[f64], order: usize) -> Vec<f64> {
    (0..order).fold(values.to_vec(), |v, _| v.windows(2).map(|w| w[1] - w[0]).collect())
}

/// Returns the median of the squares, scaled to the mean square of normal numbers.
fn median_square(all: &[Series], of: impl Fn(&Series) -> Option<Vec<f64>>) -> f64 {
    /// Median of the square of a standard normal number.
    const MEDIAN: f64 = 0.4549;
    let mut squares: Vec<f64> =
        all.iter().filter_map(of).flatten().map(|value| value * value).collect();
    median(&mut squares).unwrap_or_default() / MEDIAN
}

/// Returns parts of the log, evenly spread over its series.
fn judged(all: &[Series]) -> Vec<Series> {
    let rows: usize = all.iter().map(Series::len).sum();
    if rows <= MAX_EVALUATED_ROWS {
        return all.to_vec();
    }
    let long: Vec<&Series> = all.iter().filter(|s| s.len() > 20).collect();
    let count = EVALUATED_PARTS;
    let each = MAX_EVALUATED_ROWS / count;
    (0..count)
        .filter_map(|index| {
            let series = *long.get(index * long.len() / count)?;
            let room = series.len().saturating_sub(each);
            // A different place in each: the start of a log is often at rest.
            let start = room * (2 * index + 1) / (2 * count);
            Some(series.part(start..(start + each).min(series.len())))
        })
        .collect()
}

/// Returns the roughness of each row, and the motion smoothed with it.
pub fn adapt(series: &Series, levels: &Levels) -> (Vec<f64>, Smoothed) {
    let rows = series.len();
    let mut jumps = vec![levels.jump; rows - 1];
    let mut usual = levels.jump;
    let mut smoothed = smooth(series, &levels.noise, &jumps);
    // A joint starts and stops with at most the acceleration that it has elsewhere.
    let mut sizes: Vec<f64> = smoothed.states.iter().map(|x| x[2].abs()).collect();
    let at = (sizes.len() - 1) * EDGE_PERCENTILE / 100;
    let edge = sizes.select_nth_unstable_by(at, f64::total_cmp).1.powi(2).max(levels.jump);
    for _ in 0..ROUNDS {
        let mut sums = vec![0.0; rows];
        for row in 0..rows - 1 {
            sums[row + 1] = sums[row] + smoothed.jumps[row];
        }
        let (mut inverse, mut moving) = (0.0, 0.0);
        for (row, jump) in jumps.iter_mut().enumerate() {
            let (from, to) = (row.saturating_sub(NEIGHBOURS), (row + NEIGHBOURS + 1).min(rows - 1));
            let squares = (sums[to] - sums[from]).max(0.0);
            *jump = (USUAL_WEIGHT * usual + squares) / (USUAL_WEIGHT + (to - from) as f64);
            if !series.at_rest[row] {
                inverse += 1.0 / *jump;
                moving += 1.0;
            }
        }
        if moving > 0.0 {
            usual = (moving / inverse).max(MIN_USUAL_ROUGHNESS * levels.jump);
        }
        free_edges(series, &mut jumps, edge);
        smoothed = smooth(series, &levels.noise, &jumps);
    }
    (jumps, smoothed)
}

/// Allows any acceleration where a joint stops or starts: `edge` is the variance of its jump.
fn free_edges(series: &Series, jumps: &mut [f64], edge: f64) {
    let rows = series.len();
    for row in 0..rows.saturating_sub(1) {
        if series.at_rest[row] != series.at_rest[row + 1] {
            for near in [row.saturating_sub(1), row, row + 1] {
                if let Some(jump) = jumps.get_mut(near) {
                    *jump = edge;
                }
            }
        }
    }
}
