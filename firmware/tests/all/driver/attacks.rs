//! What an attacker on the bus can still do to a locked joint, a line of docs/src/explanation/bus-security.md each.
//!
//! The attacker sends any frame and receives all, and does not know the key of the joint. A test that fails here means
//! that the page is wrong: the joint is better, or worse, than it says.

use super::bench::{Bench, Flash, LOCKED, NODE, frame};
use compensator_core::can::{CommandFrame, Frame, Message, SealFrame};
use compensator_core::{Flags, LawKind, ParameterId, TermKind};
use firmware::access::Key;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::{Access, DataType, OBJECTS, SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;

const SECRET_KEY: Key = Key::new(*b"sixteen bytes !!");
const RESPONSE: u8 = 3;
const LOCK: u8 = 4;
const NEW_KEY: u8 = 5;
/// Default current limit, A.
const CURRENT_LIMIT_A: f32 = 26.0;

fn measured() -> LoopReport {
    LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        position_rad: 0.25,
        ..LoopReport::default()
    }
}

fn pass(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        bench.driver.joint.report(&measured());
        bench.pass_ms(1);
    }
    bench.sent();
}

/// Starts a commissioned joint with a key of its own, locked, as it is installed.
fn installed() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.commission();
    bench.write_proven(NEW_KEY, &SECRET_KEY.bytes(), &Key::DEFAULT).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    restarted(bench)
}

fn restarted(bench: Bench) -> Bench {
    let flash: Flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.key = None;
    pass(&mut bench, 5);
    bench
}

fn command(bench: &mut Bench, current_a: f32, counter: u8) {
    bench.give(Message::Command(NODE, CommandFrame::new(current_a, 0.0, counter)));
}

/// Starts an installed joint that its master has armed, and commands with the counters 0 to 19.
fn armed() -> Bench {
    let mut bench = installed();
    bench.start();
    for counter in 0..20 {
        command(&mut bench, 1.0, counter);
        pass(&mut bench, 1);
    }
    bench.write(index::STATE, 1, &[1]).expect("arming is open");
    bench
}

fn commanded_a(bench: &Bench) -> f32 {
    bench.driver.joint.loop_commands(bench.now_us).setpoint.current_a
}

/// Attack: arm a commissioned joint and drive it. Bound: the limits of the service level.
#[test]
fn attacker_arms_a_locked_joint_and_drives_it_within_its_limits() {
    let mut bench = installed();
    bench.start();
    bench.write(index::MODE, 0, &[10]).unwrap();
    bench.write(index::MAX_TORQUE, 0, &[0xFF, 0xFF]).unwrap();
    bench.write(index::TARGET_TORQUE, 0, &i16::MAX.to_le_bytes()).unwrap();
    for controlword in [6u8, 7, 15] {
        bench.write(index::CONTROLWORD, 0, &[controlword, 0]).unwrap();
        pass(&mut bench, 2);
    }
    assert!(bench.driver.joint.is_armed() && bench.driver.joint.loop_commands(bench.now_us).bridge);
    assert_eq!(commanded_a(&bench), CURRENT_LIMIT_A);
    bench.write(index::CONTROLWORD, 0, &[7, 0]).unwrap();
    assert_eq!(bench.write(index::MOTOR, 1, &99f32.to_le_bytes()), Err(LOCKED));
}

/// Attack: disarm the joint by 2002h:1 or NMT. Bound: NMT stops it as 6007h says; 2002h:1 lets it coast.
#[test]
fn attacker_stops_disarms_and_resets_an_armed_joint() {
    for command in [2, 0x80, 0x81, 0x82] {
        let mut bench = armed();
        bench.driver.receive(&frame(0, &[command, NODE.number()]), bench.now_us);
        assert!(!bench.driver.joint.is_armed(), "{command:02X}");
    }
    let mut bench = armed();
    bench.write(index::STATE, 1, &[0]).unwrap();
    assert!(!bench.driver.joint.is_armed());
}

/// Attack: send set-points in place of the master. Bound: the limits of the service level.
#[test]
fn attacker_replaces_the_set_points_of_the_master() {
    let mut bench = armed();
    // A counter ahead of the master's, whose next frames then are late.
    command(&mut bench, -5.0, 40);
    command(&mut bench, 1.0, 20);
    assert_eq!(commanded_a(&bench), -5.0);
    assert_eq!(bench.driver.joint.counters().command_late, 1);
}

/// Attack: repeat recorded commands. Bound: the limits of the service level.
#[test]
fn attacker_repeats_recorded_commands() {
    let recorded: Vec<Frame> = (0..20u8)
        .map(|counter| Message::Command(NODE, CommandFrame::new(3.0, 0.0, counter)).emit())
        .collect();
    let mut bench = installed();
    bench.start();
    for frame in &recorded {
        bench.driver.receive(frame, bench.now_us);
        pass(&mut bench, 1);
    }
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert_eq!(commanded_a(&bench), 3.0);
}

/// Attack: send telemetry and states in the name of the joint. Bound: nothing: do not base a safety function on them.
#[test]
fn attacker_sends_telemetry_in_the_name_of_the_joint() {
    let mut bench = Bench::hil();
    bench.start();
    let messages = super::sample(&mut bench, 0);
    let mut sent = messages.iter().map(Message::emit);
    let telemetry = sent.find(|sent| sent.identifier() == 0x381).expect("telemetry");
    // Another content in the same frame is as good: nothing in it depends on the sender.
    for bit in 0..8 * telemetry.data().len() {
        let mut data = telemetry.data().to_vec();
        data[bit / 8] ^= 1 << (bit % 8);
        let forged = frame(telemetry.identifier(), &data);
        assert!(matches!(Message::parse(&forged), Ok(Message::Telemetry(NODE, _))), "{bit}");
    }
}

/// Attack: send a false side load, pressure or temperature. Bound: the envelope, the current limits and the over-compensation watch.
#[test]
fn attacker_sends_a_false_side_load() {
    let mut bench = armed();
    let seal = SealFrame { radial_force_n: 900.0, pressure_diff_pa: 0.0 };
    bench.give(Message::Seal(NODE, seal));
    let covariates = bench.driver.joint.loop_commands(bench.now_us).covariates;
    assert_eq!(covariates.radial_force_n.value, 900.0);
    // The compensator uses no pressure outside its envelope: friction and flags are those of a joint without one.
    let answers = |pressure_diff_pa: Option<f32>| {
        let mut bench = Bench::hil();
        let place = ParameterId::PressureCoulomb as u8 + 1;
        bench.write(index::MODEL, 1, &[LawKind::ImprovedLugre as u8]).unwrap();
        bench.write(index::PARAMETERS, place, &2e-6f32.to_le_bytes()).unwrap();
        let staged = bench.number(index::COMMIT, 2);
        bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
        bench.start();
        bench.write(index::STATE, 1, &[1]).unwrap();
        if let Some(pressure_diff_pa) = pressure_diff_pa {
            let seal = SealFrame { radial_force_n: f32::NAN, pressure_diff_pa };
            bench.give(Message::Seal(NODE, seal));
        }
        let mut answers = Vec::new();
        for sequence in 0..100 {
            answers = super::sample(&mut bench, sequence);
        }
        let [Message::Answer(_, answer), Message::Status(_, status), ..] = answers[..] else {
            panic!("{answers:?}")
        };
        (answer.friction_torque_nm, status.flags.contains(Flags::PRESSURE_INVALID))
    };
    let (without, _) = answers(None);
    let (within, is_invalid) = answers(Some(1e5));
    assert!(within != without && !is_invalid, "{within} {without}");
    assert_eq!(answers(Some(1e12)), (without, true));
}

/// Attack: set the position or the home of a disarmed joint. Bound: nothing: the position limits move with it, use end stops.
#[test]
fn attacker_shifts_the_position_and_with_it_its_limits() {
    let mut bench = installed();
    let before = bench.driver.joint.loop_commands(bench.now_us).home;
    bench.write(index::STATE, 6, &3f32.to_le_bytes()).unwrap();
    let home = bench.driver.joint.loop_commands(bench.now_us).home;
    assert_eq!((home.position_rad, home.number), (3.0, before.number.wrapping_add(1)));
    assert_eq!(bench.write(index::POSITION_LIMITS, 2, &[0; 4]), Err(LOCKED));
}

/// Attack: change the friction model of a disarmed joint. Bound: no more friction than stored; it is back after a restart.
#[test]
fn attacker_changes_the_friction_model_until_the_next_start() {
    let mut bench = installed();
    let stored = bench.number(index::COMMIT, 1);
    // compensator.scale
    bench.write(index::COMPENSATOR, 1, &0.5f32.to_le_bytes()).unwrap();
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    assert_ne!(bench.number(index::COMMIT, 1), stored);
    // More than stored is refused, each quantity that raises the compensation by its name; less may be undone.
    let write = |bench: &mut Bench, at: u16, place: u8, value: &[u8]| {
        bench.write(at, place, value).unwrap();
        let staged = bench.number(index::COMMIT, 2);
        bench.write(index::COMMIT, 3, &staged.to_le_bytes())
    };
    let level = ParameterId::StaticTorque as u8 + 1;
    let viscous = ParameterId::ViscousFriction as u8 + 1;
    let level_nm = bench.driver.joint.set().friction.model.get(ParameterId::StaticTorque);
    for (at, place, value, name) in [
        (index::COMPENSATOR, 1, &1.0f32.to_le_bytes()[..], "coulomb_torque"),
        (index::PARAMETERS, level, &(2.0 * level_nm).to_le_bytes(), "static_torque"),
        (index::PARAMETERS, viscous, &9f32.to_le_bytes(), "viscous_friction"),
        (index::MODEL, 1, &[LawKind::ImprovedLugre as u8], "law"),
        (index::MODEL, 3, &[TermKind::PositionRipple as u8], "position-ripple"),
        (index::MODEL, 2, &[5], "allow_active"),
    ] {
        assert_eq!(write(&mut bench, at, place, value), Err(LOCKED), "{name}");
        let refusal = bench.text(index::REFUSAL);
        assert!(refusal.contains(name) && refusal.contains("service"), "{refusal}");
        bench.write(index::COMMIT, 4, &[1]).unwrap();
    }
    write(&mut bench, index::COMPENSATOR, 1, &0.9f32.to_le_bytes()).unwrap();
    write(&mut bench, index::COMPENSATOR, 1, &0.5f32.to_le_bytes()).unwrap();
    // It is not stored, and the watch stays.
    assert_eq!(bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()), Err(LOCKED));
    assert_eq!(bench.write(index::THRESHOLDS, 1, &[0; 4]), Err(LOCKED));
    assert_eq!(restarted(bench).number(index::COMMIT, 1), stored);
}

/// Attack: change identifiers and mappings of a disarmed joint. Bound: the defaults are back after a reset.
#[test]
fn attacker_redirects_the_process_data_of_a_disarmed_joint() {
    let mut bench = installed();
    bench.write(index::TRANSMIT_STATUS, 1, &0x8000_0281u32.to_le_bytes()).unwrap();
    bench.write(index::TRANSMIT_STATUS, 1, &0x0000_0199u32.to_le_bytes()).unwrap();
    assert_eq!(bench.number(index::TRANSMIT_STATUS, 1), 0x199);
    // The defaults are back after a reset of the communication.
    bench.driver.receive(&frame(0, &[0x82, NODE.number()]), bench.now_us);
    bench.sent();
    assert_eq!(bench.number(index::TRANSMIT_STATUS, 1), 0x281);
}

/// Attack: read parameters, states and logs. Bound: the key cannot be read.
#[test]
fn attacker_reads_every_object_but_the_key() {
    let mut bench = installed();
    for object in OBJECTS {
        for sub_index in 0..=object.highest_sub_index() {
            let entry = object.entry(sub_index).expect("within its last");
            let read = bench.read(object.index, sub_index);
            let is_empty = entry.data == DataType::Domain || object.index == index::ERROR_FIELD;
            let at = format!("{:04X}h:{sub_index}", object.index);
            match entry.access {
                Access::WriteOnly => assert_eq!(read, Err(0x0601_0001), "{at}"),
                _ => assert!(read.is_ok() || is_empty, "{at}: {read:?}"),
            }
            if let Ok(value) = read {
                let leaks = value
                    .windows(4)
                    .any(|part| SECRET_KEY.bytes().windows(4).any(|key| key == part));
                assert!(!leaks, "{at}");
            }
        }
    }
}

/// Attack: write service objects, and save them, while a tool has unlocked the joint. Bound: 10 minutes after the unlock, the lock; key and policy stay.
#[test]
fn attacker_uses_the_session_of_a_tool() {
    let mut bench = installed();
    assert_eq!(bench.write(index::FOLLOWING_TIME, 0, &[5, 0]), Err(LOCKED));
    bench.unlock(&SECRET_KEY).expect("the tool's key");
    // The frames of the attacker do not differ from those of the tool.
    bench.write(index::FOLLOWING_TIME, 0, &[5, 0]).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    // It has no proof of the key.
    assert!(bench.write(index::ACCESS, NEW_KEY, &[0; 24]).is_err());
    bench.write(index::ACCESS, LOCK, &[1]).unwrap();
    assert_eq!(bench.write(index::FOLLOWING_TIME, 0, &[6, 0]), Err(LOCKED));
}

/// Attack: listen while a key is set.
#[test]
fn attacker_who_listens_to_a_key_change_has_the_key() {
    let mut bench = Bench::on_sensors();
    bench.unlock(&Key::DEFAULT).unwrap();
    // The frames of the tool: 2041h:5 with key and proof of 24 bytes, in segments of seven.
    let proof = bench.proof(&Key::DEFAULT, &SECRET_KEY.bytes());
    let mut wire: Vec<[u8; 8]> = vec![[0x21, 0x41, 0x20, 5, 24, 0, 0, 0]];
    for (place, part) in [&SECRET_KEY.bytes()[..], &proof].concat().chunks(7).enumerate() {
        let unused = 7 - part.len();
        let mut segment = [0; 8];
        segment[0] = (place as u8 % 2) << 4 | (unused as u8) << 1 | u8::from(unused > 0);
        segment[1..=part.len()].copy_from_slice(part);
        wire.push(segment);
    }
    for request in &wire {
        bench.driver.receive(&frame(0x601, request), bench.now_us);
    }
    bench.sent();
    let heard: Vec<u8> = wire[1..].iter().flat_map(|segment| segment[1..].to_vec()).collect();
    bench.write(index::ACCESS, LOCK, &[1]).unwrap();
    bench.unlock(&Key::new(heard[..16].try_into().unwrap())).expect("the key that was heard");
}

/// Attack: unlock a joint with the default key.
#[test]
fn attacker_unlocks_a_joint_that_has_the_default_key() {
    let mut bench = Bench::on_sensors();
    bench.key = None;
    bench.unlock(&Key::DEFAULT).unwrap();
    bench.write(index::MOTOR, 1, &8f32.to_le_bytes()).unwrap();
}

/// Attack: keep a tool from unlocking.
#[test]
fn attacker_keeps_a_tool_out_with_wrong_responses() {
    let mut bench = installed();
    assert!(bench.write(index::ACCESS, RESPONSE, &[0; 8]).is_err());
    assert_eq!(bench.unlock(&SECRET_KEY), Err(super::STATE_REFUSED));
    // A challenge that another node reads replaces that of the tool.
    pass(&mut bench, 1000);
    let response = bench.response(&SECRET_KEY);
    bench.read(index::ACCESS, 2).unwrap();
    assert!(bench.write(index::ACCESS, RESPONSE, &response).is_err());
}

/// Attack: abort transfers of a tool. Bound: nothing is changed by an incomplete one.
#[test]
fn attacker_ends_the_transfer_of_a_tool() {
    let mut bench = installed();
    bench.unlock(&SECRET_KEY).unwrap();
    // The tool begins to write 2027h:6, and the attacker aborts it.
    bench.driver.receive(&frame(0x601, &[0x21, 0x27, 0x20, 6, 0, 1, 0, 0]), bench.now_us);
    bench.driver.receive(&frame(0x601, &[0x80, 0x27, 0x20, 6, 0, 0, 0, 8]), bench.now_us);
    bench.sent();
    bench.driver.receive(&frame(0x601, &[0x00; 8]), bench.now_us);
    assert_eq!(bench.sent()[0].data()[0], 0x80);
}

/// Attack: give a number to a joint without stored settings.
#[test]
fn attacker_gives_a_number_to_a_joint_without_stored_settings() {
    let mut bench = Bench::blank(7);
    bench.sent();
    bench.driver.receive(&frame(0x7E5, &[4, 1, 0, 0, 0, 0, 0, 0]), bench.now_us);
    bench.driver.receive(&frame(0x7E5, &[0x11, 99, 0, 0, 0, 0, 0, 0]), bench.now_us);
    assert_eq!(bench.number(index::OPERATION, 6), 99);
}
