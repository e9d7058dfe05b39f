//! The EDS, which describes the dictionary for CANopen tools (CiA 306), from the dictionary and the values of a new driver.

use firmware::access::Level;
use firmware::node::bit_timing::BIT_RATES_KBIT;
use firmware::node::dictionary::{self, Access, DataType, Entry, OBJECTS, Object, Shape, index};
use std::fmt::Write;

/// Reads the value of an index and a sub-index; `None` if the driver aborts the transfer.
type Read<'a> = dyn FnMut(u16, u8) -> Option<Vec<u8>> + 'a;

/// Mandatory objects of every device.
const MANDATORY: [u16; 3] = [index::DEVICE_TYPE, index::ERROR_REGISTER, index::IDENTITY];

fn access(entry: &Entry) -> &'static str {
    match entry.access {
        Access::Const => "const",
        Access::ReadOnly => "ro",
        Access::ReadWrite => "rw",
        Access::Input => "rww",
        Access::WriteOnly => "wo",
    }
}

/// Returns true if a value is the node number plus a constant.
fn by_node(object: u16, sub_index: u8) -> bool {
    let is_pdo = (0x1400..0x1600).contains(&object) || (0x1800..0x1A00).contains(&object);
    object == index::EMERGENCY_IDENTIFIER
        || object == index::SDO_SERVER && sub_index > 0
        || is_pdo && sub_index == 1
}

fn is_mapping(object: u16) -> bool {
    (0x1600..0x1800).contains(&object) || (0x1A00..0x1C00).contains(&object)
}

/// Returns the default value in the syntax of the format; `None` if the driver changes it.
fn default(read: &mut Read<'_>, object: &Object, sub_index: u8, entry: &Entry) -> Option<String> {
    let changes = matches!(entry.access, Access::ReadOnly | Access::Input)
        || object.index == index::LAST_PANIC
        || object.index == index::REFUSAL
        || entry.data == DataType::Domain
        // Values of the board.
        || matches!(object.index, index::HARDWARE_VERSION)
        || object.index == index::IDENTITY && sub_index == 4;
    if changes {
        return None;
    }
    let value = read(object.index, sub_index)?;
    if entry.data == DataType::VisibleString {
        return Some(String::from_utf8(value).expect("text"));
    }
    let number = value.iter().rev().fold(0u32, |number, byte| number << 8 | u32::from(*byte));
    Some(match entry.data {
        // Some tools read the fields of a mapping by their digits.
        _ if is_mapping(object.index) && sub_index > 0 => format!("0x{number:08X}"),
        _ if by_node(object.index, sub_index) => format!("$NODEID+0x{:X}", number - 1),
        // A float is written as its bits, because the tools of Lely accept no decimal number.
        DataType::Real32 => format!("0x{number:08X}"),
        // Tools read a hexadecimal number as positive.
        DataType::Integer8 if (number as i8) < 0 => (number as i8).to_string(),
        DataType::Integer16 if (number as i16) < 0 => (number as i16).to_string(),
        DataType::Integer32 if (number as i32) < 0 => (number as i32).to_string(),
        _ => format!("0x{number:X}"),
    })
}

fn list(text: &mut String, name: &str, objects: &[&Object]) {
    let _ = write!(text, "\n[{name}]\nSupportedObjects={}\n", objects.len());
    for (place, object) in objects.iter().enumerate() {
        let _ = writeln!(text, "{}=0x{:04X}", place + 1, object.index);
    }
}

/// Returns the comment before an entry. The format has no key for the level, and tools accept comments only there.
fn level_comment(object: &Object, sub_index: u8, entry: &Entry) -> &'static str {
    let is_written = !matches!(entry.access, Access::Const | Access::ReadOnly);
    let needs_service =
        dictionary::find(object.index, sub_index).is_ok_and(|entry| entry.level == Level::Service);
    if is_written && needs_service { ";AccessLevel=service\n" } else { "" }
}

fn value(text: &mut String, read: &mut Read<'_>, object: &Object, sub_index: u8, entry: &Entry) {
    let mapped = u8::from(
        dictionary::is_received(object.index, sub_index)
            || dictionary::is_transmitted(object.index, sub_index),
    );
    let _ = write!(
        text,
        "ObjectType=0x7\nDataType=0x{:04X}\nAccessType={}\n",
        entry.data as u8,
        access(entry)
    );
    if let Some(default) = default(read, object, sub_index, entry) {
        let _ = writeln!(text, "DefaultValue={default}");
    }
    let _ = writeln!(text, "PDOMapping={mapped}");
}

/// Returns the EDS. `read` returns the values of a new driver on its own sensors.
pub fn eds(read: &mut Read<'_>) -> String {
    let mut text = String::from(
        "[FileInfo]\n\
         FileName=joint.eds\n\
         FileVersion=1\n\
         FileRevision=1\n\
         EDSVersion=4.0\n\
         Description=Friction-compensated joint driver\n\
         CreationTime=12:00PM\n\
         CreationDate=01-05-2026\n\
         CreatedBy=joint driver project\n\
         ModificationTime=12:00PM\n\
         ModificationDate=11-28-2026\n\
         ModifiedBy=joint driver project\n\
         \n\
         [DeviceInfo]\n\
         VendorName=none\n\
         VendorNumber=0x0\n\
         ProductName=joint driver\n\
         ProductNumber=0x46524943\n\
         RevisionNumber=0x2\n\
         OrderCode=0\n",
    );
    for kbit in [10, 20, 50, 125, 250, 500, 800, 1000] {
        let _ = writeln!(text, "BaudRate_{kbit}={}", u8::from(BIT_RATES_KBIT.contains(&kbit)));
    }
    text.push_str(
        "SimpleBootUpMaster=0\n\
         SimpleBootUpSlave=1\n\
         Granularity=0\n\
         DynamicChannelsSupported=0\n\
         GroupMessaging=0\n\
         NrOfRXPDO=6\n\
         NrOfTXPDO=6\n\
         LSS_Supported=1\n\
         \n\
         [DummyUsage]\n\
         Dummy0001=0\n\
         Dummy0002=0\n\
         Dummy0003=0\n\
         Dummy0004=0\n\
         Dummy0005=0\n\
         Dummy0006=0\n\
         Dummy0007=0\n",
    );
    let all = |keep: &dyn Fn(u16) -> bool| -> Vec<&Object> {
        OBJECTS.iter().filter(|object| keep(object.index)).collect()
    };
    list(&mut text, "MandatoryObjects", &all(&|index| MANDATORY.contains(&index)));
    list(
        &mut text,
        "OptionalObjects",
        &all(&|index| !(0x2000..0x6000).contains(&index) && !MANDATORY.contains(&index)),
    );
    list(&mut text, "ManufacturerObjects", &all(&|index| (0x2000..0x6000).contains(&index)));
    for object in OBJECTS {
        let comment = match object.shape {
            Shape::Variable(entry) => level_comment(object, 0, &entry),
            _ => "",
        };
        let _ = write!(text, "\n{comment}[{:04X}]\nParameterName={}\n", object.index, object.name);
        if let Shape::Variable(entry) = object.shape {
            value(&mut text, read, object, 0, &entry);
            continue;
        }
        let kind = if matches!(object.shape, Shape::Array(..)) { 8 } else { 9 };
        let _ = writeln!(
            text,
            "ObjectType=0x{kind}\nSubNumber={}",
            u16::from(object.highest_sub_index()) + 1
        );
        for sub_index in 0..=object.highest_sub_index() {
            let entry = object.entry(sub_index).expect("within its last");
            let many = matches!(object.shape, Shape::Array(..)) || entry.name == "term";
            let name = match sub_index {
                0 => "highest_sub_index".to_owned(),
                _ if many => format!("{}_{sub_index}", entry.name),
                _ => entry.name.to_owned(),
            };
            let _ = write!(
                text,
                "\n{}[{:04X}sub{sub_index:X}]\nParameterName={name}\n",
                level_comment(object, sub_index, &entry),
                object.index
            );
            value(&mut text, read, object, sub_index, &entry);
        }
    }
    text
}
