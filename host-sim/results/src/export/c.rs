//! Export as one C header: state, inputs, one step and a start in `float`. It requires C99 and `math.h` only.
//!
//! The step has the statements of [`super::law`]. The core uses a table for the Stribeck curve and C calls `expf`. They
//! differ by at most 1.3e-5 of `F_S - F_C`, so the torques are close but not bit-identical. The header contains none of the
//! compensator's guards (age of inputs, slew rate, limits). A control loop without guards of its own should use the core.

use super::effects::BRISTLE_TORQUE;
use super::law::{self, BISECTIONS};
use super::program::{Action, Binary, Expr, Node, Program, Unary};
use super::{ExportError, ExportedModel};
use friction_fit::params::{ParameterFile, unit};
use joint_log::JointKind;
use std::fmt::Write as _;

/// Body of the function `friction_start` of a law with bristles. `BISECTIONS` is replaced.
const START: &str = include_str!("friction_start.c.in");

/// Exports the model as a C header.
pub(super) fn export(file: &ParameterFile, source: &str) -> Result<ExportedModel, ExportError> {
    let model = &file.compensated_model();
    if let Some(term) = law::unsupported_term(model) {
        return Err(ExportError::UnsupportedTerm { term });
    }
    let step = law::step(model);
    let has_bristles = model.law.has_bristles();
    let mut text = head(file, source, has_bristles);
    text += " */\n#ifndef FRICTION_H\n#define FRICTION_H\n\n#include <math.h>\n\n";
    if let Some(constant) = file.compensator.get("torque_constant_nm_per_a") {
        text += &format!(
            "/* Torque of one ampere, of the log that the model was fitted to. */\n\
             #define FRICTION_TORQUE_CONSTANT_NM_PER_A {constant:?}f\n\n"
        );
    }
    text +=
        "/* Initialise all fields with zero, then call friction_start(). */\ntypedef struct {\n";
    let others = step.state().into_iter().filter(|name| *name != BRISTLE_TORQUE);
    for field in std::iter::once(BRISTLE_TORQUE).chain(others) {
        text += &format!("    float {field};\n");
    }
    text += "} friction_state;\n\n/* Units as in the names. All values must be finite. */\ntypedef struct {\n    float velocity_rad_s;\n";
    let others = step.inputs().into_iter().filter(|name| *name != "velocity_rad_s");
    others.for_each(|field| text += &format!("    float {field};\n"));
    text += "} friction_inputs;\n\n";
    step_function(&mut text, &step);
    start_function(&mut text, has_bristles);
    text += "\n#endif\n";
    let mut notes = vec![
        "the header contains only the law: the control loop must check the age of its inputs and limit slew rate and current"
            .to_owned(),
    ];
    if has_bristles {
        notes.push(
            "at the start of a run and after a gap, zero the state and call friction_start() with the first measured torque: a \
             state of zero is wrong until the joint leaves presliding"
                .to_owned(),
        );
    }
    Ok(ExportedModel::new(text.into_bytes(), notes))
}

/// Returns the comment at the top of the header, without its end.
fn head(file: &ParameterFile, source: &str, has_bristles: bool) -> String {
    let model = &file.compensated_model();
    let [torque, speed] = match file.joint {
        JointKind::Revolute => ["Nm", "rad/s"],
        JointKind::Prismatic => {
            ["N", "m/s (the names are those of a revolute joint: rad means m, Nm means N)"]
        }
    };
    let mut text = format!(
        "/* Friction model {}, written by `host-sim export {} --to c`.\n\
         \x20*\n\
         \x20* Call friction_step() once per sample with the time since the last call. It returns the friction\n\
         \x20* torque in {torque}, positive for positive velocity. To compensate friction, add it to the torque\n\
         \x20* command and limit the sum. Velocity is in {speed}.\n\
         \x20*\n",
        file.compensated_name(),
        source.replace("*/", "* /")
    );
    text += if has_bristles {
        " * Start: at the start of a run and after a gap in the samples, set all fields of the state to zero.\n\
         \x20* Then call friction_start() with the first sample and its measured friction torque, and then\n\
         \x20* friction_step() with the same sample. A joint at rest holds any torque up to its static level, and\n\
         \x20* only a measured torque indicates which one. From a state of zero, the torque is wrong until the joint\n\
         \x20* leaves presliding.\n"
    } else {
        " * Start: set all fields of the state to zero. The law has no bristles, so friction_start() has no effect.\n"
    };
    text += " *\n * Parameters:\n *\n";
    for id in model.active() {
        // Writing to a string does not fail.
        let _ =
            writeln!(text, " *   {:<28} {:?} {}", id.name(), model.get(id), unit(id, file.joint));
    }
    text
}

/// Writes the function `friction_step`.
fn step_function(text: &mut String, step: &Program) {
    text.push_str(
        "/* Returns the friction torque of a sample and advances the state.\n\
         \x20* dt_s: time since the last step, s; must be positive. */\n\
         static inline float friction_step(friction_state *state, const friction_inputs *in, float dt_s)\n{\n",
    );
    if step.state().is_empty() {
        text.push_str("    (void)state;\n");
    }
    if !step.reads_period() {
        text.push_str("    (void)dt_s;\n");
    }
    for statement in &step.statements {
        if let Some(comment) = &statement.comment {
            text.push_str(&format!("    /* {comment} */\n"));
        }
        let left = match &statement.action {
            Action::Define(name) if step.changes(name) => format!("float {name} ="),
            Action::Define(name) => format!("const float {name} ="),
            Action::AddTo(name) => format!("{name} +="),
            Action::ScaleBy(name) => format!("{name} *="),
            Action::SetState(name) => format!("state->{name} ="),
        };
        text.push_str(&format!("    {left} {};\n", render(&statement.value).0));
    }
    if let Some(result) = &step.result {
        text.push_str(&format!("    return {};\n}}\n", render(result).0));
    }
}

/// Writes the function `friction_start`.
fn start_function(text: &mut String, has_bristles: bool) {
    text.push_str(
        "\n/* Sets the bristle torque of the state so that friction_step() with the same sample returns torque_nm, as\n\
         \x20* far as the static level permits. Other fields of the state remain. torque_nm: measured friction torque\n\
         \x20* of the sample. dt_s: as in friction_step(). */\n\
         static inline void friction_start(friction_state *state, const friction_inputs *in, float torque_nm, float dt_s)\n{\n",
    );
    if !has_bristles {
        text.push_str(
            "    /* The law has no bristles. */\n    (void)state;\n    (void)in;\n    (void)torque_nm;\n    (void)dt_s;\n}\n",
        );
        return;
    }
    text.push_str(&START.replace("BISECTIONS", &BISECTIONS.to_string()));
}

/// How tightly the operators of C bind, in rising order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Conditional,
    Sum,
    Product,
    Unary,
    Atom,
}

/// Returns the expression as C text, and how tightly its outermost operator binds.
fn render(value: &Expr) -> (String, Binding) {
    let at_least = |operand: &Expr, binding: Binding| {
        let (text, inner) = render(operand);
        if inner < binding { format!("({text})") } else { text }
    };
    let call = |function: &str, operands: &[&Expr]| {
        let operands: Vec<String> = operands.iter().map(|operand| render(operand).0).collect();
        (format!("{function}({})", operands.join(", ")), Binding::Atom)
    };
    let infix = |sign: &str, [a, b]: [&Expr; 2], binding: Binding, right: Binding| {
        (format!("{} {sign} {}", at_least(a, binding), at_least(b, right)), binding)
    };
    match &*value.0 {
        Node::Number(number) if *number < 0.0 => (format!("{number:?}f"), Binding::Unary),
        Node::Number(number) => (format!("{number:?}f"), Binding::Atom),
        Node::Input(name) => (format!("in->{name}"), Binding::Atom),
        Node::Period => ("dt_s".into(), Binding::Atom),
        Node::State(name) => (format!("state->{name}"), Binding::Atom),
        Node::Variable(name) => (name.clone(), Binding::Atom),
        Node::Unary(operator, a) => match operator {
            Unary::Negative => (format!("-{}", at_least(a, Binding::Atom)), Binding::Unary),
            Unary::Abs => call("fabsf", &[a]),
            Unary::Sign => {
                let a = at_least(a, Binding::Atom);
                (format!("(float)(({a} > 0.0f) - ({a} < 0.0f))"), Binding::Unary)
            }
            Unary::Exp => call("expf", &[a]),
            Unary::Ln => call("logf", &[a]),
            Unary::Sin => call("sinf", &[a]),
            Unary::Cos => call("cosf", &[a]),
            Unary::Atan => call("atanf", &[a]),
        },
        Node::Binary(operator, a, b) => match operator {
            Binary::Add => infix("+", [a, b], Binding::Sum, Binding::Sum),
            Binary::Subtract => infix("-", [a, b], Binding::Sum, Binding::Product),
            Binary::Multiply => infix("*", [a, b], Binding::Product, Binding::Unary),
            Binary::Divide => infix("/", [a, b], Binding::Product, Binding::Unary),
            Binary::Min => call("fminf", &[a, b]),
            Binary::Max => call("fmaxf", &[a, b]),
            Binary::Power => call("powf", &[a, b]),
        },
        Node::IfPositive(value, positive, otherwise) => {
            let [value, positive, otherwise] =
                [value, positive, otherwise].map(|operand| at_least(operand, Binding::Sum));
            let text = format!("{value} > 0.0f ? {positive} : {otherwise}");
            (text, Binding::Conditional)
        }
    }
}
