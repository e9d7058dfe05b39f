//! The extension terms as statements, the same as in `compensator_core::term`. They stand before those of the law.

use super::effects::{BRISTLE_TORQUE, Effects};
use super::program::{Expr, Program};
use compensator_core::term::TORQUE_RIPPLE_PARAMETERS;
use compensator_core::{ParameterId as Id, Parameters, TermKind as Kind};

/// Maximum contact age of `dwell-time-static`, s, as in the core.
const CONTACT_AGE_MAX_S: f32 = 1000.0;

/// Returns true if a term can be exported as statements. The others need a table or the memory of many samples.
pub(super) fn is_supported(kind: Kind) -> bool {
    !matches!(kind, Kind::LookupTable | Kind::WarmUp)
}

/// Adds the statements of a term. A term that [`is_supported`] excludes adds none.
pub(super) fn add(
    program: &mut Program,
    effects: &mut Effects,
    kind: Kind,
    model: &Parameters<f32>,
) {
    let n = |id: Id| Expr::number(model.get(id));
    let one = Expr::number(1.0);
    program.comment(format!("Term {}.", kind.name()));
    match kind {
        Kind::RadialForceCoulomb => {
            let static_level =
                model.get(Id::RadialForceCoulomb) + model.get(Id::RadialForceStaticExcess);
            let force = Expr::input("radial_force_n");
            load_levels(program, effects, &force, model.get(Id::RadialForceCoulomb), static_level);
        }
        Kind::PressureCoulomb => {
            let static_level = model.get(Id::PressureCoulomb) + model.get(Id::PressureStaticExcess);
            let pressure = Expr::input("pressure_diff_pa");
            load_levels(program, effects, &pressure, model.get(Id::PressureCoulomb), static_level);
        }
        Kind::LoadTorqueCoulomb => {
            let level = model.get(Id::LoadCoulomb);
            load_levels(program, effects, &Expr::input("load_torque_nm").abs(), level, level);
        }
        Kind::RadialForceRate => radial_force_rate(program, effects, model),
        Kind::TemperatureViscous => {
            let factor = by_temperature(model, Id::TemperatureViscosity);
            program.scale_by("viscous_scale", &mut effects.viscous_scale, factor);
        }
        Kind::TemperatureCoulomb => {
            let factor = by_temperature(model, Id::TemperatureCoulomb);
            program.scale_by("level_scale", &mut effects.level_scale, factor);
        }
        Kind::PositionRipple => {
            let ripple = wave(n(Id::RippleOrder), n(Id::RippleSine), n(Id::RippleCosine));
            program.scale_by("level_scale", &mut effects.level_scale, one + ripple);
        }
        Kind::DirectionAsymmetry => {
            let asymmetry = &mut effects.level_asymmetry;
            program.add_to("level_asymmetry", asymmetry, n(Id::CoulombAsymmetry));
            let factor = one + n(Id::ViscousAsymmetry) * &effects.direction;
            program.scale_by("viscous_scale", &mut effects.viscous_scale, factor);
        }
        Kind::DwellTimeStatic => dwell_time_static(program, effects, model),
        Kind::Backlash => backlash(program, effects, model),
        Kind::TimeDrift => {
            let factor = by_time(model);
            program.scale_by("level_scale", &mut effects.level_scale, factor);
        }
        Kind::StribeckShape => effects.stribeck_exponent = Some(n(Id::StribeckExponent)),
        Kind::GravityImbalance => {
            let position = Expr::input("position_rad");
            let gravity =
                n(Id::GravitySine) * position.sin() + n(Id::GravityCosine) * position.cos();
            program.add_to("torque", &mut effects.torque, gravity);
        }
        Kind::TorqueRipple => {
            for ids in TORQUE_RIPPLE_PARAMETERS.iter().filter(|ids| model.get(ids[0]) > 0.0) {
                let [order, sine, cosine] = ids.map(n);
                program.add_to("torque", &mut effects.torque, wave(order, sine, cosine));
            }
        }
        Kind::QuadraticDrag => {
            let drag = n(Id::QuadraticDrag) * &effects.velocity * &effects.speed;
            program.add_to("torque", &mut effects.torque, drag);
        }
        // What is exported is the friction. It has no part of the rigid body, and no offset or delay of a channel.
        Kind::TorqueOffset | Kind::UnmodelledInertia | Kind::ChannelDelay | Kind::LoadGain => {}
        Kind::LookupTable | Kind::WarmUp => {}
    }
    program.end_comment();
}

/// A load that raises both levels.
fn load_levels(
    program: &mut Program,
    effects: &mut Effects,
    load: &Expr,
    coulomb: f32,
    static_level: f32,
) {
    let (coulomb, static_level) = (Expr::number(coulomb), Expr::number(static_level));
    program.add_to("added_coulomb", &mut effects.added_coulomb, coulomb * load);
    program.add_to("added_static", &mut effects.added_static, static_level * load);
}

/// A factor of run-in and wear.
fn by_time(model: &Parameters<f32>) -> Expr {
    let n = |id: Id| Expr::number(model.get(id));
    let time = Expr::input("campaign_time_s");
    let run_in = n(Id::DriftAmplitude) * (time.negative() / n(Id::DriftTime)).exp();
    Expr::number(1.0) + run_in + n(Id::DriftRate) * time
}

/// A wave over the position.
fn wave(order: Expr, sine: Expr, cosine: Expr) -> Expr {
    let angle = order * Expr::input("position_rad");
    sine * angle.sin() + cosine * angle.cos()
}

fn radial_force_rate(program: &mut Program, effects: &mut Effects, model: &Parameters<f32>) {
    let [previous, has_previous] = ["previous_radial_force_n", "has_previous_radial_force"];
    let force = Expr::input("radial_force_n");
    let change = &force - Expr::state(previous);
    let rate = Expr::number(model.get(Id::RadialForceRate)) * change / Expr::period();
    let rate = Expr::state(has_previous).if_positive(&rate, &Expr::number(0.0));
    program.add_to("carried_rate", &mut effects.carried_rate, rate);
    program.set_state(previous, force);
    program.set_state(has_previous, Expr::number(1.0));
}

/// Position within the play, from -1 to 1, and the stiffness while the drive crosses it.
fn backlash(program: &mut Program, effects: &mut Effects, model: &Parameters<f32>) {
    let (zero, one) = (Expr::number(0.0), Expr::number(1.0));
    let half_travel = 0.5 * model.get(Id::BacklashTravel);
    if half_travel <= 0.0 {
        return;
    }
    let share = &effects.speed * Expr::period() / Expr::number(half_travel);
    let crossing = program.define("crossing", share);
    let room = &one - Expr::state("play") * &effects.direction;
    let room = if model.get(Id::BacklashUnloaded) > 0.5 {
        // Elastic torsion in the opposite direction is released first, with the flanks in contact.
        let releasing = (Expr::state(BRISTLE_TORQUE) * &effects.direction).negative();
        releasing.if_positive(&zero, &room)
    } else {
        room
    };
    let room = program.define("room", room);
    let beyond = crossing.max(&Expr::number(f32::MIN_POSITIVE));
    let free = (&room - &crossing).if_positive(&one, &(&room / beyond));
    let missing = Expr::number(1.0 - model.get(Id::BacklashStiffnessRatio));
    let scale = program.define("contact", &one - missing * free);
    program.scale_by("stiffness_scale", &mut effects.stiffness_scale, scale);
    let play = Expr::state("play") + crossing.min(&room) * &effects.direction;
    program.set_state("play", play.within(&one));
}

/// An exponential decrease with temperature.
fn by_temperature(model: &Parameters<f32>, rate: Id) -> Expr {
    let [rate, reference] = [rate, Id::TemperatureReference].map(|id| model.get(id));
    (Expr::number(-rate) * (Expr::input("temperature_c") - Expr::number(reference))).exp()
}

fn dwell_time_static(program: &mut Program, effects: &mut Effects, model: &Parameters<f32>) {
    let n = |id: Id| Expr::number(model.get(id));
    let one = || Expr::number(1.0);
    let aged = Expr::state("contact_age_s") + Expr::period();
    let aged = aged.min(&CONTACT_AGE_MAX_S.into());
    let renewed = one() + Expr::period() / n(Id::DwellTravel) * &effects.speed;
    let age = program.set_state("contact_age_s", aged / renewed);
    let added = n(Id::DwellGain) * (one() + age / n(Id::DwellTime)).ln();
    program.add_to("added_static", &mut effects.added_static, added);
}
