//! The image's parameters over its bus: saved ones survive a reset and a power cut, others do not; refusals name the field.

use super::board_bus::{BoardBus, MILLISECOND, started_image};
use canopen_rs::{Address, NmtCommand};
use compensator_core::LawKind;
use firmware::node::dictionary::index;
use firmware::node_settings::InputSource;
use firmware::parameter_set::ParameterSet;
use firmware::reference_joint::configuration;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::parameters::{read_set, write_set};

/// Number of the static torque among the parameters of the friction model.
const STATIC_TORQUE: u8 = 2;

fn set() -> ParameterSet {
    let friction = configuration(LawKind::ImprovedLugre, &[]);
    ParameterSet { friction, ..ParameterSet::default() }
}

fn number(client: &mut Client<BoardBus>, index: u16, sub_index: u8) -> u32 {
    client.read_number(Address::new(index, sub_index)).expect("an answer")
}

/// Resets the node over its bus.
fn reset(client: &mut Client<BoardBus>) {
    let before = client.bus().resets;
    client.command(NmtCommand::ResetNode).expect("a bus");
    client.bus().await_boot_up();
    assert_eq!(client.bus().resets, before + 1);
}

#[test]
fn status_of_new_board_names_it_without_a_fault() {
    let mut client = started_image();
    let hardware = client.read_text(Address::new(index::HARDWARE_VERSION, 0)).expect("a text");
    assert!(hardware.contains("STM32G474"), "{hardware}");
    let states = [2, 3].map(|entry| number(&mut client, index::STATE, entry));
    assert_eq!(states, [0, 0], "state and faults");
    assert_eq!(client.read_text(Address::new(index::LAST_PANIC, 0)).expect("a text"), "");
}

#[test]
fn saved_set_survives_reset_and_power_cut_and_another_does_not() {
    let mut client = started_image();
    let saved = set();
    write_set(&mut client, &saved).expect("a legal set");
    client.write(Address::new(index::STORE, 1), b"save").expect("a save");
    let mut other = set();
    other.friction.compensator.scale = 0.5;
    let changed = write_set(&mut client, &other).expect("a legal set");
    assert_eq!(number(&mut client, index::COMMIT, 1), changed);
    reset(&mut client);
    assert_eq!(number(&mut client, index::COMMIT, 1), saved.crc());
    client.bus().cut_power();
    client.bus().await_boot_up();
    let found: ParameterSet = read_set(&mut client).expect("a set");
    assert_eq!(found, saved);
}

#[track_caller]
fn assert_refused(result: Result<(), SdoError>, words: &[&str]) {
    let Err(SdoError::Refused { why, .. }) = result else { panic!("{result:?}") };
    assert!(words.iter().all(|word| why.contains(word)), "{why}");
}

#[test]
fn refused_write_names_its_field_and_changes_nothing() {
    let mut client = started_image();
    let before = number(&mut client, index::COMMIT, 1);
    let parameter = Address::new(index::PARAMETERS, STATIC_TORQUE);
    assert_refused(client.write(parameter, &(-1.0f32).to_le_bytes()), &["static_torque", "-1"]);
    client.write(Address::new(index::OPERATION, 1), &[InputSource::Bus as u8]).expect("a setting");
    client.command(NmtCommand::StartRemoteNode).expect("a bus");
    client.write(Address::new(index::STATE, 1), &[1]).expect("it arms");
    client.bus().run(10 * MILLISECOND);
    assert_refused(client.write(parameter, &2.0f32.to_le_bytes()), &["disarm first"]);
    client.write(Address::new(index::STATE, 1), &[0]).expect("it disarms");
    assert_eq!(number(&mut client, index::COMMIT, 1), before);
}
