//! Prints the EDS of the joint, which masters and configurators load:
//!
//! ```text
//! cargo run -p firmware --example joint_eds > joint.eds
//! ```
//!
//! The default values are read by SDO from a driver with an erased store.

mod eds;

use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, encode_upload_request, encode_upload_segment_request,
};
use compensator_core::can::{Frame, NodeId};
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_parts::StageTraits;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::store::memory::MemoryFlash;

type NewDriver = Driver<MemoryFlash<4>>;

const NODE: NodeId = NodeId::FIRST;

fn new_driver() -> NewDriver {
    let source = InputSource::Sensors;
    let settings = NodeSettings { node: NODE, source, ..NodeSettings::default() };
    // Hardware and serial number are values of a board, which the EDS leaves out.
    let identity = Identity { hardware: "", serial: 0, stage: StageTraits::NONE };
    Driver::boot(settings, MemoryFlash::new(), identity, &Boot::default(), 0)
}

/// Sends a request of a transfer; returns its answer, `None` for an abort.
fn exchange(driver: &mut NewDriver, request: &[u8; 8]) -> Option<[u8; 8]> {
    let node = u16::from(NODE.number());
    driver.receive(&Frame::new(0x600 + node, request).expect("a legal frame"), 0);
    let mut sent = std::iter::from_fn(|| driver.transmit());
    let answer = sent.find(|frame| frame.identifier() == 0x580 + node).expect("an answer");
    let data = answer.data().try_into().expect("eight bytes");
    decode_abort(&data).is_err().then_some(data)
}

/// Reads an object; `None` if the driver aborts the transfer.
fn read(driver: &mut NewDriver, index: u16, sub_index: u8) -> Option<Vec<u8>> {
    let answer = exchange(driver, &encode_upload_request(Address::new(index, sub_index)))?;
    if answer[0] & 2 != 0 {
        return Some(answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec());
    }
    let (mut value, mut toggle) = (Vec::new(), false);
    loop {
        let answer = exchange(driver, &encode_upload_segment_request(toggle))?;
        let segment = decode_data_segment(&answer).expect("a segment");
        value.extend_from_slice(segment.data);
        if segment.last {
            return Some(value);
        }
        toggle = !toggle;
    }
}

fn main() {
    let mut driver = new_driver();
    print!("{}", eds::eds(&mut |index, sub_index| read(&mut driver, index, sub_index)));
}
