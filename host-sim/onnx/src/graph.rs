//! ONNX: the messages of a model, and a builder of graphs. [`super::law`] and `super::network` use them.
//!
//! The message types are the part of `onnx.proto` (version 1.17) that a graph of tensors needs, with its field numbers.

use prost::Message;

/// `TensorProto.DataType`: `f32`.
pub(super) const FLOAT: i32 = 1;
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
pub(super) struct ValueInfo {
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
    /// Name of a dimension of any size. Only one of both fields is set.
    #[prost(string, tag = "2")]
    dim_param: String,
}

fn declare(name: &str, dim: Vec<Dimension>) -> ValueInfo {
    let tensor = TensorType { elem_type: FLOAT, shape: Some(Shape { dim }) };
    ValueInfo { name: name.into(), r#type: Some(Type { tensor_type: Some(tensor) }) }
}

/// Declares a value with one row and the given number of columns.
pub(super) fn row(name: &str, columns: usize) -> ValueInfo {
    let size = |size: i64| Dimension { dim_value: size, dim_param: String::new() };
    declare(name, vec![size(1), size(columns as i64)])
}

/// Declares a value with one number for each joint, for any number of joints.
pub(super) fn per_joint(name: &str) -> ValueInfo {
    declare(name, vec![Dimension { dim_value: 0, dim_param: "joints".into() }])
}

/// Declares a value of one number.
pub(super) fn single(name: &str) -> ValueInfo {
    declare(name, vec![Dimension { dim_value: 1, dim_param: String::new() }])
}

/// Builds a graph. The result of each operator has a unique name.
#[derive(Default)]
pub(super) struct Builder {
    nodes: Vec<Node>,
    tensors: Vec<Tensor>,
}

impl Builder {
    pub fn tensor(
        &mut self,
        name: &str,
        dims: &[usize],
        numbers: impl Iterator<Item = f64>,
    ) -> String {
        self.tensors.push(Tensor {
            dims: dims.iter().map(|dim| *dim as i64).collect(),
            data_type: FLOAT,
            name: name.into(),
            raw_data: numbers.flat_map(|number| (number as f32).to_le_bytes()).collect(),
        });
        name.into()
    }

    /// Adds a scalar constant and returns its name.
    pub fn number(&mut self, number: f64) -> String {
        let name = format!("number_{number}");
        if !self.tensors.iter().any(|tensor| tensor.name == name) {
            self.tensor(&name, &[], std::iter::once(number));
        }
        name
    }

    pub fn named(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        self.nodes.push(Node {
            input: inputs.iter().map(|name| (*name).to_owned()).collect(),
            output: vec![output.into()],
            op_type: operator.into(),
            attribute: Vec::new(),
        });
        output.into()
    }

    pub fn apply(&mut self, operator: &str, inputs: &[&str]) -> String {
        let name = format!("{}_{}", operator.to_lowercase(), self.nodes.len());
        self.named(operator, inputs, &name)
    }

    /// Adds an integer attribute to the last operator.
    pub fn set_attribute(&mut self, name: &str, i: i64) {
        if let Some(node) = self.nodes.last_mut() {
            node.attribute.push(Attribute { name: name.into(), i, r#type: INT });
        }
    }

    pub fn clip(&mut self, value: &str, min: f64, max: f64) -> String {
        let (min, max) = (self.number(min), self.number(max));
        self.apply("Clip", &[value, &min, &max])
    }

    /// `x (a + x^2) / (b + c x^2)`, with `x` clipped to `-limit..=limit`.
    pub fn rational(&mut self, x: &str, limit: f64, [a, b, c]: [f64; 3]) -> String {
        let x = self.clip(x, -limit, limit);
        let square = self.apply("Mul", &[&x, &x]);
        let [a, b, c] = [a, b, c].map(|number| self.number(number));
        let numerator = self.apply("Add", &[&a, &square]);
        let numerator = self.apply("Mul", &[&x, &numerator]);
        let denominator = self.apply("Mul", &[&c, &square]);
        let denominator = self.apply("Add", &[&b, &denominator]);
        self.apply("Div", &[&numerator, &denominator])
    }

    pub fn squash(&mut self, x: &str) -> String {
        self.rational(x, 3.0, [27.0, 27.0, 9.0])
    }

    pub fn sigmoid(&mut self, x: &str) -> String {
        let share = self.rational(x, 6.0, [108.0, 432.0, 36.0]);
        let half = self.number(0.5);
        self.apply("Add", &[&half, &share])
    }

    /// The sum of the bias and of `x W` for each pair of a value and its weights.
    pub fn sums(&mut self, parts: &[(&str, &str)], bias: &str) -> String {
        parts.iter().fold(bias.to_owned(), |sum, (value, weights)| {
            let product = self.apply("MatMul", &[value, weights]);
            self.apply("Add", &[&sum, &product])
        })
    }

    /// Returns the ONNX model of the graph, encoded. `entries` are keys and values for the caller.
    pub fn model(
        self,
        name: &str,
        doc_string: String,
        [input, output]: [Vec<ValueInfo>; 2],
        entries: &[(&str, String)],
    ) -> Vec<u8> {
        let graph =
            Graph { node: self.nodes, name: name.into(), initializer: self.tensors, input, output };
        let entry =
            |(key, value): &(&str, String)| Entry { key: (*key).into(), value: value.clone() };
        let model = Model {
            ir_version: IR_VERSION,
            producer_name: "host-sim".into(),
            doc_string,
            graph: Some(graph),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPERATOR_SET_VERSION,
            }],
            metadata_props: entries.iter().map(entry).collect(),
        };
        model.encode_to_vec()
    }
}
