//! The ceiling: what a flexible model with the same columns leaves of the error.
//!
//! The error of a diagnosis lies above the noise floor for two reasons: an effect that no cause describes, or noise that no
//! column follows. A flexible model tells them apart. Trees (`boosting`) are grown on what the named model leaves, with the
//! log's columns and a memory of the motion, and predict rows that they have not seen. Their input holds no torque of earlier
//! rows, which would predict the noise of a slow channel.
//!
//! [`explained_share`] works on plain columns. [`Ceiling::new`] gives it those of a log.

mod boosting;
mod table;

use super::left_out::{FEWEST_RUNS, LeftOut, stretch};
use super::train_test::TrainTest;
use boosting::{BinnedColumns, Tree};
use friction_fit::Predicted;
use joint_log::work::checkpoint;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use table::Table;

/// Most rows that are used; of a longer log, one in several.
const MOST_ROWS: usize = 20_000;

/// Most parts that are held out in turn.
const MOST_PARTS: usize = 5;

/// Most trees of a model.
const MOST_TREES: usize = 80;

/// Trees without a smaller error after which no more are grown.
const PATIENCE: usize = 12;

/// Blocks of rows that the standard error is taken from.
const BLOCKS: usize = 60;

/// Seed of the samples. It is constant, so that a log always gives the same ceiling.
const SEED: u64 = 0x6365_696c;

/// Fold of rows that are never held out.
pub const TRAINING: usize = usize::MAX;

/// Share of a squared error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExplainedShare {
    /// The share, 0 to 1.
    pub value: f64,
    /// Its standard error, over blocks of rows.
    pub std_error: f64,
}

/// Returns the share of the weighted squared target that a flexible model of these columns predicts in held-out rows.
///
/// `fold` is the part of each row, [`TRAINING`] for rows that only train; many folds are held out several at a time. All
/// columns have as many rows as `target`. The number of trees in a fold is chosen by the errors of the other folds, so that
/// the error of a fold is not used before it is counted. The share is 0 if the model predicts nothing.
pub fn explained_share(
    columns: &[&[f64]],
    target: &[f64],
    weights: &[f64],
    fold: &[usize],
) -> ExplainedShare {
    let counted: Vec<usize> = (0..target.len()).filter(|row| weights[*row] > 0.0).collect();
    let stride = counted.len().div_ceil(MOST_ROWS).max(1);
    let rows: Vec<usize> = counted.into_iter().step_by(stride).collect();
    let part =
        |row: &usize| if fold[*row] == TRAINING { MOST_PARTS } else { fold[*row] % MOST_PARTS };
    let part: Vec<usize> = rows.iter().map(part).collect();
    if rows.is_empty() || columns.is_empty() {
        return ExplainedShare::default();
    }
    let columns = BinnedColumns::new(columns, &rows);
    let scale = rows.iter().map(|row| target[*row].powi(2)).sum::<f64>() / rows.len() as f64;
    let scale = scale.sqrt().max(f64::MIN_POSITIVE);
    let target: Vec<f32> = rows.iter().map(|row| (target[*row] / scale) as f32).collect();
    let weights: Vec<f32> = rows.iter().map(|row| weights[*row] as f32).collect();
    let mut parts: Vec<Part> = (0..MOST_PARTS)
        .filter_map(|held_out_part| Part::new(held_out_part, &part, &target, &weights))
        .collect();
    grow(&mut parts, &columns, &weights);
    share(&parts, &columns, &target, &weights)
}

/// Grows trees in all parts until the held-out error falls no further.
fn grow(parts: &mut [Part], columns: &BinnedColumns, weights: &[f32]) {
    let error =
        |parts: &[Part], trees: usize| parts.iter().map(|part| part.errors[trees]).sum::<f64>();
    let mut best = (error(parts, 0), 0);
    for trees in 1..=MOST_TREES {
        parts.par_iter_mut().for_each(|part| {
            checkpoint();
            part.add_tree(columns, weights);
        });
        let error = error(parts, trees);
        if error < best.0 {
            best = (error, trees);
        }
        if trees - best.1 >= PATIENCE {
            break;
        }
    }
}

/// Returns the share of the held-out error that the trees predict.
fn share(
    parts: &[Part],
    columns: &BinnedColumns,
    target: &[f32],
    weights: &[f32],
) -> ExplainedShare {
    // Weighted squared error of each row, before and after; `None` for rows that only train.
    let mut errors: Vec<Option<[f64; 2]>> = vec![None; target.len()];
    for part in parts {
        let others = parts.iter().filter(|other| other.held_out_part != part.held_out_part);
        let others: Vec<&[f64]> = others.map(|other| other.errors.as_slice()).collect();
        let error = |trees: &usize| others.iter().map(|errors| errors[*trees]).sum::<f64>();
        let trees = (0..part.errors.len()).min_by(|a, b| error(a).total_cmp(&error(b)));
        for row in &part.held_out {
            let trees = &part.trees[..trees.unwrap_or(0)];
            let predicted: f32 = trees.iter().map(|tree| tree.predict(columns, *row)).sum();
            let square = |error: f32| f64::from(weights[*row] * error * error);
            errors[*row] = Some([square(target[*row]), square(target[*row] - predicted)]);
        }
    }
    let errors: Vec<[f64; 2]> = errors.into_iter().flatten().collect();
    let add = |sum: [f64; 2], errors: &[f64; 2]| [sum[0] + errors[0], sum[1] + errors[1]];
    let [before, after] = errors.iter().fold([0.0; 2], add);
    if after >= before {
        return ExplainedShare::default();
    }
    let value = 1.0 - after / before;
    let blocks = errors.chunks(errors.len().div_ceil(BLOCKS).max(1));
    let deviation = |block: &[[f64; 2]]| {
        let [before, after] = block.iter().fold([0.0; 2], add);
        (before - after - value * before).powi(2)
    };
    let std_error = blocks.map(deviation).sum::<f64>().sqrt() / before;
    ExplainedShare { value, std_error }
}

/// The model that does not see one part.
struct Part {
    held_out_part: usize,
    held_out: Vec<usize>,
    others: Vec<usize>,
    /// Target minus prediction of every row.
    error: Vec<f32>,
    trees: Vec<Tree>,
    /// Held-out squared error with the first 0, 1, 2... trees.
    errors: Vec<f64>,
    random: Pcg64,
}

impl Part {
    /// Returns the model of a part; `None` if the part or the rest is empty.
    fn new(held_out_part: usize, part: &[usize], target: &[f32], weights: &[f32]) -> Option<Self> {
        let (held_out, others): (Vec<usize>, Vec<usize>) =
            (0..part.len()).partition(|row| part[*row] == held_out_part);
        if held_out.is_empty() || others.is_empty() {
            return None;
        }
        let mut part = Self {
            held_out_part,
            held_out,
            others,
            error: target.to_vec(),
            trees: Vec::new(),
            errors: Vec::new(),
            random: Pcg64::seed_from_u64(SEED + held_out_part as u64),
        };
        part.note_error(weights);
        Some(part)
    }

    fn add_tree(&mut self, columns: &BinnedColumns, weights: &[f32]) {
        let tree = Tree::grow(columns, &self.others, &self.error, weights, &mut self.random);
        for (row, error) in self.error.iter_mut().enumerate() {
            *error -= tree.predict(columns, row);
        }
        self.trees.push(tree);
        self.note_error(weights);
    }

    fn note_error(&mut self, weights: &[f32]) {
        let square = |row: &usize| f64::from(weights[*row] * self.error[*row].powi(2));
        self.errors.push(self.held_out.iter().map(square).sum());
    }
}

/// What a flexible model leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ceiling {
    /// RMS error on the held-out rows, Nm: at most that of the named model.
    pub rmse: f64,
    /// Its standard error, Nm.
    pub std_error: f64,
}

impl Ceiling {
    /// How the ceiling is found, for `diagnosis.json`.
    pub const METHOD: &str =
        "gradient-boosted trees on the residual of the named model, out of fold";

    /// Returns what trees leave of the error of `after` on the held-out rows of a log. `trained` is the same model on the
    /// training rows, if those are not held out too.
    pub fn new(
        log: &TrainTest,
        left_out: Option<LeftOut>,
        after: &Predicted,
        trained: Option<&Predicted>,
    ) -> Self {
        let has_runs = log.test.runs.len() >= FEWEST_RUNS;
        let by_run = left_out.map_or(has_runs, |left_out| left_out == LeftOut::Runs);
        let mut table = Table::default();
        table.add(log, &log.test_tracks, after, |track, row| match by_run {
            true => track.run,
            false => stretch(&log.test, track, row),
        });
        if let Some(trained) = trained {
            table.add_training(log, trained);
        }
        let columns: Vec<&[f64]> = table.columns.iter().map(Vec::as_slice).collect();
        let share = explained_share(&columns, &table.target, &table.weights, &table.fold);
        let left = (1.0 - share.value).max(0.0).sqrt();
        let rmse = after.metrics.rmse * left;
        let std_error = 0.5 * after.metrics.rmse * share.std_error / left.max(f64::MIN_POSITIVE);
        Self { rmse, std_error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{HandMadeLog, LogRow, linear_base, linear_torque};
    use crate::left_out::{one_step_left_out, unit};
    use rand::RngExt;

    const ROWS: usize = 6000;

    /// Returns three independent columns and noise of unit variance.
    fn columns(seed: u64) -> [Vec<f64>; 4] {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut column = || (0..ROWS).map(|_| random.random_range(-1.0..1.0)).collect();
        let [a, b, c, noise]: [Vec<f64>; 4] = [column(), column(), column(), column()];
        [a, b, c, noise.iter().map(|noise| noise * 3f64.sqrt()).collect()]
    }

    fn share(columns: &[Vec<f64>], target: &[f64]) -> ExplainedShare {
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let fold: Vec<usize> = (0..ROWS).map(|row| row * 10 / ROWS).collect();
        explained_share(&columns, target, &[1.0; ROWS], &fold)
    }

    #[test]
    fn explained_share_of_product_of_two_columns_is_found() {
        let [a, b, c, noise] = columns(1);
        // Half of the variance is the product.
        let target: Vec<f64> = (0..ROWS).map(|row| 3.0 * a[row] * b[row] + noise[row]).collect();
        let found = share(&[a, b.clone(), c.clone()], &target);
        assert!((0.4..0.55).contains(&found.value), "{found:?}");
        assert!(found.std_error > 0.0 && found.std_error < 0.05);
        let without = share(&[b, c], &target);
        assert!(without.value < 0.02, "{without:?}");
    }

    #[test]
    fn explained_share_of_noise_is_within_its_error_of_zero() {
        for seed in 0..10 {
            let [a, b, c, noise] = columns(seed);
            let found = share(&[a, b, c], &noise);
            assert!(found.value <= 3.0 * found.std_error && found.value < 0.01, "{found:?}");
        }
    }

    #[test]
    fn explained_share_with_training_rows_counts_held_out_rows_only() {
        let [a, b, _, noise] = columns(3);
        let half = ROWS / 2;
        // Training rows hold the effect. Held-out rows hold it with the other sign.
        let sign = |row: usize| if row < half { 1.0 } else { -1.0 };
        let target: Vec<f64> = (0..ROWS).map(|row| 3.0 * sign(row) * a[row] + noise[row]).collect();
        let fold: Vec<usize> = (0..ROWS).map(|row| if row < half { TRAINING } else { 0 }).collect();
        let found = explained_share(&[&a, &b], &target, &[1.0; ROWS], &fold);
        assert_eq!(found, ExplainedShare::default());
    }

    #[test]
    fn explained_share_ignores_rows_without_weight() {
        let [a, b, c, noise] = columns(4);
        let target: Vec<f64> =
            (0..ROWS).map(|row| if row % 2 == 0 { noise[row] } else { 5.0 * a[row] }).collect();
        let weights: Vec<f64> = (0..ROWS).map(|row| f64::from(u8::from(row % 2 == 0))).collect();
        let fold: Vec<usize> = (0..ROWS).map(|row| row * 10 / ROWS).collect();
        let found = explained_share(&[&a, &b, &c], &target, &weights, &fold);
        assert!(found.value < 0.01, "{found:?}");
    }

    /// Returns the error of the linear law on a log, and the ceiling.
    fn ceiling(torque_nm: impl Fn(&LogRow) -> f64) -> (f64, Ceiling) {
        let log = HandMadeLog::new(torque_nm).train_test();
        let way = unit(&log.train_tracks);
        let predicted = one_step_left_out(&log, &log, &linear_base(&log));
        (predicted.metrics.rmse, Ceiling::new(&log, Some(way), &predicted, None))
    }

    #[test]
    fn ceiling_of_clean_log_is_the_error_of_the_model() {
        let (rmse, ceiling) = ceiling(linear_torque);
        assert!(ceiling.rmse <= rmse && ceiling.rmse > 0.98 * rmse, "{ceiling:?} {rmse}");
    }

    #[test]
    fn ceiling_of_effect_without_term_is_far_below_the_model() {
        // Friction with the product of two columns.
        let product = |row: &LogRow| (row.pressure_mpa - 0.5) * (row.temperature_c - 30.0);
        let (rmse, found) =
            ceiling(|row| linear_torque(row) + 0.1 * product(row) * row.direction());
        assert!(found.rmse < 0.75 * rmse, "{found:?} {rmse}");
        // Hysteresis.
        let (rmse, found) = ceiling(|row| linear_torque(row) + 0.2 * row.soft_bristle_share);
        assert!(found.rmse < 0.75 * rmse, "{found:?} {rmse}");
    }
}
