//! The recurrent network: an LSTM and its readout, with bounded factors as output.
//!
//! For *any* weights and inputs, each factor stays within its bounds and changes by at most `slew` per evaluation.
//! Therefore `|y| <= max g` holds with the upper bounds. Passivity is not guaranteed: the torque `y` is kept when
//! the stiffness changes, so the stored energy `y^2 / 2 sigma0` differs from the energy supplied.
//!
//! [`JointNetwork`] adds the input sources and the period, for records ([`super::record`]) and for transfer over CAN.
//!
//! [`InputRange`] holds the range of each input during training. Outside these ranges the network sets a flag and
//! counts the evaluation. Its share fades until the law runs on its constant parameters.

mod activation;
mod augmented;
mod factor_bounds;
mod input_range;
mod joint;
mod lstm;
mod readout;
#[cfg(test)]
#[path = "../../../tests/reference_network.rs"]
pub(super) mod reference;
mod stroke;

pub use activation::{sigmoid, squash, squash_slope};
pub use augmented::AugmentedLugre;
pub use factor_bounds::FactorBounds;
pub use input_range::InputRange;
pub use joint::{FactorSupplier, InputSource, JointNetwork};
pub use lstm::{CELL_LIMIT, GATES, Lstm, LstmActivations, LstmCell, LstmState};
pub use readout::Readout;
pub use stroke::{StrokeRange, StrokeTracker};

use super::{CELLS, FACTOR_COUNT, Factors, MAX_INPUTS};
use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;
use core::array;

/// A trained network: input ranges, weights and limits of the factors.
#[derive(Clone, Debug, PartialEq)]
pub struct Network<T, const INPUTS: usize, const CELLS: usize> {
    /// Ranges the network was trained on, in the order of its inputs.
    pub inputs: [InputRange<T>; INPUTS],
    /// The recurrent layer.
    pub lstm: Lstm<T, INPUTS, CELLS>,
    /// The output layer.
    pub readout: Readout<T, CELLS>,
    /// Bounds of each factor. Every interval contains 1.
    pub bounds: [FactorBounds<T>; FACTOR_COUNT],
    /// Maximum change of a factor per evaluation.
    pub slew: T,
    /// Change of the share per evaluation, 0..=1: a decrease outside the ranges, an increase inside.
    pub fade: T,
}

/// State of a network between evaluations.
#[derive(Clone, Copy, Debug)]
pub struct NetworkState<T, const CELLS: usize> {
    /// State of the recurrent layer.
    pub hidden: LstmState<T, CELLS>,
    /// Factors of the last evaluation.
    pub factors: Factors<T>,
    /// Share of the network in the factors, from 0 (constant parameters) to 1.
    pub share: T,
    /// True if the last inputs were outside the ranges.
    pub is_outside: bool,
    /// Number of evaluations outside the ranges; saturates.
    pub outside_count: u32,
}

impl<T: Real, const CELLS: usize> Default for NetworkState<T, CELLS> {
    fn default() -> Self {
        Self {
            hidden: LstmState::default(),
            factors: Factors::default(),
            share: T::one(),
            is_outside: false,
            outside_count: 0,
        }
    }
}

/// Intermediate values of an evaluation, for training.
#[derive(Clone, Copy, Debug)]
pub struct NetworkTrace<T, const INPUTS: usize, const CELLS: usize> {
    /// Scaled inputs, -1..=1.
    pub scaled: [T; INPUTS],
    /// Intermediate values of the recurrent layer.
    pub activations: LstmActivations<T, CELLS>,
    /// Output sums of the readout.
    pub sums: [T; FACTOR_COUNT],
    /// Target factors, before the slew limit.
    pub targets: Factors<T>,
}

/// Maximum sum of the magnitudes of one gate's weights. It keeps the products within the range of [`crate::Fixed`].
const LARGEST_SUM: f32 = 1000.0;

impl<T: Real, const INPUTS: usize, const CELLS: usize> Network<T, INPUTS, CELLS> {
    /// Number of weights: first those of the gates, then those of the readout.
    pub const WEIGHTS: usize =
        CELLS * LstmCell::<T, INPUTS, CELLS>::WEIGHTS + FACTOR_COUNT * (1 + CELLS);

    /// Evaluates the network once and returns the factors. Inputs are in their own units; any bit pattern is valid.
    #[inline]
    pub fn evaluate(&self, state: &mut NetworkState<T, CELLS>, inputs: &[T; INPUTS]) -> Factors<T> {
        self.evaluate_guarded(state, inputs, true)
    }

    /// Evaluates as [`Network::evaluate`]. If `is_known` is false, the evaluation counts as outside the ranges.
    ///
    /// The caller sets `is_known` to false for a motion that training did not contain ([`StrokeTracker`]).
    #[inline]
    pub fn evaluate_guarded(
        &self,
        state: &mut NetworkState<T, CELLS>,
        inputs: &[T; INPUTS],
        is_known: bool,
    ) -> Factors<T> {
        self.evaluate_traced(state, inputs, is_known);
        state.factors
    }

    /// Evaluates as [`Network::evaluate_guarded`] and returns the intermediate values for back-propagation.
    #[inline(always)]
    pub fn evaluate_traced(
        &self,
        state: &mut NetworkState<T, CELLS>,
        inputs: &[T; INPUTS],
        is_known: bool,
    ) -> NetworkTrace<T, INPUTS, CELLS> {
        let (scaled, beyond_range) = self.scaled(inputs);
        let is_outside = beyond_range || !is_known;
        state.is_outside = is_outside;
        state.outside_count = state.outside_count.saturating_add(u32::from(is_outside));
        let change = if is_outside { -self.fade } else { self.fade };
        state.share = (state.share + change).at_most(T::one()).at_least(T::zero());
        let activations = self.lstm.step(&mut state.hidden, &scaled);
        let sums = self.readout.read(&state.hidden.output);
        let targets = Factors::within(sums, &self.bounds).faded(state.share);
        let before = state.factors;
        state.factors = before.towards(targets, self.slew);
        NetworkTrace { scaled, activations, sums, targets }
    }

    /// Returns the inputs scaled to -1..=1 over their ranges, and true if any input is outside its range.
    #[inline]
    pub fn scaled(&self, inputs: &[T; INPUTS]) -> ([T; INPUTS], bool) {
        let mut scaled = [T::zero(); INPUTS];
        let mut is_outside = false;
        for ((scaled, range), input) in scaled.iter_mut().zip(&self.inputs).zip(inputs) {
            let (value, outside) = range.scaled(*input);
            *scaled = value;
            is_outside |= outside;
        }
        (scaled, is_outside)
    }

    /// Converts the network to another number type.
    pub fn convert<R: Real>(&self) -> Network<R, INPUTS, CELLS> {
        let number = |value: T| R::from_f64(value.value());
        Network {
            inputs: self.inputs.each_ref().map(|range| range.convert()),
            lstm: self.lstm.map(number),
            readout: self.readout.map(number),
            bounds: self.bounds.map(|bounds| bounds.convert()),
            slew: number(self.slew),
            fade: number(self.fade),
        }
    }

    /// Returns the network with additional inputs whose weights are 0.
    #[must_use]
    pub fn widened<const MORE: usize>(&self) -> Network<T, MORE, CELLS> {
        const { assert!(MORE >= INPUTS, "inputs would be lost") };
        let unused = InputRange { middle: T::zero(), per_unit: T::one() };
        Network {
            inputs: array::from_fn(|input| self.inputs.get(input).copied().unwrap_or(unused)),
            lstm: self.lstm.widened(),
            readout: self.readout.clone(),
            bounds: self.bounds,
            slew: self.slew,
            fade: self.fade,
        }
    }

    /// Calls `sink` with every weight, in the order of [`Network::set_weights`].
    pub fn for_each_weight(&self, mut sink: impl FnMut(T)) {
        self.lstm.for_each(&mut sink);
        self.readout.for_each(&mut sink);
    }

    /// Sets the weights from a list of [`Network::WEIGHTS`] values.
    ///
    /// Returns false if the list is shorter. The weights are then unspecified.
    pub fn set_weights(&mut self, mut weights: impl Iterator<Item = T>) -> bool {
        let mut next = || weights.next();
        self.lstm.set(&mut next).and_then(|()| self.readout.set(&mut next)).is_some()
    }

    /// Checks that every value is in its valid range and that no number type can overflow.
    ///
    /// # Errors
    /// Names the first invalid field.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for range in &self.inputs {
            range.validate()?;
        }
        for bounds in &self.bounds {
            bounds.validate()?;
        }
        let sum = lstm::largest([self.lstm.largest_sum(), self.readout.largest_sum()].into_iter());
        if sum.is_nan() || sum > LARGEST_SUM {
            let why = text!("their sum must stay within the range of fixed point");
            refuse(text!("network_weights"), sum, Bound::AtMost(LARGEST_SUM), why)?;
        }
        for (field, value) in
            [(text!("network_slew"), self.slew), (text!("network_fade"), self.fade)]
        {
            let value = value.single();
            if value.is_nan() || value <= 0.0 {
                refuse(field, value, Bound::MoreThan(0.0), text!("factors must be able to move"))?;
            }
            if value > 1.0 {
                refuse(field, value, Bound::AtMost(1.0), text!("a change is at most 1"))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
