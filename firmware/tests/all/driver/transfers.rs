//! Level and state of the joint at the moment at which a transfer takes effect, for every object and kind of transfer.

use super::STATE_REFUSED;
use super::bench::{Bench, LOCKED};
use super::drive::{control, in_cst};
use firmware::access::{Level, SESSION_US};
use firmware::node::dictionary::{Access, Entry, OBJECTS, index};

const LOCK: u8 = 4;

/// Kinds of transfers. One of a single frame takes effect at its begin, the others with a later frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Transfer {
    Expedited,
    Segments,
    Blocks,
}

/// What happens before the frame that completes a transfer.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    Nothing,
    Armed,
    Locked,
    SessionEnded,
}

/// Returns the first frame of a download and the frames that follow it.
fn frames(transfer: Transfer, at: (u16, u8), value: &[u8]) -> ([u8; 8], Vec<[u8; 8]>) {
    let [low, high] = at.0.to_le_bytes();
    let [a, b, ..] = value.len().to_le_bytes();
    let first = |command| [command, low, high, at.1, a, b, 0, 0];
    let unused = (value.len().next_multiple_of(7) - value.len()) as u8;
    let parts: Vec<[u8; 7]> = value
        .chunks(7)
        .map(|part| core::array::from_fn(|place| part.get(place).copied().unwrap_or(0)))
        .collect();
    let segment = |command: u8, [a, b, c, d, e, f, g]: [u8; 7]| [command, a, b, c, d, e, f, g];
    match transfer {
        Transfer::Expedited => {
            let mut frame = first(0x23 | (4 - value.len() as u8) << 2);
            frame[4..].fill(0);
            frame[4..4 + value.len()].copy_from_slice(value);
            (frame, Vec::new())
        }
        Transfer::Segments => {
            let last = parts.len() - 1;
            let command = |place: usize| {
                (place as u8 & 1) << 4 | if place == last { unused << 1 | 1 } else { 0 }
            };
            let segments = parts.iter().enumerate();
            (first(0x21), segments.map(|(place, part)| segment(command(place), *part)).collect())
        }
        Transfer::Blocks => {
            let command =
                |place: usize| (place as u8 + 1) | if place + 1 == parts.len() { 0x80 } else { 0 };
            let segments = parts.iter().enumerate();
            let mut rest: Vec<[u8; 8]> =
                segments.map(|(place, part)| segment(command(place), *part)).collect();
            rest.push([0xC1 | unused << 2, 0, 0, 0, 0, 0, 0, 0]);
            (first(0xC2), rest)
        }
    }
}

fn writable() -> impl Iterator<Item = (u16, u8, Entry)> {
    let entries = OBJECTS.iter().flat_map(|object| {
        let subs = 0..=object.highest_sub_index();
        subs.map(|sub| (object.index, sub, object.entry(sub).expect("within its last")))
    });
    entries.filter(|(.., entry)| {
        matches!(entry.access, Access::ReadWrite | Access::WriteOnly | Access::Input)
    })
}

/// Returns a value other than the present one, if that can be read.
fn other_value(bench: &mut Bench, at: (u16, u8), entry: &Entry) -> Vec<u8> {
    match bench.read(at.0, at.1) {
        Ok(mut value) if entry.data.length().is_some() => {
            value[0] ^= 1;
            value
        }
        // A program would take longer values in parts, before the last frame.
        _ if at.0 == index::PROGRAM_DATA => vec![1; 7],
        _ => vec![1; entry.data.length().unwrap_or(24)],
    }
}

/// Lets the event happen by frames that do not end a transfer.
fn pass_event(bench: &mut Bench, event: Event) {
    match event {
        Event::Nothing | Event::Locked => {}
        Event::Armed => {
            for word in [0x06, 0x07, 0x0F] {
                control(bench, word, 0);
            }
            assert!(bench.driver.joint.is_armed());
        }
        Event::SessionEnded => bench.now_us = SESSION_US,
    }
    bench.sent();
}

/// Writes an object, with the event before the last frame. Returns the abort code.
fn write(
    bench: &mut Bench,
    transfer: Transfer,
    at: (u16, u8),
    value: &[u8],
    event: Event,
) -> Result<(), u32> {
    let (first, mut rest) = frames(transfer, at, value);
    let Some(last) = rest.pop() else {
        pass_event(bench, event);
        return bench.exchange(first).map(drop);
    };
    bench.exchange(first)?;
    for (place, segment) in rest.iter().enumerate() {
        if matches!(transfer, Transfer::Blocks) && place + 1 < rest.len() {
            // Only the last segment of a block is answered.
            bench.driver.receive(&super::frame(0x601, segment), bench.now_us);
        } else {
            bench.exchange(*segment)?;
        }
    }
    pass_event(bench, event);
    bench.exchange(last).map(drop)
}

/// Creates a joint that can be armed, with a session that began at 0 and ends within the time-out of a transfer.
fn joint(event: Event) -> Bench {
    let mut bench = in_cst();
    assert_eq!(bench.number(index::ACCESS, 1), 1, "the bench has unlocked it");
    bench.key = None;
    match event {
        Event::Locked => bench.write(index::ACCESS, LOCK, &[1]).expect("is open"),
        Event::SessionEnded => bench.now_us = SESSION_US - 100_000,
        Event::Nothing | Event::Armed => {}
    }
    bench.sent();
    bench
}

/// Excluded: begin a transfer in time, and complete it after the lock or the arming.
///
/// Every object, in one frame, in segments and in blocks: the joint is locked at the begin, is armed before the last frame,
/// or its session ends before it.
#[test]
fn transfer_is_refused_if_the_joint_was_locked_or_armed_before_it_takes_effect() {
    let mut refused = 0;
    for (at_index, sub_index, entry) in writable() {
        let at = (at_index, sub_index);
        for transfer in [Transfer::Expedited, Transfer::Segments, Transfer::Blocks] {
            if transfer == Transfer::Expedited && entry.data.length().is_none() {
                continue;
            }
            for event in [Event::Armed, Event::Locked, Event::SessionEnded] {
                let mut bench = joint(event);
                let value = other_value(&mut bench, at, &entry);
                let before = bench.read(at_index, sub_index);
                let written = write(&mut bench, transfer, at, &value, event);
                let expected = match event {
                    Event::Armed if !entry.is_written_armed => STATE_REFUSED,
                    Event::Locked | Event::SessionEnded if entry.level == Level::Service => LOCKED,
                    _ => continue,
                };
                let case = format!("{at_index:04X}h:{sub_index} in {transfer:?}, {event:?}");
                assert_eq!(written, Err(expected), "{case}");
                assert_eq!(bench.read(at_index, sub_index), before, "{case}");
                refused += 1;
            }
        }
    }
    assert!(refused > 750, "{refused}");
}

/// The same frames write an object if nothing happens in between.
#[test]
fn transfer_without_an_event_writes_an_object_of_any_length() {
    let deceleration = 5_000_000u32.to_le_bytes();
    for transfer in [Transfer::Expedited, Transfer::Segments, Transfer::Blocks] {
        let mut bench = joint(Event::Nothing);
        let at = (index::QUICK_DECELERATION, 0);
        write(&mut bench, transfer, at, &deceleration, Event::Nothing).expect("it is unlocked");
        assert_eq!(bench.read(at.0, at.1), Ok(deceleration.to_vec()));
        if transfer == Transfer::Expedited {
            continue;
        }
        let mut record = bench.read(index::COMMIT, 6).expect("the record of the drive");
        // The lowest bit of `motor.gear_ratio`.
        record[4] ^= 1;
        write(&mut bench, transfer, (index::COMMIT, 6), &record, Event::Nothing).expect("staged");
        assert_eq!(bench.read(index::COMMIT, 6), Ok(record));
    }
}
