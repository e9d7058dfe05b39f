//! Tests of telemetry in one frame of CAN FD per sample: the same data as in the classic frames, and only where no master
//! has changed them.

use super::bench::{Bench, Flash};
use super::{frame, sample};
use compensator_core::can::{FdTelemetry, Frame, Message, SyncFrame};
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::{Equipment, Joint};
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;

const FD_TELEMETRY: u8 = 9;
const VALUE: u32 = 0x0609_0030;

/// Returns a started joint whose controller sends CAN FD, with the option on or off.
fn started(source: InputSource, is_on: bool) -> Bench {
    let mut bench = Bench::boot(source, Flash::new(), &Boot::default());
    bench.driver.joint.equip(Equipment { sends_fd: true, ..Equipment::default() });
    bench.write(index::OPERATION, FD_TELEMETRY, &[is_on.into()]).unwrap();
    bench.start();
    bench.sent();
    bench
}

/// Sends a SYNC; returns the classic frames and the frame of CAN FD that answer it.
fn answers(bench: &mut Bench, sequence: u32) -> (Vec<Frame>, Option<FdTelemetry>) {
    bench.give(Message::Sync(SyncFrame::of(sequence)));
    let fd = bench.driver.transmit_fd_if(|_| true);
    assert_eq!(bench.driver.transmit_fd_if(|_| true), None);
    (bench.sent(), fd)
}

#[test]
fn fd_telemetry_is_off_by_default_and_refused_without_a_controller_for_it() {
    let mut bench = Bench::hil();
    assert_eq!(bench.number(index::OPERATION, FD_TELEMETRY), 0);
    assert_eq!(bench.write(index::OPERATION, FD_TELEMETRY, &[1]), Err(VALUE));
    assert!(bench.text(index::REFUSAL).contains("fd_telemetry"));
    bench.driver.joint.equip(Equipment { sends_fd: true, ..Equipment::default() });
    bench.write(index::OPERATION, FD_TELEMETRY, &[1]).unwrap();
    assert_eq!(bench.write(index::OPERATION, FD_TELEMETRY, &[2]), Err(VALUE));
    assert_eq!(bench.number(index::OPERATION, FD_TELEMETRY), 1);
    bench.write(index::OPERATION, FD_TELEMETRY, &[0]).unwrap();
    bench.start();
    assert_eq!(answers(&mut bench, 0).1, None);
}

#[test]
fn fd_telemetry_of_a_joint_in_hil_contains_its_classic_frames() {
    let run = |is_on: bool| -> Vec<Vec<Frame>> {
        let mut bench = started(InputSource::Bus, is_on);
        bench.write(index::OPERATION, 5, &[3]).unwrap();
        bench.write(index::STATE, 1, &[1]).unwrap();
        let sampled = |sequence| {
            let classic = sample(&mut bench, sequence);
            let fd = bench.driver.transmit_fd_if(|_| true);
            assert_eq!(fd.is_some(), is_on, "sample {sequence}");
            let Some(fd) = fd else { return classic.iter().map(Message::emit).collect() };
            assert!(classic.is_empty(), "{classic:?}");
            assert_eq!(fd.counter(), SyncFrame::of(sequence).counter);
            fd.frames().collect()
        };
        (0..500).map(sampled).collect()
    };
    let classic = run(false);
    assert_eq!(run(true), classic);
    // Telemetry is in every third one.
    assert_eq!(classic.iter().map(Vec::len).sum::<usize>(), 500 * 2 + 500 / 3 + 1);
}

#[test]
fn fd_telemetry_of_a_joint_on_sensors_contains_five_frames_and_the_drive() {
    let run = |is_on: bool| {
        let mut bench = started(InputSource::Sensors, is_on);
        // As in a frame of CAN FD.
        for at_index in index::TRANSMIT_ANSWER..=index::TRANSMIT_TORQUE {
            assert_eq!(bench.number(at_index, 2) == 1, is_on || at_index == index::TRANSMIT_MOTION);
            bench.write(at_index, 2, &[1]).unwrap();
        }
        bench.now_us = 1_234_000;
        let report = LoopReport { current_a: 1.5, velocity_rad_s: 2.5, ..LoopReport::default() };
        bench.driver.joint.report(&report);
        let statusword = bench.number(index::STATUSWORD, 0);
        let (classic, fd) = answers(&mut bench, 7);
        (classic, fd, statusword)
    };
    let (classic, none, _) = run(false);
    let (rest, fd, statusword) = run(true);
    let fd = fd.expect("it is on");
    assert_eq!((none, rest), (None, Vec::new()));
    assert_eq!(classic.len(), 5);
    assert_eq!(fd.frames().collect::<Vec<_>>(), classic);
    assert_eq!((fd.identifier(), fd.counter(), fd.time_us()), (0x381, 8, 1_234_000));
    assert_eq!(fd.get(5).expect("the drive")[..2], statusword.to_le_bytes()[..2]);
}

#[test]
fn pdo_that_a_master_has_changed_is_sent_as_a_classic_frame() {
    let mut bench = started(InputSource::Sensors, true);
    let unused = 1u32 << 31;
    // Answer with another identifier, Status disabled, Torque at every second SYNC.
    bench.write(index::TRANSMIT_ANSWER, 1, &0x1C5u32.to_le_bytes()).unwrap();
    bench.write(index::TRANSMIT_STATUS, 1, &(unused | 0x281).to_le_bytes()).unwrap();
    bench.write(index::TRANSMIT_TORQUE, 2, &[2]).unwrap();
    let contained = |fd: Option<FdTelemetry>| -> Vec<u16> {
        fd.expect("it is on").frames().map(|frame| frame.identifier()).collect()
    };
    for (sequence, expected) in [(0, &[0x481, 0x381][..]), (1, &[0x481, 0x681, 0x381])] {
        let (classic, fd) = answers(&mut bench, sequence);
        assert_eq!(classic.iter().map(Frame::identifier).collect::<Vec<_>>(), [0x1C5]);
        assert_eq!(contained(fd), expected);
    }
    // The frame has the identifier of Telemetry. Where a master moves that, all frames are classic.
    bench.write(index::TRANSMIT_TELEMETRY, 1, &0x1C6u32.to_le_bytes()).unwrap();
    bench.write(index::TRANSMIT_TELEMETRY, 2, &[1]).unwrap();
    bench.write(index::TRANSMIT_ANSWER, 2, &[1]).unwrap();
    let (classic, fd) = answers(&mut bench, 2);
    assert_eq!(fd, None);
    let identifiers: Vec<u16> = classic.iter().map(Frame::identifier).collect();
    assert_eq!(identifiers, [0x481, 0x1C5, 0x1C6]);
    // A reset of the communication returns to the defaults.
    bench.driver.receive(&frame(0, &[0x82, 1]), bench.now_us);
    bench.start();
    bench.sent();
    assert_eq!(contained(answers(&mut bench, 3).1).len(), 5);
}

#[test]
fn fd_telemetry_is_stored_and_an_unsent_frame_is_counted() {
    let mut bench = started(InputSource::Bus, true);
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Bus, flash, &Boot::default());
    assert_eq!(bench.number(index::OPERATION, FD_TELEMETRY), 1);
    // A board without CAN FD ignores the stored setting.
    bench.start();
    assert_eq!(sample(&mut bench, 0).len(), 3);
    bench.driver.joint.equip(Equipment { sends_fd: true, ..Equipment::default() });
    let lost = bench.number(index::FRAME_COUNTERS, 3);
    for sequence in 1..4 {
        assert_eq!(sample(&mut bench, sequence).len(), 0);
    }
    assert_eq!(bench.number(index::FRAME_COUNTERS, 3), lost + 2);
    assert_eq!(bench.driver.transmit_fd_if(|_| true).expect("the last").counter(), 4);
}
