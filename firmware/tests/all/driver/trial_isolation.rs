//! Nothing of a trial reaches the flash, whatever is written, and a random order of events leaves no values in use that are
//! neither on trial nor kept nor stored.

use super::STATE_REFUSED;
use super::bench::{Bench, frame};
use super::drive::{control, in_cst, pass};
use super::parameter_trial::{
    KEEP, KEEP_AND_SAVE, RETURN, commit_scale, open, order, save, trial_state,
};
use crate::update::bench as update;
use firmware::access::Key;
use firmware::background::BoardState;
use firmware::control::LoopFlags;
use firmware::driver::{Boot, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::{Access, LOAD_SIGNATURE, OBJECTS, SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::store::memory::{MemoryFlash, PAGE_BYTES};
use firmware::supervisor::CanState;
use firmware::update::{Program, Slot};

/// A board with two banks: a slot of four pages and a store of four pages in each.
pub type BankFlash = MemoryFlash<16>;
pub const PAGE: u32 = PAGE_BYTES as u32;

/// Starts a joint that can be updated, whose store is in bank `1 - own`.
pub fn with_banks(flash: BankFlash, running: u32) -> Bench<BankFlash> {
    let bank = |number: u32| Slot { start: 8 * number * PAGE, marks: (8 * number + 3) * PAGE };
    let (running, other) = (bank(running), bank(1 - running));
    let program = Program {
        running,
        other,
        stores: [running, other].map(|bank| bank.start + 4 * PAGE),
        store_bytes: 4 * PAGE,
        ..update::program(0)
    };
    let boot = Boot { program: Some(program), ..Boot::default() };
    let mut bench = Bench::boot_on(StageTraits::NONE, InputSource::Sensors, flash, &boot);
    bench.sent();
    bench
}

/// Signature that makes a write of 1010h or 1011h effective, or a small number. The order that saves a trial is not among
/// them.
fn words(at_index: u16) -> [u32; 4] {
    match at_index {
        index::STORE => [SAVE_SIGNATURE; 4],
        index::RESTORE => [LOAD_SIGNATURE; 4],
        index::TRIAL => [0, KEEP.into(), RETURN.into(), 4],
        _ => [0, 1, 2, 3],
    }
}

#[test]
fn write_of_every_object_while_a_trial_is_open_leaves_the_flash() {
    let mut bench = with_banks(BankFlash::new(), 0);
    bench.start();
    save(&mut bench).unwrap();
    let steps = bench.driver.joint.flash().steps();
    let mut written = 0;
    for object in OBJECTS {
        for sub_index in 0..=object.highest_sub_index() {
            let entry = object.entry(sub_index).expect("within its last");
            if matches!(entry.access, Access::Const | Access::ReadOnly) {
                continue;
            }
            for word in words(object.index) {
                // A former write may have ended the trial, or changed what a trial needs.
                if trial_state(&mut bench) != 1 {
                    let mut fresh = with_banks(bench.driver.joint.into_flash(), 0);
                    fresh.start();
                    bench = fresh;
                    open(&mut bench, 60_000).expect("the stored values are in use");
                    commit_scale(&mut bench, 0.25).unwrap();
                }
                let value = word.to_le_bytes().repeat(6);
                let length = entry.data.length().unwrap_or(24);
                let _ = bench.write(object.index, sub_index, &value[..length]);
                bench.pass_ms(20);
                bench.sent();
                let at = (object.index, sub_index, word);
                assert_eq!(bench.driver.joint.flash().steps(), steps, "{at:04X?}");
                written += 1;
            }
        }
    }
    assert!(written > 1000, "{written}");
}

#[test]
fn program_update_key_policy_and_lss_are_refused_while_a_trial_is_open() {
    let mut bench = with_banks(BankFlash::new(), 0);
    bench.start();
    // A package that is left does not block a trial, and could be continued.
    bench.write(index::PROGRAM_CONTROL, 1, &[3]).unwrap();
    assert_eq!(open(&mut bench, 60_000), Err(STATE_REFUSED), "an update is in progress");
    bench.pass_ms(10_000);
    bench.sent();
    open(&mut bench, 60_000).unwrap();
    for command in 0..4 {
        assert_eq!(bench.write(index::PROGRAM_CONTROL, 1, &[command]), Err(STATE_REFUSED));
        bench.check_refusal("write during a trial", &[]);
    }
    assert_eq!(bench.write(index::PROGRAM_DATA, 1, &[0; 24]), Err(STATE_REFUSED));
    bench.check_refusal("program during a trial", &[]);
    for (sub_index, change) in [(5, &[7; 16][..]), (8, &[0])] {
        assert_eq!(bench.write_proven(sub_index, change, &Key::DEFAULT), Err(STATE_REFUSED));
    }
    // Global selection, then: number 99, store, back to waiting. An answer of 255 is a refusal.
    for (request, answer) in [([4, 1], None), ([0x11, 99], Some(255)), ([0x17, 0], Some(255))] {
        let mut data = [0; 8];
        data[..2].copy_from_slice(&request);
        bench.driver.receive(&frame(0x7E5, &data), bench.now_us);
        let answers = bench.sent();
        let found = answers.iter().find(|frame| frame.identifier() == 0x7E4);
        assert_eq!(found.map(|frame| frame.data()[1]), answer, "{request:?}");
    }
    order(&mut bench, KEEP).unwrap();
    bench.write(index::PROGRAM_CONTROL, 1, &[3]).expect("the trial is over");
}

/// After an update the joint runs from the other bank, whose store is the one that it copied.
#[test]
fn undo_after_a_change_of_the_bank_needs_the_former_set_in_the_other_store() {
    let tuned = |flash| {
        let mut bench = with_banks(flash, 0);
        commit_scale(&mut bench, 0.5).unwrap();
        save(&mut bench).unwrap();
        let before = bench.number(index::COMMIT, 1);
        commit_scale(&mut bench, 0.25).unwrap();
        bench.write(index::TUNING, 3, &before.to_le_bytes()).unwrap();
        bench
    };
    let undo = |bench: &mut Bench<BankFlash>| bench.write(index::TUNING, 7, &[1]);
    let mut bench = tuned(BankFlash::new());
    save(&mut bench).unwrap();
    // The newest set alone is copied.
    let mut bench = with_banks(bench.driver.joint.into_flash(), 1);
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.25);
    assert_eq!(undo(&mut bench), Err(STATE_REFUSED));
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.25);
    let mut bench = with_banks(bench.driver.joint.into_flash(), 0);
    undo(&mut bench).expect("the first bank has both");
    // A bank that was in use between the two saves has a copy of the former set.
    let bench = tuned(BankFlash::new());
    let bench = with_banks(bench.driver.joint.into_flash(), 1);
    let mut bench = tuned(bench.driver.joint.into_flash());
    save(&mut bench).unwrap();
    let mut bench = with_banks(bench.driver.joint.into_flash(), 1);
    undo(&mut bench).expect("its own former set");
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.5);
}

/// The other bank may have an older block with the same set and other settings of the drive.
#[test]
fn undo_of_a_block_that_is_not_the_one_before_is_refused() {
    let gain = |bench: &mut Bench<BankFlash>, gain: u32| {
        bench.write(index::POSITION_LOOP, 1, &gain.to_le_bytes()).unwrap();
        save(bench).unwrap();
    };
    let mut bench = with_banks(BankFlash::new(), 0);
    gain(&mut bench, 3_000);
    let bench = with_banks(bench.driver.joint.into_flash(), 1);
    let mut bench = with_banks(bench.driver.joint.into_flash(), 0);
    gain(&mut bench, 5_000);
    let before = bench.number(index::COMMIT, 1);
    commit_scale(&mut bench, 0.25).unwrap();
    bench.write(index::TUNING, 3, &before.to_le_bytes()).unwrap();
    save(&mut bench).unwrap();
    let mut bench = with_banks(bench.driver.joint.into_flash(), 1);
    assert_eq!(bench.write(index::TUNING, 7, &[1]), Err(STATE_REFUSED));
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.25);
    let mut bench = with_banks(bench.driver.joint.into_flash(), 0);
    bench.write(index::TUNING, 7, &[1]).expect("the block before");
    assert_eq!(bench.number(index::POSITION_LOOP, 1), 5_000);
}

/// Random numbers of a seed (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, most: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as u32 % most
    }
}

/// Set and settings of the drive in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Values {
    set_crc: u32,
    position_gain: u32,
    fault_option: u32,
}

fn values(bench: &mut Bench) -> Values {
    let set_crc = bench.driver.joint.set().crc();
    assert_eq!(bench.number(index::COMMIT, 1), set_crc);
    Values {
        set_crc,
        position_gain: bench.number(index::POSITION_LOOP, 1),
        fault_option: bench.number(index::FAULT_OPTION, 0),
    }
}

/// What a sequence of events must leave.
struct Expected {
    active: Values,
    stored: Values,
    is_open: bool,
    deadline_us: u64,
}

/// Opens or renews a trial, sometimes after a save.
fn open_or_renew(bench: &mut Bench, random: &mut Random, expected: &mut Expected) {
    let deadline_ms = 100 + random.below(400) as u16;
    if random.below(2) == 0 && save(bench).is_ok() {
        expected.stored = expected.active;
    }
    let is_returning = trial_state(bench) == 7;
    if open(bench, deadline_ms).is_ok() {
        if is_returning {
            expected.active = expected.stored;
        }
        let is_renewal = expected.is_open && !is_returning;
        assert!(is_renewal || expected.active == expected.stored, "opened unsaved");
        expected.is_open = true;
        expected.deadline_us = bench.now_us + 1000 * u64::from(deadline_ms);
    }
}

/// Gives an order that ends a trial with its values, and saves them with the second one.
fn end(bench: &mut Bench, keep: u8, expected: &mut Expected) {
    if order(bench, keep).is_ok() {
        assert!(expected.is_open);
        expected.is_open = false;
        if keep == KEEP_AND_SAVE {
            expected.stored = expected.active;
        }
    }
}

/// A random event; `expected` follows what the joint accepts.
fn step(bench: &mut Bench, random: &mut Random, expected: &mut Expected) {
    match random.below(16) {
        0..=2 => open_or_renew(bench, random, expected),
        3 | 4 => {
            if commit_scale(bench, random.below(100) as f32 * 0.01).is_ok() {
                expected.active.set_crc = bench.number(index::COMMIT, 2);
            }
        }
        5 => {
            let gain = 1000 + random.below(100);
            if bench.write(index::POSITION_LOOP, 1, &gain.to_le_bytes()).is_ok() {
                expected.active.position_gain = gain;
            }
        }
        6 => {
            let option = random.below(3) as u16;
            if bench.write(index::FAULT_OPTION, 0, &option.to_le_bytes()).is_ok() {
                expected.active.fault_option = option.into();
            }
        }
        7 => end(bench, KEEP, expected),
        8 if random.below(3) == 0 => end(bench, KEEP_AND_SAVE, expected),
        8 => drop(order(bench, RETURN)),
        9 => {
            if save(bench).is_ok() {
                assert!(!expected.is_open, "saved in a trial");
                expected.stored = expected.active;
            }
        }
        10 | 11 => {
            for word in [0x06, 0x07, 0x0F] {
                control(bench, word, 0);
                pass(bench, 1);
            }
        }
        12 => {
            control(bench, 0x80, 0);
            control(bench, 0, 0);
        }
        13 => disturb(bench, random),
        _ => {
            let has_targets = random.below(4) != 0;
            for _ in 0..random.below(300) {
                if has_targets && bench.driver.joint.is_armed() {
                    control(bench, 0x0F, 0);
                }
                pass(bench, 1);
            }
        }
    }
}

/// A fault, a lost connection or another state of the network.
fn disturb(bench: &mut Bench, random: &mut Random) {
    match random.below(5) {
        0 => bench.driver.joint.report(&LoopReport {
            loop_flags: LoopFlags::OVERCURRENT,
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            ..LoopReport::default()
        }),
        1 => bench
            .driver
            .joint
            .take_board_state(&BoardState { can: CanState::Off, ..BoardState::default() }),
        2 => bench.driver.receive(&frame(0, &[0x82, 0]), bench.now_us),
        3 => bench.driver.receive(&frame(0, &[0x80, 0]), bench.now_us),
        _ => bench.driver.receive(&frame(0, &[2, 0]), bench.now_us),
    }
    bench.pass_ms(1);
    bench
        .driver
        .joint
        .take_board_state(&BoardState { can: CanState::Active, ..BoardState::default() });
    bench.start();
    bench.sent();
}

#[test]
fn random_events_leave_no_values_that_are_neither_tried_nor_kept_nor_stored() {
    let mut ends = [0; 8];
    for seed in 1..=300 {
        let mut random = Random(0x9E37_79B9_7F4A_7C15u64.wrapping_mul(seed));
        let mut bench = in_cst();
        let start = values(&mut bench);
        let mut expected =
            Expected { active: start, stored: start, is_open: false, deadline_us: 0 };
        for event in 0..120 {
            if random.below(60) == 0 {
                let flash = bench.driver.joint.into_flash();
                bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
                bench.sent();
                bench.start();
                bench.commission();
                bench.write(index::MODE, 0, &[10]).unwrap();
                pass(&mut bench, 5);
                (expected.active, expected.is_open) = (expected.stored, false);
            }
            step(&mut bench, &mut random, &mut expected);
            // Between two ticks, a joint that was disarmed may not have returned.
            let has_ticked = random.below(2) == 0;
            pass(&mut bench, has_ticked.into());
            let state = trial_state(&mut bench);
            if expected.is_open && !matches!(state, 1 | 7) {
                assert!((3..=6).contains(&state), "seed {seed}, event {event}: state {state}");
                ends[state as usize] += 1;
                (expected.active, expected.is_open) = (expected.stored, false);
            }
            assert!(expected.is_open || !matches!(state, 1 | 7), "seed {seed}, event {event}");
            ends[7] += u32::from(state == 7);
            if state == 1 {
                assert!(bench.now_us < expected.deadline_us, "seed {seed}, event {event}");
            }
            if state == 7 && has_ticked {
                assert!(
                    bench.driver.joint.loop_commands(bench.now_us).bridge,
                    "only a stop delays it"
                );
            }
            let found = values(&mut bench);
            assert_eq!(found, expected.active, "seed {seed}, event {event}");
        }
    }
    println!("ends of trials by state: {ends:?}");
    assert!(ends[3..].iter().all(|count| *count > 50), "{ends:?}");
}
