//! The home of a joint at rest: power cuts at each step, saves, full slots, updates and wear.

use super::{IDENTITY, load, payload, torn_variants};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES};
use firmware::store::{
    FoundHome, HOME_RECORDS, HomeRecord, Identity, MAX_PAYLOAD, SavePlace, Store,
};
use std::ops::Range;

type Flash = MemoryFlash<4>;

fn set(seed: u8) -> Vec<u8> {
    payload(seed, MAX_PAYLOAD)
}

fn record(number: u32) -> HomeRecord {
    HomeRecord {
        position_rad: 0.1 * number as f32,
        encoder: number.wrapping_mul(0x9E37_79B9),
        shaft: 77,
        turns: number as u16,
    }
}

/// Returns flash with two saved sets and this number of records, of which only the last is valid.
fn flash_with(records: u32) -> Flash {
    let mut store = Store::open(Flash::new());
    store.save(&set(1), &IDENTITY).unwrap();
    store.save(&set(2), &IDENTITY).unwrap();
    (1..=records).for_each(|number| store.append_home(&record(number), true).unwrap());
    store.into_flash()
}

fn found(flash: &Flash) -> FoundHome {
    Store::open(flash.clone()).find_home()
}

/// Runs an action with a power cut at each of its steps, and passes what it leaves to the check.
fn cut_each_step(
    before: &Flash,
    action: impl Fn(&mut Store<Flash>),
    mut check: impl FnMut(&Flash, &str),
) -> u32 {
    let mut store = Store::open(before.clone());
    action(&mut store);
    let steps = store.flash().steps() - before.steps();
    for torn in torn_variants() {
        for step in 0..steps {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = Store::open(flash);
            action(&mut store);
            let mut flash = store.into_flash();
            assert!(!flash.has_power());
            flash.power_on();
            check(&flash, &format!("{torn:?} in step {step} of {steps}"));
        }
    }
    steps
}

#[test]
fn record_is_found_until_the_joint_may_move() {
    assert_eq!(found(&flash_with(0)), FoundHome::None);
    let mut store = Store::open(flash_with(1));
    assert_eq!(store.find_home(), FoundHome::At(record(1)));
    let steps = store.flash().steps();
    store.mark_home().unwrap();
    assert_eq!(store.flash().steps() - steps, 1, "one double word");
    store.mark_home().unwrap();
    assert_eq!(store.flash().steps() - steps, 1, "a mark is programmed once");
    assert_eq!(found(&store.into_flash()), FoundHome::Lost);
}

#[test]
fn power_cut_in_a_record_finds_it_or_loses_the_home() {
    let mut store = Store::open(flash_with(3));
    store.mark_home().unwrap();
    let mut complete = 0;
    let append = |store: &mut Store<Flash>| _ = store.append_home(&record(4), true);
    let steps = cut_each_step(&store.into_flash(), append, |flash, case| {
        let home = found(flash);
        complete += u32::from(home == FoundHome::At(record(4)));
        assert!(home == FoundHome::Lost || home == FoundHome::At(record(4)), "{home:?}: {case}");
        let mut store = Store::open(flash.clone());
        store.append_home(&record(5), true).unwrap();
        assert_eq!(found(&store.into_flash()), FoundHome::At(record(5)), "{case}");
    });
    assert_eq!((steps, complete), (2, 1));
}

#[test]
fn power_cut_in_a_mark_keeps_a_joint_that_has_not_moved_or_loses_the_home() {
    let before = flash_with(3);
    cut_each_step(
        &before,
        |store| _ = store.mark_home(),
        |flash, case| {
            let home = found(flash);
            let is_kept = home == FoundHome::At(record(3));
            assert_eq!(is_kept, case.starts_with("Nothing"), "{home:?}: {case}");
            let mut store = Store::open(flash.clone());
            store.mark_home().unwrap();
            assert_eq!(found(&store.into_flash()), FoundHome::Lost, "{case}");
        },
    );
}

/// Saves with a power cut at each step, at rest and after a mark.
fn cut_save(place: SavePlace, identity: Identity) {
    let save = |store: &mut Store<Flash>| _ = store.save_at(place, &set(3), &identity);
    let valid = flash_with(3);
    cut_each_step(&valid, save, |flash, case| {
        let home = found(flash);
        let is_right = home == FoundHome::At(record(3));
        assert!(is_right || matches!(home, FoundHome::Lost | FoundHome::None), "{home:?}: {case}");
    });
    let mut store = Store::open(valid);
    store.mark_home().unwrap();
    cut_each_step(&store.into_flash(), save, |flash, case| {
        let home = found(flash);
        assert!(matches!(home, FoundHome::Lost | FoundHome::None), "{home:?}: {case}");
    });
}

#[test]
fn power_cut_in_a_save_shows_no_wrong_home() {
    cut_save(SavePlace::Former, IDENTITY);
    cut_save(SavePlace::Newest, IDENTITY);
    cut_save(SavePlace::Former, [0x3C; 36]);
}

#[test]
fn record_survives_a_save_and_is_marked_in_the_former_slot() {
    let mut store = Store::open(flash_with(3));
    store.save(&set(3), &IDENTITY).unwrap();
    assert_eq!(store.find_home(), FoundHome::At(record(3)));
    store.mark_home().unwrap();
    assert_eq!(found(&store.into_flash()), FoundHome::Lost);
}

#[test]
fn damage_of_the_current_set_shows_no_older_home() {
    let mut store = Store::open(flash_with(3));
    store.save(&set(3), &IDENTITY).unwrap();
    store.append_home(&record(4), true).unwrap();
    let mut flash = store.into_flash();
    // Sets 1 and 3 are in the first slot.
    flash.flip_bit(8 * 40);
    assert_eq!(found(&flash), FoundHome::Lost);
}

#[test]
fn full_slot_is_renewed_with_set_and_home_or_refused() {
    let before = flash_with(HOME_RECORDS as u32);
    let next = record(HOME_RECORDS as u32 + 1);
    let mut store = Store::open(before.clone());
    store.append_home(&next, false).unwrap_err();
    assert_eq!(found(&store.into_flash()), FoundHome::Lost);
    let mut store = Store::open(before.clone());
    store.append_home(&next, true).unwrap();
    assert_eq!(store.find_home(), FoundHome::At(next));
    assert_eq!(load(&mut store), Ok(set(2)));
    cut_each_step(
        &before,
        |store| _ = store.append_home(&next, true),
        |flash, case| {
            let home = found(flash);
            let last = FoundHome::At(record(HOME_RECORDS as u32));
            let is_unmarked = case.starts_with("Nothing in step 0 ");
            let is_right = home == FoundHome::At(next) || home == last && is_unmarked;
            assert!(is_right || home == FoundHome::Lost, "{home:?}: {case}");
            assert_eq!(load(&mut Store::open(flash.clone())), Ok(set(2)), "{case}");
        },
    );
}

#[test]
fn slot_of_one_page_and_flash_without_a_set_have_no_record() {
    let mut store = Store::open(MemoryFlash::<2>::new());
    store.append_home(&record(1), true).unwrap_err();
    store.save(&payload(1, 300), &IDENTITY).unwrap();
    store.append_home(&record(1), true).unwrap_err();
    assert_eq!(store.find_home(), FoundHome::None);
}

/// Plausible use: armed 50 times on each day, with a pause after each.
#[test]
fn year_of_fifty_armings_a_day_erases_a_page_less_than_500_times() {
    const ENDURANCE: u32 = 10_000;
    let mut store = Store::open(flash_with(0));
    let before: Vec<u32> = (0..4).map(|page| store.flash().erases(page)).collect();
    let armings = 50 * 365;
    for number in 0..armings {
        store.append_home(&record(number), true).unwrap();
        store.mark_home().unwrap();
    }
    for (page, before) in before.into_iter().enumerate() {
        let erases = store.flash().erases(page) - before;
        assert!((400..500).contains(&erases), "{erases} erases of page {page} in a year");
        assert!(ENDURANCE / erases >= 20, "years");
    }
}

/// Returns the two slots of the store in one of two banks of four pages.
fn bank(number: u32) -> [Range<u32>; 2] {
    let (page, start) = (PAGE_BYTES as u32, 4 * PAGE_BYTES as u32 * number);
    [start..start + 2 * page, start + 2 * page..start + 4 * page]
}

/// Starts an image that runs from this bank.
fn start_from(running: u32, flash: MemoryFlash<8>) -> (Store<MemoryFlash<8>>, FoundHome) {
    let mut store = Store::open(flash);
    let finds = store.open_mirrored(bank(running), bank(1 - running), |_| Some(IDENTITY));
    (store, finds.home)
}

#[test]
fn home_follows_updates_and_none_becomes_valid_again() {
    let (mut store, home) = start_from(0, MemoryFlash::new());
    assert_eq!(home, FoundHome::None);
    store.save(&set(1), &IDENTITY).unwrap();
    for (number, running) in (1..).zip([1, 0, 1, 0, 1]) {
        store.append_home(&record(number), true).unwrap();
        let home;
        (store, home) = start_from(running, store.into_flash());
        assert_eq!(home, FoundHome::At(record(number)), "update to bank {running}");
        // Without a new record, the joint may have moved since.
        let home;
        (store, home) = start_from(running, store.into_flash());
        assert!(!matches!(home, FoundHome::At(_)), "{home:?} after a start from bank {running}");
        let home;
        (store, home) = start_from(1 - running, store.into_flash());
        assert!(!matches!(home, FoundHome::At(_)), "{home:?} after a return from bank {running}");
        (store, _) = start_from(running, store.into_flash());
    }
}
