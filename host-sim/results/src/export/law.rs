//! The friction laws as statements: one step, and the start from a measured torque.
//!
//! The statements are those of `compensator_core::law::bristle` (backward Euler in closed form) and of the static laws. The
//! core takes the Stribeck curve from a table, which is within 1.3e-5 of the exponential function here.

use super::effects::{BRISTLE_TORQUE, Effects};
use super::program::{Expr, Program};
use super::terms;
use compensator_core::{LawKind, ParameterId as Id, Parameters, TermKind};

/// Input with the measured torque for [`start`], Nm.
pub const MEASURED_TORQUE: &str = "measured_torque_nm";

/// Number of bisections of a start: one for each bit of a `float`, and some for a torque far below the level.
pub(super) const BISECTIONS: usize = 32;

/// Returns the name of the first term that cannot be exported as statements.
pub fn unsupported_term(model: &Parameters<f32>) -> Option<&'static str> {
    let mut terms = active_terms(model).into_iter();
    terms.find(|kind| !terms::is_supported(*kind)).map(TermKind::name)
}

/// Returns the terms of a model, including those that are part of its law.
fn active_terms(model: &Parameters<f32>) -> Vec<TermKind> {
    let of_law = TermKind::ALL.iter().filter(|kind| model.law.includes(**kind));
    of_law.chain(&model.terms).copied().collect()
}

/// Returns one step: the result is the friction torque, and the statements advance the state.
pub fn step(model: &Parameters<f32>) -> Program {
    let mut program = Program::default();
    let shared = Shared::new(&mut program, model);
    let torque = if model.law.has_bristles() {
        let held = Expr::state(BRISTLE_TORQUE);
        let levels = shared.levels(&mut program, &held, "");
        let bristles = shared.bristles(&mut program, &levels, &held, "");
        let held = program.set_state(BRISTLE_TORQUE, bristles.held);
        plus(held, &bristles.damping_torque) + shared.added_torque(&mut program)
    } else {
        let levels = shared.levels(&mut program, &Expr::number(0.0), "");
        levels.level * &shared.effects.direction + shared.added_torque(&mut program)
    };
    program.result = Some(torque);
    program.without_unused()
}

/// Returns the start: the result is the bristle torque from which [`step`] returns the measured torque, as far as the level
/// permits. `None` if the law has no bristles. The state that the statements set is of no use.
pub fn start(model: &Parameters<f32>) -> Option<Program> {
    if !model.law.has_bristles() {
        return None;
    }
    let mut program = Program::default();
    let shared = Shared::new(&mut program, model);
    // The torque outside the bristles does not depend on their deflection.
    let added = shared.added_torque(&mut program);
    let wanted = program.define("wanted", Expr::input(MEASURED_TORQUE) - added);
    let zero = Expr::number(0.0);
    let positive = shared.levels(&mut program, &Expr::number(1.0), "_positive");
    let negative = shared.levels(&mut program, &zero, "_negative");
    let mut most = positive.bound.clone();
    let mut least = negative.bound.negative();
    for round in 0..BISECTIONS {
        let name = |what: &str| format!("{what}_{round}");
        let middle = program.define(name("middle"), (&least + &most) * Expr::number(0.5));
        let suffix = name("");
        let levels = if model.law == LawKind::LugreAsymmetric {
            shared.levels(&mut program, &middle, &suffix)
        } else {
            positive.clone()
        };
        let bristles = shared.bristles(&mut program, &levels, &middle, &suffix);
        let torque = plus(bristles.held, &bristles.damping_torque);
        let missing = program.define(name("missing"), &wanted - torque);
        least = program.define(name("least"), missing.if_positive(&middle, &least));
        most = program.define(name("most"), missing.if_positive(&most, &middle));
    }
    program.result = Some(most);
    Some(program.without_unused())
}

/// What does not depend on the bristle torque.
struct Shared<'a> {
    model: &'a Parameters<f32>,
    effects: Effects,
}

/// Levels of the friction.
#[derive(Clone)]
struct Levels {
    /// Level at the velocity, Nm.
    level: Expr,
    /// Largest level in either direction, Nm.
    bound: Expr,
    /// Stribeck curve at the velocity: 1 at rest, 0 in fast sliding.
    towards_rest: Option<Expr>,
}

/// Bristles after a step.
struct Bristles {
    /// Their torque, Nm.
    held: Expr,
    /// Torque of their damping, Nm.
    damping_torque: Option<Expr>,
}

impl<'a> Shared<'a> {
    /// Adds the statements of the motion and of the terms.
    fn new(program: &mut Program, model: &'a Parameters<f32>) -> Self {
        let limit = model.envelope.velocity_max_rad_s.into();
        let limit = program.define("velocity_max", limit);
        let velocity = program.define("velocity", Expr::input("velocity_rad_s").within(&limit));
        let speed = program.define("speed", velocity.abs());
        let direction = program.define("direction", velocity.sign());
        let mut effects = Effects {
            velocity,
            speed,
            direction,
            added_coulomb: None,
            added_static: None,
            level_scale: None,
            level_asymmetry: None,
            viscous_scale: None,
            stiffness_scale: None,
            carried_rate: None,
            stribeck_exponent: None,
            torque: None,
        };
        for kind in active_terms(model) {
            terms::add(program, &mut effects, kind, model);
        }
        Self { model, effects }
    }

    fn number(&self, id: Id) -> Expr {
        self.model.get(id).into()
    }

    /// Adds the levels for this bristle torque. `suffix` ends the names of the variables.
    fn levels(&self, program: &mut Program, held: &Expr, suffix: &str) -> Levels {
        let law = self.model.law;
        let base = |positive: Id, negative: Id| match law {
            LawKind::LugreAsymmetric => {
                held.if_positive(&self.number(positive), &self.number(negative))
            }
            _ => self.number(positive),
        };
        program.comment("Level of the friction at this velocity.");
        let mut define = |what: &str, value: Expr| program.define(format!("{what}{suffix}"), value);
        let coulomb = base(Id::CoulombTorque, Id::CoulombTorqueNegative);
        let coulomb = define("coulomb", plus(coulomb, &self.effects.added_coulomb));
        let has_curve = law.has_stribeck_curve();
        let static_level = if has_curve {
            base(Id::StaticTorque, Id::StaticTorqueNegative)
        } else {
            self.number(Id::CoulombTorque)
        };
        let static_level = define("static_level", plus(static_level, &self.effects.added_static));
        let towards_rest = has_curve.then(|| {
            let ratio = &self.effects.speed / self.number(Id::StribeckVelocity);
            let power = match &self.effects.stribeck_exponent {
                Some(exponent) => ratio.power(exponent),
                None => &ratio * &ratio,
            };
            define("towards_rest", power.negative().exp())
        });
        let level = match &towards_rest {
            Some(towards_rest) => &coulomb + (&static_level - &coulomb) * towards_rest,
            None => coulomb,
        };
        let (mut level, mut bound) = (
            times(level, &self.effects.level_scale),
            times(static_level, &self.effects.level_scale),
        );
        if let Some(asymmetry) = &self.effects.level_asymmetry {
            level = level * (Expr::number(1.0) + asymmetry * &self.effects.direction);
            bound = bound * (Expr::number(1.0) + asymmetry.abs());
        }
        Levels { level: define("level", level), bound: define("bound", bound), towards_rest }
    }

    /// Adds the step of the bristles from this bristle torque.
    fn bristles(
        &self,
        program: &mut Program,
        levels: &Levels,
        held: &Expr,
        suffix: &str,
    ) -> Bristles {
        let Effects { velocity, speed, carried_rate, .. } = &self.effects;
        program.comment("Bristles: backward Euler, solved for the bristle torque.");
        let mut define = |what: &str, value: Expr| program.define(format!("{what}{suffix}"), value);
        let stiffness = self.number(Id::BristleStiffness) * Expr::period();
        let stiffness = define("stiffness", stiffness);
        let carried = carried_rate.as_ref().map(|rate| &stiffness * rate);
        let held = define("held", plus(held.clone(), &carried));
        // A side load bends the bristles whatever the play in the drive.
        let stiffness =
            define("stiffness_in_play", times(stiffness, &self.effects.stiffness_scale));
        let level = &levels.level;
        let rate = (level * velocity - speed * &held) / (level + &stiffness * speed);
        let rate = define("rate", rate);
        let next = (held + stiffness * &rate).within(&levels.bound);
        let damping = match (self.model.law, &levels.towards_rest) {
            (LawKind::Dahl, _) => None,
            (_, Some(towards_rest)) if self.model.choices.damping_fades => {
                Some(self.number(Id::BristleDamping) * towards_rest)
            }
            _ => Some(self.number(Id::BristleDamping)),
        };
        let damping_torque = damping.map(|damping| damping * plus(rate, carried_rate));
        Bristles { held: next, damping_torque }
    }

    /// Returns the torque that depends on neither the level nor the bristles: viscous friction and the terms' torque.
    fn added_torque(&self, program: &mut Program) -> Expr {
        let Effects { velocity, speed, .. } = &self.effects;
        let viscous = times(self.number(Id::ViscousFriction), &self.effects.viscous_scale);
        let mut torque = plus(viscous * velocity, &self.effects.torque);
        match self.model.law {
            LawKind::Extended => {
                let quadratic = self.number(Id::QuadraticFriction);
                let printed = self.model.choices.printed_extended;
                let quadratic = if printed { quadratic } else { quadratic * velocity } * speed;
                let cubic = self.number(Id::CubicFriction) * velocity * speed * speed;
                torque = torque + quadratic + cubic;
            }
            LawKind::Atan => {
                let atan = (self.number(Id::AtanSlope) * velocity).atan();
                torque = torque + self.number(Id::AtanTorque) * atan;
            }
            _ => {}
        }
        program.comment("Torque that depends on neither the level nor the bristles.");
        program.define("added_torque", torque)
    }
}

/// Adds an effect.
fn plus(base: Expr, added: &Option<Expr>) -> Expr {
    match added {
        Some(added) => base + added,
        None => base,
    }
}

/// Multiplies by an effect.
fn times(base: Expr, factor: &Option<Expr>) -> Expr {
    match factor {
        Some(factor) => base * factor,
        None => base,
    }
}
