//! Detectability of a hidden effect by a refit of the known plant.
//!
//! ```text
//! e      torque with the effect - torque without it, along the same motion
//! B      derivatives of the plant without the effect by its parameters, rigid-body parts, and other effects of the world
//! e'     e minus its projection on B: the part that only the cause explains
//! r      logged torque - torque of the true plant with the motion reconstructed from the log
//! gain   sum e'^2;  its standard error  2 sqrt(sum over blocks (sum r e')^2)
//! ```
//!
//! `r` contains the torque noise and the error due to the uncertain motion. Its RMS is the error floor of the best of
//! several simple reconstructions of the motion. A better reconstruction may have a smaller error.
//!
//! The standard error uses blocks of rows, because `r` is correlated from row to row. `r` is clipped, because
//! otherwise a few rows at reversals would dominate.

/// Rows per block. Errors may be correlated within a block.
const BLOCK_ROWS: usize = 64;

/// Limit to which errors are clipped, in robust standard deviations.
const CLIP_DEVIATIONS: f64 = 4.0;

/// Values of all rows, run by run.
pub(super) type Rows = Vec<Vec<f64>>;

/// Part of an effect that only its cause explains, and its detectability.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Visible {
    /// RMS of the part that no parameter of the plant can explain, Nm.
    pub rms_nm: f64,
    /// Gain of the true structure, in standard errors.
    pub gain_in_errors: f64,
}

/// Returns `a - b`, run by run.
pub(super) fn difference(a: &Rows, b: &Rows) -> Rows {
    let run = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    a.iter().zip(b).map(run).collect()
}

/// Returns the RMS over all rows.
pub(super) fn rms(rows: &Rows) -> f64 {
    let count: usize = rows.iter().map(Vec::len).sum();
    (rows.iter().flatten().map(|x| x * x).sum::<f64>() / count.max(1) as f64).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the residual of `target` after a least-squares fit of `base`, by repeated Gram-Schmidt orthogonalisation.
fn residual(target: Vec<f64>, base: &[Vec<f64>]) -> Vec<f64> {
    /// Relative size of a residual below which a column counts as linearly dependent.
    const DEPENDENT_SHARE: f64 = 1e-6;
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
        let orthogonal = without(column.clone(), &directions);
        let size = dot(&orthogonal, &orthogonal).sqrt();
        if size > DEPENDENT_SHARE * whole {
            directions.push(orthogonal.into_iter().map(|x| x / size).collect());
        }
    }
    without(target, &directions)
}

/// Compares the gain of a refit with the true structure to its standard error.
pub(super) fn evaluate_visibility(effect: &Rows, base: &[Rows], errors: &Rows) -> Visible {
    let flat = |rows: &Rows| rows.iter().flatten().copied().collect::<Vec<f64>>();
    let base: Vec<Vec<f64>> = base.iter().map(flat).collect();
    let left = residual(flat(effect), &base);
    let mut errors = flat(errors);
    let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let most = CLIP_DEVIATIONS * 1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    errors.iter_mut().for_each(|e| *e = e.clamp(-most, most));
    let gain = dot(&left, &left);
    let blocks = left.chunks(BLOCK_ROWS).zip(errors.chunks(BLOCK_ROWS));
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
    fn evaluate_visibility_of_effect_within_base_returns_zero_rms() {
        let one: Vec<f64> = (0..200).map(|at| f64::from(at).sin()).collect();
        let other: Vec<f64> = (0..200).map(|at| f64::from(at % 7)).collect();
        let sum: Vec<f64> = one.iter().zip(&other).map(|(a, b)| 2.0 * a - b).collect();
        let noise = vec![vec![0.1; 200]];
        let seen =
            evaluate_visibility(&vec![sum.clone()], &[vec![one.clone()], vec![other]], &noise);
        assert!(seen.rms_nm < 1e-9, "{seen:?}");
        let seen = evaluate_visibility(&vec![sum], &[vec![one]], &noise);
        assert!(seen.rms_nm > 1.0, "{seen:?}");
    }

    #[test]
    fn evaluate_visibility_with_more_noise_returns_smaller_gain() {
        let effect = vec![(0..640).map(|at| f64::from(at % 3)).collect::<Vec<f64>>()];
        let errors =
            |size: f64| vec![(0..640).map(|at| size * f64::from(at * 7919 % 13 - 6)).collect()];
        let clear = evaluate_visibility(&effect, &[], &errors(0.01)).gain_in_errors;
        let dim = evaluate_visibility(&effect, &[], &errors(0.1)).gain_in_errors;
        assert!((clear / dim - 10.0).abs() < 1e-6, "{clear} {dim}");
    }
}
