//! Fingerprints of 10,000 steps of each law.
//!
//! Replay compares results bit for bit. Therefore the bits must not depend on the compiler, on the build profile, or
//! on a feature that the model does not use. The constants are the CRC-32 of all outputs of a model without terms.
//! They are the same with the feature `terms` and without it (`cargo test --no-default-features`). A change to the
//! arithmetic of a step must update them.

use compensator_core::model::{ModelState, Sample};
use compensator_core::{Fixed, LawKind, ParameterId as Id, Parameters, Real};

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// Returns the fingerprint of a law in `T`.
///
/// An integer generator and correctly rounded operations produce the velocity and the load. They use no library
/// functions, which could differ between machines.
fn fingerprint<T: Real<Setting = f32>>(law: LawKind) -> u32 {
    let mut parameters = Parameters::<f32>::new(law)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.2)
        .with(Id::StaticTorqueNegative, 1.75)
        .with(Id::BristleDamping, 30.0)
        .with(Id::ViscousFriction, 0.08)
        .with(Id::RadialForceCoulomb, 0.01)
        .with(Id::PressureCoulomb, 2.4e-6)
        .with(Id::RadialForceRate, 1e-6)
        .with(Id::QuadraticFriction, 0.03)
        .with(Id::AtanTorque, 0.5);
    parameters.choices.damping_fades = true;
    let model = parameters.build::<T>(50e-6).unwrap();
    let mut state = ModelState::default();
    let mut digest = CRC.digest();
    let (mut random, mut velocity, mut force) = (1u32, 0.0f64, 40.0f64);
    for step in 0..10_000u32 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from((random >> 16) as i16) / 32768.0;
        // Rest, creep, Stribeck range and high speed, in both directions.
        let target = [0.0, 0.001, -0.0625, 0.25, -2.0][(step / 400) as usize % 5];
        velocity += (target - velocity) / 64.0 + noise * target / 1024.0;
        let change = noise / 4.0;
        force += change;
        let number = T::from_f64;
        let sample = Sample {
            velocity_rad_s: number(velocity),
            radial_force_n: number(force),
            radial_force_change_n: number(change),
            pressure_diff_mpa: number(0.125),
            ..Sample::default()
        };
        // The conversion to f64 is exact for each number type.
        let friction = model.step(&mut state, &sample).value();
        digest.update(&friction.to_le_bytes());
        digest.update(&state.bristle_torque_nm.value().to_le_bytes());
    }
    digest.finalize()
}

/// Law, fingerprint in `f32`, fingerprint in fixed point.
const FINGERPRINTS: [(LawKind, u32, u32); 6] = [
    (LawKind::Stribeck, 0x783b_911b, 0xae23_c72e),
    (LawKind::Extended, 0x3572_0f70, 0xef9f_9198),
    (LawKind::Dahl, 0x717b_50d1, 0x7745_5699),
    (LawKind::Lugre, 0x200e_dfac, 0x8059_2920),
    (LawKind::LugreAsymmetric, 0x233f_b30e, 0x09ed_16d4),
    (LawKind::ImprovedLugre, 0x1ca7_37a8, 0xec0a_0072),
];

#[test]
fn step_with_plain_law_matches_fingerprint() {
    let found =
        FINGERPRINTS.map(|(law, ..)| (law, fingerprint::<f32>(law), fingerprint::<Fixed>(law)));
    let lines: Vec<String> = found
        .iter()
        .map(|(law, float, fixed)| format!("    (LawKind::{law:?}, {float:#010x}, {fixed:#010x}),"))
        .collect();
    assert!(
        found == FINGERPRINTS,
        "the bits changed; if this is intended, use:\n{}",
        lines.join("\n")
    );
}
