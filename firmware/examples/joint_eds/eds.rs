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

const FILE_AND_DEVICE: &str = "\
[FileInfo]
FileName=joint.eds
FileVersion=1
FileRevision=1
EDSVersion=4.0
Description=Friction-compensated joint driver
CreationTime=12:00PM
CreationDate=01-05-2026
CreatedBy=joint driver project
ModificationTime=12:00PM
ModificationDate=11-28-2026
ModifiedBy=joint driver project

[DeviceInfo]
VendorName=none
VendorNumber=0x0
ProductName=joint driver
ProductNumber=0x46524943
RevisionNumber=0x2
OrderCode=0
";

const AFTER_BIT_RATES: &str = "\
SimpleBootUpMaster=0
SimpleBootUpSlave=1
Granularity=0
DynamicChannelsSupported=0
GroupMessaging=0
NrOfRXPDO=6
NrOfTXPDO=6
LSS_Supported=1

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=0
Dummy0006=0
Dummy0007=0
";

/// Bit rates that the format has keys for.
const EDS_BIT_RATES_KBIT: [u16; 8] = [10, 20, 50, 125, 250, 500, 800, 1000];

fn lists(text: &mut String) {
    let is_mandatory = |index: u16| MANDATORY.contains(&index);
    let is_manufacturers = |index: u16| (0x2000..0x6000).contains(&index);
    let mut list = |name: &str, contains: &dyn Fn(u16) -> bool| {
        let objects: Vec<_> = OBJECTS.iter().filter(|object| contains(object.index)).collect();
        let _ = write!(text, "\n[{name}]\nSupportedObjects={}\n", objects.len());
        for (place, object) in objects.iter().enumerate() {
            let _ = writeln!(text, "{}=0x{:04X}", place + 1, object.index);
        }
    };
    list("MandatoryObjects", &is_mandatory);
    list("OptionalObjects", &|index| !is_manufacturers(index) && !is_mandatory(index));
    list("ManufacturerObjects", &is_manufacturers);
}

/// Adds an object that has sub-indices, and the value of each of them.
fn values(text: &mut String, read: &mut Read<'_>, object: &Object) {
    let is_array = matches!(object.shape, Shape::Array(..));
    let kind = if is_array { 8 } else { 9 };
    let sub_indices = u16::from(object.highest_sub_index()) + 1;
    let _ = writeln!(text, "ObjectType=0x{kind}\nSubNumber={sub_indices}");
    for sub_index in 0..=object.highest_sub_index() {
        let entry = object.entry(sub_index).expect("within its last");
        let name = match sub_index {
            0 => "highest_sub_index".to_owned(),
            _ if is_array || entry.name == "term" => format!("{}_{sub_index}", entry.name),
            _ => entry.name.to_owned(),
        };
        let comment = level_comment(object, sub_index, &entry);
        let section = format!("{:04X}sub{sub_index:X}", object.index);
        let _ = write!(text, "\n{comment}[{section}]\nParameterName={name}\n");
        value(text, read, object, sub_index, &entry);
    }
}

/// Returns the EDS. `read` returns the values of a new driver on its own sensors.
pub fn eds(read: &mut Read<'_>) -> String {
    let mut text = String::from(FILE_AND_DEVICE);
    for kbit in EDS_BIT_RATES_KBIT {
        let _ = writeln!(text, "BaudRate_{kbit}={}", u8::from(BIT_RATES_KBIT.contains(&kbit)));
    }
    text.push_str(AFTER_BIT_RATES);
    lists(&mut text);
    for object in OBJECTS {
        let comment = match object.shape {
            Shape::Variable(entry) => level_comment(object, 0, &entry),
            _ => "",
        };
        let _ = write!(text, "\n{comment}[{:04X}]\nParameterName={}\n", object.index, object.name);
        match object.shape {
            Shape::Variable(entry) => value(&mut text, read, object, 0, &entry),
            _ => values(&mut text, read, object),
        }
    }
    text
}
