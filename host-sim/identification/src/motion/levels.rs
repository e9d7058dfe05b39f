//! How noisy the sensors are and how roughly the joint moves: found from the log.
//!
//! Three numbers are wanted: the variance of the position, of the velocity, and of the jumps of the
//! acceleration. Where the measurements are evenly rough, the likelihood of the filter's own prediction errors
//! tells them apart: what is noise comes back at once with the other sign, what is motion stays. That is
//! maximised over a few stretches of the log. What a rounding leaves ([`super::quantum`]) is known and comes on top.
//!
//! A joint does not move evenly roughly: it glides, and then it turns about. One roughness for all would either
//! smear the turns or leave the noise in the glide. So each row has its own ([`adapt`]): a heavy-tailed jump,
//! as a normal one whose variance is itself drawn, and expected given the log (the EM of Student's t), with
//! neighbours counted in, since a turn lasts a few rows.

use super::filter::{Noise, Series, Smoothed, log_likelihood, smooth};

/// Rows of the log the likelihood is maximised on, and in how many stretches.
const JUDGED: (usize, usize) = (4000, 8);

/// A first step in the logarithm of a variance, and when to stop.
const STEPS: (f64, f64) = (3.0, 0.1);

/// How many rows a row's own roughness is worth against what is usual: 3 as for a Student's t of three degrees,
/// the heaviest tail with a variance.
const USUAL_WEIGHT: f64 = 3.0;

/// Rows on either side that share a roughness.
const NEIGHBOURS: usize = 2;

/// Rounds of [`adapt`]; the fifth moves the result by less than the noise.
const ROUNDS: usize = 5;

/// The usual roughness is no less than this share of the likeliest single one: a log that rests half of
/// its time must not forbid its joint to start.
const LEAST_USUAL: f64 = 1e-3;

/// The acceleration at a start or a stop is this percentile of all.
const HARDEST: usize = 99;

/// Smallest share of its own mean square a variance may have: what a float's rounding leaves.
const ROUNDING: f64 = 1e-20;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Of the sensors.
    pub noise: Noise,
    /// Variance of a jump of the acceleration per median step.
    pub jump: f64,
}

/// The likeliest levels for all series together.
pub fn likeliest(all: &[Series]) -> Levels {
    let judged = judged(all);
    let squares = |of: &dyn Fn(&Series) -> Option<Vec<f64>>| {
        let (mut sum, mut count) = (0.0, 0usize);
        for value in judged.iter().filter_map(of).flatten() {
            sum += value * value;
            count += 1;
        }
        sum / count.max(1) as f64
    };
    let fourth = |column: Option<&Vec<f64>>| -> Option<Vec<f64>> {
        column.map(|values| differences(values, 4))
    };
    // The median of the squares of fourth differences: few turns are among them.
    let position_scale = squares(&|s| s.position.clone()).max(f64::MIN_POSITIVE);
    let velocity_scale =
        squares(&|s| s.velocity.clone().or_else(|| s.position.as_ref().map(|q| differences(q, 1))))
            .max(f64::MIN_POSITIVE);
    let start = [
        (median_square(&judged, |s| fourth(s.position.as_ref())) / FOURTH)
            .max(ROUNDING * position_scale),
        (median_square(&judged, |s| fourth(s.velocity.as_ref())) / FOURTH)
            .max(ROUNDING * velocity_scale),
        1e-6 * velocity_scale,
    ];
    let has = [
        judged.iter().any(|s| s.position.is_some()),
        judged.iter().any(|s| s.velocity.is_some()),
        true,
    ];
    let floor = [ROUNDING * position_scale, ROUNDING * velocity_scale, f64::MIN_POSITIVE];
    let levels =
        |at: &[f64; 3]| Levels { noise: Noise { position: at[0], velocity: at[1] }, jump: at[2] };
    let likelihood = |at: &[f64; 3]| -> f64 {
        let levels = levels(at);
        let of = |s: &Series| {
            log_likelihood(s, &levels.noise, &vec![levels.jump; s.len().saturating_sub(1)])
        };
        judged.iter().map(of).sum()
    };
    let mut at = start;
    let mut best = likelihood(&at);
    let mut step = STEPS.0;
    while step > STEPS.1 {
        let mut moved = false;
        for index in [2, 1, 0] {
            if !has[index] {
                continue;
            }
            for factor in [step.exp(), (-step).exp()] {
                loop {
                    let mut tried = at;
                    tried[index] = (at[index] * factor).max(floor[index]);
                    let value = likelihood(&tried);
                    if !(value > best + 1e-3) {
                        break;
                    }
                    (at, best, moved) = (tried, value, true);
                }
            }
        }
        if !moved {
            step /= 2.0;
        }
    }
    levels(&at)
}

/// Standard deviation of the velocities' noise per median step, from themselves alone.
pub fn noise_alone(all: &[Series]) -> f64 {
    let fourth = |s: &Series| s.velocity.as_ref().map(|values| differences(values, 4));
    (median_square(&judged(all), fourth) / FOURTH).sqrt()
}

/// Variance of the fourth difference of white noise over its own: 1 + 16 + 36 + 16 + 1.
const FOURTH: f64 = 70.0;

fn differences(values: &[f64], order: usize) -> Vec<f64> {
    (0..order).fold(values.to_vec(), |v, _| v.windows(2).map(|w| w[1] - w[0]).collect())
}

/// The median of the squares, as a mean square of normal numbers has it.
fn median_square(all: &[Series], of: impl Fn(&Series) -> Option<Vec<f64>>) -> f64 {
    /// Median of the square of a standard normal number.
    const MEDIAN: f64 = 0.4549;
    let mut squares: Vec<f64> =
        all.iter().filter_map(of).flatten().map(|value| value * value).collect();
    if squares.is_empty() {
        return 0.0;
    }
    let middle = squares.len() / 2;
    *squares.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN
}

/// Stretches of the log, evenly spread over its series.
fn judged(all: &[Series]) -> Vec<Series> {
    let rows: usize = all.iter().map(Series::len).sum();
    if rows <= JUDGED.0 {
        return all.to_vec();
    }
    let long: Vec<&Series> = all.iter().filter(|s| s.len() > 20).collect();
    let count = JUDGED.1;
    let each = JUDGED.0 / count;
    (0..count)
        .filter_map(|index| {
            let series = *long.get(index * long.len() / count)?;
            let room = series.len().saturating_sub(each);
            // Somewhere else in each: a log that starts at rest must not be judged by its rest.
            let start = room * (2 * index + 1) / (2 * count);
            Some(series.part(start..(start + each).min(series.len())))
        })
        .collect()
}

/// The roughness of each row, and the motion smoothed with it.
pub fn adapt(series: &Series, levels: &Levels) -> (Vec<f64>, Smoothed) {
    let rows = series.len();
    let mut jumps = vec![levels.jump; rows - 1];
    let mut usual = levels.jump;
    let mut smoothed = smooth(series, &levels.noise, &jumps);
    // A joint starts and stops as it does elsewhere, at most.
    let mut sizes: Vec<f64> = smoothed.states.iter().map(|x| x[2].abs()).collect();
    let at = (sizes.len() - 1) * HARDEST / 100;
    let edge = sizes.select_nth_unstable_by(at, f64::total_cmp).1.powi(2).max(levels.jump);
    for _ in 0..ROUNDS {
        let mut sums = vec![0.0; rows];
        for row in 0..rows - 1 {
            sums[row + 1] = sums[row] + smoothed.jumps[row];
        }
        let (mut inverse, mut moving) = (0.0, 0.0);
        for row in 0..rows - 1 {
            let (from, to) = (row.saturating_sub(NEIGHBOURS), (row + NEIGHBOURS + 1).min(rows - 1));
            let squares = (sums[to] - sums[from]).max(0.0);
            jumps[row] = (USUAL_WEIGHT * usual + squares) / (USUAL_WEIGHT + (to - from) as f64);
            if !series.at_rest[row] {
                inverse += 1.0 / jumps[row];
                moving += 1.0;
            }
        }
        if moving > 0.0 {
            usual = (moving / inverse).max(LEAST_USUAL * levels.jump);
        }
        free_edges(series, &mut jumps, edge);
        smoothed = smooth(series, &levels.noise, &jumps);
    }
    (jumps, smoothed)
}

/// Where a joint stops or starts its acceleration may be any: `edge` is the variance of its jump.
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
