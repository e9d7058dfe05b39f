//! The error for an invalid parameter names the field, its value, the violated bound and the reason.
//!
//! Each case makes a valid set invalid in one way and states the complete expected error. The bound is exact: just
//! inside it, the same set is accepted. Cases of load, pressure and drift are at corners of the declared envelope,
//! where a set that is valid at rest fails.
#![cfg(feature = "terms")]

use compensator_core::parameters::Bound;
use compensator_core::{Fixed, LawKind, ParameterError, ParameterId as Id, Parameters, TermKind};

const PERIOD: f64 = 1e-3;

/// Returns a joint whose levels fall with load and pressure. It is valid at the corner of 100 N and 0.3 MPa.
fn sound(law: LawKind) -> Parameters<f64> {
    let mut parameters = Parameters::new(law)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.0)
        .with(Id::CoulombTorqueNegative, 1.25)
        .with(Id::StaticTorqueNegative, 1.75)
        .with(Id::BristleDamping, 0.25)
        .with(Id::ViscousFriction, 0.25)
        .with(Id::RadialForceCoulomb, -0.005)
        .with(Id::RadialForceStaticExcess, -0.001)
        .with(Id::PressureCoulomb, -1e-6)
        .with(Id::PressureStaticExcess, -1e-6);
    parameters.envelope.velocity_max_rad_s = 8.0;
    parameters
}

fn with_term(kind: TermKind) -> Parameters<f64> {
    let mut parameters = sound(LawKind::Lugre);
    assert!(parameters.add_term(kind));
    parameters
}

/// An invalid `value` of the parameter `id`. The error must have this bound and a reason that contains `word`.
struct RefusalCase {
    from: Parameters<f64>,
    id: Id,
    value: f64,
    bound: Bound,
    word: &'static str,
}

fn refusal(
    from: Parameters<f64>,
    id: Id,
    value: f64,
    bound: Bound,
    word: &'static str,
) -> RefusalCase {
    RefusalCase { from, id, value, bound, word }
}

fn are_close(a: Bound, b: Bound) -> bool {
    let is_close = |a: f32, b: f32| (a - b).abs() <= 1e-6 * b.abs();
    match (a, b) {
        (Bound::AtLeast(a), Bound::AtLeast(b))
        | (Bound::AtMost(a), Bound::AtMost(b))
        | (Bound::MoreThan(a), Bound::MoreThan(b)) => is_close(a, b),
        (a, b) => a == b,
    }
}

/// Cases of invalid numbers, ranges and levels.
fn range_and_level_cases() -> Vec<RefusalCase> {
    use Bound::{AtLeast, AtMost, Finite, MoreThan, Whole};
    let lugre = || sound(LawKind::Lugre);
    let improved = || sound(LawKind::ImprovedLugre);
    // A level must keep 0.1 % of its value, so that rounding cannot make it 0.
    let left = 1.0 - 1e-3;
    vec![
        refusal(lugre(), Id::CoulombTorque, f64::NAN, Finite, "range"),
        refusal(lugre(), Id::BristleStiffness, f64::INFINITY, Finite, "range"),
        refusal(lugre(), Id::CoulombTorque, 0.0, AtLeast(1e-9), "range"),
        refusal(lugre(), Id::StribeckVelocity, 1001.0, AtMost(1e3), "range"),
        refusal(lugre(), Id::StaticTorque, 1.4, AtLeast(1.5), "F_S >= F_C"),
        refusal(
            sound(LawKind::LugreAsymmetric),
            Id::StaticTorqueNegative,
            1.0,
            AtLeast(1.25),
            "F_S >= F_C",
        ),
        // At 100 N and 0.3 MPa the level falls by 0.5 + 0.3 Nm, and the static excess by 0.1 + 0.3 Nm.
        refusal(improved(), Id::CoulombTorque, 0.79, AtLeast(0.8 / left), "stay positive"),
        refusal(improved(), Id::StaticTorque, 1.85, AtLeast(1.9), "F_S >= F_C"),
        refusal(
            with_term(TermKind::PressureCoulomb),
            Id::CoulombTorque,
            0.2,
            AtLeast(0.3 / left),
            "positive",
        ),
        refusal(
            with_term(TermKind::LoadTorqueCoulomb).with(Id::LoadCoulomb, -0.02),
            Id::CoulombTorque,
            0.51,
            AtLeast(0.52 / left),
            "positive",
        ),
        refusal(
            with_term(TermKind::TimeDrift),
            Id::DriftRate,
            -2e-7,
            AtLeast(-0.999 / (2000.0 * 3600.0)),
            "end of the campaign",
        ),
        refusal(
            with_term(TermKind::LookupTable),
            Id::LookupColumn,
            2.5,
            Whole,
            "a column has a number",
        ),
        refusal(
            with_term(TermKind::LookupTable).with(Id::LookupLower, 0.5),
            Id::LookupUpper,
            0.5,
            MoreThan(0.5),
            "over a range",
        ),
        refusal(with_term(TermKind::LookupTable), Id::LookupLevel3, -0.95, AtLeast(-0.9), "range"),
    ]
}

/// Cases of a factor over temperature that is too steep, with 70 K from the reference to the cold end and 130 K to the
/// hot end.
fn steepness_cases() -> Vec<RefusalCase> {
    use Bound::{AtLeast, AtMost};
    let (thousand, ten_million) = (1e3f32.ln(), 1e7f32.ln());
    let coulomb = || with_term(TermKind::TemperatureCoulomb);
    let viscous = || with_term(TermKind::TemperatureViscous);
    let without_friction = viscous().with(Id::ViscousFriction, 0.0);
    let (level, viscosity) = (Id::TemperatureCoulomb, Id::TemperatureViscosity);
    vec![
        refusal(coulomb(), level, 0.0625, AtMost(thousand / 130.0), "stay positive"),
        refusal(coulomb(), level, -0.0625, AtLeast(-thousand / 130.0), "stay positive"),
        // A steep decrease towards the hot end is legal, because the step does not divide by the viscosity.
        refusal(viscous(), viscosity, 0.5, AtMost(ten_million / 70.0), "viscosity"),
        refusal(without_friction, viscosity, -0.75, AtLeast(-ten_million / 130.0), "viscosity"),
    ]
}

/// Cases that violate passivity, and a delay that exceeds its delay line.
fn passivity_and_delay_cases() -> Vec<RefusalCase> {
    use Bound::{AtLeast, AtMost};
    let lugre = || sound(LawKind::Lugre);
    let improved = || sound(LawKind::ImprovedLugre);
    let mut fading = lugre();
    fading.choices.damping_fades = true;
    vec![
        // Passivity with constant sigma1: the larger of 4 F_C / v_max = 0.75 and sigma2 F_C / (F_S - F_C).
        refusal(
            lugre().with(Id::ViscousFriction, 0.1),
            Id::BristleDamping,
            0.8,
            AtMost(0.75),
            "passivity",
        ),
        refusal(
            lugre().with(Id::ViscousFriction, 0.5),
            Id::BristleDamping,
            1.6,
            AtMost(1.5),
            "passivity",
        ),
        // Passivity with fading sigma1: 4 F_C / (v_s / sqrt(2 e)).
        refusal(
            fading,
            Id::BristleDamping,
            140.0,
            AtMost(60.0 * (2.0 * core::f32::consts::E).sqrt()),
            "passivity",
        ),
        // At the corner of the envelope F_C is 0.7 Nm: 4 * 0.7 / 8.
        refusal(
            improved().with(Id::ViscousFriction, 0.01),
            Id::BristleDamping,
            0.4,
            AtMost(0.35),
            "passivity",
        ),
        refusal(lugre(), Id::ViscousFriction, -0.1, AtLeast(0.0), "passivity"),
        refusal(
            with_term(TermKind::ChannelDelay),
            Id::ChannelDelay,
            0.032,
            AtMost(0.031),
            "delay line",
        ),
    ]
}

#[test]
fn refusals_name_field_value_bound_and_reason() {
    use Bound::{AtLeast, AtMost};
    let cases = [range_and_level_cases(), steepness_cases(), passivity_and_delay_cases()];
    let cases = cases.into_iter().flatten();
    for RefusalCase { from, id, value, bound, word } in cases {
        from.clone().build::<f64>(PERIOD).unwrap_or_else(|error| panic!("{}: {error}", id.name()));
        let refused = from.clone().with(id, value).build::<f64>(PERIOD).unwrap_err();
        assert_eq!(refused.field, id.name());
        assert_eq!(refused.value.to_bits(), (value as f32).to_bits(), "{refused}");
        assert!(are_close(refused.bound, bound), "{refused}, expected {bound:?}");
        assert!(refused.why.as_str().contains(word), "{refused}");
        let message = refused.to_string();
        for part in
            [id.name(), &value.to_string(), &refused.bound.to_string(), refused.why.as_str()]
        {
            assert!(message.contains(part), "{message:?} lacks {part:?}");
        }
        // Just inside the bound, the set is valid.
        let margin = |bound: f64| 1e-6 * (bound.abs() + (bound - value).abs());
        let inside = match bound {
            AtLeast(least) => f64::from(least) + margin(least.into()),
            AtMost(most) => f64::from(most) - margin(most.into()),
            _ => continue,
        };
        let narrow = from.with(id, inside);
        let tight = id == Id::CoulombTorque || id == Id::StribeckVelocity;
        match narrow.build::<f64>(PERIOD) {
            // A level at its bound may be valid while the damping is then too large for it.
            Err(error) if tight => assert_ne!(error.field, id.name(), "{error}"),
            other => assert!(other.is_ok(), "{}: {:?}", id.name(), other.err()),
        }
    }
}

fn refused(parameters: &Parameters<f64>, period: f64) -> ParameterError {
    parameters.build::<f64>(period).unwrap_err()
}

#[test]
fn build_with_invalid_period_envelope_or_list_names_the_field() {
    let sound = sound(LawKind::Lugre);
    for period in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(&sound, period).field, "sample_period_s");
    }
    type Change = fn(&mut Parameters<f64>);
    let changes: [(&str, Change); 6] = [
        ("velocity_max_rad_s", |p| p.envelope.velocity_max_rad_s = 0.0),
        ("velocity_max_rad_s", |p| p.envelope.velocity_max_rad_s = 2e9),
        ("radial_force_max_n", |p| p.envelope.radial_force_max_n = -1.0),
        ("campaign_max_h", |p| p.envelope.campaign_max_h = f32::NAN),
        ("hypot(ripple_sine, ripple_cosine)", |p| {
            p.add_term(TermKind::PositionRipple);
            p.set(Id::RippleSine, 0.8);
            p.set(Id::RippleCosine, 0.8);
        }),
        ("torque-offset", |p| p.terms.extend([TermKind::TorqueOffset; 2])),
    ];
    for (field, change) in changes {
        let mut invalid = sound.clone();
        change(&mut invalid);
        assert_eq!(refused(&invalid, PERIOD).field, field);
    }
}

/// A term must not repeat an effect that the law already has.
#[test]
fn build_with_term_already_in_law_names_the_term() {
    for (law, kind) in [
        (LawKind::ImprovedLugre, TermKind::PressureCoulomb),
        (LawKind::ImprovedLugre, TermKind::RadialForceRate),
        (LawKind::Atan, TermKind::TorqueOffset),
    ] {
        let mut twice = sound(law);
        twice.terms.push(kind).unwrap();
        assert_eq!(refused(&twice, PERIOD).field, kind.name());
    }
}

/// A law that can release energy is accepted only with the option `allow_active`.
#[test]
fn allow_active_permits_damping_beyond_passivity() {
    let mut active = sound(LawKind::Lugre).with(Id::BristleDamping, 100.0);
    assert!(active.build::<f64>(PERIOD).is_err());
    active.choices.allow_active = true;
    assert!(active.build::<f64>(PERIOD).is_ok());
}

/// Unused parameters may have any value, because a record always contains all parameters.
#[test]
fn unused_parameters_are_neither_checked_nor_used() {
    for law in LawKind::ALL {
        let mut parameters = Parameters::<f64>::new(*law);
        for id in Id::ALL.iter().filter(|id| !law.parameters().contains(id)) {
            parameters.set(*id, f64::NAN);
        }
        let model = parameters.build::<f64>(PERIOD).unwrap();
        let mut state = compensator_core::ModelState::default();
        for step in 0..1000 {
            let velocity_rad_s = (f64::from(step) * 0.01).sin();
            let sample = compensator_core::Sample { velocity_rad_s, ..Default::default() };
            let friction = model.step(&mut state, &sample);
            assert!(friction.abs() <= 1.5, "{}: {friction}", law.name());
        }
    }
}

/// Fixed point has 12 integer and 20 fractional bits. The error names the quantity that exceeds this range.
#[test]
fn build_in_fixed_point_with_overflow_names_the_product() {
    let joint = |law| {
        let mut joint = sound(law).convert::<f32>();
        joint.set(Id::BristleStiffness, 1e4);
        joint.choices.allow_active = true;
        joint
    };
    for law in LawKind::ALL {
        let built = joint(*law).build::<Fixed>(1e-3);
        assert!(built.is_ok(), "{}: {:?}", law.name(), built.err());
    }
    use LawKind::{Atan, Extended, ImprovedLugre, Linear, Lugre, LugreAsymmetric};
    for (law, values, field) in [
        (Linear, vec![(Id::CoulombTorque, 1e-4)], "coulomb_torque"),
        (Linear, vec![(Id::ViscousFriction, 300.0)], "viscous_friction * velocity_max"),
        (Extended, vec![(Id::CubicFriction, 5.0)], "cubic_friction"),
        (Atan, vec![(Id::AtanSlope, 300.0)], "atan_slope * velocity_max"),
        (Lugre, vec![(Id::StribeckVelocity, 1e-3)], "16 / stribeck_velocity"),
        (Lugre, vec![(Id::BristleStiffness, 1e7)], "bristle_stiffness * sample_period"),
        (
            Lugre,
            vec![(Id::BristleStiffness, 3e5)],
            "bristle_stiffness * sample_period * velocity_max",
        ),
        (Lugre, vec![(Id::StaticTorque, 150.0)], "level * velocity_max"),
        // At the corner of the envelope the divisor is 0.01 Nm.
        (
            ImprovedLugre,
            vec![(Id::CoulombTorque, 0.81), (Id::BristleStiffness, 1.0)],
            "bristle rate",
        ),
        (LugreAsymmetric, vec![(Id::StaticTorqueNegative, 150.0)], "level * velocity_max"),
        (
            Lugre,
            vec![(Id::BristleStiffness, 1e3), (Id::BristleDamping, 600.0)],
            "bristle_damping * bristle rate",
        ),
        (
            ImprovedLugre,
            vec![(Id::RadialForceRate, 0.03)],
            "radial_force_rate * radial_force_max / sample_period",
        ),
        (
            ImprovedLugre,
            vec![(Id::RadialForceRate, 0.003)],
            "bristle_stiffness * radial_force_rate * radial_force_max",
        ),
    ] {
        let mut invalid = joint(law);
        for (id, value) in values {
            invalid.set(id, value);
        }
        assert!(invalid.build::<f32>(1e-3).is_ok(), "{field}: a float holds it");
        let refused = invalid.build::<Fixed>(1e-3).unwrap_err();
        assert_eq!(refused.field, field, "{refused}");
        assert!(refused.why.as_str().contains("number type"), "{refused}");
    }
}

/// Fixed point saturates a larger factor, even if its product with a small viscous coefficient fits.
#[test]
fn build_in_fixed_point_with_thermal_factor_out_of_range_names_the_term() {
    let viscous = |rate| {
        let joint = with_term(TermKind::TemperatureViscous).convert::<f32>();
        joint.with(Id::ViscousFriction, 0.001).with(Id::TemperatureViscosity, rate)
    };
    let build = |rate| viscous(rate).build::<Fixed>(1e-3);
    assert!(build(0.1).is_ok(), "{:?}", build(0.1).err());
    assert!(viscous(0.15).build::<f32>(1e-3).is_ok(), "a float holds it");
    let refused = build(0.15).unwrap_err();
    assert_eq!(refused.field, TermKind::TemperatureViscous.name(), "{refused}");
}
