//! Each term against its formula, and each term doing nothing.
//!
//! A term is what the diagnosis deploys: it must do to the torque what its cause means, in every number,
//! and with its neutral parameters must not be there at all, to the bit. Terms that act on steady sliding are checked there, where the friction has a closed form,
//! against that form; the four with a memory of their own have a test each. A list at the end makes
//! sure no kind was forgotten.
#![cfg(feature = "terms")]

use compensator_core::model::{Sample, State};
use compensator_core::term::{KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, MAX_TERMS};
use compensator_core::{
    Fixed, LawKind, Model, ParameterId as Id, Parameters, Quantity, Real, TermKind,
};

const PERIOD: f64 = 1e-3;
const COULOMB: f64 = 1.5;
const STATIC: f64 = 2.25;
const STRIBECK: f64 = 0.25;
const STIFFNESS: f64 = 1e3;
const DAMPING: f64 = 0.5;
const VISCOUS: f64 = 0.25;

fn base<S: Real>() -> Parameters<S> {
    let mut parameters = Parameters::<S>::new(LawKind::Lugre);
    for (id, value) in [
        (Id::CoulombTorque, COULOMB),
        (Id::StaticTorque, STATIC),
        (Id::StribeckVelocity, STRIBECK),
        (Id::BristleStiffness, STIFFNESS),
        (Id::BristleDamping, DAMPING),
        (Id::ViscousFriction, VISCOUS),
    ] {
        parameters.set(id, S::from_f64(value));
    }
    parameters.choices.damping_fades = true;
    parameters.envelope.position_max_rad = 10.0;
    parameters.envelope.velocity_max_rad_s = 8.0;
    parameters
}

fn with_term<S: Real>(kind: TermKind, values: &[(Id, f64)]) -> Parameters<S> {
    let mut parameters = base();
    assert!(parameters.add_term(kind));
    for (id, value) in values {
        parameters.set(*id, S::from_f64(*value));
    }
    parameters
}

fn build<T: Real>(parameters: &Parameters<T::Setting>) -> Model<T> {
    parameters.build(<T::Setting as Real>::from_f64(PERIOD)).expect("legal")
}

/// What a joint meets while it moves to and fro, all covariates alive.
fn lively<T: Real>(step: u32) -> Sample<T> {
    let t = f64::from(step) * PERIOD;
    let number = T::from_f64;
    Sample {
        velocity_rad_s: number((3.0 * t).sin() * (0.7 * t).sin().powi(3)),
        position_rad: number(3.0 * t.sin()),
        acceleration_rad_s2: number(20.0 * (2.0 * t).cos()),
        radial_force_n: number(50.0 + 40.0 * (5.0 * t).sin()),
        radial_force_change_n: number(0.2 * (5.0 * t).cos()),
        pressure_diff_mpa: number(0.15 + 0.1 * t.cos()),
        temperature_c: number(10.0 + t),
        load_torque_nm: number(5.0 * (4.0 * t).sin()),
        campaign_time_h: number(t),
        auxiliary: number(0.3 * t),
        ..Sample::default()
    }
}

fn neutral_is_absent<T: Real>() {
    for kind in TermKind::ALL {
        let without = build::<T>(&base());
        let with = build::<T>(&with_term(*kind, &[]));
        let (mut a, mut b) = (State::default(), State::default());
        for step in 0..10_000 {
            let sample = lively(step);
            let expected = without.step(&mut a, &sample).value();
            let found = with.step(&mut b, &sample).value();
            assert_eq!(found, expected, "{} at {step}", kind.name());
            assert_eq!(b.bristle_torque_nm.value(), a.bristle_torque_nm.value());
        }
    }
}

#[test]
fn a_term_with_its_neutral_parameters_leaves_every_bit() {
    neutral_is_absent::<f64>();
    neutral_is_absent::<f32>();
    neutral_is_absent::<Fixed>();
}

/// `F_C + (F_S - F_C) exp(-(v/v_s)^2)`.
fn level(coulomb: f64, static_level: f64, speed: f64) -> f64 {
    coulomb + (static_level - coulomb) * (-(speed / STRIBECK).powi(2)).exp()
}

/// Friction after sliding long at `velocity` under constant covariates.
fn settled<T: Real>(parameters: &Parameters<T::Setting>, sample: &Sample<f64>) -> f64 {
    let model = build::<T>(parameters);
    let sample = Sample { radial_force_change_n: T::zero(), ..sample.map(T::from_f64) };
    let mut state = State::default();
    (0..20_000).map(|_| model.step(&mut state, &sample).value()).last().unwrap()
}

/// Friction in steady sliding at a velocity under one sample's covariates, from what each term means.
type Formula = fn(f64, &Sample<f64>) -> f64;

/// A kind, its parameters and its formula.
type Sliding = (TermKind, Vec<(Id, f64)>, Formula);

/// The kinds that act on steady sliding.
fn sliding() -> Vec<Sliding> {
    fn rubs(coulomb: f64, static_level: f64, v: f64) -> f64 {
        level(coulomb, static_level, v.abs()) * v.signum() + VISCOUS * v
    }
    vec![
        (
            TermKind::RadialForceCoulomb,
            vec![(Id::RadialForceCoulomb, 0.0125), (Id::RadialForceStaticExcess, 0.005)],
            |v, s| rubs(COULOMB + 0.0125 * s.radial_force_n, STATIC + 0.0175 * s.radial_force_n, v),
        ),
        (
            TermKind::PressureCoulomb,
            vec![(Id::PressureCoulomb, 2.4e-6), (Id::PressureStaticExcess, 1e-6)],
            |v, s| {
                let pascal = s.pressure_diff_mpa * 1e6;
                rubs(COULOMB + 2.4e-6 * pascal, STATIC + 3.4e-6 * pascal, v)
            },
        ),
        (TermKind::TemperatureViscous, vec![(Id::TemperatureViscosity, 0.02)], |v, s| {
            let thinned = (-0.02 * (s.temperature_c - 20.0)).exp();
            rubs(COULOMB, STATIC, v) + VISCOUS * v * (thinned - 1.0)
        }),
        (TermKind::TemperatureCoulomb, vec![(Id::TemperatureCoulomb, 0.02)], |v, s| {
            let stiffened = (-0.02 * (s.temperature_c - 20.0)).exp();
            level(COULOMB, STATIC, v.abs()) * stiffened * v.signum() + VISCOUS * v
        }),
        (
            TermKind::PositionRipple,
            vec![(Id::RippleSine, 0.125), (Id::RippleCosine, -0.0625), (Id::RippleOrder, 3.0)],
            |v, s| {
                let angle = 3.0 * s.position_rad;
                let ripple = 0.125 * angle.sin() - 0.0625 * angle.cos();
                level(COULOMB, STATIC, v.abs()) * (1.0 + ripple) * v.signum() + VISCOUS * v
            },
        ),
        (
            TermKind::GravityImbalance,
            vec![(Id::GravitySine, 0.5), (Id::GravityCosine, 0.25)],
            |v, s| {
                let angle = s.position_rad;
                rubs(COULOMB, STATIC, v) + 0.5 * angle.sin() + 0.25 * angle.cos()
            },
        ),
        (
            TermKind::TorqueRipple,
            vec![
                (Id::TorqueRippleOrder1, 7.0),
                (Id::TorqueRippleSine1, 0.25),
                (Id::TorqueRippleCosine1, -0.125),
                (Id::TorqueRippleOrder2, 14.0),
                (Id::TorqueRippleSine2, 0.0625),
                (Id::TorqueRippleOrder4, 6.0),
                (Id::TorqueRippleCosine4, 0.5),
                // Of order 0: a place that is not taken adds nothing.
                (Id::TorqueRippleCosine3, 0.5),
            ],
            |v, s| {
                let q = s.position_rad;
                let ripple = 0.25 * (7.0 * q).sin() - 0.125 * (7.0 * q).cos();
                let ripple = ripple + 0.0625 * (14.0 * q).sin() + 0.5 * (6.0 * q).cos();
                rubs(COULOMB, STATIC, v) + ripple
            },
        ),
        (
            TermKind::DirectionAsymmetry,
            vec![(Id::CoulombAsymmetry, 0.125), (Id::ViscousAsymmetry, -0.25)],
            |v, _| {
                let (of_level, of_viscous) = if v > 0.0 { (1.125, 0.75) } else { (0.875, 1.25) };
                level(COULOMB, STATIC, v.abs()) * of_level * v.signum() + VISCOUS * of_viscous * v
            },
        ),
        (TermKind::TorqueOffset, vec![(Id::TorqueOffset, -0.375)], |v, _| {
            rubs(COULOMB, STATIC, v) - 0.375
        }),
        (TermKind::QuadraticDrag, vec![(Id::QuadraticDrag, 0.0625)], |v, _| {
            rubs(COULOMB, STATIC, v) + 0.0625 * v * v.abs()
        }),
        (
            TermKind::TimeDrift,
            vec![(Id::DriftAmplitude, 0.5), (Id::DriftTime, 7200.0), (Id::DriftRate, 1e-6)],
            |v, s| {
                let seconds = s.campaign_time_h * 3600.0;
                let drift = 1.0 + 0.5 * (-seconds / 7200.0).exp() + 1e-6 * seconds;
                level(COULOMB, STATIC, v.abs()) * drift * v.signum() + VISCOUS * v
            },
        ),
        (TermKind::LoadTorqueCoulomb, vec![(Id::LoadCoulomb, 0.0625)], |v, s| {
            let added = 0.0625 * s.load_torque_nm.abs();
            rubs(COULOMB + added, STATIC + added, v)
        }),
        (TermKind::UnmodelledInertia, vec![(Id::Inertia, 0.0625)], |v, s| {
            rubs(COULOMB, STATIC, v) + 0.0625 * s.acceleration_rad_s2
        }),
        (TermKind::LoadGain, vec![(Id::LoadGain, 0.125)], |v, s| {
            rubs(COULOMB, STATIC, v) + 0.125 * s.load_torque_nm
        }),
        // A low exponent reaches far: at 16 v_s a share of 0.018 is left, beyond the table's end.
        (TermKind::StribeckShape, vec![(Id::StribeckExponent, 0.5)], |v, _| {
            let left = (-(v.abs() / STRIBECK).powf(0.5)).exp();
            (COULOMB + (STATIC - COULOMB) * left) * v.signum() + VISCOUS * v
        }),
        (TermKind::DwellTimeStatic, vec![(Id::DwellGain, 0.5), (Id::DwellTravel, 0.01)], |v, _| {
            // In steady sliding the contact is as old as one travel takes.
            let age = 0.01 / v.abs();
            rubs(COULOMB, STATIC + 0.5 * (1.0 + age).ln(), v)
        }),
        (TermKind::LookupTable, drawn_over(Quantity::Temperature, -25.0, 75.0), |v, s| {
            let (torque, change) = drawn_at((s.temperature_c + 25.0) / 100.0);
            level(COULOMB, STATIC, v.abs()) * (1.0 + change) * v.signum() + VISCOUS * v + torque
        }),
    ]
}

#[test]
fn terms_do_in_steady_sliding_what_their_formula_says() {
    let covariates = |velocity: f64| Sample {
        velocity_rad_s: velocity,
        position_rad: 0.75,
        acceleration_rad_s2: -8.0,
        radial_force_n: 40.0,
        pressure_diff_mpa: 0.25,
        temperature_c: 5.0,
        load_torque_nm: -6.0,
        campaign_time_h: 1.5,
        ..Sample::default()
    };
    for (kind, values, formula) in sliding() {
        let mut moved = 0.0f64;
        for velocity in [0.0625, -0.25, 0.5, -1.0, 4.0] {
            let sample = covariates(velocity);
            let expected = formula(velocity, &sample);
            let name = kind.name();
            for (found, tolerance) in [
                (settled::<f64>(&with_term(kind, &values), &sample), 5e-5),
                // The embedded sine is good to 1e-3, fixed point's coefficients are too.
                (settled::<f32>(&with_term(kind, &values), &sample), 1e-3),
                (settled::<Fixed>(&with_term(kind, &values), &sample), 3e-3),
            ] {
                let error = (found - expected).abs();
                assert!(error < tolerance, "{name} at {velocity}: {found}, formula {expected}");
            }
            moved = moved.max((expected - settled::<f64>(&base(), &sample)).abs());
        }
        assert!(moved > 0.01, "{}: a formula that changes nothing tests nothing", kind.name());
    }
}

const TORQUES: [f64; KNOTS] = [0.5, -0.25, 0.125, 0.375, -0.125, 0.25];
const LEVELS: [f64; KNOTS] = [-0.25, 0.125, 0.5, 0.25, -0.5, 0.0625];

/// The parameters of the knots above over a range of a column.
fn drawn_over(column: Quantity, lower: f64, upper: f64) -> Vec<(Id, f64)> {
    let mut values = vec![
        (Id::LookupColumn, f64::from(column.info().column.unwrap())),
        (Id::LookupLower, lower),
        (Id::LookupUpper, upper),
    ];
    values.extend(LOOKUP_TORQUES.into_iter().zip(TORQUES));
    values.extend(LOOKUP_LEVELS.into_iter().zip(LEVELS));
    values
}

/// Torque and change of the level at a share of the range, as one would draw it.
fn drawn_at(share: f64) -> (f64, f64) {
    let along = share.clamp(0.0, 1.0) * 5.0;
    let drawn = |knots: [f64; KNOTS]| {
        knots
            .iter()
            .enumerate()
            .fold(0.0, |sum, (at, knot)| sum + knot * (1.0 - (along - at as f64).abs()).max(0.0))
    };
    (drawn(TORQUES), drawn(LEVELS))
}

#[test]
fn unknown_cause_follows_every_column_within_and_beyond_its_range() {
    /// Column, its range as a person writes it, and how a sample is given a value of it.
    type Row = (Quantity, f64, f64, fn(&mut Sample<f64>, f64));
    let rows: [Row; 8] = [
        (Quantity::Velocity, -2.0, 3.0, |s, x| s.velocity_rad_s = x),
        (Quantity::Position, -1.0, 4.0, |s, x| s.position_rad = x),
        (Quantity::CampaignTime, 3600.0, 360_000.0, |s, x| s.campaign_time_h = x / 3600.0),
        (Quantity::RadialForce, 20.0, 80.0, |s, x| s.radial_force_n = x),
        (Quantity::Pressure, 5e4, 2.5e5, |s, x| s.pressure_diff_mpa = x * 1e-6),
        (Quantity::Temperature, 5.0, 25.0, |s, x| s.temperature_c = x),
        (Quantity::LoadTorque, -20.0, 10.0, |s, x| s.load_torque_nm = x),
        (Quantity::Auxiliary, -300.0, 700.0, |s, x| s.auxiliary = x),
    ];
    let followed = Quantity::ALL.iter().filter(|of| of.info().column.is_some());
    assert!(rows.iter().map(|row| row.0).eq(followed.copied()));
    for (column, lower, upper, put) in rows {
        let values = drawn_over(column, lower, upper);
        for share in [-1.0, -0.125, 0.0, 0.0625, 0.2, 0.45, 0.6, 0.75, 0.9375, 1.0, 1.25] {
            let mut sample = Sample { velocity_rad_s: 1.0, ..Sample::default() };
            put(&mut sample, lower + (upper - lower) * share);
            let (torque, change) = drawn_at(share);
            let v = sample.velocity_rad_s;
            for trust in [1.0, 0.5, 0.0] {
                let sample = Sample { lookup_trust: trust, ..sample };
                let scaled = 1.0 + change * trust;
                let rubs = level(COULOMB, STATIC, v.abs()) * scaled * v.signum() + VISCOUS * v;
                let expected = rubs + torque * trust;
                let built = (
                    with_term(TermKind::LookupTable, &values),
                    with_term(TermKind::LookupTable, &values),
                );
                for (found, tolerance) in [
                    (settled::<f64>(&built.0, &sample), 5e-5),
                    (settled::<f32>(&built.1, &sample), 1e-4),
                    (settled::<Fixed>(&built.1, &sample), 3e-3),
                ] {
                    let error = (found - expected).abs();
                    assert!(error < tolerance, "{column:?} at {share}: {found}, drawn {expected}");
                }
            }
        }
    }
}

#[test]
fn a_formula_over_a_column_is_drawn_through_its_knots() {
    let (lower, upper) = (20.0, 80.0);
    for (number, rise, scale) in
        [(1.0, 0.5, 1.0), (2.0, 1.25, 15.0), (3.0, 1.5, 1.0), (3.0, -0.5, 1.0)]
    {
        let values = [
            (Id::LookupColumn, f64::from(Quantity::RadialForce.info().column.unwrap())),
            (Id::LookupLower, lower),
            (Id::LookupUpper, upper),
            (Id::LookupFormula, number),
            (Id::LookupRise, rise),
            (Id::LookupScale, scale),
        ];
        for knot in 0..KNOTS {
            let x = lower + (upper - lower) * knot as f64 / 5.0;
            let u = knot as f64 / 5.0;
            let change = match number {
                1.0 => rise * u,
                // Michaelis and Menten's, scaled to the rise at the end.
                2.0 => {
                    rise * (x - lower) / (x - lower + scale) * (upper - lower + scale)
                        / (upper - lower)
                }
                _ => (1.0f64 + rise).powf(u) - 1.0,
            };
            let sample = Sample { velocity_rad_s: -1.0, radial_force_n: x, ..Sample::default() };
            let expected = -level(COULOMB, STATIC, 1.0) * (1.0 + change) - VISCOUS;
            let parameters = with_term(TermKind::LookupTable, &values);
            let found = settled::<f64>(&parameters, &sample);
            assert!(
                (found - expected).abs() < 5e-5,
                "{number} at {x}: {found}, formula {expected}"
            );
        }
    }
}

#[test]
fn changing_side_load_bends_the_bristles_by_stiffness_times_eta3() {
    const ETA3: f64 = 2e-6;
    let model = build::<f64>(&with_term(TermKind::RadialForceRate, &[(Id::RadialForceRate, ETA3)]));
    let mut state = State::holding(0.5);
    let sample = Sample { radial_force_change_n: 30.0, ..Sample::default() };
    let friction = model.step(&mut state, &sample);
    let bent = STIFFNESS * ETA3 * 30.0;
    assert!((state.bristle_torque_nm - (0.5 + bent)).abs() < 1e-12);
    // At rest the damping acts on the bending alone.
    let damped = DAMPING * ETA3 * 30.0 / PERIOD;
    assert!((friction - (0.5 + bent + damped)).abs() < 1e-12);
}

/// Speed of starting off, rad/s: slow against Stribeck's, fast against the renewal of the contact.
const STARTING: f64 = 0.05;

/// Peak friction when starting off slowly after resting for `seconds`.
fn breakaway<T: Real>(parameters: &Parameters<T::Setting>, seconds: f64) -> f64 {
    let model = build::<T>(parameters);
    let mut state = State::default();
    let at = |velocity: f64| Sample { velocity_rad_s: T::from_f64(velocity), ..Sample::default() };
    for _ in 0..2000 {
        model.step(&mut state, &at(1.0));
    }
    for _ in 0..(seconds / PERIOD) as u32 {
        model.step(&mut state, &at(0.0));
    }
    let starting = (0..300).map(|_| model.step(&mut state, &at(STARTING)).value());
    starting.fold(0.0, f64::max)
}

#[test]
fn longer_rest_raises_breakaway_by_the_logarithm_and_sliding_forgets_it() {
    // A travel long against the bristles' 2 mrad, so that the contact is still old at the peak.
    let values = [(Id::DwellGain, 0.25), (Id::DwellTime, 0.5), (Id::DwellTravel, 1.0)];
    fn rise<T: Real>(values: &[(Id, f64)]) -> f64 {
        let parameters = with_term(TermKind::DwellTimeStatic, values);
        breakaway::<T>(&parameters, 100.0) - breakaway::<T>(&parameters, 5.0)
    }
    // The sliding before leaves an age of travel over speed, 1 s. Of the static level the Stribeck
    // curve leaves its share at the speed of starting.
    let aged = 0.25 * ((1.0f64 + 101.0 / 0.5) / (1.0 + 6.0 / 0.5)).ln();
    let formula = level(0.0, aged, STARTING);
    for found in [rise::<f64>(&values), rise::<f32>(&values), rise::<Fixed>(&values)] {
        assert!((found / formula - 1.0).abs() < 0.05, "{found}, formula {formula}");
    }
    let plain = breakaway::<f64>(&base(), 100.0) - breakaway::<f64>(&base(), 5.0);
    assert!(plain.abs() < 1e-6, "without the term rest changes nothing: {plain}");
}

#[test]
fn backlash_softens_the_bristles_over_its_travel_after_a_reversal() {
    const TRAVEL: f64 = 2e-3;
    const SHARE: f64 = 0.125;
    const SPEED: f64 = 0.05;
    fn reversed<T: Real>() -> Vec<f64> {
        let values = [(Id::BacklashTravel, TRAVEL), (Id::BacklashStiffnessRatio, SHARE)];
        // One level and no damping, so that the reversal has a closed form.
        let one_level = [(Id::StaticTorque, COULOMB), (Id::BristleDamping, 0.0)];
        let values = [values, one_level].concat();
        let period = <T::Setting as Real>::from_f64(50e-6);
        let model: Model<T> = with_term(TermKind::Backlash, &values).build(period).expect("legal");
        let mut state = State::default();
        let mut bristle = |velocity| {
            let velocity_rad_s = T::from_f64(velocity);
            model.step(&mut state, &Sample { velocity_rad_s, ..Sample::default() });
            state.bristle_torque_nm.value()
        };
        (0..8_000).for_each(|_| assert!(bristle(SPEED) <= COULOMB));
        (0..2_400).map(|_| bristle(-SPEED)).collect()
    }
    // dy/dx = -sigma(x) (1 + y/g) from y = g: y = g (2 exp(-int sigma dx / g) - 1).
    let closed_form = |travel: f64| {
        let bent = STIFFNESS * (SHARE * travel.min(TRAVEL) + (travel - TRAVEL).max(0.0));
        COULOMB * (2.0 * (-bent / COULOMB).exp() - 1.0)
    };
    for (found, tolerance) in
        [(reversed::<f64>(), 5e-3), (reversed::<f32>(), 5e-3), (reversed::<Fixed>(), 2e-2)]
    {
        for (step, found) in found.into_iter().enumerate() {
            let expected = closed_form((step + 1) as f64 * SPEED * 50e-6);
            let error = (found - expected).abs();
            assert!(error < tolerance, "{step}: {found}, closed form {expected}");
        }
    }
    // Without the term the same travel would have turned the torque round.
    let stiff = COULOMB * (2.0 * (-STIFFNESS * TRAVEL / COULOMB).exp() - 1.0);
    assert!(closed_form(TRAVEL) - stiff > 1.0);
}

#[test]
fn backlash_of_a_drive_that_unwinds_is_crossed_at_zero_torque() {
    const TRAVEL: f64 = 2e-3;
    const SPEED: f64 = 0.05;
    let period = 50e-6;
    fn reversed<T: Real>(period: f64) -> Vec<f64> {
        let values = [
            (Id::BacklashTravel, TRAVEL),
            (Id::BacklashStiffnessRatio, 0.0),
            (Id::BacklashUnloaded, 1.0),
            (Id::StaticTorque, COULOMB),
            (Id::BristleDamping, 0.0),
        ];
        let period = <T::Setting as Real>::from_f64(period);
        let model: Model<T> = with_term(TermKind::Backlash, &values).build(period).expect("legal");
        let mut state = State::default();
        let mut bristle = |velocity| {
            let velocity_rad_s = T::from_f64(velocity);
            model.step(&mut state, &Sample { velocity_rad_s, ..Sample::default() });
            state.bristle_torque_nm.value()
        };
        (0..8_000).for_each(|_| assert!(bristle(SPEED) <= COULOMB));
        (0..3_200).map(|_| bristle(-SPEED)).collect()
    }
    // As far as ln 2 of g/sigma0 the bristles unwind: dy/dx = -sigma0 (1 + y/g) from y = g; then the play;
    // then they wind up the other way.
    let unwound = COULOMB / STIFFNESS * 2f64.ln();
    let closed_form = |travel: f64| {
        let bent = travel.min(unwound) + (travel - unwound - TRAVEL).max(0.0);
        COULOMB * (2.0 * (-STIFFNESS * bent / COULOMB).exp() - 1.0)
    };
    for (found, tolerance) in [
        (reversed::<f64>(period), 1e-2),
        (reversed::<f32>(period), 1e-2),
        (reversed::<Fixed>(period), 2e-2),
    ] {
        for (step, found) in found.into_iter().enumerate() {
            let expected = closed_form((step + 1) as f64 * SPEED * period);
            let error = (found - expected).abs();
            assert!(error < tolerance, "{step}: {found}, closed form {expected}");
        }
    }
    assert!(closed_form(unwound + 0.5 * TRAVEL).abs() < 1e-9 && closed_form(8e-3) < -1.3);
}

#[test]
fn delayed_channel_answers_the_velocity_of_d_ago() {
    // Whole and broken numbers of samples, up to the end of the line.
    for samples in [1.0, 7.0, 2.5, 0.25, 30.75, 31.0] {
        let delay = [(Id::ChannelDelay, samples * PERIOD)];
        let delayed = build::<f64>(&with_term(TermKind::ChannelDelay, &delay));
        let plain = build::<f64>(&base());
        let velocity = |step: i32| (0.02 * f64::from(step.max(0))).sin();
        let (mut a, mut b) = (State::default(), State::default());
        for step in 0..2000 {
            let sample = Sample { velocity_rad_s: velocity(step), ..Sample::default() };
            let found = delayed.step(&mut a, &sample);
            let (whole, share) = (samples.floor() as i32, samples.fract());
            let then = velocity(step - whole) * (1.0 - share) + velocity(step - whole - 1) * share;
            let sample = Sample { velocity_rad_s: then, ..Sample::default() };
            let expected = plain.step(&mut b, &sample);
            assert!((found - expected).abs() < 1e-9, "{samples} at {step}: {found} {expected}");
        }
    }
}

#[test]
fn friction_falls_with_the_heat_it_leaves_and_comes_back_as_that_is_lost() {
    let values = [(Id::WarmUpFall, 0.5), (Id::WarmUpEnergy, 500.0), (Id::WarmUpCooling, 40.0)];
    fn run<T: Real>(values: &[(Id, f64)]) -> Vec<f64> {
        let model = build::<T>(&with_term(TermKind::WarmUp, values));
        let mut state = State::default();
        let mut step = |v: f64| {
            let sample = Sample { velocity_rad_s: T::from_f64(v), ..Sample::default() };
            model.step(&mut state, &sample).value()
        };
        let mut seen: Vec<f64> = (0..30_000).map(|_| step(4.0)).collect();
        // At rest for 10 s, then 0.2 s of sliding.
        (0..10_000).for_each(|_| _ = step(0.0));
        seen.extend((0..200).map(|_| step(4.0)));
        seen
    }
    // The same by hand, one step of a millisecond at a time.
    let (mut heat, mut expected) = (0.0f64, Vec::new());
    let mut by_hand = |v: f64| {
        let left = 1.0 - 0.5 * (1.0 - (-heat).exp());
        let friction = if v > 0.0 { level(COULOMB, STATIC, v) * left + VISCOUS * v } else { 0.0 };
        heat += PERIOD * (friction * v / 500.0 - heat / 40.0);
        friction
    };
    expected.extend((0..30_000).map(|_| by_hand(4.0)));
    (0..10_000).for_each(|_| _ = by_hand(0.0));
    expected.extend((0..200).map(|_| by_hand(4.0)));
    assert!(expected[29_999] < 0.92 * expected[0] && expected[30_199] > 1.01 * expected[29_999]);
    for (found, tolerance) in
        [(run::<f64>(&values), 1e-2), (run::<f32>(&values), 1e-2), (run::<Fixed>(&values), 2e-2)]
    {
        // The bristles bend for some milliseconds first.
        for step in (20..30_000).chain(30_020..30_200) {
            let (found, expected) = (found[step], expected[step]);
            assert!((found - expected).abs() < tolerance, "{step}: {found}, by hand {expected}");
        }
    }
}

#[test]
fn no_kind_is_left_untested() {
    let mut tested: Vec<TermKind> = sliding().into_iter().map(|(kind, ..)| kind).collect();
    tested.extend([
        TermKind::RadialForceRate,
        TermKind::Backlash,
        TermKind::ChannelDelay,
        TermKind::WarmUp,
    ]);
    tested.sort();
    assert_eq!(tested, TermKind::ALL);
}

#[test]
fn a_list_is_bounded_and_holds_each_kind_once() {
    let mut parameters = base::<f64>();
    for kind in &TermKind::ALL[..MAX_TERMS] {
        assert!(parameters.add_term(*kind));
        assert!(parameters.add_term(*kind), "a second time is no harm");
    }
    assert_eq!(parameters.terms.len(), MAX_TERMS);
    assert!(!parameters.add_term(TermKind::ALL[MAX_TERMS]), "full");
    assert!(parameters.add_term(TermKind::ALL[0]), "what is there is there");
    assert_eq!(parameters.terms, TermKind::ALL[..MAX_TERMS]);
    // A list made by hand can hold a kind twice; validation refuses it by name.
    let mut twice = base::<f64>();
    twice.terms.extend([TermKind::TorqueOffset, TermKind::TorqueOffset]);
    assert_eq!(twice.validate().unwrap_err().field, "torque-offset");
}

#[test]
fn a_delay_acts_before_the_terms_that_read_the_velocity() {
    let drag = [(Id::QuadraticDrag, 0.5), (Id::ChannelDelay, 3.0 * PERIOD)];
    let mut parameters = with_term::<f64>(TermKind::QuadraticDrag, &drag);
    parameters.add_term(TermKind::ChannelDelay);
    assert_eq!(parameters.terms[0], TermKind::ChannelDelay);
    let model = build::<f64>(&parameters);
    let mut state = State::default();
    let mut step = |velocity| {
        model.step(&mut state, &Sample { velocity_rad_s: velocity, ..Sample::default() })
    };
    let before = (0..2000).map(|_| step(2.0)).last().unwrap();
    let after: Vec<f64> = (0..4).map(|_| step(4.0)).collect();
    assert!(after[..3].iter().all(|friction| (friction - before).abs() < 1e-9));
    assert!(after[3] - before > 0.5 * (16.0 - 4.0) - 0.1);
}
