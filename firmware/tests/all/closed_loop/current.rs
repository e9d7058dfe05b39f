//! Tests of current control: steps, field orientation, decoupling and the voltage limit.

use super::plant::Machine;
use super::rig::{PERIOD_S, Rig, cycles, no_compensation, parameters};
use firmware::control::{LoopFlags, MotorParameters};

fn clamped_machine() -> Machine {
    Machine { clamped: true, ..Machine::default() }
}

fn rotating_machine(joint_rad_s: f64) -> Machine {
    Machine { driven: Some(joint_rad_s), ..Machine::default() }
}

/// Applies a step of 10 A. Returns the rise time from 10 to 90 %, s, and the peak and final values relative to 10 A.
///
/// All values are of the plant's current, not of the measured one.
fn measure_step(machine: Machine, motor: MotorParameters) -> (f64, f64, f64) {
    let mut rig = Rig::settled(machine, motor, no_compensation());
    rig.setpoint.current_a = 10.0;
    let (mut low, mut high, mut peak) = (None, None, 0.0f64);
    for k in 0..cycles(0.01) {
        rig.cycle();
        let q = rig.stage.plant.current()[1] / 10.0;
        peak = peak.max(q);
        if q > 0.1 {
            low.get_or_insert(k);
        }
        if q > 0.9 {
            high.get_or_insert(k);
        }
    }
    let rise = (high.expect("above 90 %") - low.expect("above 10 %")) as f64 * f64::from(PERIOD_S);
    (rise, peak, rig.stage.plant.current()[1] / 10.0)
}

#[test]
fn current_step_rises_at_bandwidth_with_little_overshoot() {
    for machine in
        [clamped_machine(), rotating_machine(0.3), rotating_machine(8.0), rotating_machine(-8.0)]
    {
        let (rise, peak, end) = measure_step(machine, parameters());
        // A first-order lag of 800 Hz rises in 0.35 / 800 = 0.44 ms.
        assert!((0.25e-3..0.55e-3).contains(&rise), "rise {rise:e}");
        assert!((0.995..1.08).contains(&peak), "peak {peak}");
        assert!((end - 1.0).abs() < 0.01, "end {end}");
    }
    let slower = MotorParameters { current_bandwidth_hz: 200.0, ..parameters() };
    let (rise, peak, _) = measure_step(clamped_machine(), slower);
    // 1.75 ms at 200 Hz, and up to half as much more: the dead time takes 0.29 V of the initial 1.1 V.
    assert!((1.6e-3..2.8e-3).contains(&rise), "rise {rise:e}");
    assert!((0.995..1.03).contains(&peak), "peak {peak}");
}

/// Returns the mean and the maximum angle between the plant's current and its q axis at 10 A, rad.
fn orientation_error(joint_rad_s: f64, motor: MotorParameters) -> (f64, f64) {
    delayed_orientation_error(0.0, joint_rad_s, motor)
}

/// Returns the orientation error if the encoder is sampled `encoder_age_s` before the currents.
fn delayed_orientation_error(
    encoder_age_s: f64,
    joint_rad_s: f64,
    motor: MotorParameters,
) -> (f64, f64) {
    let mut rig = Rig::settled(rotating_machine(joint_rad_s), motor, no_compensation());
    rig.stage.encoder_age_s = encoder_age_s;
    rig.setpoint.current_a = 10.0;
    rig.run(cycles(0.02));
    let count = cycles(0.2);
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for _ in 0..count {
        rig.cycle();
        let [d, q] = rig.stage.plant.current();
        sum += d.atan2(q);
        worst = worst.max(d.atan2(q).abs());
    }
    (sum / count as f64, worst)
}

#[test]
fn field_orientation_up_to_full_speed_stays_aligned() {
    for speed in [0.05, 1.0, -5.0, 11.0, -11.0] {
        let (mean, worst) = orientation_error(speed, parameters());
        println!("{speed} rad/s: orientation error {mean:.4} rad mean, {worst:.4} rad maximum");
        // Half an encoder step is 1.3 mrad (electrical). The sine table and the current resolution add to it.
        assert!(mean.abs() < 0.006, "{speed} rad/s: {mean}");
        // The dead time distorts the current six times per electrical turn.
        assert!((1e-3..0.06).contains(&worst), "{speed} rad/s: {worst}");
    }
}

#[test]
fn orientation_with_encoder_offset_error_of_one_degree_is_rotated() {
    let one_degree = 1f32.to_radians();
    let motor = MotorParameters { encoder_offset_rad: one_degree / 7.0, ..parameters() };
    let difference = orientation_error(1.0, motor).0 - orientation_error(1.0, parameters()).0;
    assert!((0.016..0.019).contains(&difference.abs()), "{difference}");
}

#[test]
fn orientation_with_configured_encoder_delay_is_corrected() {
    let configured = MotorParameters { encoder_delay_s: 10e-6, ..parameters() };
    for speed in [11.0f64, -11.0] {
        // 11 rad/s of the joint are 3927 rad/s electrical: the current vector lags by 39 mrad in 10 us.
        let uncorrected = delayed_orientation_error(10e-6, speed, parameters()).0;
        assert!((0.035..0.043).contains(&uncorrected.abs()), "{uncorrected}");
        let corrected = delayed_orientation_error(10e-6, speed, configured).0;
        assert!(corrected.abs() < 0.006, "{corrected}");
    }
}

#[test]
fn current_on_rotating_motor_is_decoupled_from_speed() {
    for speed in [11.0, -11.0] {
        // The motor rotates when the bridge is enabled. Its back-EMF of 7.2 V would drive 20 A without feed-forward.
        let mut rig = Rig::settled(rotating_machine(speed), parameters(), no_compensation());
        rig.control.set_driving(false);
        rig.run(cycles(0.01));
        rig.control.set_driving(true);
        let inrush = (0..cycles(0.01)).fold(0.0f64, |inrush, _| {
            rig.cycle();
            let [d, q] = rig.stage.plant.current();
            inrush.max(d.hypot(q))
        });
        // A step of the q current of 15 A induces 5.4 V on the d axis.
        rig.setpoint.current_a = 15.0;
        let cross = (0..cycles(0.01)).fold(0.0f64, |cross, _| {
            rig.cycle();
            cross.max(rig.stage.plant.current()[0].abs())
        });
        println!(
            "{speed} rad/s: {inrush:.2} A after enabling the bridge, {cross:.2} A of d current in a step of 15 A"
        );
        assert!((0.05..1.5).contains(&inrush), "{inrush}");
        assert!((0.05..2.5).contains(&cross), "{cross}");
    }
}

#[test]
fn current_with_two_or_three_shunts_reaches_setpoint() {
    use firmware::control::ValidChannels;
    let ends = [ValidChannels::CURRENT_C, ValidChannels::empty()].map(|added| {
        let mut rig = Rig::settled(rotating_machine(2.0), parameters(), no_compensation());
        rig.stage.valid |= added;
        rig.setpoint.current_a = -7.0;
        rig.run(cycles(0.01));
        rig.stage.plant.current()[1]
    });
    for end in ends {
        assert!((end + 7.0).abs() < 0.1, "{end}");
    }
}

#[test]
fn negative_joint_direction_reverses_current_and_motion() {
    let mut rig = Rig::settled(
        Machine { coulomb: 0.1, static_level: 0.1, ..Machine::default() },
        MotorParameters { joint_direction: -1.0, ..parameters() },
        no_compensation(),
    );
    rig.setpoint.current_a = 2.0;
    let cycle = rig.run(cycles(0.1));
    // The joint turns against the motor: 2 A of the joint are -2 A of the motor, which turns backwards.
    assert!((rig.stage.plant.current()[1] + 2.0).abs() < 0.1);
    assert!(rig.stage.plant.velocity() < -0.3);
    assert!(cycle.velocity_rad_s > 0.3 && cycle.acceleration_rad_s2 > 0.0);
    assert!((cycle.current_q_a - 2.0).abs() < 0.1);
}

/// Steps the set-point from -24 A, held for 0.2 s, to 3 A.
///
/// Returns the time until the current is within 0.3 A of 3 A, s; its peak, A; its value before the step, A; and
/// whether the voltage limited it before the step.
fn step_from_limit(bus: f64) -> (f64, f64, f64, bool) {
    let machine = Machine { bus, ..rotating_machine(-11.9) };
    let mut rig = Rig::settled(machine, parameters(), no_compensation());
    rig.setpoint.current_a = -24.0;
    let limited = rig.run(cycles(0.2)).flags.contains(LoopFlags::VOLTAGE_LIMITED);
    let before = rig.stage.plant.current()[1];
    rig.setpoint.current_a = 3.0;
    let (mut arrival, mut peak) = (None, f64::MIN);
    for k in 0..cycles(0.01) {
        rig.cycle();
        let q = rig.stage.plant.current()[1];
        peak = peak.max(q);
        if (q - 3.0).abs() < 0.3 {
            arrival.get_or_insert(k);
        }
    }
    let end = rig.cycle();
    assert!(!end.flags.contains(LoopFlags::VOLTAGE_LIMITED));
    assert!((end.current_q_a - 3.0).abs() < 0.2);
    (arrival.expect("the current reaches 3 A") as f64 * f64::from(PERIOD_S), peak, before, limited)
}

#[test]
fn current_after_voltage_limit_recovers_without_windup() {
    // -24 A at this speed need 11 V on q and 9 V on d, 14 V in all. A bus of 18.5 V gives 10 V.
    let (limited_s, peak, before, is_limited) = step_from_limit(18.5);
    let (free_s, _, free_before, is_free_limited) = step_from_limit(48.0);
    println!(
        "recovery from the limit in {limited_s:e} s, without a limit in {free_s:e} s; peak {peak:.2} A"
    );
    assert!(is_limited && !is_free_limited);
    assert!(before > -20.0 && (free_before + 24.0).abs() < 0.3, "{before} {free_before}");
    // Recovery is as fast as without a limit, and the overshoot is that of an ordinary step.
    assert!((0.3 * free_s..1.5 * free_s).contains(&limited_s), "{limited_s:e}, {free_s:e}");
    assert!(peak < 3.0 + 0.08 * (3.0 - before), "{peak}");
}
