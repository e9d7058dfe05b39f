//! Export of a law as ONNX graphs: one step with its state as input and output, and the start from a measured torque.
//!
//! ```text
//! velocity_rad_s [joints]   dt_s [1]   pressure_diff_pa [joints] ..   bristle_torque_nm [joints] ..
//!   -> one step ->
//! torque_nm [joints]   bristle_torque_nm_next [joints] ..
//! ```
//! The statements are those of [`friction_results::export`]. Every operator is elementwise, so one evaluation serves any number of joints of
//! this model. The start is a graph of its own: it reads the inputs of the step and `measured_torque_nm`, and returns
//! `bristle_torque_nm`. It is the bisection of the core, unrolled, so that neither graph needs control flow.

use super::OnnxError;
use super::graph::{Builder, Entry, Message, per_joint, single};
use compensator_core::TermKind;
use friction_fit::params::ParameterFile;
use friction_results::export::ExportedModel;
use friction_results::export::statements::{
    Action, BRISTLE_TORQUE, Binary, Expr, MEASURED_TORQUE, Node, Program, Unary, start, step,
    unsupported_term,
};
use joint_log::JointKind;
use std::collections::HashMap;

/// Name of the file with the graph of the start.
pub(super) const START_FILE: &str = "friction-start.onnx";

/// Exports a law as a graph of its step, and a graph of its start if it has bristles.
pub(super) fn export(file: &ParameterFile, source: &str) -> Result<ExportedModel, OnnxError> {
    let model = &file.compensated_model();
    // The graph of the start has no state of the play.
    let play = model.terms.iter().find(|kind| **kind == TermKind::Backlash);
    if let Some(term) = unsupported_term(model).or(play.map(|kind| kind.name())) {
        return Err(OnnxError::Term { term });
    }
    let step = step(model);
    let (inputs, state) = (inputs(&step), step.state());
    let units = match file.joint {
        JointKind::Revolute => "",
        JointKind::Prismatic => " The joint is prismatic: rad means m, and Nm means N.",
    };
    let name = file.compensated_name();
    let mut note = format!("one step: inputs {}, dt_s", inputs.join(", "));
    if !state.is_empty() {
        note += &format!(
            "; state {}: feed each output NAME_next back as input NAME, starting at 0",
            state.join(", ")
        );
    }
    let start = start(model);
    let start_rule = match &start {
        Some(_) => format!(
            "at the start of a run and after a gap, zero the state and run {START_FILE} with the first sample and its measured \
             torque; its output is the input bristle_torque_nm of the first step. From 0, the torque is wrong until the joint \
             leaves presliding"
        ),
        None => {
            "the law has no bristles, so its step needs no start from a measured torque".to_owned()
        }
    };
    let doc =
        format!("One step of the friction model {name} in {source}: {note}; {start_rule}.{units}");
    let entries =
        [("model", name.clone()), ("inputs", inputs.join(",")), ("state", state.join(","))];
    let content = step_graph(&step, &inputs, doc, &entries);
    let mut exported = ExportedModel::new(content, vec![note, start_rule]);
    if let Some(start) = start {
        let doc = format!(
            "Start of the friction model {name} in {source}: the bristle torque from which one step with the same inputs returns \
             measured_torque_nm, as far as the level permits.{units}"
        );
        let others = state.iter().filter(|field| **field != BRISTLE_TORQUE);
        let mut declared = declare_inputs(inputs.iter().chain(others));
        declared.push(per_joint(MEASURED_TORQUE));
        let mut graph = Graph::default();
        let held = graph.run(&start);
        graph.output(&held, BRISTLE_TORQUE);
        let interface = [declared, vec![per_joint(BRISTLE_TORQUE)]];
        let content = graph.builder.model("friction_start", doc, interface, &entries);
        exported.further_files.push((START_FILE, content));
    }
    Ok(exported)
}

/// Returns the graph of one step, encoded: the torque, and the next value of each field of the state.
fn step_graph(step: &Program, inputs: &[&'static str], doc: String, entries: &[Entry]) -> Vec<u8> {
    let state = step.state();
    let mut graph = Graph::default();
    let torque = graph.run(step);
    graph.output(&torque, "torque_nm");
    let mut outputs = vec![per_joint("torque_nm")];
    for field in &state {
        let (value, next) = (graph.value(&Expr::state(field)), next(field));
        graph.output(&value, &next);
        outputs.push(per_joint(&next));
    }
    let declared = declare_inputs(inputs.iter().chain(&state));
    graph.builder.model("friction_step", doc, [declared, outputs], entries)
}

/// Returns the name of the output with the next value of a field of the state.
fn next(field: &str) -> String {
    format!("{field}_next")
}

/// Returns the inputs of a step with one value for each joint, the velocity first.
fn inputs(step: &Program) -> Vec<&'static str> {
    let velocity = "velocity_rad_s";
    let others = step.inputs().into_iter().filter(|name| *name != velocity);
    std::iter::once(velocity).chain(others).collect()
}

fn declare_inputs<'a>(names: impl Iterator<Item = &'a &'static str>) -> Vec<Message> {
    let mut declared: Vec<_> = names.map(|name| per_joint(name)).collect();
    declared.insert(1, single("dt_s"));
    declared
}

/// A graph under construction, with the value of each variable and of each field of the state. A program defines a variable
/// before it reads it.
#[derive(Default)]
struct Graph {
    builder: Builder,
    variables: HashMap<String, String>,
    state: HashMap<&'static str, String>,
}

impl Graph {
    /// Adds the statements of a program and returns the name of its result.
    fn run(&mut self, program: &Program) -> String {
        for statement in &program.statements {
            let value = self.value(&statement.value);
            match &statement.action {
                Action::Define(name) => {
                    self.variables.insert(name.clone(), value);
                }
                Action::AddTo(name) => self.change("Add", name, &value),
                Action::ScaleBy(name) => self.change("Mul", name, &value),
                Action::SetState(name) => {
                    self.state.insert(name, value);
                }
            }
        }
        self.value(program.result.as_ref().expect("a program returns a torque"))
    }

    fn change(&mut self, operator: &str, name: &str, by: &str) {
        let after = self.builder.apply(operator, &[&self.variables[name], by]);
        self.variables.insert(name.to_owned(), after);
    }

    /// Adds the nodes of an expression and returns the name of its value.
    fn value(&mut self, value: &Expr) -> String {
        match &*value.0 {
            Node::Number(number) => self.builder.number(f64::from(*number)),
            Node::Input(name) => (*name).to_owned(),
            Node::Period => "dt_s".to_owned(),
            Node::State(name) => self.state.get(name).cloned().unwrap_or((*name).to_owned()),
            Node::Variable(name) => self.variables[name].clone(),
            Node::Unary(operator, a) => {
                let a = self.value(a);
                let operator = match operator {
                    Unary::Negative => "Neg",
                    Unary::Abs => "Abs",
                    Unary::Sign => "Sign",
                    Unary::Exp => "Exp",
                    Unary::Ln => "Log",
                    Unary::Sin => "Sin",
                    Unary::Cos => "Cos",
                    Unary::Atan => "Atan",
                };
                self.builder.apply(operator, &[&a])
            }
            Node::Binary(operator, a, b) => {
                let [a, b] = [a, b].map(|operand| self.value(operand));
                let operator = match operator {
                    Binary::Add => "Add",
                    Binary::Subtract => "Sub",
                    Binary::Multiply => "Mul",
                    Binary::Divide => "Div",
                    Binary::Min => "Min",
                    Binary::Max => "Max",
                    Binary::Power => "Pow",
                };
                self.builder.apply(operator, &[&a, &b])
            }
            Node::IfPositive(value, positive, otherwise) => {
                let [value, positive, otherwise] =
                    [value, positive, otherwise].map(|operand| self.value(operand));
                let zero = self.builder.number(0.0);
                let is_positive = self.builder.apply("Greater", &[&value, &zero]);
                self.builder.apply("Where", &[&is_positive, &positive, &otherwise])
            }
        }
    }

    /// Declares a value as an output of the graph, with one number for each joint.
    fn output(&mut self, value: &str, name: &str) {
        // A constant has no dimension, and the velocity has one number for each joint.
        let shape = self.builder.apply("Shape", &["velocity_rad_s"]);
        self.builder.named("Expand", &[value, &shape], name);
    }
}
