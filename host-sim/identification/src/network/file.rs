//! `network.json`: a trained network as a file.
//!
//! ```json
//! {
//!   "schema": 1, "cells": 8,
//!   "inputs": ["tension_n", "velocity", "held"],
//!   "ranges": [{"middle": 200.0, "per_unit": 0.0066}, ..],
//!   "factors": [{"factor": "coulomb", "least": 0.2, "most": 2.5}, ..],
//!   "slew": 0.5, "fade": 0.03125, "evaluation_period_s": 0.0078125,
//!   "strokes": {"least": 0.01, "most": 0.03, "reversal": 0.0005},
//!   "weights": [..],
//!   "base": {"model": "lugre-asymmetric", "params": "params.toml"}, "training": {..}
//! }
//! ```
//!
//! Inputs are `velocity`, `held` (the torque the law's bristles hold), and columns of the log by name. Ranges are in
//! the columns' units: the middle, and one over half the width. Weights are in the order of
//! [`Network::for_each_weight`]. `params.toml` beside it names this file with its checksum ([`checksum`]).

use compensator_core::network::{
    FactorBounds, Feed, InputRange, JointNetwork, Lstm, MOST_INPUTS, Network, Readout, StrokeRange,
};
use compensator_core::{JointKind, Quantity};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Cells of the recurrent layer.
pub const CELLS: usize = 8;

/// A network of any number of inputs up to [`MOST_INPUTS`]; what is not used weighs nothing.
pub type Widened = Network<f64, MOST_INPUTS, CELLS>;

/// The law a network's factors multiply.
pub const BASE: &str = "lugre-asymmetric";

const FACTOR_NAMES: [&str; 3] = ["coulomb", "static", "stiffness"];

/// What a `network.json` holds.
#[derive(Clone, Debug)]
pub struct NetworkFile {
    /// What its inputs are fed with, by name.
    pub inputs: Vec<String>,
    /// Ranges (in the columns' units), weights, bounds and rates.
    pub network: Widened,
    /// Time from one evaluation to the next, s.
    pub period_s: f64,
    /// The strokes it was trained on, where those are watched.
    pub strokes: Option<StrokeRange<f64>>,
}

#[derive(Serialize, Deserialize)]
struct Range {
    middle: f64,
    per_unit: f64,
}

#[derive(Serialize, Deserialize)]
struct Bounds {
    factor: String,
    least: f64,
    most: f64,
}

#[derive(Serialize, Deserialize)]
struct Strokes {
    least: f64,
    most: f64,
    reversal: f64,
}

/// The text, field by field. What is said of training and of the base is for people.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    schema: u32,
    cells: usize,
    inputs: Vec<String>,
    ranges: Vec<Range>,
    factors: Vec<Bounds>,
    slew: f64,
    fade: f64,
    evaluation_period_s: f64,
    #[serde(default)]
    strokes: Option<Strokes>,
    weights: Vec<f64>,
    #[serde(default)]
    base: Value,
    #[serde(default)]
    training: Value,
}

/// CRC-32 (ISO-HDLC) of a file's bytes, as `params.toml` has it: eight digits.
pub fn checksum(bytes: &[u8]) -> String {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    format!("{:08x}", crc.checksum(bytes))
}

impl NetworkFile {
    /// The text of the file; `training` is said beside it.
    pub fn emit(&self, training: Value) -> String {
        let Self { inputs, network, period_s, strokes } = self;
        let used = inputs.len();
        let written = Written {
            schema: 1,
            cells: CELLS,
            inputs: inputs.clone(),
            ranges: network.inputs[..used]
                .iter()
                .map(|range| Range { middle: range.middle, per_unit: range.per_unit })
                .collect(),
            factors: FACTOR_NAMES
                .iter()
                .zip(&network.bounds)
                .map(|(name, bounds)| Bounds {
                    factor: (*name).into(),
                    least: bounds.least,
                    most: bounds.most,
                })
                .collect(),
            slew: network.slew,
            fade: network.fade,
            evaluation_period_s: *period_s,
            strokes: strokes.map(|range| Strokes {
                least: range.least,
                most: range.most,
                reversal: range.reversal,
            }),
            weights: weights(network, used),
            base: json!({"model": BASE, "params": "params.toml"}),
            training,
        };
        serde_json::to_string_pretty(&written).expect("numbers and names") + "\n"
    }

    /// Reads and validates the text of a file.
    ///
    /// # Errors
    /// One line: what was found, what was expected, and where; or the core's own refusal.
    pub fn parse(text: &str) -> Result<Self, String> {
        let written: Written = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if written.schema != 1 {
            return Err(format!("schema: found {}, expected 1", written.schema));
        }
        if written.cells != CELLS {
            return Err(format!("cells: found {}, expected {CELLS}", written.cells));
        }
        let used = written.inputs.len();
        if !(1..=MOST_INPUTS).contains(&used) {
            return Err(format!("inputs: found {used}, expected 1 to {MOST_INPUTS}"));
        }
        for (name, found, expected) in [
            ("ranges", written.ranges.len(), used),
            ("factors", written.factors.len(), FACTOR_NAMES.len()),
            ("weights", written.weights.len(), count(used)),
        ] {
            if found != expected {
                return Err(format!(
                    "{name}: found {found}, expected {expected} for {used} inputs"
                ));
            }
        }
        let named = written.factors.iter().map(|bounds| bounds.factor.as_str());
        if let Some((found, expected)) = named.zip(FACTOR_NAMES).find(|(one, other)| one != other) {
            return Err(format!("factors: found {found:?}, expected {expected:?}"));
        }
        let bounds = |place: usize| {
            let Bounds { least, most, .. } = written.factors[place];
            FactorBounds { least, most }
        };
        let range = |place: usize| match written.ranges.get(place) {
            Some(range) => InputRange { middle: range.middle, per_unit: range.per_unit },
            None => InputRange { middle: 0.0, per_unit: 1.0 },
        };
        let mut network = Network {
            inputs: std::array::from_fn(range),
            lstm: Lstm::zero(),
            readout: Readout::zero(),
            bounds: std::array::from_fn(bounds),
            slew: written.slew,
            fade: written.fade,
        };
        set_weights(&mut network, used, &written.weights);
        network.validate().map_err(|error| error.to_string())?;
        let period_s = written.evaluation_period_s;
        let strokes = written.strokes.map(|range| StrokeRange {
            least: range.least,
            most: range.most,
            reversal: range.reversal,
            period_s,
        });
        Ok(Self { inputs: written.inputs, network, period_s, strokes })
    }

    /// The network as a driver takes it: in `f32`, its inputs by what a driver reads. A column that has no place of
    /// its own in the driver comes as its auxiliary covariate; there is one of those.
    ///
    /// # Errors
    /// One line: an input no driver can feed, or the core's refusal.
    pub fn for_driver(&self) -> Result<JointNetwork, String> {
        let mut feeds = heapless::Vec::new();
        let mut own: Option<&str> = None;
        let mut network = self.network.clone();
        for (name, range) in self.inputs.iter().zip(&mut network.inputs) {
            let feed = match name.as_str() {
                "held" => Feed::Held,
                "velocity" => Feed::Of(Quantity::Velocity),
                name => match Quantity::parse(name).map(|(quantity, _)| Feed::Of(quantity)) {
                    Some(feed) if feed.number().is_some() => feed,
                    Some(_) => return Err(format!("inputs: a driver has no reading of {name:?}")),
                    None => {
                        if let Some(other) = own.replace(name) {
                            return Err(format!(
                                "inputs: {other:?} and {name:?} are columns of this log's own, and a driver has one place \
                                 for such, its auxiliary covariate"
                            ));
                        }
                        Feed::Of(Quantity::Auxiliary)
                    }
                },
            };
            if let Feed::Of(quantity) = feed {
                range.middle *= quantity.info().inside_scale;
                range.per_unit /= quantity.info().inside_scale;
            }
            // No more than there are places.
            let _ = feeds.push(feed);
        }
        let strokes = self.strokes.map(|range| StrokeRange {
            least: range.least as f32,
            most: range.most as f32,
            reversal: range.reversal as f32,
            period_s: self.period_s as f32,
        });
        let joint = JointNetwork {
            feeds,
            period_s: self.period_s as f32,
            strokes,
            network: network.convert(),
        };
        joint.validate().map_err(|error| error.to_string())?;
        Ok(joint)
    }

    /// The file of a driver's network: read back and taken for a driver, it is the same network to the bit.
    pub fn of_driver(joint: &JointNetwork, kind: JointKind) -> Self {
        let mut network: Widened = joint.network.convert();
        let mut inputs = Vec::new();
        for (feed, range) in joint.feeds.iter().zip(&mut network.inputs) {
            inputs.push(match feed {
                Feed::Held => "held".to_owned(),
                Feed::Of(Quantity::Velocity) => "velocity".to_owned(),
                Feed::Of(quantity) => quantity.name(kind).to_owned(),
            });
            if let Feed::Of(quantity) = feed {
                range.middle /= quantity.info().inside_scale;
                range.per_unit *= quantity.info().inside_scale;
            }
        }
        let strokes = joint.strokes.map(|range| StrokeRange {
            least: range.least.into(),
            most: range.most.into(),
            reversal: range.reversal.into(),
            period_s: range.period_s.into(),
        });
        Self { inputs, network, period_s: joint.period_s.into(), strokes }
    }
}

/// How many weights a network of so many inputs has.
fn count(used: usize) -> usize {
    match used {
        1 => Network::<f64, 1, CELLS>::WEIGHTS,
        2 => Network::<f64, 2, CELLS>::WEIGHTS,
        3 => Network::<f64, 3, CELLS>::WEIGHTS,
        _ => Network::<f64, MOST_INPUTS, CELLS>::WEIGHTS,
    }
}

/// Whether each weight of a widened network, in its order, is one of the inputs in use.
fn in_use(used: usize) -> impl Iterator<Item = bool> {
    // A cell is a bias, the inputs and the cells, each for four gates; behind the cells comes the readout.
    let cell = move |row: usize| !(1 + used..1 + MOST_INPUTS).contains(&row);
    let rows = (0..CELLS).flat_map(move |_| (0..1 + MOST_INPUTS + CELLS).map(cell));
    rows.flat_map(|is_used| [is_used; 4]).chain(std::iter::repeat(true))
}

fn weights(network: &Widened, used: usize) -> Vec<f64> {
    let mut all = Vec::new();
    network.for_each_weight(|weight| all.push(weight));
    all.into_iter().zip(in_use(used)).filter_map(|(weight, used)| used.then_some(weight)).collect()
}

fn set_weights(network: &mut Widened, used: usize, weights: &[f64]) {
    let mut given = weights.iter().copied();
    let spread = in_use(used).map(|used| if used { given.next().unwrap_or_default() } else { 0.0 });
    network.set_weights(spread.take(Widened::WEIGHTS));
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::network::reference;

    fn file() -> NetworkFile {
        let network = reference::network::<f64>().widened();
        NetworkFile {
            inputs: ["tension_n", "velocity", "held"].map(str::to_owned).into(),
            network,
            period_s: 1.0 / 128.0,
            strokes: Some(StrokeRange {
                least: 0.01,
                most: 1.0,
                reversal: 5e-4,
                period_s: 1.0 / 128.0,
            }),
        }
    }

    #[test]
    fn a_file_is_read_as_it_was_written() {
        let file = file();
        let text = file.emit(json!({"passes": 3}));
        let read = NetworkFile::parse(&text).unwrap();
        assert_eq!((&read.inputs, &read.network), (&file.inputs, &file.network));
        assert_eq!((read.period_s, read.strokes), (file.period_s, file.strokes));
        // Three inputs have the weights of three, in the core's order.
        let mut three = Vec::new();
        reference::network::<f64>().for_each_weight(|weight| three.push(weight));
        assert_eq!(weights(&file.network, 3), three);
        assert_eq!(three.len(), count(3));
    }

    #[test]
    fn a_driver_s_network_comes_back_to_the_bit() {
        let joint = file().for_driver().unwrap();
        assert_eq!(joint, reference::joint());
        let back = NetworkFile::of_driver(&joint, JointKind::Revolute);
        assert_eq!(back.inputs, ["auxiliary", "velocity", "held"]);
        let text = back.emit(Value::Null);
        assert_eq!(NetworkFile::parse(&text).unwrap().for_driver().unwrap(), joint);
        // In the unit inside: MPa.
        let mut pressure = file();
        pressure.inputs[0] = "pressure_diff_pa".into();
        pressure.network.inputs[0] = InputRange::new(1e6, 3e6, 0.0);
        let joint = pressure.for_driver().unwrap();
        assert!((joint.network.inputs[0].middle - 2.0).abs() < 1e-6);
        assert!((joint.network.inputs[0].per_unit - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let good = file().emit(Value::Null);
        for (from, to, word) in [
            ("\"schema\": 1", "\"schema\": 2", "schema: found 2"),
            ("\"cells\": 8", "\"cells\": 9", "cells: found 9"),
            ("\"held\"\n", "\"held\", \"kp\", \"kd\"\n", "inputs: found 5, expected 1 to 4"),
            ("\"held\"\n", "\"held\", \"kp\"\n", "ranges: found 3, expected 4"),
            (
                "\"factor\": \"static\"",
                "\"factor\": \"viscous\"",
                "found \"viscous\", expected \"static\"",
            ),
            ("\"slew\": 0.5", "\"slew\": 0.0", "network_slew = 0"),
            ("\"slew\"", "\"slow\"", "unknown field `slow`"),
            ("\"weights\": [", "\"weights\": [0.5,", "weights: found 412, expected 411"),
            ("\"weights\"", "\"weights", "line "),
        ] {
            let error = NetworkFile::parse(&good.replacen(from, to, 1)).unwrap_err();
            assert!(error.contains(word), "{from} -> {to}: {error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        let fed = |names: [&str; 3]| {
            let mut file = file();
            file.inputs = names.map(str::to_owned).into();
            file.for_driver().unwrap_err()
        };
        assert!(fed(["kp", "kd", "held"]).contains("\"kp\" and \"kd\""));
        assert!(fed(["time_s", "velocity", "held"]).contains("no reading of \"time_s\""));
    }
}
