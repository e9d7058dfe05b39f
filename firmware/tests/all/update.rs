//! Tests of the program update: power cuts, bit flips, foreign packages, failed trials.

pub mod bench;
mod stored_settings;
mod trial;

use bench::{
    BOARD, End, Flash, IMAGE_BYTES, OTHER, Package, RUNNING, assert_starts_one_of, confirm,
    erase_marks, finish, flash_with, image, key, package, program, receive, signed, start,
    start_after,
};
use ed25519_dalek::SigningKey;
use embedded_storage::nor_flash::NorFlash;
use firmware::store::memory::TornStep;
use firmware::supervisor::ResetCause;
use firmware::update::Board;
use firmware::update::boot::{LastRun, Requirement, Selection, select};
use firmware::update::marks::{self, SlotState};
use firmware::update::package::{CRC, HASH_AT, HEADER_BYTES};
use firmware::update::receiver::{Receiver, Refusal};
use proptest::prelude::*;

const fn started(slot: usize, is_trial: bool) -> Selection {
    Selection::Start { slot, is_trial }
}

fn torn_variants() -> Vec<TornStep> {
    let mut variants =
        vec![TornStep::Nothing, TornStep::FirstHalf, TornStep::LastHalf, TornStep::Done];
    for seed in 0..2 {
        variants.extend([
            TornStep::Partly(seed),
            TornStep::Garbage(seed),
            TornStep::Unreadable(seed),
        ]);
    }
    variants
}

#[test]
fn update_without_interruption_tries_and_then_keeps_the_new_image() {
    let (old, new) = (package(1, 5), package(2, 5));
    let mut flash = flash_with(&old);
    assert_eq!(receive(&mut flash, 0, &new), End::Done);
    assert_eq!(start(&mut flash, false), started(1, true));
    assert_eq!(image(&mut flash, 1, IMAGE_BYTES), new.bytes[HEADER_BYTES..]);
    confirm(&mut flash, 1).unwrap();
    // Confirmed: a watchdog reset does not return to the old image.
    assert_eq!(start(&mut flash, true), started(1, false));
    // The next update goes to the first slot.
    let next = package(3, 6);
    assert_eq!(receive(&mut flash, 1, &next), End::Done);
    assert_eq!(start(&mut flash, false), started(0, true));
}

#[test]
fn trial_with_watchdog_reset_returns_to_the_old_image_for_good() {
    let mut flash = flash_with(&package(1, 5));
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
    // The restart into the trial is one by software, and the trial has not begun then.
    assert_eq!(start(&mut flash, true), started(1, true));
    assert_eq!(start(&mut flash, true), started(0, false));
    assert_eq!(start(&mut flash, false), started(0, false));
    let SlotState::Image(image) = marks::state(&mut flash, &OTHER) else { panic!("no image") };
    assert!(image.is_rejected && !image.is_confirmed);
}

#[test]
fn trial_with_three_losses_of_power_returns_to_the_old_image() {
    let mut flash = flash_with(&package(1, 5));
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
    for _ in 0..marks::TRIALS {
        assert_eq!(start(&mut flash, false), started(1, true));
    }
    assert_eq!(start(&mut flash, false), started(0, false));
}

/// Marks the restart that follows as ordered by the bus.
fn order_restart(flash: &mut Flash) {
    let SlotState::Image(image) = marks::state(flash, &OTHER) else { panic!("no image") };
    let _ = marks::order_restart(flash, &OTHER, &image);
}

#[test]
fn trial_with_restarts_ordered_by_the_bus_goes_on_until_its_starts_are_used() {
    let mut flash = flash_with(&package(1, 5));
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
    for _ in 1..marks::TRIALS {
        assert_eq!(start(&mut flash, true), started(1, true));
        order_restart(&mut flash);
    }
    assert_eq!(start(&mut flash, true), started(1, true));
    let mut confirmed = flash.clone();
    confirm(&mut confirmed, 1).unwrap();
    assert_eq!(start(&mut confirmed, true), started(1, false));
    // The last start ended by an order, too.
    order_restart(&mut flash);
    assert_eq!(start(&mut flash, true), started(0, false));
}

#[test]
fn trial_with_watchdog_reset_after_an_ordered_restart_returns_to_the_old_image() {
    let mut flash = flash_with(&package(1, 5));
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
    assert_eq!(start(&mut flash, true), started(1, true));
    order_restart(&mut flash);
    assert_eq!(start(&mut flash, true), started(1, true));
    assert_eq!(start(&mut flash, true), started(0, false));
}

#[test]
fn trial_with_resets_by_a_debugger_goes_on_and_uses_no_start() {
    let (old, new) = (package(1, 5), package(2, 5));
    let mut flash = flash_with(&old);
    assert_eq!(receive(&mut flash, 0, &new), End::Done);
    let debugged = LastRun::of(ResetCause::Software, true);
    let before = flash.steps();
    assert_eq!(start_after(&mut flash, debugged), started(1, true), "the first start is marked");
    let after_first = flash.steps();
    assert!(after_first > before);
    for _ in 0..10 {
        assert_eq!(start_after(&mut flash, debugged), started(1, true));
    }
    assert_eq!(flash.steps(), after_first);
    // A watchdog reset counts, with a debugger too.
    assert_eq!(start_after(&mut flash, LastRun::of(ResetCause::Watchdog, true)), started(0, false));
    assert_eq!(start_after(&mut flash, debugged), started(0, false), "it is rejected for good");
}

#[test]
fn last_run_with_software_reset_and_no_debugger_has_failed() {
    assert_eq!(LastRun::of(ResetCause::Software, false), LastRun::Failed);
    assert_eq!(LastRun::of(ResetCause::Watchdog, true), LastRun::Failed);
    assert_eq!(LastRun::of(ResetCause::Pin, true), LastRun::Interrupted);
}

#[test]
fn order_of_a_restart_with_power_cut_starts_one_of_the_images() {
    let (old, new) = (package(1, 5), package(2, 5));
    let mut initial = flash_with(&old);
    assert_eq!(receive(&mut initial, 0, &new), End::Done);
    assert_eq!(start(&mut initial, true), started(1, true));
    for (torn, has_failed) in
        torn_variants().into_iter().flat_map(|torn| [(torn, false), (torn, true)])
    {
        let mut flash = initial.clone();
        flash.cut_power(0, torn);
        order_restart(&mut flash);
        assert!(!flash.has_power());
        flash.power_on();
        let selection = start(&mut flash, has_failed);
        let found = assert_starts_one_of(&mut flash, selection, &[&old, &new]);
        // A loss of power is no failure, whatever is left of the mark.
        assert!(found == 1 || has_failed, "{torn:?}");
    }
}

#[test]
fn select_without_intact_image_recovers() {
    let mut flash = flash_with(&package(1, 5));
    erase_marks(&mut flash, 0);
    assert_eq!(start(&mut flash, false), Selection::Recover);
    assert_eq!(start(&mut Flash::new(), false), Selection::Recover);
    // In recovery the device receives an image for either slot.
    assert_eq!(receive(&mut flash, 1, &package(2, 0)), End::Done);
    assert_eq!(start(&mut flash, false), started(0, true));
}

/// Excluded: install a program for another board or another wiring, or an older one.
#[test]
fn receiver_with_foreign_package_names_the_reason() {
    let mut flash = flash_with(&package(1, 5));
    let board = Board { number: BOARD.number + 1, ..BOARD };
    let rewired = Board { wiring: BOARD.wiring + 1, ..BOARD };
    let cases: [(Package, Refusal); 4] = [
        (signed(&key(), board, 2, 5, 800), Refusal::Board(board.number)),
        (signed(&key(), rewired, 2, 5, 800), Refusal::Wiring(rewired.wiring)),
        (signed(&key(), BOARD, 2, 4, 800), Refusal::Counter(4, 5)),
        (signed(&key(), BOARD, 2, 5, 5640), Refusal::TooLong(5640)),
    ];
    for (package, refusal) in cases {
        assert_eq!(receive(&mut flash, 0, &package), End::Refused(refusal));
        assert_eq!(start(&mut flash, false), started(0, false));
    }
    // The image of the other slot.
    let mut receiver = Receiver::new(program(1));
    receiver.clear(&mut flash).unwrap();
    let new = package(2, 5);
    let end = finish(&mut flash, &mut receiver, &new.bytes);
    assert_eq!(end, End::Refused(Refusal::Address(new.header.address)));
    let mut flash = flash_with(&package(1, 5));
    let mut receiver = Receiver::new(program(0));
    assert_eq!(receiver.write(&mut flash, &[0; 8]), Err(Refusal::NotCleared));
    receiver.clear(&mut flash).unwrap();
    let junk = finish(&mut flash, &mut receiver, &[0x55; 600]);
    assert_eq!(junk, End::Refused(Refusal::NoPackage));
    receiver.clear(&mut flash).unwrap();
    let long = [&package(2, 5).bytes[..], &[0]].concat();
    let excess = finish(&mut flash, &mut receiver, &long);
    assert!(matches!(excess, End::Refused(Refusal::Excess | Refusal::NotCleared)), "{excess:?}");
    assert_eq!(start(&mut flash, false), started(0, false));
}

#[test]
fn select_with_image_of_another_key_rejects_it_before_its_first_start() {
    let mut flash = flash_with(&package(1, 5));
    let other_key = SigningKey::from_bytes(&[8; 32]);
    let foreign = signed(&other_key, BOARD, 2, 5, 800);
    assert_eq!(receive(&mut flash, 0, &foreign), End::Done);
    assert_eq!(start(&mut flash, true), started(0, false));
    let SlotState::Image(image) = marks::state(&mut flash, &OTHER) else { panic!("no image") };
    assert!(image.is_rejected && image.trials == 0);
}

/// Returns a package with a changed byte of the image, and a CRC that fits.
fn forged() -> Package {
    let mut forged = package(2, 5);
    forged.bytes[HEADER_BYTES + 100] ^= 1;
    let crc = CRC.checksum(&forged.bytes[HEADER_BYTES..]);
    forged.bytes[24..28].copy_from_slice(&crc.to_le_bytes());
    forged
}

#[test]
fn receiver_with_changed_image_or_hash_refuses_it_before_the_restart() {
    let mut flash = flash_with(&package(1, 5));
    let mut receiver = Receiver::new(program(0));
    for (change, refusal) in [(HEADER_BYTES + 100, Refusal::Crc), (HASH_AT + 5, Refusal::Hash)] {
        let mut changed = package(2, 5);
        changed.bytes[change] ^= 1;
        receiver.clear(&mut flash).unwrap();
        let end = finish(&mut flash, &mut receiver, &changed.bytes);
        assert_eq!(end, End::Refused(refusal));
    }
    receiver.clear(&mut flash).unwrap();
    let end = finish(&mut flash, &mut receiver, &forged().bytes);
    assert_eq!(end, End::Refused(Refusal::Hash));
    assert_eq!(marks::state(&mut flash, &OTHER), SlotState::Empty);
    assert_eq!(start(&mut flash, false), started(0, false));
}

/// Writes a package as a receiver that checks nothing leaves it.
fn write_unchecked(flash: &mut Flash, package: &Package) {
    flash.erase(OTHER.start, OTHER.marks).unwrap();
    flash.write(OTHER.start, &package.bytes).unwrap();
    let header = marks::header(flash, &OTHER).unwrap();
    marks::receive(flash, &OTHER, &header, 7).unwrap();
}

/// Excluded: start a signed image for another board or another wiring, or an older one, by a replaced receiver.
#[test]
fn select_with_image_of_another_board_or_wiring_or_an_older_one_rejects_it() {
    let board = Board { number: BOARD.number + 1, ..BOARD };
    let rewired = Board { wiring: BOARD.wiring + 1, ..BOARD };
    for (board, counter, starts) in [(BOARD, 5, 1), (board, 6, 0), (rewired, 6, 0), (BOARD, 4, 0)] {
        let mut flash = flash_with(&package(1, 5));
        write_unchecked(&mut flash, &signed(&key(), board, 2, counter, 800));
        assert_eq!(start(&mut flash, false), started(starts, starts == 1), "{board:?} {counter}");
        let SlotState::Image(image) = marks::state(&mut flash, &OTHER) else { panic!("no image") };
        assert_eq!((image.is_rejected, image.trials), (starts == 0, starts as u32));
    }
}

#[test]
fn select_on_a_rewired_board_starts_no_confirmed_image_of_the_former_wiring() {
    let mut flash = flash_with(&package(1, 5));
    let board = Board { wiring: BOARD.wiring + 1, ..BOARD };
    let requirement = Requirement { board, public_key: key().verifying_key().to_bytes() };
    let selected =
        select(&mut flash, &[RUNNING, OTHER], &requirement, LastRun::Interrupted, |_, _| true);
    assert_eq!(selected, Selection::Recover);
}

/// Excluded: start an image that was changed together with its CRC.
#[test]
fn select_with_changed_image_and_its_crc_rejects_it() {
    let mut flash = flash_with(&package(1, 5));
    write_unchecked(&mut flash, &forged());
    assert_eq!(start(&mut flash, false), started(0, false));
    let SlotState::Image(image) = marks::state(&mut flash, &OTHER) else { panic!("no image") };
    assert!(image.is_rejected && image.trials == 0);
}

#[test]
fn receiver_with_any_flipped_bit_of_the_header_refuses_it() {
    let mut flash = flash_with(&package(1, 5));
    let new = package(2, 5);
    for bit in 0..8 * firmware::update::package::USED_BYTES {
        let mut bytes = new.bytes.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let mut receiver = Receiver::new(program(0));
        receiver.clear(&mut flash).unwrap();
        let mut refused = receiver.write(&mut flash, &bytes).err();
        while receiver.is_verifying() {
            receiver.step(&mut flash);
        }
        refused = refused.or(receiver.refusal());
        // A longer length waits for bytes that do not come. What only the signature protects is left to the start.
        let is_ready = refused.is_none() && receiver.is_ready();
        assert!(refused.is_some() || receiver.is_receiving() || is_ready, "bit {bit}");
        assert_eq!(start(&mut flash, false), started(0, false), "bit {bit}");
    }
}

#[test]
fn select_with_any_flipped_bit_of_marks_or_header_starts_one_of_the_images() {
    let (old, new) = (package(1, 5), package(2, 5));
    let mut flash = flash_with(&old);
    assert_eq!(receive(&mut flash, 0, &new), End::Done);
    assert_eq!(start(&mut flash, false), started(1, true));
    confirm(&mut flash, 1).unwrap();
    let header = 8 * OTHER.start as usize..8 * (OTHER.start as usize + 160);
    let marks = 8 * OTHER.marks as usize..8 * (OTHER.marks as usize + 160);
    for bit in header.chain(marks) {
        let mut flipped = flash.clone();
        flipped.flip_bit(bit);
        for has_failed in [false, true] {
            let selection = start(&mut flipped, has_failed);
            assert_starts_one_of(&mut flipped, selection, &[&old, &new]);
        }
    }
}

/// Receives, tries and confirms a package with one power cut; then finishes the update.
fn update_with_cut(initial: &Flash, packages: [&Package; 2], step: u32, torn: TornStep) -> bool {
    let [old, new] = packages;
    let mut flash = initial.clone();
    flash.cut_power(step, torn);
    if receive(&mut flash, 0, new) == End::Done
        && start(&mut flash, true) == started(1, true)
        && flash.has_power()
    {
        let _ = confirm(&mut flash, 1);
    }
    let was_cut = !flash.has_power();
    flash.power_on();
    // The joint starts, and the update can be repeated or is done.
    for _ in 0..2 {
        let selection = start(&mut flash, false);
        if assert_starts_one_of(&mut flash, selection, packages.as_slice()) == 0 {
            assert_eq!(selection, started(0, false), "step {step}, {torn:?}");
            assert_eq!(receive(&mut flash, 0, new), End::Done, "step {step}, {torn:?}");
            assert_eq!(start(&mut flash, true), started(1, true), "step {step}, {torn:?}");
        }
    }
    if let SlotState::Image(image) = marks::state(&mut flash, &OTHER)
        && !image.is_confirmed
    {
        confirm(&mut flash, 1).unwrap();
    }
    assert_eq!(start(&mut flash, true), started(1, false), "step {step}, {torn:?}");
    assert_eq!(image(&mut flash, 0, IMAGE_BYTES), old.bytes[HEADER_BYTES..]);
    was_cut
}

#[test]
fn update_with_power_cut_at_every_step_starts_one_of_the_images_and_can_be_repeated() {
    let (old, new) = (package(1, 5), package(2, 5));
    let initial = flash_with(&old);
    for torn in torn_variants() {
        let mut step = 0;
        while update_with_cut(&initial, [&old, &new], step, torn) {
            step += 1;
        }
        // Four erases, 614 double words, and the marks.
        assert!(step > 600, "{step} steps");
    }
}

/// One interruption of a random update.
#[derive(Clone, Debug)]
struct Interruption {
    step: u32,
    torn: TornStep,
    has_failed: bool,
    flipped: Option<usize>,
}

#[test]
fn package_with_a_length_beyond_its_bytes_stays_unfinished() {
    let (old, mut sent) = (package(1, 5), package(2, 5));
    let mut flash = flash_with(&old);
    // The length of the program grows by 8 bytes.
    sent.bytes[20] ^= 8;
    assert_eq!(receive(&mut flash, 0, &sent), End::Unfinished);
    let selection = start(&mut flash, false);
    assert_eq!(assert_starts_one_of(&mut flash, selection, &[&old]), 0);
    assert_eq!(receive(&mut flash, 0, &package(2, 5)), End::Done);
}

fn interruption() -> impl Strategy<Value = Interruption> {
    let torn = (0..7usize, any::<u32>()).prop_map(|(kind, seed)| match kind {
        0 => TornStep::Nothing,
        1 => TornStep::FirstHalf,
        2 => TornStep::LastHalf,
        3 => TornStep::Partly(seed),
        4 => TornStep::Garbage(seed),
        5 => TornStep::Unreadable(seed),
        _ => TornStep::Done,
    });
    let flipped = proptest::option::of(0..8 * (HEADER_BYTES + IMAGE_BYTES));
    (0..1300u32, torn, any::<bool>(), flipped).prop_map(|(step, torn, has_failed, flipped)| {
        Interruption { step, torn, has_failed, flipped }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn update_with_random_interruptions_always_starts_one_of_the_images(
        interruptions in proptest::collection::vec(interruption(), 1..5),
        confirms in any::<bool>(),
    ) {
        let (old, new) = (package(1, 5), package(2, 5));
        let mut flash = flash_with(&old);
        let mut running = 0;
        for Interruption { step, torn, has_failed, flipped } in interruptions {
            flash.cut_power(step, torn);
            if running == 0 {
                let mut sent = package(2, 5);
                if let Some(bit) = flipped {
                    sent.bytes[bit / 8] ^= 1 << (bit % 8);
                }
                receive(&mut flash, 0, &sent);
            } else if confirms {
                let _ = confirm(&mut flash, 1);
            }
            flash.power_on();
            let selection = start(&mut flash, has_failed);
            running = assert_starts_one_of(&mut flash, selection, &[&old, &new]);
            prop_assert_eq!(image(&mut flash, 0, IMAGE_BYTES), &old.bytes[HEADER_BYTES..]);
        }
    }
}
