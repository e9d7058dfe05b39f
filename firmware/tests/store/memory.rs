//! The flash in RAM obeys the rules the chip's does.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use firmware::store::memory::{MemoryError, MemoryFlash, PAGE, Torn};

fn read(flash: &mut MemoryFlash<2>, at: u32) -> Result<[u8; 8], MemoryError> {
    let mut bytes = [0; 8];
    flash.read(at, &mut bytes).map(|()| bytes)
}

#[test]
fn a_double_word_is_programmed_once_after_an_erase() {
    let mut flash = MemoryFlash::<2>::new();
    flash.write(8, &[0xA5; 16]).unwrap();
    assert_eq!((read(&mut flash, 0), read(&mut flash, 16)), (Ok([0xFF; 8]), Ok([0xA5; 8])));
    assert_eq!(flash.write(16, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    // With ones too: the check bits are programmed, if nothing else is.
    flash.write(32, &[0xFF; 8]).unwrap();
    assert_eq!(flash.write(32, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    flash.erase(0, PAGE as u32).unwrap();
    assert_eq!(read(&mut flash, 16), Ok([0xFF; 8]));
    assert!(flash.write(16, &[0; 8]).is_ok());
    assert_eq!(flash.steps(), 5);
}

#[test]
fn bits_only_go_down_and_limits_are_kept() {
    let mut flash = MemoryFlash::<2>::new();
    flash.flip(8 * 8);
    flash.write(8, &[0xFF; 8]).unwrap();
    assert_eq!(read(&mut flash, 8).unwrap()[0], 0xFE);
    assert_eq!(flash.write(4, &[0; 8]), Err(MemoryError::NotAligned));
    assert_eq!(flash.write(16, &[0; 4]), Err(MemoryError::NotAligned));
    assert_eq!(flash.erase(8, PAGE as u32), Err(MemoryError::NotAligned));
    assert_eq!(flash.erase(0, 3 * PAGE as u32), Err(MemoryError::OutOfBounds));
    assert_eq!(read(&mut flash, 2 * PAGE as u32 - 4), Err(MemoryError::OutOfBounds));
}

#[test]
fn a_cut_comes_in_its_step_and_nothing_works_after_it() {
    let wanted = [0, 0, 0, 0, 0, 0, 0, 0];
    for (torn, expected) in [
        (Torn::Nothing, Some([0xFF; 8])),
        (Torn::Done, Some([0; 8])),
        (Torn::FirstHalf, Some([0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF])),
        (Torn::LastHalf, Some([0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0])),
        (Torn::Unreadable(1), None),
    ] {
        let mut flash = MemoryFlash::<2>::new();
        flash.cut(1, torn);
        assert!(flash.write(0, &wanted).is_ok());
        assert_eq!(flash.write(8, &wanted), Err(MemoryError::PowerLost));
        assert_eq!(read(&mut flash, 0), Err(MemoryError::PowerLost));
        assert_eq!(flash.erase(0, PAGE as u32), Err(MemoryError::PowerLost));
        flash.power_on();
        assert_eq!(read(&mut flash, 0), Ok(wanted));
        assert_eq!(read(&mut flash, 8).ok(), expected, "{torn:?}");
        // Whatever is there, only an erase makes it new; except where nothing was done.
        assert_eq!(flash.write(8, &wanted).is_ok(), torn == Torn::Nothing, "{torn:?}");
        flash.erase(0, PAGE as u32).unwrap();
        assert_eq!(read(&mut flash, 8), Ok([0xFF; 8]));
    }
}

#[test]
fn torn_bits_are_neither_all_old_nor_all_new() {
    let mut seen = std::collections::HashSet::new();
    for seed in 0..50 {
        let mut flash = MemoryFlash::<2>::new();
        flash.write(0, &[0; 8]).unwrap();
        flash.cut(0, Torn::Partly(seed));
        assert_eq!(flash.erase(0, PAGE as u32), Err(MemoryError::PowerLost));
        flash.power_on();
        let bytes = read(&mut flash, 0).unwrap();
        assert!(bytes != [0; 8] && bytes != [0xFF; 8]);
        assert_eq!(read(&mut flash, 8), Ok([0xFF; 8]), "what did not change cannot be torn");
        assert!(seen.insert(bytes), "seeds differ");
    }
}

#[test]
fn an_image_comes_back_from_a_file() {
    let mut flash = MemoryFlash::<2>::new();
    flash.write(PAGE as u32 + 8, &[7; 8]).unwrap();
    let image: Vec<u8> = flash.image().flatten().copied().collect();
    let mut copy = MemoryFlash::<2>::new();
    copy.restore(&image);
    assert_eq!(read(&mut copy, PAGE as u32 + 8), Ok([7; 8]));
    assert_eq!(copy.write(PAGE as u32 + 8, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    assert!(copy.write(PAGE as u32, &[0; 8]).is_ok());
}
