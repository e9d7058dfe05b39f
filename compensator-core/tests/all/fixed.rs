//! Property tests: an accepted set of parameters never wraps in fixed point.
//!
//! The loop does not check the products of a fixed-point step. Instead, `build` refuses every set of parameters whose
//! products could overflow within the envelope. An unchecked product could turn a friction of 3 Nm into -2045 Nm.
//! The tests build random sets, run the accepted ones to the corners of their envelope, and compare them with `f64`.

use crate::support::cases::{Case, FIXED, case, converted};
use compensator_core::model::{ModelState, Sample};
use compensator_core::{Fixed, LawKind, ParameterId as Id, Parameters, Real, TermKind};
use proptest::prelude::*;

/// Maximum difference between fixed point and `f64`, as a share of the largest torque of the run.
const MAX_DIFFERENCE_SHARE: f64 = 0.01;

/// Additional difference, in last bits of the bristle rate.
///
/// The rate is a quotient by the level. It enters the torque through `sigma0 dt` and `sigma1`.
const RATE_TOLERANCE_BITS: f64 = 4.0;

/// Maximum difference as a share of the largest torque, for terms that branch on the velocity.
///
/// With backlash or a delay, the last bit of the velocity can decide a branch. The results then differ by up to twice
/// the level. A product that wraps causes an error of thousands of Nm.
const MAX_BRANCH_DIFFERENCE_SHARE: f64 = 2.1;

/// Converts a rounded sample to `f64`, so that the difference excludes the rounding of the inputs.
fn to_f64(sample: &Sample<Fixed>) -> Sample<f64> {
    sample.map(Real::value)
}

/// Returns the largest difference between fixed point and `f64`, as a share of the tolerance.
///
/// Returns `None` if fixed point refuses the case.
fn difference_ratio(case: &Case) -> Option<f64> {
    let parameters = case.parameters::<f32>();
    let fixed = parameters.build::<Fixed>(case.period as f32).ok()?;
    let exact = parameters.convert::<f64>();
    let exact = exact.build::<f64>(f64::from(case.period as f32)).expect("f64 holds more");
    let (mut a, mut b) = (ModelState::<Fixed>::default(), ModelState::<f64>::default());
    let mut force_before = 0.0;
    let value = |id| f64::from(parameters.get(id));
    let (mut distance, mut largest) = (0.0f64, value(Id::StaticTorque));
    for (bits, covariates) in &case.samples {
        let sample = Case::sample(f64::from_bits(*bits), covariates, force_before);
        force_before = covariates[0];
        let sample: Sample<Fixed> = converted(&sample);
        // The asymmetric law jumps when the held torque changes sign, so the last bit may decide.
        let side = |torque: f64| torque > 0.0;
        let sides = (side(a.bristle_torque_nm.value()), side(b.bristle_torque_nm));
        if case.law == LawKind::LugreAsymmetric && sides.0 != sides.1 {
            break;
        }
        let found = fixed.step(&mut a, &sample).value();
        let expected = exact.step(&mut b, &to_f64(&sample));
        distance = distance.max((found - expected).abs());
        largest = largest.max(expected.abs());
    }
    let branching = [TermKind::Backlash, TermKind::ChannelDelay];
    let has_branch = case.terms.iter().any(|kind| branching.contains(kind));
    let share = if has_branch { MAX_BRANCH_DIFFERENCE_SHARE } else { MAX_DIFFERENCE_SHARE };
    let per_rate = value(Id::BristleStiffness) * case.period + value(Id::BristleDamping);
    let per_bit = 1.0 + per_rate * (1.0 + 1.0 / value(Id::CoulombTorque));
    let last_bits = RATE_TOLERANCE_BITS / f64::from(1 << 20) * per_bit;
    Some(distance / (share * largest + last_bits))
}

proptest! {
    // Most cases are refused, because the ranges exceed the range of fixed point.
    #![proptest_config(ProptestConfig { max_global_rejects: 20_000, ..ProptestConfig::with_cases(3000) })]

    #[test]
    fn step_with_accepted_parameters_does_not_wrap(case in case(FIXED)) {
        let ratio = difference_ratio(&case);
        prop_assume!(ratio.is_some());
        prop_assert!(ratio.unwrap() <= 1.0, "{ratio:?} of the tolerance");
    }
}

/// Returns laws with torques beside their level and the viscous friction, by this share of 1000 Nm each.
fn laws_with_torques(share: f64) -> [Parameters<f64>; 3] {
    let law = |kind| {
        let mut law = Parameters::<f64>::new(kind).with(Id::CoulombTorque, 1000.0 * share);
        law.choices.allow_active = true;
        law.envelope.velocity_max_rad_s = 4.0;
        law
    };
    let atan = law(LawKind::Atan)
        .with(Id::TorqueOffset, -200.0 * share)
        .with(Id::AtanTorque, 600.0 * share)
        .with(Id::AtanSlope, 100.0);
    let extended = law(LawKind::Extended)
        .with(Id::ViscousFriction, 10.0 * share)
        .with(Id::QuadraticFriction, 60.0 * share)
        .with(Id::CubicFriction, 2.0 * share);
    let mut printed = law(LawKind::Extended).with(Id::QuadraticFriction, 280.0 * share);
    printed.choices.printed_extended = true;
    [atan, extended, printed]
}

#[test]
fn largest_torque_of_a_law_is_that_at_its_largest_speed() {
    for law in laws_with_torques(1e-2) {
        let [_, largest] = law.largest_torques_nm(1e-3).unwrap();
        let model = law.build::<f64>(1e-3).unwrap();
        let at = |velocity_rad_s| {
            let sample = Sample { velocity_rad_s, ..Sample::default() };
            model.step(&mut ModelState::default(), &sample).abs()
        };
        let found = at(4.0).max(at(-4.0));
        let share = found / f64::from(largest);
        assert!((0.99..=1.000_001).contains(&share), "{}: {found} {largest}", law.law.name());
    }
}

#[test]
fn build_with_torques_that_exceed_fixed_point_only_together_is_refused() {
    for law in laws_with_torques(1.0) {
        let refused = law.convert::<f32>().build::<Fixed>(1e-3).map(|_| ()).unwrap_err();
        assert_eq!(refused.field, "the sum of all torques", "{}", law.law.name());
        assert!(law.build::<f64>(1e-3).is_ok());
    }
}
