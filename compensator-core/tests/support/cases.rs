//! Random joints and random inputs, for the properties that must hold of all of them.
//!
//! A case is a bristle law with terms in random company, parameters over many decades, and samples
//! that jump about the envelope with any bit pattern for a velocity. For floats the ranges are made
//! so that every case is legal; of the cases for fixed point a part is refused, and says so.

use compensator_core::model::Sample;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
use compensator_core::{LawKind, ParameterId as Id, Parameters, Real, TermKind};
use proptest::prelude::*;

/// Bristle laws, and parameters over many decades.
#[derive(Clone, Debug)]
pub struct Case {
    pub law: LawKind,
    pub terms: Vec<TermKind>,
    pub values: Vec<(Id, f64)>,
    pub period: f64,
    pub samples: Vec<(u64, [f64; 8])>,
}

/// How far apart the ranges reach: all a float can be asked for, or what suits fixed point.
#[derive(Clone, Copy)]
pub struct Decades {
    level: (f64, f64),
    stiffness: (f64, f64),
    period: (f64, f64),
    size: f64,
}

pub const FLOAT: Decades =
    Decades { level: (-8.0, 4.3), stiffness: (-3.0, 9.0), period: (-9.0, 6.0), size: 1.0 };
pub const FIXED: Decades =
    Decades { level: (-1.5, 2.2), stiffness: (1.0, 6.0), period: (-4.5, -2.5), size: 30.0 };

/// What each column ranges over in [`Case::sample`], as a person writes it.
const COLUMN_RANGES: [(f64, f64); 8] = [
    (-12.0, 12.0),
    (-10.0, 10.0),
    (0.0, 7.2e6),
    (0.0, 100.0),
    (0.0, 3e5),
    (-50.0, 150.0),
    (-26.0, 26.0),
    (-200.0, 800.0),
];

fn ten_to(range: (f64, f64)) -> impl Strategy<Value = f64> {
    (range.0..range.1).prop_map(|exponent| 10f64.powf(exponent))
}

fn values(decades: Decades) -> impl Strategy<Value = Vec<(Id, f64)>> {
    let signed = || -1.0..1.0f64;
    (
        ten_to(decades.level),
        ten_to(decades.stiffness),
        [0.0..2.0f64, 0.0..2.0],
        [0.0..1.0f64, 0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0],
        [signed(), signed(), signed(), signed(), signed(), signed(), signed(), signed()],
        unknown(decades.size),
    )
        .prop_map(move |(coulomb, stiffness, excess, positive, signed, unknown)| {
            let negative = coulomb * (1.0 + 9.0 * positive[5]);
            // Load and pressure may halve the level at the far corner, or raise it.
            let least = -0.2 * coulomb;
            let load = |share: f64, size: f64| (share * coulomb).max(least) / size;
            let size = decades.size;
            let mut values = vec![
                (Id::CoulombTorque, coulomb),
                (Id::StaticTorque, coulomb * (1.0 + excess[0])),
                (Id::CoulombTorqueNegative, negative),
                (Id::StaticTorqueNegative, negative * (1.0 + excess[1])),
                (Id::StribeckVelocity, 0.01 + positive[0]),
                (Id::BristleStiffness, stiffness),
                (Id::BristleDamping, positive[1] * size * 10.0),
                (Id::ViscousFriction, positive[2] * size),
                (Id::RadialForceCoulomb, load(signed[0], 100.0)),
                (Id::RadialForceStaticExcess, positive[3] * coulomb / 100.0),
                (Id::PressureCoulomb, load(signed[1], 3e5)),
                (Id::PressureStaticExcess, positive[4] * coulomb / 3e5),
                (Id::RadialForceRate, signed[2] * 1e-4 * size),
                (Id::TemperatureViscosity, signed[3] * 0.02),
                (Id::RippleSine, signed[4] * 0.6),
                (Id::RippleCosine, signed[5] * 0.6),
                (Id::CoulombAsymmetry, signed[6] * 0.9),
                (Id::ViscousAsymmetry, signed[7]),
                (Id::TorqueOffset, signed[0] * size),
                (Id::QuadraticDrag, positive[5] * size),
                (Id::DwellGain, positive[5] * coulomb),
                (Id::DriftAmplitude, signed[1] * 0.9),
                (Id::DriftRate, positive[2] * 1e-7),
                (Id::LoadCoulomb, (signed[2] * 0.2).max(-0.2) * coulomb / 26.0),
                (Id::Inertia, positive[0] * size),
                (Id::BacklashTravel, positive[1] * 0.1),
                (Id::StribeckExponent, 0.3 + 5.0 * positive[3]),
                (Id::TemperatureCoulomb, signed[6] * 0.02),
                (Id::TorqueRippleOrder2, 20.0 * positive[0]),
                (Id::TorqueRippleSine2, signed[4] * size),
                (Id::TorqueRippleCosine2, signed[5] * size),
            ];
            values.extend(unknown);
            values
        })
}

/// Knots of any height over a part of any column.
fn unknown(size: f64) -> impl Strategy<Value = Vec<(Id, f64)>> {
    let knot = || 0.0..1.0f64;
    let knots = || [knot(), knot(), knot(), knot(), knot(), knot()];
    let ends = [knot(), knot()];
    (0..8usize, ends, knots(), knots()).prop_map(move |(column, ends, torque, level)| {
        let (least, most) = COLUMN_RANGES[column];
        let at = |share: f64| least + (most - least) * share;
        let lower = ends[0].min(ends[1]);
        let mut values = vec![
            (Id::LookupColumn, column as f64),
            (Id::LookupLower, at(lower)),
            (Id::LookupUpper, at(ends[0].max(ends[1]).max(lower + 0.01))),
        ];
        values.extend(LOOKUP_TORQUES.into_iter().zip(torque.map(|k| (2.0 * k - 1.0) * size)));
        values.extend(LOOKUP_LEVELS.into_iter().zip(level.map(|k| 3.0 * k - 0.9)));
        values
    })
}

pub fn case(decades: Decades) -> impl Strategy<Value = Case> {
    let laws = vec![
        LawKind::Dahl,
        LawKind::Lugre,
        LawKind::LugreAsymmetric,
        LawKind::ImprovedLugre,
        LawKind::ImprovedLugre,
    ];
    let most = if cfg!(feature = "terms") { 8 } else { 0 };
    let unit = || 0.0..1.0f64;
    let unit = [unit(), unit(), unit(), unit(), unit(), unit(), unit(), unit()];
    (
        proptest::sample::select(laws),
        proptest::sample::subsequence(TermKind::ALL, 0..=most),
        values(decades),
        ten_to(decades.period),
        proptest::collection::vec((velocity_bits(), unit), 1..40),
    )
        .prop_map(|(law, terms, values, period, samples)| Case {
            law,
            terms,
            values,
            period,
            samples,
        })
}

/// Any bit pattern, and as often a velocity a joint may have.
fn velocity_bits() -> impl Strategy<Value = u64> {
    let usual = (-12.0..12.0f64).prop_map(f64::to_bits);
    let slow = (-1e-3..1e-3f64).prop_map(f64::to_bits);
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 5e-324].map(f64::to_bits);
    prop_oneof![any::<u64>(), usual, slow, proptest::sample::select(odd.to_vec())]
}

impl Case {
    pub fn parameters<S: Real>(&self) -> Parameters<S> {
        let mut parameters = Parameters::<S>::new(self.law);
        parameters.choices.allow_active = true;
        // A delay is at most as long as its line.
        parameters.set(Id::ChannelDelay, S::from_f64((20.7 * self.period).min(10.0)));
        parameters.envelope.position_max_rad = 10.0;
        for (id, value) in &self.values {
            parameters.set(*id, S::from_f64(*value));
        }
        for kind in &self.terms {
            parameters.add_term(*kind);
        }
        parameters
    }

    /// The sample of these covariates (each 0..=1 over its range) at a velocity.
    pub fn sample(velocity: f64, covariates: &[f64; 8], force_before: f64) -> Sample<f64> {
        let [force, pressure, position, temperature, load, time, acceleration, own] = *covariates;
        Sample {
            velocity_rad_s: velocity,
            position_rad: position * 20.0 - 10.0,
            acceleration_rad_s2: acceleration * 2000.0 - 1000.0,
            radial_force_n: force * 100.0,
            radial_force_change_n: (force - force_before) * 100.0,
            pressure_diff_mpa: pressure * 0.3,
            temperature_c: temperature * 200.0 - 50.0,
            load_torque_nm: (load * 2.0 - 1.0) * 26.0,
            campaign_time_h: time * 2000.0,
            auxiliary: own * 1000.0 - 200.0,
            ..Sample::default()
        }
    }
}

/// A sample in another number.
pub fn converted<T: Real>(sample: &Sample<f64>) -> Sample<T> {
    sample.map(T::from_f64)
}
