//! Motions and their reference friction, with which the tests compare every scheme.
//!
//! The classical Runge-Kutta method integrates each motion at 1 us. Every 50 us, the shortest sample period of a
//! scheme, the result is recorded. For a prescribed motion, only the bristle is integrated. In stick-slip, a mass on
//! a slowly pulled spring is integrated too, so that friction determines the motion. The schemes then receive the
//! recorded velocity. So only their friction is compared, and a small error cannot change the trajectory.

use super::{Input, Seal};
use core::f64::consts::TAU;

/// Period of the recorded points, s.
pub const RECORD_PERIOD: f64 = 50e-6;

/// Number of integration steps of 1 us per record.
pub const SUBSTEPS: u32 = 50;

/// One recorded point.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub input: Input,
    pub friction: f64,
}

/// A motion of a seal, with its reference friction.
pub struct Motion {
    pub name: &'static str,
    pub seal: Seal,
    /// Side load before the first point, N.
    pub first_force: f64,
    pub points: Vec<Point>,
}

/// Returns the motions of the accuracy table.
pub fn all() -> Vec<Motion> {
    let seal = Seal::JOINT.unloaded();
    vec![
        prescribed("presliding", seal, SUBSTEPS, presliding),
        prescribed("reversal", seal, SUBSTEPS, reversal),
        prescribed("Stribeck sweep", seal, SUBSTEPS, sweep),
        Motion {
            name: "stick-slip",
            seal,
            first_force: 0.0,
            points: stick_slip(&seal, 3.0, SUBSTEPS),
        },
        prescribed("varying load and pressure", Seal::JOINT, SUBSTEPS, loaded),
    ]
}

fn moving(velocity: f64) -> Input {
    Input { velocity, ..Input::default() }
}

/// Oscillation of 0.1 mrad at 5 Hz: half of the maximum bristle deflection.
fn presliding(t: f64) -> Input {
    moving(1e-4 * 5.0 * TAU * (5.0 * TAU * t).cos())
}

/// Oscillation with 1 rad/s at 1 Hz.
pub fn reversal(t: f64) -> Input {
    moving((TAU * t).sin())
}

/// Sweep from 0.1 to 10 times the Stribeck velocity and back.
fn sweep(t: f64) -> Input {
    moving(0.1 * 10f64.powf(-(0.5 * TAU * t).cos()))
}

/// As `reversal`, with varying side load and pressure.
fn loaded(t: f64) -> Input {
    Input {
        radial_force: 50.0 + 40.0 * (3.0 * TAU * t).sin(),
        radial_force_rate: 40.0 * 3.0 * TAU * (3.0 * TAU * t).cos(),
        pressure_pa: 1.5e5 - 1.4e5 * (0.5 * TAU * t).cos(),
        ..reversal(t)
    }
}

/// Integrates 2 s of a prescribed motion, with `substeps` steps per record.
pub fn prescribed(
    name: &'static str,
    seal: Seal,
    substeps: u32,
    input: impl Fn(f64) -> Input,
) -> Motion {
    let dt = RECORD_PERIOD / f64::from(substeps);
    let mut deflection = 0.0;
    let points = record(&seal, 2.0, substeps, |t| {
        let slope = |t, [z]: [f64; 1]| [seal.deflection_rate(z, &input(t))];
        [deflection] = runge_kutta(slope, t, [deflection], dt);
        (deflection, input(t + dt))
    });
    Motion { name, seal, first_force: input(0.0).radial_force, points }
}

/// Integrates an inertia (0.05 kg m^2) that a spring (20 Nm/rad) pulls at 0.05 rad/s.
fn stick_slip(seal: &Seal, duration: f64, substeps: u32) -> Vec<Point> {
    const INERTIA: f64 = 0.05;
    const SPRING: f64 = 20.0;
    const PULL_VELOCITY: f64 = 0.05;
    let dt = RECORD_PERIOD / f64::from(substeps);
    let mut state = [0.0; 3];
    let slope = |t: f64, [position, velocity, deflection]: [f64; 3]| {
        let input = Input { velocity, ..Input::default() };
        let rate = seal.deflection_rate(deflection, &input);
        let friction = seal.friction(deflection, rate, &input);
        [velocity, (SPRING * (PULL_VELOCITY * t - position) - friction) / INERTIA, rate]
    };
    record(seal, duration, substeps, |t| {
        state = runge_kutta(slope, t, state, dt);
        (state[2], Input { velocity: state[1], ..Input::default() })
    })
}

/// Calls `advance` with the time of each integration step and records the last of every `substeps` steps.
fn record(
    seal: &Seal,
    duration: f64,
    substeps: u32,
    mut advance: impl FnMut(f64) -> (f64, Input),
) -> Vec<Point> {
    let dt = RECORD_PERIOD / f64::from(substeps);
    let records = (duration / RECORD_PERIOD).round() as u32;
    (0..records)
        .map(|record| {
            let mut last = (0.0, Input::default());
            for substep in 0..substeps {
                last = advance(f64::from(record * substeps + substep) * dt);
            }
            let (deflection, input) = last;
            let rate = seal.deflection_rate(deflection, &input);
            Point { input, friction: seal.friction(deflection, rate, &input) }
        })
        .collect()
}

/// One step of the classical fourth-order Runge-Kutta method.
fn runge_kutta<const N: usize>(
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
    t: f64,
    x: [f64; N],
    dt: f64,
) -> [f64; N] {
    let along = |k: [f64; N], share: f64| core::array::from_fn(|i| x[i] + share * dt * k[i]);
    let a = slope(t, x);
    let b = slope(t + 0.5 * dt, along(a, 0.5));
    let c = slope(t + 0.5 * dt, along(b, 0.5));
    let d = slope(t + dt, along(c, 1.0));
    core::array::from_fn(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
}
