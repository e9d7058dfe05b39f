//! The EDS of the joint, which `cargo run -p firmware --example joint_eds` prints, against the dictionary and the driver.

#[path = "../../../examples/joint_eds/eds.rs"]
mod generator;

use super::bench::Bench;
use compensator_core::can::NodeId;
use firmware::node::dictionary::{self, Access, DataType, OBJECTS, Shape, index};
use std::collections::{BTreeMap, BTreeSet};

/// Sub-index of the node number in 2001h.
const NODE_NUMBER: u8 = 6;

/// Keys and values of each section, as a tool reads them.
type Sections = BTreeMap<String, BTreeMap<String, String>>;

fn sections(bench: &mut Bench) -> Sections {
    let text = generator::eds(&mut |index, sub_index| bench.read(index, sub_index).ok());
    let (mut sections, mut name) = (Sections::new(), String::new());
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with(';')) {
        if let Some(head) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            head.clone_into(&mut name);
            assert!(sections.insert(name.clone(), BTreeMap::new()).is_none(), "twice: [{name}]");
            continue;
        }
        let (key, value) = line.split_once('=').expect("a key and its value");
        let section = sections.get_mut(&name).expect("a section");
        assert!(
            section.insert(key.to_owned(), value.to_owned()).is_none(),
            "twice: [{name}] {key}"
        );
    }
    sections
}

/// Returns the value of a number: `0x`, decimal, or `$NODEID+0x` for this node.
fn number(text: &str, node: u8) -> u32 {
    let (base, rest) = match text.strip_prefix("$NODEID+") {
        Some(rest) => (u32::from(node), rest),
        None => (0, text),
    };
    let number = match rest.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).expect("hexadecimal digits"),
        None => rest.parse::<i32>().expect("a decimal number") as u32,
    };
    base + number
}

/// Name of the section of a value.
fn section_of(object: &dictionary::Object, sub_index: u8) -> String {
    match object.shape {
        Shape::Variable(_) => format!("{:04X}", object.index),
        _ => format!("{:04X}sub{sub_index:X}", object.index),
    }
}

#[test]
fn eds_lists_every_object_once_with_a_section() {
    let sections = sections(&mut Bench::on_sensors());
    let mut listed = Vec::new();
    for name in ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"] {
        let list = &sections[name];
        assert_eq!(number(&list["SupportedObjects"], 0) as usize, list.len() - 1, "{name}");
        listed.extend((1..list.len()).map(|place| number(&list[&place.to_string()], 0) as u16));
    }
    listed.sort_unstable();
    let indices: Vec<u16> = OBJECTS.iter().map(|object| object.index).collect();
    assert_eq!(listed, indices);
    assert!(indices.len() > 100, "{}", indices.len());
    for object in OBJECTS {
        let section = &sections[&format!("{:04X}", object.index)];
        assert_eq!(section["ParameterName"], object.name);
        if !matches!(object.shape, Shape::Variable(_)) {
            let count = u32::from(object.highest_sub_index()) + 1;
            assert_eq!(number(&section["SubNumber"], 0), count, "{:04X}", object.index);
        }
    }
    let expected = OBJECTS.iter().flat_map(|object| {
        let subs = 0..=object.highest_sub_index();
        subs.map(|sub_index| section_of(object, sub_index))
            .chain([format!("{:04X}", object.index)])
            .collect::<Vec<_>>()
    });
    let expected: BTreeSet<String> = expected.collect();
    let found =
        sections.keys().filter(|name| name.starts_with(|first: char| first.is_ascii_digit()));
    assert_eq!(found.cloned().collect::<BTreeSet<_>>(), expected);
}

#[test]
fn eds_values_have_the_types_and_rights_of_their_entries() {
    let sections = sections(&mut Bench::on_sensors());
    for object in OBJECTS {
        for sub_index in 0..=object.highest_sub_index() {
            let name = section_of(object, sub_index);
            let section = &sections[&name];
            let entry = object.entry(sub_index).expect("within its last");
            assert_eq!(number(&section["DataType"], 0), entry.data as u32, "{name}");
            let is_written = matches!(section["AccessType"].as_str(), "rw" | "rww" | "wo");
            let is_read_only = matches!(entry.access, Access::Const | Access::ReadOnly);
            assert_eq!(is_written, !is_read_only, "{name}");
            let is_mapped = dictionary::is_received(object.index, sub_index)
                || dictionary::is_transmitted(object.index, sub_index);
            assert_eq!(section["PDOMapping"] == "1", is_mapped, "{name}");
            // A master may only receive into what it can write.
            let is_input = dictionary::is_received(object.index, sub_index);
            assert!(!is_input || is_written, "{name}");
        }
    }
}

/// A master that finds another default than the EDS says writes the object at every start.
#[test]
fn eds_defaults_are_the_values_of_a_new_joint_with_another_number() {
    let sections = sections(&mut Bench::on_sensors());
    let node = NodeId::new(5).expect("a legal number");
    let mut bench = Bench::numbered(node);
    let mut compared = 0;
    for object in OBJECTS {
        for sub_index in 0..=object.highest_sub_index() {
            let entry = object.entry(sub_index).expect("within its last");
            let name = section_of(object, sub_index);
            // The node number itself, of a joint that got none.
            let is_node = (object.index, sub_index) == (index::OPERATION, NODE_NUMBER);
            let Some(default) = sections[&name].get("DefaultValue").filter(|_| !is_node) else {
                continue;
            };
            let value = bench.read(object.index, sub_index).expect("can be read");
            compared += 1;
            if entry.data == DataType::VisibleString {
                assert_eq!(default.as_bytes(), value, "{name}");
                continue;
            }
            let expected = number(default, node.number()).to_le_bytes();
            assert_eq!(value, expected[..value.len()], "{name}: {default}");
        }
    }
    assert!(compared > 400, "{compared}");
}

/// The identifiers and the layout in the EDS match the frames.
#[test]
fn pdo_mappings_have_the_length_of_their_frames() {
    let mut bench = Bench::hil();
    let words = [(index::MAPPING_RECEIVED_COMMAND, 5u16), (index::MAPPING_ANSWER, 5)];
    for (first, count) in words {
        for object in first..first + count {
            let bits: u32 = (1..=2).map(|place| bench.number(object, place) & 0xFF).sum();
            assert_eq!(bits, 64, "{object:04X}");
            for place in 1..=2 {
                let mapped = bench.number(object, place);
                let (index, sub_index) = ((mapped >> 16) as u16, (mapped >> 8) as u8);
                let entry = firmware::node::dictionary::find(index, sub_index).expect("is there");
                assert_eq!(entry.data.length(), Some(4));
            }
        }
    }
}
