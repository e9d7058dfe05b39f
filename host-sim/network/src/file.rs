//! The file `network.json` of a trained network.
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
//! Inputs are `velocity`, `held` (the bristle torque of the law), and columns of the log by name. Ranges are in the
//! columns' units: the middle, and the inverse of half the width. Weights are in the order of
//! [`Network::for_each_weight`]. The `params.toml` in the same folder contains the name of this file and its checksum ([`friction_fit::params::checksum`]).

use crate::NetworkError;
pub use compensator_core::network::CELLS;
use compensator_core::network::{
    FactorBounds, InputRange, InputSource, JointNetwork, Lstm, MAX_INPUTS, Network, Readout,
    StrokeRange,
};
use compensator_core::{JointKind, Quantity};
use friction_fit::params::NetworkText;
use serde::Deserialize;
use serde_json::{Value, json};

/// A network with up to [`MAX_INPUTS`] inputs; unused inputs have weights of 0.
pub type WideNetwork = Network<f64, MAX_INPUTS, CELLS>;

/// Name of the model.
pub const MODEL: &str = "lugre-lstm";

/// Name of the law whose parameters the factors multiply.
pub const BASE: &str = "lugre-asymmetric";

const FACTOR_NAMES: [&str; 3] = ["coulomb", "static", "stiffness"];

/// Content of a `network.json`.
#[derive(Clone, Debug)]
pub struct NetworkFile {
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Ranges (in the columns' units), weights, bounds and rates.
    pub network: WideNetwork,
    /// Time between evaluations, s.
    pub period_s: f64,
    /// Range of trained strokes, if strokes are monitored.
    pub strokes: Option<StrokeRange<f64>>,
}

#[derive(Deserialize)]
struct Range {
    middle: f64,
    per_unit: f64,
}

#[derive(Deserialize)]
struct Bounds {
    factor: String,
    least: f64,
    most: f64,
}

#[derive(Deserialize)]
struct Strokes {
    least: f64,
    most: f64,
    reversal: f64,
}

/// Fields of the file. `training` and `base` are information for people.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileFields {
    schema: usize,
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
    #[serde(default, rename = "base")]
    _base: Value,
    #[serde(default, rename = "training")]
    _training: Value,
}

impl NetworkFile {
    /// Returns the text of the file, with `training` as additional information.
    pub fn emit(&self, training: Value) -> String {
        let Self { inputs, network, period_s, strokes } = self;
        let used = inputs.len();
        let ranges = network.inputs[..used].iter();
        let ranges =
            ranges.map(|range| json!({"middle": range.middle, "per_unit": range.per_unit}));
        let factors = FACTOR_NAMES.iter().zip(&network.bounds).map(
            |(name, bounds)| json!({"factor": name, "least": bounds.least, "most": bounds.most}),
        );
        let written = json!({
            "schema": 1,
            "cells": CELLS,
            "inputs": inputs,
            "ranges": ranges.collect::<Vec<_>>(),
            "factors": factors.collect::<Vec<_>>(),
            "slew": network.slew,
            "fade": network.fade,
            "evaluation_period_s": period_s,
            "strokes": strokes.map(|range| {
                json!({"least": range.least, "most": range.most, "reversal": range.reversal})
            }),
            "weights": weights(network, used),
            "base": {"model": BASE, "params": "params.toml"},
            "training": training,
        });
        serde_json::to_string_pretty(&written).expect("numbers and names") + "\n"
    }

    /// Reads the network of a parameter file.
    ///
    /// # Errors
    /// As [`NetworkFile::parse`], with the path.
    pub fn of(NetworkText { path, text }: &NetworkText) -> Result<Self, NetworkError> {
        let failed = |error| NetworkError::File { path: path.clone(), error: Box::new(error) };
        Self::parse(text).map_err(failed)
    }

    /// Reads and validates the text of a file.
    ///
    /// # Errors
    /// The found value, the expected value and the place; or the error of the core's validation.
    pub fn parse(text: &str) -> Result<Self, NetworkError> {
        let written: FileFields = serde_json::from_str(text)?;
        for (field, found, expected) in
            [("schema", written.schema, 1), ("cells", written.cells, CELLS)]
        {
            if found != expected {
                return Err(NetworkError::Number { field, found, expected });
            }
        }
        let used = written.inputs.len();
        if !(1..=MAX_INPUTS).contains(&used) {
            return Err(NetworkError::InputCount(used));
        }
        for (field, found, expected) in [
            ("ranges", written.ranges.len(), used),
            ("factors", written.factors.len(), FACTOR_NAMES.len()),
            ("weights", written.weights.len(), count(used)),
        ] {
            if found != expected {
                return Err(NetworkError::Length { field, found, expected, inputs: used });
            }
        }
        for (bounds, expected) in written.factors.iter().zip(FACTOR_NAMES) {
            if bounds.factor != expected {
                let found = bounds.factor.clone();
                return Err(NetworkError::Factor { found, expected });
            }
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
        network.validate()?;
        let period_s = written.evaluation_period_s;
        if period_s <= 0.0 {
            return Err(NetworkError::EvaluationPeriod(period_s));
        }
        let strokes = written.strokes.map(|range| StrokeRange {
            least: range.least,
            most: range.most,
            reversal: range.reversal,
            period_s,
        });
        Ok(Self { inputs: written.inputs, network, period_s, strokes })
    }

    /// Converts the network for a driver: to `f32`, with inputs as the driver's quantities. A column without a quantity of its
    /// own becomes the auxiliary covariate, of which there is one.
    ///
    /// # Errors
    /// An input that no driver can supply, or the error of the core's validation.
    pub fn for_driver(&self) -> Result<JointNetwork, NetworkError> {
        let mut feeds = heapless::Vec::new();
        let mut custom: Option<&str> = None;
        let mut network = self.network.clone();
        for (name, range) in self.inputs.iter().zip(&mut network.inputs) {
            let feed = match name.as_str() {
                "held" => InputSource::Held,
                "velocity" => InputSource::Of(Quantity::Velocity),
                name => {
                    match Quantity::parse(name).map(|(quantity, _)| InputSource::Of(quantity)) {
                        Some(feed) if feed.number().is_some() => feed,
                        Some(_) => {
                            return Err(NetworkError::NotMeasured(name.to_owned()));
                        }
                        None => {
                            if let Some(other) = custom.replace(name) {
                                let (first, second) = (other.to_owned(), name.to_owned());
                                return Err(NetworkError::TwoCustomInputs(first, second));
                            }
                            InputSource::Of(Quantity::Auxiliary)
                        }
                    }
                }
            };
            if let InputSource::Of(quantity) = feed {
                range.middle *= quantity.info().inside_scale;
                range.per_unit /= quantity.info().inside_scale;
            }
            // The number of inputs is at most the capacity.
            let _ = feeds.push(feed);
        }
        let strokes =
            self.strokes.map(|range| StrokeRange { period_s: self.period_s, ..range }.convert());
        let joint = JointNetwork {
            feeds,
            period_s: self.period_s as f32,
            strokes,
            network: network.convert(),
        };
        joint.validate()?;
        Ok(joint)
    }

    /// Creates the file of a driver's network. Reading it back and converting it for a driver gives the same bits.
    pub fn of_driver(joint: &JointNetwork, kind: JointKind) -> Self {
        let mut network: WideNetwork = joint.network.convert();
        let mut inputs = Vec::new();
        for (feed, range) in joint.feeds.iter().zip(&mut network.inputs) {
            inputs.push(match feed {
                InputSource::Held => "held".to_owned(),
                InputSource::Of(Quantity::Velocity) => "velocity".to_owned(),
                InputSource::Of(quantity) => quantity.name(kind).to_owned(),
            });
            if let InputSource::Of(quantity) = feed {
                range.middle /= quantity.info().inside_scale;
                range.per_unit *= quantity.info().inside_scale;
            }
        }
        let strokes = joint.strokes.map(|range| range.convert());
        Self { inputs, network, period_s: joint.period_s.into(), strokes }
    }
}

/// Returns the number of weights of a network with `used` inputs.
fn count(used: usize) -> usize {
    in_use(used).take(WideNetwork::WEIGHTS).filter(|is_used| *is_used).count()
}

/// Returns for each weight of a wide network, in order, whether it belongs to a used input.
fn in_use(used: usize) -> impl Iterator<Item = bool> {
    // A cell has a bias, the inputs and the cells, each for four gates. The readout follows after the cells.
    let cell = move |row: usize| !(1 + used..1 + MAX_INPUTS).contains(&row);
    let rows = (0..CELLS).flat_map(move |_| (0..1 + MAX_INPUTS + CELLS).map(cell));
    rows.flat_map(|is_used| [is_used; 4]).chain(std::iter::repeat(true))
}

/// Returns the weights of the used inputs.
fn weights(network: &WideNetwork, used: usize) -> Vec<f64> {
    let mut all = Vec::new();
    network.for_each_weight(|weight| all.push(weight));
    all.into_iter().zip(in_use(used)).filter_map(|(weight, used)| used.then_some(weight)).collect()
}

/// Sets the weights of the used inputs, of which there are [`count`], and all others to 0.
fn set_weights(network: &mut WideNetwork, used: usize, weights: &[f64]) {
    let mut given = weights.iter().copied();
    let mut next = || given.next().expect("the length has been checked");
    let spread = in_use(used).map(|is_used| if is_used { next() } else { 0.0 });
    network.set_weights(spread.take(WideNetwork::WEIGHTS));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference_network as reference;
    use crate::{message, snapshot};

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
    fn parse_of_emitted_text_returns_same_network() {
        let file = file();
        let text = file.emit(json!({"passes": 3}));
        let read = NetworkFile::parse(&text).unwrap();
        assert_eq!((&read.inputs, &read.network), (&file.inputs, &file.network));
        assert_eq!((read.period_s, read.strokes), (file.period_s, file.strokes));
        // A file with three inputs has the weights of a network with three inputs, in the core's order.
        let mut three = Vec::new();
        reference::network::<f64>().for_each_weight(|weight| three.push(weight));
        assert_eq!(weights(&file.network, 3), three);
        assert_eq!(three.len(), count(3));
    }

    #[test]
    fn of_driver_and_for_driver_return_same_bits() {
        let joint = file().for_driver().unwrap();
        assert_eq!(joint, reference::joint());
        let back = NetworkFile::of_driver(&joint, JointKind::Revolute);
        assert_eq!(back.inputs, ["auxiliary", "velocity", "held"]);
        let text = back.emit(Value::Null);
        assert_eq!(NetworkFile::parse(&text).unwrap().for_driver().unwrap(), joint);
        // The internal unit of pressure is MPa.
        let mut pressure = file();
        pressure.inputs[0] = "pressure_diff_pa".into();
        pressure.network.inputs[0] = InputRange::new(1e6, 3e6, 0.0);
        let joint = pressure.for_driver().unwrap();
        assert!((joint.network.inputs[0].middle - 2.0).abs() < 1e-6);
        assert!((joint.network.inputs[0].per_unit - 1.0).abs() < 1e-6);
    }

    #[test]
    fn parse_with_invalid_field_names_it() {
        let good = file().emit(Value::Null);
        let mut errors = String::new();
        for (from, to, parts) in [
            ("\"schema\": 1", "\"schema\": 2", &["schema", "2"][..]),
            ("\"cells\": 8", "\"cells\": 9", &["cells", "9"]),
            ("\"held\"\n", "\"held\", \"kp\", \"kd\"\n", &["inputs", "5", "1 to 4"]),
            ("\"held\"\n", "\"held\", \"kp\"\n", &["ranges", "3", "4"]),
            ("\"factor\": \"static\"", "\"factor\": \"viscous\"", &["\"viscous\"", "\"static\""]),
            ("\"slew\": 0.5", "\"slew\": 0.0", &["network_slew = 0"]),
            (
                "\"evaluation_period_s\": 0.0078125",
                "\"evaluation_period_s\": -0.0078125",
                &["evaluation_period_s", "-0.0078125", "more than 0"],
            ),
            ("\"slew\"", "\"slow\"", &["`slow`"]),
            ("\"weights\": [", "\"weights\": [0.5,", &["weights", "412", "411"]),
            ("\"weights\"", "\"weights", &["line "]),
        ] {
            let error = NetworkFile::parse(&good.replacen(from, to, 1)).unwrap_err().to_string();
            message::require(&error, parts);
            assert_eq!(error.lines().count(), 1, "{error}");
            errors += &format!("{} => {error}\n", to.trim_end());
        }
        snapshot::check("files", "network", &errors);
        let error_for = |names: [&str; 3]| {
            let mut file = file();
            file.inputs = names.map(str::to_owned).into();
            file.for_driver().unwrap_err().to_string()
        };
        assert!(error_for(["kp", "kd", "held"]).contains("\"kp\" and \"kd\""));
        let unmeasured = error_for(["time_s", "velocity", "held"]);
        message::check("files", "network of a time", &unmeasured, &["\"time_s\""]);
    }
}
