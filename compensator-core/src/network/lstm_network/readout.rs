//! The output layer: for each factor, a weighted sum of the outputs of the cells.

use super::FACTOR_COUNT;
use super::lstm::largest;
use crate::number::Real;

/// Weights of the output layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout<T, const CELLS: usize> {
    /// Bias of each factor.
    pub bias: [T; FACTOR_COUNT],
    /// Weights of the cells for each factor.
    pub weights: [[T; CELLS]; FACTOR_COUNT],
}

impl<T: Real, const CELLS: usize> Readout<T, CELLS> {
    /// Returns a readout with all weights 0.
    pub fn zero() -> Self {
        Self { bias: [T::zero(); FACTOR_COUNT], weights: [[T::zero(); CELLS]; FACTOR_COUNT] }
    }

    /// Returns the sums, which the sigmoid then maps to the bounds of the factors.
    #[inline]
    pub fn read(&self, output: &[T; CELLS]) -> [T; FACTOR_COUNT] {
        let mut sums = self.bias;
        for (sum, weights) in sums.iter_mut().zip(&self.weights) {
            for (weight, output) in weights.iter().zip(output) {
                *sum = sum.plus_product(*weight, *output);
            }
        }
        sums
    }

    /// Applies `f` to every weight, for example to convert the number type.
    pub fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Readout<R, CELLS> {
        Readout { bias: self.bias.map(&f), weights: self.weights.map(|row| row.map(&f)) }
    }

    fn rows(&self) -> impl Iterator<Item = impl Iterator<Item = T> + '_> {
        self.bias.iter().zip(&self.weights).map(|(bias, row)| core::iter::once(*bias).chain(*row))
    }

    /// Returns the largest sum of the magnitudes of one factor's weights.
    pub(super) fn largest_sum(&self) -> f32 {
        largest(self.rows().map(|row| row.map(|weight| weight.single().abs()).sum()))
    }

    pub(super) fn for_each(&self, sink: &mut impl FnMut(T)) {
        self.rows().flatten().for_each(sink);
    }

    pub(super) fn set(&mut self, next: &mut impl FnMut() -> Option<T>) -> Option<()> {
        for (bias, row) in self.bias.iter_mut().zip(&mut self.weights) {
            *bias = next()?;
            for weight in row {
                *weight = next()?;
            }
        }
        Some(())
    }
}
