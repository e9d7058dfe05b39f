//! The SDO server: tools read and write the objects of a driver through it (CiA 301, 7.2.4).
//!
//! A value of up to four bytes travels in one frame. A longer one travels in segments of seven bytes, each
//! confirmed, or in blocks of up to 127 segments, each block confirmed.
//! `canopen-rs` codes the frames of the first two. The server is our own, because it must ask the driver
//! *before* it confirms a write: the driver refuses parameters while the joint is armed, out of range, or
//! inconsistent with others, and the answer must contain that.
//!
//! One transfer is active at a time. A new request, or a pause of [`TIMEOUT_US`], ends the previous one. A
//! value is collected in a buffer of [`MAX_VALUE_BYTES`], or, if its object asks for it, passed on in parts
//! as it arrives: a firmware image is longer than any buffer.
//!
//! ```text
//! request -> answer()       -> the answer; none to an abort and within a block
//!            tick()         -> what a lost frame needs: a confirmation or an abort
//!            next_segment() -> the next segment of a block that is read, once there is room to send it
//! ```

mod abort;
mod block;
#[cfg(test)]
mod block_tests;
mod incoming;
mod outgoing;
mod segmented;
#[cfg(test)]
mod tests;

pub use abort::Abort;

use abort::abort_frame;
use block::{BlockDownload, BlockUpload};
use canopen_rs::Address;
use heapless::Vec;
use incoming::Incoming;
use outgoing::Outgoing;

/// Maximum length of a value that is not passed on in parts, bytes: a network's record.
pub const MAX_VALUE_BYTES: usize = compensator_core::network::record::LENGTH;
const _: () = assert!(compensator_core::record::LENGTH <= MAX_VALUE_BYTES);

/// Maximum length of a part of a value, bytes: a block of 127 segments.
pub const MAX_PART_BYTES: usize = block::MAX_SEGMENTS as usize * SEGMENT;
const _: () = assert!(MAX_PART_BYTES + SEGMENT <= MAX_VALUE_BYTES);

/// Maximum pause within a transfer, us.
pub const TIMEOUT_US: u64 = 1_000_000;

/// Bytes of data in a segment.
const SEGMENT: usize = 7;

/// Bits of the command byte (CiA 301, 7.2.4.3).
mod command_bits {
    pub const COMMAND: u8 = 0xE0;
    pub const DOWNLOAD_SEGMENT: u8 = 0x00;
    pub const DOWNLOAD: u8 = 0x20;
    pub const UPLOAD: u8 = 0x40;
    pub const UPLOAD_SEGMENT: u8 = 0x60;
    pub const ABORT: u8 = 0x80;
    pub const BLOCK_UPLOAD: u8 = 0xA0;
    pub const BLOCK_DOWNLOAD: u8 = 0xC0;
    pub const EXPEDITED: u8 = 0x02;
    pub const SIZED: u8 = 0x01;
    pub const TOGGLE: u8 = 0x10;
}

/// Buffer for one value, with the unused bytes of its last segment.
pub type ValueBuffer = Vec<u8, { MAX_VALUE_BYTES + SEGMENT - 1 }>;

/// Access of the server to the driver's objects.
pub trait Objects {
    /// Checks that the object can be written with this length. The server calls it before it accepts data, and again
    /// when the value is complete: the rights may have changed meanwhile.
    ///
    /// # Errors
    /// Returns why it cannot be written.
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort>;

    /// Writes a value, little-endian.
    ///
    /// # Errors
    /// Returns why it is refused. Nothing is changed then.
    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort>;

    /// Reads a value, little-endian.
    ///
    /// # Errors
    /// Returns why it cannot be read.
    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort>;

    /// Returns true if the object takes its value in parts ([`Objects::write_part`]); it may then be longer than
    /// [`MAX_VALUE_BYTES`].
    fn takes_parts(&self, _at: Address) -> bool {
        false
    }

    /// Takes the next part of a value, of 1 to [`MAX_PART_BYTES`] bytes. The parts follow each other without
    /// gap; the first one, at offset 0, ends an incomplete value. The client waits until this returns. The CRC of a
    /// block transfer is checked after the last part.
    ///
    /// # Errors
    /// Returns why it is refused; the transfer ends then.
    fn write_part(&mut self, _at: Address, _offset: usize, _part: &[u8]) -> Result<(), Abort> {
        Err(Abort::Command)
    }

    /// Ends a value that was taken in parts: it is complete, has this length in bytes, and its CRC is right.
    /// Not called for a transfer that is aborted.
    ///
    /// # Errors
    /// Returns why the value is refused.
    fn end_stream(&mut self, _at: Address, _length: usize) -> Result<(), Abort> {
        Err(Abort::Command)
    }

    /// Returns the length of a value that is read in parts ([`Objects::read_part`]), bytes; `None` if it is
    /// read at once. It may be longer than [`MAX_VALUE_BYTES`] and must not change until it has been read.
    ///
    /// # Errors
    /// Returns why it cannot be read.
    fn stream_length(&mut self, _at: Address) -> Result<Option<usize>, Abort> {
        Ok(None)
    }

    /// Fills `part` (at most 7 bytes) from a value, starting at this offset. A part may be read again.
    ///
    /// # Errors
    /// Returns why it cannot be read.
    fn read_part(&mut self, _at: Address, _offset: usize, _part: &mut [u8]) -> Result<(), Abort> {
        Err(Abort::Command)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    None,
    /// To the driver, in confirmed segments.
    Download {
        incoming: Incoming,
        toggle: bool,
    },
    /// From the driver, in confirmed segments. `sent` bytes are sent.
    Upload {
        outgoing: Outgoing,
        sent: usize,
        toggle: bool,
    },
    /// To the driver, in blocks.
    BlockDownload(BlockDownload),
    /// From the driver, in blocks.
    BlockUpload(BlockUpload),
}

/// Error of a request: the object that its abort names, and the reason.
type Failure = (Address, Abort);

/// Abort of a request that belongs to no transfer, and thus to no object.
const NO_TRANSFER: Failure = (Address::new(0, 0), Abort::Command);

/// The server of one driver.
#[derive(Debug)]
pub struct SdoServer {
    transfer: Transfer,
    /// The value, or the part of it that has not been passed on.
    value: ValueBuffer,
    last_us: u64,
    aborts: u32,
}

impl Default for SdoServer {
    fn default() -> Self {
        Self::new()
    }
}

impl SdoServer {
    /// Returns a server without an active transfer.
    pub const fn new() -> Self {
        Self { transfer: Transfer::None, value: Vec::new(), last_us: 0, aborts: 0 }
    }

    /// Returns the number of transfers that the driver refused or aborted.
    pub const fn aborts(&self) -> u32 {
        self.aborts
    }

    /// Answers a request. An abort by the client has no answer, nor has a segment within a block.
    pub fn answer(
        &mut self,
        request: &[u8; 8],
        now_us: u64,
        objects: &mut impl Objects,
    ) -> Option<[u8; 8]> {
        if now_us.saturating_sub(self.last_us) > TIMEOUT_US {
            self.transfer = Transfer::None;
        }
        let [command, low, high, sub_index, ..] = *request;
        if command == command_bits::ABORT {
            self.transfer = Transfer::None;
            return None;
        }
        let outcome = if let Transfer::BlockDownload(block) = self.transfer
            && block.takes(request, &self.value)
        {
            self.block_segment(block, request, now_us, objects)
        } else {
            self.last_us = now_us;
            let at = Address::new(u16::from_le_bytes([low, high]), sub_index);
            self.begin_or_continue(at, request, objects)
        };
        self.or_abort(outcome)
    }

    /// Processes a request that is not a segment of a block.
    fn begin_or_continue(
        &mut self,
        at: Address,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<Option<[u8; 8]>, Failure> {
        let command = request[0];
        match command & command_bits::COMMAND {
            command_bits::DOWNLOAD => {
                self.begin_download(at, request, objects).map_err(|abort| (at, abort))
            }
            command_bits::UPLOAD => self.begin_upload(at, objects).map_err(|abort| (at, abort)),
            command_bits::DOWNLOAD_SEGMENT => self.download_segment(request, objects),
            command_bits::UPLOAD_SEGMENT => {
                self.upload_segment(command & command_bits::TOGGLE != 0, objects)
            }
            command_bits::BLOCK_DOWNLOAD if command & 1 == 0 => {
                self.begin_block_download(at, request, objects).map_err(|abort| (at, abort))
            }
            command_bits::BLOCK_DOWNLOAD => self.end_block_download(request, objects),
            command_bits::BLOCK_UPLOAD if command & 3 == 0 => {
                self.begin_block_upload(at, request, objects).map_err(|abort| (at, abort))
            }
            command_bits::BLOCK_UPLOAD => return self.continue_block_upload(request),
            // An abort may have its reserved bits set.
            command_bits::ABORT => {
                self.transfer = Transfer::None;
                return Ok(None);
            }
            _ => Err((at, Abort::Command)),
        }
        .map(Some)
    }

    /// Returns the frame that recovers from a lost frame of a block transfer: a confirmation of the segments
    /// that arrived, or the abort of a transfer whose client has gone. Call it about once a millisecond.
    pub fn tick(&mut self, now_us: u64, objects: &mut impl Objects) -> Option<[u8; 8]> {
        let pause_us = now_us.saturating_sub(self.last_us);
        match &mut self.transfer {
            Transfer::BlockDownload(block) => {
                if pause_us > TIMEOUT_US {
                    let at = block.at();
                    return self.or_abort(Err((at, Abort::TimedOut)));
                }
                if block.is_interrupted(now_us) {
                    let block = *block;
                    let outcome = self.end_block(block, objects);
                    return self.or_abort(outcome);
                }
                None
            }
            Transfer::BlockUpload(block) => {
                if block.has_segments() {
                    // A busy bus delays the segments, not the client.
                    self.last_us = now_us;
                } else if pause_us > TIMEOUT_US {
                    let at = block.at();
                    return self.or_abort(Err((at, Abort::TimedOut)));
                }
                None
            }
            _ => None,
        }
    }

    /// Returns the next segment of a block that the client reads. Call it when there is room to send a frame.
    pub fn next_segment(&mut self, objects: &mut impl Objects) -> Option<[u8; 8]> {
        let Transfer::BlockUpload(block) = &mut self.transfer else { return None };
        let at = block.at();
        let outcome = block.next_segment(&self.value, objects).map_err(|abort| (at, abort));
        self.or_abort(outcome)
    }

    fn or_abort(&mut self, outcome: Result<Option<[u8; 8]>, Failure>) -> Option<[u8; 8]> {
        outcome.unwrap_or_else(|(at, abort)| {
            self.transfer = Transfer::None;
            self.aborts = self.aborts.saturating_add(1);
            Some(abort_frame(at, abort))
        })
    }
}
