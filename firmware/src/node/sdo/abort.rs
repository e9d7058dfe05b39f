//! Abort codes (CiA 301, table 22).

use canopen_rs::Address;
use canopen_rs::sdo::{SdoAbortCode, encode_abort};

macro_rules! aborts {
    ($($(#[$doc:meta])* $abort:ident = $code:literal,)*) => {
        /// Reasons to abort a transfer: the abort codes of CiA 301 that this driver uses.
        // Numbered from 0, because an image loads and compares a small number with fewer bytes than a code, and in a word, so
        // that a result of a word and an abort fits two registers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum Abort { $($(#[$doc])* $abort,)* }

        impl Abort {
            /// Returns the code of CiA 301.
            #[inline(never)]
            pub const fn code(self) -> u32 {
                match self {
                    $(Self::$abort => $code,)*
                }
            }
        }
    };
}

aborts! {
    /// A segment is repeated or missing.
    Toggle = 0x0503_0000,
    /// The client does not continue a block transfer.
    TimedOut = 0x0504_0000,
    /// The request is unknown or does not fit the transfer.
    Command = 0x0504_0001,
    /// The client asks for blocks of 0 or more than 127 segments.
    BlockSize = 0x0504_0002,
    /// The client confirms a segment that was not sent.
    Sequence = 0x0504_0003,
    /// The CRC of a block transfer is wrong.
    Crc = 0x0504_0004,
    /// The value exceeds the driver's buffer.
    Memory = 0x0504_0005,
    /// The object needs the service level, and the joint is locked.
    Locked = 0x0601_0000,
    /// The object can only be written.
    WriteOnly = 0x0601_0001,
    /// The object can only be read.
    ReadOnly = 0x0601_0002,
    /// The object does not exist.
    NoObject = 0x0602_0000,
    /// The object cannot be mapped to a PDO.
    NotMappable = 0x0604_0041,
    /// The mapped objects are longer than a PDO.
    MappingLength = 0x0604_0042,
    /// The flash reported an error.
    Hardware = 0x0606_0000,
    /// The value has too many bytes.
    TooLong = 0x0607_0012,
    /// The value has too few bytes.
    TooShort = 0x0607_0013,
    /// The sub-index does not exist.
    NoSubIndex = 0x0609_0011,
    /// The value is out of range or inconsistent with others; the refusal object gives name and reason.
    Value = 0x0609_0030,
    /// Above its range.
    TooHigh = 0x0609_0031,
    /// Below its range.
    TooLow = 0x0609_0032,
    /// The request is valid but refused.
    Refused = 0x0800_0020,
    /// The request is not allowed while the joint is armed.
    State = 0x0800_0022,
}

/// Returns the frame that aborts a transfer. `canopen-rs` has fewer abort codes, so the code is inserted
/// here.
pub(super) fn abort_frame(at: Address, abort: Abort) -> [u8; 8] {
    let [a, b, c, d, ..] = encode_abort(at, SdoAbortCode::General);
    let [e, f, g, h] = abort.code().to_le_bytes();
    [a, b, c, d, e, f, g, h]
}
