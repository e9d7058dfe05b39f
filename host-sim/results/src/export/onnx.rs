//! Export of a network as an ONNX graph: one evaluation, with its state as input and output.
//!
//! ```text
//! inputs [1, N]   output [1, 8]   cell [1, 8]   factors [1, 3]   share [1, 1]   known [1, 1]
//!   -> one evaluation, as in compensator_core::network ->
//! factors_next    output_next     cell_next     share_next       outside
//! ```
//! The activation functions of the gates are rational, and ONNX's LSTM operator has no such functions. The graph
//! therefore consists of sums and products. It computes in `f32` and equals the driver except for the order of sums.
//!
//! The caller feeds the outputs back as inputs, starting with `factors` and `share` at 1 and the others at 0. `known` is
//! 1 if the current stroke is similar to those of the training data. The caller must evaluate this guard
//! (`network::stroke`), because it needs the motion.
//!
//! The message types are the part of `onnx.proto` (version 1.17) that a graph of tensors needs, with its field numbers.

use compensator_core::network::{CELL_LIMIT, GATES};
use friction_identification::network::{CELLS, NetworkFile};
use prost::Message;

/// `TensorProto.DataType`: `f32`.
const FLOAT: i32 = 1;
/// `AttributeProto.AttributeType`: an integer.
const INT: i32 = 2;
/// Version of the operator set. Version 13 is the first that contains all operators used here in their current form.
const OPERATOR_SET_VERSION: i64 = 13;
/// `IR_VERSION` that belongs to this operator set.
const IR_VERSION: i64 = 7;

#[derive(Clone, PartialEq, Message)]
struct Model {
    #[prost(int64, tag = "1")]
    ir_version: i64,
    #[prost(string, tag = "2")]
    producer_name: String,
    #[prost(string, tag = "6")]
    doc_string: String,
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
    #[prost(message, repeated, tag = "8")]
    opset_import: Vec<OperatorSet>,
    #[prost(message, repeated, tag = "14")]
    metadata_props: Vec<Entry>,
}

#[derive(Clone, PartialEq, Message)]
struct OperatorSet {
    #[prost(string, tag = "1")]
    domain: String,
    #[prost(int64, tag = "2")]
    version: i64,
}

#[derive(Clone, PartialEq, Message)]
struct Entry {
    #[prost(string, tag = "1")]
    key: String,
    #[prost(string, tag = "2")]
    value: String,
}

#[derive(Clone, PartialEq, Message)]
struct Graph {
    #[prost(message, repeated, tag = "1")]
    node: Vec<Node>,
    #[prost(string, tag = "2")]
    name: String,
    #[prost(message, repeated, tag = "5")]
    initializer: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    input: Vec<ValueInfo>,
    #[prost(message, repeated, tag = "12")]
    output: Vec<ValueInfo>,
}

#[derive(Clone, PartialEq, Message)]
struct Node {
    #[prost(string, repeated, tag = "1")]
    input: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    output: Vec<String>,
    #[prost(string, tag = "4")]
    op_type: String,
    #[prost(message, repeated, tag = "5")]
    attribute: Vec<Attribute>,
}

#[derive(Clone, PartialEq, Message)]
struct Attribute {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int64, tag = "3")]
    i: i64,
    #[prost(int32, tag = "20")]
    r#type: i32,
}

#[derive(Clone, PartialEq, Message)]
struct Tensor {
    #[prost(int64, repeated, tag = "1")]
    dims: Vec<i64>,
    #[prost(int32, tag = "2")]
    data_type: i32,
    #[prost(string, tag = "8")]
    name: String,
    #[prost(bytes = "vec", tag = "9")]
    raw_data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
struct ValueInfo {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, optional, tag = "2")]
    r#type: Option<Type>,
}

#[derive(Clone, PartialEq, Message)]
struct Type {
    #[prost(message, optional, tag = "1")]
    tensor_type: Option<TensorType>,
}

#[derive(Clone, PartialEq, Message)]
struct TensorType {
    #[prost(int32, tag = "1")]
    elem_type: i32,
    #[prost(message, optional, tag = "2")]
    shape: Option<Shape>,
}

#[derive(Clone, PartialEq, Message)]
struct Shape {
    #[prost(message, repeated, tag = "1")]
    dim: Vec<Dimension>,
}

#[derive(Clone, PartialEq, Message)]
struct Dimension {
    #[prost(int64, tag = "1")]
    dim_value: i64,
}

/// Declares a value with one row and the given number of columns.
fn row(name: &str, columns: usize) -> ValueInfo {
    let dim = [1, columns as i64].map(|dim_value| Dimension { dim_value }).to_vec();
    let tensor = TensorType { elem_type: FLOAT, shape: Some(Shape { dim }) };
    ValueInfo { name: name.into(), r#type: Some(Type { tensor_type: Some(tensor) }) }
}

/// Builds a graph. The result of each operator has a unique name.
#[derive(Default)]
struct Builder {
    nodes: Vec<Node>,
    tensors: Vec<Tensor>,
}

impl Builder {
    fn tensor(&mut self, name: &str, dims: &[usize], numbers: impl Iterator<Item = f64>) -> String {
        self.tensors.push(Tensor {
            dims: dims.iter().map(|dim| *dim as i64).collect(),
            data_type: FLOAT,
            name: name.into(),
            raw_data: numbers.flat_map(|number| (number as f32).to_le_bytes()).collect(),
        });
        name.into()
    }

    /// Adds a scalar constant and returns its name.
    fn number(&mut self, number: f64) -> String {
        let name = format!("number_{number}");
        if !self.tensors.iter().any(|tensor| tensor.name == name) {
            self.tensor(&name, &[], std::iter::once(number));
        }
        name
    }

    fn named(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        self.nodes.push(Node {
            input: inputs.iter().map(|name| (*name).to_owned()).collect(),
            output: vec![output.into()],
            op_type: operator.into(),
            attribute: Vec::new(),
        });
        output.into()
    }

    fn apply(&mut self, operator: &str, inputs: &[&str]) -> String {
        let name = format!("{}_{}", operator.to_lowercase(), self.nodes.len());
        self.named(operator, inputs, &name)
    }

    /// Adds an integer attribute to the last operator.
    fn set_attribute(&mut self, name: &str, i: i64) {
        if let Some(node) = self.nodes.last_mut() {
            node.attribute.push(Attribute { name: name.into(), i, r#type: INT });
        }
    }

    fn clip(&mut self, value: &str, min: f64, max: f64) -> String {
        let (min, max) = (self.number(min), self.number(max));
        self.apply("Clip", &[value, &min, &max])
    }

    /// `x (a + x^2) / (b + c x^2)`, with `x` clipped to `-limit..=limit`.
    fn rational(&mut self, x: &str, limit: f64, [a, b, c]: [f64; 3]) -> String {
        let x = self.clip(x, -limit, limit);
        let square = self.apply("Mul", &[&x, &x]);
        let [a, b, c] = [a, b, c].map(|number| self.number(number));
        let numerator = self.apply("Add", &[&a, &square]);
        let numerator = self.apply("Mul", &[&x, &numerator]);
        let denominator = self.apply("Mul", &[&c, &square]);
        let denominator = self.apply("Add", &[&b, &denominator]);
        self.apply("Div", &[&numerator, &denominator])
    }

    fn squash(&mut self, x: &str) -> String {
        self.rational(x, 3.0, [27.0, 27.0, 9.0])
    }

    fn sigmoid(&mut self, x: &str) -> String {
        let share = self.rational(x, 6.0, [108.0, 432.0, 36.0]);
        let half = self.number(0.5);
        self.apply("Add", &[&half, &share])
    }

    /// The sum of the bias and of `x W` for each pair of a value and its weights.
    fn sums(&mut self, parts: &[(&str, &str)], bias: &str) -> String {
        parts.iter().fold(bias.to_owned(), |sum, (value, weights)| {
            let product = self.apply("MatMul", &[value, weights]);
            self.apply("Add", &[&sum, &product])
        })
    }
}

/// Returns the ONNX model of a network, encoded.
pub(super) fn model(file: &NetworkFile, source: &str) -> Vec<u8> {
    let mut graph = Builder::default();
    let used = file.inputs.len();
    let (scaled, outside) = guard(&mut graph, file);
    let output = recurrent(&mut graph, file, &scaled);
    factors(&mut graph, file, &output, &outside);
    let Builder { nodes, tensors } = graph;
    let graph = Graph {
        node: nodes,
        name: "lugre_lstm".into(),
        initializer: tensors,
        input: vec![
            row("inputs", used),
            row("output", CELLS),
            row("cell", CELLS),
            row("factors", 3),
            row("share", 1),
            row("known", 1),
        ],
        output: vec![
            row("factors_next", 3),
            row("output_next", CELLS),
            row("cell_next", CELLS),
            row("share_next", 1),
            row("outside", 1),
        ],
    };
    let entry = |key: &str, value: String| Entry { key: key.into(), value };
    let model = Model {
        ir_version: IR_VERSION,
        producer_name: "host-sim".into(),
        doc_string: format!(
            "Factors on coulomb_torque, static_torque (of each direction) and bristle_stiffness of the model lugre-asymmetric in \
             {source}. One evaluation; feed the outputs back as inputs. Start with factors and share 1, output and cell 0; \
             known is 1 if the stroke is similar to those of the training data."
        ),
        graph: Some(graph),
        opset_import: vec![OperatorSet { domain: String::new(), version: OPERATOR_SET_VERSION }],
        metadata_props: vec![
            entry("inputs", file.inputs.join(",")),
            entry("evaluation_period_s", file.period_s.to_string()),
        ],
    };
    model.encode_to_vec()
}

/// Adds the input guard. Returns the names of the scaled inputs and of `outside`, which is 1 if an input is outside its
/// range or the stroke is not known.
fn guard(graph: &mut Builder, file: &NetworkFile) -> (String, String) {
    let used = file.inputs.len();
    let ranges = &file.network.inputs[..used];
    let middle = graph.tensor("middle", &[1, used], ranges.iter().map(|range| range.middle));
    let per_unit = graph.tensor("per_unit", &[1, used], ranges.iter().map(|range| range.per_unit));
    let (zero, one) = (graph.number(0.0), graph.number(1.0));
    // NaN is replaced by the middle of the range and counts as outside.
    let missing = graph.apply("IsNaN", &["inputs"]);
    let from_middle = graph.apply("Sub", &["inputs", &middle]);
    let scaled = graph.apply("Mul", &[&from_middle, &per_unit]);
    let scaled = graph.apply("Where", &[&missing, &zero, &scaled]);
    let size = graph.apply("Abs", &[&scaled]);
    let beyond = graph.apply("Greater", &[&size, &one]);
    let beyond = graph.apply("Or", &[&beyond, &missing]);
    let beyond = graph.apply("Cast", &[&beyond]);
    graph.set_attribute("to", FLOAT.into());
    let any = graph.apply("ReduceMax", &[&beyond]);
    graph.set_attribute("keepdims", 1);
    let unknown = graph.apply("Sub", &[&one, "known"]);
    let any = graph.apply("Max", &[&any, &unknown]);
    // One value, independent of the number of inputs.
    let outside = graph.named("Identity", &[&any], "outside");
    (graph.clip(&scaled, -1.0, 1.0), outside)
}

/// Adds the recurrent layer. Returns the name of its output.
fn recurrent(graph: &mut Builder, file: &NetworkFile, scaled: &str) -> String {
    let (cells, used) = (&file.network.lstm.cells, file.inputs.len());
    let gates: [String; GATES] = ["forget", "input", "output", "candidate"].map(|name| {
        let gate = ["forget", "input", "output", "candidate"]
            .iter()
            .position(|known| *known == name)
            .unwrap_or_default();
        let bias = cells.iter().map(|cell| cell.bias[gate]);
        let bias = graph.tensor(&format!("bias_{name}"), &[1, CELLS], bias);
        let of_input =
            (0..used).flat_map(|input| cells.iter().map(move |cell| cell.input[input][gate]));
        let of_input = graph.tensor(&format!("input_{name}"), &[used, CELLS], of_input);
        let of_cell =
            (0..CELLS).flat_map(|other| cells.iter().map(move |cell| cell.recurrent[other][gate]));
        let of_cell = graph.tensor(&format!("recurrent_{name}"), &[CELLS, CELLS], of_cell);
        graph.sums(&[(scaled, &of_input), ("output", &of_cell)], &bias)
    });
    let [forget, input, output, candidate] = gates;
    let (forget, input) = (graph.sigmoid(&forget), graph.sigmoid(&input));
    let candidate = graph.squash(&candidate);
    let kept = graph.apply("Mul", &[&forget, "cell"]);
    let taken = graph.apply("Mul", &[&input, &candidate]);
    let cell = graph.apply("Add", &[&kept, &taken]);
    let (least, most) = (graph.number(-CELL_LIMIT), graph.number(CELL_LIMIT));
    let cell = graph.named("Clip", &[&cell, &least, &most], "cell_next");
    let (output, squashed) = (graph.sigmoid(&output), graph.squash(&cell));
    graph.named("Mul", &[&output, &squashed], "output_next")
}

/// Adds the readout with its bounds, the share of the network, and the slew limit.
fn factors(graph: &mut Builder, file: &NetworkFile, output: &str, outside: &str) {
    let network = &file.network;
    let readout = &network.readout;
    let bias = graph.tensor("bias_factors", &[1, 3], readout.bias.into_iter());
    let weights = (0..CELLS).flat_map(|cell| readout.weights.iter().map(move |row| row[cell]));
    let weights = graph.tensor("factors_of_cells", &[CELLS, 3], weights);
    let sums = graph.sums(&[(output, &weights)], &bias);
    let share_of_range = graph.sigmoid(&sums);
    let bounds = &network.bounds;
    let least = graph.tensor("least", &[1, 3], bounds.iter().map(|bound| bound.least));
    let width = graph.tensor("width", &[1, 3], bounds.iter().map(|bound| bound.most - bound.least));
    let above = graph.apply("Mul", &[&width, &share_of_range]);
    let targets = graph.apply("Add", &[&least, &above]);
    // The static factor must not be below the Coulomb factor. This matrix copies the first column to the second.
    let places = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let places = graph.tensor("coulomb_twice", &[3, 3], places.into_iter());
    let floor = graph.apply("MatMul", &[&targets, &places]);
    let targets = graph.apply("Max", &[&targets, &floor]);
    // The share rises by `fade` per evaluation inside the range and falls by `fade` outside.
    let (one, fade, twice) =
        (graph.number(1.0), graph.number(network.fade), graph.number(2.0 * network.fade));
    let loss = graph.apply("Mul", &[&twice, outside]);
    let change = graph.apply("Sub", &[&fade, &loss]);
    let share = graph.apply("Add", &["share", &change]);
    let zero = graph.number(0.0);
    let share = graph.named("Clip", &[&share, &zero, &one], "share_next");
    let from_one = graph.apply("Sub", &[&targets, &one]);
    let faded = graph.apply("Mul", &[&from_one, &share]);
    let faded = graph.apply("Add", &[&one, &faded]);
    let way = graph.apply("Sub", &[&faded, "factors"]);
    let step = graph.clip(&way, -network.slew, network.slew);
    graph.named("Add", &["factors", &step], "factors_next");
}
