//! What is read from the recurrent layer: one number for each factor, a weighted sum of the cells' outputs.

use super::FACTORS;
use super::lstm::largest;
use crate::number::Real;

/// Weights of the readout.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout<T, const CELLS: usize> {
    /// A bias for each factor.
    pub bias: [T; FACTORS],
    /// Weights of the cells for each factor.
    pub weights: [[T; CELLS]; FACTORS],
}

impl<T: Real, const CELLS: usize> Readout<T, CELLS> {
    /// A readout of nothing but zeros.
    pub fn zero() -> Self {
        Self { bias: [T::zero(); FACTORS], weights: [[T::zero(); CELLS]; FACTORS] }
    }

    /// The sums, to be squashed into the factors' bounds.
    #[inline]
    pub fn read(&self, output: &[T; CELLS]) -> [T; FACTORS] {
        let mut sums = self.bias;
        for (sum, weights) in sums.iter_mut().zip(&self.weights) {
            for (weight, output) in weights.iter().zip(output) {
                *sum = sum.plus_product(*weight, *output);
            }
        }
        sums
    }

    /// The same in another number.
    pub fn map<R: Real>(&self, f: impl Fn(T) -> R) -> Readout<R, CELLS> {
        Readout { bias: self.bias.map(&f), weights: self.weights.map(|row| row.map(&f)) }
    }

    fn rows(&self) -> impl Iterator<Item = impl Iterator<Item = T> + '_> {
        self.bias.iter().zip(&self.weights).map(|(bias, row)| core::iter::once(*bias).chain(*row))
    }

    /// The largest sum of the magnitudes of a factor's weights.
    pub(super) fn largest_sum(&self) -> f64 {
        largest(self.rows().map(|row| row.map(|weight| weight.value().abs()).sum()))
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
