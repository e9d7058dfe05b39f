//! The fields of a network in its record ([`crate::network::record`]).

use super::{Head, NUMBERS_AT, RecordError, WEIGHTS};
use crate::network::{
    CELLS, FACTOR_COUNT, FactorBounds, InputRange, InputSource, JointNetwork, Lstm, MAX_INPUTS,
    Network, Readout, StrokeRange,
};
use heapless::Vec;

/// Number of an unused input.
const NO_FEED: u8 = 0xFF;
/// Choice: the record has a stroke range.
const HAS_STROKES: u8 = 1;
const _: () = assert!(WEIGHTS == Network::<f32, MAX_INPUTS, CELLS>::WEIGHTS);

/// Writes what follows the length.
pub fn put_network(network: &JointNetwork, put: &mut impl FnMut(&[u8])) {
    let JointNetwork { feeds, period_s, strokes, network } = network;
    put(&[feeds.len() as u8, CELLS as u8, strokes.is_some().into(), 0]);
    let mut codes = [NO_FEED; MAX_INPUTS];
    for (code, feed) in codes.iter_mut().zip(feeds) {
        *code = feed.number().unwrap_or(NO_FEED);
    }
    put(&codes);
    let strokes = strokes.map_or([0.0; 3], |range| [range.least, range.most, range.reversal]);
    let mut number = |value: f32| put(&value.to_le_bytes());
    [*period_s, network.slew, network.fade].into_iter().chain(strokes).for_each(&mut number);
    network.bounds.iter().flat_map(|b| [b.least, b.most]).for_each(&mut number);
    network.inputs.iter().flat_map(|r| [r.middle, r.per_unit]).for_each(&mut number);
    network.for_each_weight(number);
}

/// Reads a network behind a valid header.
pub fn read_network(guarded: &[u8], head: Head) -> Result<Option<JointNetwork>, RecordError> {
    let Head { inputs, cells, choices } = head;
    if usize::from(inputs) > MAX_INPUTS {
        return Err(RecordError::Size(inputs));
    }
    if usize::from(cells) != CELLS {
        return Err(RecordError::Size(cells));
    }
    if choices & !HAS_STROKES != 0 {
        return Err(RecordError::UnknownChoices(choices));
    }
    let mut feeds = Vec::new();
    for code in guarded.iter().skip(12).take(usize::from(inputs)) {
        let feed = InputSource::from_number(*code).ok_or(RecordError::UnknownFeed(*code))?;
        let _ = feeds.push(feed);
    }
    let words = guarded.get(NUMBERS_AT..).unwrap_or_default().as_chunks::<4>().0;
    let mut numbers = words.iter().map(|word| f32::from_le_bytes(*word));
    let mut next = || numbers.next().unwrap_or_default();
    let period_s = next();
    let (slew, fade) = (next(), next());
    let (least, most, reversal) = (next(), next(), next());
    let strokes =
        (choices & HAS_STROKES != 0).then_some(StrokeRange { least, most, reversal, period_s });
    let bounds = [(); FACTOR_COUNT].map(|()| {
        let (least, most) = (next(), next());
        FactorBounds { least, most }
    });
    let inputs = [(); MAX_INPUTS].map(|()| {
        let (middle, per_unit) = (next(), next());
        InputRange { middle, per_unit }
    });
    let mut network =
        Network { inputs, lstm: Lstm::zero(), readout: Readout::zero(), bounds, slew, fade };
    network.set_weights(numbers);
    let network = JointNetwork { feeds, period_s, strokes, network };
    network.validate()?;
    Ok(Some(network))
}
