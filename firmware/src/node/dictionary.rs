//! The object dictionary: every object of a joint driver with name, type, access and rights.
//!
//! [`OBJECTS`] lists the objects; [`records`] lists the entries of records. The SDO server uses it to check
//! whether an object exists and may be written. `examples/joint_eds` prints the EDS from it, and a test compares the
//! two. `host-sim params` takes names from it. Objects from 1000h are those of CiA 301, from 2000h
//! manufacturer specific, from 6000h those of CiA 402. Parameters are not listed again: their names come
//! from the core's tables, and a sub-index is the parameter's number in its table plus one.
//!
//! *Service* objects need the service level ([`crate::access`]). What bounds the harm of open objects is not open itself:
//! motor and wiring, limits, watches, stop reactions, gains, the settings in flash, the node's number, the program. What a
//! master writes at every start is open: process data, communication times, modes, targets, limits below those of the
//! parameters. The friction model is open, too, but only up to the stored one: more friction than the joint has drives it.
//!
//! *Armed* objects can be written while the joint is armed: a request to disarm, entries of a trace, inputs that also come
//! in frames, a move between two set-points, limits within those of the parameters, the deadline and the end of a trial,
//! and what controls nothing.

mod entry;
pub mod records;
mod table;

pub use entry::{Access, DataType, Entry};
pub use records::FRAME_COUNTERS;
pub use table::{find, is_compact, value_count};

use crate::access::Level;
use crate::control::MotorParameters;
use crate::scope::MAX_SIGNALS;
use crate::sensors::SensorParameters;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::ParameterId;
use compensator_core::adaptation::MAX_GAINS;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::Envelope;
use compensator_core::term::MAX_TERMS;
use entry::{Names, entry};
use records::{
    AccessObject, AdaptationObject, CommissioningObject, CommissioningRunObject, CommitObject,
    DrivePdoObject, EnclosureObject, HoldingBrakeObject, HomingSpeedsObject, HomingStopObject,
    IdentityObject, InputsObject, InterpolationTimeObject, JointEncoderObject, MeasuredObject,
    NetworkObject, OperationObject, OutputsObject, PdoObject, PositionLimitsObject,
    PositionLoopObject, ProgramObject, ScopeObject, SdoServerObject, StateObject, TraceObject,
    TransmitPdoObject, TrialObject, TuningObject, WatchObject,
};

/// Structure of an object.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// One value, at sub-index 0.
    Variable(Entry),
    /// Values from sub-index 1; sub-index 0 is their number.
    Record(&'static [Entry]),
    /// Values of one type from sub-index 1; sub-index 0 is their number.
    Array(Entry, u8),
    /// Named `f32` values, which can be read and written.
    Numbers(Names),
    /// The friction parameters, which can be read and written.
    Parameters,
}

/// One object.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// Index of the object.
    pub index: u16,
    /// Name of the object. A board has none.
    #[cfg(not(target_os = "none"))]
    pub name: &'static str,
    /// Structure of the object.
    pub shape: Shape,
    /// Level that a write needs to any of its entries.
    level: Level,
    /// An armed joint accepts a write to any of its entries, too.
    is_written_armed: bool,
    /// A compact node has it, too.
    is_compact: bool,
}

/// Value that must be written to [`index::STORE`]: "save".
pub const SAVE_SIGNATURE: u32 = u32::from_le_bytes(*b"save");
/// Value that must be written to [`index::RESTORE`]: "load".
pub const LOAD_SIGNATURE: u32 = u32::from_le_bytes(*b"load");

use Access::{Const, Input, ReadOnly, ReadWrite, WriteOnly};
use DataType::{
    Domain, Integer8, Integer16, Integer32, OctetString, Real32, Unsigned8, Unsigned16, Unsigned32,
    VisibleString,
};

/// Returns an object without an index, which every node of the bus may write while the joint is disarmed.
#[cfg_attr(target_os = "none", allow(unused_variables))]
const fn object(name: &'static str, shape: Shape) -> Object {
    Object {
        index: 0,
        #[cfg(not(target_os = "none"))]
        name,
        shape,
        level: Level::Open,
        is_written_armed: false,
        is_compact: false,
    }
}

/// A compact node has the object, too.
const fn compact(object: Object) -> Object {
    Object { is_compact: true, ..object }
}

/// A write needs the service level.
const fn service(object: Object) -> Object {
    Object { level: Level::Service, ..object }
}

/// An armed joint accepts a write, too.
const fn armed(object: Object) -> Object {
    Object { is_written_armed: true, ..object }
}

const fn variable(name: &'static str, data: DataType, access: Access) -> Object {
    object(name, Shape::Variable(entry(name, data, access)))
}

const fn array(name: &'static str, of: &'static str, access: Access, count: usize) -> Object {
    array_of(name, entry(of, Unsigned32, access), count)
}

const fn array_of(name: &'static str, of: Entry, count: usize) -> Object {
    object(name, Shape::Array(of, count as u8))
}

const fn record(name: &'static str, entries: &'static [Entry]) -> Object {
    object(name, Shape::Record(entries))
}

const fn numbers(name: &'static str, names: &'static [&'static str]) -> Object {
    object(name, Shape::Numbers(Names::new(names)))
}

/// Maximum number of objects in a PDO: one per byte.
pub const MAX_MAPPED_OBJECTS: usize = 8;

/// Mapping of objects to a PDO.
const fn mapping(name: &'static str) -> Object {
    array(name, "mapped_object", ReadWrite, MAX_MAPPED_OBJECTS)
}

/// 60E3h: homing methods. 37 and 35 (its older number) use the present position; -1 and -2 a stop in negative and
/// positive direction, found by torque (manufacturer specific).
pub const HOMING_METHODS: [i8; 4] = [37, 35, -1, -2];

/// Number of errors kept in [`index::ERROR_FIELD`].
pub const ERROR_HISTORY_LENGTH: usize = 8;

/// Number of supervisor codes that are counted.
pub const CODE_COUNT: usize = crate::supervisor::CODE_COUNT;

macro_rules! objects {
    ($($index:literal $INDEX:ident $object:expr;)*) => {
        /// Indices by name.
        #[allow(missing_docs)]
        pub mod index {
            $(pub const $INDEX: u16 = $index;)*
        }

        /// All objects, in ascending order of their indices.
        pub static OBJECTS: &[Object] = ALL;
        const ALL: &[Object] = &[$(Object { index: $index, ..$object }),*];
    };
}

objects! {
    0x1000 DEVICE_TYPE compact(variable("device_type", Unsigned32, Const));
    0x1001 ERROR_REGISTER compact(variable("error_register", Unsigned8, ReadOnly));
    0x1003 ERROR_FIELD compact(armed(array("predefined_error_field", "error", ReadOnly, ERROR_HISTORY_LENGTH)));
    0x1005 SYNC_IDENTIFIER compact(variable("sync_cob_id", Unsigned32, Const));
    0x1006 SYNC_PERIOD variable("communication_cycle_period_us", Unsigned32, ReadWrite);
    0x1007 SYNC_WINDOW variable("synchronous_window_length_us", Unsigned32, ReadWrite);
    0x1008 DEVICE_NAME compact(variable("device_name", VisibleString, Const));
    0x1009 HARDWARE_VERSION compact(variable("hardware_version", VisibleString, Const));
    0x100A SOFTWARE_VERSION compact(variable("software_version", VisibleString, Const));
    0x1010 STORE compact(service(record("store_parameters", &[entry("save_all", Unsigned32, ReadWrite)])));
    0x1011 RESTORE compact(service(record("restore_defaults", &[entry("load_all", Unsigned32, ReadWrite)])));
    0x1014 EMERGENCY_IDENTIFIER compact(variable("emergency_cob_id", Unsigned32, Const));
    0x1016 AWAITED_HEARTBEAT compact(record(
        "consumer_heartbeat_time",
        &[entry("awaited_heartbeat", Unsigned32, ReadWrite)],
    ));
    0x1017 HEARTBEAT compact(armed(variable("producer_heartbeat_time_ms", Unsigned16, ReadWrite)));
    0x1018 IDENTITY compact(record("identity", IdentityObject::ENTRIES));
    0x1019 SYNC_OVERFLOW variable("sync_counter_overflow", Unsigned8, ReadWrite);
    0x1200 SDO_SERVER compact(record("sdo_server", SdoServerObject::ENTRIES));
    0x1400 RECEIVE_DRIVE record("receive_pdo_drive", DrivePdoObject::ENTRIES);
    0x1401 RECEIVE_COMMAND record("receive_pdo_command", PdoObject::ENTRIES);
    0x1402 RECEIVE_SEAL record("receive_pdo_seal", PdoObject::ENTRIES);
    0x1403 RECEIVE_SURROUNDINGS record("receive_pdo_surroundings", PdoObject::ENTRIES);
    0x1404 RECEIVE_MOTION record("receive_pdo_motion", PdoObject::ENTRIES);
    0x1405 RECEIVE_TORQUE record("receive_pdo_torque", PdoObject::ENTRIES);
    0x1600 MAPPING_RECEIVED_DRIVE mapping("mapping_received_drive");
    0x1601 MAPPING_RECEIVED_COMMAND mapping("mapping_received_command");
    0x1602 MAPPING_RECEIVED_SEAL mapping("mapping_received_seal");
    0x1603 MAPPING_RECEIVED_SURROUNDINGS mapping("mapping_received_surroundings");
    0x1604 MAPPING_RECEIVED_MOTION mapping("mapping_received_motion");
    0x1605 MAPPING_RECEIVED_TORQUE mapping("mapping_received_torque");
    0x1800 TRANSMIT_ANSWER compact(record("transmit_pdo_answer", TransmitPdoObject::ENTRIES));
    0x1801 TRANSMIT_STATUS compact(record("transmit_pdo_status", TransmitPdoObject::ENTRIES));
    0x1802 TRANSMIT_TELEMETRY compact(record("transmit_pdo_telemetry", TransmitPdoObject::ENTRIES));
    0x1803 TRANSMIT_MOTION compact(record("transmit_pdo_motion", TransmitPdoObject::ENTRIES));
    0x1804 TRANSMIT_TORQUE compact(record("transmit_pdo_torque", TransmitPdoObject::ENTRIES));
    0x1805 TRANSMIT_DRIVE record("transmit_pdo_drive", TransmitPdoObject::ENTRIES);
    0x1A00 MAPPING_ANSWER mapping("mapping_answer");
    0x1A01 MAPPING_STATUS mapping("mapping_status");
    0x1A02 MAPPING_TELEMETRY mapping("mapping_telemetry");
    0x1A03 MAPPING_MOTION mapping("mapping_motion");
    0x1A04 MAPPING_TORQUE mapping("mapping_torque");
    0x1A05 MAPPING_DRIVE mapping("mapping_drive");
    0x1F50 PROGRAM_DATA service(array_of("program_data", entry("program_data", Domain, WriteOnly), 1));
    0x1F51 PROGRAM_CONTROL service(array_of("program_control", entry("program_control", Unsigned8, ReadWrite), 1));
    0x1F56 PROGRAM_IDENTIFICATION service(array("program_software_identification", "program_crc", ReadOnly, 2));
    0x1F57 FLASH_STATUS service(array("flash_status_identification", "flash_status", ReadOnly, 1));
    0x2000 TRACE compact(armed(record("trace", TraceObject::ENTRIES)));
    0x2001 OPERATION compact(record("operation", OperationObject::ENTRIES));
    0x2002 STATE compact(record("state", StateObject::ENTRIES));
    0x2003 FRAME_COUNTERS
        compact(array("frame_counters", "frame_counter", ReadOnly, records::FRAME_COUNTERS.len()));
    0x2004 INPUTS compact(armed(record("inputs", InputsObject::ENTRIES)));
    0x2005 OUTPUTS record("outputs", OutputsObject::ENTRIES);
    0x2006 CODE_COUNTERS compact(array("code_counters", "code_counter", ReadOnly, CODE_COUNT));
    0x2007 WATCH compact(record("watch", WatchObject::ENTRIES));
    0x2008 LAST_PANIC compact(variable("last_panic", VisibleString, ReadOnly));
    0x2009 MEASURED compact(record("measured", MeasuredObject::ENTRIES));
    0x200A COMMISSIONING compact(service(record("commissioning", CommissioningObject::ENTRIES)));
    0x200B NETWORK compact(record("network", NetworkObject::ENTRIES));
    0x200C COMMISSIONING_RUN service(record("commissioning_run", CommissioningRunObject::ENTRIES));
    0x200D LIVE_TERMS compact(variable("live_terms", Unsigned32, ReadOnly));
    0x2012 ENCLOSURE record("enclosure", EnclosureObject::ENTRIES);
    0x2013 SCOPE armed(record("scope", ScopeObject::ENTRIES));
    0x2014 SCOPE_SIGNALS
        armed(array_of("scope_signals", entry("scope_signal", Unsigned8, ReadWrite), MAX_SIGNALS));
    0x2020 MODEL compact(record("model", &const {
        let mut entries = [entry("term", Unsigned8, ReadWrite); 2 + MAX_TERMS];
        entries[0] = entry("law", Unsigned8, ReadWrite);
        entries[1] = entry("choices", Unsigned8, ReadWrite);
        entries
    }));
    0x2021 ENVELOPE compact(numbers("envelope", &Envelope::NAMES));
    0x2022 COMPENSATOR compact(numbers("compensator", &CompensatorParameters::NAMES));
    0x2023 PARAMETERS compact(object("parameters", Shape::Parameters));
    0x2024 MOTOR compact(service(numbers("motor", &MotorParameters::NAMES)));
    0x2025 THRESHOLDS compact(service(numbers("thresholds", &Thresholds::NAMES)));
    0x2026 WATCH_PARAMETERS compact(service(numbers("watch_parameters", &WatchParameters::NAMES)));
    0x2027 COMMIT compact(record("commit", CommitObject::ENTRIES));
    0x2028 REFUSAL compact(variable("last_refusal", OctetString, ReadOnly));
    0x2029 SENSORS compact(service(numbers("sensors", &SensorParameters::NAMES)));
    0x2030 HOLDING_BRAKE service(record("holding_brake", HoldingBrakeObject::ENTRIES));
    0x2031 HOMING_STOP record("homing_stop", HomingStopObject::ENTRIES);
    0x2032 JOINT_ENCODER record("joint_encoder", JointEncoderObject::ENTRIES);
    0x2040 PROGRAM record("program", ProgramObject::ENTRIES);
    0x2041 ACCESS record("access", AccessObject::ENTRIES);
    0x2042 TRIAL service(record("parameter_trial", TrialObject::ENTRIES));
    0x2043 TUNING service(record("tuning_record", TuningObject::ENTRIES));
    0x2044 ADAPTATION service(record("adaptation", AdaptationObject::ENTRIES));
    0x2045 LEARNT_GAINS array_of("learnt_gains", entry("learnt_gain", Real32, ReadOnly), MAX_GAINS);
    0x2046 GAIN_DEVIATIONS array_of("learnt_gain_deviations", entry("deviation", Real32, ReadOnly), MAX_GAINS);
    0x2047 LEVEL_TREND variable("learnt_level_trend", Domain, ReadOnly);
    0x6007 ABORT_CONNECTION service(variable("abort_connection_option_code", Integer16, ReadWrite));
    0x603F ERROR_CODE variable("error_code", Unsigned16, ReadOnly);
    0x6040 CONTROLWORD armed(variable("controlword", Unsigned16, Input));
    0x6041 STATUSWORD variable("statusword", Unsigned16, ReadOnly);
    0x605A QUICK_STOP_OPTION service(variable("quick_stop_option_code", Integer16, ReadWrite));
    0x605B SHUTDOWN_OPTION service(variable("shutdown_option_code", Integer16, ReadWrite));
    0x605C DISABLE_OPTION service(variable("disable_operation_option_code", Integer16, ReadWrite));
    0x605D HALT_OPTION service(variable("halt_option_code", Integer16, ReadWrite));
    0x605E FAULT_OPTION service(variable("fault_reaction_option_code", Integer16, ReadWrite));
    0x6060 MODE armed(variable("modes_of_operation", Integer8, Input));
    0x6061 MODE_DISPLAY variable("modes_of_operation_display", Integer8, ReadOnly);
    0x6062 POSITION_DEMAND variable("position_demand_value", Integer32, ReadOnly);
    0x6064 ACTUAL_POSITION variable("position_actual_value", Integer32, ReadOnly);
    0x6065 FOLLOWING_WINDOW service(variable("following_error_window", Unsigned32, ReadWrite));
    0x6066 FOLLOWING_TIME service(variable("following_error_time_out", Unsigned16, ReadWrite));
    0x6067 POSITION_WINDOW variable("position_window", Unsigned32, ReadWrite);
    0x6068 POSITION_TIME variable("position_window_time", Unsigned16, ReadWrite);
    0x606B VELOCITY_DEMAND variable("velocity_demand_value", Integer32, ReadOnly);
    0x606C ACTUAL_VELOCITY variable("velocity_actual_value", Integer32, ReadOnly);
    0x606D VELOCITY_WINDOW variable("velocity_window", Unsigned16, ReadWrite);
    0x606E VELOCITY_TIME variable("velocity_window_time", Unsigned16, ReadWrite);
    0x606F VELOCITY_THRESHOLD variable("velocity_threshold", Unsigned16, ReadWrite);
    0x6070 THRESHOLD_TIME variable("velocity_threshold_time", Unsigned16, ReadWrite);
    0x6071 TARGET_TORQUE armed(variable("target_torque", Integer16, Input));
    0x6072 MAX_TORQUE armed(variable("max_torque", Unsigned16, ReadWrite));
    0x6074 TORQUE_DEMAND variable("torque_demand", Integer16, ReadOnly);
    0x6075 RATED_CURRENT variable("motor_rated_current", Unsigned32, ReadOnly);
    0x6076 RATED_TORQUE variable("motor_rated_torque", Unsigned32, ReadOnly);
    0x6077 ACTUAL_TORQUE variable("torque_actual_value", Integer16, ReadOnly);
    0x6078 ACTUAL_CURRENT variable("current_actual_value", Integer16, ReadOnly);
    0x6079 BUS_VOLTAGE variable("dc_link_circuit_voltage", Unsigned32, ReadOnly);
    0x607A TARGET_POSITION armed(variable("target_position", Integer32, Input));
    0x607C HOME_OFFSET armed(variable("home_offset", Integer32, ReadWrite));
    0x607D POSITION_LIMITS service(record("software_position_limit", PositionLimitsObject::ENTRIES));
    0x607F MAX_PROFILE_VELOCITY armed(variable("max_profile_velocity", Unsigned32, ReadWrite));
    0x6080 MAX_MOTOR_SPEED armed(variable("max_motor_speed", Unsigned32, ReadWrite));
    0x6081 PROFILE_VELOCITY armed(variable("profile_velocity", Unsigned32, ReadWrite));
    0x6083 ACCELERATION armed(variable("profile_acceleration", Unsigned32, ReadWrite));
    0x6084 DECELERATION armed(variable("profile_deceleration", Unsigned32, ReadWrite));
    0x6085 QUICK_DECELERATION service(variable("quick_stop_deceleration", Unsigned32, ReadWrite));
    0x6086 MOTION_PROFILE variable("motion_profile_type", Integer16, ReadWrite);
    0x6087 TORQUE_SLOPE armed(variable("torque_slope", Unsigned32, ReadWrite));
    0x6088 TORQUE_PROFILE variable("torque_profile_type", Integer16, ReadWrite);
    0x6098 HOMING_METHOD variable("homing_method", Integer8, ReadWrite);
    0x6099 HOMING_SPEEDS record("homing_speeds", HomingSpeedsObject::ENTRIES);
    0x609A HOMING_ACCELERATION variable("homing_acceleration", Unsigned32, ReadWrite);
    0x60B1 VELOCITY_OFFSET armed(variable("velocity_offset", Integer32, Input));
    0x60B2 TORQUE_OFFSET armed(variable("torque_offset", Integer16, Input));
    0x60B8 TOUCH_FUNCTION armed(variable("touch_probe_function", Unsigned16, Input));
    0x60B9 TOUCH_STATUS variable("touch_probe_status", Unsigned16, ReadOnly);
    0x60BA TOUCH_1_POSITIVE variable("touch_probe_1_positive_edge", Integer32, ReadOnly);
    0x60BB TOUCH_1_NEGATIVE variable("touch_probe_1_negative_edge", Integer32, ReadOnly);
    0x60BC TOUCH_2_POSITIVE variable("touch_probe_2_positive_edge", Integer32, ReadOnly);
    0x60BD TOUCH_2_NEGATIVE variable("touch_probe_2_negative_edge", Integer32, ReadOnly);
    0x60C2 INTERPOLATION_TIME record("interpolation_time_period", InterpolationTimeObject::ENTRIES);
    0x60E3 HOMING_METHODS
        array_of("supported_homing_methods", entry("homing_method", Integer8, Const), HOMING_METHODS.len());
    0x60E4 ADDITIONAL_POSITION
        array_of("additional_position_actual_value", entry("joint_encoder_position", Integer32, ReadOnly), 1);
    0x60F4 FOLLOWING_ERROR variable("following_error_actual_value", Integer32, ReadOnly);
    0x60FB POSITION_LOOP service(record("position_control_parameter_set", PositionLoopObject::ENTRIES));
    0x60FF TARGET_VELOCITY armed(variable("target_velocity", Integer32, Input));
    0x6502 SUPPORTED_MODES variable("supported_drive_modes", Unsigned32, Const);
}

impl Object {
    /// Returns the object at an index.
    pub fn find(index: u16) -> Option<&'static Self> {
        OBJECTS.iter().find(|object| object.index == index)
    }

    /// Returns the highest sub-index of the object.
    pub const fn highest_sub_index(&self) -> u8 {
        match self.shape {
            Shape::Variable(_) => 0,
            Shape::Record(entries) => entries.len() as u8,
            Shape::Array(_, count) => count,
            Shape::Numbers(names) => names.count(),
            Shape::Parameters => ParameterId::ALL.len() as u8,
        }
    }

    /// Returns the entry at a sub-index, with the rights of the object.
    pub fn entry(&self, sub_index: u8) -> Option<Entry> {
        find(self.index, sub_index).ok()
    }

    /// Returns the number of entries of the object: the values of an array have one.
    const fn listed(&self) -> usize {
        if let Shape::Record(entries) = self.shape { entries.len() } else { 1 }
    }

    /// Returns one of these entries, with the rights of the object.
    const fn listed_entry(&self, place: usize) -> Entry {
        let mut entry = match self.shape {
            Shape::Variable(entry) | Shape::Array(entry, _) => entry,
            Shape::Record(entries) => entries[place],
            Shape::Numbers(_) | Shape::Parameters => entry("", Real32, ReadWrite),
        };
        if matches!(self.level, Level::Service) {
            entry = entry.service();
        }
        if self.is_written_armed { entry.armed() } else { entry }
    }

    /// Returns the name of the value at a sub-index, if the values of one entry have names of their own.
    #[cfg(not(target_os = "none"))]
    fn name_at(&self, sub_index: u8) -> Option<&'static str> {
        let place = usize::from(sub_index.checked_sub(1)?);
        match self.shape {
            Shape::Numbers(names) => names.get(place),
            Shape::Parameters => ParameterId::ALL.get(place).map(|id| id.name()),
            _ => None,
        }
    }
}

/// Returns true if sub-index 0 can be written: a tool clears the error history by 0, and counts the objects of a mapping.
const fn has_written_count(object: &Object) -> bool {
    matches!(object.shape, Shape::Array(..))
        && (object.index == index::ERROR_FIELD || is_mapping(object.index))
}

/// Returns true if an object is the mapping of a PDO.
pub const fn is_mapping(at_index: u16) -> bool {
    matches!(at_index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
}

/// Returns true if an object can be mapped to a receive PDO.
pub fn is_received(at_index: u16, sub_index: u8) -> bool {
    let entry = find(at_index, sub_index);
    entry.is_ok_and(|entry| entry.access == Access::Input && entry.data.length().is_some())
}

/// Returns true if an object can be mapped to a transmit PDO: a number that the driver changes.
pub fn is_transmitted(at_index: u16, sub_index: u8) -> bool {
    let is_of_joint = matches!(at_index, 0x2000..=0x67FF | index::ERROR_REGISTER);
    let entry = find(at_index, sub_index);
    is_of_joint
        && entry.is_ok_and(|entry| {
            matches!(entry.access, Access::ReadOnly | Access::Input)
                && entry.data.length().is_some()
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::sdo::Abort;

    #[test]
    fn indices_are_sorted_and_every_sub_index_has_an_entry() {
        assert!(OBJECTS.windows(2).all(|pair| pair[0].index < pair[1].index));
        for object in OBJECTS {
            for sub_index in 0..=object.highest_sub_index() {
                assert!(find(object.index, sub_index).is_ok(), "{object:?}");
            }
            let beyond = find(object.index, object.highest_sub_index() + 1);
            assert_eq!(beyond, Err(Abort::NoSubIndex), "{object:?}");
        }
        assert_eq!(find(0x2FFF, 0), Err(Abort::NoObject));
    }
}
