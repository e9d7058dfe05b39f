//! A network for a joint driver: the source of each input, the evaluation period and the weights.
//!
//! The size is fixed, because a driver reserves memory for one network: [`MAX_INPUTS`] inputs and [`CELLS`] cells.
//! [`Network::widened`] extends a smaller network. An unused input reads the middle of its range, which the cells
//! receive as 0, so the factors do not change.
//!
//! [`JointNetwork`] is the form in files and records, in `f32`. [`FactorSupplier`] is built from it and computes the
//! factors for a compensator.

use super::{CELLS, Factors, MAX_INPUTS, Network, NetworkState, StrokeRange, StrokeTracker};
use crate::number::Real;
use crate::parameters::{LawKind, Parameters};
use crate::quantity::{Inputs, Quantity};
use crate::refusal::Text;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;

/// Source of a network input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputSource {
    /// A reading of the joint, in the internal unit ([`Inputs`]).
    Of(Quantity),
    /// The torque held by the bristles, which is the state of the law, Nm.
    Held,
}

impl InputSource {
    /// Number of [`InputSource::Held`] in records. A quantity has the number of its column.
    const HELD: u8 = 0xFE;

    /// Returns the number in records, which must never change. Returns `None` for a quantity that no driver reads.
    pub fn number(self) -> Option<u8> {
        match self {
            Self::Held => Some(Self::HELD),
            // A driver counts the hours itself, and no network is trained on them.
            Self::Of(Quantity::CampaignTime) => None,
            Self::Of(quantity) => quantity.column(),
        }
    }

    /// Returns the source with this number in records.
    pub fn from_number(number: u8) -> Option<Self> {
        let quantities = Quantity::ALL.iter().map(|quantity| Self::Of(*quantity));
        quantities.chain([Self::Held]).find(|source| source.number() == Some(number))
    }

    /// Returns the name in files, for a revolute joint: `held`, or the name of a log column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Of(quantity) => quantity.info().names[0],
        }
    }
}

/// A network for a joint driver.
#[derive(Clone, Debug, PartialEq)]
pub struct JointNetwork {
    /// Sources of the inputs. Inputs after the last source are unused.
    pub feeds: heapless::Vec<InputSource, MAX_INPUTS>,
    /// Evaluation period, s, as in training.
    pub period_s: f32,
    /// Strokes of the training data. `None` if every stroke counts as known.
    pub strokes: Option<StrokeRange<f32>>,
    /// Ranges, weights, bounds and rates of change.
    pub network: Network<f32, MAX_INPUTS, CELLS>,
}

/// Valid range of the evaluation period, s.
const PERIOD_RANGE_S: [f32; 2] = [1e-4, 10.0];

impl JointNetwork {
    /// Checks that a driver can run the network.
    ///
    /// # Errors
    /// Names the first invalid field.
    pub fn validate(&self) -> Result<(), ParameterError> {
        if self.feeds.is_empty() {
            refuse(
                text!("network_inputs"),
                0.0,
                Bound::AtLeast(1.0),
                text!("a network needs an input"),
            )?;
        }
        between(
            text!("network_period_s"),
            self.period_s,
            PERIOD_RANGE_S,
            text!("the evaluation period"),
        )?;
        if let Some(strokes) = &self.strokes {
            let largest = f32::MAX;
            let least = strokes.least;
            between(
                text!("network_stroke_least"),
                strokes.least,
                [0.0, largest],
                text!("a length"),
            )?;
            let why = text!("it is at least the shortest stroke");
            between(text!("network_stroke_most"), strokes.most, [least, largest], why)?;
            let tiny = f32::MIN_POSITIVE;
            let why = text!("noise is not a reversal");
            between(text!("network_stroke_reversal"), strokes.reversal, [tiny, largest], why)?;
        }
        self.network.validate()
    }

    /// Checks that the model accepts factors.
    ///
    /// # Errors
    /// Returns an error if the law is not `lugre-asymmetric` or if the model has terms.
    pub fn validate_with<T: Real>(model: &Parameters<T>) -> Result<(), ParameterError> {
        if model.law == LawKind::LugreAsymmetric && model.terms.is_empty() {
            return Ok(());
        }
        let why = text!("a network supplies lugre-asymmetric without terms, and no other model");
        refuse(text!("network_inputs"), 1.0, Bound::AtMost(0.0), why)
    }
}

fn between(
    field: Text,
    value: f32,
    [least, most]: [f32; 2],
    why: Text,
) -> Result<(), ParameterError> {
    if value.is_nan() || value < least {
        refuse(field, value, Bound::AtLeast(least), why)?;
    }
    if value > most {
        refuse(field, value, Bound::AtMost(most), why)?;
    }
    Ok(())
}

/// A running network: it reads the inputs of a compensator and computes its factors.
#[derive(Clone, Debug)]
pub struct FactorSupplier<T: Real> {
    feeds: heapless::Vec<InputSource, MAX_INPUTS>,
    period_s: f32,
    strokes: Option<StrokeRange<T>>,
    network: Network<T, MAX_INPUTS, CELLS>,
    /// Maximum age of a valid reading, s.
    hold_s: T,
    state: NetworkState<T, CELLS>,
    stroke: StrokeTracker<T>,
}

impl<T: Real<Setting = f32>> FactorSupplier<T> {
    /// Builds the supplier. Readings older than `hold_s` (s) count as missing.
    ///
    /// # Errors
    /// As [`JointNetwork::validate`]. Also if the number type cannot represent a range or a stroke.
    pub fn build(from: &JointNetwork, hold_s: f32) -> Result<Self, ParameterError> {
        from.validate()?;
        for range in from.network.inputs.iter().take(from.feeds.len()) {
            held_by::<T>(text!("network_input_middle"), range.middle)?;
            held_by::<T>(text!("network_input_per_unit"), range.per_unit)?;
        }
        if let Some(strokes) = &from.strokes {
            held_by::<T>(text!("network_stroke_most"), strokes.most)?;
        }
        let strokes = from.strokes.map(|range| StrokeRange { period_s: from.period_s, ..range });
        Ok(Self {
            feeds: from.feeds.clone(),
            period_s: from.period_s,
            strokes: strokes.map(|range| range.convert()),
            network: from.network.convert(),
            hold_s: T::from_f64(f64::from(hold_s)),
            state: NetworkState::default(),
            stroke: StrokeTracker::default(),
        })
    }

    /// Returns the number of samples per evaluation, at least 1, for a sample period in s.
    ///
    /// # Errors
    /// Returns an error if the sample period exceeds 1.25 evaluation periods: the network would run more slowly
    /// than in training.
    pub fn every(&self, sample_period_s: f32) -> Result<u32, ParameterError> {
        let ratio = self.period_s / sample_period_s;
        if ratio < 0.8 {
            let why = text!("samples are farther apart than the evaluations it was trained with");
            let (found, least) = (self.period_s, 0.8 * sample_period_s);
            refuse(text!("network_period_s"), found, Bound::AtLeast(least), why)?;
        }
        // Round by hand: `f32::round` is not in `core`.
        Ok(((ratio + 0.5) as u32).max(1))
    }

    /// Returns the evaluation period, s.
    pub const fn period_s(&self) -> f32 {
        self.period_s
    }

    /// Evaluates the network with the inputs of the joint and the torque held by the bristles (Nm).
    ///
    /// Every bit pattern is valid. A missing or expired reading is replaced by the middle of its range, and the
    /// evaluation then counts as outside the ranges.
    #[inline(never)]
    pub fn evaluate(&mut self, inputs: &Inputs<T>, held_nm: T) -> Factors<T> {
        let mut values = self.network.inputs.each_ref().map(|range| range.middle);
        let mut is_known = true;
        for (value, source) in values.iter_mut().zip(&self.feeds) {
            match source {
                InputSource::Held => *value = held_nm,
                InputSource::Of(quantity) => {
                    let reading = quantity.reading_in(inputs);
                    let missing =
                        reading.age_s.negative_or_nan_mask() | self.hold_s.lt_mask(reading.age_s);
                    is_known &= !missing.is_set();
                    *value = T::select(missing, *value, reading.value);
                }
            }
        }
        if let Some(range) = &self.strokes {
            is_known &= self.stroke.is_known(inputs.velocity_rad_s.value, range);
        }
        self.network.evaluate_guarded(&mut self.state, &values, is_known)
    }

    /// Returns the state: the factors, the share and the count of evaluations outside the ranges.
    pub const fn state(&self) -> &NetworkState<T, CELLS> {
        &self.state
    }

    /// Resets the state and the stroke tracker. The count of evaluations outside the ranges is kept.
    pub fn rest(&mut self) {
        let outside_count = self.state.outside_count;
        self.state = NetworkState { outside_count, ..NetworkState::default() };
        self.stroke = StrokeTracker::default();
    }
}

/// Returns an error if `T` cannot represent the value to 0.1 %, plus an absolute tolerance of 1e-5.
fn held_by<T: Real>(field: Text, value: f32) -> Result<(), ParameterError> {
    let held = T::from_f64(value.into()).single();
    let (size, error) = (libm::fabsf(value), libm::fabsf(held - value));
    if error > 1e-3 * size + 1e-5 {
        refuse(
            field,
            value,
            Bound::AtMost(libm::fabsf(held)),
            text!("the number type cannot represent it"),
        )?;
    }
    Ok(())
}

#[cfg(test)]
#[path = "joint_tests.rs"]
mod tests;
