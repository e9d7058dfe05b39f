//! Duration of the core's step on one processor core of this PC: a line per number type and law, in seconds per step.
//!
//! `tests/bench` runs this example. A step depends on the one before it, so the result is the latency of a step, the cost of
//! one joint. Steps of independent joints would overlap. The last line is for a fit: the step with its derivatives by six
//! parameters.

use compensator_core::{
    Fixed, FrictionModel, LawKind, ModelState, ParameterId, Parameters, Real, Sample,
};
use friction_fit::Dual;
use std::hint::black_box;
use std::time::Instant;

const STEPS: usize = 60_000;
const REPETITIONS: usize = 40;

/// Returns a joint at a driver's 20 kHz, where its coefficients fit a fixed-point number.
fn model<T: Real>(law: LawKind) -> FrictionModel<T>
where
    T::Setting: Real<Setting = T::Setting>,
{
    use ParameterId as Id;
    let values = [
        (Id::CoulombTorque, 1.5),
        (Id::StaticTorque, 2.1),
        (Id::StribeckVelocity, 0.1),
        (Id::BristleStiffness, 1e4),
        (Id::BristleDamping, 0.3),
        (Id::ViscousFriction, 0.05),
        (Id::RadialForceCoulomb, 1e-3),
        (Id::PressureCoulomb, 1e-7),
        (Id::RadialForceRate, 1e-7),
    ];
    let mut parameters = Parameters::<T::Setting>::new(law);
    for (id, value) in values {
        if parameters.active().any(|active| active == id) {
            parameters.set(id, T::Setting::from_f64(value));
        }
    }
    parameters.build(T::Setting::from_f64(50e-6)).expect("a joint that builds")
}

/// Returns samples with presliding, reversals and sliding, under varying side load and pressure.
fn samples<T: Real>() -> Vec<Sample<T>> {
    let sample = |i: usize| {
        let t = i as f64 * 1e-3;
        let force = |t: f64| 200.0 + 100.0 * (0.9 * t).sin();
        Sample {
            velocity_rad_s: T::from_f64(
                (0.7 * t).sin() * (1.0 + (0.11 * t).sin()) * (3.1 * t).cos(),
            ),
            radial_force_n: T::from_f64(force(t)),
            radial_force_change_n: T::from_f64(force(t) - force(t - 1e-3)),
            pressure_diff_mpa: T::from_f64(0.5 + 0.3 * (0.05 * t).sin()),
            ..Sample::default()
        }
    };
    (0..STEPS).map(sample).collect()
}

/// Returns the shortest duration per step over all repetitions.
fn shortest_step_s(mut run: impl FnMut()) -> f64 {
    let time = |()| {
        let begin = Instant::now();
        run();
        begin.elapsed().as_secs_f64()
    };
    (0..REPETITIONS).map(|_| ()).map(time).fold(f64::INFINITY, f64::min) / STEPS as f64
}

/// Measures the step of a law and prints a line.
fn print_line<T: Real>(name: &str, law: LawKind)
where
    T::Setting: Real<Setting = T::Setting>,
{
    let (model, samples) = (model::<T>(law), samples::<T>());
    let seconds = shortest_step_s(|| {
        let mut state = ModelState::default();
        for sample in black_box(&samples) {
            black_box(model.step(&mut state, sample));
        }
    });
    println!("{name}\t{}\t{seconds:e}", law.name());
}

/// Measures the step with the derivatives by the law's parameters and prints a line.
fn print_line_with_derivatives() {
    const NUMBER: usize = 6;
    let plain = model::<f64>(LawKind::Lugre);
    let law = plain.law().plain_bristles().expect("a lugre model");
    let mut parameters = Parameters::<Dual<NUMBER>>::new(LawKind::Lugre);
    let values = [law.coulomb, law.static_level, 0.1, 1e4, law.damping, law.viscous];
    for (index, (id, value)) in LawKind::Lugre.parameters().iter().zip(values).enumerate() {
        parameters.set(*id, Dual::parameter(value, index));
    }
    let model: FrictionModel<Dual<NUMBER>> = parameters.build_unchecked(Dual::from_f64(50e-6));
    let velocities: Vec<f64> = samples::<f64>().iter().map(|s| s.velocity_rad_s).collect();
    let law = model.law().plain_bristles().expect("a lugre model");
    let seconds = shortest_step_s(|| {
        let mut bristle = Dual::default();
        let mut sum = [0.0; NUMBER];
        for velocity in black_box(&velocities) {
            let torque = law.step(
                &mut bristle,
                Dual::from_f64(*velocity),
                &compensator_core::effect::NoEffect,
            );
            for (sum, g) in sum.iter_mut().zip(torque.gradient) {
                *sum += g;
            }
        }
        black_box(sum);
    });
    println!("f64 with 6 derivatives\tlugre\t{seconds:e}");
}

fn main() {
    for law in [LawKind::Lugre, LawKind::ImprovedLugre] {
        print_line::<f32>("f32", law);
        print_line::<f64>("f64", law);
        print_line::<Fixed>("Fixed", law);
    }
    print_line_with_derivatives();
}
