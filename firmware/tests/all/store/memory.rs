//! The flash in RAM follows the rules of the chip's flash.

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use firmware::store::memory::{MemoryError, MemoryFlash, PAGE_BYTES, TornStep};

fn read(flash: &mut MemoryFlash<2>, at: u32) -> Result<[u8; 8], MemoryError> {
    let mut bytes = [0; 8];
    flash.read(at, &mut bytes).map(|()| bytes)
}

#[test]
fn write_to_programmed_double_word_is_refused_until_erased() {
    let mut flash = MemoryFlash::<2>::new();
    flash.write(8, &[0xA5; 16]).unwrap();
    assert_eq!((read(&mut flash, 0), read(&mut flash, 16)), (Ok([0xFF; 8]), Ok([0xA5; 8])));
    assert_eq!(flash.write(16, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    // Programming ones counts as well, because it sets the check bits.
    flash.write(32, &[0xFF; 8]).unwrap();
    assert_eq!(flash.write(32, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    flash.erase(0, PAGE_BYTES as u32).unwrap();
    assert_eq!(read(&mut flash, 16), Ok([0xFF; 8]));
    assert!(flash.write(16, &[0; 8]).is_ok());
    assert_eq!(flash.steps(), 5);
}

#[test]
fn write_clears_bits_only_and_checks_alignment_and_bounds() {
    let mut flash = MemoryFlash::<2>::new();
    flash.flip_bit(8 * 8);
    flash.write(8, &[0xFF; 8]).unwrap();
    assert_eq!(read(&mut flash, 8).unwrap()[0], 0xFE);
    assert_eq!(flash.write(4, &[0; 8]), Err(MemoryError::NotAligned));
    assert_eq!(flash.write(16, &[0; 4]), Err(MemoryError::NotAligned));
    assert_eq!(flash.erase(8, PAGE_BYTES as u32), Err(MemoryError::NotAligned));
    assert_eq!(flash.erase(0, 3 * PAGE_BYTES as u32), Err(MemoryError::OutOfBounds));
    assert_eq!(read(&mut flash, 2 * PAGE_BYTES as u32 - 4), Err(MemoryError::OutOfBounds));
}

#[test]
fn power_cut_tears_its_step_and_fails_all_later_ones() {
    let wanted = [0, 0, 0, 0, 0, 0, 0, 0];
    for (torn, expected) in [
        (TornStep::Nothing, Some([0xFF; 8])),
        (TornStep::Done, Some([0; 8])),
        (TornStep::FirstHalf, Some([0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF])),
        (TornStep::LastHalf, Some([0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0])),
        (TornStep::Unreadable(1), None),
    ] {
        let mut flash = MemoryFlash::<2>::new();
        flash.cut_power(1, torn);
        assert!(flash.write(0, &wanted).is_ok());
        assert_eq!(flash.write(8, &wanted), Err(MemoryError::PowerLost));
        assert_eq!(read(&mut flash, 0), Err(MemoryError::PowerLost));
        assert_eq!(flash.erase(0, PAGE_BYTES as u32), Err(MemoryError::PowerLost));
        flash.power_on();
        assert_eq!(read(&mut flash, 0), Ok(wanted));
        assert_eq!(read(&mut flash, 8).ok(), expected, "{torn:?}");
        // The torn double word must be erased before it is written again, except if nothing was done.
        assert_eq!(flash.write(8, &wanted).is_ok(), torn == TornStep::Nothing, "{torn:?}");
        flash.erase(0, PAGE_BYTES as u32).unwrap();
        assert_eq!(read(&mut flash, 8), Ok([0xFF; 8]));
    }
}

#[test]
fn partly_torn_step_leaves_a_seed_dependent_mix_of_bits() {
    let mut seen = std::collections::HashSet::new();
    for seed in 0..50 {
        let mut flash = MemoryFlash::<2>::new();
        flash.write(0, &[0; 8]).unwrap();
        flash.cut_power(0, TornStep::Partly(seed));
        assert_eq!(flash.erase(0, PAGE_BYTES as u32), Err(MemoryError::PowerLost));
        flash.power_on();
        let bytes = read(&mut flash, 0).unwrap();
        assert!(bytes != [0; 8] && bytes != [0xFF; 8]);
        assert_eq!(read(&mut flash, 8), Ok([0xFF; 8]), "unchanged bits are not torn");
        assert!(seen.insert(bytes), "seeds differ");
    }
}

#[test]
fn restored_image_reads_as_before() {
    let mut flash = MemoryFlash::<2>::new();
    flash.write(PAGE_BYTES as u32 + 8, &[7; 8]).unwrap();
    let image: Vec<u8> = flash.image().flatten().copied().collect();
    let mut copy = MemoryFlash::<2>::new();
    copy.restore(&image);
    assert_eq!(read(&mut copy, PAGE_BYTES as u32 + 8), Ok([7; 8]));
    assert_eq!(copy.write(PAGE_BYTES as u32 + 8, &[0; 8]), Err(MemoryError::ProgrammedTwice));
    assert!(copy.write(PAGE_BYTES as u32, &[0; 8]).is_ok());
}
