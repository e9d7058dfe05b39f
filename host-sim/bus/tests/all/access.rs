//! Tests of the client with a locked joint driver: it unlocks the joint when a write is refused.

use super::message;
use crate::reference_network as reference;
use canopen_rs::Address;
use compensator_core::can::NodeId;
use compensator_core::network::record;
use firmware::access::Key;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommitObject;
use joint_bus::bus::Hub;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::joint::JointNode;

const FOLLOWING_TIME: Address = Address::new(index::FOLLOWING_TIME, 0);
const LEVEL: Address = Address::new(index::ACCESS, 1);
const OWN_KEY: Key = Key::new([7; 16]);

fn joint() -> Hub {
    let hub = Hub::new();
    hub.attach(JointNode::start(NodeId::FIRST, None).expect("starts without a file"));
    hub
}

#[test]
fn write_to_a_locked_joint_unlocks_it_once() {
    let hub = joint();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    assert_eq!(client.read_number(LEVEL).unwrap(), 0);
    client.write(FOLLOWING_TIME, &[5, 0]).unwrap();
    assert_eq!(client.read_number(LEVEL).unwrap(), 1);
    assert_eq!(client.read_number(FOLLOWING_TIME).unwrap(), 5);
    client.lock().unwrap();
    assert_eq!(client.read_number(LEVEL).unwrap(), 0);
}

#[test]
fn record_in_blocks_or_segments_unlocks_the_joint() {
    let hub = joint();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    let drive_at = Address::new(index::COMMIT, CommitObject::DRIVE_RECORD);
    let drive = client.read(drive_at).unwrap();
    client.write(drive_at, &drive).unwrap();
    client.lock().unwrap();
    client.write_blocks(drive_at, &drive, |_| ()).unwrap();
    assert_eq!(client.read_number(LEVEL).unwrap(), 1);
    // An open object needs no unlock.
    client.lock().unwrap();
    let network = record::emit(Some(&reference::joint()));
    let network_at = Address::new(index::COMMIT, CommitObject::NETWORK_RECORD);
    client.write_blocks(network_at, &network, |_| ()).unwrap();
    assert_eq!(client.read_number(LEVEL).unwrap(), 0);
}

#[test]
fn wrong_key_is_reported_with_the_object_and_the_remedy() {
    let hub = joint();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    client.set_key(OWN_KEY).unwrap();
    client.lock().unwrap();
    client.write(FOLLOWING_TIME, &[5, 0]).expect("it has the new key");
    client.lock().unwrap();
    let mut stranger = Client::new(hub.port(), NodeId::FIRST);
    let error = stranger.write(FOLLOWING_TIME, &[6, 0]).unwrap_err();
    assert!(matches!(error, SdoError::WrongKey { .. }));
    let parts = ["following_error_time_out (6066h:0)", "node 1", "--key FILE"];
    message::check("access", "wrong key", &error.to_string(), &parts);
    let error = stranger.write(FOLLOWING_TIME, &[6, 0]).unwrap_err();
    assert!(matches!(error, SdoError::UnlockDelayed { node: 1, .. }), "{error}");
    let words = error.to_string();
    message::check("access", "key given too soon", &words, &["following_error_time_out", "60 s"]);
    assert!(!words.contains("--key"), "the key may be right: {words}");
    assert_eq!(stranger.read_number(FOLLOWING_TIME).unwrap(), 5);
}

#[test]
fn joint_that_starts_open_needs_no_key() {
    let hub = joint();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    client.set_locked_by_default(false).unwrap();
    client.lock().unwrap();
    let mut stranger = Client::new(hub.port(), NodeId::FIRST).with_key(OWN_KEY);
    stranger.write(FOLLOWING_TIME, &[6, 0]).unwrap();
}

#[test]
fn open_joint_whose_key_is_unknown_is_not_locked() {
    let hub = joint();
    let mut client = Client::new(hub.port(), NodeId::FIRST);
    client.set_key(OWN_KEY).unwrap();
    client.set_locked_by_default(false).unwrap();
    let mut stranger = Client::new(hub.port(), NodeId::FIRST);
    let error = stranger.set_locked_by_default(true).unwrap_err();
    assert!(matches!(error, SdoError::WrongKey { .. }), "{error}");
    let error = stranger.set_key(Key::DEFAULT).unwrap_err();
    assert!(matches!(error, SdoError::UnlockDelayed { .. }), "{error}");
    stranger.write(FOLLOWING_TIME, &[6, 0]).expect("still open");
}
