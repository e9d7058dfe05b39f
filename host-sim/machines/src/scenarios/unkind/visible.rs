//! How well a hidden effect could be seen at all: by whoever knew the plant and fitted it.
//!
//! ```text
//! e      torque with the effect - torque without, along the same motion
//! B      what a fit of the plant without it can do: derivatives by its parameters, rigid-body parts
//! e'     e less its projection on B: what is left for the cause
//! r      logged torque - the true plant's, driven by the motion as a plain method reads it from the log
//! gain   sum e'^2;  its standard error  2 sqrt(sum over blocks (sum r e')^2)
//! ```
//!
//! `r` holds the torque's noise and what the uncertain motion does to any model, so its RMS is the floor: the
//! best of a few plain readings of the motion (angle, velocity, each smoothed or not). A better reading may go below
//! it. Blocks of rows, because `r` is not independent from row to row; clipped, because a few rows at reversals would
//! decide it.

/// Rows of a block over which errors may be correlated.
const BLOCK: usize = 64;

/// Errors beyond so many robust standard deviations count as if they were there.
const CLIP: f64 = 4.0;

/// Runs of rows.
pub(super) type Rows = Vec<Vec<f64>>;

/// What is left of an effect for a cause, and how plainly it shows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Visible {
    /// RMS of what no parameter of the plant can take, Nm.
    pub rms_nm: f64,
    /// Gain of the true structure over its standard error.
    pub gain_in_errors: f64,
}

/// `a - b`, run by run.
pub(super) fn difference(a: &Rows, b: &Rows) -> Rows {
    let run = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    a.iter().zip(b).map(run).collect()
}

/// RMS over all rows.
pub(super) fn rms(rows: &Rows) -> f64 {
    let count: usize = rows.iter().map(Vec::len).sum();
    (rows.iter().flatten().map(|x| x * x).sum::<f64>() / count.max(1) as f64).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What is left of `of` after a least-squares fit of `base`, by Gram and Schmidt twice over.
fn left_over(of: Vec<f64>, base: &[Vec<f64>]) -> Vec<f64> {
    /// A column of which less than this is left beside the others adds nothing but rounding.
    const DEPENDENT: f64 = 1e-6;
    let mut directions: Vec<Vec<f64>> = Vec::with_capacity(base.len());
    let without = |mut column: Vec<f64>, directions: &[Vec<f64>]| {
        for _ in 0..2 {
            for direction in directions {
                let along = dot(&column, direction);
                column.iter_mut().zip(direction).for_each(|(x, d)| *x -= along * d);
            }
        }
        column
    };
    for column in base {
        let whole = dot(column, column).sqrt();
        let own = without(column.clone(), &directions);
        let size = dot(&own, &own).sqrt();
        if size > DEPENDENT * whole {
            directions.push(own.into_iter().map(|x| x / size).collect());
        }
    }
    without(of, &directions)
}

/// What of an effect a refit of the true structure would gain against the errors of that structure.
pub(super) fn visible(effect: &Rows, base: &[Rows], errors: &Rows) -> Visible {
    let flat = |rows: &Rows| rows.iter().flatten().copied().collect::<Vec<f64>>();
    let base: Vec<Vec<f64>> = base.iter().map(flat).collect();
    let left = left_over(flat(effect), &base);
    let mut errors = flat(errors);
    let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let most = CLIP * 1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    errors.iter_mut().for_each(|e| *e = e.clamp(-most, most));
    let gain = dot(&left, &left);
    let blocks = left.chunks(BLOCK).zip(errors.chunks(BLOCK));
    let variance: f64 = blocks.map(|(left, errors)| 4.0 * dot(left, errors).powi(2)).sum();
    Visible {
        rms_nm: (gain / left.len().max(1) as f64).sqrt(),
        gain_in_errors: if variance > 0.0 { gain / variance.sqrt() } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_base_can_do_is_no_effect() {
        let one: Vec<f64> = (0..200).map(|at| f64::from(at).sin()).collect();
        let other: Vec<f64> = (0..200).map(|at| f64::from(at % 7)).collect();
        let sum: Vec<f64> = one.iter().zip(&other).map(|(a, b)| 2.0 * a - b).collect();
        let noise = vec![vec![0.1; 200]];
        let seen = visible(&vec![sum.clone()], &[vec![one.clone()], vec![other]], &noise);
        assert!(seen.rms_nm < 1e-9, "{seen:?}");
        let seen = visible(&vec![sum], &[vec![one]], &noise);
        assert!(seen.rms_nm > 1.0, "{seen:?}");
    }

    #[test]
    fn more_noise_shows_less() {
        let effect = vec![(0..640).map(|at| f64::from(at % 3)).collect::<Vec<f64>>()];
        let errors =
            |size: f64| vec![(0..640).map(|at| size * f64::from(at * 7919 % 13 - 6)).collect()];
        let clear = visible(&effect, &[], &errors(0.01)).gain_in_errors;
        let dim = visible(&effect, &[], &errors(0.1)).gain_in_errors;
        assert!((clear / dim - 10.0).abs() < 1e-6, "{clear} {dim}");
    }
}
