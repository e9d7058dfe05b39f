//! The layout of a set in flash, and sets of other firmware versions.

use super::{IDENTITY, load};
use firmware::store::image::{self, COMMIT_AT, Commit, SlotHeader, UNIT_BYTES};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES};
use firmware::store::{LoadError, LoadedSet, SaveOutcome, SlotState, Store, StoreHealth};

/// Builds the bytes of a slot.
fn slot(version: u16, sequence: u32, payload: &[u8]) -> Vec<u8> {
    let head = SlotHeader { version, length: payload.len() as u16, sequence }.emit();
    let mut bytes = vec![0xFF; PAGE_BYTES];
    let mut commit = Commit::begin();
    for (at, unit) in image::units(&head, payload) {
        commit.update(&unit);
        bytes[at as usize..][..UNIT_BYTES].copy_from_slice(&unit);
    }
    bytes[COMMIT_AT as usize..][..UNIT_BYTES].copy_from_slice(&commit.emit());
    bytes
}

fn flash_of(first: &[u8], second: &[u8]) -> MemoryFlash<2> {
    let mut flash = MemoryFlash::new();
    flash.restore(&[first, second].concat());
    flash
}

#[test]
fn saved_set_has_the_documented_layout() {
    let mut store = Store::open(MemoryFlash::<2>::new());
    store.save(b"123456789", &IDENTITY).unwrap();
    let flash = store.into_flash();
    let page = flash.image().next().unwrap();
    assert_eq!(&page[..16], b"JSET\x02\x00\x09\x00\x01\x00\x00\x00\x00\x00\x00\x00");
    assert_eq!(&page[24..40], b"123456789\0\0\0\0\0\0\0");
    assert_eq!(page[40..PAGE_BYTES - 48], [0xFF; PAGE_BYTES - 88]);
    let rest = [&page[..16], &page[24..40]].concat();
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&rest);
    assert_eq!(page[16..20], crc.to_le_bytes());
    assert_eq!(page[20..24], (!crc).to_le_bytes());
    assert_eq!(page[..PAGE_BYTES - 48], slot(2, 1, b"123456789")[..PAGE_BYTES - 48]);
    let copy = &page[PAGE_BYTES - 48..];
    assert_eq!(copy[..8], *b"JKEY\x01\x00\x00\x00");
    assert_eq!(copy[8..44], IDENTITY);
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&copy[..44]);
    assert_eq!(copy[44..], crc.to_le_bytes());
}

#[test]
fn newest_set_is_found_when_the_sequence_wraps() {
    for (first, second, newer) in [
        (u32::MAX, 0, 1),
        (0, u32::MAX, 0),
        (u32::MAX - 1, u32::MAX, 1),
        (5, 4, 0),
        (7, 7, 0),
        (1 << 31, (1 << 31) - 1, 0),
        (0, (1 << 31) - 1, 1),
    ] {
        let mut store =
            Store::open(flash_of(&slot(2, first, b"first"), &slot(2, second, b"second")));
        let expected: &[u8] = if newer == 0 { b"first" } else { b"second" };
        assert_eq!(load(&mut store).as_deref(), Ok(expected), "{first} {second}");
        let next = [first, second][newer].wrapping_add(1);
        let saved = store.save(b"third", &IDENTITY);
        assert_eq!(saved, Ok(SaveOutcome::Written { slot: 1 - newer, sequence: next }));
        assert_eq!(load(&mut store).as_deref(), Ok(&b"third"[..]));
    }
}

#[test]
fn sets_of_another_layout_are_reported_and_the_newest_is_kept() {
    let mut store = Store::open(flash_of(&slot(3, 8, b"new"), &slot(3, 7, b"old")));
    assert_eq!(
        (load(&mut store), store.health()),
        (Err(LoadError::Foreign(3)), StoreHealth::Foreign)
    );
    // A save by older firmware must not overwrite the newest set of newer firmware.
    assert_eq!(store.save(b"mine", &IDENTITY), Ok(SaveOutcome::Written { slot: 1, sequence: 9 }));
    assert_eq!(store.slots()[0], SlotState::Foreign { version: 3, sequence: 8 });
    let mut place = [0; 8];
    assert_eq!(store.load(&mut place), Ok(LoadedSet { length: 4, slot: 1, sequence: 9 }));
    // A readable set is loaded even if an unknown one is newer.
    let mut store = Store::open(flash_of(&slot(2, 3, b"mine"), &slot(3, 4, b"theirs")));
    assert_eq!(load(&mut store).as_deref(), Ok(&b"mine"[..]));
}
