//! ONNX: the messages of a model, and a builder of graphs. [`super::law`] and `super::network` use them.
//!
//! The messages are the part of `onnx.proto` (version 1.17) that a graph of tensors needs. Their fields have these numbers:
//!
//! | message | fields |
//! |---|---|
//! | `ModelProto` | 1 ir_version, 2 producer_name, 6 doc_string, 7 graph, 8 opset_import, 14 metadata_props |
//! | `OperatorSetIdProto` | 2 version |
//! | `StringStringEntryProto` | 1 key, 2 value |
//! | `GraphProto` | 1 node, 2 name, 5 initializer, 11 input, 12 output |
//! | `NodeProto` | 1 input, 2 output, 4 op_type, 5 attribute |
//! | `AttributeProto` | 1 name, 3 i, 20 type |
//! | `TensorProto` | 1 dims, 2 data_type, 8 name, 9 raw_data |
//! | `ValueInfoProto` | 1 name, 2 type; `TypeProto`: 1 tensor_type |
//! | `TypeProto.Tensor` | 1 elem_type, 2 shape; `TensorShapeProto`: 1 dim |
//! | `TensorShapeProto.Dimension` | 1 dim_value, or 2 dim_param, the name of a dimension of any size |

use std::collections::HashSet;

/// `TensorProto.DataType`: `f32`.
pub(super) const FLOAT: i64 = 1;
/// `AttributeProto.AttributeType`: an integer.
const INT: i64 = 2;
/// Version of the operator set. Version 13 is the first that contains all operators used here in their current form.
const OPERATOR_SET_VERSION: i64 = 13;
/// `IR_VERSION` that belongs to this operator set.
const IR_VERSION: i64 = 7;

/// A message in the encoding of protocol buffers: its fields one after the other, each behind its number.
#[derive(Clone, Default)]
pub(super) struct Message(Vec<u8>);

impl Message {
    /// Appends a number in groups of seven bits.
    fn number(mut self, mut number: u64) -> Self {
        while number > 0x7F {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
        self
    }

    /// Appends a field with an integer.
    fn integer(self, field: u64, value: i64) -> Self {
        self.number(field << 3).number(value as u64)
    }

    /// Appends a field with a text, bytes or a message. An empty one is left out, as it is the default.
    fn bytes(self, field: u64, content: impl AsRef<[u8]>) -> Self {
        let content = content.as_ref();
        if content.is_empty() {
            return self;
        }
        let mut message = self.number(field << 3 | 2).number(content.len() as u64);
        message.0.extend_from_slice(content);
        message
    }

    /// Appends a field for each of several contents.
    fn each(self, field: u64, contents: impl IntoIterator<Item = impl AsRef<[u8]>>) -> Self {
        contents.into_iter().fold(self, |message, content| message.bytes(field, content))
    }
}

impl AsRef<[u8]> for Message {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

fn declare(name: &str, shape: Message) -> Message {
    let tensor = Message::default().integer(1, FLOAT).bytes(2, shape);
    Message::default().bytes(1, name).bytes(2, Message::default().bytes(1, tensor))
}

/// Declares a value with one row and the given number of columns.
pub(super) fn row(name: &str, columns: usize) -> Message {
    let size = |size: usize| Message::default().integer(1, size as i64);
    declare(name, Message::default().each(1, [size(1), size(columns)]))
}

/// Declares a value with one number for each joint, for any number of joints.
pub(super) fn per_joint(name: &str) -> Message {
    declare(name, Message::default().bytes(1, Message::default().bytes(2, "joints")))
}

/// Declares a value of one number.
pub(super) fn single(name: &str) -> Message {
    declare(name, Message::default().bytes(1, Message::default().integer(1, 1)))
}

/// Key and value of a model, for the caller.
pub(super) type Entry = (&'static str, String);

/// Builds a graph. The result of each operator has a unique name.
#[derive(Default)]
pub(super) struct Builder {
    nodes: Vec<Message>,
    tensors: Vec<Message>,
    /// Names of the scalar constants.
    constants: HashSet<String>,
}

impl Builder {
    pub fn tensor(
        &mut self,
        name: &str,
        dims: &[usize],
        numbers: impl Iterator<Item = f64>,
    ) -> String {
        let dims = dims.iter().fold(Message::default(), |dims, dim| dims.number(*dim as u64));
        let numbers: Vec<u8> = numbers.flat_map(|number| (number as f32).to_le_bytes()).collect();
        let tensor = Message::default().bytes(1, dims).integer(2, FLOAT);
        self.tensors.push(tensor.bytes(8, name).bytes(9, numbers));
        name.into()
    }

    /// Adds a scalar constant and returns its name.
    pub fn number(&mut self, number: f64) -> String {
        let name = format!("number_{number}");
        if self.constants.insert(name.clone()) {
            self.tensor(&name, &[], std::iter::once(number));
        }
        name
    }

    pub fn named(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        let node = Message::default().each(1, inputs).bytes(2, output);
        self.nodes.push(node.bytes(4, operator));
        output.into()
    }

    pub fn apply(&mut self, operator: &str, inputs: &[&str]) -> String {
        let name = format!("{}_{}", operator.to_lowercase(), self.nodes.len());
        self.named(operator, inputs, &name)
    }

    /// Adds an integer attribute to the last operator.
    pub fn set_attribute(&mut self, name: &str, i: i64) {
        let attribute = Message::default().bytes(1, name).integer(3, i).integer(20, INT);
        if let Some(node) = self.nodes.pop() {
            self.nodes.push(node.bytes(5, attribute));
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

    /// Returns the ONNX model of the graph, encoded.
    pub fn model(
        self,
        name: &str,
        doc_string: String,
        [inputs, outputs]: [Vec<Message>; 2],
        entries: &[Entry],
    ) -> Vec<u8> {
        let graph = Message::default().each(1, self.nodes).bytes(2, name).each(5, self.tensors);
        let graph = graph.each(11, inputs).each(12, outputs);
        let entry = |(key, value): &Entry| Message::default().bytes(1, key).bytes(2, value);
        let model = Message::default().integer(1, IR_VERSION).bytes(2, "host-sim");
        let model = model.bytes(6, doc_string).bytes(7, graph);
        let operators = Message::default().integer(2, OPERATOR_SET_VERSION);
        model.bytes(8, operators).each(14, entries.iter().map(entry)).0
    }
}
