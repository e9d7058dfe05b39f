//! Random joints and inputs for property tests.
//!
//! A case is a bristle law with a random combination of terms, parameters over many decades, and samples that jump
//! within the envelope. The velocity has any bit pattern. Every case for floats is valid. Validation refuses some of
//! the cases for fixed point.

use compensator_core::model::Sample;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
use compensator_core::{LawKind, ParameterId as Id, Parameters, Real, TermKind};
use proptest::prelude::*;

/// A bristle law with terms, parameters and samples.
#[derive(Clone, Debug)]
pub struct Case {
    pub law: LawKind,
    pub terms: Vec<TermKind>,
    pub values: Vec<(Id, f64)>,
    pub period: f64,
    pub samples: Vec<(u64, [f64; 8])>,
}

/// Ranges of the parameters, as exponents of ten: the full range of floats, or a range for fixed point.
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

/// Range of each column in [`Case::sample`], in the unit of the log.
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
        lookup_values(decades.size),
    )
        .prop_map(move |(coulomb, stiffness, excess, positive, signed, lookup)| {
            let negative = coulomb * (1.0 + 9.0 * positive[5]);
            // At the corner of the envelope, load and pressure may lower the level to about half, or raise it.
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
            values.extend(lookup);
            values
        })
}

/// Lookup tables with random knots over a part of a random column.
fn lookup_values(size: f64) -> impl Strategy<Value = Vec<(Id, f64)>> {
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
        // A delay must not exceed its delay line.
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

    /// Returns the sample for a velocity and covariates, each 0..=1 over its range.
    pub fn sample(velocity: f64, covariates: &[f64; 8], force_before: f64) -> Sample<f64> {
        let [force, pressure, position, temperature, load, time, acceleration, auxiliary] =
            *covariates;
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
            auxiliary: auxiliary * 1000.0 - 200.0,
            ..Sample::default()
        }
    }
}

/// Converts a sample to another number type.
pub fn converted<T: Real>(sample: &Sample<f64>) -> Sample<T> {
    sample.map(T::from_f64)
}
