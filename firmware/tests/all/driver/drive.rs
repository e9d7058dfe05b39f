//! Tests of the joint as a CiA 402 drive, for a master without knowledge of joints: controlword, CST,
//! statusword.

use super::bench::{Bench, frame};
use super::pdos::map;
use compensator_core::can::{Message, SyncFrame};
use firmware::driver::LoopReport;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::supervisor::Thresholds;

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

/// Creates a commissioned joint with measurements, in CST.
pub fn in_cst() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.commission();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    pass(&mut bench, 5);
    bench
}

pub fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.joint.report(&measured());
        bench.pass_ms(1);
    }
}

pub fn control(bench: &mut Bench, controlword: u16, target_permille: i16) {
    let [a, b] = controlword.to_le_bytes();
    let [c, d] = target_permille.to_le_bytes();
    bench.driver.receive(&frame(RPDO_1, &[a, b, c, d]), bench.now_us);
}

/// Returns the state bits of the statusword.
pub fn state(bench: &mut Bench) -> u16 {
    bench.number(index::STATUSWORD, 0) as u16 & 0x6F
}

/// Creates a joint in CST that is enabled, with a target of 100 thousandths.
pub fn enabled() -> Bench {
    let mut bench = in_cst();
    for (word, expected) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        control(&mut bench, word, 100);
        assert_eq!(state(&mut bench), expected);
    }
    assert!(bench.driver.joint.is_armed());
    bench.sent();
    bench
}

#[test]
fn master_in_cst_enables_drives_and_stops_the_joint() {
    let mut bench = in_cst();
    assert_eq!(bench.number(index::DEVICE_TYPE, 0), 0x0002_0192);
    assert_eq!(bench.number(index::SUPPORTED_MODES, 0), 1 << 9 | 1 << 8 | 1 << 7 | 1 << 5 | 0b1101);
    assert_eq!(bench.number(index::MODE_DISPLAY, 0), 10);
    assert_eq!(state(&mut bench), 0x40);
    // Rated: 26 A, and 1 Nm/A at the joint.
    assert_eq!(bench.number(index::RATED_CURRENT, 0), 26_000);
    assert_eq!(bench.number(index::RATED_TORQUE, 0), 26_000);
    let mut bench = enabled();
    control(&mut bench, 0x0F, -250);
    let commands = bench.driver.joint.loop_commands(bench.now_us);
    assert!(commands.bridge);
    assert!((commands.setpoint.current_a + 6.5).abs() < 1e-4);
    assert_eq!(bench.number(index::TORQUE_DEMAND, 0) as i16, -250);
    // Measured values as objects.
    assert_eq!(bench.number(index::ACTUAL_TORQUE, 0) as i16, 250);
    assert_eq!(bench.number(index::ACTUAL_POSITION, 0) as i32, 250_000);
    assert_eq!(bench.number(index::ACTUAL_VELOCITY, 0) as i32, -1_500_000);
    bench.write(index::CONTROLWORD, 0, &[0x07, 0]).unwrap();
    assert_eq!(state(&mut bench), 0x23);
    assert!(
        !bench.driver.joint.is_armed() && !bench.driver.joint.loop_commands(bench.now_us).bridge
    );
    // A quick stop has no ramp: it opens the bridge.
    let mut bench = enabled();
    control(&mut bench, 0x0B, 0);
    assert_eq!(state(&mut bench), 0x40);
    assert!(!bench.driver.joint.is_armed());
}

/// Returns the whole statusword.
fn status(bench: &mut Bench) -> u16 {
    bench.number(index::STATUSWORD, 0) as u16
}

#[test]
fn homing_sets_home_at_standstill_and_fails_in_motion() {
    const HOMING: u8 = 6;
    let mut bench = in_cst();
    assert_eq!(bench.number(index::HOMING_METHODS, 1) as i8, 37);
    for method in [1i8, 17, -3, 36] {
        assert!(bench.write(index::HOMING_METHOD, 0, &method.to_le_bytes()).is_err(), "{method}");
        bench.check_refusal("homing method", &["37", "35"]);
    }
    bench.write(index::HOMING_METHOD, 0, &[35]).unwrap();
    bench.write(index::HOME_OFFSET, 0, &(-750_000i32).to_le_bytes()).unwrap();
    bench.write(index::MODE, 0, &[HOMING]).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 300);
    }
    assert!(bench.driver.joint.is_armed());
    // Enabled in homing mode, the drive gives no torque for any target.
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a, 0.0);
    assert_eq!(status(&mut bench) & 0x3400, 0x0400, "not begun");
    let before = bench.driver.joint.loop_commands(bench.now_us).home;
    // The joint moves with 1.5 rad/s.
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x2000, "failed, and it moves");
    bench.check_refusal("homing in motion", &[]);
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).home.number, before.number);
    bench.driver.joint.report(&LoopReport { velocity_rad_s: 0.02, ..measured() });
    bench.pass_ms(1);
    // An unchanged controlword has no edge.
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x2400, "failed, and it stands");
    control(&mut bench, 0x0F, 0);
    control(&mut bench, 0x1F, 0);
    assert_eq!(status(&mut bench) & 0x3400, 0x1400, "attained");
    let home = bench.driver.joint.loop_commands(bench.now_us).home;
    assert_eq!(home.number, before.number.wrapping_add(1));
    assert!((home.position_rad - 0.75).abs() < 1e-6, "{}", home.position_rad);
    // Another mode clears the homing state.
    control(&mut bench, 0x06, 0);
    bench.write(index::MODE, 0, &[CST]).unwrap();
    assert_eq!(status(&mut bench) & 0x3400, 0);
    bench.write(index::MODE, 0, &[HOMING]).unwrap();
    assert_eq!(status(&mut bench) & 0x3400, 0x0400);
}

/// Sends RPDO 1 with a target velocity.
fn drive_at(bench: &mut Bench, controlword: u16, micro_rad_s: i32) {
    let mut data = [0; 8];
    data[..2].copy_from_slice(&controlword.to_le_bytes());
    data[4..].copy_from_slice(&micro_rad_s.to_le_bytes());
    bench.driver.receive(&frame(RPDO_1, &data), bench.now_us);
}

/// Advances the time at a velocity, with a frame of the master in each millisecond.
fn pass_at(bench: &mut Bench, milliseconds: u64, velocity_rad_s: f32, target_micro_rad_s: i32) {
    for _ in 0..milliseconds {
        drive_at(bench, 0x0F, target_micro_rad_s);
        bench.driver.joint.report(&LoopReport { velocity_rad_s, ..measured() });
        bench.pass_ms(1);
    }
}

/// Creates a joint that is enabled in CSV and has moved towards 2 rad/s for 10 ms, from -1.5 rad/s.
fn in_csv() -> Bench {
    const CSV: u8 = 9;
    let mut bench = in_cst();
    bench.write(index::MODE, 0, &[CSV]).unwrap();
    assert_eq!(bench.number(index::MODE_DISPLAY, 0), 9);
    // 12 rad/s of the joint at a gear ratio of 51.
    assert_eq!(bench.number(index::MAX_MOTOR_SPEED, 0), 5844);
    for word in [0x06, 0x07, 0x0F] {
        drive_at(&mut bench, word, 0);
    }
    assert_eq!(state(&mut bench), 0x27);
    pass_at(&mut bench, 10, -1.5, 2_000_000);
    bench
}

#[test]
fn csv_target_gives_a_current_and_the_velocity_reference() {
    let mut bench = in_csv();
    // The reference starts at the present speed, -1.5 rad/s, with 50 rad/s^2.
    let setpoint = bench.driver.joint.loop_commands(bench.now_us).setpoint;
    assert!((setpoint.velocity_reference_rad_s + 1.0).abs() < 1e-3, "{setpoint:?}");
    assert!(setpoint.current_a > 1.4 && setpoint.current_a < 2.5, "{setpoint:?}");
    pass_at(&mut bench, 100, 1.0, 2_000_000);
    let setpoint = bench.driver.joint.loop_commands(bench.now_us).setpoint;
    assert_eq!(setpoint.velocity_reference_rad_s, 2.0);
    assert_eq!(bench.number(index::VELOCITY_DEMAND, 0), 2_000_000);
    // At a blocked joint the current grows to the limit of 6072h and the rating.
    pass_at(&mut bench, 2000, 0.0, 2_000_000);
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a, 26.0);
    // A target beyond 6080h is limited, and the statusword reports it.
    assert_eq!(bench.number(index::STATUSWORD, 0) & 1 << 11, 0);
    pass_at(&mut bench, 400, 5.0, i32::MAX);
    assert_eq!(
        bench.driver.joint.loop_commands(bench.now_us).setpoint.velocity_reference_rad_s,
        12.0
    );
    assert_ne!(bench.number(index::STATUSWORD, 0) & 1 << 11, 0);
}

#[test]
fn drive_in_csv_stops_without_its_master_and_starts_again_at_the_present_speed() {
    let mut bench = in_csv();
    // Without a message of the master for 0.1 s the joint stops; the age of the set-point shows it.
    pass(&mut bench, 98);
    assert!(bench.driver.joint.is_armed());
    assert!((bench.driver.joint.loop_commands(bench.now_us).setpoint.age_s - 0.099).abs() < 1e-4);
    pass(&mut bench, 3);
    assert!(!bench.driver.joint.is_armed());
    // The next enabling starts from the speed at that time.
    for _ in 0..3 {
        drive_at(&mut bench, 0, 0);
        pass(&mut bench, 1);
    }
    drive_at(&mut bench, 0x80, 0);
    bench.write(index::MAX_MOTOR_SPEED, 0, &487u32.to_le_bytes()).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        drive_at(&mut bench, word, 0);
    }
    assert!(bench.driver.joint.is_armed());
    pass_at(&mut bench, 100, 0.0, -3_000_000);
    let reference =
        bench.driver.joint.loop_commands(bench.now_us).setpoint.velocity_reference_rad_s;
    assert!((reference + 1.0).abs() < 1e-3, "{reference} rad/s, 487 turns a minute of the motor");
    // It stops as in CST: at once, without a ramp.
    drive_at(&mut bench, 0x0B, 0);
    assert!(
        !bench.driver.joint.is_armed() && !bench.driver.joint.loop_commands(bench.now_us).bridge
    );
    // Frames of other lengths are ignored.
    let wrong = bench.driver.joint.counters().wrong_length;
    bench.driver.receive(&frame(RPDO_1, &[0x0F, 0, 0, 0, 1, 0]), bench.now_us);
    assert_eq!(bench.driver.joint.counters().wrong_length, wrong + 1);
}

#[test]
fn drive_pdo_with_identifier_is_sent_at_every_sync() {
    let mut bench = in_cst();
    let sync = |bench: &mut Bench, counter| -> Vec<u16> {
        bench.give(Message::Sync(SyncFrame { counter }));
        bench.sent().iter().map(|frame| frame.identifier()).collect()
    };
    assert!(!sync(&mut bench, 1).contains(&0x1F1));
    // The identifiers of SYNC and heartbeat, and extended ones, are refused.
    for wrong in [0x080u32, 0x701, 0x2000_0181, 0x180] {
        assert_eq!(bench.write(0x1805, 1, &wrong.to_le_bytes()), Err(0x0609_0030), "{wrong:x}");
    }
    // Typical use: disable the answer's PDO and give its identifier to the drive's PDO.
    bench.write(0x1800, 1, &0x8000_0181u32.to_le_bytes()).unwrap();
    bench.write(0x1805, 1, &0x4000_0181u32.to_le_bytes()).unwrap();
    assert_eq!(bench.number(0x1805, 1), 0x4000_0181);
    bench.give(Message::Sync(SyncFrame { counter: 2 }));
    let sent = bench.sent();
    let [drive] = sent.iter().filter(|frame| frame.identifier() == 0x181).collect::<Vec<_>>()[..]
    else {
        panic!("one frame under 181h: {sent:?}")
    };
    let data = drive.data();
    assert_eq!(u16::from_le_bytes([data[0], data[1]]) & 0x6F, 0x40);
    assert_eq!(i16::from_le_bytes([data[2], data[3]]), 250);
    assert_eq!(i32::from_le_bytes([data[4], data[5], data[6], data[7]]), 250_000);
    // A restart of the communication resets the identifiers.
    bench.driver.receive(&frame(0, &[0x82, 1]), bench.now_us);
    assert_eq!(bench.number(0x1805, 1), 0x8000_0181);
    assert_eq!(bench.number(0x1800, 1), 0x181);
}

#[test]
fn csp_holds_until_the_first_target_after_enabling() {
    let mut bench = in_cst();
    bench.write(index::MODE, 0, &[8]).unwrap();
    bench.write(index::TARGET_POSITION, 0, &2_000_000i32.to_le_bytes()).unwrap();
    let still = LoopReport { velocity_rad_s: 0.0, ..measured() };
    bench.driver.joint.report(&still);
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 0);
    }
    for _ in 0..10 {
        control(&mut bench, 0x0F, 0);
        bench.driver.joint.report(&still);
        bench.pass_ms(1);
    }
    assert_eq!(bench.number(index::POSITION_DEMAND, 0) as i32, 250_000, "the old target");
    assert_eq!(bench.number(index::BUS_VOLTAGE, 0), 48_000);
    bench.write(index::TARGET_POSITION, 0, &251_000i32.to_le_bytes()).unwrap();
    for _ in 0..2 {
        bench.driver.joint.report(&still);
        bench.pass_ms(1);
    }
    // A target after 1 ms; single precision resolves 3e-8 rad.
    let near = |found: u32, expected: i32| (found as i32 - expected).abs() <= 1;
    assert!(near(bench.number(index::POSITION_DEMAND, 0), 251_000));
    assert!(near(bench.number(index::FOLLOWING_ERROR, 0), 1_000));
    let setpoint = bench.driver.joint.loop_commands(bench.now_us).setpoint;
    assert!(setpoint.current_a > 0.0, "{setpoint:?}");
}

#[test]
fn controlword_takes_the_position_that_follows_it_in_its_frame() {
    let mut bench = in_cst();
    map(&mut bench, 0x1400, RPDO_1.into(), &[0x6040_0010, 0x607A_0020]).unwrap();
    bench.write(index::MODE, 0, &[1]).unwrap();
    let still = LoopReport { velocity_rad_s: 0.0, ..measured() };
    let order = |bench: &mut Bench, word: u8, target_micro_rad: i32| {
        let [a, b, c, d] = target_micro_rad.to_le_bytes();
        bench.driver.receive(&frame(RPDO_1, &[word, 0, a, b, c, d]), bench.now_us);
        bench.driver.joint.report(&still);
        bench.pass_ms(1);
    };
    for word in [0x06, 0x07, 0x0F] {
        order(&mut bench, word, 0);
    }
    assert!(bench.driver.joint.is_armed());
    // The target before, 0, would move it back.
    order(&mut bench, 0x1F, 350_000);
    for _ in 0..20 {
        order(&mut bench, 0x0F, 0);
    }
    let demand = bench.number(index::POSITION_DEMAND, 0) as i32;
    assert!(demand > 250_000, "{demand}");
    // The frame confirms the target once for each of its receptions.
    let setpoint = bench.driver.joint.loop_commands(bench.now_us).setpoint;
    assert!((setpoint.age_s - 1e-3).abs() < 1e-6, "{setpoint:?}");
    assert_eq!(bench.driver.joint.counters().command_lost, 0);
}

#[test]
fn drive_enable_is_refused_like_arming() {
    // The joint is not commissioned.
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
    // In this mode the joint's own Command frame is ignored, and unknown modes are refused.
    let mut bench = enabled();
    let foreign = bench.driver.joint.counters().foreign;
    bench.driver.receive(&frame(0x301, &[0, 0, 0x80, 0x3F, 0, 0, 0, 99]), bench.now_us);
    assert_eq!(bench.driver.joint.counters().foreign, foreign + 1);
    let mut bench = in_cst();
    for mode in [2i8, 5, 7, 11, -1] {
        assert_eq!(bench.write(index::MODE, 0, &mode.to_le_bytes()), Err(0x0609_0030));
    }
    // Without a mode of the profile, the frame drives nothing.
    bench.write(index::MODE, 0, &[0]).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 500);
    }
    assert!(!bench.driver.joint.is_armed());
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).setpoint.age_s, -1.0);
    control(&mut bench, 0x0F, 0);
    let wrong = bench.driver.joint.counters().wrong_length;
    bench.driver.receive(&frame(RPDO_1, &[0x0F, 0]), bench.now_us);
    assert_eq!(bench.driver.joint.counters().wrong_length, wrong + 1);
}

#[test]
fn drive_that_leaves_nmt_operational_opens_its_bridge() {
    for command in [0x02, 0x80, 0x82] {
        let mut bench = enabled();
        bench.driver.receive(&frame(0, &[command, 1]), bench.now_us);
        assert!(!bench.driver.joint.is_armed(), "{command:#x}");
        assert!(!bench.driver.joint.loop_commands(bench.now_us).bridge, "{command:#x}");
    }
}

/// A report of a joint that turned by 0.125 rad from an arbitrary zero.
fn unreferenced() -> LoopReport {
    LoopReport { position_rad: f32::NAN, turned_rad: 0.125, ..measured() }
}

fn pass_unreferenced(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.joint.report(&unreferenced());
        bench.pass_ms(1);
    }
}

#[test]
fn unknown_position_reads_as_relative_position_with_its_status_bit_cleared() {
    let mut bench = in_cst();
    assert_ne!(status(&mut bench) & 1 << 8, 0);
    pass_unreferenced(&mut bench, 2);
    assert_eq!(status(&mut bench) & 1 << 8, 0);
    assert_eq!(bench.number(index::ACTUAL_POSITION, 0) as i32, 125_000);
    let mut bench = Bench::hil();
    assert_eq!((bench.number(index::ACTUAL_POSITION, 0), status(&mut bench) & 1 << 8), (0, 0));
}

#[test]
fn enabling_with_unknown_position_is_refused_if_the_position_is_required() {
    const HOMING: u8 = 6;
    let enable = |bench: &mut Bench| {
        for word in [0x06, 0x07, 0x0F] {
            control(bench, word, 0);
        }
        bench.driver.joint.is_armed()
    };
    let mut bench = in_cst();
    pass_unreferenced(&mut bench, 2);
    assert!(enable(&mut bench), "not required");
    let place = Thresholds::NAMES.iter().position(|name| *name == "position_required").unwrap();
    let mut bench = in_cst();
    bench.write(index::THRESHOLDS, place as u8 + 1, &1f32.to_le_bytes()).unwrap();
    let crc = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &crc.to_le_bytes()).unwrap();
    pass_unreferenced(&mut bench, 2);
    assert!(!enable(&mut bench));
    assert_eq!(state(&mut bench), 0x23, "it stays switched on");
    bench.check_refusal("position unknown", &[": position-unknown"]);
    // Homing gives no torque, and makes the position known.
    control(&mut bench, 0x06, 0);
    bench.write(index::MODE, 0, &[HOMING]).unwrap();
    pass_unreferenced(&mut bench, 2);
    assert!(enable(&mut bench));
    control(&mut bench, 0x06, 0);
    bench.write(index::MODE, 0, &[CST]).unwrap();
    pass(&mut bench, 2);
    assert!(enable(&mut bench), "the position is known");
}

/// Offers a target of 0.1 rad in PP and returns the demanded position after 20 reports, in its unit. With `is_early`, every
/// second tick comes just before its report, which the next one then finds with its own.
fn demand_after_20_reports(is_early: bool) -> i32 {
    const PP: u8 = 1;
    let still = LoopReport { velocity_rad_s: 0.0, motor_torque_nm: 0.0, ..measured() };
    let again = LoopReport { is_repeated: true, ..still };
    let mut bench = in_cst();
    bench.driver.joint.report(&still);
    bench.pass_ms(1);
    bench.write(index::MODE, 0, &[PP]).unwrap();
    let target = bench.number(index::ACTUAL_POSITION, 0) as i32 + 100_000;
    bench.write(index::TARGET_POSITION, 0, &target.to_le_bytes()).unwrap();
    for word in [0x06, 0x07, 0x0F, 0x1F] {
        control(&mut bench, word, 0);
    }
    for _ in 0..10 {
        bench.driver.joint.report(if is_early { &again } else { &still });
        bench.pass_ms(1);
        bench.driver.joint.report(&still);
        if is_early {
            bench.driver.joint.report(&still);
        }
        bench.pass_ms(1);
    }
    assert!(bench.driver.joint.is_armed());
    bench.number(index::POSITION_DEMAND, 0) as i32
}

#[test]
fn reference_advances_once_with_each_report_at_any_phase_of_the_ticks() {
    let expected = demand_after_20_reports(false);
    assert_ne!(expected, Bench::on_sensors().number(index::POSITION_DEMAND, 0) as i32);
    assert_eq!(demand_after_20_reports(true), expected);
}
