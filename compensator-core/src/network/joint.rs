//! A network as a joint driver takes it: what each input is fed with, how often it is evaluated, and the weights.
//!
//! A driver has one place for a network, so its size is fixed: [`MOST_INPUTS`] inputs, [`CELLS`] cells. A smaller one is
//! widened ([`Network::widened`]); an input that is not used reads the middle of its range, which is 0 to the cells,
//! so the factors are those of the smaller one. [`JointNetwork`] is what people and records hold, in `f32`;
//! [`Supplier`] is built of it and gives a compensator its factors.

use super::{Factors, Network, NetworkState, Stroke, StrokeRange};
use crate::number::Real;
use crate::parameters::{LawKind, Parameters};
use crate::quantity::{Inputs, Quantity};
use crate::refusal::{Bound, ParameterError, refuse};

/// Most inputs a driver's network has.
pub const MOST_INPUTS: usize = 4;

/// Cells of a driver's network.
pub const CELLS: usize = 8;

/// What an input of a network is fed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feed {
    /// A reading of the joint's, in the unit inside ([`Inputs`]).
    Of(Quantity),
    /// The torque the bristles hold: the law's own state, Nm.
    Held,
}

impl Feed {
    /// What is written for [`Feed::Held`]; quantities have the numbers of their columns.
    const HELD: u8 = 0xFE;

    /// Its number in records, which may never change; `None` of what a driver does not read.
    pub fn number(self) -> Option<u8> {
        match self {
            Self::Held => Some(Self::HELD),
            // A driver counts the hours itself, and a network that drifts with them was never trained on them.
            Self::Of(Quantity::CampaignTime) => None,
            Self::Of(quantity) => quantity.info().column,
        }
    }

    /// The one with this number.
    pub fn from_number(number: u8) -> Option<Self> {
        let quantities = Quantity::ALL.iter().map(|quantity| Self::Of(*quantity));
        quantities.chain([Self::Held]).find(|feed| feed.number() == Some(number))
    }

    /// What it is called in files, of a joint that turns: `held`, or the column of a log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Of(quantity) => quantity.info().names[0],
        }
    }
}

/// A network as a joint driver takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct JointNetwork {
    /// What its inputs are fed with; those behind the last one are not used.
    pub feeds: heapless::Vec<Feed, MOST_INPUTS>,
    /// Time from one evaluation to the next, s: the one it was trained with.
    pub period_s: f32,
    /// Strokes it was trained on; `None` where any counts as known.
    pub strokes: Option<StrokeRange<f32>>,
    /// Ranges, weights, bounds and rates.
    pub network: Network<f32, MOST_INPUTS, CELLS>,
}

/// Legal times from one evaluation to the next, s.
const PERIOD_RANGE_S: [f64; 2] = [1e-4, 10.0];

impl JointNetwork {
    /// Refuses what is no network a driver could run.
    ///
    /// # Errors
    /// Names what is wrong.
    pub fn validate(&self) -> Result<(), ParameterError> {
        if self.feeds.is_empty() {
            refuse("network_inputs", 0.0, Bound::AtLeast(1.0), "it would say the same for ever")?;
        }
        between("network_period_s", self.period_s, PERIOD_RANGE_S, "a time between evaluations")?;
        if let Some(strokes) = &self.strokes {
            let largest = f64::from(f32::MAX);
            let least = f64::from(strokes.least);
            between("network_stroke_least", strokes.least, [0.0, largest], "a length")?;
            let why = "the longest stroke is not the shortest";
            between("network_stroke_most", strokes.most, [least, largest], why)?;
            let tiny = f64::from(f32::MIN_POSITIVE);
            let why = "noise is no reversal";
            between("network_stroke_reversal", strokes.reversal, [tiny, largest], why)?;
        }
        self.network.validate()
    }

    /// Refuses a law that takes no factors.
    ///
    /// # Errors
    /// Another law than `lugre-asymmetric`, or terms beside it.
    pub fn validate_with<T: Real>(model: &Parameters<T>) -> Result<(), ParameterError> {
        if model.law == LawKind::LugreAsymmetric && model.terms.is_empty() {
            return Ok(());
        }
        let why = "a network supplies lugre-asymmetric without terms, and no other model";
        refuse("network_inputs", 1.0, Bound::AtMost(0.0), why)
    }
}

fn between(
    field: &'static str,
    value: f32,
    [least, most]: [f64; 2],
    why: &'static str,
) -> Result<(), ParameterError> {
    let value = f64::from(value);
    if value.is_nan() || value < least {
        refuse(field, value, Bound::AtLeast(least), why)?;
    }
    if value > most {
        refuse(field, value, Bound::AtMost(most), why)?;
    }
    Ok(())
}

/// A network at work: it reads what a compensator reads, and gives it factors.
#[derive(Clone, Debug)]
pub struct Supplier<T: Real> {
    feeds: heapless::Vec<Feed, MOST_INPUTS>,
    period_s: f32,
    strokes: Option<StrokeRange<T>>,
    network: Network<T, MOST_INPUTS, CELLS>,
    /// A reading is good for this long, s.
    hold_s: T,
    state: NetworkState<T, CELLS>,
    stroke: Stroke<T>,
}

impl<T: Real<Setting = f32>> Supplier<T> {
    /// Builds it; readings older than `hold_s` (s) count as missing.
    ///
    /// # Errors
    /// As [`JointNetwork::validate`]; a range or stroke the number has no room for.
    pub fn build(from: &JointNetwork, hold_s: f32) -> Result<Self, ParameterError> {
        from.validate()?;
        for range in from.network.inputs.iter().take(from.feeds.len()) {
            held_by::<T>("network_input_middle", range.middle)?;
            held_by::<T>("network_input_per_unit", range.per_unit)?;
        }
        let number = |value: f32| T::from_f64(f64::from(value));
        let strokes = match &from.strokes {
            None => None,
            Some(strokes) => {
                held_by::<T>("network_stroke_most", strokes.most)?;
                Some(StrokeRange {
                    least: number(strokes.least),
                    most: number(strokes.most),
                    reversal: number(strokes.reversal),
                    period_s: number(from.period_s),
                })
            }
        };
        Ok(Self {
            feeds: from.feeds.clone(),
            period_s: from.period_s,
            strokes,
            network: from.network.convert(),
            hold_s: number(hold_s),
            state: NetworkState::default(),
            stroke: Stroke::default(),
        })
    }

    /// How many samples of this period (s) go from one evaluation to the next, at least one.
    ///
    /// # Errors
    /// Samples farther apart than a quarter over the time between evaluations: the network would run slower than trained.
    pub fn every(&self, sample_period_s: f32) -> Result<u32, ParameterError> {
        let ratio = self.period_s / sample_period_s;
        if ratio < 0.8 {
            let why = "samples are farther apart than the evaluations it was trained with";
            let (found, least) = (f64::from(self.period_s), 0.8 * f64::from(sample_period_s));
            refuse("network_period_s", found, Bound::AtLeast(least), why)?;
        }
        // Rounded: `f32::round` is not in core.
        Ok(((ratio + 0.5) as u32).max(1))
    }

    /// Time from one evaluation to the next, s.
    pub const fn period_s(&self) -> f32 {
        self.period_s
    }

    /// One evaluation, on what is known of the joint and the torque its bristles hold (Nm); any bit pattern is
    /// legal. A reading that is missing or too old counts as outside of the range, and as its middle.
    #[inline(never)]
    pub fn evaluate(&mut self, inputs: &Inputs<T>, held_nm: T) -> Factors<T> {
        let mut fed = self.network.inputs.each_ref().map(|range| range.middle);
        let mut is_known = true;
        for (place, feed) in fed.iter_mut().zip(&self.feeds) {
            match feed {
                Feed::Held => *place = held_nm,
                Feed::Of(quantity) => {
                    let reading = quantity.of_inputs(inputs);
                    let missing =
                        reading.age_s.negative_or_nan_mask() | self.hold_s.lt_mask(reading.age_s);
                    is_known &= !missing.is_set();
                    *place = T::select(missing, *place, reading.value);
                }
            }
        }
        if let Some(range) = &self.strokes {
            is_known &= self.stroke.is_known(inputs.velocity_rad_s.value, range);
        }
        self.network.evaluate_where(&mut self.state, &fed, is_known)
    }

    /// What it remembers: its factors, its share, the guard of its inputs.
    pub const fn state(&self) -> &NetworkState<T, CELLS> {
        &self.state
    }

    /// Forgets the motion so far, and what it said; the count of evaluations outside stays.
    pub fn rest(&mut self) {
        let outside_count = self.state.outside_count;
        self.state = NetworkState { outside_count, ..NetworkState::default() };
        self.stroke = Stroke::default();
    }
}

/// Refuses what the number `T` would hold as another by more than a thousandth.
fn held_by<T: Real>(field: &'static str, value: f32) -> Result<(), ParameterError> {
    let value = f64::from(value);
    let held = T::from_f64(value).value();
    let (size, apart) = (libm::fabs(value), libm::fabs(held - value));
    if apart > 1e-3 * size + 1e-5 {
        refuse(
            field,
            value,
            Bound::AtMost(libm::fabs(held)),
            "the number it computes with has no room",
        )?;
    }
    Ok(())
}

#[cfg(test)]
#[path = "joint_tests.rs"]
mod tests;
