//! Transfers in blocks of up to 127 segments (CiA 301, 7.2.4.3.9 to 7.2.4.3.17).
//!
//! The receiver of a block confirms the last segment that arrived in order, and the sender continues behind it. A lost
//! segment thus costs a part of a block. A CRC over the value ends the transfer. If the last segment of a block that is
//! read is lost, the client confirms after a pause; a driver does the same for a block that is written.

use super::{Client, SdoError, name};
use crate::bus::Bus;
use canopen_rs::Address;
use canopen_rs::sdo::decode_abort;
use std::time::Duration;

/// Maximum number of segments in a block.
const MAX_SEGMENTS: u8 = 127;
/// Bytes of data in a segment.
const SEGMENT: usize = 7;

/// Pause within a block that is read after which it is confirmed as far as it arrived. It is longer than a driver waits
/// for a busy bus, and shorter than its time-out.
const PAUSE: Duration = Duration::from_millis(300);

/// Number of blocks in a row without a segment in order after which a transfer ends.
const MAX_EMPTY_BLOCKS: u32 = 3;

/// Time limit for the confirmation of a block: the node may erase and write its flash before.
const CONFIRMATION_TIMEOUT: Duration = Duration::from_millis(3000);

/// Commands, and bits of them.
mod command {
    pub const DOWNLOAD: u8 = 0xC0;
    pub const UPLOAD: u8 = 0xA0;
    pub const HAS_CRC: u8 = 0x04;
    pub const SIZED: u8 = 0x02;
    pub const CONFIRM: u8 = 0x02;
    pub const START: u8 = 0x03;
    pub const END: u8 = 0x01;
    pub const LAST: u8 = 0x80;
    pub const ABORT: u8 = 0x80;
}

const TIMED_OUT: u32 = 0x0504_0000;
const WRONG_CRC: u32 = 0x0504_0004;

/// CRC-16/XMODEM.
fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc: u16, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
        })
    })
}

fn begin(kind: u8, at: Address, rest: [u8; 4]) -> [u8; 8] {
    let [low, high] = at.index.to_le_bytes();
    let [a, b, c, d] = rest;
    [kind, low, high, at.subindex, a, b, c, d]
}

fn is_abort(frame: &[u8; 8]) -> bool {
    frame[0] == command::ABORT
}

/// A value that arrives in blocks.
#[derive(Default)]
struct Arriving {
    value: Vec<u8>,
    is_complete: bool,
    empty_blocks: u32,
}

impl<B: Bus> Client<B> {
    /// Writes a value in blocks. `progress` receives the number of bytes that the node has confirmed.
    ///
    /// # Errors
    /// See [`SdoError`]. A node without block transfer refuses it as an unknown command.
    pub fn write_blocks(
        &mut self,
        at: Address,
        value: &[u8],
        mut progress: impl FnMut(usize),
    ) -> Result<(), SdoError> {
        let done = self.unlocked(at, |client| {
            let done = client.download_blocks(at, value, &mut progress);
            client.abort_after(at, done)
        });
        self.with_reason(done)
    }

    /// Reads a value in blocks. `progress` receives the number of bytes that arrived.
    ///
    /// # Errors
    /// See [`SdoError`]. A node without block transfer refuses it as an unknown command.
    pub fn read_blocks(
        &mut self,
        at: Address,
        mut progress: impl FnMut(usize),
    ) -> Result<Vec<u8>, SdoError> {
        let value = self.upload_blocks(at, &mut progress);
        let value = self.abort_after(at, value);
        self.with_reason(value)
    }

    fn download_blocks(
        &mut self,
        at: Address,
        value: &[u8],
        progress: &mut dyn FnMut(usize),
    ) -> Result<(), SdoError> {
        let kind = command::DOWNLOAD | command::HAS_CRC | command::SIZED;
        let answer = self.exchange(at, begin(kind, at, (value.len() as u32).to_le_bytes()))?;
        if answer[0] & !command::HAS_CRC != command::UPLOAD {
            return Err(self.protocol(at));
        }
        let (mut done, mut empty_blocks, mut segments) = (0, 0, answer[4]);
        let unused = loop {
            if !(1..=MAX_SEGMENTS).contains(&segments) {
                return Err(self.protocol(at));
            }
            let (good, next_segments) = self.download_block(at, value, done, segments)?;
            if good > segments {
                return Err(self.protocol(at));
            }
            empty_blocks = if good == 0 { empty_blocks + 1 } else { 0 };
            if empty_blocks == MAX_EMPTY_BLOCKS {
                return Err(self.silent());
            }
            segments = next_segments;
            done += usize::from(good) * SEGMENT;
            progress(done.min(value.len()));
            if done >= value.len() && good > 0 {
                break (done - value.len()) as u8;
            }
        };
        let [low, high] = crc(value).to_le_bytes();
        let kind = command::DOWNLOAD | command::END | unused << 2;
        self.send_request([kind, low, high, 0, 0, 0, 0, 0])?;
        let is_end = |frame: &[u8; 8]| frame[0] == command::UPLOAD | command::END;
        self.confirmation(at, is_end).map(drop)
    }

    /// Sends the block that starts at this byte. Returns how many segments arrived, and how many the next block has.
    fn download_block(
        &mut self,
        at: Address,
        value: &[u8],
        start: usize,
        segments: u8,
    ) -> Result<(u8, u8), SdoError> {
        let rest = value.get(start..).unwrap_or_default();
        // An empty value has one empty segment.
        let count = rest.len().div_ceil(SEGMENT).max(1);
        for place in 0..count.min(usize::from(segments)) {
            let chunk = rest.chunks(SEGMENT).nth(place).unwrap_or_default();
            let last = if place + 1 == count { command::LAST } else { 0 };
            let mut segment = [0; 8];
            segment[0] = (place as u8 + 1) | last;
            segment[1..=chunk.len()].copy_from_slice(chunk);
            self.send_request(segment)?;
        }
        let is_confirmation = |frame: &[u8; 8]| frame[0] == command::UPLOAD | command::CONFIRM;
        let [_, good, next, ..] = self.confirmation(at, is_confirmation)?;
        Ok((good, next))
    }

    /// Waits for a confirmation that the node may send late.
    fn confirmation(
        &mut self,
        at: Address,
        is_expected: impl Fn(&[u8; 8]) -> bool,
    ) -> Result<[u8; 8], SdoError> {
        let wanted = |frame: &[u8; 8]| is_abort(frame) || is_expected(frame);
        let answer = self.receive_answer(CONFIRMATION_TIMEOUT, wanted)?;
        self.refusal(at, answer.ok_or(self.silent())?)
    }

    /// Returns the frame, or the error of an abort.
    fn refusal(&self, at: Address, answer: [u8; 8]) -> Result<[u8; 8], SdoError> {
        let abort = if is_abort(&answer) { decode_abort(&answer).ok() } else { None };
        match abort {
            Some((_, code)) => {
                Err(SdoError::Refused { object: name(at), code, why: String::new() })
            }
            None => Ok(answer),
        }
    }

    fn upload_blocks(
        &mut self,
        at: Address,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Vec<u8>, SdoError> {
        let request = begin(command::UPLOAD | command::HAS_CRC, at, [MAX_SEGMENTS, 0, 0, 0]);
        let answer = self.exchange(at, request)?;
        if answer[0] & !(command::HAS_CRC | command::SIZED) != command::DOWNLOAD {
            return Err(self.protocol(at));
        }
        let has_crc = answer[0] & command::HAS_CRC != 0;
        let declared = u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]]) as usize;
        let declared = (answer[0] & command::SIZED != 0).then_some(declared);
        self.send_request([command::UPLOAD | command::START, 0, 0, 0, 0, 0, 0, 0])?;
        let mut arriving = Arriving::default();
        while !arriving.is_complete {
            let good = self.upload_block(at, &mut arriving)?;
            progress(arriving.value.len());
            if declared.is_some_and(|length| arriving.value.len() >= length + SEGMENT) {
                return Err(self.protocol(at));
            }
            let confirm = command::UPLOAD | command::CONFIRM;
            self.send_request([confirm, good, MAX_SEGMENTS, 0, 0, 0, 0, 0])?;
        }
        // The number of unused bytes stands between the bits of the command.
        let kind = command::DOWNLOAD | command::END;
        let end = self.confirmation(at, |frame| frame[0] & 0xE3 == kind)?;
        let mut value = arriving.value;
        value.truncate(value.len().saturating_sub(usize::from(end[0] >> 2 & 7)));
        if let Some(expected) = declared.filter(|length| *length != value.len()) {
            return Err(SdoError::Length { object: name(at), found: value.len(), expected });
        }
        if has_crc && crc(&value) != u16::from_le_bytes([end[1], end[2]]) {
            return Err(SdoError::Crc { object: name(at), node: self.node.number() });
        }
        self.send_request([command::UPLOAD | command::END, 0, 0, 0, 0, 0, 0, 0])?;
        Ok(value)
    }

    /// Receives a block. Returns the number of segments that arrived in order.
    fn upload_block(&mut self, at: Address, arriving: &mut Arriving) -> Result<u8, SdoError> {
        let mut good = 0;
        // All frames are segments here; 80h would have the number 0, and is an abort.
        while let Some(frame) = self.receive_answer(PAUSE, |_| true)? {
            let [head, data @ ..] = self.refusal(at, frame)?;
            let (sequence, is_last) = (head & !command::LAST, head & command::LAST != 0);
            if sequence == good + 1 {
                good = sequence;
                arriving.value.extend_from_slice(&data);
                arriving.is_complete = is_last;
            }
            // Without a segment in order, the end may be that of the previous block, repeated.
            if (is_last || sequence == MAX_SEGMENTS) && good > 0 {
                break;
            }
        }
        arriving.empty_blocks = if good == 0 { arriving.empty_blocks + 1 } else { 0 };
        if arriving.empty_blocks == MAX_EMPTY_BLOCKS { Err(self.silent()) } else { Ok(good) }
    }

    /// Reports an error that the node does not know to the node, so that it does not wait for the rest of a transfer.
    fn abort_after<T>(&mut self, at: Address, outcome: Result<T, SdoError>) -> Result<T, SdoError> {
        let code = match &outcome {
            Err(SdoError::Silent { .. } | SdoError::Protocol { .. } | SdoError::Length { .. }) => {
                TIMED_OUT
            }
            Err(SdoError::Crc { .. }) => WRONG_CRC,
            _ => return outcome,
        };
        // The first error is the one to report.
        let _ = self.send_request(begin(command::ABORT, at, code.to_le_bytes()));
        outcome
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn crc_of_check_string_is_that_of_xmodem() {
        assert_eq!(super::crc(b"123456789"), 0x31C3);
    }
}
