//! An exported model gives the same torque as the original model.
//!
//! Every law runs through one motion, alone and with every term that the format supports. The record and the Rust
//! constants must be bit-identical to the core. The C header is compiled and must agree within 1e-4 of the largest
//! torque. The simulator formats are compared with the core in steady sliding.

mod compiled_c;
mod drive_torque;
mod on_a_log;
mod simulators;

use compensator_core::configuration::Configuration;
use compensator_core::{
    Compensator, Inputs, LawKind, ModelState, ParameterId as Id, Parameters, Reading, Sample,
    TermKind, record,
};
use compiled_c::{CRow, run_c};
use friction_fit::params::{ParameterFile, emit_model};
use friction_results::export::{ExportFormat, export};
use host_sim::driver_file;
use joint_log::JointKind;
use joint_log::setting::plain;

const PERIOD_S: f32 = 1e-3;
const ROWS: usize = 4000;

/// Terms that the C header supports. A test below checks that it rejects all others.
const C_TERMS: [TermKind; 15] = [
    TermKind::Backlash,
    TermKind::RadialForceCoulomb,
    TermKind::RadialForceRate,
    TermKind::PressureCoulomb,
    TermKind::TemperatureViscous,
    TermKind::PositionRipple,
    TermKind::GravityImbalance,
    TermKind::DirectionAsymmetry,
    TermKind::QuadraticDrag,
    TermKind::DwellTimeStatic,
    TermKind::TimeDrift,
    TermKind::LoadTorqueCoulomb,
    TermKind::StribeckShape,
    TermKind::TorqueRipple,
    TermKind::TemperatureCoulomb,
];

/// A model of this law in which every parameter has an effect.
fn joint(law: LawKind, terms: &[TermKind]) -> Parameters<f32> {
    let mut joint = Parameters::<f32>::new(law);
    for (id, value) in [
        (Id::CoulombTorque, 1.5),
        (Id::StaticTorque, 2.1),
        (Id::CoulombTorqueNegative, 1.3),
        (Id::StaticTorqueNegative, 1.8),
        (Id::StribeckVelocity, 0.07),
        (Id::BristleStiffness, 900.0),
        (Id::BristleDamping, 0.4),
        (Id::ViscousFriction, 0.8),
        (Id::QuadraticFriction, 0.05),
        (Id::CubicFriction, 0.01),
        (Id::AtanTorque, 0.3),
        (Id::AtanSlope, 20.0),
        (Id::RadialForceCoulomb, 4e-3),
        (Id::RadialForceStaticExcess, 1e-3),
        (Id::PressureCoulomb, 2.4e-6),
        (Id::PressureStaticExcess, 3e-7),
        (Id::RadialForceRate, 2e-5),
        (Id::TemperatureViscosity, 0.03),
        (Id::TemperatureCoulomb, 0.01),
        (Id::RippleSine, 0.1),
        (Id::RippleCosine, -0.06),
        (Id::RippleOrder, 3.0),
        (Id::GravitySine, 0.4),
        (Id::GravityCosine, 0.2),
        (Id::CoulombAsymmetry, 0.08),
        (Id::ViscousAsymmetry, -0.1),
        (Id::TorqueOffset, 0.12),
        (Id::QuadraticDrag, 0.07),
        (Id::DwellGain, 0.1),
        (Id::DwellTime, 0.2),
        (Id::DriftAmplitude, 0.2),
        (Id::DriftTime, 7200.0),
        (Id::DriftRate, 1e-7),
        (Id::LoadCoulomb, 0.03),
        (Id::LoadGain, 0.9),
        (Id::Inertia, 0.05),
        (Id::StribeckExponent, 1.4),
        (Id::BacklashTravel, 0.05),
        (Id::BacklashStiffnessRatio, 0.1),
        (Id::TorqueRippleSine1, 0.15),
        (Id::TorqueRippleOrder2, 7.0),
        (Id::TorqueRippleCosine2, 0.1),
    ] {
        joint.set(id, value);
    }
    for term in terms {
        assert!(joint.add_term(*term), "{term:?}");
    }
    // Passivity is not tested here.
    joint.choices.allow_active = true;
    joint
}

fn file(model: &Parameters<f32>) -> ParameterFile {
    let settings = "\n[compensator]\nscale = 0.9\ntorque_limit_nm = 6\ntorque_constant_nm_per_a = 1\n\
         current_limit_a = 26\ngravity = true\n";
    let text = emit_model(model, JointKind::Revolute) + settings;
    driver_file::parse(&text).expect("a legal model")
}

/// A motion back and forth with rests, under varying loads.
fn samples() -> Vec<Sample<f32>> {
    let mut force_before = None;
    (0..ROWS)
        .map(|row| {
            let t = row as f32 * PERIOD_S;
            let rests = (row / 500) % 4 == 3;
            let force = 40.0 + 30.0 * (5.0 * t).sin();
            let change = force - force_before.replace(force).unwrap_or(force);
            Sample {
                velocity_rad_s: if rests { 0.0 } else { 1.2 * (4.0 * t).sin() },
                position_rad: -0.3 * (4.0 * t).cos(),
                position_weight: 1.0,
                radial_force_n: force,
                radial_force_change_n: change,
                pressure_diff_mpa: 0.1 + 0.05 * t.sin(),
                temperature_c: 8.0 + 2.0 * t,
                load_torque_nm: 3.0 * (0.9 * t).cos(),
                acceleration_rad_s2: 4.8 * (4.0 * t).cos(),
                campaign_time_h: 1.0 + t / 3600.0,
                ..Sample::default()
            }
        })
        .collect()
}

/// Torques of the core in double precision, so that the reference is free of `float` rounding. Without the offset of the law `atan`,
/// which is not compensated.
fn torques_of_core(model: &Parameters<f32>) -> Vec<f64> {
    let built =
        model.convert::<f64>().compensated().build::<f64>(f64::from(PERIOD_S)).expect("it builds");
    let mut state = ModelState::default();
    samples().iter().map(|sample| built.step(&mut state, &sample.map(f64::from))).collect()
}

/// Torques of the compiled C header, from a state of zero.
fn torques_of_c(model: &Parameters<f32>) -> Vec<f64> {
    let rows: Vec<CRow> = samples().into_iter().map(CRow::from).collect();
    run_c(&file(model), PERIOD_S, &rows)
}

fn assert_close(model: &Parameters<f32>) {
    let (core, c) = (torques_of_core(model), torques_of_c(model));
    assert_eq!(core.len(), c.len());
    let largest = core.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
    assert!(largest > 1.0, "torque too small for a comparison");
    for (row, (core, c)) in core.iter().zip(&c).enumerate() {
        let apart = (core - c).abs();
        assert!(
            apart < 1e-4 * largest,
            "{:?} {:?}: row {row}: core {core}, C {c}",
            model.law,
            model.terms
        );
    }
}

#[test]
fn export_to_c_of_every_law_matches_core() {
    for law in LawKind::ALL {
        assert_close(&joint(*law, &[]));
        let mut other = joint(*law, &[]);
        other.choices.damping_fades = true;
        other.choices.printed_extended = true;
        assert_close(&other);
    }
}

#[test]
fn export_to_c_of_every_supported_term_matches_core() {
    for terms in C_TERMS.chunks(6) {
        for law in [LawKind::Lugre, LawKind::Stribeck] {
            let of_law: Vec<TermKind> =
                terms.iter().copied().filter(|term| !law.includes(*term)).collect();
            assert_close(&joint(law, &of_law));
        }
    }
}

#[test]
fn export_to_c_of_unsupported_term_returns_error_with_its_name() {
    let is_unsupported = |kind: &&TermKind| kind.is_compensated() && !C_TERMS.contains(kind);
    for kind in TermKind::ALL.iter().filter(is_unsupported) {
        let model = joint(LawKind::Lugre, &[*kind]);
        let error = export(&file(&model), ExportFormat::C, "params.toml")
            .expect_err("it has a memory")
            .to_string();
        assert!(error.contains(kind.name()) && plain(&error).contains("format rust"), "{error}");
        assert!(export(&file(&model), ExportFormat::Rust, "params.toml").is_ok());
    }
}

#[test]
fn export_to_record_is_read_back_from_the_store() {
    let model = joint(LawKind::ImprovedLugre, &[TermKind::PositionRipple]);
    let file = file(&model);
    let bytes = export(&file, ExportFormat::Record, "params.toml").expect("exported").content;
    let mut store = firmware::store::Store::open(firmware::store::memory::MemoryFlash::<2>::new());
    store.save(&bytes, &[0; firmware::store::IDENTITY_BYTES]).expect("saved");
    let mut kept = [0; firmware::store::MAX_PAYLOAD];
    let length = store.load(&mut kept).expect("loaded").length;
    let configuration = record::parse(&kept[..length]).expect("a record");
    assert_eq!(configuration, file.friction());
    assert_eq!(torques_of_core(&configuration.model), torques_of_core(&model));
}

/// Output of `export --to rust` for the model of the example loop; compiled here and in the example.
#[rustfmt::skip]
#[path = "../../../firmware/examples/bare_loop/src/friction.rs"]
mod exported;

fn torques(configuration: &Configuration) -> Vec<u32> {
    let mut compensator = Compensator::<f32>::build(configuration, PERIOD_S).expect("it builds");
    compensator.set_enabled(true);
    let step = |sample: Sample<f32>| {
        let mut inputs = Inputs::velocity(sample.velocity_rad_s);
        inputs.pressure_diff_mpa = Reading::fresh(sample.pressure_diff_mpa);
        compensator.step(&inputs).compensation_torque_nm.to_bits()
    };
    samples().into_iter().map(step).collect()
}

#[test]
fn export_to_rust_is_bit_identical_to_the_file() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware/examples/bare_loop");
    let read = driver_file::read(format!("{folder}/params.toml").as_ref()).expect("a model");
    let written = export(&read, ExportFormat::Rust, "params.toml").expect("exported").content;
    let in_git = std::fs::read(format!("{folder}/src/friction.rs")).expect("in git");
    let how = "host-sim export params.toml --to rust --out src";
    assert!(written == in_git, "src/friction.rs is out of date, regenerate it: {how}");
    assert_eq!(exported::configuration(), read.friction());
    let torques = torques(&exported::configuration());
    assert_eq!(torques, self::torques(&read.friction()));
    assert!(torques.iter().any(|bits| f32::from_bits(*bits) > 1.0));
}
