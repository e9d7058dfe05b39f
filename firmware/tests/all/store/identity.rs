//! Tests of the copies of the identity: which of them a start finds after lost slots, cut saves and in another bank.

use super::{COPY_STEPS, IDENTITY, LENGTH, flash_after_saves, load, payload, torn_variants};
use firmware::store::image::UNIT_BYTES;
use firmware::store::memory::{MemoryFlash, PAGE_BYTES, TornStep};
use firmware::store::{
    FoundIdentity, IDENTITY_BYTES, Identity, IdentityCopy, SaveOutcome, Store, StoreHealth,
};

const fn copy(sequence: u32, identity: Identity) -> FoundIdentity {
    FoundIdentity::Copy(IdentityCopy { sequence, identity })
}

#[test]
fn save_of_another_identity_replaces_the_copies_in_both_slots() {
    let other: Identity = [0x3C; IDENTITY_BYTES];
    let mut store = Store::open(flash_after_saves::<4>(3));
    assert_eq!(store.find_identity(None), copy(3, IDENTITY));
    let set = payload(9, LENGTH);
    store.save(&set, &other).unwrap();
    let flash = store.into_flash();
    // With any of the two slots lost, the copy is the new one, and the set is the one that was saved with it.
    for slot in [0, 1] {
        let mut bytes: Vec<u8> = flash.image().flatten().copied().collect();
        bytes[slot * 2 * PAGE_BYTES..][..2 * PAGE_BYTES].fill(0x77);
        let mut half = flash.clone();
        half.restore(&bytes);
        let mut store = Store::open(half);
        assert_eq!(store.find_identity(None), copy(4, other), "slot {slot}");
        assert_eq!(load(&mut store), Ok(set.clone()));
    }
}

#[test]
fn save_repeated_after_a_failure_in_the_second_slot_replaces_the_identity_there() {
    let other: Identity = [0x3C; IDENTITY_BYTES];
    let set = payload(9, LENGTH);
    let before = flash_after_saves::<2>(2);
    // Erase, set, commit and copy of the first slot.
    let first = (1 + 2 + LENGTH.div_ceil(UNIT_BYTES)) as u32 + 1 + COPY_STEPS;
    let (mut cuts, mut repeated) = (0, 0);
    for torn in torn_variants() {
        for step in first..2 * first {
            let mut flash = before.clone();
            flash.cut_power(step, torn);
            let mut store = Store::open(flash);
            assert!(store.save(&set, &other).is_err(), "{torn:?} in step {step}");
            let mut flash = store.into_flash();
            flash.power_on();
            let mut store = Store::open(flash);
            let outcome = store.save(&set, &other).expect("the power is back");
            repeated += usize::from(outcome != SaveOutcome::Unchanged);
            let flash = store.into_flash();
            // With any of the two slots lost, the other one has the set and the new identity.
            for slot in [0, 1] {
                let mut bytes: Vec<u8> = flash.image().flatten().copied().collect();
                bytes[slot * PAGE_BYTES..][..PAGE_BYTES].fill(0x77);
                let mut half = flash.clone();
                half.restore(&bytes);
                let mut store = Store::open(half);
                let FoundIdentity::Copy(found) = store.find_identity(None) else {
                    panic!("{torn:?} in step {step}: no identity without slot {slot}")
                };
                assert_eq!(found.identity, other, "{torn:?} in step {step} without slot {slot}");
                assert_eq!(load(&mut store), Ok(set.clone()));
            }
            cuts += 1;
        }
    }
    assert!(repeated > cuts / 2, "{repeated} of {cuts}");
}

#[test]
fn identity_of_a_lost_store_differs_from_that_of_a_first_save_that_was_cut() {
    let mut store = Store::open(MemoryFlash::<4>::new());
    assert_eq!(store.find_identity(None), FoundIdentity::None);
    for step in 0..20 {
        let mut flash = MemoryFlash::<4>::new();
        flash.cut_power(step, TornStep::Garbage(step));
        let mut store = Store::open(flash);
        assert!(store.save(&payload(1, LENGTH), &IDENTITY).is_err());
        let mut flash = store.into_flash();
        flash.power_on();
        assert_eq!(Store::open(flash).find_identity(None), FoundIdentity::None, "step {step}");
    }
    let mut lost = flash_after_saves::<4>(1);
    lost.restore(&[0x77; 4 * PAGE_BYTES]);
    assert_eq!(Store::open(lost.clone()).find_identity(None), FoundIdentity::Lost);
    // A blank store beside it, as that of the other bank, changes nothing.
    let pages = 2 * PAGE_BYTES as u32;
    let mut both = MemoryFlash::<8>::new();
    let mut bytes: Vec<u8> = lost.image().flatten().copied().collect();
    bytes.resize(8 * PAGE_BYTES, 0xFF);
    both.restore(&bytes);
    let slots = [0, 1, 2, 3].map(|slot| slot * pages..(slot + 1) * pages);
    let [a, b, c, d] = slots;
    let mut store = Store::open_at(both, [c, d]).unwrap();
    assert_eq!(store.find_identity(Some([a, b])), FoundIdentity::Lost);
    assert_eq!(store.health(), StoreHealth::Empty, "the store is the same");
}

#[test]
fn mirrored_store_keeps_the_newest_identity_with_an_older_set() {
    let pages = 2 * PAGE_BYTES as u32;
    let [a, b, c, d] = [0, 1, 2, 3].map(|slot| slot * pages..(slot + 1) * pages);
    let (running, other) = ([a, b], [c, d]);
    let new: Identity = [0x3C; IDENTITY_BYTES];
    let mut store = Store::open_at(MemoryFlash::<8>::new(), running.clone()).unwrap();
    store.save(&payload(1, LENGTH), &IDENTITY).unwrap();
    // The next start copies the set and its identity.
    let identity_of = |_: &[u8]| Some(IDENTITY);
    store.open_mirrored(running.clone(), other.clone(), identity_of);
    assert_eq!(store.find_identity(None), copy(1, IDENTITY));
    assert_eq!(load(&mut store), Ok(payload(1, LENGTH)));
    store.save(&payload(2, LENGTH), &new).unwrap();
    // Both sets of the other bank are damaged.
    let mut flash = store.into_flash();
    for slot in &other {
        flash.flip_bit((slot.start as usize + 100) * 8);
    }
    let mut store = Store::open_at(flash, running.clone()).unwrap();
    store.open_mirrored(running.clone(), other, identity_of);
    assert_eq!(load(&mut store), Ok(payload(1, LENGTH)));
    let FoundIdentity::Copy(found) = store.find_identity(Some(running)) else { panic!() };
    assert_eq!(found.identity, new);
}
