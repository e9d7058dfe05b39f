//! Tests of a driver on its own sensors: set-points age, and a joint without commands stops.

use super::bench::{Bench, NODE, frame};
use compensator_core::TermKind;
use compensator_core::can::{CommandFrame, JointKind, Message, MotionFrame, SealFrame};
use firmware::control::{Covariates, MotorParameters};
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::InputsObject;
use firmware::node_settings::InputSource;
use firmware::supervisor::{Code, JointState};

fn measured() -> LoopReport {
    LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        bridge_temperature_c: Some(30.0),
        motor_temperature_c: Some(30.0),
        sample_age_us: Some(10),
        velocity_rad_s: 1.5,
        position_rad: 0.25,
        motor_torque_nm: 2.0,
        ..LoopReport::default()
    }
}

fn command(bench: &mut Bench, counter: u8) {
    bench.give(Message::Command(NODE, CommandFrame::new(3.0, 1.0, counter)));
}

/// Creates a joint that has been measured, commanded and armed for a while.
fn armed() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.start();
    // Commit the default parameters: otherwise compensation is not allowed.
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    bench.commission();
    for counter in 0..20 {
        bench.driver.joint.report(&measured());
        command(&mut bench, counter);
        bench.pass_ms(1);
    }
    bench.write(index::STATE, 1, &[1]).unwrap();
    bench.sent();
    bench
}

/// Advances the time with measurements.
fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.joint.report(&measured());
        bench.pass_ms(1);
    }
}

#[test]
fn arming_without_measurements_and_set_point_is_refused() {
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.pass_ms(5);
    assert_eq!(bench.write(index::STATE, 1, &[1]), Err(0x0800_0022));
    let reason = bench.text(index::REFUSAL);
    for why in ["command-timeout", "unmeasured", "not-commissioned"] {
        assert!(reason.contains(why), "{reason}");
    }
    assert!(!bench.driver.joint.loop_commands(bench.now_us).bridge);
}

/// The default parameters belong to some motor, and the encoder of this one may have any offset: 26 A may make
/// it run away.
#[test]
fn arming_an_uncommissioned_joint_is_refused() {
    let mut bench = Bench::on_sensors();
    bench.start();
    let tries = |bench: &mut Bench, counter: u8| {
        for step in 0..10 {
            bench.driver.joint.report(&measured());
            command(bench, counter + step);
            bench.pass_ms(1);
        }
        let armed = bench.write(index::STATE, 1, &[1]).is_ok();
        assert_eq!(bench.driver.joint.loop_commands(bench.now_us).bridge, armed);
        bench.write(index::STATE, 1, &[0]).unwrap();
        armed
    };
    let commit = |bench: &mut Bench| {
        let staged = bench.number(index::COMMIT, 2);
        bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    };
    assert!(!tries(&mut bench, 0));
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
    // Friction parameters are not part of the wiring.
    bench.write(index::PARAMETERS, 1, &0.5f32.to_le_bytes()).unwrap();
    commit(&mut bench);
    assert!(!tries(&mut bench, 10));
    // Only the wiring in use can be confirmed.
    let wiring = bench.number(index::COMMISSIONING, 2);
    let wrong = bench.write(index::COMMISSIONING, 3, &(wiring ^ 1).to_le_bytes());
    assert_eq!(wrong, Err(0x0609_0030));
    assert!(bench.text(index::REFUSAL).contains(&format!("{wiring:08x}")));
    assert!(!tries(&mut bench, 20));
    bench.commission();
    assert_eq!(bench.number(index::COMMISSIONING, 1), 1);
    assert!(tries(&mut bench, 30));
    // A new limit keeps the confirmation, a new direction does not. The old direction restores it.
    let place =
        |name| MotorParameters::NAMES.iter().position(|known| *known == name).unwrap() as u8 + 1;
    let change = |bench: &mut Bench, name, to: f32| {
        bench.write(index::MOTOR, place(name), &to.to_le_bytes()).unwrap();
        commit(bench);
    };
    change(&mut bench, "current_limit_a", 10.0);
    assert!(tries(&mut bench, 40));
    change(&mut bench, "encoder_direction", -1.0);
    assert!(!tries(&mut bench, 50));
    assert_eq!(bench.number(index::COMMISSIONING, 1), 0);
    change(&mut bench, "encoder_direction", 1.0);
    assert!(tries(&mut bench, 60));
    // The confirmation survives a reset if it was saved; restored defaults remove it.
    bench.write(index::STORE, 1, b"save").unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.start();
    assert!(tries(&mut bench, 70));
    bench.write(index::RESTORE, 1, b"load").unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.start();
    assert!(!tries(&mut bench, 80));
}

#[test]
fn armed_joint_commands_the_set_point_with_its_age() {
    let bench = armed();
    let commands = bench.driver.joint.loop_commands(bench.now_us + 5000);
    assert!(commands.bridge && commands.compensation);
    assert_eq!(commands.setpoint.current_a, 3.0);
    assert_eq!(commands.setpoint.velocity_reference_rad_s, 1.0);
    assert!((commands.setpoint.age_s - 0.006).abs() < 1e-6, "{}", commands.setpoint.age_s);
}

/// Attack: block the bus. Bound: the joint stops 100 ms after the last command.
#[test]
fn joint_without_commands_stops_within_a_tenth_of_a_second() {
    let mut bench = armed();
    pass(&mut bench, 98);
    assert!(bench.driver.joint.is_armed());
    pass(&mut bench, 2);
    assert_eq!(bench.driver.joint.supervisor().state(), JointState::Fault);
    assert!(!bench.driver.joint.loop_commands(bench.now_us).bridge);
    let code = Code::CommandTimeout.info().emergency.to_le_bytes();
    let is_reported = bench.sent().iter().any(|f| f.identifier() == 0x81 && f.data()[..2] == code);
    assert!(is_reported, "an emergency");
    // A new set-point does not restart it.
    command(&mut bench, 100);
    pass(&mut bench, 5);
    assert!(!bench.driver.joint.is_armed());
    bench.write(index::STATE, 1, &[2]).unwrap();
    assert!(!bench.driver.joint.is_armed());
    command(&mut bench, 101);
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert!(bench.driver.joint.is_armed());
}

#[test]
fn duplicate_and_late_commands_do_not_refresh_the_set_point() {
    let mut bench = armed();
    for _ in 0..99 {
        command(&mut bench, 19);
        command(&mut bench, 10);
        pass(&mut bench, 1);
    }
    pass(&mut bench, 1);
    assert_eq!(bench.driver.joint.supervisor().state(), JointState::Fault);
    let counters = bench.driver.joint.counters();
    assert_eq!((counters.command_duplicate, counters.command_late), (99, 99));
}

#[test]
fn position_can_be_set_only_while_disarmed() {
    let mut bench = Bench::on_sensors();
    bench.start();
    let before = bench.driver.joint.loop_commands(bench.now_us).home;
    bench.write(index::STATE, 6, &1.25f32.to_le_bytes()).unwrap();
    let home = bench.driver.joint.loop_commands(bench.now_us).home;
    assert_eq!((home.position_rad, home.number), (1.25, before.number + 1));
    let refused = bench.write(index::STATE, 6, &f32::INFINITY.to_le_bytes());
    assert_eq!(refused, Err(0x0609_0030));
    assert!(bench.text(index::REFUSAL).contains("set_position_rad = inf"));
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).home, home);

    let mut bench = armed();
    let home = bench.driver.joint.loop_commands(bench.now_us).home;
    assert_eq!(bench.write(index::STATE, 6, &1f32.to_le_bytes()), Err(0x0800_0022));
    bench.check_refusal("position of an armed joint", &[]);
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).home, home);
    assert!(bench.driver.joint.is_armed());

    // A joint in HIL receives its position in frames.
    let mut bench = Bench::hil();
    bench.start();
    assert_eq!(bench.write(index::STATE, 6, &1f32.to_le_bytes()), Err(0x0800_0022));
    bench.check_refusal("position in HIL", &["HIL"]);
}

#[test]
fn measurements_are_sent_as_a_trace() {
    let mut bench = armed();
    bench.give_ten_syncs();
    let messages = bench.messages();
    let [Message::Motion(_, motion), Message::Torque(_, torque), Message::Answer(..), ..] =
        messages[..]
    else {
        panic!("{messages:?}")
    };
    assert_eq!((motion.velocity_rad_s, motion.position_rad), (1.5, 0.25));
    assert_eq!(torque.torque_nm, 2.0);
}

/// Two senders with the same identifier cause bus-off. A master and a joint share no identifier, and Motion and
/// Torque have one sender each, as their PDOs say.
#[test]
fn sent_and_received_identifiers_are_disjoint() {
    const UNUSED: u32 = 1 << 31;
    for (mut bench, says) in [(armed(), true), (Bench::hil(), false)] {
        let pdos = |bench: &mut Bench, from: u16| -> Vec<u32> {
            (from..from + 16)
                .filter_map(|object| {
                    let value = bench.read(object, 1).ok()?;
                    Some(u32::from_le_bytes(value.try_into().unwrap()))
                })
                .collect()
        };
        let (received, sends) = (pdos(&mut bench, 0x1400), pdos(&mut bench, 0x1800));
        let used = |all: &[u32]| -> Vec<u32> {
            all.iter().copied().filter(|identifier| identifier & UNUSED == 0).collect()
        };
        assert!(used(&received).iter().all(|identifier| !used(&sends).contains(identifier)));
        assert_eq!(used(&sends).contains(&0x481), says);
        assert_eq!(used(&received).contains(&0x481), !says);
        assert_eq!(used(&sends).contains(&0x681), says);
        // The identifiers of a master in the predefined connection set are not used by the joint.
        for master in [0x201, 0x301, 0x401, 0x501] {
            assert!(!sends.contains(&master) && !sends.contains(&(master | UNUSED)));
        }
    }
    let mut bench = armed();
    bench.give_ten_syncs();
    let sent: Vec<u16> = bench.sent().iter().map(|frame| frame.identifier()).collect();
    assert_eq!(sent, [0x481, 0x681, 0x181, 0x281, 0x381]);
    // A frame that the joint itself sends is not accepted from others.
    let before = bench.driver.joint.counters().foreign;
    bench.driver.receive(&frame(0x481, &[0; 8]), bench.now_us);
    assert_eq!(bench.driver.joint.counters().foreign, before + 1);
}

#[test]
fn input_written_as_an_object_acts_like_its_frame() {
    let mut bench = armed();
    let inputs = index::INPUTS;
    bench.write(inputs, InputsObject::LOAD_TORQUE, &2.5f32.to_le_bytes()).unwrap();
    pass(&mut bench, 3);
    let covariates = bench.driver.joint.loop_commands(bench.now_us).covariates;
    assert_eq!(covariates.load_torque_nm.value, 2.5);
    assert!((covariates.load_torque_nm.age_s - 0.003).abs() < 1.1e-3);
    // A command by its words has a counter, too: a repeated one is a duplicate.
    let fresh = |bench: &mut Bench| {
        bench.sent();
        bench.write(inputs, InputsObject::COMMAND_CURRENT, &4.0f32.to_le_bytes()).unwrap();
        bench.write(inputs, InputsObject::COMMAND_REST, &(20u32 << 24).to_le_bytes()).unwrap();
        bench.driver.joint.loop_commands(bench.now_us).setpoint
    };
    assert_eq!(fresh(&mut bench).current_a, 4.0);
    let repeated = bench.driver.joint.counters().command_duplicate;
    fresh(&mut bench);
    assert!(bench.driver.joint.counters().command_duplicate > repeated);
    // It is also sent in the joint's own frame.
    bench.give_ten_syncs();
    let messages = bench.messages();
    let said =
        |message: &Message| matches!(message, Message::Torque(_, of) if of.load_torque_nm == 2.5);
    assert!(messages.iter().any(said), "{messages:?}");
}

/// Every covariate of the table has an entry of the same name in object 2004h, which acts like its frame. The
/// test fails for a covariate without an entry, or whose frame is not evaluated.
#[test]
fn covariate_of_any_quantity_written_as_object_reaches_the_current_loop() {
    for &quantity in Covariates::QUANTITIES {
        let name = quantity.name(JointKind::Revolute);
        let entries = InputsObject::ENTRIES.iter();
        let place = entries.take_while(|entry| entry.name != name).count();
        assert!(place < InputsObject::ENTRIES.len(), "{name} has no entry");
        let value = 2.5 * quantity.info().outside_scale as f32;
        let mut bench = armed();
        bench.write(index::INPUTS, place as u8 + 1, &value.to_le_bytes()).unwrap();
        let mut covariates = bench.driver.joint.loop_commands(bench.now_us).covariates;
        for &other in Covariates::QUANTITIES {
            let reading = covariates.get_mut(other).unwrap();
            assert_eq!(reading.age_s >= 0.0, other == quantity, "{name}: {other:?}");
        }
        assert!((covariates.get_mut(quantity).unwrap().value - 2.5).abs() < 1e-6, "{name}");
    }
}

#[test]
fn overvoltage_and_consecutive_overruns_stop_the_joint() {
    let mut bench = armed();
    bench.driver.joint.report(&LoopReport { bus_voltage_v: Some(90.0), ..measured() });
    bench.pass_ms(1);
    assert!(bench.driver.joint.supervisor().faults().contains(Code::BusOvervoltage));

    let mut bench = armed();
    bench.driver.joint.report(&LoopReport { overruns_in_a_row: 1, ..measured() });
    assert!(bench.driver.joint.is_armed());
    assert!(!bench.driver.joint.loop_commands(bench.now_us).compensation);
    bench.driver.joint.report(&LoopReport { overruns_in_a_row: 50, ..measured() });
    assert!(bench.driver.joint.supervisor().faults().contains(Code::LoopOverrun));
}

#[test]
fn commit_changes_the_set_number() {
    let mut bench = armed();
    let before = bench.driver.joint.loop_commands(0).set_number;
    bench.write(index::STATE, 1, &[0]).unwrap();
    bench.write(index::COMPENSATOR, 1, &0.5f32.to_le_bytes()).unwrap();
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    assert_ne!(bench.driver.joint.loop_commands(0).set_number, before);
    bench.driver.receive(&frame(0, &[2, 1]), 0);
    assert!(!bench.driver.joint.loop_commands(0).bridge);
}

#[test]
fn terms_are_live_while_their_quantities_are_received() {
    let mut bench = Bench::hil();
    bench.start();
    let term = |bench: &mut Bench, place: u8, kind: TermKind| {
        bench.write(index::MODEL, place, &[kind as u8]).unwrap();
    };
    term(&mut bench, 3, TermKind::PressureCoulomb);
    term(&mut bench, 4, TermKind::PositionRipple);
    term(&mut bench, 5, TermKind::QuadraticDrag);
    let live = |bench: &mut Bench| bench.number(index::LIVE_TERMS, 0);
    assert_eq!(live(&mut bench), 0, "staged terms are not in use");
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    let bit = |kind: TermKind| 1u32 << kind as u8;
    assert_eq!(live(&mut bench), bit(TermKind::QuadraticDrag));
    bench.give(Message::Seal(NODE, SealFrame { radial_force_n: f32::NAN, pressure_diff_pa: 1e5 }));
    bench.give(Message::Motion(NODE, MotionFrame { velocity_rad_s: 0.0, position_rad: 0.5 }));
    let all = bit(TermKind::QuadraticDrag)
        | bit(TermKind::PressureCoulomb)
        | bit(TermKind::PositionRipple);
    assert_eq!(live(&mut bench), all);
    bench.pass_ms(60_000);
    bench.sent();
    assert_eq!(live(&mut bench), all & !bit(TermKind::PressureCoulomb), "old");
}
