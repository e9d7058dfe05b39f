//! Long short-term memory (Hochreiter and Schmidhuber 1997; the damper paper, eq. 6-11), one layer.
//!
//! ```text
//! f, i, o = sigmoid(W x + U h + b)      c~ = squash(W x + U h + b)
//! c <- f c + i c~                       h <- o squash(c)
//! ```
//!
//! [`CELL_LIMIT`] bounds the cell state. Beyond 3 `squash(c)` is saturated, and an unbounded integrator would leave
//! the range of fixed point. With eight cells and three inputs, a step takes 384 products and 40 activation
//! functions.

use super::activation::{sigmoid, squash};
use crate::number::Real;
use core::array;

/// Gates of a cell: forget, input, output, candidate.
pub const GATES: usize = 4;

/// Maximum magnitude of the state of a cell.
pub const CELL_LIMIT: f64 = 8.0;

/// Weights of one cell. The four gates are stored together, so that a step reads each input once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LstmCell<T, const INPUTS: usize, const CELLS: usize> {
    /// Bias `b` of the forget, input, output and candidate gate.
    pub bias: [T; GATES],
    /// Rows of `W`, one per input.
    pub input: [[T; GATES]; INPUTS],
    /// Rows of `U`, one per cell.
    pub recurrent: [[T; GATES]; CELLS],
}

/// A recurrent layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Lstm<T, const INPUTS: usize, const CELLS: usize> {
    /// Cells of the layer.
    pub cells: [LstmCell<T, INPUTS, CELLS>; CELLS],
}

/// State of a layer.
#[derive(Clone, Copy, Debug)]
pub struct LstmState<T, const CELLS: usize> {
    /// Output `h`, within -1..=1.
    pub output: [T; CELLS],
    /// Cell state `c`.
    pub cell: [T; CELLS],
}

impl<T: Real, const CELLS: usize> Default for LstmState<T, CELLS> {
    fn default() -> Self {
        Self { output: [T::zero(); CELLS], cell: [T::zero(); CELLS] }
    }
}

/// Intermediate values of a step, for back-propagation.
#[derive(Clone, Copy, Debug)]
pub struct LstmActivations<T, const CELLS: usize> {
    /// Sum of each gate of each cell, before the activation function.
    pub sums: [[T; GATES]; CELLS],
    /// `f c + i c~`, before the limit.
    pub cell: [T; CELLS],
}

/// Returns `sums` plus the products of `number` and the weight of each gate.
#[inline(always)]
fn plus<T: Real>(sums: [T; GATES], weights: &[T; GATES], number: T) -> [T; GATES] {
    let [forget, input, output, candidate] = sums;
    let [of_forget, of_input, of_output, of_candidate] = *weights;
    [
        forget.plus_product(of_forget, number),
        input.plus_product(of_input, number),
        output.plus_product(of_output, number),
        candidate.plus_product(of_candidate, number),
    ]
}

impl<T: Real, const INPUTS: usize, const CELLS: usize> LstmCell<T, INPUTS, CELLS> {
    /// Number of weights of a cell.
    pub const WEIGHTS: usize = GATES * (1 + INPUTS + CELLS);

    #[inline(always)]
    fn sums(&self, inputs: &[T; INPUTS], output: &[T; CELLS]) -> [T; GATES] {
        let mut sums = self.bias;
        for (weights, input) in self.input.iter().zip(inputs) {
            sums = plus(sums, weights, *input);
        }
        for (weights, output) in self.recurrent.iter().zip(output) {
            sums = plus(sums, weights, *output);
        }
        sums
    }

    fn map<R: Real>(&self, f: impl Fn(T) -> R) -> LstmCell<R, INPUTS, CELLS> {
        LstmCell {
            bias: self.bias.map(&f),
            input: self.input.map(|row| row.map(&f)),
            recurrent: self.recurrent.map(|row| row.map(&f)),
        }
    }

    /// Iterates over the weights in groups of four, one per gate: bias, inputs, cells.
    fn rows(&self) -> impl Iterator<Item = &[T; GATES]> {
        core::iter::once(&self.bias).chain(&self.input).chain(&self.recurrent)
    }

    fn rows_mut(&mut self) -> impl Iterator<Item = &mut [T; GATES]> {
        core::iter::once(&mut self.bias).chain(&mut self.input).chain(&mut self.recurrent)
    }
}

impl<T: Real, const INPUTS: usize, const CELLS: usize> Lstm<T, INPUTS, CELLS> {
    /// Returns a layer with all weights 0.
    pub fn zero() -> Self {
        let zeros = [T::zero(); GATES];
        let cell = LstmCell { bias: zeros, input: [zeros; INPUTS], recurrent: [zeros; CELLS] };
        Self { cells: [cell; CELLS] }
    }

    /// Advances the state by one step, in place. The inputs are within -1..=1.
    ///
    /// Returns the intermediate values. The compiler removes them if the caller does not use them.
    #[inline(always)]
    pub fn step(
        &self,
        hidden: &mut LstmState<T, CELLS>,
        inputs: &[T; INPUTS],
    ) -> LstmActivations<T, CELLS> {
        let mut taken =
            LstmActivations { sums: [[T::zero(); GATES]; CELLS], cell: [T::zero(); CELLS] };
        // All cells read the outputs of the previous step.
        let before = hidden.output;
        let limit = T::from_f64(CELL_LIMIT);
        let each = self.cells.iter().zip(&mut taken.sums).zip(&mut taken.cell);
        let states = hidden.output.iter_mut().zip(&mut hidden.cell);
        for (((weights, sums), limitless), (output, cell)) in each.zip(states) {
            *sums = weights.sums(inputs, &before);
            let [forget, input, out, candidate] = *sums;
            *limitless = sigmoid(forget) * *cell + sigmoid(input) * squash(candidate);
            *cell = limitless.within(limit);
            *output = sigmoid(out) * squash(*cell);
        }
        taken
    }

    /// Returns the layer with additional inputs whose weights are 0.
    pub(super) fn widened<const MORE: usize>(&self) -> Lstm<T, MORE, CELLS> {
        let none = [T::zero(); GATES];
        Lstm {
            cells: self.cells.each_ref().map(|cell| LstmCell {
                bias: cell.bias,
                input: array::from_fn(|input| cell.input.get(input).copied().unwrap_or(none)),
                recurrent: cell.recurrent,
            }),
        }
    }

    /// Applies `f` to every weight, for example to convert the number type.
    pub fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Lstm<R, INPUTS, CELLS> {
        Lstm { cells: self.cells.each_ref().map(|cell| cell.map(&f)) }
    }

    /// Returns the largest sum of the magnitudes of one gate's weights.
    pub(super) fn largest_sum(&self) -> f32 {
        let of_gate = |cell: &LstmCell<T, INPUTS, CELLS>, gate: usize| -> f32 {
            cell.rows().flat_map(|row| row.get(gate)).map(|weight| weight.single().abs()).sum()
        };
        largest(self.cells.iter().flat_map(|cell| (0..GATES).map(move |gate| of_gate(cell, gate))))
    }

    pub(super) fn for_each(&self, sink: &mut impl FnMut(T)) {
        self.cells.iter().flat_map(LstmCell::rows).flatten().copied().for_each(sink);
    }

    pub(super) fn set(&mut self, next: &mut impl FnMut() -> Option<T>) -> Option<()> {
        for weight in self.cells.iter_mut().flat_map(LstmCell::rows_mut).flatten() {
            *weight = next()?;
        }
        Some(())
    }
}

/// Returns the largest of the sums, or NaN if any sum is NaN.
pub(super) fn largest(sums: impl Iterator<Item = f32>) -> f32 {
    sums.fold(0.0, |most: f32, sum| if sum <= most || most.is_nan() { most } else { sum })
}
