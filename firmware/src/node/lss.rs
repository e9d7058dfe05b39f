//! Layer setting services (CiA 305): a tool gives joints their node numbers over the bus.
//!
//! Joints from the shelf have the same node number, so no identifier of theirs names one of them. LSS addresses them by
//! their identity (1018h): vendor, product, revision, serial number. A master finds a joint without a number by
//! *fastscan*, a binary search in which all such joints answer with the same frame. It then configures the number, stores
//! it, and switches the joint back to *waiting*.
//!
//! A joint without stored settings counts as one without a number. It works as node 1 meanwhile.

use compensator_core::can::Frame;

/// Identifier of the frames of the LSS master.
pub const LSS_REQUEST: u16 = 0x7E5;
/// Identifier of the answers of the joints.
pub const LSS_ANSWER: u16 = 0x7E4;

/// Node number of a joint that has none.
pub const NO_NODE: u8 = 255;

/// Bit rates of the standard table (CiA 305, table 1), kbit/s, by their number in it.
const BIT_RATES_KBIT: [u16; 5] = [1000, 800, 500, 250, 125];

/// Command specifiers.
mod command {
    pub const SWITCH_GLOBAL: u8 = 0x04;
    pub const CONFIGURE_NODE: u8 = 0x11;
    pub const CONFIGURE_BIT_TIMING: u8 = 0x13;
    pub const STORE: u8 = 0x17;
    pub const SELECT_VENDOR: u8 = 0x40;
    pub const SELECT_SERIAL: u8 = 0x43;
    pub const SELECTED: u8 = 0x44;
    pub const IDENTIFY_VENDOR: u8 = 0x46;
    pub const IDENTIFY_SERIAL_HIGH: u8 = 0x4B;
    pub const IDENTIFY_UNCONFIGURED: u8 = 0x4C;
    pub const IDENTIFIED: u8 = 0x4F;
    pub const UNCONFIGURED: u8 = 0x50;
    pub const FASTSCAN: u8 = 0x51;
    pub const INQUIRE_VENDOR: u8 = 0x5A;
    pub const INQUIRE_SERIAL: u8 = 0x5D;
    pub const INQUIRE_NODE: u8 = 0x5E;
}

/// Value of `bit_check` that starts a fastscan.
const FASTSCAN_START: u8 = 0x80;

/// What a request requires of the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssAction {
    /// Nothing.
    None,
    /// Send this answer.
    Answer([u8; 8]),
    /// Set the node number, and answer with [`Lss::result`].
    SetNode(u8),
    /// Set the bit rate, kbit/s, and answer with [`Lss::result`].
    SetBitRate(u16),
    /// Store the settings, and answer with [`Lss::result`].
    Store,
    /// The configuration ends.
    Leave,
}

/// State of the layer setting services of a joint.
#[derive(Clone, Debug, Default)]
pub struct Lss {
    is_configuring: bool,
    /// Vendor, product and revision of a selection.
    selected: [u32; 3],
    /// Values of an identification: vendor, product, lowest and highest revision, lowest and highest serial number.
    identified: [u32; 6],
    /// Part of the identity that the fastscan has reached.
    fastscan_at: u8,
}

impl Lss {
    /// Returns an answer with an error code: 0 success, 1 illegal or not supported, 2 storage failed, 255 refused.
    pub const fn result(request: u8, code: u8) -> [u8; 8] {
        [request, code, 0, 0, 0, 0, 0, 0]
    }

    /// Processes a request to a joint with this identity and node number ([`NO_NODE`] if it has none).
    pub fn receive(&mut self, frame: &Frame, identity: &[u32; 4], node: u8) -> LssAction {
        let Ok([request, a, b, c, d, rest @ ..]) = <[u8; 8]>::try_from(frame.data()) else {
            return LssAction::None;
        };
        let number = u32::from_le_bytes([a, b, c, d]);
        match request {
            command::SWITCH_GLOBAL => self.switch(a),
            command::SELECT_VENDOR..=command::SELECT_SERIAL => {
                self.select(request, number, identity)
            }
            command::IDENTIFY_VENDOR..=command::IDENTIFY_SERIAL_HIGH => {
                self.identify(request, number, identity)
            }
            command::IDENTIFY_UNCONFIGURED if node == NO_NODE => {
                LssAction::Answer(Self::result(command::UNCONFIGURED, 0))
            }
            command::FASTSCAN if node == NO_NODE && !self.is_configuring => {
                self.fastscan(number, rest, identity)
            }
            _ if !self.is_configuring => LssAction::None,
            command::CONFIGURE_NODE => LssAction::SetNode(a),
            command::CONFIGURE_BIT_TIMING => {
                let rate = BIT_RATES_KBIT.get(usize::from(b)).filter(|_| a == 0);
                rate.map_or(LssAction::Answer(Self::result(request, 1)), |rate| {
                    LssAction::SetBitRate(*rate)
                })
            }
            command::STORE => LssAction::Store,
            command::INQUIRE_VENDOR..=command::INQUIRE_SERIAL => {
                let part = identity.get(usize::from(request - command::INQUIRE_VENDOR));
                let [a, b, c, d] = part.copied().unwrap_or_default().to_le_bytes();
                LssAction::Answer([request, a, b, c, d, 0, 0, 0])
            }
            command::INQUIRE_NODE => LssAction::Answer(Self::result(request, node)),
            _ => LssAction::None,
        }
    }

    fn switch(&mut self, mode: u8) -> LssAction {
        let was_configuring = self.is_configuring;
        match mode {
            0 => self.is_configuring = false,
            1 => self.is_configuring = true,
            _ => {}
        }
        let has_ended = was_configuring && !self.is_configuring;
        if has_ended { LssAction::Leave } else { LssAction::None }
    }

    fn select(&mut self, request: u8, number: u32, identity: &[u32; 4]) -> LssAction {
        let place = usize::from(request - command::SELECT_VENDOR);
        if let Some(part) = self.selected.get_mut(place) {
            *part = number;
            return LssAction::None;
        }
        let [vendor, product, revision] = self.selected;
        self.selected = [0; 3];
        if *identity != [vendor, product, revision, number] {
            return LssAction::None;
        }
        self.is_configuring = true;
        LssAction::Answer(Self::result(command::SELECTED, 0))
    }

    fn identify(&mut self, request: u8, number: u32, identity: &[u32; 4]) -> LssAction {
        let place = usize::from(request - command::IDENTIFY_VENDOR);
        if let Some(part) = self.identified.get_mut(place) {
            *part = number;
        }
        let [vendor, product, low, high, first, last] = self.identified;
        let [vendor_id, product_code, revision, serial] = *identity;
        let is_identified = (vendor, product) == (vendor_id, product_code)
            && (low..=high).contains(&revision)
            && (first..=last).contains(&serial);
        if request == command::IDENTIFY_SERIAL_HIGH && is_identified {
            LssAction::Answer(Self::result(command::IDENTIFIED, 0))
        } else {
            LssAction::None
        }
    }

    fn fastscan(&mut self, number: u32, step: [u8; 3], identity: &[u32; 4]) -> LssAction {
        let [bit_check, part, next] = step;
        let found = LssAction::Answer(Self::result(command::IDENTIFIED, 0));
        if bit_check == FASTSCAN_START {
            self.fastscan_at = 0;
            return found;
        }
        let Some(word) = identity.get(usize::from(part)).filter(|_| part == self.fastscan_at)
        else {
            return LssAction::None;
        };
        let Some(mask) = u32::MAX.checked_shl(bit_check.into()) else { return LssAction::None };
        if (word ^ number) & mask != 0 {
            return LssAction::None;
        }
        self.fastscan_at = next;
        // The last bit of the last part selects the joint.
        self.is_configuring = bit_check == 0 && next < part;
        found
    }
}
