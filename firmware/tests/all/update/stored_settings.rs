//! The settings of the bus that the boot program finds in recovery: of a copy of the identity, or of the newest set.

use super::bench::{Flash, program};
use compensator_core::can::NodeId;
use embedded_storage::nor_flash::NorFlash;
use firmware::node_settings::{BusSettings, NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use firmware::store::Store;
use firmware::store::image::{self, COMMIT_AT, Commit, SlotHeader};
use firmware::store::memory::PAGE_BYTES;
use firmware::update::Program;
use firmware::update::recovery::stored_settings;

/// Length of a store, bytes: two slots of two pages.
const STORE_BYTES: u32 = 4 * PAGE_BYTES as u32;

/// A device with two stores that fill its flash.
fn device() -> Program {
    Program { stores: [0, STORE_BYTES], store_bytes: STORE_BYTES, ..program(0) }
}

fn settings(node: u8) -> NodeSettings {
    NodeSettings { node: NodeId::new(node).unwrap(), ..NodeSettings::default() }
}

/// Writes a set with this node number and this sequence number at an offset, without a copy of the identity.
fn write_set(flash: &mut Flash, at: u32, node: u8, sequence: u32) {
    let payload = emit_block(&settings(node), &ParameterSet::default());
    let length = payload.len() as u16;
    let head = SlotHeader { version: image::VERSION, length, sequence }.emit();
    let mut commit = Commit::begin();
    for (offset, unit) in image::units(&head, &payload) {
        commit.update(&unit);
        flash.write(at + offset, &unit).unwrap();
    }
    flash.write(at + COMMIT_AT, &commit.emit()).unwrap();
}

#[test]
fn settings_without_a_copy_are_those_of_the_newest_set_also_when_its_sequence_wraps() {
    for (running, other, newer) in [(5, 6, 2), (6, 5, 1), (u32::MAX, 0, 2), (0, u32::MAX, 1)] {
        let mut flash = Flash::new();
        write_set(&mut flash, 0, 1, running);
        write_set(&mut flash, STORE_BYTES, 2, other);
        let found = stored_settings(&mut flash, &device());
        assert_eq!(found.node.number(), newer, "{running} and {other}");
    }
}

#[test]
fn settings_of_a_copy_are_found_although_its_set_is_damaged() {
    let mut store = Store::open_within(Flash::new(), device().running_store());
    let stored = settings(9);
    store.save(&emit_block(&stored, &ParameterSet::default()), &stored.identity()).unwrap();
    let mut flash = store.into_flash();
    flash.flip_bit(100 * 8);
    assert_eq!(stored_settings(&mut flash, &device()), stored.bus());
}

#[test]
fn settings_of_an_empty_flash_are_the_defaults() {
    assert_eq!(stored_settings(&mut Flash::new(), &device()), BusSettings::default());
}
