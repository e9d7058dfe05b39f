//! Mapping of objects to the bytes of a PDO (CiA 301, 7.5.2.36 and 7.5.2.38).
//!
//! A master changes a mapping in the usual order: disable the PDO (bit 31 of its identifier), set the count to 0, write
//! the entries, set the count, enable the PDO. An entry holds index, sub-index and length in bits.

use crate::node::dictionary::records::{
    InputsObject as Input, MeasuredObject as Measured, OutputsObject as Output,
};
use crate::node::dictionary::{self, MAX_MAPPED_OBJECTS, index};
use crate::node::sdo::Abort;

/// Bytes of a PDO.
const PDO_BYTES: usize = 8;

/// Direction of a PDO, seen from the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Receive,
    Transmit,
}

/// A mapped object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    pub index: u16,
    pub sub_index: u8,
    /// Length in the PDO, bytes.
    pub length: usize,
}

impl Mapped {
    const fn of(entry: u32) -> Self {
        Self {
            index: (entry >> 16) as u16,
            sub_index: (entry >> 8) as u8,
            length: (entry as u8 / 8) as usize,
        }
    }
}

/// The mapping of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapping {
    count: u8,
    entries: [u32; MAX_MAPPED_OBJECTS],
}

const fn entry(index: u16, sub_index: u8, bits: u8) -> u32 {
    (index as u32) << 16 | (sub_index as u32) << 8 | bits as u32
}

/// Two entries of a record of 32-bit values.
const fn pair(index: u16, [first, second]: [u8; 2]) -> [u32; 3] {
    [entry(index, first, 32), entry(index, second, 32), 0]
}

/// Default entries of the receive PDOs; 0 for none.
static RECEIVED: [[u32; 3]; 6] = [
    [
        entry(index::CONTROLWORD, 0, 16),
        entry(index::TARGET_TORQUE, 0, 16),
        entry(index::TARGET_VELOCITY, 0, 32),
    ],
    pair(index::INPUTS, [Input::COMMAND_CURRENT, Input::COMMAND_REST]),
    pair(index::INPUTS, [Input::RADIAL_FORCE, Input::PRESSURE_DIFF]),
    pair(index::INPUTS, [Input::TEMPERATURE, Input::AUXILIARY]),
    pair(index::INPUTS, [Input::VELOCITY, Input::POSITION]),
    pair(index::INPUTS, [Input::TORQUE, Input::LOAD_TORQUE]),
];

/// Default entries of the transmit PDOs.
static TRANSMITTED: [[u32; 3]; 6] = [
    pair(index::OUTPUTS, [Output::FRICTION_TORQUE, Output::FEED_FORWARD_CURRENT]),
    pair(index::OUTPUTS, [Output::FLAGS, Output::SEQUENCE]),
    pair(index::OUTPUTS, [Output::CURRENT, Output::RESIDUAL_TORQUE]),
    pair(index::MEASURED, [Measured::VELOCITY, Measured::POSITION]),
    pair(index::MEASURED, [Measured::TORQUE, Measured::LOAD_TORQUE]),
    [
        entry(index::STATUSWORD, 0, 16),
        entry(index::ACTUAL_TORQUE, 0, 16),
        entry(index::ACTUAL_POSITION, 0, 32),
    ],
];

impl Mapping {
    #[inline(never)]
    fn of(defaults: &[[u32; 3]; 6], slot: usize) -> Self {
        let mut entries = [0; MAX_MAPPED_OBJECTS];
        let mut count = 0;
        for (place, default) in entries.iter_mut().zip(defaults.get(slot).into_iter().flatten()) {
            *place = *default;
            count += u8::from(*default != 0);
        }
        Self { count, entries }
    }

    /// Returns the default of a receive PDO, counted from 0.
    pub fn of_receive(slot: usize) -> Self {
        Self::of(&RECEIVED, slot)
    }

    /// Returns the default of a transmit PDO, counted from 0.
    pub fn of_transmit(slot: usize) -> Self {
        Self::of(&TRANSMITTED, slot)
    }

    /// Returns the value at a sub-index of the mapping object: the count at 0, then the entries.
    #[inline(never)]
    pub fn number(&self, sub_index: u8) -> Result<u32, Abort> {
        match sub_index.checked_sub(1) {
            None => Ok(self.count.into()),
            Some(place) => self.entries.get(usize::from(place)).copied().ok_or(Abort::NoSubIndex),
        }
    }

    /// Writes the value at a sub-index. The PDO must be disabled.
    ///
    /// # Errors
    /// Returns the abort codes of CiA 301: the object cannot be mapped, the PDO would be too long, or an entry is
    /// written while the count is not 0.
    pub fn write(&mut self, sub_index: u8, number: u32, direction: Direction) -> Result<(), Abort> {
        let Some(place) = sub_index.checked_sub(1) else {
            let count = u8::try_from(number).map_err(|_| Abort::MappingLength)?;
            let entries = self.entries.get(..usize::from(count)).ok_or(Abort::MappingLength)?;
            if entries.contains(&0) {
                return Err(Abort::NotMappable);
            }
            if entries.iter().map(|entry| Mapped::of(*entry).length).sum::<usize>() > PDO_BYTES {
                return Err(Abort::MappingLength);
            }
            self.count = count;
            return Ok(());
        };
        if self.count != 0 {
            return Err(Abort::State);
        }
        let mapped = Mapped::of(number);
        let is_mappable = match direction {
            Direction::Receive => dictionary::is_received,
            Direction::Transmit => dictionary::is_transmitted,
        };
        let object = dictionary::find(mapped.index, mapped.sub_index)?;
        if !is_mappable(mapped.index, mapped.sub_index) {
            return Err(Abort::NotMappable);
        }
        if object.data.length() != Some(mapped.length) || !number.is_multiple_of(8) {
            return Err(Abort::NotMappable);
        }
        *self.entries.get_mut(usize::from(place)).ok_or(Abort::NoSubIndex)? = number;
        Ok(())
    }

    /// Returns the mapped objects in order.
    pub fn objects(&self) -> impl Iterator<Item = Mapped> {
        self.entries.into_iter().take(self.count.into()).map(Mapped::of)
    }

    /// Returns the length of the PDO, bytes.
    #[inline(never)]
    pub fn length(&self) -> usize {
        self.objects().map(|object| object.length).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_fill_their_frames_with_objects_that_can_be_mapped() {
        for slot in 0..6 {
            for (default, direction) in [
                (Mapping::of_receive(slot), Direction::Receive),
                (Mapping::of_transmit(slot), Direction::Transmit),
            ] {
                assert_eq!(default.length(), PDO_BYTES, "{direction:?} {slot}");
                let mut mapping = default;
                mapping.write(0, 0, direction).unwrap();
                for sub_index in 1..=8 {
                    let number = default.number(sub_index).unwrap();
                    if number != 0 {
                        mapping.write(sub_index, number, direction).unwrap();
                    }
                }
                mapping.write(0, default.number(0).unwrap(), direction).unwrap();
                assert_eq!(mapping, default);
            }
        }
    }
}
