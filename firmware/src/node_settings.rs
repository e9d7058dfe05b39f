//! What a driver keeps besides the friction model: how it takes part in the bus and what feeds it.
//!
//! Stored in one block with the parameter record, so that the two cannot be of different ages. Every
//! setting is an object of the dictionary (see [`crate::node::dictionary`]) and is refused out of range
//! when it is written, not when it is used.

use crate::hil::{HilSetup, Number};
use crate::node::bit_timing::RATES_KBIT;
use crate::parameter_set::{LONGEST_SET, ParameterSet, SetError};
use compensator_core::can::Node;
use core::fmt;
use heapless::Vec;

/// Where a driver's inputs come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// Its own encoder and converters: it drives a joint.
    #[default]
    Sensors,
    /// Frames: it drives nothing.
    Bus,
}

/// Legal sample periods of a joint in HIL, s.
pub const PERIOD_RANGE_S: (f32, f32) = (1e-5, 1.0);

/// What a driver keeps besides the friction model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeSettings {
    /// Number of the joint on its bus.
    pub node: Node,
    /// Bit rate of the bus, kbit/s: one of [`RATES_KBIT`]. It counts from the next start, as the number does.
    pub bit_rate_kbit: u16,
    /// Time between heartbeats, ms; 0 for none.
    pub heartbeat_ms: u16,
    /// Whose heartbeat is awaited (bits 16 to 22) and for how long, ms (bits 0 to 15), as CiA 301
    /// writes it; 0 for none.
    pub awaited_heartbeat: u32,
    /// Where inputs come from.
    pub source: Source,
    /// The number a joint in HIL computes with.
    pub number: Number,
    /// Telemetry is sent at every so many SYNCs; 0 for never.
    pub telemetry_every: u8,
    /// Time from SYNC to SYNC of a joint in HIL, s.
    pub period_s: f32,
    /// Age of the campaign when a run begins, h.
    pub campaign_h: f32,
    /// The wiring somebody confirmed, as [`ParameterSet::wiring_crc`]; 0 for none.
    pub commissioned: u32,
}

impl Default for NodeSettings {
    fn default() -> Self {
        Self {
            node: Node::FIRST,
            bit_rate_kbit: 1000,
            heartbeat_ms: 1000,
            awaited_heartbeat: 0,
            source: Source::default(),
            number: Number::default(),
            telemetry_every: 1,
            period_s: 1e-3,
            campaign_h: 0.0,
            commissioned: 0,
        }
    }
}

impl NodeSettings {
    /// Length in bytes of the settings in a block.
    pub const LENGTH: usize = 28;
    const VERSION: u8 = 2;

    /// What a joint in HIL is built for.
    pub fn hil_setup(&self) -> HilSetup {
        HilSetup { number: self.number, period_s: self.period_s, campaign_h: self.campaign_h }
    }

    /// The settings as bytes, little-endian, in the order of the fields behind a version.
    pub fn emit(&self) -> [u8; Self::LENGTH] {
        let mut bytes = [0; Self::LENGTH];
        let words = [
            (
                0,
                u32::from_le_bytes([
                    Self::VERSION,
                    self.node.number(),
                    self.source as u8,
                    self.number as u8,
                ]),
            ),
            (4, u32::from(self.heartbeat_ms) | u32::from(self.bit_rate_kbit) << 16),
            (8, self.awaited_heartbeat),
            (12, u32::from(self.telemetry_every)),
            (16, self.period_s.to_bits()),
            (20, self.campaign_h.to_bits()),
            (24, self.commissioned),
        ];
        for (at, word) in words {
            if let Some(place) = bytes.get_mut(at..at + 4) {
                place.copy_from_slice(&word.to_le_bytes());
            }
        }
        bytes
    }

    /// Reads settings; `None` for another version or anything out of its range.
    pub fn parse(bytes: &[u8; Self::LENGTH]) -> Option<Self> {
        let word = |at: usize| bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes);
        let [version, node, source, number] = word(0)?.to_le_bytes();
        let settings = Self {
            node: Node::new(node)?,
            bit_rate_kbit: (word(4)? >> 16) as u16,
            heartbeat_ms: word(4)? as u16,
            awaited_heartbeat: word(8)?,
            source: match source {
                0 => Source::Sensors,
                1 => Source::Bus,
                _ => return None,
            },
            number: Number::from_code(number)?,
            telemetry_every: u8::try_from(word(12)?).ok()?,
            period_s: f32::from_bits(word(16)?),
            campaign_h: f32::from_bits(word(20)?),
            commissioned: word(24)?,
        };
        (version == Self::VERSION && settings.validate().is_ok()).then_some(settings)
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// Names the first one out of its range, and the range.
    pub fn validate(&self) -> Result<(), SettingError> {
        let (least, most) = PERIOD_RANGE_S;
        let checks = [
            (RATES_KBIT.contains(&self.bit_rate_kbit), "bit_rate_kbit", "1000, 500, 250 or 125"),
            ((least..=most).contains(&self.period_s), "period_s", "1e-5 to 1"),
            ((0.0..=1e6).contains(&self.campaign_h), "campaign_h", "0 to 1e6"),
            (
                self.awaited_heartbeat >> 23 == 0,
                "awaited_heartbeat",
                "a node (bits 16 to 22) and milliseconds (bits 0 to 15)",
            ),
        ];
        match checks.into_iter().find(|(holds, ..)| !holds) {
            Some((_, name, legal)) => Err(SettingError { name, legal }),
            None => Ok(()),
        }
    }
}

/// A setting out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingError {
    /// Its name.
    pub name: &'static str,
    /// What it may be.
    pub legal: &'static str,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: must be {}", self.name, self.legal)
    }
}

impl core::error::Error for SettingError {}

/// Length in bytes of the longest block that is stored: with a network.
pub const BLOCK_LENGTH: usize = NodeSettings::LENGTH + LONGEST_SET;
const _: () = assert!(BLOCK_LENGTH <= crate::store::MAX_PAYLOAD, "it must fit the store");

/// Why a stored block was not taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlockError {
    /// Too short, of another version, or a setting is out of its range.
    NodeSettings,
    /// The parameter set is refused.
    Set(SetError),
}

impl fmt::Display for BlockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NodeSettings => {
                f.write_str("stored settings are of another version or out of range")
            }
            Self::Set(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for BlockError {}

/// NodeSettings and parameters as the block that is stored.
pub fn emit_block(settings: &NodeSettings, set: &ParameterSet) -> Vec<u8, BLOCK_LENGTH> {
    let mut block = Vec::new();
    // Its length is the sum of theirs.
    let _ = block.extend_from_slice(&settings.emit());
    let _ = block.extend_from_slice(&set.emit());
    block
}

/// Reads a stored block.
///
/// # Errors
/// Says which half is wrong, and of the parameters which one is refused and why.
pub fn parse_block(block: &[u8]) -> Result<(NodeSettings, ParameterSet), BlockError> {
    let (head, set) =
        block.split_first_chunk::<{ NodeSettings::LENGTH }>().ok_or(BlockError::NodeSettings)?;
    let settings = NodeSettings::parse(head).ok_or(BlockError::NodeSettings)?;
    Ok((settings, ParameterSet::parse(set).map_err(BlockError::Set)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::record::RecordError;

    #[test]
    fn a_block_is_read_as_it_was_written() {
        let settings = NodeSettings {
            node: Node::new(17).unwrap(),
            bit_rate_kbit: 250,
            heartbeat_ms: 250,
            awaited_heartbeat: 3 << 16 | 500,
            source: Source::Bus,
            number: Number::default(),
            telemetry_every: 7,
            period_s: 2.5e-4,
            campaign_h: 12.5,
            commissioned: 0x1234_5678,
        };
        let mut block = emit_block(&settings, &ParameterSet::default());
        assert_eq!(parse_block(&block), Ok((settings, ParameterSet::default())));
        assert_eq!(parse_block(&block[..10]), Err(BlockError::NodeSettings));
        block[NodeSettings::LENGTH + 90] ^= 1;
        assert_eq!(parse_block(&block), Err(BlockError::Set(SetError::Record(RecordError::Crc))));
        block[2] = 2;
        assert_eq!(parse_block(&block), Err(BlockError::NodeSettings));
    }
}
