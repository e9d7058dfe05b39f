//! Settings of the node, stored besides the parameters: bus participation and the source of inputs.
//!
//! Stored in one block with the parameter record, so that the two cannot be of different ages. Every
//! setting is an object of the dictionary (see [`crate::node::dictionary`]) and is refused out of range
//! when it is written, not when it is used.

use crate::access::AccessSettings;
use crate::drive_settings::DriveSettings;
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::hil::{HilSetup, NumberType};
use crate::node::bit_timing::{BIT_RATES_KBIT, DATA_BIT_RATES_KBIT, DEFAULT_DATA_BIT_RATE_KBIT};
use crate::parameter_set::{MAX_SET_BYTES, ParameterSet};
use crate::setting_error::SettingError;
use crate::store::{IDENTITY_BYTES, Identity};
use compensator_core::can::NodeId;
use compensator_core::text;
use heapless::Vec;

/// Source of the driver's inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InputSource {
    /// Own encoder and converters: the driver controls a joint.
    #[default]
    Sensors,
    /// CAN frames (HIL): the driver controls no joint.
    Bus,
}

impl InputSource {
    /// Returns the source with this number on the bus.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Sensors),
            1 => Some(Self::Bus),
            _ => None,
        }
    }
}

/// Legal sample periods of a joint in HIL, s.
pub const PERIOD_RANGE_S: (f32, f32) = (1e-5, 1.0);

/// Maximum of [`NodeSettings::target_timeout_ms`], and its default: the maximum of `command_timeout_us`, which
/// also applies.
pub const TARGET_TIMEOUT_MAX_MS: u16 = 100;

with_defaults! {
    /// Settings of the node: bus participation and source of inputs.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct NodeSettings {
        /// Node number of the joint on its bus.
        pub node: NodeId = NodeId::FIRST,
        /// Bit rate of the bus, kbit/s: one of [`BIT_RATES_KBIT`]. Node number and bit rate take effect at the
        /// next start.
        pub bit_rate_kbit: u16 = 1000,
        /// Bit rate of the data of CAN FD frames on the bus, kbit/s: one of [`DATA_BIT_RATES_KBIT`]. The controller must
        /// follow those of other nodes. Takes effect at the next start.
        pub data_bit_rate_kbit: u16 = DEFAULT_DATA_BIT_RATE_KBIT,
        /// The transmit PDOs of a sample are sent in one frame of CAN FD, with switched bit rate.
        pub fd_telemetry: bool,
        /// Period of the heartbeat, ms; 0 disables it.
        pub heartbeat_ms: u16 = 1000,
        /// Monitored heartbeat in the format of CiA 301: node (bits 16 to 22) and timeout, ms (bits 0 to 15); 0
        /// disables it.
        pub awaited_heartbeat: u32,
        /// Maximum time between two targets of a CiA 402 master, ms (1400h:5). With 0 the monitored heartbeat
        /// confirms the last target.
        pub target_timeout_ms: u16 = TARGET_TIMEOUT_MAX_MS,
        /// Source of the inputs.
        pub source: InputSource,
        /// Number type of the joint in HIL.
        pub number: NumberType,
        /// Telemetry is sent at every n-th SYNC; 0 disables it.
        pub telemetry_every: u8 = 1,
        /// SYNC period of a joint in HIL, s.
        pub period_s: f32 = 1e-3,
        /// Age of the campaign when a run begins, h.
        pub campaign_h: f32,
        /// CRC of the confirmed wiring, see [`ParameterSet::wiring_crc`]; 0 if none is confirmed.
        pub commissioned: u32,
        /// CRC of the wiring with which the motor was seen to turn by its current; 0 if there is none.
        pub proven: u32,
        /// Settings of the CiA 402 drive.
        pub drive: DriveSettings,
        /// Record of the last tuning.
        pub tuning: TuningRecord,
        /// Key and policy of the service level.
        pub access: AccessSettings,
    }
}

/// Record of the last tuning: the words of 2043h:1 to 2043h:6. The driver uses [`SET_BEFORE`] alone, the rest is for tools.
pub type TuningRecord = [u32; 6];

/// Place of the CRC of the set before the tuning in a [`TuningRecord`].
pub const SET_BEFORE: usize = 2;

/// The settings that a node needs to answer on its bus.
///
/// The boot program reads them from a store that a newer image may have written. Their places are therefore the same in all
/// versions, and must stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusSettings {
    /// Node number.
    pub node: NodeId,
    /// Bit rate, kbit/s.
    pub bit_rate_kbit: u16,
    /// Bit rate of the data of CAN FD frames, kbit/s.
    pub data_bit_rate_kbit: u16,
}

impl BusSettings {
    /// Length of the begin of encoded settings that has them, bytes.
    pub const BYTES: usize = 16;

    /// Parses the begin of encoded settings, of this or a later version; `None` for a value out of range.
    pub fn parse(bytes: &[u8; Self::BYTES]) -> Option<Self> {
        let [version, node, _, _, _, _, rate_low, rate_high, .., data_rate, _, _] = *bytes;
        let bit_rate_kbit = u16::from_le_bytes([rate_low, rate_high]);
        let is_known = version >= NodeSettings::VERSION_WITHOUT_DRIVE
            && BIT_RATES_KBIT.contains(&bit_rate_kbit);
        // The highest bit is that of the telemetry.
        let data_bit_rate_kbit = match data_rate & 0x7F {
            // Settings of a driver without this one.
            0 => DEFAULT_DATA_BIT_RATE_KBIT,
            1 => 1000,
            2 => 2000,
            5 => 5000,
            _ => return None,
        };
        let node = NodeId::new(node)?;
        is_known.then_some(Self { node, bit_rate_kbit, data_bit_rate_kbit })
    }
}

impl Default for BusSettings {
    fn default() -> Self {
        let NodeSettings { node, bit_rate_kbit, data_bit_rate_kbit, .. } = NodeSettings::default();
        Self { node, bit_rate_kbit, data_bit_rate_kbit }
    }
}

impl NodeSettings {
    /// Returns the settings of the bus.
    pub const fn bus(&self) -> BusSettings {
        BusSettings {
            node: self.node,
            bit_rate_kbit: self.bit_rate_kbit,
            data_bit_rate_kbit: self.data_bit_rate_kbit,
        }
    }

    /// Length of the encoded settings without those of drive and access, bytes.
    const HEAD: usize = 32;
    /// Length of the encoded settings without those of tuning and access, bytes.
    const WITHOUT_ACCESS: usize = Self::HEAD + DriveSettings::LENGTH;
    /// Length of the encoded settings without those of the tuning, bytes.
    const WITHOUT_TUNING: usize = Self::WITHOUT_ACCESS + AccessSettings::LENGTH;
    /// Length of the encoded settings, bytes.
    pub const LENGTH: usize = Self::WITHOUT_TUNING + size_of::<TuningRecord>();
    const VERSION: u8 = 8;
    const VERSION_WITHOUT_PROFILES: u8 = 7;
    const VERSION_WITHOUT_ADAPTATION: u8 = 6;
    const VERSION_WITHOUT_TUNING: u8 = 5;
    const VERSION_WITHOUT_ACCESS: u8 = 4;
    const VERSION_WITHOUT_DRIVE: u8 = 3;

    /// Returns true for a joint in HIL, whose inputs come over the bus.
    pub const fn is_in_hil(&self) -> bool {
        matches!(self.source, InputSource::Bus)
    }

    /// Returns the time from one sample of the joint to the next, s: a report of the loop, or a SYNC in HIL.
    pub const fn sample_period_s(&self) -> f32 {
        match self.source {
            InputSource::Sensors => REPORT_PERIOD_S,
            InputSource::Bus => self.period_s,
        }
    }

    /// Returns the setup of a joint in HIL.
    pub fn hil_setup(&self) -> HilSetup {
        HilSetup { number: self.number, period_s: self.period_s, campaign_h: self.campaign_h }
    }

    /// Returns the settings as bytes, little-endian: a version, the fields in order, then those of drive, tuning and
    /// access.
    pub fn emit(&self) -> [u8; Self::LENGTH] {
        let [timeout_low, timeout_high] = self.target_timeout_ms.to_le_bytes();
        let data_rate = (self.data_bit_rate_kbit / 1000) as u8 | u8::from(self.fd_telemetry) << 7;
        let (node, source, number) = (self.node.number(), self.source as u8, self.number as u8);
        let head = [
            u32::from_le_bytes([Self::VERSION, node, source, number]),
            u32::from(self.heartbeat_ms) | u32::from(self.bit_rate_kbit) << 16,
            self.awaited_heartbeat,
            u32::from_le_bytes([self.telemetry_every, data_rate, timeout_low, timeout_high]),
            self.period_s.to_bits(),
            self.campaign_h.to_bits(),
            self.commissioned,
            self.proven,
        ];
        let mut bytes = [0; Self::LENGTH];
        let (words, _) = bytes.as_chunks_mut::<4>();
        let numbers = head.into_iter().chain(self.drive.to_words()).chain(self.tuning);
        words.iter_mut().zip(numbers).for_each(|(place, word)| *place = word.to_le_bytes());
        if let Some(place) = bytes.last_chunk_mut() {
            *place = self.access.emit();
        }
        bytes
    }

    /// Returns what the joint keeps if its store is damaged: node number and bit rates as at the begin of encoded
    /// settings, and key and policy. Other versions read it, so that the places must stay. It contains nothing else,
    /// because a save with another identity writes both slots, and the former set is lost.
    pub fn identity(&self) -> Identity {
        let mut identity = [0; IDENTITY_BYTES];
        let mut bus = [0; BusSettings::BYTES];
        [bus[6], bus[7]] = self.bit_rate_kbit.to_le_bytes();
        bus[0] = Self::VERSION_WITHOUT_DRIVE;
        bus[1] = self.node.number();
        bus[13] = (self.data_bit_rate_kbit / 1000) as u8;
        let bytes = bus.into_iter().chain(self.access.emit());
        identity.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
        identity
    }

    /// Returns these settings with an identity; `None` for a value out of range.
    pub fn with_identity(self, identity: &Identity) -> Option<Self> {
        let BusSettings { node, bit_rate_kbit, data_bit_rate_kbit } =
            BusSettings::parse(identity.first_chunk()?)?;
        let access = AccessSettings::parse(identity.last_chunk()?)?;
        Some(Self { node, bit_rate_kbit, data_bit_rate_kbit, access, ..self })
    }

    /// Parses the settings at the begin of a block, of this version or an earlier one. Returns the rest, too: the encoded
    /// parameter set, which is not parsed. What that
    /// version did not store has its default. `None` for another version or a value out of range.
    #[inline(never)]
    pub fn split(block: &[u8]) -> Option<(Self, &[u8])> {
        let version = *block.first()?;
        let drive_length = match version {
            Self::VERSION => DriveSettings::LENGTH,
            Self::VERSION_WITHOUT_PROFILES => DriveSettings::LENGTH_WITHOUT_PROFILES,
            Self::VERSION_WITHOUT_DRIVE => 0,
            _ => DriveSettings::LENGTH_WITHOUT_ADAPTATION,
        };
        let length = Self::HEAD
            + drive_length
            + match version {
                Self::VERSION
                | Self::VERSION_WITHOUT_PROFILES
                | Self::VERSION_WITHOUT_ADAPTATION => {
                    size_of::<TuningRecord>() + AccessSettings::LENGTH
                }
                Self::VERSION_WITHOUT_TUNING => AccessSettings::LENGTH,
                Self::VERSION_WITHOUT_ACCESS | Self::VERSION_WITHOUT_DRIVE => 0,
                _ => return None,
            };
        let (bytes, set) = block.split_at_checked(length)?;
        let (head, rest) = bytes.split_first_chunk()?;
        let mut settings = Self::parse_head(head)?;
        if let Some((drive, rest)) = rest.split_at_checked(drive_length) {
            settings.drive = DriveSettings::parse(drive)?;
            if let Some((tuning, access)) = rest.split_last_chunk() {
                settings.access = AccessSettings::parse(access)?;
                for (place, word) in settings.tuning.iter_mut().zip(tuning.as_chunks().0) {
                    *place = u32::from_le_bytes(*word);
                }
            }
        }
        Some((settings, set))
    }

    fn parse_head(bytes: &[u8; Self::HEAD]) -> Option<Self> {
        let word = |at: usize| bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes);
        let [_, _, source, number] = word(0)?.to_le_bytes();
        let bus = BusSettings::parse(bytes.first_chunk()?)?;
        let settings = Self {
            node: bus.node,
            bit_rate_kbit: bus.bit_rate_kbit,
            heartbeat_ms: word(4)? as u16,
            awaited_heartbeat: word(8)?,
            target_timeout_ms: (word(12)? >> 16) as u16,
            source: InputSource::from_code(source)?,
            number: NumberType::from_code(number)?,
            telemetry_every: word(12)? as u8,
            fd_telemetry: word(12)? >> 15 & 1 == 1,
            data_bit_rate_kbit: bus.data_bit_rate_kbit,
            period_s: f32::from_bits(word(16)?),
            campaign_h: f32::from_bits(word(20)?),
            commissioned: word(24)?,
            proven: word(28)?,
            ..Self::default()
        };
        settings.validate().is_ok().then_some(settings)
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// Returns the first setting out of range, and its range.
    pub fn validate(&self) -> Result<(), SettingError> {
        let (least, most) = PERIOD_RANGE_S;
        let (name, legal) = if !BIT_RATES_KBIT.contains(&self.bit_rate_kbit) {
            (text!("bit_rate_kbit"), text!("1000, 500, 250 or 125"))
        } else if !DATA_BIT_RATES_KBIT.contains(&self.data_bit_rate_kbit) {
            (text!("data_bit_rate_kbit"), text!("1000, 2000 or 5000"))
        } else if !(least..=most).contains(&self.period_s) {
            (text!("period_s"), text!("1e-5 to 1"))
        } else if !(0.0..=1e6).contains(&self.campaign_h) {
            (text!("campaign_h"), text!("0 to 1e6"))
        } else if self.awaited_heartbeat >> 23 != 0 {
            let legal = text!("a node (bits 16 to 22) and milliseconds (bits 0 to 15)");
            (text!("awaited_heartbeat"), legal)
        } else if self.target_timeout_ms > TARGET_TIMEOUT_MAX_MS {
            let legal = text!("1 to 100, or 0 (the monitored heartbeat confirms the target)");
            (text!("event_timer_ms"), legal)
        } else {
            return Ok(());
        };
        Err(SettingError { name, legal })
    }
}

/// Maximum length of a stored block, bytes: with a network.
pub const MAX_BLOCK_BYTES: usize = NodeSettings::LENGTH + MAX_SET_BYTES;
const _: () = assert!(MAX_BLOCK_BYTES <= crate::store::MAX_PAYLOAD, "it must fit the store");
const _: () = assert!(BusSettings::BYTES + AccessSettings::LENGTH == IDENTITY_BYTES);

/// Returns settings and parameters as the block that is stored.
pub fn emit_block(settings: &NodeSettings, set: &ParameterSet) -> Vec<u8, MAX_BLOCK_BYTES> {
    let mut block = Vec::new();
    // The capacity is the sum of the parts.
    let _ = block.extend_from_slice(&settings.emit());
    let _ = block.extend_from_slice(&set.emit());
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Key;
    use crate::parameter_set::SetError;
    use compensator_core::record::RecordError;

    /// Returns settings and parameters of a block; `None` if either is refused.
    fn parse_block(block: &[u8]) -> Option<(NodeSettings, ParameterSet)> {
        let (settings, set) = NodeSettings::split(block)?;
        Some((settings, ParameterSet::parse(set).ok()?))
    }

    #[test]
    fn parse_of_emitted_block_returns_settings_and_set() {
        let settings = NodeSettings {
            node: NodeId::new(17).unwrap(),
            bit_rate_kbit: 250,
            data_bit_rate_kbit: 5000,
            fd_telemetry: true,
            heartbeat_ms: 250,
            awaited_heartbeat: 3 << 16 | 500,
            target_timeout_ms: 45,
            source: InputSource::Bus,
            number: NumberType::default(),
            telemetry_every: 7,
            period_s: 2.5e-4,
            campaign_h: 12.5,
            commissioned: 0x1234_5678,
            proven: 0x8765_4321,
            drive: DriveSettings { quick_stop_option: -1, ..DriveSettings::default() },
            tuning: [1, 2, 3, 4, 0xFFFF_FF9C, 6],
            access: AccessSettings { key: Key::new([7; 16]), is_locked: false },
        };
        let mut block = emit_block(&settings, &ParameterSet::default());
        assert_eq!(parse_block(&block), Some((settings, ParameterSet::default())));
        assert_eq!(parse_block(&block[..10]), None);
        for thousands in 1..=u8::MAX {
            block[13] = thousands;
            let is_legal = matches!(thousands & 0x7F, 0 | 1 | 2 | 5);
            assert_eq!(parse_block(&block).is_some(), is_legal, "{thousands}");
        }
        // Settings stored before the data bit rate existed have its default.
        block[13] = 0;
        let former = NodeSettings { data_bit_rate_kbit: 2000, fd_telemetry: false, ..settings };
        assert_eq!(parse_block(&block), Some((former, ParameterSet::default())));
        block[NodeSettings::LENGTH + 90] ^= 1;
        let (_, set) = NodeSettings::split(&block).expect("intact settings");
        assert_eq!(ParameterSet::parse(set), Err(SetError::Record(RecordError::Crc)));
        block[2] = 2;
        assert_eq!(parse_block(&block), None);
    }

    /// Returns settings up to those of the drive, as versions before the adaptation stored them.
    fn old_begin(settings: &NodeSettings) -> std::vec::Vec<u8> {
        let length = NodeSettings::HEAD + DriveSettings::LENGTH_WITHOUT_ADAPTATION;
        settings.emit()[..length].to_vec()
    }

    #[test]
    fn parse_of_a_block_without_adaptation_keeps_all_other_settings() {
        let access = AccessSettings { key: Key::new([7; 16]), is_locked: false };
        let drive = DriveSettings { position_gain: 7_000, ..DriveSettings::default() };
        let tuning = [1, 2, 3, 4, 5, 6];
        let settings = NodeSettings { drive, tuning, access, ..NodeSettings::default() };
        let mut block = old_begin(&settings);
        block[0] = NodeSettings::VERSION_WITHOUT_ADAPTATION;
        block.extend_from_slice(&settings.emit()[NodeSettings::WITHOUT_ACCESS..]);
        block.extend_from_slice(&ParameterSet::default().emit());
        assert_eq!(parse_block(&block), Some((settings, ParameterSet::default())));
    }

    #[test]
    fn parse_of_a_block_without_profile_modes_has_their_defaults() {
        let drive = DriveSettings { adapt: 1, torque_slope: 7, ..DriveSettings::default() };
        let settings = NodeSettings { drive, tuning: [6; 6], ..NodeSettings::default() };
        let encoded = settings.emit();
        let former = NodeSettings::HEAD + DriveSettings::LENGTH_WITHOUT_PROFILES;
        let mut block = [&encoded[..former], &encoded[NodeSettings::WITHOUT_ACCESS..]].concat();
        block[0] = NodeSettings::VERSION_WITHOUT_PROFILES;
        block.extend_from_slice(&ParameterSet::default().emit());
        let drive = DriveSettings { adapt: 1, ..DriveSettings::default() };
        let expected = NodeSettings { drive, ..settings };
        assert_eq!(parse_block(&block), Some((expected, ParameterSet::default())));
    }

    #[test]
    fn parse_of_a_block_without_tuning_record_returns_an_empty_one() {
        let access = AccessSettings { key: Key::new([7; 16]), is_locked: false };
        let settings = NodeSettings { heartbeat_ms: 250, access, ..NodeSettings::default() };
        let mut block = old_begin(&settings);
        block[0] = 5;
        block.extend_from_slice(&access.emit());
        block.extend_from_slice(&ParameterSet::default().emit());
        assert_eq!(parse_block(&block), Some((settings, ParameterSet::default())));
        assert_eq!(settings.tuning, [0; 6]);
    }

    #[test]
    fn parse_of_a_block_without_access_settings_returns_a_locked_joint() {
        let settings = NodeSettings { heartbeat_ms: 250, ..NodeSettings::default() };
        let mut block = old_begin(&settings);
        block[0] = NodeSettings::VERSION_WITHOUT_ACCESS;
        block.extend_from_slice(&ParameterSet::default().emit());
        assert_eq!(parse_block(&block), Some((settings, ParameterSet::default())));
        assert!(settings.access.is_locked);
    }

    #[test]
    fn parse_of_a_block_without_drive_settings_returns_their_defaults() {
        let settings = NodeSettings { heartbeat_ms: 250, ..NodeSettings::default() };
        let mut block = settings.emit()[..NodeSettings::HEAD].to_vec();
        block[0] = NodeSettings::VERSION_WITHOUT_DRIVE;
        block.extend_from_slice(&ParameterSet::default().emit());
        assert_eq!(parse_block(&block), Some((settings, ParameterSet::default())));
        block[0] = 2;
        assert_eq!(parse_block(&block), None);
    }
}
