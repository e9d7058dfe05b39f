//! Fixed point wraps where a float would only round: what building accepts must never wrap.
//!
//! The products of a fixed-point step are not checked in the loop; building refuses every set of
//! parameters whose products could leave the range within the envelope. A product it forgot would
//! turn a friction of 3 Nm into one of -2045 Nm. So random sets are built, those accepted are run to
//! the corners of their envelope, and the same set in `f64` says what should have come out.

mod support;

use compensator_core::model::{Sample, State};
use compensator_core::{Fixed, LawKind, ParameterId as Id, Real, TermKind};
use proptest::prelude::*;
use support::cases::{Case, FIXED, case, converted};

/// Largest distance of fixed point from `f64`, in shares of the largest torque of the run.
const LARGEST_SHARE: f64 = 0.01;

/// And in last bits of the bristle's rate, which is a quotient by the level and goes into the torque
/// by `sigma0 dt` and by `sigma1`.
const LAST_BITS: f64 = 4.0;

/// Backlash and a delay decide by a velocity that may be down to its last bits: then one sample is
/// soft in one number and stiff in the other, and the two are apart by what a bristle can hold,
/// twice the level. A product that wrapped is off by thousands of Nm.
const SHARE_WHERE_BITS_DECIDE: f64 = 2.1;

/// What `Fixed` makes of a sample, for `f64`: the error wanted is the step's, not the sensor's.
fn held(sample: &Sample<Fixed>) -> Sample<f64> {
    sample.map(Real::value)
}

/// The largest distance between the two numbers over a case, in shares of what is allowed; `None`
/// where fixed point refuses the case.
fn apart(case: &Case) -> Option<f64> {
    let parameters = case.parameters::<f32>();
    let fixed = parameters.build::<Fixed>(case.period as f32).ok()?;
    let exact = parameters.convert::<f64>();
    let exact = exact.build::<f64>(f64::from(case.period as f32)).expect("f64 holds more");
    let (mut a, mut b) = (State::<Fixed>::default(), State::<f64>::default());
    let mut force_before = 0.0;
    let value = |id| f64::from(parameters.get(id));
    let (mut distance, mut largest) = (0.0f64, value(Id::StaticTorque));
    for (bits, covariates) in &case.samples {
        let sample = Case::sample(f64::from_bits(*bits), covariates, force_before);
        force_before = covariates[0];
        let sample: Sample<Fixed> = converted(&sample);
        // The asymmetric law jumps where the held torque changes sign: the last bit may decide.
        let side = |torque: f64| torque > 0.0;
        let sides = (side(a.bristle_torque_nm.value()), side(b.bristle_torque_nm));
        if case.law == LawKind::LugreAsymmetric && sides.0 != sides.1 {
            break;
        }
        let found = fixed.step(&mut a, &sample).value();
        let expected = exact.step(&mut b, &held(&sample));
        distance = distance.max((found - expected).abs());
        largest = largest.max(expected.abs());
    }
    let bits_decide = [TermKind::Backlash, TermKind::ChannelDelay];
    let bits_decide = case.terms.iter().any(|kind| bits_decide.contains(kind));
    let share = if bits_decide { SHARE_WHERE_BITS_DECIDE } else { LARGEST_SHARE };
    let per_rate = value(Id::BristleStiffness) * case.period + value(Id::BristleDamping);
    let per_bit = 1.0 + per_rate * (1.0 + 1.0 / value(Id::CoulombTorque));
    let last_bits = LAST_BITS / f64::from(1 << 20) * per_bit;
    Some(distance / (share * largest + last_bits))
}

proptest! {
    // Most cases are refused: the ranges reach past what fixed point can hold.
    #![proptest_config(ProptestConfig { max_global_rejects: 20_000, ..ProptestConfig::with_cases(3000) })]

    #[test]
    fn what_is_accepted_does_not_wrap(case in case(FIXED)) {
        let apart = apart(&case);
        prop_assume!(apart.is_some());
        prop_assert!(apart.unwrap() <= 1.0, "{apart:?} of what is allowed");
    }
}
