//! Tests of the joint with a stock CANopen master, which knows only the EDS and a node number.
//!
//! Lely's `dcfgen` makes the configuration of such a master; `tests/eds/run` compares it with the files used here. The
//! master then boots the joint as CiA 302-2 says: check the identity, write the concise DCF, start the network. Its SYNC
//! has no counter, and it sends all its PDOs at each SYNC, with zeros in those that nobody uses.

use super::bench::{Bench, LOCKED, frame};
use firmware::access::Key;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;

/// Concise DCF of `tests/eds/bus/drive.yml`; `plain.yml` needs none, so `dcfgen` makes none.
const DRIVE: &[u8] = include_bytes!("../../../../tests/eds/bus/drive_joint_1.bin");

const MASTER: u8 = 10;

/// Returns the entries of a concise DCF (CiA 302-3): index, sub-index and value.
fn entries(mut concise: &[u8]) -> Vec<(u16, u8, &[u8])> {
    let mut take = |count: usize| {
        let (value, rest) = concise.split_at(count);
        concise = rest;
        value
    };
    let count = u32::from_le_bytes(take(4).try_into().unwrap());
    let entries = (0..count)
        .map(|_| {
            let index = u16::from_le_bytes(take(2).try_into().unwrap());
            let sub_index = take(1)[0];
            let length = u32::from_le_bytes(take(4).try_into().unwrap());
            (index, sub_index, take(length as usize))
        })
        .collect();
    assert!(concise.is_empty());
    entries
}

/// Boots a commissioned joint as a master does.
fn booted(concise: &[u8]) -> Bench {
    let mut bench = Bench::on_sensors();
    bench.commission();
    // The master cannot unlock the joint.
    bench.write(index::ACCESS, 4, &[1]).unwrap();
    bench.key = None;
    assert_eq!(bench.number(index::DEVICE_TYPE, 0) & 0xFFFF, 402);
    assert_eq!(bench.number(index::IDENTITY, 2), u32::from_be_bytes(*b"FRIC"));
    for (index, sub_index, value) in entries(concise) {
        assert_eq!(bench.write(index, sub_index, value), Ok(()), "{index:04X}h:{sub_index}");
    }
    bench.start();
    bench.sent();
    bench
}

fn measured() -> LoopReport {
    LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        velocity_rad_s: 0.5,
        position_rad: 0.25,
        motor_torque_nm: 5.2,
        ..LoopReport::default()
    }
}

/// Runs cycles of 10 ms with a plain SYNC and these PDOs. Returns the frames of the last cycle.
fn cycles(bench: &mut Bench, count: u32, pdos: &[(u16, &[u8])]) -> Vec<(u16, Vec<u8>)> {
    for cycle in 0..count {
        if cycle % 10 == 0 {
            bench.driver.receive(&frame(0x700 + u16::from(MASTER), &[5]), bench.now_us);
        }
        bench.sent();
        bench.driver.receive(&frame(0x080, &[]), bench.now_us);
        for (identifier, data) in pdos {
            bench.driver.receive(&frame(*identifier, data), bench.now_us);
        }
        for _ in 0..10 {
            bench.driver.joint.report(&measured());
            bench.pass_ms(1);
        }
    }
    bench.sent().iter().map(|frame| (frame.identifier(), frame.data().to_vec())).collect()
}

fn data_of(frames: &[(u16, Vec<u8>)], identifier: u16) -> &[u8] {
    let found = frames.iter().find(|(found, _)| *found == identifier);
    &found.unwrap_or_else(|| panic!("no {identifier:03X}h in {frames:02X?}")).1
}

#[test]
fn master_of_a_plain_bus_file_brings_the_joint_up() {
    let mut bench = booted(&[0; 4]);
    // The mode is an SDO of the application, as nothing of the file says it.
    bench.write(index::MODE, 0, &[10]).unwrap();
    let drive = |controlword: u8, target: i16| {
        let [low, high] = target.to_le_bytes();
        [controlword, 0, low, high, 0, 0, 0, 0]
    };
    let zeros = [0; 8];
    for (word, expected) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        let data = drive(word, 250);
        let pdos = [(0x201, &data[..]), (0x301, &zeros[..]), (0x401, &zeros), (0x501, &zeros)];
        let frames = cycles(&mut bench, 10, &pdos);
        assert_eq!(bench.number(index::STATUSWORD, 0) & 0x6F, expected);
        // Motion at every SYNC, Answer, Status, Telemetry and Torque at every tenth.
        for identifier in [0x181, 0x281, 0x381, 0x481, 0x681] {
            assert_eq!(data_of(&frames, identifier).len(), 8);
        }
    }
    assert!(bench.driver.joint.is_armed());
    let commands = bench.driver.joint.loop_commands(bench.now_us);
    assert!(commands.bridge && (commands.setpoint.current_a - 6.5).abs() < 1e-4, "{commands:?}");
    assert_eq!(bench.driver.joint.counters().wrong_length, 0);
    // The application ends, and with it its targets.
    cycles(&mut bench, 11, &[]);
    assert!(!bench.driver.joint.is_armed());
}

#[test]
fn concise_dcf_of_a_drive_maps_and_enables_the_joint() {
    let mut bench = booted(DRIVE);
    let pdos =
        |word: u8, torque: i16| ([word, 0, 10], [torque.to_le_bytes(), [0; 2], [0; 2]].concat());
    for (word, expected) in [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)] {
        let (control, targets) = pdos(word, 400);
        let frames = cycles(&mut bench, 3, &[(0x201, &control), (0x301, &targets)]);
        let status = data_of(&frames, 0x181);
        assert_eq!((status[0] & 0x6F, status[2]), (expected, 10), "statusword and mode");
        let motion = data_of(&frames, 0x281);
        assert_eq!(motion[..4], 250_000i32.to_le_bytes());
        assert_eq!(motion[4..], 500_000i32.to_le_bytes());
        assert!(frames.iter().all(|(found, _)| ![0x481, 0x681].contains(found)), "{frames:?}");
    }
    assert!(bench.driver.joint.is_armed());
    let setpoint = bench.driver.joint.loop_commands(bench.now_us).setpoint;
    assert!((setpoint.current_a - 10.4).abs() < 1e-4, "{setpoint:?}");
    // 6072h is in force, and the event timer of the third PDO is 50 ms.
    assert_eq!(bench.number(index::MAX_TORQUE, 0), 800);
    let (control, targets) = pdos(0x0F, 400);
    let mut timed = 0;
    for _ in 0..50 {
        let frames = cycles(&mut bench, 1, &[(0x201, &control), (0x301, &targets)]);
        timed += frames.iter().filter(|(found, _)| *found == 0x381).count();
    }
    assert_eq!(timed, 10);
    // Without the heartbeat of the master (300 ms in 1016h) the joint stops.
    for _ in 0..400 {
        bench.driver.receive(&frame(0x301, &targets), bench.now_us);
        bench.driver.joint.report(&measured());
        bench.pass_ms(1);
    }
    assert!(!bench.driver.joint.is_armed());
}

#[test]
fn master_whose_configuration_has_service_objects_needs_an_open_joint() {
    // 605Eh = 1, as a bus file may ask for it.
    let concise = [&[1, 0, 0, 0][..], &[0x5E, 0x60, 0, 2, 0, 0, 0, 1, 0]].concat();
    let (at_index, sub_index, value) = entries(&concise)[0];
    let mut bench = Bench::on_sensors();
    bench.key = None;
    assert_eq!(bench.write(at_index, sub_index, value), Err(LOCKED));
    // Stored once with an open policy (2041h:8), it starts open.
    bench.write_proven(8, &[0], &Key::DEFAULT).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.key = None;
    assert_eq!(bench.write(at_index, sub_index, value), Ok(()));
}
