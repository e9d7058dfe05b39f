//! A small network that supplies parameters to LuGre while it runs: the law `lugre-lstm`.
//!
//! The damper paper lets an LSTM say how large `F_C`, `F_S` and `sigma0` are at the moment. Here it gives
//! *factors* on a fitted law's ([`Factors`]), which the one bristle step takes as it takes any [`crate::effect`]: the
//! law is not written again. [`Network::evaluate`] belongs outside the current loop, at its own rate; the loop reads
//! the last factors, three numbers.
//!
//! What holds for *any* weights and inputs: each factor lies within its bounds and moves by at most `slew` an
//! evaluation, so `|y| <= max g` at the upper bounds. Passivity does not: a stiffness that falls while bristles are bent
//! gives no energy back here (the torque `y` is kept), one that rises under load takes none, so the stored energy
//! `y^2 / 2 sigma0` is not what was put in.
//!
//! [`JointNetwork`] is a network with a home: in a record ([`record`]) and over CAN, fed with a joint's readings.
//!
//! The network knows which inputs it was trained on ([`InputRange`]). Outside of them it says so, counts, and its share
//! fades until the law runs on its constants.

mod activation;
mod augmented;
mod factors;
mod input_range;
mod joint;
mod lstm;
mod readout;
pub mod record;
pub mod reference;
mod stroke;

pub use activation::{sigmoid, squash, squash_slope};
pub use augmented::AugmentedLugre;
pub use factors::{FACTORS, FactorBounds, Factors};
pub use input_range::InputRange;
pub use joint::{CELLS, Feed, JointNetwork, MOST_INPUTS, Supplier};
pub use lstm::{Activations, CELL_LIMIT, Cell, GATES, Hidden, Lstm};
pub use readout::Readout;
pub use stroke::{Stroke, StrokeRange};

use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use core::array;

/// A network built for use: weights, what it may be asked and what it may answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Network<T, const INPUTS: usize, const CELLS: usize> {
    /// Ranges the network was trained on, in the order of its inputs.
    pub inputs: [InputRange<T>; INPUTS],
    /// The recurrent layer.
    pub lstm: Lstm<T, INPUTS, CELLS>,
    /// What is read from its cells.
    pub readout: Readout<T, CELLS>,
    /// Bounds of each factor; they hold 1.
    pub bounds: [FactorBounds<T>; FACTORS],
    /// Most a factor may move in an evaluation.
    pub slew: T,
    /// How much of its share the network loses in an evaluation outside its ranges, and gains inside, 0..=1.
    pub fade: T,
}

/// What a network remembers between evaluations.
#[derive(Clone, Copy, Debug)]
pub struct NetworkState<T, const CELLS: usize> {
    /// The recurrent layer's.
    pub hidden: Hidden<T, CELLS>,
    /// The factors last given.
    pub factors: Factors<T>,
    /// How much the network has to say, 0 (constant parameters) to 1.
    pub share: T,
    /// Whether the last inputs lay outside the ranges.
    pub is_outside: bool,
    /// Evaluations outside the ranges so far; stays at its largest value.
    pub outside_count: u32,
}

impl<T: Real, const CELLS: usize> Default for NetworkState<T, CELLS> {
    fn default() -> Self {
        Self {
            hidden: Hidden::default(),
            factors: Factors::default(),
            share: T::one(),
            is_outside: false,
            outside_count: 0,
        }
    }
}

/// What an evaluation computed on its way.
#[derive(Clone, Copy, Debug)]
pub struct Trace<T, const INPUTS: usize, const CELLS: usize> {
    /// The inputs over their ranges.
    pub scaled: [T; INPUTS],
    /// Of the recurrent layer.
    pub activations: Activations<T, CELLS>,
    /// Sums of the readout.
    pub sums: [T; FACTORS],
    /// Where the factors were to go.
    pub targets: Factors<T>,
}

/// Sum of weights of one gate that is accepted: their products stay within the range of [`crate::Fixed`].
const LARGEST_SUM: f64 = 1000.0;

impl<T: Real, const INPUTS: usize, const CELLS: usize> Network<T, INPUTS, CELLS> {
    /// How many weights there are: those of the gates, then those of the readout.
    pub const WEIGHTS: usize = CELLS * Cell::<T, INPUTS, CELLS>::WEIGHTS + FACTORS * (1 + CELLS);

    /// Takes one evaluation: inputs in their units, which may be any bit pattern, factors out.
    #[inline]
    pub fn evaluate(&self, state: &mut NetworkState<T, CELLS>, inputs: &[T; INPUTS]) -> Factors<T> {
        self.evaluate_where(state, inputs, true)
    }

    /// The same, where the caller knows besides whether this is a motion it was trained on ([`Stroke`]): one that is
    /// not counts as outside.
    #[inline]
    pub fn evaluate_where(
        &self,
        state: &mut NetworkState<T, CELLS>,
        inputs: &[T; INPUTS],
        is_known: bool,
    ) -> Factors<T> {
        self.evaluate_traced(state, inputs, is_known);
        state.factors
    }

    /// The same, and what was computed on the way: for training, which goes back along it.
    #[inline(always)]
    pub fn evaluate_traced(
        &self,
        state: &mut NetworkState<T, CELLS>,
        inputs: &[T; INPUTS],
        is_known: bool,
    ) -> Trace<T, INPUTS, CELLS> {
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
        Trace { scaled, activations, sums, targets }
    }

    /// The inputs as the recurrent layer sees them, -1..=1 over their ranges, and whether one lies outside.
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

    /// The same network in another number.
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

    /// The same with more inputs, which weigh nothing.
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

    /// Hands every weight to `sink`, in the order [`Network::set_weights`] takes them.
    pub fn for_each_weight(&self, mut sink: impl FnMut(T)) {
        self.lstm.for_each(&mut sink);
        self.readout.for_each(&mut sink);
    }

    /// Takes its weights from a list of [`Network::WEIGHTS`]; `false` where it is shorter, and then nothing
    /// is said of the weights.
    pub fn set_weights(&mut self, mut weights: impl Iterator<Item = T>) -> bool {
        let mut next = || weights.next();
        self.lstm.set(&mut next).and_then(|()| self.readout.set(&mut next)).is_some()
    }

    /// Refuses what could leave a number's range or does not say what it should.
    ///
    /// # Errors
    /// Names what is wrong.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for range in &self.inputs {
            range.validate()?;
        }
        for bounds in &self.bounds {
            bounds.validate()?;
        }
        let sum = lstm::largest([self.lstm.largest_sum(), self.readout.largest_sum()].into_iter());
        if sum.is_nan() || sum > LARGEST_SUM {
            let why = "their sum must stay within the range of fixed point";
            refuse("network_weights", sum, Bound::AtMost(LARGEST_SUM), why)?;
        }
        for (field, value) in [("network_slew", self.slew), ("network_fade", self.fade)] {
            let value = value.value();
            if value.is_nan() || value <= 0.0 {
                refuse(field, value, Bound::MoreThan(0.0), "factors must be able to move")?;
            }
            if value > 1.0 {
                refuse(field, value, Bound::AtMost(1.0), "a larger step is none")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
