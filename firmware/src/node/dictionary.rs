//! The object dictionary: every object of a joint driver with its name, type and access.
//!
//! One list. The SDO server looks in it whether an object is there and may be written; `joint.eds` is
//! made from it and a test holds the two together; `host-sim params` takes names from it. Objects from
//! 1000h are those of CiA 301, from 2000h the joint's own. Parameters are not listed again: their names
//! come from the core's own tables, a sub-index is a parameter's number in them plus one.

use super::sdo::Abort;
use crate::control::MotorParameters;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::ParameterId;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::Envelope;
use compensator_core::term::MAX_TERMS;

/// Type of a value, by its number in CiA 301.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum DataType {
    /// Eight bits.
    Unsigned8 = 0x05,
    /// Sixteen bits.
    Unsigned16 = 0x06,
    /// Thirty-two bits.
    Unsigned32 = 0x07,
    /// `f32`.
    Real32 = 0x08,
    /// Text.
    VisibleString = 0x09,
    /// Bytes.
    Domain = 0x0F,
}

impl DataType {
    /// Length in bytes; `None` where it varies.
    pub const fn length(self) -> Option<usize> {
        match self {
            Self::Unsigned8 => Some(1),
            Self::Unsigned16 => Some(2),
            Self::Unsigned32 | Self::Real32 => Some(4),
            Self::VisibleString | Self::Domain => None,
        }
    }
}

/// Who may do what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Never changes.
    Const,
    /// The driver changes it.
    ReadOnly,
    /// A tool may write it.
    ReadWrite,
    /// A tool may write it; there is nothing to read.
    WriteOnly,
}

/// One value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name, in the words of the rest of the project.
    pub name: &'static str,
    /// Its type.
    pub data: DataType,
    /// Who may do what.
    pub access: Access,
}

/// What stands at an index.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// One value, at sub-index 0.
    Variable(Entry),
    /// Values from sub-index 1; how many, at 0.
    Record(&'static [Entry]),
    /// As many values of one kind; how many, at 0.
    Array(Entry, u8),
    /// Numbers with these names, which can be read and written.
    Numbers(&'static [&'static str]),
    /// The friction parameters, which can be read and written.
    Parameters,
}

/// An object.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// Its index.
    pub index: u16,
    /// Its name.
    pub name: &'static str,
    /// What stands there.
    pub shape: Shape,
}

/// Indices, by name.
#[allow(missing_docs)]
pub mod index {
    pub const DEVICE_TYPE: u16 = 0x1000;
    pub const ERROR_REGISTER: u16 = 0x1001;
    pub const ERROR_FIELD: u16 = 0x1003;
    pub const SYNC_IDENTIFIER: u16 = 0x1005;
    pub const DEVICE_NAME: u16 = 0x1008;
    pub const HARDWARE_VERSION: u16 = 0x1009;
    pub const SOFTWARE_VERSION: u16 = 0x100A;
    pub const STORE: u16 = 0x1010;
    pub const RESTORE: u16 = 0x1011;
    pub const EMERGENCY_IDENTIFIER: u16 = 0x1014;
    pub const AWAITED_HEARTBEAT: u16 = 0x1016;
    pub const HEARTBEAT: u16 = 0x1017;
    pub const IDENTITY: u16 = 0x1018;
    pub const SYNC_OVERFLOW: u16 = 0x1019;
    pub const SDO_SERVER: u16 = 0x1200;
    pub const RECEIVE_PDO: u16 = 0x1400;
    pub const RECEIVE_MAPPING: u16 = 0x1600;
    pub const TRANSMIT_PDO: u16 = 0x1800;
    pub const TRANSMIT_MAPPING: u16 = 0x1A00;
    pub const TRACE: u16 = 0x2000;
    pub const OPERATION: u16 = 0x2001;
    pub const STATE: u16 = 0x2002;
    pub const FRAME_COUNTERS: u16 = 0x2003;
    pub const INPUTS: u16 = 0x2004;
    pub const OUTPUTS: u16 = 0x2005;
    pub const CODE_COUNTERS: u16 = 0x2006;
    pub const WATCH: u16 = 0x2007;
    pub const LAST_PANIC: u16 = 0x2008;
    pub const MODEL: u16 = 0x2020;
    pub const ENVELOPE: u16 = 0x2021;
    pub const COMPENSATOR: u16 = 0x2022;
    pub const PARAMETERS: u16 = 0x2023;
    pub const MOTOR: u16 = 0x2024;
    pub const THRESHOLDS: u16 = 0x2025;
    pub const WATCH_PARAMETERS: u16 = 0x2026;
    pub const COMMIT: u16 = 0x2027;
    pub const REFUSAL: u16 = 0x2028;
}

/// Word that is written to [`index::STORE`]: "save".
pub const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Word that is written to [`index::RESTORE`]: "load".
pub const LOAD: u32 = u32::from_le_bytes(*b"load");

use Access::{Const, ReadOnly, ReadWrite, WriteOnly};
use DataType::{Domain, Real32, Unsigned8, Unsigned16, Unsigned32, VisibleString};

const fn entry(name: &'static str, data: DataType, access: Access) -> Entry {
    Entry { name, data, access }
}

const fn variable(index: u16, name: &'static str, data: DataType, access: Access) -> Object {
    Object { index, name, shape: Shape::Variable(entry(name, data, access)) }
}

const fn record(index: u16, name: &'static str, entries: &'static [Entry]) -> Object {
    Object { index, name, shape: Shape::Record(entries) }
}

/// What the frames and answers are counted as, in the order of their sub-indices.
pub const FRAME_COUNTERS: &[&str] = &[
    "received",
    "sent",
    "not_sent",
    "foreign",
    "passed_over",
    "wrong_length",
    "wrong_content",
    "sync_lost",
    "sync_duplicate",
    "sync_late",
    "command_duplicate",
    "command_lost",
    "command_late",
    "sdo_refused",
    "receiver_overrun",
    "bus_off",
];

const PDO: &[Entry] =
    &[entry("cob_id", Unsigned32, Const), entry("transmission_type", Unsigned8, Const)];
const MAPPED: Entry = entry("mapped_object", Unsigned32, Const);

const fn receive(number: u16, name: &'static str) -> Object {
    record(index::RECEIVE_PDO + number, name, PDO)
}
const fn transmit(number: u16, name: &'static str) -> Object {
    record(index::TRANSMIT_PDO + number, name, PDO)
}
const fn mapping(index: u16, name: &'static str, count: u8) -> Object {
    Object { index, name, shape: Shape::Array(MAPPED, count) }
}

/// Errors kept in [`index::ERROR_FIELD`].
pub const ERRORS_KEPT: usize = 8;

/// Supervisor codes that are counted, at most.
pub const CODES: usize = crate::supervisor::CODES;

/// Every object, by rising index.
pub static OBJECTS: &[Object] = &[
    variable(index::DEVICE_TYPE, "device_type", Unsigned32, Const),
    variable(index::ERROR_REGISTER, "error_register", Unsigned8, ReadOnly),
    Object {
        index: index::ERROR_FIELD,
        name: "predefined_error_field",
        shape: Shape::Array(entry("error", Unsigned32, ReadOnly), ERRORS_KEPT as u8),
    },
    variable(index::SYNC_IDENTIFIER, "sync_cob_id", Unsigned32, Const),
    variable(index::DEVICE_NAME, "device_name", VisibleString, Const),
    variable(index::HARDWARE_VERSION, "hardware_version", VisibleString, Const),
    variable(index::SOFTWARE_VERSION, "software_version", VisibleString, Const),
    record(index::STORE, "store_parameters", &[entry("save_all", Unsigned32, ReadWrite)]),
    record(index::RESTORE, "restore_defaults", &[entry("load_all", Unsigned32, ReadWrite)]),
    variable(index::EMERGENCY_IDENTIFIER, "emergency_cob_id", Unsigned32, Const),
    record(
        index::AWAITED_HEARTBEAT,
        "consumer_heartbeat_time",
        &[entry("awaited_heartbeat", Unsigned32, ReadWrite)],
    ),
    variable(index::HEARTBEAT, "producer_heartbeat_time_ms", Unsigned16, ReadWrite),
    record(
        index::IDENTITY,
        "identity",
        &[
            entry("vendor_id", Unsigned32, Const),
            entry("product_code", Unsigned32, Const),
            entry("revision_number", Unsigned32, Const),
            entry("serial_number", Unsigned32, Const),
        ],
    ),
    variable(index::SYNC_OVERFLOW, "sync_counter_overflow", Unsigned8, Const),
    record(
        index::SDO_SERVER,
        "sdo_server",
        &[
            entry("client_to_server", Unsigned32, Const),
            entry("server_to_client", Unsigned32, Const),
        ],
    ),
    receive(0, "receive_pdo_motion"),
    receive(1, "receive_pdo_torque"),
    receive(2, "receive_pdo_seal"),
    receive(3, "receive_pdo_surroundings"),
    receive(4, "receive_pdo_command"),
    mapping(index::RECEIVE_MAPPING, "mapping_motion", 2),
    mapping(index::RECEIVE_MAPPING + 1, "mapping_torque", 2),
    mapping(index::RECEIVE_MAPPING + 2, "mapping_seal", 2),
    mapping(index::RECEIVE_MAPPING + 3, "mapping_surroundings", 2),
    mapping(index::RECEIVE_MAPPING + 4, "mapping_command", 2),
    transmit(0, "transmit_pdo_answer"),
    transmit(1, "transmit_pdo_status"),
    transmit(2, "transmit_pdo_telemetry"),
    mapping(index::TRANSMIT_MAPPING, "mapping_answer", 2),
    mapping(index::TRANSMIT_MAPPING + 1, "mapping_status", 2),
    mapping(index::TRANSMIT_MAPPING + 2, "mapping_telemetry", 2),
    record(
        index::TRACE,
        "trace",
        &[
            entry("run", Unsigned32, ReadWrite),
            entry("sequence", Unsigned32, ReadWrite),
            entry("joint_kind", Unsigned32, ReadWrite),
        ],
    ),
    record(
        index::OPERATION,
        "operation",
        &[
            entry("source", Unsigned8, ReadWrite),
            entry("number", Unsigned8, ReadWrite),
            entry("period_s", Real32, ReadWrite),
            entry("campaign_h", Real32, ReadWrite),
            entry("telemetry_every", Unsigned8, ReadWrite),
            entry("node", Unsigned8, ReadWrite),
        ],
    ),
    record(
        index::STATE,
        "state",
        &[
            entry("request", Unsigned8, WriteOnly),
            entry("state", Unsigned8, ReadOnly),
            entry("faults", Unsigned32, ReadOnly),
            entry("limits", Unsigned32, ReadOnly),
            entry("blocking_codes", Unsigned32, ReadOnly),
            entry("set_position_rad", Real32, WriteOnly),
        ],
    ),
    Object {
        index: index::FRAME_COUNTERS,
        name: "frame_counters",
        shape: Shape::Array(
            entry("frame_counter", Unsigned32, ReadOnly),
            FRAME_COUNTERS.len() as u8,
        ),
    },
    record(
        index::INPUTS,
        "inputs",
        &[
            entry("velocity_rad_s", Real32, ReadOnly),
            entry("position_rad", Real32, ReadOnly),
            entry("torque_nm", Real32, ReadOnly),
            entry("load_torque_nm", Real32, ReadOnly),
            entry("radial_force_n", Real32, ReadOnly),
            entry("pressure_diff_pa", Real32, ReadOnly),
            entry("temperature_c", Real32, ReadOnly),
            entry("auxiliary", Real32, ReadOnly),
            entry("command_current_a", Real32, ReadOnly),
            entry("command_velocity_and_counter", Unsigned32, ReadOnly),
        ],
    ),
    record(
        index::OUTPUTS,
        "outputs",
        &[
            entry("friction_torque_nm", Real32, ReadOnly),
            entry("feed_forward_current_a", Real32, ReadOnly),
            entry("flags", Unsigned32, ReadOnly),
            entry("sequence", Unsigned32, ReadOnly),
            entry("current_a", Real32, ReadOnly),
            entry("residual_torque_nm", Real32, ReadOnly),
        ],
    ),
    Object {
        index: index::CODE_COUNTERS,
        name: "code_counters",
        shape: Shape::Array(entry("code_counter", Unsigned32, ReadOnly), CODES as u8),
    },
    record(
        index::WATCH,
        "watch",
        &[
            entry("in_band", Unsigned8, ReadOnly),
            entry("windows", Unsigned32, ReadOnly),
            entry("windows_out_of_band", Unsigned32, ReadOnly),
            entry("alarms", Unsigned32, ReadOnly),
            entry("largest_in_bands", Real32, ReadOnly),
        ],
    ),
    variable(index::LAST_PANIC, "last_panic", VisibleString, ReadOnly),
    record(
        index::MODEL,
        "model",
        &const {
            let mut entries = [entry("term", Unsigned8, ReadWrite); 2 + MAX_TERMS];
            entries[0] = entry("law", Unsigned8, ReadWrite);
            entries[1] = entry("choices", Unsigned8, ReadWrite);
            entries
        },
    ),
    Object { index: index::ENVELOPE, name: "envelope", shape: Shape::Numbers(&Envelope::NAMES) },
    Object {
        index: index::COMPENSATOR,
        name: "compensator",
        shape: Shape::Numbers(&CompensatorParameters::NAMES),
    },
    Object { index: index::PARAMETERS, name: "parameters", shape: Shape::Parameters },
    Object { index: index::MOTOR, name: "motor", shape: Shape::Numbers(&MotorParameters::NAMES) },
    Object {
        index: index::THRESHOLDS,
        name: "thresholds",
        shape: Shape::Numbers(&Thresholds::NAMES),
    },
    Object {
        index: index::WATCH_PARAMETERS,
        name: "watch_parameters",
        shape: Shape::Numbers(&WatchParameters::NAMES),
    },
    record(
        index::COMMIT,
        "commit",
        &[
            entry("active_crc", Unsigned32, ReadOnly),
            entry("staged_crc", Unsigned32, ReadOnly),
            entry("commit", Unsigned32, WriteOnly),
            entry("discard", Unsigned8, WriteOnly),
            entry("friction_record", Domain, ReadWrite),
            entry("drive_record", Domain, ReadWrite),
        ],
    ),
    variable(index::REFUSAL, "last_refusal", VisibleString, ReadOnly),
];

impl Object {
    /// The object at an index.
    pub fn find(index: u16) -> Option<&'static Self> {
        let at = OBJECTS.binary_search_by_key(&index, |object| object.index).ok()?;
        OBJECTS.get(at)
    }

    /// Its highest sub-index.
    pub fn last(&self) -> u8 {
        match self.shape {
            Shape::Variable(_) => 0,
            Shape::Record(entries) => entries.len() as u8,
            Shape::Array(_, count) => count,
            Shape::Numbers(names) => names.len() as u8,
            Shape::Parameters => ParameterId::ALL.len() as u8,
        }
    }

    /// What stands at a sub-index.
    pub fn entry(&self, sub_index: u8) -> Option<Entry> {
        let number = |name| entry(name, Real32, ReadWrite);
        let Some(place) = sub_index.checked_sub(1).map(usize::from) else {
            return Some(match self.shape {
                Shape::Variable(entry) => entry,
                // A tool empties the list of errors by writing 0 to its count.
                Shape::Array(..) if self.index == index::ERROR_FIELD => {
                    entry("highest_sub_index", Unsigned8, ReadWrite)
                }
                _ => entry("highest_sub_index", Unsigned8, Const),
            });
        };
        match self.shape {
            Shape::Variable(_) => None,
            Shape::Record(entries) => entries.get(place).copied(),
            Shape::Array(entry, count) => (sub_index <= count).then_some(entry),
            Shape::Numbers(names) => names.get(place).copied().map(number),
            Shape::Parameters => ParameterId::ALL.get(place).map(|id| number(id.name())),
        }
    }
}

/// What stands at an address.
///
/// # Errors
/// [`Abort::NoObject`] or [`Abort::NoSubIndex`].
pub fn find(index: u16, sub_index: u8) -> Result<Entry, Abort> {
    let object = Object::find(index).ok_or(Abort::NoObject)?;
    object.entry(sub_index).ok_or(Abort::NoSubIndex)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_rise_and_every_sub_index_has_an_entry() {
        assert!(OBJECTS.windows(2).all(|pair| pair[0].index < pair[1].index));
        for object in OBJECTS {
            for sub_index in 0..=object.last() {
                assert!(find(object.index, sub_index).is_ok(), "{object:?}");
            }
            let beyond = find(object.index, object.last() + 1);
            assert_eq!(beyond, Err(Abort::NoSubIndex), "{object:?}");
        }
        assert_eq!(find(0x2FFF, 0), Err(Abort::NoObject));
    }
}
