//! Values that a board reads at its start only: while those of the set in use differ, nothing closes the bridge.

use super::STATE_REFUSED;
use super::bench::Bench;
use super::drive::{control, in_cst, pass};
use super::parameter_trial::save;
use compensator_core::can::Message;
use firmware::control::MotorParameters;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{CommissioningObject, CommissioningRunObject as Run};
use firmware::node_settings::InputSource;
use firmware::sensors::SensorParameters;
use firmware::supervisor::Code;

fn place(names: &[&str], name: &str) -> u8 {
    names.iter().position(|known| *known == name).expect(name) as u8 + 1
}

/// Commits the set in use with this value of a sensor or of the motor.
fn commit(bench: &mut Bench, name: &str, value: f32) {
    let (object, place) = match SensorParameters::NAMES.contains(&name) {
        true => (index::SENSORS, place(&SensorParameters::NAMES, name)),
        false => (index::MOTOR, place(&MotorParameters::NAMES, name)),
    };
    bench.write(object, place, &value.to_le_bytes()).expect(name);
    let crc = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &crc.to_le_bytes()).expect(name);
    bench.commission();
}

/// Requests to arm, from a tool, a CiA 402 master and commissioning. Returns whether the bridge closes.
fn closes(bench: &mut Bench) -> [bool; 4] {
    let mut results = [false; 4];
    for (way, result) in results.iter_mut().enumerate() {
        control(bench, 0, 0);
        match way {
            0 => _ = bench.write(index::STATE, 1, &[1]),
            1 => [0x06, 0x07, 0x0F].into_iter().for_each(|word| control(bench, word, 0)),
            2 => _ = bench.write(index::COMMISSIONING_RUN, Run::ORDER, &[1]),
            _ => _ = bench.write(index::COMMISSIONING_RUN, Run::ORDER, &[3]),
        }
        *result = bench.driver.joint.loop_commands(bench.now_us).bridge;
        let _ = bench.write(index::STATE, 1, &[0]);
        pass(bench, 3);
    }
    results
}

#[test]
fn set_with_other_start_values_closes_no_bridge_until_it_is_started() {
    for (name, value) in [
        ("encoder_kind", 4.0),
        ("shunt_sign", 1.0),
        ("joint_encoder_kind", 1.0),
        ("overcurrent_a", 35.0),
    ] {
        let mut bench = in_cst();
        save(&mut bench).unwrap();
        commit(&mut bench, name, value);
        pass(&mut bench, 3);
        assert_eq!(closes(&mut bench), [false; 4], "{name}");
        assert_eq!(bench.write(index::STATE, 1, &[1]), Err(STATE_REFUSED));
        let why = bench.text(index::REFUSAL);
        assert!(why.starts_with(&format!("{name}: needs a restart")), "{why}");
        save(&mut bench).expect("a set that needs a restart can be saved");
        let flash = bench.driver.joint.into_flash();
        let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
        bench.sent();
        bench.start();
        bench.write(index::MODE, 0, &[10]).unwrap();
        pass(&mut bench, 5);
        assert_eq!(closes(&mut bench), [true; 4], "{name} after a restart");
    }
}

#[test]
fn set_with_the_values_of_the_start_again_closes_the_bridge() {
    let mut bench = in_cst();
    commit(&mut bench, "encoder_kind", 4.0);
    commit(&mut bench, "encoder_kind", 0.0);
    // No AS504x uses them.
    commit(&mut bench, "abz_lines", 500.0);
    commit(&mut bench, "pole_pairs", 8.0);
    pass(&mut bench, 3);
    assert_eq!(closes(&mut bench), [true; 4]);
}

#[test]
fn joint_in_hil_needs_no_restart() {
    let mut bench = Bench::hil();
    bench.start();
    commit(&mut bench, "encoder_kind", 4.0);
    bench
        .give(Message::Command(super::NODE, compensator_core::can::CommandFrame::new(0.0, 0.0, 0)));
    bench.write(index::STATE, 1, &[1]).expect("it drives nothing");
}

/// The joint turns by its current, and is disarmed. Another wiring is committed before the next report, and armed again.
#[test]
fn proof_of_one_wiring_is_not_kept_for_another() {
    let proven =
        |bench: &mut Bench| bench.number(index::COMMISSIONING, CommissioningObject::PROVEN);
    let turning = LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        current_a: 2.0,
        velocity_rad_s: 0.5,
        ..LoopReport::default()
    };
    let mut bench = in_cst();
    let arm = |bench: &mut Bench| {
        [0x06, 0x07, 0x0F].into_iter().for_each(|word| control(bench, word, 0));
        assert!(bench.driver.joint.is_armed());
    };
    let turn = |bench: &mut Bench, milliseconds| {
        for _ in 0..milliseconds {
            control(bench, 0x0F, 0);
            bench.driver.joint.report(&turning);
            bench.pass_ms(1);
        }
    };
    arm(&mut bench);
    turn(&mut bench, 150);
    assert_eq!(proven(&mut bench), 0, "0.075 rad prove nothing");
    // No report comes while the joint is disarmed.
    control(&mut bench, 0, 0);
    commit(&mut bench, "gear_ratio", 52.0);
    arm(&mut bench);
    turn(&mut bench, 150);
    assert_eq!(proven(&mut bench), 0, "both wirings turned 0.075 rad");
    turn(&mut bench, 100);
    assert_eq!(proven(&mut bench), 1);
}

/// The defaults of a board whose shunts see less are not driven with. The reason names the current.
#[test]
fn defaults_beyond_the_shunts_are_refused_by_name_and_raise_no_internal_error() {
    let stage = StageTraits { current_max_a: 30.0, ..StageTraits::NONE };
    let mut bench = Bench::on_stage(stage);
    let refused = firmware::loop_parts::LoopParts::build(
        bench.driver.joint.set(),
        stage,
        firmware::control::PERIOD_S,
    );
    bench.driver.joint.base().start.set_refused(Some(refused.expect_err("40 A")));
    bench.start();
    bench.commission();
    bench.write(index::MODE, 0, &[10]).unwrap();
    pass(&mut bench, 5);
    assert_eq!(closes(&mut bench), [false; 4]);
    assert_eq!(bench.write(index::STATE, 1, &[1]), Err(STATE_REFUSED));
    bench.check_refusal("defaults beyond the shunts", &["measure no more"]);
    assert!(!bench.driver.joint.supervisor().faults().contains(Code::Internal));
    for (name, value) in [("current_limit_a", 20.0f32), ("overcurrent_a", 29.0)] {
        bench
            .write(index::MOTOR, place(&MotorParameters::NAMES, name), &value.to_le_bytes())
            .unwrap();
    }
    let names = &firmware::supervisor::Thresholds::NAMES;
    bench.write(index::THRESHOLDS, place(names, "overcurrent_a"), &29f32.to_le_bytes()).unwrap();
    let crc = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &crc.to_le_bytes()).expect("within the range");
    bench.commission();
    pass(&mut bench, 3);
    assert_eq!(bench.write(index::STATE, 1, &[1]), Err(STATE_REFUSED));
    bench.check_refusal("set that needs a restart", &["overcurrent_a"]);
}
