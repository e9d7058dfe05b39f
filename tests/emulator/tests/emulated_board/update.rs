//! Program updates of the emulated board: the shipped boot program and images, and the client of host-sim.

use super::board_bus::{BoardBus, MILLISECOND, NODE, blank_board, entry, new_board, started};
use super::common::image_path;
use super::slots::{SLOTS, confirm, install};
use canopen_rs::Address;
use compensator_core::can::Frame;
use ed25519_dalek::SigningKey;
use emulated_board::chip::CORE_HZ;
use emulated_board::chip::flash::Content;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::ProgramObject;
use firmware::update::package::{HEADER_BYTES, Version};
use firmware::update::recovery::RECOVERY_STATE;
use firmware::update::session::OtherState;
use joint_bus::canopen::Client;
use joint_bus::program::package::{Code, Package, Release, Statement, read_image};
use joint_bus::program::update::{Outcome, Update, UpdateError};
use std::sync::LazyLock;

const BOARD: u32 = u32::from_be_bytes(*b"G474");
/// The published test key, firmware/keys/test.key.
const KEY: [u8; 32] = [7; 32];
/// Running states in object 2040h.
const TRIAL: u32 = 1;
const CONFIRMED: u32 = 2;

/// Returns the code of the images for slots A and B.
fn codes() -> &'static [Code; 2] {
    static CODES: LazyLock<[Code; 2]> = LazyLock::new(|| {
        ["firmware", "firmware-b"].map(|name| read_image(&image_path(name)).expect("an image"))
    });
    &CODES
}

fn signed(code: &Code, version: &str, key: &[u8; 32]) -> Package {
    let version = Version::parse(version).expect("a version");
    let statement = Statement { board: BOARD, version, counter: 0 };
    Package::sign(code, statement, &SigningKey::from_bytes(key))
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

#[test]
fn update_of_whole_image_takes_less_than_a_minute_and_is_confirmed() {
    let mut client = started(new_board());
    let outcome = update(&mut client, &release("1.0.0")).expect("an update");
    let seconds = outcome.duration_ms as f64 * 1e-3;
    println!("measured: update of {} bytes in {seconds:.1} s", outcome.bytes);
    println!("measured: that is {:.1} s for 180 KB", seconds * 180e3 / f64::from(outcome.bytes));
    assert!(seconds < 60.0, "{seconds} s");
    assert_eq!(entry(&mut client, ProgramObject::VERSION), number("1.0.0"));
    assert_eq!(client.bus().resets, 1);
}
