//! Updates of the emulated board that are interrupted: power cuts at flash operations, bits that flip in transit, a second
//! master, and random mixtures. The joint always starts with one of the two images and whole parameters.

use super::board_bus::{BoardBus, Disturbance, NODE, entry, started};
use super::slots::SLOTS;
use super::update::{
    interrupted, is_long, number, parameters_crc, recorded_update, release, update,
};
use compensator_core::can::Frame;
use emulated_board::chip::CORE_HZ;
use emulated_board::chip::flash::{Content, Operation};
use firmware::node::dictionary::records::ProgramObject;
use firmware::update::recovery::RECOVERY_STATE;
use joint_bus::canopen::Client;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::cell::Cell;
use std::rc::Rc;

const REQUEST: u16 = 0x601;
const PAGE_BYTES: u32 = 2048;

/// Returns the flash after a power cut during an operation of the recorded update.
fn cut_during(content: &Content, operation: &Operation) -> Content {
    let mut content = content.clone();
    content.tear(operation);
    content
}

/// Starts the board on this flash; asserts that the parameters are whole, and returns true if the new image runs.
fn runs_new_image(content: Content, what: &str) -> bool {
    let mut client = started(content);
    let version = entry(&mut client, ProgramObject::VERSION);
    assert!(entry(&mut client, ProgramObject::STATE) < RECOVERY_STATE, "{what}");
    // The image that the debugger wrote has no version.
    assert!([0, number("1.0.0")].contains(&version), "{what}: {version:08x}");
    assert_eq!(parameters_crc(&mut client), recorded_update().parameters, "{what}");
    version != 0
}

/// Runs the boot program on this flash; returns the slot that it starts.
fn started_slot(content: Content, what: &str) -> usize {
    let mut bus = BoardBus::power_up(content);
    for _ in 0..200_000 {
        bus.run(CORE_HZ / 100_000);
        let place = bus.machine().pc().wrapping_sub(0x0800_0000);
        for (number, slot) in SLOTS.iter().enumerate() {
            if (slot.start..slot.marks).contains(&place) {
                return number;
            }
        }
    }
    panic!("{what}: no image is started, at {:#x}", bus.machine().pc());
}

/// Returns true if this operation is on a page that decides what starts: header, last page, marks, stores.
fn is_decisive(operation: &Operation, bytes: u32) -> bool {
    let (Operation::Erase(at) | Operation::Program(at, _)) = *operation;
    let page = at / PAGE_BYTES;
    let slot = SLOTS[1].start;
    let body = slot / PAGE_BYTES + 1..(slot + bytes) / PAGE_BYTES;
    !body.contains(&page)
}

#[test]
fn update_with_power_cut_at_its_flash_operations_starts_one_of_the_images() {
    let update = recorded_update();
    let mut content = update.before.clone();
    let total = update.operations.len();
    let (every, whole_every) = if is_long() { (1, 300) } else { (400, 4000) };
    let (mut boots, mut wholes, mut new) = (0, 0, 0);
    for (number, operation) in update.operations.iter().enumerate() {
        // Of the decisive pages, the marks and erases are few; the double words of header and stores are alike.
        let is_decisive = is_decisive(operation, update.bytes);
        let is_rare = is_decisive
            && (number % 16 == 0
                || total - number < 12
                || matches!(operation, Operation::Erase(_)));
        let what = format!("operation {number} of {total}, {operation:x?}");
        if number % every == 0 || is_rare {
            started_slot(cut_during(&content, operation), &what);
            boots += 1;
        }
        if number % whole_every == 0 || is_rare && (total - number < 12 || is_long()) {
            new += u32::from(runs_new_image(cut_during(&content, operation), &what));
            wholes += 1;
        }
        content.apply(operation);
    }
    println!("measured: {total} flash operations of an update");
    println!("measured: {boots} power cuts for the boot program, {wholes} up to the parameters");
    println!("measured: {new} of these starts with the new image");
    assert!(new > 0 && new < wholes);
    assert!(runs_new_image(content, "the end"));
}

/// Updates a board that has received most of a package, under a disturbance.
fn disturbed(percent: usize, disturbance: Disturbance) -> Client<BoardBus> {
    let mut client = started(interrupted(percent));
    client.bus().disturbance = Some(disturbance);
    update(&mut client, &release("1.0.0")).expect("an update");
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(parameters_crc(&mut client), recorded_update().parameters);
    client
}

#[test]
fn transfer_with_flipped_bits_is_repaired() {
    let mut random = Pcg64Mcg::seed_from_u64(33);
    // A flip of the data is found by the CRC at the end, after which the whole package is sent again. One of the sequence
    // number, in the lowest seven bits, costs a block.
    let bits = if is_long() { 64 } else { 7 };
    let flips = Rc::new(Cell::new(0));
    let counted = Rc::clone(&flips);
    let flip: Disturbance = Box::new(move |number, frames| {
        if (50..2000).contains(&number) && random.random_bool(0.01) {
            let frame = &mut frames[0];
            let mut data = frame.data().to_vec();
            let bit = random.random_range(0..bits);
            counted.set(counted.get() + 1);
            data[bit / 8] ^= 1 << (bit % 8);
            *frame = Frame::new(frame.identifier(), &data).expect("a frame");
        }
    });
    disturbed(if is_long() { 5 } else { 95 }, flip);
    println!("measured: {} flipped bits in transit", flips.get());
    assert!(flips.get() > 5);
}

/// Attack: disturb a program update. Bound: the running image is never written; the transfer is repeated.
#[test]
fn update_beside_a_second_master_is_confirmed() {
    let abort = [0x80, 0x50, 0x1F, 1, 0, 0, 0, 8];
    let download = [0x21, 0x50, 0x1F, 1, 0, 16, 0, 0];
    let reset = [0x81, NODE.number()];
    let second: Disturbance = Box::new(move |number, frames| {
        let frame = |identifier, data: &[u8]| Frame::new(identifier, data).expect("a frame");
        match number {
            200 | 500 | 900 => frames.push(frame(REQUEST, &abort)),
            350 | 700 => frames.push(frame(REQUEST, &download)),
            // The node restarts; the transfer goes on from the flash.
            1100 => frames.push(frame(0, &reset)),
            _ => {}
        }
    });
    let mut client = disturbed(if is_long() { 5 } else { 95 }, second);
    // That of the second master, and that of the update.
    assert_eq!(client.bus().resets, 2);
}

#[test]
fn update_with_random_interruptions_always_starts_one_of_the_images() {
    let (count, percent) = if is_long() { (300, 30) } else { (9, 96) };
    let mut random = Pcg64Mcg::seed_from_u64(1000);
    let mut content = interrupted(percent);
    let mut ends = [0, 0];
    for number in 0..count {
        let mut bus = BoardBus::power_up(content.clone());
        bus.await_boot_up();
        let operations = bus.flash().record_operations();
        bus.cut_at = Some(bus.now() + random.random_range(CORE_HZ / 20..4 * CORE_HZ / 5));
        let mut client = Client::new(bus, NODE);
        // It fails without power, and after the confirmation there is nothing to do.
        let _ = update(&mut client, &release("1.0.0"));
        let operations = operations.take();
        if let Some((last, before)) = operations.split_last() {
            before.iter().for_each(|operation| content.apply(operation));
            if random.random_bool(0.7) { content.tear(last) } else { content.apply(last) }
        }
        let is_new = runs_new_image(content.clone(), &format!("interruption {number}"));
        ends[usize::from(is_new)] += 1;
        if is_new {
            content = interrupted(percent);
        }
    }
    println!("measured: {count} random interruptions, {} starts with the new image", ends[1]);
    assert!(ends[0] > 0);
}
