//! Tests of the parameter store: power cuts, bit rot and wear.
//!
//! A save is interrupted at each step, with each result of a torn step and from several initial states.
//! Afterwards the store must hold the old or the new set completely and must accept further saves.

mod flashes;
mod home;
mod identity;
mod layout;
mod memory;
mod trend;

use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind};
use firmware::store::image::{PAYLOAD_AT, UNIT_BYTES};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES, TornStep};
use firmware::store::{
    IDENTITY_BYTES, Identity, LoadError, MAX_PAYLOAD, SaveOutcome, SlotState, Store, StoreError,
    StoreHealth,
};
use flashes::{Shared, Words, Worn};
use proptest::prelude::*;

/// Length of a parameter record, bytes; not a multiple of a double word.
const LENGTH: usize = 301;
/// Identity that is saved with every set.
const IDENTITY: Identity = [0xA5; IDENTITY_BYTES];
/// Double words of the copy of an identity.
const COPY_STEPS: u32 = 6;

fn payload(seed: u8, length: usize) -> Vec<u8> {
    (0..length).map(|index| (index as u8).wrapping_mul(31).wrapping_add(seed)).collect()
}

fn load<F: NorFlash>(store: &mut Store<F>) -> Result<Vec<u8>, LoadError> {
    let mut bytes = [0; MAX_PAYLOAD];
    store.load(&mut bytes).map(|loaded| bytes[..loaded.length].to_vec())
}

/// Loads the set that a start would find.
fn load_at_start<const PAGES: usize>(flash: &MemoryFlash<PAGES>) -> Result<Vec<u8>, LoadError> {
    load(&mut Store::open(flash.clone()))
}

fn torn_variants() -> Vec<TornStep> {
    let mut variants =
        vec![TornStep::Nothing, TornStep::FirstHalf, TornStep::LastHalf, TornStep::Done];
    for seed in 0..6 {
        variants.extend([
            TornStep::Partly(seed),
            TornStep::Garbage(seed),
            TornStep::Unreadable(seed),
        ]);
    }
    variants
}

/// Returns flash after this number of saves of different sets.
fn flash_after_saves<const PAGES: usize>(saves: u8) -> MemoryFlash<PAGES> {
    let mut store = Store::open(MemoryFlash::new());
    for seed in 1..=saves {
        let written = store.save(&payload(seed, LENGTH - usize::from(seed)), &IDENTITY).unwrap();
        assert!(
            matches!(written, SaveOutcome::Written { sequence, .. } if sequence == u32::from(seed))
        );
    }
    store.into_flash()
}

fn cut_everywhere<const PAGES: usize>(saves: u8) -> usize {
    let before = flash_after_saves::<PAGES>(saves);
    let old = load_at_start(&before);
    let new = payload(200, LENGTH);
    let commit = (PAGES / 2 + 2 + LENGTH.div_ceil(UNIT_BYTES)) as u32;
    // The first save writes both slots, because none has the identity yet.
    let steps = (commit + 1 + COPY_STEPS) * if saves == 0 { 2 } else { 1 };
    let (mut cuts, mut kept, mut taken) = (0, 0, 0);
    for torn in torn_variants() {
        for step in 0..steps {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = Store::open(flash);
            let error = store.save(&new, &IDENTITY).expect_err("the power is cut");
            assert!(
                matches!(error, StoreError::Flash(NorFlashErrorKind::Other)),
                "{torn:?} in step {step}: {error}"
            );
            let mut flash = store.into_flash();
            assert!(!flash.has_power());
            flash.power_on();
            match load_at_start(&flash) {
                Ok(set) if set == new => {
                    assert!(step >= commit, "{torn:?} in step {step}");
                    taken += 1;
                }
                other => {
                    assert!(step <= commit, "{torn:?} in step {step}");
                    match (&old, &other) {
                        (Err(_), Err(LoadError::Empty | LoadError::Damaged)) => (),
                        _ => assert_eq!(other, old, "{torn:?} in step {step} after {saves} saves"),
                    }
                    kept += 1;
                }
            }
            // The next two saves succeed from any remains.
            let mut store = Store::open(flash);
            for seed in [201, 202] {
                let next = payload(seed, LENGTH);
                assert!(
                    matches!(store.save(&next, &IDENTITY), Ok(SaveOutcome::Written { .. })),
                    "{torn:?} {step}"
                );
                assert_eq!(load(&mut store), Ok(next));
            }
            assert_eq!(store.health(), StoreHealth::Sound);
            cuts += 1;
        }
    }
    // Both results occur, which confirms that the cuts cover the whole save.
    assert!(kept > 0 && taken > 0, "{kept} {taken}");
    // One step later the save is complete.
    let mut flash = before;
    flash.cut_power(steps, TornStep::Nothing);
    let mut store = Store::open(flash);
    assert!(store.save(&new, &IDENTITY).is_ok());
    assert_eq!(load(&mut store), Ok(new));
    cuts
}

#[test]
fn power_cut_in_any_step_leaves_the_old_or_the_new_set() {
    let mut cuts = 0;
    for saves in [0, 1, 2, 3, 7] {
        cuts += cut_everywhere::<2>(saves);
        // Slots of three pages: an erase is more than one step.
        cuts += cut_everywhere::<6>(saves);
    }
    println!("{cuts} cuts");
    assert!(cuts > 8000);
}

#[derive(Clone, Debug)]
struct Operation {
    seed: u8,
    length: usize,
    cut: Option<(u32, TornStep)>,
}

fn operation() -> impl Strategy<Value = Operation> {
    let torn = (0_u8..6, any::<u32>()).prop_map(|(kind, seed)| match kind {
        0 => TornStep::Nothing,
        1 => TornStep::FirstHalf,
        2 => TornStep::LastHalf,
        3 => TornStep::Partly(seed),
        4 => TornStep::Unreadable(seed),
        _ => TornStep::Done,
    });
    // The longest set has 389 steps: some cuts hit this save, some the next, some none.
    let cut = proptest::option::of((0_u32..470, torn));
    (any::<u8>(), 0..=MAX_PAYLOAD, cut).prop_map(|(seed, length, cut)| Operation {
        seed,
        length,
        cut,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    #[test]
    fn random_saves_and_cuts_never_lose_a_set(
        operations in proptest::collection::vec(operation(), 1..20)
    ) {
        let mut flash = MemoryFlash::<4>::new();
        let mut current: Option<Vec<u8>> = None;
        for Operation { seed, length, cut } in operations {
            if let Some((step, torn)) = cut {
                flash.cut_power(step, torn);
            }
            let new = payload(seed, length);
            let mut store = Store::open(flash);
            let result = store.save(&new, &IDENTITY);
            flash = store.into_flash();
            prop_assert_eq!(result.is_ok(), flash.has_power());
            flash.power_on();
            match load_at_start(&flash) {
                Ok(set) => {
                    let allowed = set == new || (result.is_err() && Some(&set) == current.as_ref());
                    prop_assert!(allowed, "{:?}", result);
                    current = Some(set);
                }
                Err(error) => {
                    prop_assert!(current.is_none() && result.is_err(), "{error:?}");
                }
            }
        }
    }

    #[test]
    fn open_with_random_bytes_reports_damage_and_writes_nothing(
        mut image in proptest::collection::vec(any::<u8>(), 2 * PAGE_BYTES), magic: bool, seed: u8
    ) {
        if magic {
            image[..4].copy_from_slice(b"JSET");
            image[PAGE_BYTES..PAGE_BYTES + 4].copy_from_slice(b"JSET");
        }
        let mut flash = MemoryFlash::<2>::new();
        flash.restore(&image);
        let mut store = Store::open(flash);
        prop_assert_eq!(store.health(), StoreHealth::Damaged);
        prop_assert_eq!(load(&mut store), Err(LoadError::Damaged));
        prop_assert_eq!(store.flash().steps(), 0);
        let new = payload(seed, LENGTH);
        prop_assert!(store.save(&new, &IDENTITY).is_ok());
        prop_assert_eq!(load(&mut store), Ok(new));
    }
}

#[test]
fn flipped_bit_in_newer_set_loads_the_older_set() {
    let two = flash_after_saves::<2>(2);
    let older = payload(1, LENGTH - 1);
    let newer = payload(2, LENGTH - 2);
    assert_eq!(load_at_start(&two), Ok(newer.clone()));
    let bytes = PAYLOAD_AT as usize + newer.len().next_multiple_of(UNIT_BYTES);
    for bit in 0..bytes * 8 {
        let mut flash = two.clone();
        flash.flip_bit(PAGE_BYTES * 8 + bit);
        let mut store = Store::open(flash);
        assert_eq!(load(&mut store), Ok(older.clone()), "bit {bit}");
        assert_eq!(store.health(), StoreHealth::Reduced, "bit {bit}");
        // Saving the loaded set again writes a second copy.
        assert!(matches!(
            store.save(&older, &IDENTITY),
            Ok(SaveOutcome::Written { slot: 1, sequence: 2 })
        ));
        assert_eq!((load(&mut store), store.health()), (Ok(older.clone()), StoreHealth::Sound));
    }
    // Bits outside the image have no effect.
    let mut flash = two;
    flash.flip_bit((PAGE_BYTES + bytes) * 8);
    assert_eq!(load_at_start(&flash), Ok(newer));
    // Without a second set, nothing can be loaded.
    let one = flash_after_saves::<2>(1);
    for bit in 0..bytes * 8 {
        let mut flash = one.clone();
        flash.flip_bit(bit);
        flash.flip_bit(PAGE_BYTES * 8 + bit);
        let mut store = Store::open(flash);
        assert_eq!(
            (load(&mut store), store.health()),
            (Err(LoadError::Damaged), StoreHealth::Damaged)
        );
    }
}

#[test]
fn bit_flipped_while_running_is_found_by_the_next_load() {
    let shared = Shared::default();
    shared.good_reads.set(u32::MAX);
    *shared.flash.borrow_mut() = flash_after_saves::<2>(2);
    let mut store = Store::open(shared.clone());
    assert_eq!(
        (load(&mut store), store.health()),
        (Ok(payload(2, LENGTH - 2)), StoreHealth::Sound)
    );
    shared.flash.borrow_mut().flip_bit((PAGE_BYTES + 100) * 8);
    assert_eq!(load(&mut store), Ok(payload(1, LENGTH - 1)));
    assert_eq!(store.health(), StoreHealth::Reduced);
}

#[test]
fn read_failure_while_copying_loads_the_other_set() {
    // The inspection before the copy takes some reads. Wherever reading fails, an intact set is loaded.
    let older = payload(1, LENGTH - 1);
    let newer = payload(2, LENGTH - 2);
    let (mut first, mut second) = (0, 0);
    for good_reads in 0..400 {
        let shared = Shared::default();
        *shared.flash.borrow_mut() = flash_after_saves::<2>(2);
        shared.good_reads.set(u32::MAX);
        let mut store = Store::open(shared.clone());
        shared.good_reads.set(good_reads);
        let set = load(&mut store).unwrap();
        assert!(set == older || set == newer);
        if set == older {
            assert_eq!(store.slots()[1], SlotState::Damaged);
            first += 1;
        } else {
            second += 1;
        }
    }
    assert!(first > 80 && second > 80, "{first} {second}");
}

#[test]
fn empty_incomplete_and_damaged_slots_are_distinguished() {
    let mut store = Store::open(MemoryFlash::<2>::new());
    assert_eq!(store.slots(), [SlotState::Blank; 2]);
    assert_eq!((load(&mut store), store.health()), (Err(LoadError::Empty), StoreHealth::Empty));

    // A first save cut before its commit: no set was ever saved.
    let mut flash = MemoryFlash::<2>::new();
    flash.cut_power(10, TornStep::Partly(3));
    let mut store = Store::open(flash);
    assert!(store.save(&payload(1, LENGTH), &IDENTITY).is_err());
    let mut flash = store.into_flash();
    flash.power_on();
    let mut store = Store::open(flash);
    assert_eq!(store.slots(), [SlotState::Incomplete, SlotState::Blank]);
    assert_eq!((load(&mut store), store.health()), (Err(LoadError::Empty), StoreHealth::Empty));

    // A later save: the previous set stays valid.
    let mut flash = flash_after_saves::<2>(1);
    flash.cut_power(10, TornStep::Partly(3));
    let mut store = Store::open(flash);
    assert!(store.save(&payload(9, LENGTH), &IDENTITY).is_err());
    let mut flash = store.into_flash();
    flash.power_on();
    let store = Store::open(flash);
    assert_eq!((store.slots()[1], store.health()), (SlotState::Incomplete, StoreHealth::Sound));
}

#[test]
fn save_of_the_current_set_writes_nothing() {
    let mut store = Store::open(flash_after_saves::<2>(2));
    let steps = store.flash().steps();
    let same = payload(2, LENGTH - 2);
    assert_eq!(store.save(&same, &IDENTITY), Ok(SaveOutcome::Unchanged));
    assert_eq!(store.flash().steps(), steps);
    // The older set is not current, so it is written.
    assert_eq!(
        store.save(&payload(1, LENGTH - 1), &IDENTITY),
        Ok(SaveOutcome::Written { slot: 0, sequence: 3 })
    );
    // A prefix or an extension of the current set is a different set.
    let longer = payload(1, LENGTH);
    assert!(matches!(store.save(&longer, &IDENTITY), Ok(SaveOutcome::Written { .. })));
    assert!(matches!(store.save(&longer[..9], &IDENTITY), Ok(SaveOutcome::Written { .. })));
    assert!(matches!(store.save(&[], &IDENTITY), Ok(SaveOutcome::Written { .. })));
    assert_eq!(load(&mut store), Ok(vec![]));
}

#[test]
fn saves_alternate_between_the_slots() {
    // Under Miri ten saves already take most of a minute.
    let saves: u8 = if cfg!(miri) { 10 } else { 100 };
    let mut store = Store::open(MemoryFlash::<2>::new());
    for save in 0..saves {
        store.save(&payload(save, 40), &IDENTITY).unwrap();
    }
    // The first one writes both.
    let each = u32::from(saves / 2);
    assert_eq!([0, 1].map(|page| store.flash().erases(page)), [each, each + 1]);
}

#[test]
fn oversized_payload_and_invalid_slots_are_refused() {
    let mut store = Store::open(MemoryFlash::<4>::new());
    assert_eq!(store.max_payload_bytes(), MAX_PAYLOAD);
    assert!(store.save(&payload(1, MAX_PAYLOAD), &IDENTITY).is_ok());
    let error = store.save(&payload(1, MAX_PAYLOAD + 1), &IDENTITY).unwrap_err();
    assert_eq!(error, StoreError::TooLong { length: 3073, max: 3072 });
    let words = error.to_string();
    crate::message::check("refusals", "parameter set too long", &words, &["3073", "3072"]);
    let mut small = [0; 3071];
    let error = store.load(&mut small).unwrap_err();
    assert_eq!(error, LoadError::TooSmall { needed: 3072, given: 3071 });

    let mut tiny = Store::open(MemoryFlash::<1>::new());
    assert_eq!(load(&mut tiny), Err(LoadError::Empty));
    assert_eq!(tiny.save(b"x", &IDENTITY), Err(StoreError::TooLong { length: 1, max: 0 }));
    let page = PAGE_BYTES as u32;
    for slots in [
        [0..page, 0..page],
        [0..2 * page, page..2 * page],
        [0..8, page..2 * page],
        [0..0, page..2 * page],
        [0..page, page..3 * page],
    ] {
        let refused = Store::open_at(MemoryFlash::<2>::new(), slots).map(|_| ());
        assert_eq!(refused, Err(StoreError::Slots));
    }
    let swapped = Store::open_at(MemoryFlash::<2>::new(), [page..2 * page, 0..page]);
    assert_eq!(
        swapped.unwrap().save(b"x", &IDENTITY),
        Ok(SaveOutcome::Written { slot: 0, sequence: 1 })
    );
}

#[test]
fn worn_cell_is_reported_before_the_commit() {
    let old = payload(1, 64);
    let new = vec![0; 64];
    let nowhere = (usize::MAX, 0);
    let page = PAGE_BYTES as u32;
    for (one, zero, expected) in [
        // In the second slot: a payload bit, a bit of the commit, and a bit that no erase restores.
        ((PAGE_BYTES + 50, 0x10), nowhere, StoreError::NotVerified(page + 48)),
        ((PAGE_BYTES + 16, 0xFF), nowhere, StoreError::NotVerified(page + 16)),
        (nowhere, (PAGE_BYTES + 1000, 1), StoreError::NotErased(page + 1000)),
    ] {
        let mut store = Store::open(Worn { flash: MemoryFlash::new(), one, zero });
        // The first save writes both slots.
        assert_eq!(store.save(&old, &IDENTITY), Err(expected));
        assert_eq!(store.save(&new, &IDENTITY), Err(expected));
        assert_eq!(load(&mut store), Ok(old.clone()));
    }
}

#[test]
fn store_works_on_flash_with_other_page_and_word_sizes() {
    // Five pages: the last one is unused.
    let mut store = Store::open(Words(vec![0xFF; 5 * 512]));
    assert_eq!(store.max_payload_bytes(), 952);
    for seed in 0..5 {
        let set = payload(seed, 952 - usize::from(seed));
        store.save(&set, &IDENTITY).unwrap();
        assert_eq!(load(&mut store), Ok(set));
    }
}

#[test]
fn load_former_without_a_former_set_returns_why() {
    let load_former = |flash: MemoryFlash<2>| {
        let mut bytes = [0; MAX_PAYLOAD];
        Store::open(flash).load_former(&mut bytes).map(|set| bytes[..set.length].to_vec())
    };
    let mut both = flash_after_saves::<2>(3);
    assert_eq!(load_former(both.clone()), Ok(payload(2, LENGTH - 2)));
    let mut small = [0; LENGTH - 3];
    let error = Store::open(both.clone()).load_former(&mut small).unwrap_err();
    assert_eq!(error, LoadError::TooSmall { needed: LENGTH - 2, given: LENGTH - 3 });
    both.flip_bit((PAGE_BYTES + 100) * 8);
    assert_eq!(load_former(both), Err(LoadError::Damaged));
    assert_eq!(load_former(MemoryFlash::new()), Err(LoadError::Empty));
    // The first save writes one set to both slots.
    assert_eq!(load_former(flash_after_saves(1)), Err(LoadError::Empty));
}
