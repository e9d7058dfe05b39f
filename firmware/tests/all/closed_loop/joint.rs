//! Tests of the compensated joint: benefit of the compensation, current limits, stale set-points and the residual.

use super::plant::Machine;
use super::rig::{PERIOD_S, Rig, cycles, lugre, no_compensation, parameters};
use compensator_core::compensator::Reading;
use compensator_core::{Fixed, Flags, LawKind};
use firmware::control::{JointCompensator, LoopFlags, MotorParameters, Setpoint};

/// Returns the RMS velocity error on a slow sine with two reversals per second, rad/s, without its first period.
///
/// The velocity controller runs at 1 kHz and has no friction model.
fn following_error(compensating: bool) -> f64 {
    let compensator = lugre(0.9);
    let mut rig = Rig::settled(Machine::default(), parameters(), compensator);
    rig.control.set_compensating(compensating);
    let (mut squares, mut count) = (0.0, 0usize);
    let mut integral = 0.0f32;
    let mut velocity_rad_s = 0.0f32;
    for k in 0..cycles(3.0) {
        let t = k as f64 * f64::from(PERIOD_S);
        let reference = 0.2 * (std::f64::consts::TAU * t).sin();
        if k % 20 == 0 {
            let error = reference as f32 - velocity_rad_s;
            integral += 100.0 * error * 1e-3;
            rig.setpoint.current_a = 20.0 * error + integral;
            rig.setpoint.velocity_reference_rad_s = reference as f32;
        }
        velocity_rad_s = rig.cycle().velocity_rad_s;
        if t > 1.0 {
            squares += (rig.stage.plant.velocity() - reference).powi(2);
            count += 1;
        }
    }
    (squares / count as f64).sqrt()
}

#[test]
fn following_error_with_compensation_is_several_times_smaller() {
    let (without, with) = (following_error(false), following_error(true));
    let factor = without / with;
    println!("following error {without:.5} rad/s without, {with:.5} with: {factor:.1} times");
    assert!((4.5..7.5).contains(&factor), "{without:.5} -> {with:.5}: {factor:.2}");
}

/// Returns the current at which a joint has moved by one degree on a ramp of 1 A/s from rest, A.
fn breakaway_current(compensating: bool) -> f64 {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(compensating);
    for k in 0..cycles(4.0) {
        let t = k as f64 * f64::from(PERIOD_S);
        rig.setpoint.current_a = t as f32;
        // The reference velocity gives the direction of the ramp and increases slowly.
        rig.setpoint.velocity_reference_rad_s = (0.1 * t as f32).min(0.02);
        rig.cycle();
        if rig.stage.plant.position() > 0.0175 {
            return t;
        }
    }
    panic!("the joint does not move");
}

#[test]
fn breakaway_current_with_compensation_is_several_times_smaller() {
    let (without, with) = (breakaway_current(false), breakaway_current(true));
    println!("breakaway at {without:.2} A without, {with:.2} A with compensation");
    // 2.2 Nm of static friction at 0.98 Nm/A, plus the ramp's increase until the joint has moved one degree.
    assert!((2.3..2.6).contains(&without), "{without}");
    assert!((0.35..0.7).contains(&with), "{with}");
}

#[test]
fn compensator_with_scale_above_one_or_nan_is_rejected() {
    for scale in [1.001, 1.2, f32::NAN] {
        let mut joint = firmware::reference_joint::configuration(LawKind::Lugre, &[]);
        joint.compensator.scale = scale;
        let error = JointCompensator::<f32>::build(&joint, PERIOD_S).expect_err("invalid scale");
        assert_eq!(error.field, "scale");
    }
}

#[test]
fn current_limit_applies_to_command_plus_compensation() {
    let motor = MotorParameters { current_limit_a: 6.0, ..parameters() };
    let mut rig = Rig::settled(Machine::default(), motor, lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 5.5, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    let cycle = rig.run(cycles(0.1));
    assert!(cycle.feed_forward_current_a > 1.0, "{}", cycle.feed_forward_current_a);
    assert_eq!(cycle.current_reference_a, 6.0);
    assert!(cycle.flags.contains(LoopFlags::CURRENT_LIMITED));
    assert!((rig.stage.plant.current()[1] - 6.0).abs() < 0.15);
    // The compensator's own limit of 26 A applies too.
    let mut rig = Rig::settled(
        Machine { clamped: true, ..Machine::default() },
        MotorParameters { current_limit_a: 35.0, ..parameters() },
        lugre(0.9),
    );
    rig.setpoint.current_a = 30.0;
    let cycle = rig.run(cycles(0.01));
    assert_eq!(cycle.current_reference_a, 26.0);
    assert!(cycle.flags.contains(LoopFlags::CURRENT_LIMITED));
    assert!(cycle.compensator.contains(Flags::CURRENT_LIMITED));
}

#[test]
fn duties_with_compensation_off_equal_those_without_compensator() {
    let fixed = JointCompensator::<Fixed>::build(
        &firmware::reference_joint::configuration(LawKind::ImprovedLugre, &[]),
        PERIOD_S,
    )
    .expect("the joint is valid");
    let machine = Machine::default();
    let mut without = Rig::settled(machine, parameters(), no_compensation());
    let mut off = Rig::settled(machine, parameters(), lugre(0.9));
    let mut fixed = Rig::settled(machine, parameters(), fixed);
    for k in 0..cycles(0.3) {
        let t = k as f32 * PERIOD_S;
        let current_a = 3.0 * (20.0 * t).sin() + 0.123_456_7;
        let setpoint = Setpoint { current_a, velocity_reference_rad_s: 0.3, age_s: 0.0 };
        without.setpoint = setpoint;
        off.setpoint = setpoint;
        fixed.setpoint = setpoint;
        let bits = |cycle: firmware::control::CycleResult| {
            let firmware::control::Bridge::Drive(duty) = cycle.bridge else {
                panic!("the bridge is off")
            };
            assert_eq!(cycle.feed_forward_current_a.to_bits(), 0);
            (duty.map(f32::to_bits), cycle.current_reference_a.to_bits())
        };
        let expected = bits(without.cycle());
        assert_eq!(bits(off.cycle()), expected, "cycle {k}");
        assert_eq!(bits(fixed.cycle()), expected, "cycle {k}");
    }
}

#[test]
fn setpoint_older_than_100_ms_gives_zero_current() {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 4.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.2));
    let mut age_s = 0.0f64;
    let stopped_s = loop {
        rig.setpoint.age_s = age_s as f32;
        let cycle = rig.cycle();
        if cycle.flags.contains(LoopFlags::SETPOINT_STALE) {
            assert_eq!(cycle.current_reference_a, 0.0);
            assert!(cycle.flags.contains(LoopFlags::COMPENSATION_OFF));
            break age_s;
        }
        assert!(cycle.current_reference_a > 4.0);
        age_s += f64::from(PERIOD_S);
        assert!(age_s < 0.2);
    };
    assert!((0.0999..0.1002).contains(&stopped_s), "{stopped_s}");
    rig.run(cycles(0.002));
    let [_, q] = rig.stage.plant.current();
    assert!(q.abs() < 0.2, "{q} A remain of 5.6 A after 2 ms");
    // With a fresh set-point, the compensation rises from zero at its slew limit of 0.1 Nm per cycle.
    rig.setpoint.age_s = 0.0;
    let cycle = rig.cycle();
    assert!(cycle.feed_forward_current_a.abs() < 0.11, "{}", cycle.feed_forward_current_a);
    assert!(!cycle.flags.contains(LoopFlags::SETPOINT_STALE));
    for age_s in [-1.0, f32::NAN, f32::INFINITY] {
        rig.setpoint.age_s = age_s;
        let cycle = rig.cycle();
        assert!(cycle.flags.contains(LoopFlags::SETPOINT_STALE), "{age_s}");
        assert_eq!(cycle.current_reference_a, 0.0);
    }
    rig.setpoint.age_s = 0.0;
    rig.setpoint.current_a = f32::NAN;
    let cycle = rig.cycle();
    assert!(cycle.flags.contains(LoopFlags::SETPOINT_INVALID));
    assert_eq!(cycle.current_reference_a, 0.0);
}

#[test]
fn residual_with_worn_seal_exceeds_that_of_new_seal() {
    let residual = |coulomb: f64| {
        let machine = Machine { coulomb, static_level: coulomb + 0.7, ..Machine::default() };
        let mut rig = Rig::settled(machine, parameters(), lugre(0.9));
        rig.control.set_compensating(true);
        rig.setpoint = Setpoint { current_a: 0.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
        let (mut sum, mut count) = (0.0, 0);
        for k in 0..cycles(2.0) {
            let error = 1.0 - rig.stage.plant.velocity() as f32;
            rig.setpoint.current_a = 8.0 * error;
            rig.covariates.load_torque_nm = Reading::fresh(0.0);
            let cycle = rig.cycle();
            assert!(cycle.residual_valid, "{:?}", cycle.flags);
            if k > cycles(1.0) {
                sum += f64::from(cycle.residual_torque_nm);
                count += 1;
            }
        }
        sum / f64::from(count)
    };
    let (new, worn) = (residual(1.5), residual(1.8));
    println!("residual {new:.3} Nm with a new seal, {worn:.3} Nm with 20 % more friction");
    assert!(new.abs() < 0.06, "{new}");
    assert!((0.25..0.36).contains(&(worn - new)), "{new} -> {worn}");
    // The residual excludes the inertia torque: 0.25 kg m^2 at 13 rad/s^2 are 3.3 Nm.
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 3.5, velocity_reference_rad_s: f32::NAN, age_s: 0.0 };
    rig.run(cycles(0.1));
    let (mut sum, mut count) = (0.0, 0);
    for _ in 0..cycles(0.3) {
        let cycle = rig.cycle();
        assert!(cycle.acceleration_rad_s2 > 8.0, "{}", cycle.acceleration_rad_s2);
        sum += f64::from(cycle.residual_torque_nm);
        count += 1;
    }
    let accelerating = sum / f64::from(count);
    assert!(accelerating.abs() < 0.15, "{accelerating}");
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    assert!(!rig.cycle().residual_valid, "the residual needs the compensator's model");
    rig.control.set_compensating(true);
    assert!(rig.cycle().residual_valid);
    rig.covariates.load_torque_nm = Reading { value: 0.0, age_s: 0.2 };
    assert!(!rig.cycle().residual_valid, "the residual needs a fresh load torque");
}
