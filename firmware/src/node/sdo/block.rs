//! Block transfer: up to 127 segments under one confirmation (CiA 301, 7.2.4.3.9 to 7.2.4.3.17).
//!
//! The segments of a block are numbered from 1. The receiver takes them in order and ignores all that follow
//! a gap. It confirms the last good one, and the sender continues behind it with a new block. A CRC
//! (CRC-16/XMODEM) over the value ends the transfer.
//!
//! CiA 301 has no remedy if the *last* segment of a block is lost: both sides wait for each other. Here, a
//! pause of [`PAUSE_US`] within a block ends it as well. A client that waits then resends; a client that was
//! only slow finds the confirmation after its last segment, and does the same.

use super::incoming::Incoming;
use super::outgoing::Outgoing;
use super::{
    Abort, Failure, NO_TRANSFER, Objects, SEGMENT, SdoServer, Transfer, ValueBuffer, command_bits,
};
use canopen_rs::Address;

/// Segments of a block that is written, and the maximum of one that is read.
pub(super) const MAX_SEGMENTS: u8 = 127;

/// Pause within a block after which it is confirmed as far as it arrived, us. It is longer than a block at
/// 125 kbit/s, and shorter than the time-out of clients (python-canopen: 300 ms).
const PAUSE_US: u64 = 200_000;

/// Bit of a segment: it is the last of the value.
const LAST: u8 = 0x80;
/// Bits of the commands of block transfers.
const HAS_CRC: u8 = 0x04;
const SIZED: u8 = 0x02;
const END: u8 = 0x01;
const CONFIRM: u8 = 0x02;

const CRC: crc::Crc<u16, crc::NoTable> = crc::Crc::<u16, crc::NoTable>::new(&crc::CRC_16_XMODEM);

/// Returns the CRC of a value that continues one with the CRC `before` (0 at its start).
fn continued_crc(before: u16, data: &[u8]) -> u16 {
    let mut digest = CRC.digest_with_initial(before);
    digest.update(data);
    digest.finalize()
}

/// Returns the number of bytes in the last segment that are not used, as the commands contain it.
const fn unused_bits(unused: usize) -> u8 {
    (unused as u8) << 2
}

/// A value that is written in blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockDownload {
    incoming: Incoming,
    has_crc: bool,
    /// CRC of the value, except the first unchecked byte of the buffer and all after it.
    crc: u16,
    unchecked_at: usize,
    /// Number of the next segment, 1..=128.
    next: u8,
    /// Time of the last segment of this block, in order or not, us; `None` if none has arrived.
    seen_us: Option<u64>,
    /// First byte of the segment that ended the block before; 0 in the first block.
    ended_by: u8,
    /// The last segment of the value has this number, has arrived, and is confirmed.
    last: Option<u8>,
    /// Reason to abort at the end of the block. Until then the client sends segments, and those must not be
    /// taken for requests.
    failed: Option<Abort>,
}

impl BlockDownload {
    pub const fn at(&self) -> Address {
        self.incoming.at
    }

    /// Returns true if a block has begun and pauses.
    pub fn is_interrupted(&self, now_us: u64) -> bool {
        self.seen_us.is_some_and(|seen_us| now_us.saturating_sub(seen_us) > PAUSE_US)
    }

    /// Returns true if a frame is a segment: all are within a block. After the last one, only its repetition.
    pub fn takes(&self, frame: &[u8; 8], buffer: &ValueBuffer) -> bool {
        match self.last {
            None => true,
            Some(sequence) => frame[0] == LAST | sequence && buffer.ends_with(&frame[1..]),
        }
    }

    /// Includes the buffer in the CRC, except its last `kept` bytes, and passes it on if the object takes parts.
    fn check_and_pass_on(
        &mut self,
        kept: usize,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<(), Abort> {
        let end = buffer.len().saturating_sub(kept);
        self.crc = continued_crc(self.crc, buffer.get(self.unchecked_at..end).unwrap_or_default());
        self.incoming.pass_on(kept, buffer, objects)?;
        self.unchecked_at = buffer.len().saturating_sub(kept);
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum UploadPhase {
    /// The client must start the first block.
    AwaitStart,
    /// Segments are sent.
    Sending,
    /// The block is sent; the client must confirm it.
    AwaitConfirmation,
    /// The value is confirmed; the client must end the transfer.
    AwaitEnd,
}

/// A value that is read in blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockUpload {
    outgoing: Outgoing,
    phase: UploadPhase,
    /// Maximum number of segments in this block.
    segments: u8,
    /// Segments of this block that are sent.
    sent: u8,
    /// Bytes that the client has confirmed: the block starts here.
    confirmed: usize,
    crc: u16,
    /// Bytes included in the CRC.
    checked: usize,
}

impl BlockUpload {
    pub const fn at(&self) -> Address {
        self.outgoing.at
    }

    /// Returns true if segments wait to be sent.
    pub fn has_segments(&self) -> bool {
        self.phase == UploadPhase::Sending
    }

    pub fn next_segment(
        &mut self,
        buffer: &ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<Option<[u8; 8]>, Abort> {
        if !self.has_segments() {
            return Ok(None);
        }
        let offset = self.confirmed + usize::from(self.sent) * SEGMENT;
        let (data, count) = self.outgoing.segment(offset, buffer, objects)?;
        let end = offset + count;
        // A segment that is sent again is already included.
        if end > self.checked {
            self.crc = continued_crc(self.crc, data.get(..count).unwrap_or_default());
            self.checked = end;
        }
        self.sent += 1;
        let is_last = end == self.outgoing.length;
        if is_last || self.sent == self.segments {
            self.phase = UploadPhase::AwaitConfirmation;
        }
        let [a, b, c, d, e, f, g] = data;
        Ok(Some([if is_last { LAST | self.sent } else { self.sent }, a, b, c, d, e, f, g]))
    }

    /// Processes the confirmation of a block: `good` segments arrived, the next block has up to `segments`.
    fn confirm(&mut self, good: u8, segments: u8) -> Result<Option<[u8; 8]>, Abort> {
        check_block_size(segments)?;
        if good > self.sent {
            // While a block is sent, this is the repetition of the previous confirmation.
            return if self.has_segments() { Ok(None) } else { Err(Abort::Sequence) };
        }
        let behind = self.confirmed + usize::from(good) * SEGMENT;
        let (is_last, used) = (behind >= self.outgoing.length, self.outgoing.length);
        // An empty value has one segment, which must be confirmed too.
        if is_last && good > 0 {
            self.phase = UploadPhase::AwaitEnd;
            let [low, high] = self.crc.to_le_bytes();
            let command = command_bits::BLOCK_DOWNLOAD | END | unused_bits(behind - used);
            return Ok(Some([command, low, high, 0, 0, 0, 0, 0]));
        }
        self.confirmed = behind;
        self.segments = segments;
        self.sent = 0;
        self.phase = UploadPhase::Sending;
        Ok(None)
    }
}

fn check_block_size(segments: u8) -> Result<(), Abort> {
    if (1..=MAX_SEGMENTS).contains(&segments) { Ok(()) } else { Err(Abort::BlockSize) }
}

impl SdoServer {
    pub(super) fn begin_block_download(
        &mut self,
        at: Address,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        let [command, low, high, sub_index, size @ ..] = *request;
        let declared = (command & SIZED != 0).then_some(u32::from_le_bytes(size) as usize);
        let incoming = Incoming::begin(at, declared, &mut self.value, objects)?;
        self.transfer = Transfer::BlockDownload(BlockDownload {
            incoming,
            has_crc: command & HAS_CRC != 0,
            crc: 0,
            unchecked_at: 0,
            next: 1,
            seen_us: None,
            ended_by: 0,
            last: None,
            failed: None,
        });
        let answer = command_bits::BLOCK_UPLOAD | HAS_CRC;
        Ok([answer, low, high, sub_index, MAX_SEGMENTS, 0, 0, 0])
    }

    /// Takes a segment of a block, or ignores it because it does not follow the one before.
    pub(super) fn block_segment(
        &mut self,
        mut block: BlockDownload,
        request: &[u8; 8],
        now_us: u64,
        objects: &mut impl Objects,
    ) -> Result<Option<[u8; 8]>, Failure> {
        let [head, data @ ..] = request;
        let (sequence, is_last) = (head & !LAST, head & LAST != 0);
        let is_repeated_end =
            block.last.is_some() || block.next == 1 && *head == block.ended_by && sequence > 1;
        if is_repeated_end || sequence == 0 {
            return Ok(None);
        }
        block.seen_us = Some(now_us);
        if sequence == block.next {
            let padding = if is_last { SEGMENT - 1 } else { 0 };
            if block.failed.is_none() {
                block.failed = block.incoming.append(data, padding, &mut self.value).err();
            }
            block.next += 1;
            block.last = is_last.then_some(sequence);
            // Frames out of order are no progress: a transfer that its client has left must time out.
            self.last_us = now_us;
        }
        if is_last || sequence == MAX_SEGMENTS {
            block.ended_by = *head;
            return self.end_block(block, objects);
        }
        self.transfer = Transfer::BlockDownload(block);
        Ok(None)
    }

    /// Ends a block: passes on what arrived in order, and confirms it.
    pub(super) fn end_block(
        &mut self,
        mut block: BlockDownload,
        objects: &mut impl Objects,
    ) -> Result<Option<[u8; 8]>, Failure> {
        if let Some(abort) = block.failed {
            return Err((block.at(), abort));
        }
        let good = block.next - 1;
        // How many bytes of the last segment are used is known at the end.
        let kept = if block.last.is_some() { SEGMENT } else { 0 };
        let passed = block.check_and_pass_on(kept, &mut self.value, objects);
        passed.map_err(|abort| (block.at(), abort))?;
        block.next = 1;
        block.seen_us = None;
        self.transfer = Transfer::BlockDownload(block);
        let answer = command_bits::BLOCK_UPLOAD | CONFIRM;
        Ok(Some([answer, good, MAX_SEGMENTS, 0, 0, 0, 0, 0]))
    }

    pub(super) fn end_block_download(
        &mut self,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Failure> {
        let Transfer::BlockDownload(mut block) = self.transfer else { return Err(NO_TRANSFER) };
        self.transfer = Transfer::None;
        let [command, low, high, ..] = *request;
        let fail = |abort| (block.incoming.at, abort);
        let unused = usize::from(command >> 2 & 7);
        self.value.truncate(self.value.len().saturating_sub(unused));
        let rest = self.value.get(block.unchecked_at..).unwrap_or_default();
        block.crc = continued_crc(block.crc, rest);
        if block.has_crc && block.crc != u16::from_le_bytes([low, high]) {
            return Err(fail(Abort::Crc));
        }
        block.incoming.finish(&mut self.value, objects).map_err(fail)?;
        Ok([command_bits::BLOCK_UPLOAD | END, 0, 0, 0, 0, 0, 0, 0])
    }

    pub(super) fn begin_block_upload(
        &mut self,
        at: Address,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        let [_, low, high, sub_index, segments, threshold, ..] = *request;
        check_block_size(segments)?;
        let outgoing = Outgoing::begin(at, &mut self.value, objects)?;
        // The client prefers the transfer in segments for a value of up to this length.
        if outgoing.length <= usize::from(threshold) {
            return self.begin_upload(at, objects);
        }
        self.transfer = Transfer::BlockUpload(BlockUpload {
            outgoing,
            phase: UploadPhase::AwaitStart,
            segments,
            sent: 0,
            confirmed: 0,
            crc: 0,
            checked: 0,
        });
        let [a, b, c, d] = (outgoing.length as u32).to_le_bytes();
        let command = command_bits::BLOCK_DOWNLOAD | HAS_CRC | SIZED;
        Ok([command, low, high, sub_index, a, b, c, d])
    }

    pub(super) fn continue_block_upload(
        &mut self,
        request: &[u8; 8],
    ) -> Result<Option<[u8; 8]>, Failure> {
        let Transfer::BlockUpload(block) = &mut self.transfer else { return Err(NO_TRANSFER) };
        let [command, good, segments, ..] = *request;
        match (command & 3, block.phase) {
            (3, UploadPhase::AwaitStart) => {
                block.phase = UploadPhase::Sending;
                Ok(None)
            }
            (CONFIRM, UploadPhase::Sending | UploadPhase::AwaitConfirmation) => {
                block.confirm(good, segments).map_err(|abort| (block.at(), abort))
            }
            (END, UploadPhase::AwaitEnd) => {
                self.transfer = Transfer::None;
                Ok(None)
            }
            _ => Err((block.at(), Abort::Command)),
        }
    }
}
