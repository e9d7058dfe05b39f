//! The parameter store against power cuts, rot and wear.
//!
//! A save is cut in every one of its steps, in every way a step can be left, from every kind of
//! beginning; after each the store must hold the old set or the new one, whole, and go on working.

mod flashes;
mod layout;
mod memory;

use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind};
use firmware::store::image::{PAYLOAD_AT, UNIT};
use firmware::store::memory::{MemoryFlash, PAGE, Torn};
use firmware::store::{Health, LoadError, MAX_PAYLOAD, Saved, SlotState, Store, StoreError};
use flashes::{Shared, Words, Worn};
use proptest::prelude::*;

/// As long as a parameter record, and not a whole number of double words.
const LENGTH: usize = 301;

fn payload(seed: u8, length: usize) -> Vec<u8> {
    (0..length).map(|index| (index as u8).wrapping_mul(31).wrapping_add(seed)).collect()
}

fn load<F: NorFlash>(store: &mut Store<F>) -> Result<Vec<u8>, LoadError> {
    let mut bytes = [0; MAX_PAYLOAD];
    store.load(&mut bytes).map(|loaded| bytes[..loaded.length].to_vec())
}

/// What a start would find.
fn found<const PAGES: usize>(flash: &MemoryFlash<PAGES>) -> Result<Vec<u8>, LoadError> {
    load(&mut Store::open(flash.clone()))
}

fn torn_variants() -> Vec<Torn> {
    let mut variants = vec![Torn::Nothing, Torn::FirstHalf, Torn::LastHalf, Torn::Done];
    for seed in 0..6 {
        variants.extend([Torn::Partly(seed), Torn::Garbage(seed), Torn::Unreadable(seed)]);
    }
    variants
}

/// Flash after so many saves of different sets.
fn saved<const PAGES: usize>(saves: u8) -> MemoryFlash<PAGES> {
    let mut store = Store::open(MemoryFlash::new());
    for seed in 1..=saves {
        let written = store.save(&payload(seed, LENGTH - usize::from(seed))).unwrap();
        assert!(matches!(written, Saved::Written { sequence, .. } if sequence == u32::from(seed)));
    }
    store.release()
}

fn cut_everywhere<const PAGES: usize>(saves: u8) -> usize {
    let before = saved::<PAGES>(saves);
    let old = found(&before);
    let new = payload(200, LENGTH);
    let steps = (PAGES / 2 + 2 + LENGTH.div_ceil(UNIT) + 1) as u32;
    let (mut cuts, mut kept, mut taken) = (0, 0, 0);
    for torn in torn_variants() {
        for step in 0..steps {
            let mut flash = before.clone();
            flash.cut(step, torn);
            let mut store = Store::open(flash);
            let error = store.save(&new).expect_err("the power went");
            assert!(
                matches!(error, StoreError::Flash(NorFlashErrorKind::Other)),
                "{torn:?} in step {step}: {error}"
            );
            let mut flash = store.release();
            assert!(!flash.has_power());
            flash.power_on();
            match found(&flash) {
                Ok(set) if set == new => {
                    // Only the last step makes it count.
                    assert_eq!(step, steps - 1, "{torn:?}");
                    taken += 1;
                }
                other => {
                    match (&old, &other) {
                        (Err(_), Err(LoadError::Empty | LoadError::Damaged)) => (),
                        _ => assert_eq!(other, old, "{torn:?} in step {step} after {saves} saves"),
                    }
                    kept += 1;
                }
            }
            // And it goes on: the next two saves count, whatever lies about.
            let mut store = Store::open(flash);
            for seed in [201, 202] {
                let next = payload(seed, LENGTH);
                assert!(matches!(store.save(&next), Ok(Saved::Written { .. })), "{torn:?} {step}");
                assert_eq!(load(&mut store), Ok(next));
            }
            assert_eq!(store.health(), Health::Sound);
            cuts += 1;
        }
    }
    // Both ends happen, or the cut is not where it is meant to be.
    assert!(kept > 0 && taken > 0, "{kept} {taken}");
    // One step later there is nothing left to cut.
    let mut flash = before;
    flash.cut(steps, Torn::Nothing);
    let mut store = Store::open(flash);
    assert!(store.save(&new).is_ok());
    assert_eq!(load(&mut store), Ok(new));
    cuts
}

#[test]
fn a_cut_in_any_step_leaves_the_old_or_the_new_set() {
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
    cut: Option<(u32, Torn)>,
}

fn operation() -> impl Strategy<Value = Operation> {
    let torn = (0_u8..6, any::<u32>()).prop_map(|(kind, seed)| match kind {
        0 => Torn::Nothing,
        1 => Torn::FirstHalf,
        2 => Torn::LastHalf,
        3 => Torn::Partly(seed),
        4 => Torn::Unreadable(seed),
        _ => Torn::Done,
    });
    // The longest set has 389 steps: some cuts come in it, some in the next, some not at all.
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
    fn saves_and_cuts_in_any_order_never_lose_a_set(
        operations in proptest::collection::vec(operation(), 1..20)
    ) {
        let mut flash = MemoryFlash::<4>::new();
        let mut current: Option<Vec<u8>> = None;
        for Operation { seed, length, cut } in operations {
            if let Some((step, torn)) = cut {
                flash.cut(step, torn);
            }
            let new = payload(seed, length);
            let mut store = Store::open(flash);
            let result = store.save(&new);
            flash = store.release();
            prop_assert_eq!(result.is_ok(), flash.has_power());
            flash.power_on();
            match found(&flash) {
                Ok(set) => {
                    let allowed = set == new || (result.is_err() && Some(&set) == current.as_ref());
                    prop_assert!(allowed, "{:?}", result);
                    current = Some(set);
                }
                Err(error) => {
                    prop_assert!(current.is_none() && result.is_err(), "{}", error);
                }
            }
        }
    }

    #[test]
    fn open_takes_any_garbage_and_writes_nothing(
        mut image in proptest::collection::vec(any::<u8>(), 2 * PAGE), magic: bool, seed: u8
    ) {
        if magic {
            image[..4].copy_from_slice(b"JSET");
            image[PAGE..PAGE + 4].copy_from_slice(b"JSET");
        }
        let mut flash = MemoryFlash::<2>::new();
        flash.restore(&image);
        let mut store = Store::open(flash);
        prop_assert_eq!(store.health(), Health::Damaged);
        prop_assert_eq!(load(&mut store), Err(LoadError::Damaged));
        prop_assert_eq!(store.flash().steps(), 0);
        let new = payload(seed, LENGTH);
        prop_assert!(store.save(&new).is_ok());
        prop_assert_eq!(load(&mut store), Ok(new));
    }
}

#[test]
fn any_rotten_bit_is_found_and_the_older_set_stands_in() {
    let two = saved::<2>(2);
    let older = payload(1, LENGTH - 1);
    let newer = payload(2, LENGTH - 2);
    assert_eq!(found(&two), Ok(newer.clone()));
    let bytes = PAYLOAD_AT as usize + newer.len().next_multiple_of(UNIT);
    for bit in 0..bytes * 8 {
        let mut flash = two.clone();
        flash.flip(PAGE * 8 + bit);
        let mut store = Store::open(flash);
        assert_eq!(load(&mut store), Ok(older.clone()), "bit {bit}");
        assert_eq!(store.health(), Health::Reduced, "bit {bit}");
        // Saving the very set that stood in makes a second copy of it instead of sparing the flash.
        assert!(matches!(store.save(&older), Ok(Saved::Written { slot: 1, sequence: 2 })));
        assert_eq!((load(&mut store), store.health()), (Ok(older.clone()), Health::Sound));
    }
    // Beyond the image nothing counts.
    let mut flash = two;
    flash.flip((PAGE + bytes) * 8);
    assert_eq!(found(&flash), Ok(newer));
    // Alone, it is missed.
    let one = saved::<2>(1);
    for bit in 0..bytes * 8 {
        let mut flash = one.clone();
        flash.flip(bit);
        let mut store = Store::open(flash);
        assert_eq!((load(&mut store), store.health()), (Err(LoadError::Damaged), Health::Damaged));
    }
}

#[test]
fn a_bit_that_rots_while_running_is_found_by_the_next_load() {
    let shared = Shared::default();
    shared.good_reads.set(u32::MAX);
    *shared.flash.borrow_mut() = saved::<2>(2);
    let mut store = Store::open(shared.clone());
    assert_eq!((load(&mut store), store.health()), (Ok(payload(2, LENGTH - 2)), Health::Sound));
    shared.flash.borrow_mut().flip((PAGE + 100) * 8);
    assert_eq!(load(&mut store), Ok(payload(1, LENGTH - 1)));
    assert_eq!(store.health(), Health::Reduced);
}

#[test]
fn a_set_that_fails_while_it_is_copied_gives_way_to_the_other() {
    // The looks before the copy take some reads; wherever reading turns bad, a whole set comes out.
    let older = payload(1, LENGTH - 1);
    let newer = payload(2, LENGTH - 2);
    let (mut first, mut second) = (0, 0);
    for good_reads in 0..400 {
        let shared = Shared::default();
        *shared.flash.borrow_mut() = saved::<2>(2);
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
fn empty_incomplete_and_damaged_are_told_apart() {
    let mut store = Store::open(MemoryFlash::<2>::new());
    assert_eq!(store.slots(), [SlotState::Blank; 2]);
    assert_eq!((load(&mut store), store.health()), (Err(LoadError::Empty), Health::Empty));

    // A first save cut before its commit: still nothing was ever saved.
    let mut flash = MemoryFlash::<2>::new();
    flash.cut(10, Torn::Partly(3));
    let mut store = Store::open(flash);
    assert!(store.save(&payload(1, LENGTH)).is_err());
    let mut flash = store.release();
    flash.power_on();
    let mut store = Store::open(flash);
    assert_eq!(store.slots(), [SlotState::Incomplete, SlotState::Blank]);
    assert_eq!((load(&mut store), store.health()), (Err(LoadError::Empty), Health::Empty));

    // A later one: the set before it stands and nothing is wrong.
    let mut flash = saved::<2>(1);
    flash.cut(10, Torn::Partly(3));
    let mut store = Store::open(flash);
    assert!(store.save(&payload(9, LENGTH)).is_err());
    let mut flash = store.release();
    flash.power_on();
    let store = Store::open(flash);
    assert_eq!((store.slots()[1], store.health()), (SlotState::Incomplete, Health::Sound));
}

#[test]
fn the_same_set_is_not_written_again() {
    let mut store = Store::open(saved::<2>(2));
    let steps = store.flash().steps();
    let same = payload(2, LENGTH - 2);
    assert_eq!(store.save(&same), Ok(Saved::Unchanged));
    assert_eq!(store.flash().steps(), steps);
    // The older set is not current, so it is written.
    assert_eq!(store.save(&payload(1, LENGTH - 1)), Ok(Saved::Written { slot: 0, sequence: 3 }));
    // A set the current one begins with is another set, and the other way round.
    let longer = payload(1, LENGTH);
    assert!(matches!(store.save(&longer), Ok(Saved::Written { .. })));
    assert!(matches!(store.save(&longer[..9]), Ok(Saved::Written { .. })));
    assert!(matches!(store.save(&[]), Ok(Saved::Written { .. })));
    assert_eq!(load(&mut store), Ok(vec![]));
}

#[test]
fn slots_wear_alike() {
    // Interpreted ten take 39 s on a busy machine: a hundred alone would be past the stage's 300 s.
    let saves: u8 = if cfg!(miri) { 10 } else { 100 };
    let mut store = Store::open(MemoryFlash::<2>::new());
    for save in 0..saves {
        store.save(&payload(save, 40)).unwrap();
    }
    let each = u32::from(saves / 2);
    assert_eq!([0, 1].map(|page| store.flash().erases(page)), [each, each]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut store = Store::open(MemoryFlash::<4>::new());
    assert_eq!(store.most(), MAX_PAYLOAD);
    assert!(store.save(&payload(1, MAX_PAYLOAD)).is_ok());
    let error = store.save(&payload(1, MAX_PAYLOAD + 1)).unwrap_err();
    assert_eq!(error.to_string(), "a parameter set of 3073 bytes, at most 3072 fit");
    let mut small = [0; 3071];
    let error = store.load(&mut small).unwrap_err();
    assert_eq!(error, LoadError::TooSmall { needed: 3072, given: 3071 });

    let mut tiny = Store::open(MemoryFlash::<1>::new());
    assert_eq!(load(&mut tiny), Err(LoadError::Empty));
    assert_eq!(tiny.save(b"x"), Err(StoreError::TooLong { length: 1, most: 0 }));
    let page = PAGE as u32;
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
    assert_eq!(swapped.unwrap().save(b"x"), Ok(Saved::Written { slot: 0, sequence: 1 }));
}

#[test]
fn worn_cells_are_found_before_the_commit() {
    let old = payload(1, 64);
    let new = vec![0; 64];
    let nowhere = (usize::MAX, 0);
    let page = PAGE as u32;
    for (one, zero, expected) in [
        // In the second slot: a payload bit, a bit of the commit, and one that no erase brings back.
        ((PAGE + 50, 0x10), nowhere, StoreError::NotVerified(page + 48)),
        ((PAGE + 16, 0xFF), nowhere, StoreError::NotVerified(page + 16)),
        (nowhere, (PAGE + 1000, 1), StoreError::NotErased(page + 1000)),
    ] {
        let mut store = Store::open(Worn { flash: MemoryFlash::new(), one, zero });
        store.save(&old).unwrap();
        assert_eq!(store.save(&new), Err(expected));
        assert_eq!(load(&mut store), Ok(old.clone()));
    }
}

#[test]
fn other_flash_serves_too() {
    // Five pages: the odd one is left out.
    let mut store = Store::open(Words(vec![0xFF; 5 * 512]));
    assert_eq!(store.most(), 1000);
    for seed in 0..5 {
        let set = payload(seed, 1000 - usize::from(seed));
        store.save(&set).unwrap();
        assert_eq!(load(&mut store), Ok(set));
    }
}
