//! One C header: state, inputs, one step in `float`; C99 with `math.h`, and nothing else.
//!
//! The step is that of `compensator_core::law::bristle` (backward Euler in closed form, through the rate) and of
//! the static laws beside it. Where the core looks the Stribeck curve up in a table, C calls `expf`: the two
//! differ by 1.3e-5 of `F_S - F_C` at most, so the torques are close and not the same bits. None of the
//! compensator's guards is in it (ages, slew, limits): a loop that has none better is better off with the core.

use super::Export;
use super::c_terms::{Lines, lines, number};
use compensator_core::{LawKind, ParameterId as Id, Parameters, TermKind};
use friction_identification::data::JointKind;
use friction_identification::params::{ParameterFile, unit};
use std::fmt::Write as _;

/// The terms of a model, and those its law has in it.
fn acting(model: &Parameters<f32>) -> Vec<TermKind> {
    let own = TermKind::ALL.iter().filter(|kind| model.law.includes(**kind));
    own.chain(&model.terms).copied().collect()
}

/// The file.
pub(super) fn export(file: &ParameterFile, source: &str) -> Result<Export, String> {
    let model = &file.friction().model;
    let mut all = Lines::default();
    for kind in acting(model) {
        let Some(lines) = lines(kind, model) else {
            return Err(format!(
                "{}: the C header has no such term (it needs a memory or a table): take --to rust or --to record",
                kind.name()
            ));
        };
        for (fields, more) in [(&mut all.inputs, lines.inputs), (&mut all.state, lines.state)] {
            more.into_iter().for_each(|field| {
                if !fields.contains(&field) {
                    fields.push(field);
                }
            });
        }
        all.code.extend(lines.code);
    }
    let [torque, speed] = match file.joint {
        JointKind::Revolute => ["Nm", "rad/s"],
        JointKind::Prismatic => ["N", "m/s (names of a revolute joint: read m for rad, N for Nm)"],
    };
    let mut text = format!(
        "/* Friction model {}, written by `host-sim export {} --to c`.\n\
         \x20*\n\
         \x20* friction_step() is to be called once a sample with the time since the last one. It returns the\n\
         \x20* friction torque in {torque}, positive where it has to be driven towards positive velocity: add it to\n\
         \x20* the command to cancel it, and limit the sum. Velocity in {speed}. Parameters:\n\
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
    text += "/* All zero at the start. */\ntypedef struct {\n    float bristle_torque_nm;\n";
    all.state.iter().for_each(|field| text += &format!("    float {field};\n"));
    text += "} friction_state;\n\n/* SI units, by name. All are to be finite. */\ntypedef struct {\n    float velocity_rad_s;\n";
    all.inputs.iter().for_each(|field| text += &format!("    float {field};\n"));
    text += "} friction_inputs;\n\n";
    step(&mut text, model, &all);
    text += "\n#endif\n";
    let unguarded =
        "the header has the law alone: ages, slew and current limits are the loop's own to keep";
    Ok(Export { content: text.into_bytes(), notes: vec![unguarded.to_owned()] })
}

fn step(text: &mut String, model: &Parameters<f32>, all: &Lines) {
    let n = |id: Id| number(model.get(id));
    let law = model.law;
    text.push_str(
        "/* dt_s: time since the last step, s, more than 0. */\n\
         static inline float friction_step(friction_state *state, const friction_inputs *in, float dt_s)\n{\n",
    );
    let mut say = |code: &str| *text += &format!("    {code}\n");
    say(&format!("const float velocity_max = {};", number(model.envelope.velocity_max_rad_s)));
    say("const float velocity = fmaxf(-velocity_max, fminf(velocity_max, in->velocity_rad_s));");
    say("const float speed = fabsf(velocity);");
    say("const float direction = (float)((velocity > 0.0f) - (velocity < 0.0f));");
    let (coulomb, static_level) = (n(Id::CoulombTorque), n(Id::StaticTorque));
    if law == LawKind::LugreAsymmetric {
        let either = |positive: &str, negative: Id| {
            format!("state->bristle_torque_nm > 0.0f ? {positive} : {};", n(negative))
        };
        say(&format!("float coulomb = {}", either(&coulomb, Id::CoulombTorqueNegative)));
        say(&format!("float static_level = {}", either(&static_level, Id::StaticTorqueNegative)));
    } else {
        let static_level = if law.has_stribeck_curve() { &static_level } else { &coulomb };
        say(&format!("float coulomb = {coulomb}, static_level = {static_level};"));
    }
    say("float level_scale = 1.0f, level_asymmetry = 0.0f;");
    say("float viscous_scale = 1.0f, carried_rate = 0.0f, torque = 0.0f;");
    all.code.iter().for_each(|code| say(code));
    if law.has_stribeck_curve() {
        let ratio = format!("speed / {}", n(Id::StribeckVelocity));
        let power = if model.terms.contains(&TermKind::StribeckShape) {
            format!("powf({ratio}, {})", n(Id::StribeckExponent))
        } else {
            format!("({ratio}) * ({ratio})")
        };
        say(&format!("const float towards_rest = expf(-({power}));"));
        say("float level = coulomb + (static_level - coulomb) * towards_rest;");
    } else {
        say("float level = coulomb;");
    }
    say("level *= level_scale * (1.0f + level_asymmetry * direction);");
    say(&format!("torque += {} * viscous_scale * velocity;", n(Id::ViscousFriction)));
    if law.has_bristles() {
        bristles(&mut say, model);
    } else {
        match law {
            LawKind::Extended => {
                let along = if model.choices.printed_extended { "" } else { " * velocity" };
                say(&format!("torque += {}{along} * speed;", n(Id::QuadraticFriction)));
                say(&format!("torque += {} * velocity * speed * speed;", n(Id::CubicFriction)));
            }
            LawKind::Atan => {
                let (torque, slope) = (n(Id::AtanTorque), n(Id::AtanSlope));
                say(&format!("torque += {torque} * atanf({slope} * velocity);"));
            }
            _ => {}
        }
        for unused in ["state", "speed", "dt_s", "static_level", "carried_rate"] {
            say(&format!("(void){unused};"));
        }
        say("return level * direction + torque;");
    }
    text.push_str("}\n");
}

fn bristles(say: &mut impl FnMut(&str), model: &Parameters<f32>) {
    let n = |id: Id| number(model.get(id));
    say(&format!("const float stiffness = {} * dt_s;", n(Id::BristleStiffness)));
    say("const float held = state->bristle_torque_nm + stiffness * carried_rate;");
    say("const float rate = (level * velocity - speed * held) / (level + stiffness * speed);");
    say("const float bound = static_level * level_scale * (1.0f + fabsf(level_asymmetry));");
    say("state->bristle_torque_nm = fmaxf(-bound, fminf(bound, held + stiffness * rate));");
    let damping = match model.law {
        LawKind::Dahl => "0.0f".to_owned(),
        _ if model.choices.damping_fades => format!("{} * towards_rest", n(Id::BristleDamping)),
        _ => n(Id::BristleDamping),
    };
    say(&format!("torque += {damping} * (rate + carried_rate);"));
    say("return state->bristle_torque_nm + torque;");
}
