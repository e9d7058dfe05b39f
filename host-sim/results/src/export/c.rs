//! Export as one C header: state, inputs, and one step in `float`. It requires C99 and `math.h` only.
//!
//! The step implements `compensator_core::law::bristle` (backward Euler in closed form) and the static laws. The core
//! uses a table for the Stribeck curve and C calls `expf`. They differ by at most 1.3e-5 of `F_S - F_C`, so the torques
//! are close but not bit-identical. The header contains none of the compensator's guards (age of inputs, slew rate,
//! limits). A control loop without guards of its own should use the core.

use super::ExportedModel;
use super::c_terms::{TermCode, number, term_code};
use compensator_core::{LawKind, ParameterId as Id, Parameters, TermKind};
use friction_identification::data::JointKind;
use friction_identification::params::{ParameterFile, unit};
use std::fmt::Write as _;

/// Returns the terms of a model, including those that are part of its law.
fn active_terms(model: &Parameters<f32>) -> Vec<TermKind> {
    let own = TermKind::ALL.iter().filter(|kind| model.law.includes(**kind));
    own.chain(&model.terms).copied().collect()
}

/// Exports the model as a C header.
pub(super) fn export(file: &ParameterFile, source: &str) -> Result<ExportedModel, String> {
    let model = &file.friction().model;
    let mut all = TermCode::default();
    for kind in active_terms(model) {
        let Some(term) = term_code(kind, model) else {
            return Err(format!(
                "{}: the C header does not support this term, which needs a memory or a table: use --to rust or --to record",
                kind.name()
            ));
        };
        for (fields, more) in [(&mut all.inputs, term.inputs), (&mut all.state, term.state)] {
            more.into_iter().for_each(|field| {
                if !fields.contains(&field) {
                    fields.push(field);
                }
            });
        }
        all.code.extend(term.code);
    }
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
         \x20* command and limit the sum. Velocity is in {speed}. Parameters:\n\
         \x20*\n",
        file.spec.full_name(),
        source.replace("*/", "* /")
    );
    for id in model.active() {
        let _ = writeln!(
            text,
            " *   {:<28} {:?} {}",
            id.name(),
            model.get(id),
            unit(id.info(), file.joint)
        );
    }
    text += " */\n#ifndef FRICTION_H\n#define FRICTION_H\n\n#include <math.h>\n\n";
    text +=
        "/* Initialise all fields with zero. */\ntypedef struct {\n    float bristle_torque_nm;\n";
    all.state.iter().for_each(|field| text += &format!("    float {field};\n"));
    text += "} friction_state;\n\n/* Units as in the names. All values must be finite. */\ntypedef struct {\n    float velocity_rad_s;\n";
    all.inputs.iter().for_each(|field| text += &format!("    float {field};\n"));
    text += "} friction_inputs;\n\n";
    step(&mut text, model, &all);
    text += "\n#endif\n";
    let unguarded = "the header contains only the law: the control loop must check the age of its inputs and limit slew rate and current";
    Ok(ExportedModel { content: text.into_bytes(), notes: vec![unguarded.to_owned()] })
}

/// Writes the function `friction_step`.
fn step(text: &mut String, model: &Parameters<f32>, all: &TermCode) {
    let n = |id: Id| number(model.get(id));
    let law = model.law;
    text.push_str(
        "/* dt_s: time since the last step, s; must be positive. */\n\
         static inline float friction_step(friction_state *state, const friction_inputs *in, float dt_s)\n{\n",
    );
    let mut emit = |code: &str| *text += &format!("    {code}\n");
    emit(&format!("const float velocity_max = {};", number(model.envelope.velocity_max_rad_s)));
    emit("const float velocity = fmaxf(-velocity_max, fminf(velocity_max, in->velocity_rad_s));");
    emit("const float speed = fabsf(velocity);");
    emit("const float direction = (float)((velocity > 0.0f) - (velocity < 0.0f));");
    let (coulomb, static_level) = (n(Id::CoulombTorque), n(Id::StaticTorque));
    if law == LawKind::LugreAsymmetric {
        let either = |positive: &str, negative: Id| {
            format!("state->bristle_torque_nm > 0.0f ? {positive} : {};", n(negative))
        };
        emit(&format!("float coulomb = {}", either(&coulomb, Id::CoulombTorqueNegative)));
        emit(&format!("float static_level = {}", either(&static_level, Id::StaticTorqueNegative)));
    } else {
        let static_level = if law.has_stribeck_curve() { &static_level } else { &coulomb };
        emit(&format!("float coulomb = {coulomb}, static_level = {static_level};"));
    }
    emit("float level_scale = 1.0f, level_asymmetry = 0.0f;");
    emit("float viscous_scale = 1.0f, carried_rate = 0.0f, torque = 0.0f;");
    all.code.iter().for_each(|code| emit(code));
    if law.has_stribeck_curve() {
        let ratio = format!("speed / {}", n(Id::StribeckVelocity));
        let power = if model.terms.contains(&TermKind::StribeckShape) {
            format!("powf({ratio}, {})", n(Id::StribeckExponent))
        } else {
            format!("({ratio}) * ({ratio})")
        };
        emit(&format!("const float towards_rest = expf(-({power}));"));
        emit("float level = coulomb + (static_level - coulomb) * towards_rest;");
    } else {
        emit("float level = coulomb;");
    }
    emit("level *= level_scale * (1.0f + level_asymmetry * direction);");
    emit(&format!("torque += {} * viscous_scale * velocity;", n(Id::ViscousFriction)));
    if law.has_bristles() {
        bristles(&mut emit, model);
    } else {
        match law {
            LawKind::Extended => {
                let along = if model.choices.printed_extended { "" } else { " * velocity" };
                emit(&format!("torque += {}{along} * speed;", n(Id::QuadraticFriction)));
                emit(&format!("torque += {} * velocity * speed * speed;", n(Id::CubicFriction)));
            }
            LawKind::Atan => {
                let (torque, slope) = (n(Id::AtanTorque), n(Id::AtanSlope));
                emit(&format!("torque += {torque} * atanf({slope} * velocity);"));
            }
            _ => {}
        }
        for unused in ["state", "speed", "dt_s", "static_level", "carried_rate"] {
            emit(&format!("(void){unused};"));
        }
        emit("return level * direction + torque;");
    }
    text.push_str("}\n");
}

/// Writes the bristle step and the return statement.
fn bristles(emit: &mut impl FnMut(&str), model: &Parameters<f32>) {
    let n = |id: Id| number(model.get(id));
    emit(&format!("const float stiffness = {} * dt_s;", n(Id::BristleStiffness)));
    emit("const float held = state->bristle_torque_nm + stiffness * carried_rate;");
    emit("const float rate = (level * velocity - speed * held) / (level + stiffness * speed);");
    emit("const float bound = static_level * level_scale * (1.0f + fabsf(level_asymmetry));");
    emit("state->bristle_torque_nm = fmaxf(-bound, fminf(bound, held + stiffness * rate));");
    let damping = match model.law {
        LawKind::Dahl => "0.0f".to_owned(),
        _ if model.choices.damping_fades => format!("{} * towards_rest", n(Id::BristleDamping)),
        _ => n(Id::BristleDamping),
    };
    emit(&format!("torque += {damping} * (rate + carried_rate);"));
    emit("return state->bristle_torque_nm + torque;");
}
