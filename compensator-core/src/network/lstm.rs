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

/// Gates of a cell: forget, input, output, candidate.
pub const GATES: usize = 4;

/// The largest magnitude of a cell's state.
pub const CELL_LIMIT: f64 = 8.0;

/// Weights of one gate of one cell.
#[derive(Clone, Copy, Debug)]
pub struct Gate<T, const INPUTS: usize, const CELLS: usize> {
    /// `b`.
    pub bias: T,
    /// Its row of `W`.
    pub input: [T; INPUTS],
    /// Its row of `U`.
    pub recurrent: [T; CELLS],
}

/// A layer: by cell, its gates.
#[derive(Clone, Debug)]
pub struct Lstm<T, const INPUTS: usize, const CELLS: usize> {
    /// Forget, input, output and candidate gate of each cell.
    pub cells: [[Gate<T, INPUTS, CELLS>; GATES]; CELLS],
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
    /// What each gate summed up, before it was squashed.
    pub sums: [[T; GATES]; CELLS],
    /// `f c + i c~`, before it was limited.
    pub cell: [T; CELLS],
}

impl<T: Real, const INPUTS: usize, const CELLS: usize> Gate<T, INPUTS, CELLS> {
    #[inline(always)]
    fn sum(&self, inputs: &[T; INPUTS], output: &[T; CELLS]) -> T {
        let mut sum = self.bias;
        for (weight, input) in self.input.iter().zip(inputs) {
            sum = sum.plus_product(*weight, *input);
        }
        for (weight, output) in self.recurrent.iter().zip(output) {
            sum = sum.plus_product(*weight, *output);
        }
        sum
    }

    fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Gate<R, INPUTS, CELLS> {
        Gate { bias: f(self.bias), input: self.input.map(&f), recurrent: self.recurrent.map(&f) }
    }

    fn weights(&self) -> impl Iterator<Item = T> + '_ {
        core::iter::once(self.bias).chain(self.input).chain(self.recurrent)
    }
}

impl<T: Real, const INPUTS: usize, const CELLS: usize> Lstm<T, INPUTS, CELLS> {
    /// A layer of nothing but zeros.
    pub fn zero() -> Self {
        let gate =
            Gate { bias: T::zero(), input: [T::zero(); INPUTS], recurrent: [T::zero(); CELLS] };
        Self { cells: [[gate; GATES]; CELLS] }
    }

    /// One step. The inputs are within -1..=1.
    #[inline]
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
        for (((gates, sums), limitless), (output, cell)) in each.zip(states) {
            for (sum, gate) in sums.iter_mut().zip(gates) {
                *sum = gate.sum(inputs, &before);
            }
            let [forget, input, out, candidate] = *sums;
            *limitless = sigmoid(forget) * *cell + sigmoid(input) * squash(candidate);
            *cell = limitless.within(limit);
            *output = sigmoid(out) * squash(*cell);
        }
        taken
    }

    /// The same in another number.
    pub fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Lstm<R, INPUTS, CELLS> {
        Lstm { cells: self.cells.each_ref().map(|gates| gates.each_ref().map(|gate| gate.map(&f))) }
    }

    fn gates(&self) -> impl Iterator<Item = &Gate<T, INPUTS, CELLS>> {
        self.cells.iter().flatten()
    }

    /// The largest sum of the magnitudes of a gate's weights.
    pub(super) fn largest_sum(&self) -> f64 {
        largest(self.gates().map(|gate| gate.weights().map(|weight| weight.value().abs()).sum()))
    }

    pub(super) fn for_each(&self, sink: &mut impl FnMut(T)) {
        self.gates().flat_map(Gate::weights).for_each(sink);
    }

    pub(super) fn set(&mut self, next: &mut impl FnMut() -> Option<T>) -> Option<()> {
        for gate in self.cells.iter_mut().flatten() {
            gate.bias = next()?;
            for weight in gate.input.iter_mut().chain(&mut gate.recurrent) {
                *weight = next()?;
            }
        }
        Some(())
    }
}

/// The largest of some sums; NaN where one is.
pub(super) fn largest(sums: impl Iterator<Item = f64>) -> f64 {
    sums.fold(0.0, |most: f64, sum| if sum <= most || most.is_nan() { most } else { sum })
}
