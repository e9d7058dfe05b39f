//! Program updates of the emulated board: the shipped boot program and images, and the client of host-sim.

use super::board_bus::{BoardBus, NODE, blank_board, entry, new_board, started};
use super::slots::{SLOTS, confirm, install};
use crate::common::image_path;
use canopen_rs::Address;
use compensator_core::can::Frame;
use ed25519_dalek::SigningKey;
use emulated_board::chip::CORE_HZ;
use emulated_board::chip::flash::{Content, Operation};
use firmware::access::Key;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::ProgramObject;
use firmware::supervisor::Code::ParametersDefault;
use firmware::update::PUBLISHED_KEY;
use firmware::update::package::{HEADER_BYTES, Version};
use firmware::update::recovery::RECOVERY_STATE;
use firmware::update::session::OtherState;
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::program::package::{Code, Package, Release, read_image};
use joint_bus::program::update::{Outcome, Update, UpdateError};
use joint_trace::CanFrame;
use std::sync::LazyLock;

/// The published test key, firmware/keys/test.key.
const KEY: [u8; 32] = [7; 32];
/// Running states in object 2040h.
const TRIAL: u32 = 1;
const CONFIRMED: u32 = 2;

/// Returns true in the long form of the tests.
pub fn is_long() -> bool {
    std::env::var_os("LONG_TESTS").is_some()
}

/// Returns the code of the images for slots A and B.
fn codes() -> &'static [Code; 2] {
    static CODES: LazyLock<[Code; 2]> = LazyLock::new(|| {
        ["firmware", "firmware-b"].map(|name| read_image(&image_path(name)).expect("an image"))
    });
    &CODES
}

fn signed(code: &Code, version: &str, key: &[u8; 32]) -> Package {
    let version = Version::parse(version).expect("a version");
    Package::sign(code, version, &SigningKey::from_bytes(key))
}

/// Returns the shipped images as a release.
pub fn release(version: &str) -> Release {
    let packages = codes().each_ref().map(|code| signed(code, version, &KEY));
    Release::new(packages.to_vec()).expect("a release")
}

pub fn number(version: &str) -> u32 {
    Version::parse(version).expect("a version").0
}

pub fn update(client: &mut Client<BoardBus>, release: &Release) -> Result<Outcome, UpdateError> {
    Update::new(client, NODE.number(), release).run(&mut |_, _| ())
}

/// Returns a flash with a confirmed image in each of these slots, the last one newest.
pub fn confirmed(versions: &[(usize, &str)]) -> Content {
    let mut content = blank_board();
    for (sequence, (slot, version)) in versions.iter().enumerate() {
        let package = signed(&codes()[*slot], version, &KEY);
        install(&mut content, *slot, &package, sequence as u16 + 1);
        confirm(&mut content, *slot);
    }
    content
}

/// A whole update of a new board to 1.0.0 in slot B, over the bus.
pub struct RecordedUpdate {
    /// Flash before it, with saved parameters.
    pub before: Content,
    /// CRC of these parameters (2027h:1).
    pub parameters: u32,
    /// Its flash operations, up to the confirmation.
    pub operations: Vec<Operation>,
    /// Duration, ms, and length of the package, bytes.
    pub duration_ms: u64,
    pub bytes: u32,
}

pub fn parameters_crc(client: &mut Client<BoardBus>) -> u32 {
    client.read_number(Address::new(index::COMMIT, 1)).expect("an answer")
}

/// Returns the update, which is run once per process.
pub fn recorded_update() -> &'static RecordedUpdate {
    static UPDATE: LazyLock<RecordedUpdate> = LazyLock::new(|| {
        let mut client = started(new_board());
        let heartbeat = Address::new(index::HEARTBEAT, 0);
        client.write(heartbeat, &700u16.to_le_bytes()).expect("a setting");
        client.write(Address::new(index::STORE, 1), b"save").expect("a save");
        let before = client.bus().flash().content.clone();
        let operations = client.bus().flash().record_operations();
        let outcome = update(&mut client, &release("1.0.0")).expect("an update");
        assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
        assert_eq!(client.read_number(heartbeat).expect("an answer"), 700);
        assert_eq!(client.bus().resets, 1);
        RecordedUpdate {
            before,
            parameters: parameters_crc(&mut client),
            operations: operations.take(),
            duration_ms: outcome.duration_ms,
            bytes: outcome.bytes,
        }
    });
    &UPDATE
}

/// Returns the flash after this share of the transfer.
pub fn interrupted(percent: usize) -> Content {
    let update = recorded_update();
    let mut content = update.before.clone();
    let count = update.bytes as usize / 8 * percent / 100;
    update.operations[..count].iter().for_each(|operation| content.apply(operation));
    content
}

#[test]
fn update_of_whole_image_takes_less_than_a_minute_and_is_confirmed() {
    let update = recorded_update();
    let seconds = update.duration_ms as f64 * 1e-3;
    println!("measured: update of {} bytes in {seconds:.1} s", update.bytes);
    let scaled = seconds * 180e3 / f64::from(update.bytes);
    println!("measured: {scaled:.1} s for 180 KB at that rate, with 2 s of trial");
    assert!(seconds < 60.0, "{seconds} s");
}

#[test]
fn update_writes_the_package_from_the_begin_of_the_other_slot() {
    let mut client = started(confirmed(&[(0, "1.0.0")]));
    let operations = client.bus().flash().record_operations();
    client.bus().cut_at = Some(client.bus().now() + CORE_HZ / 2);
    update(&mut client, &release("1.0.1")).expect_err("the power is cut");
    let slot = SLOTS[1];
    let places: Vec<u32> = operations
        .borrow()
        .iter()
        .map(|operation| match *operation {
            Operation::Erase(at) | Operation::Program(at, _) => at,
        })
        .collect();
    println!("measured: {} operations before the cut", places.len());
    assert!(places.contains(&slot.start), "{places:x?}");
    let package = slot.start..slot.marks + 2048;
    assert!(places.iter().all(|at| package.contains(at)), "{places:x?}");
}

/// Starts a board that has received 1.0.1 in this slot, beside a confirmed 1.0.0 in the other one.
fn trial_of(slot: usize) -> Client<BoardBus> {
    let mut content = confirmed(&[(1 - slot, "1.0.0")]);
    install(&mut content, slot, &signed(&codes()[slot], "1.0.1", &KEY), 8);
    started(content)
}

#[test]
fn trial_in_slot_a_is_confirmed_after_its_self_test() {
    let mut client = trial_of(0);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.1"));
    assert_eq!(entry(&mut client, ProgramObject::STATE), TRIAL);
    client.bus().run(CORE_HZ * 5 / 2);
    assert_eq!(entry(&mut client, ProgramObject::STATE), CONFIRMED);
    assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::Confirmed as u32);
}

#[test]
fn trial_with_watchdog_reset_returns_to_the_old_image() {
    let mut client = trial_of(1);
    client.bus().machine().chip_mut().hold_loop_interrupt(CORE_HZ);
    client.bus().await_boot_up();
    assert_eq!(client.bus().resets, 1);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::Failed as u32);
}

#[test]
fn trial_with_reset_ordered_by_a_master_is_tried_again_and_confirmed() {
    let mut client = trial_of(1);
    let reset = Frame::new(0, &[0x81, NODE.number()]).expect("an NMT command");
    client.bus().send(&CanFrame::from(reset)).expect("room");
    client.bus().await_boot_up();
    assert_eq!(client.bus().resets, 1);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.1"));
    assert_eq!(entry(&mut client, ProgramObject::STATE), TRIAL);
    client.bus().run(CORE_HZ * 5 / 2);
    assert_eq!(entry(&mut client, ProgramObject::STATE), CONFIRMED);
}

/// Returns a flash with a trial of 1.0.1 in slot B that begins with these instructions, beside a confirmed 1.0.0.
pub fn trial_beginning_with(instructions: &[u8]) -> Content {
    let mut content = confirmed(&[(0, "1.0.0")]);
    let mut code = codes()[1].clone();
    let reset = u32::from_le_bytes(code.bytes[4..8].try_into().expect("a vector"));
    let at = (reset - 1 - code.address) as usize;
    code.bytes[at..at + instructions.len()].copy_from_slice(instructions);
    install(&mut content, 1, &signed(&code, "1.0.1", &KEY), 8);
    content
}

#[test]
fn trial_that_hangs_at_its_start_returns_to_the_old_image() {
    // A branch to itself.
    let mut client = started(trial_beginning_with(&[0xFE, 0xE7]));
    assert_eq!(client.bus().resets, 1, "the watchdog of the boot program");
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::Failed as u32);
}

/// Orders a reset: AIRCR = 05FA0004h, then a branch to itself.
const RESET_CODE: [u8; 20] = [
    0x4E, 0xF6, 0x0C, 0x50, 0xCE, 0xF2, 0x00, 0x00, 0x40, 0xF2, 0x04, 0x01, 0xC0, 0xF2, 0xFA, 0x51,
    0x01, 0x60, 0xFE, 0xE7,
];

#[test]
fn trial_that_resets_itself_returns_to_the_old_image() {
    let mut client = started(trial_beginning_with(&RESET_CODE));
    assert_eq!(client.bus().resets, 1, "by software");
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::Failed as u32);
}

#[test]
fn board_reports_its_wiring_and_the_key_of_its_boot_program() {
    let mut client = started(confirmed(&[(0, "1.0.0")]));
    let board = codes()[0].board;
    assert_eq!(entry(&mut client, ProgramObject::BOARD), board.number);
    assert_eq!(entry(&mut client, ProgramObject::WIRING), board.wiring);
    assert_eq!(entry(&mut client, ProgramObject::UPDATE_KEY), PUBLISHED_KEY);
    assert_eq!(codes()[1].board, board);
}

/// Excluded: start a signed program for another wiring, or an older one, by a replaced receiver.
#[test]
fn image_of_another_wiring_and_an_older_image_are_not_started() {
    let mut rewired = codes()[1].clone();
    rewired.board.wiring ^= 1;
    for (code, version) in [(&rewired, "1.0.1"), (&codes()[1], "0.9.0")] {
        let mut content = confirmed(&[(0, "1.0.0")]);
        install(&mut content, 1, &signed(code, version, &KEY), 8);
        let mut client = started(content);
        assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
        assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::NotSigned as u32);
    }
}

/// Excluded: start a program that the holder of the signing key did not sign.
#[test]
fn image_of_another_key_is_not_started() {
    let mut content = confirmed(&[(0, "1.0.0")]);
    install(&mut content, 1, &signed(&codes()[1], "1.0.1", &[8; 32]), 8);
    let mut client = started(content);
    assert_eq!(client.bus().resets, 0);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(entry(&mut client, ProgramObject::OTHER_STATE), OtherState::NotSigned as u32);
}

#[test]
fn image_linked_for_the_other_slot_is_not_started() {
    let mut content = confirmed(&[(0, "1.0.0")]);
    install(&mut content, 1, &signed(&codes()[0], "1.0.1", &KEY), 8);
    let mut client = started(content);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
}

/// Returns the offset of a byte of this slot, from the start of its package.
fn offset(slot: usize, at: usize) -> usize {
    SLOTS[slot].start as usize + at
}

#[test]
fn image_with_flipped_bits_in_flash_does_not_start() {
    let content = confirmed(&[(0, "1.0.0"), (1, "1.0.1")]);
    let last = codes()[1].bytes.len() + HEADER_BYTES - 1;
    let mark = SLOTS[1].marks as usize;
    let step = if is_long() { last / 200 } else { last / 3 };
    let body = (HEADER_BYTES..last).step_by(step).map(|at| offset(1, at));
    let header = [0, 12, 24, 28].map(|at| offset(1, at));
    let mut flips = 0;
    for at in header.into_iter().chain(body).chain([offset(1, last), mark]) {
        let mut flipped = content.clone();
        flipped.bytes[at] ^= 1 << (at % 8);
        let mut client = started(flipped);
        assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"), "{at:#x}");
        flips += 1;
    }
    println!("measured: {flips} flipped bits of an image in flash");
}

/// Attack: send a package to a joint in recovery, which has no lock. Bound: the signature.
#[test]
fn board_without_good_image_receives_one_in_recovery() {
    // Most of an update is there, and the old image is lost.
    let mut content = interrupted(if is_long() { 0 } else { 95 });
    content.bytes[SLOTS[0].marks as usize..][..2048].fill(0xFF);
    let mut client = started(content);
    assert_eq!(entry(&mut client, ProgramObject::STATE), RECOVERY_STATE);
    let product = client.read_number(Address::new(index::IDENTITY, 2)).expect("an answer");
    assert_eq!(product, u32::from_be_bytes(*b"FRIC"));
    let outcome = update(&mut client, &release("1.0.0")).expect("an update");
    assert_eq!(outcome.previous, None);
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(parameters_crc(&mut client), recorded_update().parameters);
    println!(
        "measured: recovery from byte {} on in {} ms",
        outcome.resumed_at, outcome.duration_ms
    );
}

#[test]
fn board_with_two_damaged_images_is_in_recovery() {
    let mut content = confirmed(&[(0, "1.0.0"), (1, "1.0.1")]);
    for slot in [0, 1] {
        content.bytes[offset(slot, 5000)] ^= 1;
    }
    let mut client = started(content);
    assert_eq!(entry(&mut client, ProgramObject::STATE), RECOVERY_STATE);
}

#[test]
fn update_from_slot_b_to_slot_a_is_confirmed() {
    if !is_long() {
        return println!("skipped: the update from slot B to slot A: tests/emulator/run --all");
    }
    let mut client = started(confirmed(&[(1, "1.0.0")]));
    let outcome = update(&mut client, &release("1.0.1")).expect("an update");
    assert_eq!(outcome.previous, Version::parse("1.0.0"));
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.1"));
}

/// Places of the two sets of a board that runs from slot A: the store is in the other bank.
const SETS: [usize; 2] = [0x7_E000, 0x7_F000];

#[test]
fn board_with_damaged_sets_keeps_its_key() {
    let secret_key = Key::new(*b"sixteen bytes !!");
    let following_time = Address::new(index::FOLLOWING_TIME, 0);
    let mut client = started(confirmed(&[(0, "1.0.0")]));
    client.set_key(secret_key).expect("the default key");
    client.write(Address::new(index::STORE, 1), b"save").expect("a save");
    let mut content = client.bus().flash().content.clone();
    SETS.iter().for_each(|set| content.bytes[set + 100] ^= 1);
    let refused = started(content.clone()).write(following_time, &[5, 0]);
    assert!(matches!(refused, Err(SdoError::WrongKey { .. })), "{refused:?}");
    let mut client = started(content).with_key(secret_key);
    client.write(following_time, &[5, 0]).expect("its key");
    let codes = client.read_number(Address::new(index::STATE, 4)).expect("an answer");
    assert_ne!(codes & 1 << (ParametersDefault.number() - 33), 0, "no set was loaded");
}
