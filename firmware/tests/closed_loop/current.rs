//! Current: steps, orientation, and the voltage's end.

use crate::plant::Machine;
use crate::rig::{PERIOD_S, Rig, cycles, none, parameters};
use firmware::control::{LoopFlags, MotorParameters};

fn clamped() -> Machine {
    Machine { clamped: true, ..Machine::default() }
}

fn turning(joint_rad_s: f64) -> Machine {
    Machine { driven: Some(joint_rad_s), ..Machine::default() }
}

/// Time from 10 to 90 %, s, and the peak's share of a step of 10 A, in true current.
fn step_of(machine: Machine, written: MotorParameters) -> (f64, f64, f64) {
    let mut rig = Rig::settled(machine, written, none());
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
    let rise = (high.expect("it rises") - low.expect("it begins")) as f64 * f64::from(PERIOD_S);
    (rise, peak, rig.stage.plant.current()[1] / 10.0)
}

#[test]
fn a_current_step_rises_in_its_time_and_hardly_overshoots() {
    for machine in [clamped(), turning(0.3), turning(8.0), turning(-8.0)] {
        let (rise, peak, end) = step_of(machine, parameters());
        // A first-order lag of 800 Hz rises in 0.35 / 800 = 0.44 ms.
        assert!((0.25e-3..0.55e-3).contains(&rise), "rise {rise:e}");
        assert!((0.995..1.08).contains(&peak), "peak {peak}");
        assert!((end - 1.0).abs() < 0.01, "end {end}");
    }
    let slower = MotorParameters { current_bandwidth_hz: 200.0, ..parameters() };
    let (rise, peak, _) = step_of(clamped(), slower);
    // 1.75 ms, and half as much again: the dead time takes 0.29 V of the first 1.1 V.
    assert!((1.6e-3..2.8e-3).contains(&rise), "rise {rise:e}");
    assert!((0.995..1.03).contains(&peak), "peak {peak}");
}

/// The angle between the true current and the true q axis at 10 A, rad: its mean and its largest.
fn orientation(joint_rad_s: f64, written: MotorParameters) -> (f64, f64) {
    orientation_read_before(0.0, joint_rad_s, written)
}

/// The same with an encoder read so long before the currents, s.
fn orientation_read_before(age: f64, joint_rad_s: f64, written: MotorParameters) -> (f64, f64) {
    let mut rig = Rig::settled(turning(joint_rad_s), written, none());
    rig.stage.encoder_age = age;
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
fn the_field_stays_oriented_up_to_full_speed() {
    for speed in [0.05, 1.0, -5.0, 11.0, -11.0] {
        let (mean, worst) = orientation(speed, parameters());
        println!("{speed} rad/s: field {mean:.4} rad off in the mean, {worst:.4} at most");
        // Half an encoder step is 1.3 mrad (electrical), sine and current steps do the rest.
        assert!(mean.abs() < 0.006, "{speed} rad/s: {mean}");
        // The dead time's kinks, six a turn.
        assert!((1e-3..0.06).contains(&worst), "{speed} rad/s: {worst}");
    }
}

#[test]
fn an_encoder_offset_wrong_by_a_degree_is_seen_in_the_orientation() {
    let one_degree = 1f32.to_radians();
    let written = MotorParameters { encoder_offset_rad: one_degree / 7.0, ..parameters() };
    let difference = orientation(1.0, written).0 - orientation(1.0, parameters()).0;
    assert!((0.016..0.019).contains(&difference.abs()), "{difference}");
}

#[test]
fn an_encoder_read_before_the_currents_is_turned_on_by_what_it_is_late() {
    let told = MotorParameters { encoder_delay_s: 10e-6, ..parameters() };
    for speed in [11.0f64, -11.0] {
        // 11 rad/s of the joint are 3927 of the magnet: 39 mrad in 10 us, and a vector that lags.
        let untold = orientation_read_before(10e-6, speed, parameters()).0;
        assert!((0.035..0.043).contains(&untold.abs()), "{untold}");
        let told = orientation_read_before(10e-6, speed, told).0;
        assert!(told.abs() < 0.006, "{told}");
    }
}

#[test]
fn what_speed_induces_is_known_beforehand() {
    for speed in [11.0, -11.0] {
        // The bridge closes on a turning motor: its 7.2 V of back-EMF would drive 20 A and more.
        let mut rig = Rig::settled(turning(speed), parameters(), none());
        rig.control.set_driving(false);
        rig.run(cycles(0.01));
        rig.control.set_driving(true);
        let kick = (0..cycles(0.01)).fold(0.0f64, |kick, _| {
            rig.cycle();
            let [d, q] = rig.stage.plant.current();
            kick.max(d.hypot(q))
        });
        // A step of q pulls on d, by 5.4 V at 15 A.
        rig.setpoint.current_a = 15.0;
        let pull = (0..cycles(0.01)).fold(0.0f64, |pull, _| {
            rig.cycle();
            pull.max(rig.stage.plant.current()[0].abs())
        });
        println!(
            "{speed} rad/s: {kick:.2} A when the bridge closes, {pull:.2} A of d in a step of 15 A"
        );
        assert!((0.05..1.5).contains(&kick), "{kick}");
        assert!((0.05..2.5).contains(&pull), "{pull}");
    }
}

#[test]
fn three_shunts_do_as_well_as_two() {
    use firmware::control::Valid;
    let ends = [Valid::CURRENT_C, Valid::empty()].map(|more| {
        let mut rig = Rig::settled(turning(2.0), parameters(), none());
        rig.stage.valid |= more;
        rig.setpoint.current_a = -7.0;
        rig.run(cycles(0.01));
        rig.stage.plant.current()[1]
    });
    for end in ends {
        assert!((end + 7.0).abs() < 0.1, "{end}");
    }
}

#[test]
fn direction_signs_turn_everything_that_depends_on_them() {
    let mut rig = Rig::settled(
        Machine { coulomb: 0.1, static_level: 0.1, ..Machine::default() },
        MotorParameters { joint_direction: -1.0, ..parameters() },
        none(),
    );
    rig.setpoint.current_a = 2.0;
    let cycle = rig.run(cycles(0.1));
    // The joint is said to turn against the motor: 2 A are -2 A of the motor, and it moves backwards.
    assert!((rig.stage.plant.current()[1] + 2.0).abs() < 0.1);
    assert!(rig.stage.plant.velocity() < -0.3);
    assert!(cycle.velocity_rad_s > 0.3 && cycle.acceleration_rad_s2 > 0.0);
    assert!((cycle.current_q_a - 2.0).abs() < 0.1);
}

/// Back to 3 A from a set-point of -24 A held for long: time until within 0.3 A of it, s; the peak, A; the
/// current before, A; and whether the voltage limited it.
fn release(bus: f64) -> (f64, f64, f64, bool) {
    let machine = Machine { bus, ..turning(-11.9) };
    let mut rig = Rig::settled(machine, parameters(), none());
    rig.setpoint.current_a = -24.0;
    let limited = rig.run(cycles(0.2)).flags.contains(LoopFlags::VOLTAGE_LIMITED);
    let before = rig.stage.plant.current()[1];
    rig.setpoint.current_a = 3.0;
    let (mut arrived, mut peak) = (None, f64::MIN);
    for k in 0..cycles(0.01) {
        rig.cycle();
        let q = rig.stage.plant.current()[1];
        peak = peak.max(q);
        if (q - 3.0).abs() < 0.3 {
            arrived.get_or_insert(k);
        }
    }
    let end = rig.cycle();
    assert!(!end.flags.contains(LoopFlags::VOLTAGE_LIMITED));
    assert!((end.current_q_a - 3.0).abs() < 0.2);
    (arrived.expect("it arrives") as f64 * f64::from(PERIOD_S), peak, before, limited)
}

#[test]
fn the_voltages_end_is_told_and_leaves_no_windup() {
    // 24 A at this speed want 11 V along q and 9 V along d, 14 V together; a bus of 18.5 V gives 10.
    let (slow, peak, before, limited) = release(18.5);
    let (free, _, unlimited, never) = release(48.0);
    println!("released from the limit in {slow:e} s, without one in {free:e} s; peak {peak:.2} A");
    assert!(limited && !never);
    assert!(before > -20.0 && (unlimited + 24.0).abs() < 0.3, "{before} {unlimited}");
    // As quick as if there had never been a limit, and no farther than a step goes.
    assert!((0.3 * free..1.5 * free).contains(&slow), "{slow:e} against {free:e}");
    assert!(peak < 3.0 + 0.08 * (3.0 - before), "{peak}");
}
