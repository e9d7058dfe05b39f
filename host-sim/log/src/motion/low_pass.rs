//! A velocity column that is the derivative of the position behind a first-order low-pass.
//!
//! Drives and robot middleware filter the differences of an encoder. Far below the filter's corner the result is late by the
//! time constant; above it, it is attenuated and looks like noise. The time constant is therefore fitted itself: the
//! derivative passes low-passes of all time constants, and the logged velocity is compared with each, and with the
//! derivative at all delays.

/// Minimum time constant, rows. Below it, a low-pass and a difference from row to row are alike.
const MIN_ROWS: f64 = 1.0;

/// Maximum time constant, rows.
const MAX_ROWS: f64 = 2000.0;

/// Ratio of neighbouring time constants of the first search.
const RATIO: f64 = 1.5;

/// Rounds of the search around the best time constant, each with half the ratio's logarithm.
const ROUNDS: usize = 6;

/// Residual of the derivative itself, as a share of the RMS of the logged velocity, below which there is nothing to explain.
const MIN_RESIDUAL_SHARE: f64 = 0.01;

/// Maximum residual, as a share of the RMS of the logged velocity.
const MAX_RESIDUAL_SHARE: f64 = 0.1;

/// Maximum squared residual, relative to that of the best pure delay.
const MAX_DELAY_RATIO: f64 = 0.5;

/// Time constants at the start of a stretch in which the filter settles.
const SETTLING: f64 = 4.0;

/// A stretch with the derivative of its position.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// Steps between rows, in median steps; one fewer than rows.
    pub(super) steps: Vec<f64>,
    /// Derivative of the position.
    pub(super) derivative: Vec<f64>,
    /// Logged velocity.
    pub(super) logged: Vec<f64>,
}

/// Returns the time constant of the low-pass in rows; `None` if a delay, or nothing, explains the velocity as well.
pub(super) fn time_constant(stretches: &[Stretch]) -> Option<f64> {
    if residual_share(stretches, 0, |stretch| stretch.derivative.clone())
        < MIN_RESIDUAL_SHARE.powi(2)
    {
        return None;
    }
    let of_low_pass = |rows: f64| {
        residual_share(stretches, (SETTLING * rows) as usize, |stretch| low_pass(stretch, rows))
    };
    let (filtered, rows) = least(of_low_pass);
    if rows <= MIN_ROWS || filtered > MAX_RESIDUAL_SHARE.powi(2) {
        return None;
    }
    let from = (SETTLING * rows) as usize;
    let of_delay = |rows: f64| residual_share(stretches, from, |stretch| late(stretch, rows));
    let late = of_delay(0.0).min(least(of_delay).0);
    (filtered < MAX_DELAY_RATIO * late).then_some(rows)
}

/// Returns the least value of a function over a logarithmic scale, and its place.
fn least(of: impl Fn(f64) -> f64) -> (f64, f64) {
    let better = |best: (f64, f64), at: f64| {
        let value = of(at);
        if value < best.0 { (value, at) } else { best }
    };
    let count = ((MAX_ROWS / MIN_ROWS).ln() / RATIO.ln()) as i32;
    let mut best =
        (0..=count).map(|step| MIN_ROWS * RATIO.powi(step)).fold((f64::INFINITY, MIN_ROWS), better);
    let mut ratio = RATIO;
    for _ in 0..ROUNDS {
        ratio = ratio.sqrt();
        best = [best.1 / ratio, best.1 * ratio].into_iter().fold(best, better);
    }
    best
}

/// Returns the squared residual of the logged velocities, after `from` rows of each stretch, as a share of their squares.
/// The model is scaled to fit. It is infinite if these are fewer than half of the rows.
fn residual_share(stretches: &[Stretch], from: usize, model: impl Fn(&Stretch) -> Vec<f64>) -> f64 {
    let (mut yy, mut xy, mut xx) = (0.0, 0.0, 0.0);
    let all: usize = stretches.iter().map(|stretch| stretch.logged.len()).sum();
    let judged = stretches.iter().map(|stretch| stretch.logged.len().saturating_sub(from));
    if 2 * judged.sum::<usize>() < all {
        return f64::INFINITY;
    }
    for stretch in stretches {
        for (y, x) in stretch.logged.iter().zip(model(stretch)).skip(from) {
            yy += y * y;
            xy += x * y;
            xx += x * x;
        }
    }
    if yy > 0.0 && xx > 0.0 { 1.0 - xy * xy / (xx * yy) } else { f64::INFINITY }
}

/// Returns the derivative behind a first-order low-pass. Between rows the derivative is a line, for which the response is
/// exact.
fn low_pass(stretch: &Stretch, rows: f64) -> Vec<f64> {
    let mut held = stretch.logged.first().copied().unwrap_or_default();
    let mut filtered = vec![held];
    for (step, ends) in stretch.steps.iter().zip(stretch.derivative.windows(2)) {
        let kept = (-step / rows).exp();
        let mean = if *step > 0.0 { (1.0 - kept) * rows / step } else { 1.0 };
        held = kept * held + (mean - kept) * ends[0] + (1.0 - mean) * ends[1];
        filtered.push(held);
    }
    filtered
}

/// Returns the derivative of some rows before, with lines between rows.
fn late(stretch: &Stretch, rows: f64) -> Vec<f64> {
    let at = |row: usize| {
        let then = (row as f64 - rows).max(0.0);
        let (before, share) = (then as usize, then.fract());
        let next = stretch.derivative[(before + 1).min(stretch.derivative.len() - 1)];
        stretch.derivative[before] * (1.0 - share) + next * share
    };
    (0..stretch.derivative.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of several frequencies, and its velocity behind a low-pass, by fine steps.
    fn filtered(rows: f64) -> Stretch {
        let (fine, count) = (50, 3000);
        let speed = |time: f64| (0.05 * time).sin() + 0.6 * (0.13 * time + 1.0).sin();
        let mut held = 0.0;
        let mut stretch =
            Stretch { steps: vec![1.0; count - 1], derivative: Vec::new(), logged: Vec::new() };
        for row in 0..count {
            for step in 1..=fine {
                let time = row as f64 + step as f64 / fine as f64 - 1.0;
                held += (speed(time) - held) / (rows * fine as f64 + 1.0);
            }
            stretch.derivative.push(speed(row as f64));
            stretch.logged.push(held);
        }
        stretch
    }

    #[test]
    fn time_constant_of_low_pass_is_found() {
        for rows in [3.0, 10.0, 20.0, 100.0] {
            let found = time_constant(&[filtered(rows)]).expect("a low-pass");
            assert!((found / rows - 1.0).abs() < 0.05, "{found} for {rows}");
        }
    }

    #[test]
    fn time_constant_of_delay_or_exact_velocity_is_none() {
        let exact = filtered(5.0);
        let late = |rows: f64| Stretch { logged: late(&exact, rows), ..exact.clone() };
        for rows in [0.0, 0.5, 3.0, 20.0] {
            assert_eq!(time_constant(&[late(rows)]), None, "{rows}");
        }
    }

    #[test]
    fn time_constant_of_another_motion_is_none() {
        let mut other = filtered(10.0);
        other.logged.reverse();
        assert_eq!(time_constant(&[other]), None);
    }
}
