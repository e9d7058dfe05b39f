//! The joint as a drive of CiA 402, as a master sees it that knows nothing of joints: controlword, CST, statusword.

use super::bench::{Bench, frame};
use compensator_core::can::{Message, Sync};
use firmware::driver::LoopReport;
use firmware::node::dictionary::index;
use firmware::supervisor::{Code, State};

const CST: u8 = 10;
const RPDO_1: u16 = 0x201;

fn measured() -> LoopReport {
    LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        velocity_rad_s: -1.5,
        position_rad: 0.25,
        motor_torque_nm: 6.5,
        ..LoopReport::default()
    }
}

/// A commissioned joint, measured, in CST.
fn in_cst() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.commission();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    pass(&mut bench, 5);
    bench
}

fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.report(&measured());
        bench.pass_ms(1);
    }
}

fn control(bench: &mut Bench, controlword: u16, target_permille: i16) {
    let [a, b] = controlword.to_le_bytes();
    let [c, d] = target_permille.to_le_bytes();
    bench.driver.receive(&frame(RPDO_1, &[a, b, c, d]), bench.now_us);
}

/// State bits of the statusword.
fn state(bench: &mut Bench) -> u16 {
    bench.number(index::STATUSWORD, 0) as u16 & 0x6F
}

fn enabled() -> Bench {
    let mut bench = in_cst();
    for (word, expected) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        control(&mut bench, word, 100);
        assert_eq!(state(&mut bench), expected);
    }
    assert!(bench.driver.is_armed());
    bench.sent();
    bench
}

#[test]
fn a_master_brings_it_up_drives_and_stops_it() {
    let mut bench = in_cst();
    assert_eq!(bench.number(index::DEVICE_TYPE, 0), 0x0002_0192);
    assert_eq!(bench.number(index::SUPPORTED_MODES, 0), 1 << 9 | 1 << 8 | 1 << 5);
    assert_eq!(bench.number(index::MODE_DISPLAY, 0), 10);
    assert_eq!(state(&mut bench), 0x40);
    // Rated: 26 A, and 1 Nm/A at the joint.
    assert_eq!(bench.number(index::RATED_CURRENT, 0), 26_000);
    assert_eq!(bench.number(index::RATED_TORQUE, 0), 26_000);
    let mut bench = enabled();
    control(&mut bench, 0x0F, -250);
    let orders = bench.driver.orders(bench.now_us);
    assert!(orders.bridge);
    assert!((orders.setpoint.current_a + 6.5).abs() < 1e-4);
    // What it says of itself, as numbers and in its frame.
    assert_eq!(bench.number(index::ACTUAL_TORQUE, 0) as i16, 250);
    assert_eq!(bench.number(index::ACTUAL_POSITION, 0) as i32, 250_000);
    assert_eq!(bench.number(index::ACTUAL_VELOCITY, 0) as i32, -1_500_000);
    bench.write(index::CONTROLWORD, 0, &[0x07, 0]).unwrap();
    assert_eq!(state(&mut bench), 0x23);
    assert!(!bench.driver.is_armed() && !bench.driver.orders(bench.now_us).bridge);
    // A quick stop has no ramp: it opens the bridge.
    let mut bench = enabled();
    control(&mut bench, 0x0B, 0);
    assert_eq!(state(&mut bench), 0x40);
    assert!(!bench.driver.is_armed());
}

/// The whole statusword.
fn status(bench: &mut Bench) -> u16 {
    bench.number(index::STATUSWORD, 0) as u16
}

#[test]
fn a_joint_takes_where_it_stands_for_its_home_and_not_where_it_moves() {
    const HOMING: u8 = 6;
    let mut bench = in_cst();
    assert_eq!(bench.number(index::HOMING_METHODS, 1) as i8, 37);
    for method in [1i8, 17, -1, 36] {
        assert!(bench.write(index::HOMING_METHOD, 0, &method.to_le_bytes()).is_err(), "{method}");
        let why = bench.text(index::REFUSAL);
        assert!(why.contains("37 or 35"), "{why}");
    }
    bench.write(index::HOMING_METHOD, 0, &[35]).unwrap();
    bench.write(index::HOME_OFFSET, 0, &(-750_000i32).to_le_bytes()).unwrap();
    bench.write(index::MODE, 0, &[HOMING]).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 300);
    }
    assert!(bench.driver.is_armed());
    // Enabled, it gives no torque, whatever target it was told.
    assert_eq!(bench.driver.orders(bench.now_us).setpoint.current_a, 0.0);
    assert_eq!(status(&mut bench) & 0x3400, 0x0400, "not begun");
    let before = bench.driver.orders(bench.now_us).home;
    // It moves, with 1.5 rad/s.
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x2000, "failed, and it moves");
    let why = bench.text(index::REFUSAL);
    assert!(why.contains("it moves"), "{why}");
    assert_eq!(bench.driver.orders(bench.now_us).home.number, before.number);
    bench.driver.report(&LoopReport { velocity_rad_s: 0.02, ..measured() });
    bench.pass_ms(1);
    // The word that was there is no edge.
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x2400, "failed, and it stands");
    control(&mut bench, 0x0F, 0);
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x1400, "attained");
    let home = bench.driver.orders(bench.now_us).home;
    assert_eq!(home.number, before.number.wrapping_add(1));
    assert!((home.position_rad - 0.75).abs() < 1e-6, "{}", home.position_rad);
    // Another mode knows nothing of it, and the mode begins anew.
    control(&mut bench, 0x06, 0);
    bench.write(index::MODE, 0, &[CST]).unwrap();
    assert_eq!(status(&mut bench) & 0x3400, 0);
    bench.write(index::MODE, 0, &[HOMING]).unwrap();
    assert_eq!(status(&mut bench) & 0x3400, 0x0400);
}

/// RPDO 1 of a master that knows velocities.
fn drive_at(bench: &mut Bench, controlword: u16, micro_rad_s: i32) {
    let mut data = [0; 8];
    data[..2].copy_from_slice(&controlword.to_le_bytes());
    data[4..].copy_from_slice(&micro_rad_s.to_le_bytes());
    bench.driver.receive(&frame(RPDO_1, &data), bench.now_us);
}

/// Milliseconds at a speed, the master's frame in each.
fn pass_at(bench: &mut Bench, milliseconds: u64, velocity_rad_s: f32, target_micro_rad_s: i32) {
    for _ in 0..milliseconds {
        drive_at(bench, 0x0F, target_micro_rad_s);
        bench.driver.report(&LoopReport { velocity_rad_s, ..measured() });
        bench.pass_ms(1);
    }
}

#[test]
fn a_velocity_is_made_a_current_and_is_the_compensators_reference() {
    let mut bench = in_cst();
    bench.write(index::MODE, 0, &[9]).unwrap();
    assert_eq!(bench.number(index::MODE_DISPLAY, 0), 9);
    // 12 rad/s of the joint, behind a gear of 51.
    assert_eq!(bench.number(index::MAX_MOTOR_SPEED, 0), 5844);
    for word in [0x06, 0x07, 0x0F] {
        drive_at(&mut bench, word, 0);
    }
    assert_eq!(state(&mut bench), 0x27);
    // From the speed it has, -1.5 rad/s, with 50 rad/s^2.
    pass_at(&mut bench, 10, -1.5, 2_000_000);
    let setpoint = bench.driver.orders(bench.now_us).setpoint;
    assert!((setpoint.velocity_reference_rad_s + 1.0).abs() < 1e-3, "{setpoint:?}");
    assert!(setpoint.current_a > 1.4 && setpoint.current_a < 2.5, "{setpoint:?}");
    pass_at(&mut bench, 100, 1.0, 2_000_000);
    let setpoint = bench.driver.orders(bench.now_us).setpoint;
    assert_eq!(setpoint.velocity_reference_rad_s, 2.0);
    assert_eq!(bench.number(index::VELOCITY_DEMAND, 0), 2_000_000);
    // Held at it, the current grows to what 6072h and the rating leave, and no further.
    pass_at(&mut bench, 2000, 0.0, 2_000_000);
    assert_eq!(bench.driver.orders(bench.now_us).setpoint.current_a, 26.0);
    // A target beyond 6080h is held there, and said.
    assert_eq!(bench.number(index::STATUSWORD, 0) & 1 << 11, 0);
    pass_at(&mut bench, 400, 5.0, i32::MAX);
    assert_eq!(bench.driver.orders(bench.now_us).setpoint.velocity_reference_rad_s, 12.0);
    assert_ne!(bench.number(index::STATUSWORD, 0) & 1 << 11, 0);
    // Nothing of it without a sign of life for a tenth of a second: the set-point is as old as that.
    pass(&mut bench, 98);
    assert!(bench.driver.is_armed());
    assert!((bench.driver.orders(bench.now_us).setpoint.age_s - 0.099).abs() < 1e-4);
    pass(&mut bench, 3);
    assert!(!bench.driver.is_armed());
    // The next enabling begins from the speed it has then.
    for _ in 0..3 {
        drive_at(&mut bench, 0, 0);
        pass(&mut bench, 1);
    }
    drive_at(&mut bench, 0x80, 0);
    bench.write(index::MAX_MOTOR_SPEED, 0, &487u32.to_le_bytes()).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        drive_at(&mut bench, word, 0);
    }
    assert!(bench.driver.is_armed());
    pass_at(&mut bench, 100, 0.0, -3_000_000);
    let reference = bench.driver.orders(bench.now_us).setpoint.velocity_reference_rad_s;
    assert!((reference + 1.0).abs() < 1e-3, "{reference} rad/s, 487 turns a minute of the motor");
    // Stopped as in CST: at once, without a ramp.
    drive_at(&mut bench, 0x0B, 0);
    assert!(!bench.driver.is_armed() && !bench.driver.orders(bench.now_us).bridge);
    // Frames of other lengths are none.
    let wrong = bench.driver.counters().wrong_length;
    bench.driver.receive(&frame(RPDO_1, &[0x0F, 0, 0, 0, 1, 0]), bench.now_us);
    assert_eq!(bench.driver.counters().wrong_length, wrong + 1);
}

#[test]
fn a_master_gives_its_frame_an_identifier_and_gets_it_at_every_sync() {
    let mut bench = in_cst();
    let sync = |bench: &mut Bench, counter| -> Vec<u16> {
        bench.give(Message::Sync(Sync { counter }));
        bench.sent().iter().map(|frame| frame.identifier()).collect()
    };
    assert!(!sync(&mut bench, 1).contains(&0x1F1));
    // Not the SYNC's, not a heartbeat's, and not an extended one.
    for wrong in [0x080u32, 0x701, 0x2000_0181, 0x180] {
        assert_eq!(bench.write(0x1805, 1, &wrong.to_le_bytes()), Err(0x0609_0030), "{wrong:x}");
    }
    // As masters do it: the friction's frame away, the drive's in its place.
    bench.write(0x1800, 1, &0x8000_0181u32.to_le_bytes()).unwrap();
    bench.write(0x1805, 1, &0x4000_0181u32.to_le_bytes()).unwrap();
    assert_eq!(bench.number(0x1805, 1), 0x4000_0181);
    bench.give(Message::Sync(Sync { counter: 2 }));
    let sent = bench.sent();
    let [drive] = sent.iter().filter(|frame| frame.identifier() == 0x181).collect::<Vec<_>>()[..]
    else {
        panic!("one frame under 181h: {sent:?}")
    };
    let data = drive.data();
    assert_eq!(u16::from_le_bytes([data[0], data[1]]) & 0x6F, 0x40);
    assert_eq!(i16::from_le_bytes([data[2], data[3]]), 250);
    assert_eq!(i32::from_le_bytes([data[4], data[5], data[6], data[7]]), 250_000);
    // With the communication it begins anew as it was.
    bench.driver.receive(&frame(0, &[0x82, 1]), bench.now_us);
    assert_eq!(bench.number(0x1805, 1), 0x8000_0181);
    assert_eq!(bench.number(0x1800, 1), 0x181);
}

/// No counter is needed: the same frame again is a sign of life, so is a SYNC, so is a heartbeat; silence is none.
#[test]
fn a_master_that_repeats_a_value_is_alive_and_a_silent_one_is_not() {
    type Sign = fn(&mut Bench, u64);
    let signs: [(&str, Sign); 3] = [
        ("the same frame", |bench, _| control(bench, 0x0F, 100)),
        ("SYNC alone", |bench, at| {
            bench.give(Message::Sync(Sync { counter: (at % 240) as u8 + 1 }));
            bench.sent();
        }),
        ("the awaited heartbeat", |bench, _| {
            bench.driver.receive(&frame(0x707, &[5]), bench.now_us);
        }),
    ];
    for (name, sign) in signs {
        let mut bench = in_cst();
        bench.write(index::AWAITED_HEARTBEAT, 1, &(7u32 << 16 | 500).to_le_bytes()).unwrap();
        for word in [0x06, 0x0F] {
            control(&mut bench, word, 100);
        }
        for at in 0..100 {
            pass(&mut bench, 20);
            sign(&mut bench, at);
            assert!(bench.driver.is_armed(), "{name}, after {at} times 20 ms");
        }
        assert!(bench.driver.orders(bench.now_us).setpoint.age_s < 1e-3, "{name}");
        pass(&mut bench, 98);
        assert!(bench.driver.is_armed(), "{name}");
        pass(&mut bench, 4);
        assert_eq!(bench.driver.supervisor().state(), State::Fault, "{name}");
        assert!(bench.driver.supervisor().faults().contains(Code::CommandTimeout));
        assert_eq!(state(&mut bench), 0x08);
        assert_eq!(bench.number(index::ERROR_CODE, 0), 0x8250);
        // An edge clears it, and nothing starts by itself.
        control(&mut bench, 0x00, 0);
        pass(&mut bench, 2);
        control(&mut bench, 0x80, 0);
        assert_eq!(state(&mut bench), 0x40, "{name}");
        control(&mut bench, 0x0F, 100);
        assert!(!bench.driver.is_armed(), "{name}");
    }
}

#[test]
fn what_stands_against_arming_stands_against_the_profile_too() {
    // Nobody has commissioned it.
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    pass(&mut bench, 5);
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 0);
    }
    assert_eq!(state(&mut bench), 0x23, "it stays switched on");
    assert!(bench.text(index::REFUSAL).contains("not-commissioned"));
    assert_eq!(bench.write(index::CONTROLWORD, 0, &[0x0F, 0]), Err(0x0800_0022));
    // The joint's own frame has no say in this mode, nor a mode that is not there.
    let mut bench = enabled();
    let foreign = bench.driver.counters().foreign;
    bench.driver.receive(&frame(0x301, &[0, 0, 0x80, 0x3F, 0, 0, 0, 99]), bench.now_us);
    assert_eq!(bench.driver.counters().foreign, foreign + 1);
    let mut bench = in_cst();
    for mode in [1i8, 3, 8, 11, -1] {
        assert_eq!(bench.write(index::MODE, 0, &mode.to_le_bytes()), Err(0x0609_0030));
    }
    // Without the mode the frame drives nothing.
    bench.write(index::MODE, 0, &[0]).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 500);
    }
    assert!(!bench.driver.is_armed());
    assert_eq!(bench.driver.orders(bench.now_us).setpoint.age_s, -1.0);
    control(&mut bench, 0x0F, 0);
    let wrong = bench.driver.counters().wrong_length;
    bench.driver.receive(&frame(RPDO_1, &[0x0F, 0]), bench.now_us);
    assert_eq!(bench.driver.counters().wrong_length, wrong + 1);
}
