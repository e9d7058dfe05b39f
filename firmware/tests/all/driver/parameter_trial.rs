//! Trial of a parameter set (2042h): what opens it, what ends it, and what comes back.

use super::STATE_REFUSED;
use super::bench::{Bench, frame};
use super::drive::{in_cst, pass};
use embedded_storage::nor_flash::NorFlash;
use firmware::background::BoardState;
use firmware::driver::Boot;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::{LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::{CanState, Code};

const OUT_OF_RANGE: u32 = 0x0609_0030;
pub const DEADLINE: u8 = 1;
pub const ORDER: u8 = 2;
pub const STATE: u8 = 3;
pub const STORED_CRC: u8 = 4;
pub const KEEP: u8 = 1;
pub const RETURN: u8 = 2;
pub const KEEP_AND_SAVE: u8 = 3;
/// Gain of the position loop: default, and on trial.
const STORED_GAIN: u32 = 10_000;
const TRIAL_GAIN: u32 = 4_000;

pub fn open<F: NorFlash>(bench: &mut Bench<F>, deadline_ms: u16) -> Result<(), u32> {
    bench.write(index::TRIAL, DEADLINE, &deadline_ms.to_le_bytes())
}

pub fn order<F: NorFlash>(bench: &mut Bench<F>, order: u8) -> Result<(), u32> {
    bench.write(index::TRIAL, ORDER, &[order])
}

pub fn trial_state<F: NorFlash>(bench: &mut Bench<F>) -> u32 {
    bench.number(index::TRIAL, STATE)
}

/// Commits the set in use with this scale of the compensation.
pub fn commit_scale<F: NorFlash>(bench: &mut Bench<F>, scale: f32) -> Result<(), u32> {
    bench.write(index::COMPENSATOR, 1, &scale.to_le_bytes())?;
    let crc = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &crc.to_le_bytes())
}

pub fn save<F: NorFlash>(bench: &mut Bench<F>) -> Result<(), u32> {
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes())
}

fn set_gain(bench: &mut Bench, gain: u32) {
    bench.write(index::POSITION_LOOP, 1, &gain.to_le_bytes()).expect("a legal gain");
}

/// Opens a trial, and commits a set and a gain.
fn on_trial(bench: &mut Bench, deadline_ms: u16) {
    open(bench, deadline_ms).expect("the stored values are in use");
    commit_scale(bench, 0.25).expect("a legal set");
    set_gain(bench, TRIAL_GAIN);
    assert_eq!(trial_state(bench), 1);
}

/// Requires the trial's set and gain.
fn assert_on_trial(bench: &mut Bench, case: &str) {
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.25, "{case}");
    assert_eq!(bench.number(index::POSITION_LOOP, 1), TRIAL_GAIN, "{case}");
}

/// Requires that the defaults came back, with what was staged gone, and this state of the trial.
fn assert_returned(bench: &mut Bench, state: u32, case: &str) {
    assert_eq!(trial_state(bench), state, "{case}");
    assert_eq!(bench.driver.joint.set(), &ParameterSet::default(), "{case}");
    assert_eq!(bench.number(index::POSITION_LOOP, 1), STORED_GAIN, "{case}");
    let crc = ParameterSet::default().crc();
    let crcs = [(index::COMMIT, 1), (index::COMMIT, 2), (index::TRIAL, STORED_CRC)];
    assert_eq!(crcs.map(|(at, sub)| bench.number(at, sub)), [crc; 3], "{case}");
    assert_eq!(bench.number(index::TRIAL, DEADLINE), 0, "{case}");
}

/// Creates an armed joint in CST on a trial.
fn armed(deadline_ms: u16) -> Bench {
    let mut bench = in_cst();
    on_trial(&mut bench, deadline_ms);
    enable(&mut bench);
    bench
}

fn enable(bench: &mut Bench) {
    for word in [0x06, 0x07, 0x0F] {
        super::drive::control(bench, word, 0);
    }
    assert!(bench.driver.joint.is_armed());
}

/// Passes time with a target every millisecond.
fn drive(bench: &mut Bench, milliseconds: u64) {
    for _ in 0..milliseconds {
        super::drive::control(bench, 0x0F, 0);
        pass(bench, 1);
    }
}

#[test]
fn deadline_that_passes_returns_the_stored_values_disarmed_and_armed() {
    let mut bench = in_cst();
    on_trial(&mut bench, 500);
    pass(&mut bench, 499);
    assert_eq!(bench.number(index::TRIAL, DEADLINE), 1);
    assert_on_trial(&mut bench, "before the deadline");
    let in_loop = bench.driver.joint.loop_commands(bench.now_us).set_number;
    pass(&mut bench, 1);
    assert_returned(&mut bench, 4, "disarmed");
    let set_number = bench.driver.joint.loop_commands(bench.now_us).set_number;
    assert_eq!(set_number, in_loop + 1, "the loop takes the set that came back");

    let mut bench = armed(500);
    drive(&mut bench, 499);
    assert_on_trial(&mut bench, "before the deadline");
    assert!(bench.driver.joint.is_armed());
    drive(&mut bench, 1);
    // 6007h is 1 and 605Eh is 0: the bridge opens.
    assert!(!bench.driver.joint.is_armed());
    assert_returned(&mut bench, 4, "armed");
}

#[test]
fn trial_that_is_renewed_for_a_minute_stays_while_armed() {
    let mut bench = armed(100);
    for renewal in 0..1200 {
        drive(&mut bench, 50);
        assert_eq!(bench.number(index::TRIAL, DEADLINE), 50, "renewal {renewal}");
        open(&mut bench, 100).expect("an armed joint accepts a renewal");
    }
    assert!(bench.driver.joint.is_armed());
    assert_on_trial(&mut bench, "after a minute");
    drive(&mut bench, 100);
    assert_returned(&mut bench, 4, "without renewal");
}

#[test]
fn trial_that_is_kept_stays_and_can_be_saved() {
    let mut bench = armed(200);
    order(&mut bench, KEEP).expect("the trial is open");
    assert_eq!((trial_state(&mut bench), bench.number(index::TRIAL, DEADLINE)), (2, 0));
    drive(&mut bench, 500);
    assert!(bench.driver.joint.is_armed());
    assert_on_trial(&mut bench, "kept");
    assert_eq!(order(&mut bench, RETURN), Err(STATE_REFUSED), "the trial is over");
    super::drive::control(&mut bench, 0, 0);
    assert!(open(&mut bench, 200).is_err(), "what is kept is not stored");
    save(&mut bench).expect("nothing is on trial");
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.sent();
    assert_on_trial(&mut bench, "saved");
    open(&mut bench, 200).expect("the stored values are in use");
}

#[test]
fn order_to_keep_and_save_ends_the_trial_with_the_values_in_the_flash() {
    let mut bench = in_cst();
    assert_eq!(order(&mut bench, KEEP_AND_SAVE), Err(STATE_REFUSED), "no trial");
    let mut bench = armed(500);
    let before = bench.driver.joint.flash().steps();
    assert_eq!(order(&mut bench, KEEP_AND_SAVE), Err(STATE_REFUSED), "armed");
    bench.check_refusal("keep and save while armed", &[]);
    assert_eq!((trial_state(&mut bench), bench.driver.joint.flash().steps()), (1, before));
    super::drive::control(&mut bench, 0, 0);
    order(&mut bench, KEEP_AND_SAVE).expect("the trial is open");
    assert_eq!((trial_state(&mut bench), bench.number(index::TRIAL, DEADLINE)), (2, 0));
    pass(&mut bench, 1000);
    assert_on_trial(&mut bench, "after the deadline");
    assert_eq!(order(&mut bench, KEEP_AND_SAVE), Err(STATE_REFUSED), "the trial is over");
    open(&mut bench, 200).expect("the stored values are in use");
    let mut bench =
        Bench::boot(InputSource::Sensors, bench.driver.joint.into_flash(), &Boot::default());
    bench.sent();
    assert_on_trial(&mut bench, "after a restart");
}

#[test]
fn order_to_return_stops_the_joint_and_returns_the_stored_values() {
    let mut bench = in_cst();
    assert_eq!(order(&mut bench, RETURN), Err(STATE_REFUSED), "no trial");
    on_trial(&mut bench, 60_000);
    assert_eq!(order(&mut bench, 4), Err(OUT_OF_RANGE));
    bench.check_refusal("order of no meaning to a trial", &[]);
    order(&mut bench, RETURN).unwrap();
    assert_returned(&mut bench, 3, "disarmed");
    let mut bench = armed(60_000);
    order(&mut bench, RETURN).unwrap();
    assert!(!bench.driver.joint.is_armed());
    assert_returned(&mut bench, 3, "armed");
}

#[test]
fn fault_or_lost_connection_returns_the_stored_values() {
    type Event = (&'static str, u32, fn(&mut Bench));
    let fault: Event = ("comparators", 5, |bench| {
        let flags = firmware::control::LoopFlags::OVERCURRENT;
        let report = firmware::driver::LoopReport {
            loop_flags: flags,
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            ..firmware::driver::LoopReport::default()
        };
        bench.driver.joint.report(&report);
        bench.pass_ms(1);
    });
    let events: [Event; 7] = [
        fault,
        ("NMT stop", 6, |bench| bench.driver.receive(&frame(0, &[2, 0]), bench.now_us)),
        ("NMT pre-operational", 6, |bench| {
            bench.driver.receive(&frame(0, &[0x80, 1]), bench.now_us);
        }),
        ("NMT reset", 6, |bench| {
            bench.driver.receive(&frame(0, &[0x82, 0]), bench.now_us);
        }),
        ("bus off", 6, |bench| {
            bench
                .driver
                .joint
                .take_board_state(&BoardState { can: CanState::Off, ..BoardState::default() });
            pass(bench, 200);
            bench
                .driver
                .joint
                .take_board_state(&BoardState { can: CanState::Active, ..BoardState::default() });
        }),
        ("heartbeat", 6, |bench| pass(bench, 60)),
        ("targets", 6, |bench| pass(bench, 110)),
    ];
    for (name, state, event) in events {
        for is_armed in [false, true] {
            if name == "targets" && !is_armed {
                continue;
            }
            let mut bench = in_cst();
            bench.write(index::AWAITED_HEARTBEAT, 1, &(9u32 << 16 | 50).to_le_bytes()).unwrap();
            on_trial(&mut bench, 60_000);
            if name == "heartbeat" {
                bench.driver.receive(&frame(0x709, &[5]), bench.now_us);
            }
            if is_armed {
                enable(&mut bench);
            }
            event(&mut bench);
            let case = format!("{name}, armed: {is_armed}");
            assert!(!bench.driver.joint.is_armed(), "{case}");
            pass(&mut bench, 1);
            // A stopped node serves no objects.
            bench.start();
            bench.sent();
            assert_returned(&mut bench, state, &case);
        }
    }
}

#[test]
fn reset_of_the_processor_returns_the_stored_values() {
    let bench = armed(60_000);
    let mut bench =
        Bench::boot(InputSource::Sensors, bench.driver.joint.into_flash(), &Boot::default());
    bench.sent();
    assert_eq!(trial_state(&mut bench), 0);
    assert_eq!(bench.driver.joint.set(), &ParameterSet::default());
    assert_eq!(bench.number(index::POSITION_LOOP, 1), STORED_GAIN);
}

#[test]
fn opening_is_refused_with_unsaved_values_an_armed_joint_or_a_fault() {
    let unsaved: [fn(&mut Bench); 2] =
        [|bench| commit_scale(bench, 0.5).unwrap(), |bench| set_gain(bench, 5_000)];
    for change in unsaved {
        for stores_first in [false, true] {
            let mut bench = in_cst();
            if stores_first {
                save(&mut bench).unwrap();
            }
            change(&mut bench);
            assert_eq!(open(&mut bench, 500), Err(STATE_REFUSED));
            bench.check_refusal("trial of values that are not saved", &[]);
            assert_eq!(trial_state(&mut bench), 0);
            save(&mut bench).unwrap();
            open(&mut bench, 500).expect("saved");
        }
    }
    let mut bench = in_cst();
    for deadline_ms in [0, 99, 60_001] {
        assert_eq!(open(&mut bench, deadline_ms), Err(OUT_OF_RANGE), "{deadline_ms} ms");
    }
    enable(&mut bench);
    assert_eq!(open(&mut bench, 500), Err(STATE_REFUSED));
    pass(&mut bench, 110);
    assert!(bench.driver.joint.supervisor().faults().contains(Code::CommandTimeout));
    assert_eq!(open(&mut bench, 500), Err(STATE_REFUSED));
    let why = bench.text(index::REFUSAL);
    assert!(why.contains("command-timeout"), "{why}");
}

#[test]
fn what_is_staged_before_a_trial_can_be_committed_in_it() {
    let mut bench = in_cst();
    bench.write(index::COMPENSATOR, 1, &0.25f32.to_le_bytes()).unwrap();
    let crc = bench.number(index::COMMIT, 2);
    open(&mut bench, 500).unwrap();
    bench.write(index::COMMIT, 3, &crc.to_le_bytes()).expect("still staged");
}

#[test]
fn wiring_that_is_confirmed_in_a_trial_is_replaced_by_the_stored_confirmation() {
    let mut bench = in_cst();
    save(&mut bench).unwrap();
    open(&mut bench, 500).unwrap();
    bench.write(index::MOTOR, 1, &9f32.to_le_bytes()).unwrap();
    commit_scale(&mut bench, 0.25).unwrap();
    assert_eq!(bench.number(index::COMMISSIONING, 1), 0);
    bench.commission();
    pass(&mut bench, 500);
    assert_returned(&mut bench, 4, "other wiring");
    assert_eq!(bench.number(index::COMMISSIONING, 1), 1);
    enable(&mut bench);
}

/// A joint that stops may be disarmed and armed again before its next tick.
#[test]
fn arming_before_the_return_uses_the_stored_values() {
    let mut bench = in_cst();
    bench.write(index::FAULT_OPTION, 0, &[1, 0]).unwrap();
    save(&mut bench).unwrap();
    on_trial(&mut bench, 500);
    enable(&mut bench);
    order(&mut bench, RETURN).unwrap();
    assert_eq!(trial_state(&mut bench), 7);
    assert!(open(&mut bench, 500).is_err() && order(&mut bench, KEEP).is_err());
    assert_on_trial(&mut bench, "the joint stops");
    super::drive::control(&mut bench, 0, 0);
    enable(&mut bench);
    assert_returned(&mut bench, 3, "armed again");
}

#[test]
fn flash_that_is_damaged_in_a_trial_returns_the_defaults_with_their_code() {
    let mut bench = in_cst();
    commit_scale(&mut bench, 0.5).unwrap();
    save(&mut bench).unwrap();
    on_trial(&mut bench, 500);
    let bytes = bench.driver.joint.flash().image().flatten().map(|byte| !byte).collect::<Vec<_>>();
    bench.driver.joint.flash_mut().restore(&bytes);
    pass(&mut bench, 500);
    assert_eq!(bench.driver.joint.set(), &ParameterSet::default());
    assert_eq!(bench.number(index::POSITION_LOOP, 1), STORED_GAIN);
    assert!(bench.driver.joint.supervisor().causes().contains(Code::ParametersRefused));
}

#[test]
fn nothing_is_saved_while_a_trial_is_open() {
    let mut bench = in_cst();
    save(&mut bench).unwrap();
    on_trial(&mut bench, 60_000);
    let before = bench.driver.joint.flash().steps();
    for (at, value) in [(index::STORE, SAVE_SIGNATURE), (index::RESTORE, LOAD_SIGNATURE)] {
        assert_eq!(bench.write(at, 1, &value.to_le_bytes()), Err(STATE_REFUSED), "{at:04X}h");
        bench.check_refusal("parameters on trial", &[]);
    }
    assert_eq!(bench.driver.joint.flash().steps(), before);
    order(&mut bench, KEEP).unwrap();
    save(&mut bench).expect("the trial is over");
}
