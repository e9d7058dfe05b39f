//! Recursive least squares in square-root form: the root of the information matrix, rotated by Givens.
//!
//! The information matrix of a regression is `A = R^T R`, `R` upper triangular. A row `phi` with the error `e` of its
//! prediction is put below `R`. Rotations make it triangular again, and the estimate moves by the solution of
//! `R d = z`. Rotations keep lengths, so rounding does not grow, and `A` stays positive in any number of steps. The usual
//! recursion of the covariance matrix loses this in single precision after some hours.
//!
//! Old data is forgotten only in the direction of the new row (directional forgetting, Cao and Schwartz 2000):
//!
//! ```text
//! A' = A - (1 - mu) A phi phi^T A / (phi^T A phi)
//! ```
//!
//! What a row does not excite keeps its information, and so its estimate, however long the joint repeats one motion. In
//! root form: `w = R phi` is rotated to the first axis, and the first row is multiplied by the root of `mu`.

use super::unknowns::DIMENSIONS;
use crate::number::Real;
use libm::sqrtf;

/// Root of an information matrix of up to [`DIMENSIONS`] unknowns.
#[derive(Clone, Debug)]
pub(super) struct InformationRoot {
    /// Number of unknowns.
    count: usize,
    root: [[f32; DIMENSIONS]; DIMENSIONS],
}

/// Rotates two rows from this column on, so that `turn` becomes `(length, 0)`.
#[inline(never)]
fn rotate(above: &mut [f32], below: &mut [f32], turn: (f32, f32)) {
    let length = sqrtf(turn.0 * turn.0 + turn.1 * turn.1);
    // A pair of zeros, or of numbers whose squares vanish, needs no turn.
    if length <= 0.0 {
        return;
    }
    let (cosine, sine) = (turn.0 / length, turn.1 / length);
    for (above, below) in above.iter_mut().zip(below) {
        (*above, *below) = (cosine * *above + sine * *below, cosine * *below - sine * *above);
    }
}

impl InformationRoot {
    /// Returns the information of independent guesses with these standard deviations.
    pub fn of_deviations(deviations: &[f32]) -> Self {
        let count = deviations.len().min(DIMENSIONS);
        let mut root = [[0.0; DIMENSIONS]; DIMENSIONS];
        for (index, (row, deviation)) in root.iter_mut().zip(deviations).enumerate() {
            row[index] = 1.0 / deviation;
        }
        Self { count, root }
    }

    /// Rotates `row` and the next one from column `first` on, so that `turn` becomes `(length, 0)`.
    fn rotate_neighbours(&mut self, row: usize, first: usize, turn: (f32, f32)) {
        let columns = first..self.count;
        let (above, below) = self.root.split_at_mut(row + 1);
        rotate(&mut above[row][columns.clone()], &mut below[0][columns], turn);
    }

    fn entry(&self, row: usize, column: usize) -> f32 {
        self.root[row][column]
    }

    /// Forgets the share `1 - retained` of the information in the direction of `phi`.
    #[inline(never)]
    pub fn forget(&mut self, phi: &[f32; DIMENSIONS], retained: f32) {
        let mut along: [f32; DIMENSIONS] = core::array::from_fn(|row| {
            (row..self.count).map(|column| self.entry(row, column) * phi[column]).sum()
        });
        for below in (1..self.count).rev() {
            let turn = (along[below - 1], along[below]);
            self.rotate_neighbours(below - 1, below - 1, turn);
            along[below - 1] = sqrtf(turn.0 * turn.0 + turn.1 * turn.1);
        }
        let kept = sqrtf(retained);
        self.root[0].iter_mut().for_each(|entry| *entry *= kept);
        for column in 0..self.count.saturating_sub(1) {
            let turn = (self.entry(column, column), self.entry(column + 1, column));
            self.rotate_neighbours(column, column, turn);
            self.root[column + 1][column] = 0.0;
        }
    }

    /// Adds a row, in units of its noise, and returns the change of the estimate for the error of its prediction.
    #[inline(never)]
    pub fn update(&mut self, phi: &[f32; DIMENSIONS], error: f32) -> [f32; DIMENSIONS] {
        let mut row = *phi;
        let mut rest = error;
        let mut moved = [0.0; DIMENSIONS];
        for column in 0..self.count {
            let turn = (self.entry(column, column), row[column]);
            let mut pair = ([0.0], [rest]);
            rotate(&mut pair.0, &mut pair.1, turn);
            (moved[column], rest) = (pair.0[0], pair.1[0]);
            let columns = column..self.count;
            rotate(&mut self.root[column][columns.clone()], &mut row[columns], turn);
        }
        self.solve(moved)
    }

    /// Adds a guess of one unknown with this standard deviation, and moves the estimate.
    #[inline(never)]
    pub fn pull(
        &mut self,
        estimate: &mut [f32; DIMENSIONS],
        index: usize,
        guess: f32,
        deviation: f32,
    ) {
        let mut row = [0.0; DIMENSIONS];
        row[index] = 1.0 / deviation;
        let change = self.update(&row, (guess - estimate[index]) / deviation);
        estimate.iter_mut().zip(change).for_each(|(unknown, change)| *unknown += change);
    }

    /// Returns `x` with `R x = right`.
    #[inline(never)]
    fn solve(&self, right: [f32; DIMENSIONS]) -> [f32; DIMENSIONS] {
        let mut x = right;
        for row in (0..self.count).rev() {
            let later = row + 1..self.count;
            let known: f32 = later.map(|column| self.entry(row, column) * x[column]).sum();
            x[row] = (x[row] - known) / self.entry(row, row);
        }
        x
    }

    /// Returns the standard deviations of the estimate: the roots of the diagonal of `A^-1`.
    pub fn deviations(&self) -> [f32; DIMENSIONS] {
        let mut squares = [0.0; DIMENSIONS];
        for column in 0..self.count {
            let mut unit = [0.0; DIMENSIONS];
            unit[column] = 1.0;
            let inverse = self.solve(unit);
            squares.iter_mut().zip(inverse).for_each(|(sum, entry)| *sum += entry * entry);
        }
        squares.iter_mut().for_each(|square| *square = sqrtf(*square));
        squares
    }

    /// Returns true if every number is finite and the diagonal is not 0.
    pub fn is_regular(&self) -> bool {
        (0..self.count).all(|row| {
            let is_finite = (row..self.count).all(|column| self.entry(row, column).is_finite());
            is_finite && Real::abs(self.entry(row, row)) > f32::MIN_POSITIVE
        })
    }
}
