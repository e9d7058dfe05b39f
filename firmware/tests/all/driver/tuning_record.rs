//! Record of a tuning (2043h), its undo, and power cuts during the saves.

use super::STATE_REFUSED;
use super::bench::{Bench, Flash};
use super::parameter_trial::{
    KEEP, KEEP_AND_SAVE, RETURN, commit_scale, open, order, save, trial_state,
};
use firmware::driver::Boot;
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node_settings::InputSource;
use firmware::store::memory::TornStep;

const UNDO: u8 = 7;
const BEFORE: f32 = 0.5;
const TUNED: f32 = 0.25;

/// Record without the two CRCs: time, run, gain, cause.
const RECORD: [(u8, u32); 4] = [(1, 1_800_000_000), (2, 0xDEAD_BEEF), (5, 0xFE0C), (6, 7)];

fn torn_steps() -> [TornStep; 6] {
    [
        TornStep::Nothing,
        TornStep::FirstHalf,
        TornStep::Partly(3),
        TornStep::Garbage(5),
        TornStep::Unreadable(9),
        TornStep::Done,
    ]
}

fn start(flash: Flash) -> Bench {
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.sent();
    bench
}

fn set_gain(bench: &mut Bench, gain: u32) {
    bench.write(index::POSITION_LOOP, 1, &gain.to_le_bytes()).expect("a legal gain");
}

/// Scale of the set in use, and the position gain.
fn in_use(bench: &mut Bench) -> (f32, u32) {
    let gain = bench.number(index::POSITION_LOOP, 1);
    (bench.driver.joint.set().friction.compensator.scale, gain)
}

const OLD: (f32, u32) = (BEFORE, 5_000);
const NEW: (f32, u32) = (TUNED, 8_000);

fn record(bench: &mut Bench) -> [u32; 6] {
    [1, 2, 3, 4, 5, 6].map(|sub| bench.number(index::TUNING, sub))
}

fn undo(bench: &mut Bench) -> Result<(), u32> {
    bench.write(index::TUNING, UNDO, &[1])
}

/// Returns the flash of a joint whose own values are stored.
fn before() -> Flash {
    let mut bench = Bench::on_sensors();
    commit_scale(&mut bench, BEFORE).unwrap();
    set_gain(&mut bench, OLD.1);
    save(&mut bench).unwrap();
    bench.driver.joint.into_flash()
}

/// Tries other values, keeps them and writes the record.
fn tune(bench: &mut Bench) {
    let crc_before = begin(bench);
    order(bench, KEEP).unwrap();
    write_record(bench, crc_before);
}

/// Tries other values. Returns the CRC of the former set.
fn begin(bench: &mut Bench) -> u32 {
    let crc_before = bench.number(index::COMMIT, 1);
    open(bench, 1000).expect("the stored values are in use");
    commit_scale(bench, TUNED).unwrap();
    set_gain(bench, NEW.1);
    crc_before
}

/// Tries other values, and writes the record while they are on trial.
fn record_on_trial(bench: &mut Bench) {
    let crc_before = begin(bench);
    write_record(bench, crc_before);
}

fn write_record(bench: &mut Bench, crc_before: u32) {
    let crcs = [(3, crc_before), (4, bench.number(index::COMMIT, 1))];
    for (sub, word) in RECORD.into_iter().chain(crcs) {
        let length = [4, 4, 4, 4, 2, 1][usize::from(sub) - 1];
        bench.write(index::TUNING, sub, &word.to_le_bytes()[..length]).expect("a free record");
    }
}

fn tuned() -> Flash {
    let mut bench = start(before());
    tune(&mut bench);
    save(&mut bench).unwrap();
    bench.driver.joint.into_flash()
}

#[test]
fn undo_after_a_save_brings_the_former_set_and_gain_back() {
    let mut bench = start(tuned());
    assert_eq!(in_use(&mut bench), NEW);
    let active_crc = bench.number(index::COMMIT, 1);
    let found = record(&mut bench);
    assert_eq!([found[0], found[1], found[4], found[5]], RECORD.map(|(_, word)| word));
    assert_eq!(found[3], active_crc);
    assert!(bench.write(index::TUNING, UNDO, &[2]).is_err());
    undo(&mut bench).unwrap();
    assert_eq!((in_use(&mut bench), record(&mut bench)), (OLD, [0; 6]));
    assert_eq!(bench.number(index::COMMIT, 1), found[2]);
    assert_eq!(undo(&mut bench), Err(STATE_REFUSED), "the record is empty");
    assert_eq!(in_use(&mut bench), OLD);
    // Without a save, a restart loads the tuned set, and it can be undone again.
    let mut bench = start(bench.driver.joint.into_flash());
    assert_eq!((in_use(&mut bench), record(&mut bench)), (NEW, found));
    undo(&mut bench).unwrap();
    save(&mut bench).unwrap();
    let mut bench = start(bench.driver.joint.into_flash());
    assert_eq!((in_use(&mut bench), record(&mut bench)), (OLD, [0; 6]));
    // The next tuning begins as the first one.
    tune(&mut bench);
    save(&mut bench).unwrap();
    let mut bench = start(bench.driver.joint.into_flash());
    undo(&mut bench).unwrap();
    assert_eq!(in_use(&mut bench), OLD);
}

#[test]
fn record_written_in_a_trial_is_stored_by_its_end_and_returns_with_the_set() {
    let mut bench = start(before());
    record_on_trial(&mut bench);
    assert_eq!(record(&mut bench)[0], RECORD[0].1);
    order(&mut bench, RETURN).unwrap();
    assert_eq!((in_use(&mut bench), record(&mut bench)), (OLD, [0; 6]));

    record_on_trial(&mut bench);
    order(&mut bench, KEEP_AND_SAVE).unwrap();
    let found = record(&mut bench);
    let mut bench = start(bench.driver.joint.into_flash());
    assert_eq!((in_use(&mut bench), record(&mut bench)), (NEW, found));
    // A later trial that returns leaves the stored record.
    open(&mut bench, 1000).unwrap();
    bench.write(index::TUNING, 1, &7u32.to_le_bytes()).unwrap();
    bench.pass_ms(1000);
    assert_eq!((trial_state(&mut bench), record(&mut bench)), (4, found));
    undo(&mut bench).expect("the set before is in the former block");
    assert_eq!(in_use(&mut bench), OLD);
}

/// Saves with the power cut at every step, and passes what a restart finds to `check`.
fn cut_everywhere(
    flash: &Flash,
    prepare: impl Fn(&mut Bench),
    check: impl FnMut(&mut Bench, bool, &str),
) {
    cut_everywhere_in(flash, prepare, save, check);
}

/// The same for another way to save.
fn cut_everywhere_in(
    flash: &Flash,
    prepare: impl Fn(&mut Bench),
    save: impl Fn(&mut Bench) -> Result<(), u32>,
    mut check: impl FnMut(&mut Bench, bool, &str),
) {
    for torn in torn_steps() {
        for step in 0.. {
            let mut cut = flash.clone();
            cut.cut_power(step, torn);
            let mut bench = start(cut);
            prepare(&mut bench);
            let saved = save(&mut bench);
            let mut flash = bench.driver.joint.into_flash();
            let was_cut = !flash.has_power();
            assert_eq!(saved.is_err(), was_cut);
            flash.power_on();
            check(&mut start(flash), was_cut, &format!("{torn:?} at step {step}"));
            if !was_cut {
                assert!(step > 100, "{step} steps");
                break;
            }
        }
    }
}

#[test]
fn power_cut_in_the_save_of_a_tuning_leaves_the_old_or_the_new_set_with_its_undo() {
    let mut found = [0; 2];
    cut_everywhere(&before(), tune, |bench, was_cut, case| {
        let is_new = in_use(bench) == NEW;
        found[usize::from(is_new)] += 1;
        assert!(was_cut || is_new, "{case}");
        if is_new {
            assert_eq!(record(bench)[0], RECORD[0].1, "{case}");
            undo(bench).expect(case);
        } else {
            assert_eq!(record(bench), [0; 6], "{case}");
        }
        assert_eq!(in_use(bench), OLD, "{case}");
    });
    assert!(found.iter().all(|count| *count > 5), "{found:?}");
}

#[test]
fn power_cut_while_a_trial_is_kept_and_saved_leaves_the_old_or_the_new_set_with_its_undo() {
    let mut found = [0; 2];
    let keep = |bench: &mut Bench| order(bench, KEEP_AND_SAVE);
    cut_everywhere_in(&before(), record_on_trial, keep, |bench, was_cut, case| {
        let is_new = in_use(bench) == NEW;
        found[usize::from(is_new)] += 1;
        assert!(was_cut || is_new, "{case}");
        if is_new {
            assert_eq!(record(bench)[0], RECORD[0].1, "{case}");
            undo(bench).expect(case);
        }
        assert_eq!((in_use(bench), record(bench)), (OLD, [0; 6]), "{case}");
    });
    assert!(found.iter().all(|count| *count > 5), "{found:?}");
}

/// Orders to keep and save on a flash that fails at this step, and requires that the trial stays open. Returns true if the
/// order needs fewer steps.
fn save_on_failing_flash(step: u32, torn: TornStep, is_repeated: bool) -> bool {
    let case = format!("{torn:?} at step {step}, repeated: {is_repeated}");
    let mut flash = before();
    flash.cut_power(step, torn);
    let mut bench = start(flash);
    record_on_trial(&mut bench);
    if order(&mut bench, KEEP_AND_SAVE).is_ok() {
        return true;
    }
    bench.driver.joint.flash_mut().power_on();
    assert_eq!((trial_state(&mut bench), in_use(&mut bench)), (1, NEW), "{case}");
    let expected = if is_repeated {
        order(&mut bench, KEEP_AND_SAVE).expect(&case);
        NEW
    } else {
        bench.pass_ms(1000);
        assert_eq!(trial_state(&mut bench), 4, "{case}");
        assert_eq!((in_use(&mut bench), record(&mut bench)), (OLD, [0; 6]), "{case}");
        save(&mut bench).expect(&case);
        OLD
    };
    assert_eq!(in_use(&mut start(bench.driver.joint.into_flash())), expected, "{case}");
    false
}

/// The flash fails, and the driver does not: the deadline or a second order ends the trial.
#[test]
fn flash_that_fails_while_a_trial_is_kept_and_saved_leaves_the_trial_open() {
    for torn in torn_steps() {
        let steps = (0..).take_while(|step| {
            !([false, true].map(|is_repeated| save_on_failing_flash(*step, torn, is_repeated)))
                .contains(&true)
        });
        let steps = steps.count();
        assert!(steps > 100, "{steps} steps");
    }
}

/// The save of an undo takes the place of the tuned set: the former one is intact throughout.
#[test]
fn power_cut_in_the_save_of_an_undo_leaves_the_old_set_or_its_undo() {
    let mut found = [0; 2];
    let flash = tuned();
    cut_everywhere(
        &flash,
        |bench| undo(bench).unwrap(),
        |bench, was_cut, case| {
            let is_new = in_use(bench) == NEW;
            found[usize::from(is_new)] += 1;
            assert!(was_cut || !is_new, "{case}");
            if is_new {
                undo(bench).expect(case);
            }
            assert_eq!((in_use(bench), record(bench)), (OLD, [0; 6]), "{case}");
            save(bench).expect(case);
            let flash = bench.driver.joint.flash().clone();
            assert_eq!(in_use(&mut start(flash)), OLD, "{case}");
        },
    );
    assert!(found[0] > 500 && found[1] > 0, "{found:?}");
}

/// Requires that an undo is refused, and that nothing changes.
fn assert_refused(bench: &mut Bench, case: &str) {
    let before = (in_use(bench), record(bench));
    assert_eq!(undo(bench), Err(STATE_REFUSED), "{case}");
    bench.check_refusal("undo without the former set", &[]);
    assert_eq!((in_use(bench), record(bench)), before, "{case}");
    let crcs = (bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
    assert_eq!(crcs.0, crcs.1, "{case}");
}

#[test]
fn undo_without_the_former_set_in_the_flash_is_refused() {
    assert_refused(&mut Bench::on_sensors(), "never tuned");

    let mut bench = start(tuned());
    set_gain(&mut bench, 9_000);
    save(&mut bench).unwrap();
    assert_refused(&mut bench, "a second save");

    let mut bench = Bench::on_sensors();
    tune(&mut bench);
    save(&mut bench).unwrap();
    assert_refused(&mut bench, "the first save");

    let mut bench = start(before());
    tune(&mut bench);
    bench.write(index::OPERATION, 6, &[9]).unwrap();
    save(&mut bench).unwrap();
    assert_refused(&mut bench, "another node number");

    let mut bench = start(tuned());
    bench.write(index::TUNING, 3, &7u32.to_le_bytes()).unwrap();
    assert_refused(&mut bench, "another set");

    // The set before is damaged.
    let mut flash = tuned();
    let mut bytes = flash.image().flatten().copied().collect::<Vec<_>>();
    bytes[300] ^= 1;
    flash.restore(&bytes);
    assert_refused(&mut start(flash), "a damaged slot");
}

#[test]
fn undo_is_refused_while_the_joint_is_armed_or_a_trial_is_open() {
    let mut bench = start(tuned());
    open(&mut bench, 1000).unwrap();
    assert_eq!(undo(&mut bench), Err(STATE_REFUSED));
    assert_eq!(in_use(&mut bench), NEW);
    order(&mut bench, KEEP).unwrap();
    let mut bench =
        Bench::boot(InputSource::Bus, bench.driver.joint.into_flash(), &Boot::default());
    bench.sent();
    bench.write(index::OPERATION, 1, &[1]).unwrap();
    bench.start();
    bench.write(index::STATE, 1, &[1]).expect("a joint in HIL");
    assert_eq!(undo(&mut bench), Err(STATE_REFUSED));
    assert_eq!(in_use(&mut bench), NEW);
    bench.write(index::STATE, 1, &[0]).unwrap();
    undo(&mut bench).unwrap();
}

/// What a master sets on a bus is no part of the identity, for which a save writes both slots.
#[test]
fn other_heartbeats_and_deadlines_leave_the_former_set() {
    let mut bench = start(before());
    tune(&mut bench);
    bench.write(index::HEARTBEAT, 0, &200u16.to_le_bytes()).unwrap();
    bench.write(index::AWAITED_HEARTBEAT, 1, &(9u32 << 16 | 50).to_le_bytes()).unwrap();
    bench.write(index::RECEIVE_DRIVE, 5, &40u16.to_le_bytes()).unwrap();
    save(&mut bench).unwrap();
    undo(&mut bench).expect("the former set");
    assert_eq!(in_use(&mut bench), OLD);
}
