//! Long short-term memory (Hochreiter and Schmidhuber 1997; the damper paper, eq. 6-11), one layer.
//!
//! ```text
//! f, i, o = sigmoid(W x + U h + b)      c~ = squash(W x + U h + b)
//! c <- f c + i c~                       h <- o squash(c)
//! ```
//!
//! The cell state is held within [`CELL_LIMIT`]: beyond 3 the readout's squashing function has ended anyway, and an
//! integrator without a bound would leave fixed point's range. Of eight cells and three inputs a step is 384 products
//! and 40 squashing functions.

use super::activation::{sigmoid, squash};
use crate::number::Real;
use core::array;

/// Gates of a cell: forget, input, output, candidate.
pub const GATES: usize = 4;

/// The largest magnitude of a cell's state.
pub const CELL_LIMIT: f64 = 8.0;

/// Weights of one cell, the four gates side by side: a step reads each input once for all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell<T, const INPUTS: usize, const CELLS: usize> {
    /// `b` of the forget, input, output and candidate gate.
    pub bias: [T; GATES],
    /// Their rows of `W`, by input.
    pub input: [[T; GATES]; INPUTS],
    /// Their rows of `U`, by cell.
    pub recurrent: [[T; GATES]; CELLS],
}

/// A layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Lstm<T, const INPUTS: usize, const CELLS: usize> {
    /// Its cells.
    pub cells: [Cell<T, INPUTS, CELLS>; CELLS],
}

/// What a layer remembers.
#[derive(Clone, Copy, Debug)]
pub struct Hidden<T, const CELLS: usize> {
    /// `h`, within -1..=1.
    pub output: [T; CELLS],
    /// `c`.
    pub cell: [T; CELLS],
}

impl<T: Real, const CELLS: usize> Default for Hidden<T, CELLS> {
    fn default() -> Self {
        Self { output: [T::zero(); CELLS], cell: [T::zero(); CELLS] }
    }
}

/// What a step computed on its way, for whoever goes back along it.
#[derive(Clone, Copy, Debug)]
pub struct Activations<T, const CELLS: usize> {
    /// What each gate of each cell summed up, before it was squashed.
    pub sums: [[T; GATES]; CELLS],
    /// `f c + i c~`, before it was limited.
    pub cell: [T; CELLS],
}

/// `sums` and a number times each gate's weight of it.
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

impl<T: Real, const INPUTS: usize, const CELLS: usize> Cell<T, INPUTS, CELLS> {
    /// How many weights a cell has.
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

    fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Cell<R, INPUTS, CELLS> {
        Cell {
            bias: self.bias.map(&f),
            input: self.input.map(|row| row.map(&f)),
            recurrent: self.recurrent.map(|row| row.map(&f)),
        }
    }

    /// Its weights by fours, one for each gate: bias, inputs, cells.
    fn rows(&self) -> impl Iterator<Item = &[T; GATES]> {
        core::iter::once(&self.bias).chain(&self.input).chain(&self.recurrent)
    }

    fn rows_mut(&mut self) -> impl Iterator<Item = &mut [T; GATES]> {
        core::iter::once(&mut self.bias).chain(&mut self.input).chain(&mut self.recurrent)
    }
}

impl<T: Real, const INPUTS: usize, const CELLS: usize> Lstm<T, INPUTS, CELLS> {
    /// A layer of nothing but zeros.
    pub fn zero() -> Self {
        let zeros = [T::zero(); GATES];
        let cell = Cell { bias: zeros, input: [zeros; INPUTS], recurrent: [zeros; CELLS] };
        Self { cells: [cell; CELLS] }
    }

    /// One step. The inputs are within -1..=1. In place, so that what only training wants is not written elsewhere.
    #[inline(always)]
    pub fn step(
        &self,
        hidden: &mut Hidden<T, CELLS>,
        inputs: &[T; INPUTS],
    ) -> Activations<T, CELLS> {
        let mut taken = Activations { sums: [[T::zero(); GATES]; CELLS], cell: [T::zero(); CELLS] };
        // All cells see the outputs of the step before.
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

    /// The same with more inputs, which weigh nothing.
    pub(super) fn widened<const MORE: usize>(&self) -> Lstm<T, MORE, CELLS> {
        let none = [T::zero(); GATES];
        Lstm {
            cells: self.cells.each_ref().map(|cell| Cell {
                bias: cell.bias,
                input: array::from_fn(|input| cell.input.get(input).copied().unwrap_or(none)),
                recurrent: cell.recurrent,
            }),
        }
    }

    /// The same in another number.
    pub fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Lstm<R, INPUTS, CELLS> {
        Lstm { cells: self.cells.each_ref().map(|cell| cell.map(&f)) }
    }

    /// The largest sum of the magnitudes of a gate's weights.
    pub(super) fn largest_sum(&self) -> f64 {
        let of_gate = |cell: &Cell<T, INPUTS, CELLS>, gate: usize| -> f64 {
            cell.rows().flat_map(|row| row.get(gate)).map(|weight| weight.value().abs()).sum()
        };
        largest(self.cells.iter().flat_map(|cell| (0..GATES).map(move |gate| of_gate(cell, gate))))
    }

    pub(super) fn for_each(&self, sink: &mut impl FnMut(T)) {
        self.cells.iter().flat_map(Cell::rows).flatten().copied().for_each(sink);
    }

    pub(super) fn set(&mut self, next: &mut impl FnMut() -> Option<T>) -> Option<()> {
        for weight in self.cells.iter_mut().flat_map(Cell::rows_mut).flatten() {
            *weight = next()?;
        }
        Some(())
    }
}

/// The largest of some sums; NaN where one is.
pub(super) fn largest(sums: impl Iterator<Item = f64>) -> f64 {
    sums.fold(0.0, |most: f64, sum| if sum <= most || most.is_nan() { most } else { sum })
}
