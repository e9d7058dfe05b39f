//! Models and drawn inputs for the image in HIL: every law and every term, and values that no sensor should send.

use super::board_bus::NODE;
use super::cost::COSTLIEST_TERMS;
use compensator_core::can::{
    CommandFrame, Message, MotionFrame, SealFrame, SurroundingsFrame, SyncFrame, TorqueFrame,
};
use compensator_core::configuration::Configuration;
use compensator_core::parameter::ParameterId;
use compensator_core::term::TermKind;
use compensator_core::{Compensator, Fixed, LawKind};
use core_image::PERIOD_S;
use firmware::control;
use firmware::reference_joint::configuration;
use joint_bus::replay::Plan;
use joint_bus::replay::plan::{PlannedFrame, SkippedFrames};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The causes of the friction damper: backlash, directions, and a level with a formula.
const DAMPER_TERMS: [TermKind; 3] =
    [TermKind::Backlash, TermKind::DirectionAsymmetry, TermKind::LookupTable];

/// A model of the course, by its name in `core-cost.tsv`.
pub struct Model {
    pub name: String,
    pub friction: Configuration,
}

/// Returns true if both number types accept a model, alone and in a compensator, which leaves terms out; and the driver also in
/// its current loop.
fn is_legal(friction: &Configuration) -> bool {
    friction.model.build::<f32>(PERIOD_S).is_ok()
        && friction.model.build::<Fixed>(PERIOD_S).is_ok()
        && Compensator::<f32>::build(friction, control::PERIOD_S).is_ok()
        && Compensator::<f32>::build(friction, PERIOD_S).is_ok()
        && Compensator::<Fixed>::build(friction, PERIOD_S).is_ok()
}

/// Returns a model with these terms. Each parameter that is not set is drawn: of magnitudes that decrease, the first that
/// the number types accept.
fn drawn(law: LawKind, terms: &[TermKind], random: &mut Pcg64Mcg) -> Configuration {
    let mut drawn = configuration(law, terms);
    // The inputs that are missing must fade within a course, and the joint warm up.
    (drawn.compensator.hold_s, drawn.compensator.fade_s) = (0.02, 0.03);
    drawn.model.set(ParameterId::WarmUpEnergy, 0.5);
    for id in terms.iter().flat_map(|term| term.parameters()) {
        if drawn.model.get(*id) != 0.0 {
            continue;
        }
        let is_negative = id.range()[0] < 0.0 && random.random_bool(0.5);
        let share = random.random_range(0.1f32..0.3) * if is_negative { -1.0 } else { 1.0 };
        // Together, the terms of a model share what the levels permit.
        let first = if terms.len() > 1 { 2 } else { 0 };
        let legal = (first..12).find_map(|exponent| {
            let mut tried = drawn.clone();
            tried.model.set(*id, share * 0.1f32.powi(exponent));
            is_legal(&tried).then_some(tried)
        });
        drawn = legal.unwrap_or(drawn);
    }
    drawn
}

fn model(law: LawKind, terms: &[TermKind], random: &mut Pcg64Mcg) -> Model {
    let names = std::iter::once(law.name()).chain(terms.iter().map(|term| term.name()));
    let name = names.collect::<Vec<_>>().join(" + ");
    Model { name, friction: drawn(law, terms, random) }
}

/// Returns every law, every term with a law that does not contain it, and as many terms as a model holds.
pub fn models() -> Vec<Model> {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let laws = LawKind::ALL.iter().map(|law| model(*law, &[], &mut random));
    let mut models: Vec<Model> = laws.collect();
    for term in TermKind::ALL {
        let mut laws = [LawKind::ImprovedLugre, LawKind::Lugre].into_iter();
        let law = laws.find(|law| configuration(*law, &[*term]).model.terms.contains(term));
        models.push(model(law.expect("a law without this term"), &[*term], &mut random));
    }
    for (name, law, terms) in [
        ("lugre + the three terms of the damper", LawKind::Lugre, &DAMPER_TERMS[..]),
        (
            "improved-lugre + the eight most expensive terms",
            LawKind::ImprovedLugre,
            &COSTLIEST_TERMS,
        ),
    ] {
        models.push(Model { name: name.to_owned(), ..model(law, terms, &mut random) });
    }
    models
}

/// Speeds, rad/s: rest, presliding, the Stribeck range, sliding, and beyond the envelope of 12 rad/s. Each holds for as many
/// samples as [`SEGMENT`].
const SPEEDS: [f32; 8] = [0.0, 1e-4, -0.02, 0.1, -0.3, 1.5, -8.0, 20.0];
const SEGMENT: u32 = 40;

/// Samples of which the last third has no frame of side load, pressure, temperature and reference.
const GAP: u32 = 160;

/// Time from sample to sample, ns.
const PERIOD_NS: u64 = (PERIOD_S * 1e9) as u64;

/// Draws the inputs of a course of this many samples.
pub fn course(samples: u32, seed: u64) -> Plan {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut frames = Vec::new();
    let (mut velocity_rad_s, mut position_rad) = (0.0f32, random.random_range(-3.0f32..3.0));
    let phase = random.random_range(0..SPEEDS.len());
    for sample in 0..samples {
        let speed = SPEEDS[(phase + (sample / SEGMENT) as usize) % SPEEDS.len()];
        velocity_rad_s +=
            (speed - velocity_rad_s) * 0.1 + 0.01 * speed * random.random_range(-1.0..1.0);
        position_rad += velocity_rad_s * PERIOD_S;
        let mut push = |message| {
            let due_ns = u64::from(sample) * PERIOD_NS;
            frames.push(PlannedFrame { due_ns, message });
        };
        let shown = match sample % 97 {
            50 => f32::NAN,
            51 => f32::INFINITY,
            52 => -0.0,
            _ => velocity_rad_s,
        };
        if sample % 89 < 80 {
            push(Message::Motion(NODE, MotionFrame { velocity_rad_s: shown, position_rad }));
        }
        slow_inputs(sample, velocity_rad_s, &mut random, &mut push);
        push(Message::Sync(SyncFrame::of(sample)));
    }
    Plan {
        frames,
        samples: samples.into(),
        period_s: PERIOD_S.into(),
        recorded: Vec::new(),
        skipped: SkippedFrames::default(),
        sha256: String::new(),
        lines: 0,
        first_bad: None,
    }
}

/// Sends the covariates and the set-point at their own rates, some of them illegal.
fn slow_inputs(
    sample: u32,
    velocity_rad_s: f32,
    random: &mut Pcg64Mcg,
    push: &mut impl FnMut(Message),
) {
    let odd = |value: f32, random: &mut Pcg64Mcg| match random.random_range(0..12) {
        0 => f32::NAN,
        1 => -value,
        2 => 1e3 * value,
        _ => value,
    };
    if sample.is_multiple_of(5) {
        let load_torque_nm = random.random_range(-5.0..5.0);
        let torque_nm = random.random_range(-3.0..3.0);
        push(Message::Torque(NODE, TorqueFrame { torque_nm, load_torque_nm }));
    }
    if sample % GAP > 2 * GAP / 3 {
        return;
    }
    if sample % 4 == 1 {
        let current_a = odd(random.random_range(-10.0..10.0), random);
        let counter = (sample / 4) as u8;
        push(Message::Command(NODE, CommandFrame::new(current_a, velocity_rad_s, counter)));
    }
    if sample % 7 == 2 {
        let radial_force_n = odd(random.random_range(20.0..90.0), random);
        let pressure_diff_pa = odd(random.random_range(1e4..2.5e5), random);
        push(Message::Seal(NODE, SealFrame { radial_force_n, pressure_diff_pa }));
    }
    if sample % 9 == 3 {
        let temperature_c = odd(random.random_range(5.0..40.0), random);
        let auxiliary = random.random_range(-0.2..1.0);
        push(Message::Surroundings(NODE, SurroundingsFrame { temperature_c, auxiliary }));
    }
}
