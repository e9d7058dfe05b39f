//! An entry of an object: one value with name, type, access and rights.

use crate::access::Level;

/// Type of a value, by its number in CiA 301.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum DataType {
    /// 8-bit signed integer.
    Integer8 = 0x02,
    /// 16-bit signed integer.
    Integer16 = 0x03,
    /// 32-bit signed integer.
    Integer32 = 0x04,
    /// 8-bit unsigned integer.
    Unsigned8 = 0x05,
    /// 16-bit unsigned integer.
    Unsigned16 = 0x06,
    /// 32-bit unsigned integer.
    Unsigned32 = 0x07,
    /// `f32`.
    Real32 = 0x08,
    /// Text.
    VisibleString = 0x09,
    /// Bytes of a meaning that the object defines.
    OctetString = 0x0A,
    /// Bytes.
    Domain = 0x0F,
}

impl DataType {
    /// Returns the length in bytes; `None` if it varies.
    #[inline(never)]
    pub const fn length(self) -> Option<usize> {
        // A byte, so that the table is one of bytes.
        let length: u8 = match self {
            Self::Unsigned8 | Self::Integer8 => 1,
            Self::Unsigned16 | Self::Integer16 => 2,
            Self::Unsigned32 | Self::Integer32 | Self::Real32 => 4,
            Self::VisibleString | Self::OctetString | Self::Domain => return None,
        };
        Some(length as usize)
    }
}

/// Access rights of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Access {
    /// The value is constant.
    Const,
    /// Only the driver changes the value.
    ReadOnly,
    /// A tool may write the value.
    ReadWrite,
    /// A tool or a process frame may write the value. Objects mapped to a receive PDO must be writable.
    Input,
    /// A tool may write the value but not read it.
    WriteOnly,
}

/// One value of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name, as used in the rest of the project. A board has none, to save flash: tools take the names from their own copy of
    /// this dictionary or from `joint.eds`.
    #[cfg(not(target_os = "none"))]
    pub name: &'static str,
    /// Type of the value.
    pub data: DataType,
    /// Access rights of a value.
    pub access: Access,
    /// Level that a write needs.
    pub level: Level,
    /// An armed joint accepts a write, too.
    pub is_written_armed: bool,
}

impl Entry {
    /// A write needs the service level.
    pub(super) const fn service(self) -> Self {
        Self { level: Level::Service, ..self }
    }

    /// An armed joint accepts a write, too.
    pub(super) const fn armed(self) -> Self {
        Self { is_written_armed: true, ..self }
    }
}

/// Returns an entry that every node of the bus may write while the joint is disarmed.
#[cfg_attr(target_os = "none", allow(unused_variables))]
pub(super) const fn entry(name: &'static str, data: DataType, access: Access) -> Entry {
    Entry {
        #[cfg(not(target_os = "none"))]
        name,
        data,
        access,
        level: Level::Open,
        is_written_armed: false,
    }
}

/// Names of the values of an object; on a board their number alone.
#[derive(Clone, Copy, Debug)]
pub struct Names {
    count: u8,
    #[cfg(not(target_os = "none"))]
    names: &'static [&'static str],
}

impl Names {
    pub(super) const fn new(names: &'static [&'static str]) -> Self {
        Self {
            count: names.len() as u8,
            #[cfg(not(target_os = "none"))]
            names,
        }
    }

    /// Returns the number of names.
    pub const fn count(&self) -> u8 {
        self.count
    }

    /// Returns the name at a place; `None` beyond the last.
    #[cfg(not(target_os = "none"))]
    pub(super) fn get(&self, place: usize) -> Option<&'static str> {
        self.names.get(place).copied()
    }
}
