//! The trend of learnt levels: power cuts, torn entries, a full journal, saves and updates.

use super::{IDENTITY, payload, torn_variants};
use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES, TornStep};
use firmware::store::{
    ENTRY_BYTES, HOME_RECORD_BYTES, HOME_RECORDS, Identity, LastEntry, MAX_PAYLOAD, SavePlace,
    Store, StoreError, TrendEntry,
};
use std::ops::Range;

type Flash = MemoryFlash<4>;
/// Length of the stored set: it leaves room for few entries, so that the journal is soon full.
const LENGTH: usize = MAX_PAYLOAD;
/// Places of a slot of two pages beside that set, the header, the records of the home and the copy of the identity.
const PLACES: u32 = (2 * PAGE_BYTES - 24 - LENGTH - HOME_RECORDS * HOME_RECORD_BYTES - 48) as u32
    / ENTRY_BYTES as u32;
/// Time between two entries of these tests, in units of 10 s.
const PERIOD: u32 = 90;

fn set(seed: u8) -> Vec<u8> {
    payload(seed, LENGTH)
}

fn entry(number: u32) -> TrendEntry {
    TrendEntry {
        learnt: PERIOD * number,
        deviation_permille: 12,
        level_nm: 4.0 + 0.01 * number as f32,
        level_permille: 1000 + number as u16,
        viscous_permille: 990,
        term: 5,
        term_gain: 612,
    }
}

/// Returns the numbers of all intact entries, as a host reads them.
fn numbers<F: NorFlash>(store: &mut Store<F>) -> Vec<u32> {
    let mut bytes = vec![0; store.trend_length()];
    // Segments of an upload have seven bytes.
    for (at, part) in (0..).step_by(7).zip(bytes.chunks_mut(7)) {
        store.read_trend(at, part);
    }
    let parsed = bytes.as_chunks().0.iter().filter_map(TrendEntry::parse);
    let numbers: Vec<u32> = parsed.clone().map(|found| found.learnt / PERIOD).collect();
    parsed.zip(&numbers).for_each(|(found, number)| assert_eq!(found, entry(*number)));
    numbers
}

fn start(flash: &Flash) -> Store<Flash> {
    let mut store = Store::open(flash.clone());
    store.restore_trend(Default::default());
    store
}

fn last_entry(store: &mut Store<Flash>) -> LastEntry {
    store.restore_trend(Default::default())
}

fn load(store: &mut Store<Flash>) -> Vec<u8> {
    let mut bytes = [0; MAX_PAYLOAD];
    let loaded = store.load(&mut bytes).expect("a set");
    bytes[..loaded.length].to_vec()
}

/// Returns flash with two saved sets and this number of entries.
fn flash_with(entries: u32) -> Flash {
    let mut store = Store::open(Flash::new());
    store.save(&set(1), &IDENTITY).unwrap();
    store.save(&set(2), &IDENTITY).unwrap();
    (1..=entries).for_each(|number| store.append_trend(&entry(number), true).unwrap());
    store.into_flash()
}

#[test]
fn entry_with_any_flipped_bit_is_no_entry() {
    let bytes = entry(7).emit();
    assert_eq!(TrendEntry::parse(&bytes), Some(entry(7)));
    for bit in 0..8 * ENTRY_BYTES {
        let mut flipped = bytes;
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(TrendEntry::parse(&flipped), None, "bit {bit}");
    }
    assert_eq!(TrendEntry::parse(&[0; ENTRY_BYTES]), None);
    assert_eq!(TrendEntry::parse(&[0xFF; ENTRY_BYTES]), None);
}

#[test]
fn entry_survives_a_restart_and_needs_no_erase() {
    let before = flash_with(0);
    let mut store = start(&before);
    assert_eq!((store.trend_length(), last_entry(&mut store)), (0, LastEntry::default()));
    for number in 1..=3 {
        let steps = store.flash().steps();
        store.append_trend(&entry(number), false).unwrap();
        assert_eq!(store.flash().steps() - steps, 2, "two double words");
    }
    for page in 0..4 {
        assert_eq!(store.flash().erases(page), before.erases(page));
    }
    let mut store = start(&store.into_flash());
    assert_eq!(numbers(&mut store), [1, 2, 3]);
    let last = LastEntry { learnt: entry(3).learnt, level_nm: entry(3).level_nm };
    assert_eq!(last_entry(&mut store), last);
    assert_eq!(load(&mut store), set(2));
}

#[test]
fn power_cut_in_an_entry_loses_at_most_that_entry() {
    let before = flash_with(3);
    for torn in torn_variants() {
        for step in 0..2 {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = start(&flash);
            assert_eq!(store.append_trend(&entry(4), true), Err(StoreError::Slots));
            let mut flash = store.into_flash();
            flash.power_on();
            let mut store = start(&flash);
            let is_complete = step == 1 && torn == TornStep::Done;
            let kept: &[u32] = if is_complete { &[1, 2, 3, 4] } else { &[1, 2, 3] };
            assert_eq!(numbers(&mut store), kept, "{torn:?} in step {step}");
            assert_eq!(load(&mut store), set(2));
            store.append_trend(&entry(5), true).unwrap();
            assert_eq!(numbers(&mut store), [kept, &[5]].concat(), "{torn:?} in step {step}");
        }
    }
}

/// Saves in this place with a power cut at each step. Afterwards the trend must be complete.
fn cut_save(place: SavePlace, identity: Identity) {
    let entries = PLACES / 2;
    let before = flash_with(entries);
    let all: Vec<u32> = (1..=entries).collect();
    let mut whole = before.clone();
    let steps = {
        let mut store = start(&whole);
        store.save_at(place, &set(3), &identity).unwrap();
        assert_eq!(numbers(&mut store), all, "a save keeps the trend");
        whole = store.into_flash();
        whole.steps() - before.steps()
    };
    assert_eq!(numbers(&mut start(&whole)), all);
    for torn in [TornStep::Nothing, TornStep::Partly(3), TornStep::Unreadable(4), TornStep::Done] {
        for step in 0..steps {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = start(&flash);
            let _ = store.save_at(place, &set(3), &identity);
            let mut flash = store.into_flash();
            assert!(!flash.has_power());
            flash.power_on();
            let mut store = start(&flash);
            assert_eq!(numbers(&mut store), all, "{torn:?} in step {step} of {steps}");
            let loaded = load(&mut store);
            let is_former = place == SavePlace::Newest && loaded == set(1);
            let is_known = is_former || loaded == set(2) || loaded == set(3);
            assert!(is_known, "{torn:?} in step {step}");
            // The next save moves the completed trend.
            store.save(&set(4), &identity).unwrap();
            assert_eq!(numbers(&mut start(&store.into_flash())), all, "{torn:?} in step {step}");
        }
    }
}

#[test]
fn power_cut_in_a_save_keeps_the_whole_trend() {
    cut_save(SavePlace::Former, IDENTITY);
}

#[test]
fn power_cut_in_a_save_after_an_undo_keeps_the_whole_trend() {
    cut_save(SavePlace::Newest, IDENTITY);
}

#[test]
fn power_cut_in_a_save_of_another_identity_keeps_the_whole_trend() {
    cut_save(SavePlace::Former, [0x3C; 36]);
}

#[test]
fn full_journal_is_thinned_to_equal_distances() {
    let entries = 20 * PLACES;
    let flash = flash_with(entries);
    let mut store = start(&flash);
    let found = numbers(&mut store);
    let (half, count) = (PLACES as usize / 2, found.len());
    assert!((half..=PLACES as usize).contains(&count), "{count} entries in {PLACES} places");
    assert_eq!((found[0], found[count - 1]), (1, entries), "the first and the newest stay");
    // Every part of the time has entries: the largest distance is some of the mean one of a thinned journal.
    let largest = found.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    assert!(largest <= 4 * entries / half as u32, "{largest} in {found:?}");
    // Each erase makes room for about half of the places.
    let erases: u32 = (0..4).map(|page| flash.erases(page)).sum();
    let before: u32 = (0..4).map(|page| flash_with(0).erases(page)).sum();
    // A slot has two pages.
    let bound = 2 * (entries / (PLACES / 2 - 1) + 1);
    assert!(erases - before <= bound, "{} erases, at most {bound}", erases - before);
    assert_eq!(load(&mut store), set(2));
}

#[test]
fn full_journal_without_permission_to_erase_refuses_entries() {
    let mut store = start(&flash_with(PLACES));
    let steps = store.flash().steps();
    assert_eq!(store.append_trend(&entry(PLACES + 1), false), Err(StoreError::Slots));
    assert_eq!(store.flash().steps(), steps);
    assert_eq!(numbers(&mut store).len() as u32, PLACES);
    // The next save thins it.
    store.save(&set(3), &IDENTITY).unwrap();
    store.append_trend(&entry(PLACES + 1), false).unwrap();
    let kept = numbers(&mut store);
    assert!((PLACES / 2..=PLACES / 2 + 2).contains(&(kept.len() as u32)), "{kept:?}");
}

#[test]
fn power_cut_while_thinning_keeps_set_first_and_newest_entry() {
    let before = flash_with(PLACES);
    let mut flash = before.clone();
    let mut store = start(&flash);
    store.append_trend(&entry(PLACES + 1), true).unwrap();
    flash = store.into_flash();
    let steps = flash.steps() - before.steps();
    for torn in [TornStep::Nothing, TornStep::Garbage(3), TornStep::Unreadable(4), TornStep::Done] {
        for step in 0..steps {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = start(&flash);
            let _ = store.append_trend(&entry(PLACES + 1), true);
            let mut flash = store.into_flash();
            flash.power_on();
            let mut store = start(&flash);
            let found = numbers(&mut store);
            assert_eq!(found[0], 1, "{torn:?} in step {step}");
            assert!(*found.last().unwrap() >= PLACES, "{torn:?} in step {step}: {found:?}");
            assert!(found.len() as u32 >= PLACES / 2, "{torn:?} in step {step}: {found:?}");
            assert!(found.is_sorted(), "{found:?}");
            assert_eq!(load(&mut store), set(2), "{torn:?} in step {step}");
        }
    }
}

#[test]
fn trend_without_a_stored_set_is_refused_and_writes_nothing() {
    let mut store = Store::open(Flash::new());
    assert_eq!(store.append_trend(&entry(1), true), Err(StoreError::Slots));
    assert_eq!((store.flash().steps(), store.trend_length()), (0, 0));
    // Slots that the set fills have no place.
    let mut store = Store::open(MemoryFlash::<2>::new());
    let most = store.max_payload_bytes();
    store.save(&payload(1, most), &IDENTITY).unwrap();
    assert!(store.append_trend(&entry(1), true).is_err());
    let mut bytes = [0; MAX_PAYLOAD];
    assert!(store.load(&mut bytes).is_ok_and(|set| set.length == most));
}

/// Returns the two slots of the store in one of two banks of four pages.
fn bank(number: u32) -> [Range<u32>; 2] {
    let (page, start) = (PAGE_BYTES as u32, 4 * PAGE_BYTES as u32 * number);
    [start..start + 2 * page, start + 2 * page..start + 4 * page]
}

/// Starts an image that runs from this bank.
fn start_from(running: u32, flash: MemoryFlash<8>) -> Store<MemoryFlash<8>> {
    let mut store = Store::open(flash);
    let finds = store.open_mirrored(bank(running), bank(1 - running), |_| Some(IDENTITY));
    store.restore_trend(finds.journals);
    store
}

#[test]
fn trend_follows_updates_to_the_other_bank_and_back() {
    let mut store = start_from(0, MemoryFlash::new());
    store.save(&set(1), &IDENTITY).unwrap();
    let mut number = 0;
    let mut append = |store: &mut Store<MemoryFlash<8>>| {
        for _ in 0..3 {
            number += 1;
            store.append_trend(&entry(number), true).unwrap();
        }
        number
    };
    append(&mut store);
    for running in [1, 0, 1, 0] {
        store = start_from(running, store.into_flash());
        let last = append(&mut store);
        assert_eq!(numbers(&mut store), (1..=last).collect::<Vec<_>>(), "in bank {running}");
        let steps = store.flash().steps();
        store = start_from(running, store.into_flash());
        assert_eq!(store.flash().steps(), steps, "a start with a complete trend writes nothing");
    }
}

#[test]
fn flash_that_fails_refuses_an_entry_and_keeps_the_set() {
    let mut flash = flash_with(2);
    flash.cut_power(0, TornStep::Nothing);
    let mut store = start(&flash);
    let refused = store.append_trend(&entry(3), true).unwrap_err();
    assert!(matches!(refused, StoreError::Slots | StoreError::Flash(NorFlashErrorKind::Other)));
    let mut flash = store.into_flash();
    flash.power_on();
    assert_eq!(numbers(&mut start(&flash)), [1, 2]);
}
