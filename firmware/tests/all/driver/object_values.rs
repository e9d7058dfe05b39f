//! Values of objects that no other test reads: settings survive a save, measurements are those of the last report.

use super::bench::Bench;
use super::drive::{control, in_cst};
use compensator_core::can::{Message, SyncFrame};
use firmware::access::Key;
use firmware::background::BoardState;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::records::{
    AccessObject, HoldingBrakeObject, ScopeObject, TuningObject,
};
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::sensors::bme280::Air;
use firmware::sensors::enclosure::Readings;
use firmware::supervisor::Code;

const OUT_OF_RANGE: u32 = 0x0609_0030;

/// Stored settings that differ from their defaults: index, sub-index, value.
const SETTINGS: &[(u16, u8, &[u8])] = &[
    (0x1016, 1, &[0xE8, 0x03, 0x0A, 0]),
    (index::THRESHOLDS, 1, &[0, 0x50, 0x43, 0x47]),
    (index::ENVELOPE, 1, &[0, 0, 0x80, 0x40]),
    (index::SENSORS, 2, &[0, 0, 0x80, 0x3E]),
    (index::HOLDING_BRAKE, 2, &[150, 0]),
    (index::HOMING_STOP, 1, &[120, 0]),
    (0x6007, 0, &[3, 0]),
    (0x605B, 0, &[1, 0]),
    (0x605C, 0, &[1, 0]),
    (0x605D, 0, &[2, 0]),
    (0x6065, 0, &[0x40, 0x42, 0x0F, 0]),
    (0x6066, 0, &[0x22, 0x01]),
    (0x6067, 0, &[0x10, 0x27, 0, 0]),
    (0x6068, 0, &[0x32, 0]),
    (0x606D, 0, &[0x10, 0x27]),
    (0x606E, 0, &[0x14, 0]),
    (0x606F, 0, &[0x10, 0x27]),
    (0x6070, 0, &[0x14, 0]),
    (0x607F, 0, &[0x40, 0x42, 0x0F, 0]),
    (0x6087, 0, &[0xD0, 0x07, 0, 0]),
    (index::POSITION_LIMITS, 1, &[0x80, 0x69, 0x67, 0xFF]),
    (0x6099, 1, &[0x20, 0xA1, 0x07, 0]),
    (0x609A, 0, &[0x20, 0xA1, 0x07, 0]),
    (0x60C2, 1, &[4]),
];

/// Objects that a save does not keep.
const TRANSIENT: &[(u16, u8, &[u8])] = &[
    (0x1007, 0, &[0x10, 0x27, 0, 0]),
    (index::SCOPE, 3, &[7, 0]),
    (index::SCOPE_SIGNALS, 2, &[4]),
    (index::PROFILE_VELOCITY, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::ACCELERATION, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::DECELERATION, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::TARGET_POSITION, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::TARGET_VELOCITY, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::VELOCITY_OFFSET, 0, &[0x20, 0xA1, 0x07, 0]),
    (index::TORQUE_OFFSET, 0, &[0x64, 0]),
];

#[test]
fn order_or_switch_beyond_its_values_is_refused_with_its_name() {
    let mut bench = Bench::on_sensors();
    for (at_index, sub_index, name) in [
        (index::HOLDING_BRAKE, HoldingBrakeObject::TEST_ORDER, "test_order"),
        (index::SCOPE, ScopeObject::IS_FALLING, "is_falling"),
        (index::TUNING, TuningObject::UNDO, "undo"),
        (index::ERROR_FIELD, 0, "predefined_error_field"),
    ] {
        assert_eq!(bench.write(at_index, sub_index, &[2]), Err(OUT_OF_RANGE), "{name}");
        crate::message::require(&bench.text(index::REFUSAL), &[name, "must be"]);
    }
    assert_eq!(
        bench.write_proven(AccessObject::NEW_POLICY, &[2], &Key::DEFAULT),
        Err(OUT_OF_RANGE)
    );
    crate::message::require(&bench.text(index::REFUSAL), &["new_policy", "must be"]);
}

fn write_all(bench: &mut Bench, values: &[(u16, u8, &[u8])]) {
    for (at_index, sub_index, value) in values {
        assert_ne!(
            bench.read(*at_index, *sub_index).as_deref(),
            Ok(*value),
            "{at_index:04X}h: its default"
        );
        let written = bench.write(*at_index, *sub_index, value);
        assert_eq!(written, Ok(()), "{at_index:04X}h: {}", bench.text(index::REFUSAL));
    }
}

fn check_all(bench: &mut Bench, values: &[(u16, u8, &[u8])]) {
    for (at_index, sub_index, value) in values {
        let found = bench.read(*at_index, *sub_index);
        assert_eq!(found.as_deref(), Ok(*value), "{at_index:04X}h:{sub_index}");
    }
}

#[test]
fn settings_read_back_what_was_written_also_after_save_and_restart() {
    let mut bench = Bench::on_sensors();
    write_all(&mut bench, SETTINGS);
    write_all(&mut bench, TRANSIENT);
    check_all(&mut bench, SETTINGS);
    check_all(&mut bench, TRANSIENT);
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    check_all(&mut bench, SETTINGS);
}

/// Returns the numbers of a record, by their sub-indices.
fn numbers<const N: usize>(bench: &mut Bench, at_index: u16, places: [u8; N]) -> [f32; N] {
    places.map(|place| f32::from_bits(bench.number(at_index, place)))
}

#[test]
fn measurements_are_those_of_the_last_report() {
    let mut bench = in_cst();
    let enclosure = Readings {
        leak_share: Some(0.75),
        air: Some(Air { humidity_percent: 40.0, pressure_pa: 9.9e4, temperature_c: 8.0 }),
        torque_allowed: Some([false, true]),
    };
    bench.driver.joint.take_board_state(&BoardState { enclosure, ..BoardState::default() });
    let report = LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        velocity_rad_s: 0.5,
        position_rad: 0.25,
        motor_torque_nm: 5.5,
        current_a: 13.0,
        friction_torque_nm: 2.5,
        feed_forward_current_a: 1.5,
        residual_torque_nm: 0.125,
        ..LoopReport::default()
    };
    bench.driver.joint.report(&report);
    bench.pass_ms(1);
    bench.give(Message::Sync(SyncFrame { counter: 1 }));
    assert_eq!(numbers(&mut bench, index::MEASURED, [1, 2, 3]), [0.5, 0.25, 5.5]);
    let air = numbers(&mut bench, index::ENCLOSURE, [1, 2, 3, 4]);
    assert_eq!(air, [0.75, 40.0, 9.9e4, 8.0]);
    assert_eq!(bench.number(index::ENCLOSURE, 5), 0b10);
    let outputs = numbers(&mut bench, index::OUTPUTS, [1, 2, 5, 6]);
    assert_eq!(outputs, [2.5, 1.5, 13.0, 0.125]);
    // Thousandths of the rated current, 26 A.
    assert_eq!(bench.number(0x6078, 0) as i16, 500);
}

#[test]
fn profile_types_are_linear_and_the_torque_demand_is_the_target() {
    let mut bench = in_cst();
    for profile_type in [0x6086, 0x6088] {
        assert_eq!(bench.number(profile_type, 0), 0, "{profile_type:04X}h");
        assert!(bench.write(profile_type, 0, &[1, 0]).is_err(), "{profile_type:04X}h");
    }
    for word in [0x06, 0x07, 0x0F] {
        control(&mut bench, word, 100);
    }
    assert_eq!(bench.number(0x6074, 0) as i16, 100);
}

#[test]
fn fault_is_counted_and_stands_in_error_register_and_field() {
    let mut bench = in_cst();
    let of_voltage = 0x04;
    let place = Code::ALL.iter().position(|code| *code == Code::BusOvervoltage);
    let counter = 1 + place.expect("is listed") as u8;
    assert_eq!(bench.number(index::CODE_COUNTERS, counter), 0);
    // Bit 0 is set with any error; the defaults are reported as one.
    assert_eq!(bench.number(index::ERROR_REGISTER, 0) & 0x0F, 1);
    let errors = bench.number(index::ERROR_FIELD, 0);
    for _ in 0..200 {
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(80.0),
            phase_currents_a: Some([0.0; 3]),
            ..LoopReport::default()
        });
        bench.pass_ms(1);
    }
    assert_eq!(bench.number(index::ERROR_REGISTER, 0) & 0x0F, 1 | of_voltage);
    assert_eq!(bench.number(index::ERROR_FIELD, 0), errors + 1);
    assert_eq!(bench.number(index::ERROR_FIELD, 1) & 0xFFFF, 0x3210, "DC link over-voltage");
    assert_eq!(bench.number(index::CODE_COUNTERS, counter), 1);
}

#[test]
fn identity_in_texts_is_that_of_the_device() {
    let mut bench = Bench::on_sensors();
    assert_eq!(bench.text(0x1008), "friction-compensated joint driver");
    assert_eq!(bench.text(0x1009), "bench");
    assert_eq!(bench.text(0x100A), env!("CARGO_PKG_VERSION"));
    let (request, answer) = (bench.number(0x1200, 1), bench.number(0x1200, 2));
    assert_eq!((request, answer), (0x601, 0x581));
    assert_eq!((bench.number(0x1005, 0), bench.number(0x1014, 0)), (0x80, 0x81));
}

#[test]
fn process_data_begin_with_the_identifiers_and_values_of_the_joint_frames() {
    let mut bench = Bench::on_sensors();
    for (pdo, identifier) in [(0x1402, 0x401), (0x1403, 0x501), (0x1405, 0x8000_0681)] {
        assert_eq!(bench.number(pdo, 1), identifier, "{pdo:04X}h");
    }
    let inputs = |places: [u32; 2]| places.map(|place| 0x2004_0020 | place << 8);
    let measured = |places: [u32; 2]| places.map(|place| 0x2009_0020 | place << 8);
    for (mapping, expected) in [
        (0x1602, inputs([5, 6])),
        (0x1603, inputs([7, 8])),
        (0x1604, inputs([1, 2])),
        (0x1605, inputs([3, 4])),
        (0x1A03, measured([1, 2])),
        (0x1A04, measured([3, 4])),
    ] {
        assert_eq!([1, 2].map(|place| bench.number(mapping, place)), expected, "{mapping:04X}h");
    }
}

#[test]
fn deviations_of_learnt_gains_are_zero_without_adaptation() {
    let mut bench = Bench::on_sensors();
    assert_eq!(numbers(&mut bench, index::GAIN_DEVIATIONS, [1, 2, 3]), [0.0; 3]);
}

#[test]
fn joint_without_slots_reports_no_program_and_refuses_one() {
    let mut bench = Bench::on_sensors();
    // Without the slots of a board there is neither a program nor an update, nor a package to receive.
    assert_eq!([1, 2].map(|slot| bench.number(0x1F56, slot)), [0; 2]);
    // CiA 302-3: error 63, unspecified.
    assert_eq!(bench.number(0x1F57, 1), 63 << 1);
    let program = [1, 2, 3, 5, 7, 8, 9, 10, 11].map(|place| bench.number(index::PROGRAM, place));
    assert_eq!(program, [0; 9]);
    assert!(bench.write(index::PROGRAM_DATA, 1, &[0; 24]).is_err());
}
