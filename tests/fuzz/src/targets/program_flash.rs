//! Fuzzes the decision of the boot program, and the start of a session, on a flash with any content.
//!
//! The input writes packages and marks into both slots, as updates and a debugger do, or changes any bytes. A trial is
//! given only to a package that is complete and signed with the key of the board. Without a trial starts only what is
//! marked as confirmed or bare. A rejected image does not start. A second start gives a trial at most as often as there
//! are trials.

use crate::bytes::Bytes;
use crate::programs::{Flash, PAGE, SLOTS, found_in, packages, program, requirement};
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use firmware::update::boot::{LastRun, Selection, is_intact, select};
use firmware::update::marks::{self, BARE_MARK, SlotState, TRIALS};
use firmware::update::receiver::Receiver;
use firmware::update::session::Session;

/// Place of the mark of a debugger.
const BARE_PLACE: u32 = 16;

/// Writes bytes that follow a header, or a mark, as far as the flash takes them.
fn write(flash: &mut Flash, at: u32, bytes: &[u8]) {
    let _ = flash.write(at, bytes);
}

/// Changes the content of a slot.
fn change(flash: &mut Flash, bytes: &mut Bytes) {
    let selector = bytes.byte();
    let number = usize::from(selector & 1);
    let slot = SLOTS[number];
    let state = marks::state(flash, &slot);
    match (selector >> 1 & 7, state) {
        (0, _) => {
            let choice = usize::from(bytes.byte()) % packages().len();
            let _ = flash.erase(slot.start, slot.marks);
            write(flash, slot.start, &packages()[choice].bytes);
        }
        (1, _) => {
            let page = slot.marks_page(PAGE);
            let _ = flash.erase(page.start, page.end);
        }
        (2, _) => {
            if let Some(header) = marks::header(flash, &slot) {
                let sequence = u16::from(bytes.byte()) << 8 | u16::from(bytes.byte());
                let _ = marks::receive(flash, &slot, &header, sequence);
            }
        }
        (3, SlotState::Image(image)) => _ = marks::begin_trial(flash, &slot, &image),
        (4, SlotState::Image(image)) => _ = marks::confirm(flash, &slot, &image),
        (5, SlotState::Image(image)) => _ = marks::reject(flash, &slot, &image),
        (6, _) => write(flash, slot.marks + 8 * BARE_PLACE, &BARE_MARK),
        _ => {
            let place = u32::from(bytes.byte()) << 8 | u32::from(bytes.byte());
            let bit = u32::from(bytes.byte() % 8);
            let start = if place & 0x8000 == 0 { slot.start } else { slot.marks };
            flash.flip_bit((8 * (start + place % (slot.marks - slot.start)) + bit) as usize);
        }
    }
}

/// Starts the board once; returns the selection.
fn check_start(flash: &mut Flash, has_failed: bool) -> Selection {
    let before = SLOTS.each_ref().map(|slot| marks::state(flash, slot));
    let last_run = if has_failed { LastRun::Failed } else { LastRun::Interrupted };
    let selection = select(flash, &SLOTS, &requirement(), last_run, |_, _| true);
    let Selection::Start { slot, is_trial } = selection else { return selection };
    let is_bare = before[slot] == SlotState::Bare;
    let SlotState::Image(image) = before[slot] else {
        assert!(is_bare && !is_trial);
        return selection;
    };
    assert!(!image.is_rejected, "a rejected image starts");
    assert!(is_intact(flash, &SLOTS[slot], &image), "a damaged image starts");
    assert!(requirement().board.fits(&image.header), "an image for another board starts");
    if let SlotState::Image(other) = before[1 - slot] {
        let is_older = other.is_confirmed && image.header.counter < other.header.counter;
        assert!(!(is_trial && is_older), "an older image is tried");
    }
    assert_eq!(is_trial, !image.is_confirmed);
    if is_trial && image.trials == 0 {
        let found = found_in(flash, slot).expect("an image that nobody signed is tried");
        assert!(found.is_signed, "an image that nobody signed is tried");
    }
    let SlotState::Image(after) = marks::state(flash, &SLOTS[slot]) else { panic!("its marks") };
    assert_eq!(after.trials, image.trials + u32::from(is_trial));
    selection
}

/// Checks what a session reads of the flash that was changed, from either slot.
fn check_session(flash: &Flash, running: usize) {
    let mut flash = flash.clone();
    let before: Vec<_> = flash.image().copied().collect();
    let mut session = Session::new(&mut flash, program(running), 0);
    assert!(before.iter().eq(flash.image()), "a new session writes");
    let _ = (session.other_crc(), session.flash_status(), session.object());
    let mut receiver = Receiver::new(program(running));
    if let Some(header) = receiver.resume(&mut flash.clone()) {
        assert!(receiver.received() > 0 && receiver.received() < header.package_bytes());
        assert!(receiver.received().is_multiple_of(PAGE));
    }
    let _ = session.control(&mut flash, 0, 0);
    // Only the slot that does not run is written, marks included.
    let start = SLOTS[running].start / PAGE;
    let kept = start as usize..(SLOTS[running].marks / PAGE + 1) as usize;
    let mut now = vec![[0; PAGE as usize]; kept.len()];
    for (page, number) in now.iter_mut().zip(kept.clone()) {
        flash.read(number as u32 * PAGE, page).expect("a page");
    }
    assert_eq!(now, before[kept]);
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let (mut bytes, mut flash) = (Bytes(data), Flash::new());
    while let Some(selector) = bytes.next() {
        if selector < 200 {
            change(&mut flash, &mut bytes);
            continue;
        }
        check_session(&flash, usize::from(selector & 1));
        check_start(&mut flash, selector & 2 != 0);
    }
    let trials = (0..=2 * TRIALS).filter(|_| {
        matches!(check_start(&mut flash, false), Selection::Start { is_trial: true, .. })
    });
    assert!(trials.count() as u32 <= 2 * TRIALS);
}
