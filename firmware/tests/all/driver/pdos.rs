//! Tests of the process data objects that a stock master configures: plain SYNC, transmission types, times,
//! identifiers and mappings.

use super::bench::{Bench, Flash, frame};
use compensator_core::can::{Frame, Message, MotionFrame, SyncFrame};
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::{LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;

const NOT_MAPPABLE: u32 = 0x0604_0041;
const TOO_LONG: u32 = 0x0604_0042;
const STATE: u32 = 0x0800_0022;
const VALUE: u32 = 0x0609_0030;
const UNUSED: u32 = 1 << 31;

fn write_number(bench: &mut Bench, at_index: u16, sub_index: u8, number: u32) -> Result<(), u32> {
    let length = firmware::node::dictionary::find(at_index, sub_index).unwrap().data.length();
    bench.write(at_index, sub_index, &number.to_le_bytes()[..length.unwrap()])
}

/// Maps objects to a PDO in the usual order, and enables it with an identifier.
pub fn map(
    bench: &mut Bench,
    parameters: u16,
    identifier: u32,
    entries: &[u32],
) -> Result<(), u32> {
    write_number(bench, parameters, 1, identifier | UNUSED)?;
    write_number(bench, parameters + 0x200, 0, 0)?;
    for (place, entry) in entries.iter().enumerate() {
        write_number(bench, parameters + 0x200, place as u8 + 1, *entry)?;
    }
    write_number(bench, parameters + 0x200, 0, entries.len() as u32)?;
    write_number(bench, parameters, 1, identifier)
}

fn plain_sync(bench: &mut Bench) -> Vec<Frame> {
    bench.driver.receive(&frame(0x080, &[]), bench.now_us);
    bench.sent()
}

fn identifiers(frames: &[Frame]) -> Vec<u16> {
    frames.iter().map(Frame::identifier).collect()
}

#[test]
fn plain_sync_ends_samples_like_one_with_counter() {
    let mut samples = Vec::new();
    for is_plain in [false, true] {
        let mut bench = Bench::hil();
        bench.start();
        bench.write(index::STATE, 1, &[1]).unwrap();
        let mut frames = Vec::new();
        for sequence in 0..300 {
            let velocity_rad_s = (0.05 * sequence as f32).sin();
            let motion = MotionFrame { velocity_rad_s, position_rad: f32::NAN };
            bench.give(Message::Motion(super::NODE, motion));
            frames.extend(if is_plain {
                plain_sync(&mut bench)
            } else {
                bench.give(Message::Sync(SyncFrame::of(sequence)));
                bench.sent()
            });
        }
        assert_eq!(frames.len(), 900);
        assert_eq!(bench.number(index::FRAME_COUNTERS, 8), 0, "none lost");
        samples.push(frames);
    }
    assert_eq!(samples[0], samples[1]);
}

#[test]
fn sync_objects_are_checked_and_a_short_ring_is_followed() {
    let mut bench = Bench::hil();
    bench.start();
    assert_eq!(bench.number(index::SYNC_OVERFLOW, 0), 240);
    for wrong in [1, 241] {
        assert_eq!(write_number(&mut bench, index::SYNC_OVERFLOW, 0, wrong), Err(VALUE));
    }
    write_number(&mut bench, index::SYNC_PERIOD, 0, 10_000).unwrap();
    assert_eq!(write_number(&mut bench, index::SYNC_OVERFLOW, 0, 0), Err(STATE));
    write_number(&mut bench, index::SYNC_PERIOD, 0, 0).unwrap();
    write_number(&mut bench, index::SYNC_OVERFLOW, 0, 10).unwrap();
    for counter in [1, 2, 10, 1, 1, 2] {
        bench.driver.receive(&frame(0x080, &[counter]), bench.now_us);
    }
    let counters = bench.driver.joint.counters();
    assert_eq!((counters.sync_lost, counters.sync_duplicate), (7, 1));
}

/// Longest classic frame with this number of bytes, bits, as in `docs/src/reference/bus-load.md`.
fn frame_bits(bytes: usize) -> usize {
    let stuffable = 34 + 8 * bytes;
    stuffable + (stuffable - 1) / 4 + 13
}

#[test]
fn default_frames_of_a_joint_on_sensors_take_two_fifths_of_the_bus_at_1_khz() {
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.sent();
    let (mut bits, mut counts) = (0, [0; 5]);
    for sequence in 0..1000 {
        bench.pass_ms(1);
        let sync = Message::Sync(SyncFrame::of(sequence)).emit();
        let drive = frame(0x201, &[0; 8]);
        for received in [sync, drive] {
            bits += frame_bits(received.data().len());
            bench.driver.receive(&received, bench.now_us);
        }
        for sent in bench.sent() {
            bits += frame_bits(sent.data().len());
            let known = [0x481, 0x681, 0x181, 0x281, 0x381].iter();
            let slot = known.clone().position(|known| *known == sent.identifier());
            slot.into_iter().for_each(|slot| counts[slot] += 1);
        }
    }
    assert_eq!(counts, [1000, 100, 100, 100, 100]);
    assert!(bits <= 400_000, "{bits} bits in a second");
    // In one sample: a log at this rate has whole rows.
    write_number(&mut bench, 0x1800, 2, 1).unwrap();
    let sent = identifiers(&plain_sync(&mut bench));
    assert_eq!(sent, [0x481, 0x181]);
}

#[test]
fn transmit_pdos_follow_type_start_value_event_timer_and_inhibit_time() {
    let mut bench = Bench::on_sensors();
    bench.start();
    bench.sent();
    assert_eq!(identifiers(&plain_sync(&mut bench)), [0x481]);
    write_number(&mut bench, 0x1800, 2, 3).unwrap();
    write_number(&mut bench, 0x1801, 2, 2).unwrap();
    write_number(&mut bench, 0x1801, 6, 5).unwrap();
    for unused in [0x1802, 0x1803, 0x1804] {
        write_number(&mut bench, unused, 1, 0x181 | UNUSED).unwrap();
    }
    let mut sent = Vec::new();
    // Counter 1 has the plain one before.
    for counter in 2..=9 {
        bench.give(Message::Sync(SyncFrame { counter }));
        sent.extend(identifiers(&bench.sent()).into_iter().map(|found| (counter, found)));
    }
    assert_eq!(sent, [(4, 0x181), (5, 0x281), (7, 0x181), (7, 0x281), (9, 0x281)]);
    // By time and change: the velocity, at most every 5 ms, and at least every 20 ms.
    let velocity = u32::from(index::ACTUAL_VELOCITY) << 16 | 32;
    map(&mut bench, 0x1805, 0x1F1, &[velocity]).unwrap();
    write_number(&mut bench, 0x1805, 2, 255).unwrap();
    write_number(&mut bench, 0x1805, 3, 50).unwrap();
    write_number(&mut bench, 0x1805, 5, 20).unwrap();
    let mut times = Vec::new();
    for ms in 0..60 {
        let velocity_rad_s = if ms < 20 { ms as f32 } else { 20.0 };
        bench.driver.joint.report(&LoopReport { velocity_rad_s, ..LoopReport::default() });
        bench.pass_ms(1);
        for frame in bench.sent().iter().filter(|frame| frame.identifier() == 0x1F1) {
            assert_eq!(frame.data().len(), 4);
            times.push(ms);
        }
    }
    assert_eq!(times, [0, 5, 10, 15, 20, 40]);
    assert!(!bench.driver.joint.has_default_transmit_pdos());
    // Stopped, nothing is sent; the communication reset restores the defaults.
    bench.driver.receive(&frame(0, &[0x80, 0]), bench.now_us);
    bench.pass_ms(40);
    assert!(!identifiers(&bench.sent()).contains(&0x1F1));
    bench.driver.receive(&frame(0, &[0x82, 0]), bench.now_us);
    assert_eq!(bench.number(0x1800, 2), 10);
    assert_eq!(bench.number(0x1A05, 0), 3);
    assert!(bench.driver.joint.has_default_transmit_pdos());
}

#[test]
fn learnt_gains_and_their_deviations_can_be_sent_at_a_sync() {
    let mut bench = Bench::on_sensors();
    bench.start();
    let entry = |at_index: u16| u32::from(at_index) << 16 | 1 << 8 | 32;
    let entries = [entry(index::LEARNT_GAINS), entry(index::GAIN_DEVIATIONS)];
    map(&mut bench, 0x1805, 0x1F1, &entries).unwrap();
    write_number(&mut bench, 0x1805, 2, 1).unwrap();
    let sent = plain_sync(&mut bench);
    let frame = sent.iter().find(|frame| frame.identifier() == 0x1F1);
    let data = frame.expect("a frame of the gains").data().to_vec();
    assert_eq!(data, [1f32.to_le_bytes(), 0f32.to_le_bytes()].concat());
}

#[test]
fn receive_pdo_with_own_mapping_and_identifier_writes_its_objects() {
    let mut bench = Bench::on_sensors();
    let (control, torque) = (0x6040_0010, 0x6071_0010);
    map(&mut bench, 0x1401, 0x182, &[torque, control]).unwrap();
    assert_eq!(bench.driver.receive_identifiers(), [0x201, 0x182, 0x401, 0x501, 0, 0, 0x601]);
    bench.write(index::MODE, 0, &[10]).unwrap();
    let pdo = frame(0x182, &[0x64, 0x00, 0x06, 0x00]);
    bench.driver.receive(&pdo, bench.now_us);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 0, "not operational");
    bench.start();
    // Its old identifier belongs to no PDO now.
    bench.driver.receive(&frame(0x301, &[1; 8]), bench.now_us);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 0);
    bench.driver.receive(&frame(0x182, &[0x64, 0x00, 0x06]), bench.now_us);
    assert_eq!(bench.driver.joint.counters().wrong_length, 1);
    bench.driver.receive(&pdo, bench.now_us);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 100);
    assert_eq!(bench.number(index::CONTROLWORD, 0), 6);
    // A synchronous one waits for its SYNC, and is refused after the window.
    write_number(&mut bench, 0x1401, 2, 1).unwrap();
    write_number(&mut bench, index::SYNC_WINDOW, 0, 2000).unwrap();
    plain_sync(&mut bench);
    bench.driver.receive(&frame(0x182, &[0xC8, 0x00, 0x06, 0x00]), bench.now_us);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 100);
    plain_sync(&mut bench);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 200);
    bench.pass_ms(3);
    bench.driver.receive(&pdo, bench.now_us);
    plain_sync(&mut bench);
    assert_eq!(bench.number(index::TARGET_TORQUE, 0), 200);
    assert_eq!(bench.driver.joint.counters().outside_window, 1);
}

#[test]
fn mapping_is_refused_with_the_code_of_its_reason() {
    let mut bench = Bench::on_sensors();
    // Enabled, or with a count.
    assert_eq!(write_number(&mut bench, 0x1A00, 0, 0), Err(STATE));
    bench.check_refusal("mapping of a PDO in use", &["31"]);
    write_number(&mut bench, 0x1800, 1, 0x181 | UNUSED).unwrap();
    assert_eq!(write_number(&mut bench, 0x1A00, 1, 0x6041_0010), Err(STATE));
    write_number(&mut bench, 0x1A00, 0, 0).unwrap();
    for (entry, code) in [
        (0x6041_0020, NOT_MAPPABLE), // another length
        (0x6502_0020, NOT_MAPPABLE), // constant
        (0x1008_0020, NOT_MAPPABLE), // text
        (0x2023_0120, NOT_MAPPABLE), // parameter
        (0x3000_0010, 0x0602_0000),
        (0x6041_0110, 0x0609_0011),
    ] {
        assert_eq!(write_number(&mut bench, 0x1A00, 1, entry), Err(code), "{entry:08X}");
    }
    for place in 1..=3 {
        write_number(&mut bench, 0x1A00, place, 0x6064_0020).unwrap();
    }
    assert_eq!(write_number(&mut bench, 0x1A00, 0, 3), Err(TOO_LONG));
    assert_eq!(write_number(&mut bench, 0x1A00, 0, 9), Err(TOO_LONG));
    write_number(&mut bench, 0x1A00, 0, 2).unwrap();
    // What the joint measures cannot be received.
    write_number(&mut bench, 0x1400, 1, 0x201 | UNUSED).unwrap();
    write_number(&mut bench, 0x1600, 0, 0).unwrap();
    assert_eq!(write_number(&mut bench, 0x1600, 1, 0x6041_0010), Err(NOT_MAPPABLE));
    for kind in [241, 252, 253] {
        assert_eq!(write_number(&mut bench, 0x1800, 2, kind), Err(VALUE));
    }
    for wrong in [0x080, 0x581, 0x701, 0x2000_0181] {
        assert_eq!(write_number(&mut bench, 0x1400, 1, wrong), Err(VALUE));
    }
    // Nothing is changed while the joint is armed.
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert_eq!(write_number(&mut bench, 0x1800, 1, 0x181 | UNUSED), Err(STATE));
}

#[test]
fn store_and_restore_keep_settings_and_leave_pdos_to_the_master() {
    let mut bench = Bench::on_sensors();
    write_number(&mut bench, index::HEARTBEAT, 0, 250).unwrap();
    write_number(&mut bench, 0x1800, 2, 7).unwrap();
    assert_eq!(write_number(&mut bench, index::STORE, 1, 1), Err(0x0800_0020));
    write_number(&mut bench, index::STORE, 1, SAVE_SIGNATURE).unwrap();
    let flash: Flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    assert_eq!((bench.number(index::HEARTBEAT, 0), bench.number(0x1800, 2)), (250, 10));
    write_number(&mut bench, index::RESTORE, 1, LOAD_SIGNATURE).unwrap();
    let flash: Flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    assert_eq!(bench.number(index::HEARTBEAT, 0), 1000);
}
