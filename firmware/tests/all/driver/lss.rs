//! Tests of the layer setting services: joints from the shelf get their node numbers over the bus.

use super::bench::{Bench, Flash, frame};
use canopen_rs::sdo::encode_upload_request;
use firmware::driver::Boot;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node::lss::{LSS_ANSWER, LSS_REQUEST};
use firmware::node_settings::InputSource;

/// A master and joints on one bus.
struct Bus {
    joints: Vec<Bench>,
}

impl Bus {
    fn new(serials: &[u32]) -> Self {
        let mut joints: Vec<Bench> = serials.iter().map(|serial| Bench::blank(*serial)).collect();
        joints.iter_mut().for_each(|joint| drop(joint.sent()));
        Self { joints }
    }

    /// Sends a request to all joints. Returns the answers on the wire: equal ones are one frame.
    fn request(&mut self, request: [u8; 8]) -> Vec<[u8; 8]> {
        let mut answers: Vec<[u8; 8]> = Vec::new();
        for joint in &mut self.joints {
            joint.driver.receive(&frame(LSS_REQUEST, &request), joint.now_us);
            for sent in joint.sent().iter().filter(|sent| sent.identifier() == LSS_ANSWER) {
                answers.push(sent.data().try_into().unwrap());
            }
        }
        answers.dedup();
        answers
    }

    fn command(&mut self, command: u8, number: u32) -> Vec<[u8; 8]> {
        let [a, b, c, d] = number.to_le_bytes();
        self.request([command, a, b, c, d, 0, 0, 0])
    }

    fn scan(&mut self, number: u32, bit_check: u8, part: u8, next: u8) -> bool {
        let [a, b, c, d] = number.to_le_bytes();
        let answers = self.request([0x51, a, b, c, d, bit_check, part, next]);
        assert!(answers.iter().all(|answer| answer[0] == 0x4F) && answers.len() <= 1);
        !answers.is_empty()
    }

    /// Finds a joint without a number by fastscan (CiA 305, 4.3.6) and selects it.
    fn fastscan(&mut self) -> Option<[u32; 4]> {
        if !self.scan(0, 0x80, 0, 0) {
            return None;
        }
        let mut identity = [0; 4];
        for part in 0..4u8 {
            let mut number = 0;
            for bit in (0..32).rev() {
                // Without an answer, the bit is 1 in all joints that are left.
                if !self.scan(number, bit, part, part) {
                    number |= 1 << bit;
                }
            }
            let next = (part + 1) % 4;
            assert!(self.scan(number, 0, part, next), "part {part}: {number:X}");
            identity[usize::from(part)] = number;
        }
        Some(identity)
    }

    /// Configures, stores and starts the selected joint.
    fn give_number(&mut self, node: u8) {
        assert_eq!(self.command(0x11, node.into()), [[0x11, 0, 0, 0, 0, 0, 0, 0]]);
        assert_eq!(self.command(0x17, 0), [[0x17, 0, 0, 0, 0, 0, 0, 0]]);
        assert!(self.command(0x04, 0).is_empty());
    }
}

#[test]
fn two_blank_joints_get_two_numbers_by_fastscan() {
    let serials = [0x0012_3456, 0x8012_3456];
    let mut bus = Bus::new(&serials);
    // Both answer, with the same frame.
    assert_eq!(bus.command(0x4C, 0), [[0x50, 0, 0, 0, 0, 0, 0, 0]]);
    for node in [21u8, 22] {
        let [vendor, product, _, serial] = bus.fastscan().expect("one is left");
        assert_eq!((vendor, product), (0, u32::from_be_bytes(*b"FRIC")));
        assert!(serials.contains(&serial));
        assert_eq!(bus.command(0x5D, 0)[0][1..5], serial.to_le_bytes());
        bus.give_number(node);
    }
    assert_eq!(bus.fastscan(), None);
    assert!(bus.command(0x4C, 0).is_empty());
    // The numbers are effective, and stored.
    let mut numbers = Vec::new();
    for (mut joint, serial) in bus.joints.into_iter().zip(serials) {
        let node = joint.driver.node().number();
        let request = encode_upload_request(canopen_rs::Address::new(index::IDENTITY, 4));
        joint.driver.receive(&frame(0x600 + u16::from(node), &request), joint.now_us);
        let answer = joint.sent();
        assert_eq!(answer[0].identifier(), 0x580 + u16::from(node));
        assert_eq!(answer[0].data()[4..], serial.to_le_bytes());
        let flash: Flash = joint.driver.joint.into_flash();
        let joint = Bench::boot(InputSource::Sensors, flash, &Boot::default());
        assert_eq!(joint.driver.node().number(), node);
        numbers.push(node);
    }
    numbers.sort_unstable();
    assert_eq!(numbers, [21, 22]);
}

#[test]
fn blank_joint_without_storing_starts_with_its_number_when_the_configuration_ends() {
    let mut bus = Bus::new(&[5]);
    bus.fastscan().unwrap();
    bus.command(0x11, 30);
    let joint = &mut bus.joints[0];
    joint.driver.receive(&frame(LSS_REQUEST, &[4, 0, 0, 0, 0, 0, 0, 0]), joint.now_us);
    assert_eq!(joint.sent()[0], frame(0x71E, &[0]), "boot-up");
    assert_eq!(joint.driver.node().number(), 30);
}

#[test]
fn switch_to_an_unknown_mode_changes_nothing() {
    let mut bus = Bus::new(&[5]);
    bus.fastscan().unwrap();
    assert!(bus.command(0x04, 2).is_empty());
    assert_eq!(bus.command(0x5E, 0), [[0x5E, 255, 0, 0, 0, 0, 0, 0]], "it is still configured");
}

#[test]
fn joint_is_selected_by_its_whole_identity_only() {
    let mut bus = Bus::new(&[5, 6]);
    let product = u32::from_be_bytes(*b"FRIC");
    let revision = bus.joints[0].number(index::IDENTITY, 3);
    let select = |bus: &mut Bus, serial| {
        bus.command(0x40, 0);
        bus.command(0x41, product);
        bus.command(0x42, revision);
        bus.command(0x43, serial)
    };
    assert!(bus.command(0x5E, 0).is_empty(), "nobody is configured");
    assert!(select(&mut bus, 7).is_empty());
    assert_eq!(select(&mut bus, 6), [[0x44, 0, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(bus.command(0x5E, 0)[0][1], 255);
    assert_eq!(bus.command(0x5B, 0)[0][1..5], product.to_le_bytes());
    for wrong in [0, 128, 255] {
        assert_eq!(bus.command(0x11, wrong)[0][1], 1);
    }
    // Bit rates of the standard table; the joint has no 800 kbit/s.
    for (place, code) in [(2, 0), (1, 1), (9, 1)] {
        assert_eq!(bus.request([0x13, 0, place, 0, 0, 0, 0, 0])[0], [0x13, code, 0, 0, 0, 0, 0, 0]);
    }
    assert_eq!(bus.joints[1].number(index::OPERATION, 7), 500);
    assert_eq!(bus.joints[0].number(index::OPERATION, 7), 1000);
    bus.command(0x04, 0);
    // A range of serial numbers finds joints with and without a number.
    let identify = |bus: &mut Bus, first, last| {
        for (command, number) in [(0x46, 0), (0x47, product), (0x48, 0), (0x49, 99), (0x4A, first)]
        {
            assert!(bus.command(command, number).is_empty());
        }
        bus.command(0x4B, last).len()
    };
    assert_eq!((identify(&mut bus, 6, 9), identify(&mut bus, 7, 9)), (1, 0));
}

#[test]
fn armed_or_numbered_joint_keeps_its_number() {
    let mut bench = Bench::hil();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    bench.driver.receive(&frame(0, &[0x82, 0]), bench.now_us);
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    let mut bus = Bus { joints: vec![bench] };
    assert_eq!(bus.fastscan(), None);
    bus.command(0x04, 1);
    assert_eq!(bus.command(0x11, 9), [[0x11, 255, 0, 0, 0, 0, 0, 0]]);
    assert_eq!(bus.joints[0].number(index::OPERATION, 6), 1);
    assert!(bus.joints[0].driver.joint.is_armed());
}
