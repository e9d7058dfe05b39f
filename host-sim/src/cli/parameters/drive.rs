//! The settings of the CiA 402 drive by name: `drive.position_min`, in the unit of their objects.
//!
//! They are objects of their own and no part of the parameter set: a change is active at once, and `save` keeps it.

use super::{Driver, Result};
use crate::cli::error::found;
use canopen_rs::Address;
use firmware::drive_settings::DriveSettings;
use joint_tuning::names::NameError;

/// Prefix of the names.
const PREFIX: &str = "drive.";

/// Returns every name with its object: index and sub-index.
pub(super) fn names() -> impl Iterator<Item = (String, Address)> {
    DriveSettings::NAMES.iter().zip(DriveSettings::PLACES).map(|(name, (index, sub_index))| {
        (format!("{PREFIX}{name}"), Address::new(index, sub_index))
    })
}

/// A change of a setting, checked against the names but not yet written.
pub(super) struct Change {
    name: String,
    at: Address,
    value: i64,
}

/// Parses `drive.NAME` and a whole number; `None` for a name of another section.
///
/// # Errors
/// Returns one line if there is no such setting or the value is no whole number.
pub(super) fn parse(name: &str, value: &str) -> Result<Option<Change>> {
    if !name.starts_with(PREFIX) {
        return Ok(None);
    }
    let change = Change::of(name, 0)?;
    let is_whole = |value: &f64| value.fract() == 0.0 && value.abs() < 1e10;
    let whole = value.parse::<f64>().ok().filter(is_whole);
    let expected = "a whole number in the unit of its object";
    let whole = whole.ok_or_else(|| NameError::value(name, value, expected))?;
    Ok(Some(Change { value: whole as i64, ..change }))
}

impl Change {
    /// Returns the change of the setting with this name.
    pub(super) fn of(name: &str, value: i64) -> Result<Self, NameError> {
        let found = names().find(|(known, _)| known == name);
        let unknown = || NameError::unknown(name, names().map(|(known, _)| known));
        found.map(|(name, at)| Self { name, at, value }).ok_or_else(unknown)
    }

    /// Returns the change from the former setting in words.
    pub(super) fn in_words(&self, former: &Self) -> String {
        format!("{} {} -> {}", self.name, former.value, self.value)
    }
}

impl Driver {
    /// Reads a setting.
    pub(super) fn drive_setting(&mut self, at: Address) -> Result<i64> {
        Ok(number_of(at, &self.client.read(at)?))
    }

    /// Writes a setting. Returns the former one.
    pub(super) fn write_setting(&mut self, change: &Change) -> Result<Change> {
        let Change { name, at, value } = change;
        let former = self.client.read(*at)?;
        let is_signed = DriveSettings::is_signed(at.index, at.subindex);
        let end = 1i64 << (8 * former.len().clamp(1, 4) - usize::from(is_signed));
        let start = if is_signed { -end } else { 0 };
        if !(start..end).contains(value) {
            let expected = format!("{start} to {}", end - 1);
            return Err(found(name.as_str(), value.to_string(), expected));
        }
        self.client.write(*at, &value.to_le_bytes()[..former.len()])?;
        Ok(Change { name: name.clone(), at: *at, value: number_of(*at, &former) })
    }
}

/// Returns the number in the bytes of a setting, which has a sign if its object has one.
fn number_of(at: Address, bytes: &[u8]) -> i64 {
    let number = bytes.iter().rev().fold(0u64, |number, byte| number << 8 | u64::from(*byte));
    let unused = 64 - 8 * bytes.len().clamp(1, 8) as u32;
    match DriveSettings::is_signed(at.index, at.subindex) {
        true => (number << unused).cast_signed() >> unused,
        false => number.cast_signed(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;
    use joint_bus::bus::{Bus, Hub};
    use joint_bus::canopen::Client;
    use joint_bus::joint::JointNode;

    #[test]
    fn every_setting_is_read_and_written_by_its_name() {
        let hub = Hub::new();
        hub.attach(JointNode::start(NodeId::FIRST, None).expect("a driver"));
        let bus: Box<dyn Bus> = Box::new(hub.port());
        let mut driver = Driver { client: Client::new(bus, NodeId::FIRST) };
        for (name, at) in names() {
            let before = driver.drive_setting(at).expect("it is read");
            let change = parse(&name, &before.to_string()).expect("a number").expect("a setting");
            driver.write_setting(&change).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
        let change = parse("drive.position_min", "-1000000").expect("a number").expect("a setting");
        let former = driver.write_setting(&change).unwrap();
        assert_eq!(change.in_words(&former), "drive.position_min 0 -> -1000000");
        assert_eq!(driver.drive_setting(change.at).unwrap(), -1_000_000);
        // A number beyond its object would be another one there.
        for (name, value) in [
            ("drive.position_min", "3000000000"),
            ("drive.brake_test_ms", "-1"),
            ("drive.brake_test_ms", "65536"),
        ] {
            let change = parse(name, value).expect("a number").expect("a setting");
            let refused = driver.write_setting(&change).err().expect(value).to_string();
            assert!(refused.contains(name) && refused.contains(value), "{refused}");
        }
    }

    #[test]
    fn wrong_names_and_values_are_refused_in_one_line() {
        assert!(parse("motor.gear_ratio", "1").is_ok_and(|change| change.is_none()));
        let unknown = parse("drive.gain", "1").err().unwrap().to_string();
        assert!(
            unknown.contains("drive.gain") && unknown.contains("drive.position_gain"),
            "{unknown}"
        );
        let fraction = parse("drive.position_min", "0.5").err().unwrap().to_string();
        assert!(fraction.contains("drive.position_min") && fraction.contains("0.5"), "{fraction}");
        let lines = unknown + "\n" + &fraction;
        crate::snapshot::check("units-of-commands", "wrong settings of a drive", &lines);
    }
}
