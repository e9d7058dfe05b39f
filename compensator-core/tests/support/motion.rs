//! Motions and their true friction: the reference every step is held against.
//!
//! Each motion is computed once at 1 us by the classical Runge-Kutta method and recorded every
//! 50 us, the finest rate a step is tried at. Where the motion is prescribed, only the bristle is
//! integrated; in stick-slip a mass on a slowly drawn spring is, so that friction makes the motion,
//! and the velocity it took is then handed to the steps: they are judged on friction alone, and a
//! small error cannot grow into another trajectory.

use super::{Input, Seal};
use core::f64::consts::TAU;

/// Time between recorded points, s.
pub const RECORD_PERIOD: f64 = 50e-6;

/// Fine steps of 1 us between records.
pub const SUBSTEPS: u32 = 50;

/// One recorded moment.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub input: Input,
    pub friction: f64,
}

/// A motion of a seal, with its true friction.
pub struct Motion {
    pub name: &'static str,
    pub seal: Seal,
    /// Side load before the first point, N.
    pub first_force: f64,
    pub points: Vec<Point>,
}

/// The motions of the accuracy table.
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

/// 0.1 mrad to and fro, half of what the bristles can bend, five times a second.
fn presliding(t: f64) -> Input {
    moving(1e-4 * 5.0 * TAU * (5.0 * TAU * t).cos())
}

/// 1 rad/s to and fro, once a second.
pub fn reversal(t: f64) -> Input {
    moving((TAU * t).sin())
}

/// From a tenth of the Stribeck velocity to ten times it and back.
fn sweep(t: f64) -> Input {
    moving(0.1 * 10f64.powf(-(0.5 * TAU * t).cos()))
}

/// As `reversal`, under a side load and a pressure that change meanwhile.
fn loaded(t: f64) -> Input {
    Input {
        radial_force: 50.0 + 40.0 * (3.0 * TAU * t).sin(),
        radial_force_rate: 40.0 * 3.0 * TAU * (3.0 * TAU * t).cos(),
        pressure_pa: 1.5e5 - 1.4e5 * (0.5 * TAU * t).cos(),
        ..reversal(t)
    }
}

/// Two seconds of a prescribed motion, with `substeps` between records.
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

/// A mass (0.05 kg m^2) drawn over the seal by a spring (20 Nm/rad) at 0.05 rad/s.
fn stick_slip(seal: &Seal, duration: f64, substeps: u32) -> Vec<Point> {
    const INERTIA: f64 = 0.05;
    const SPRING: f64 = 20.0;
    const DRAWN_AT: f64 = 0.05;
    let dt = RECORD_PERIOD / f64::from(substeps);
    let mut state = [0.0; 3];
    let slope = |t: f64, [position, velocity, deflection]: [f64; 3]| {
        let input = Input { velocity, ..Input::default() };
        let rate = seal.deflection_rate(deflection, &input);
        let friction = seal.friction(deflection, rate, &input);
        [velocity, (SPRING * (DRAWN_AT * t - position) - friction) / INERTIA, rate]
    };
    record(seal, duration, substeps, |t| {
        state = runge_kutta(slope, t, state, dt);
        (state[2], Input { velocity: state[1], ..Input::default() })
    })
}

/// Calls `advance` with the time of each fine step and records every last of `substeps`.
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
