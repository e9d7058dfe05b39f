//! A CANopen client that reads and writes the objects of a node, over any bus.
//!
//! `canopen-rs` codes the frames. Its own client is limited to values of 64 bytes, and a parameter record is larger, so
//! the client is implemented here. Other frames that arrive while an answer is awaited are dropped. Long values travel in
//! blocks: [`Client::write_blocks`], [`Client::read_blocks`].

mod block;
mod unlock;

use crate::bus::{Bus, BusError};
use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, decode_download_response, decode_download_segment_response,
    decode_upload_initiate_segmented_response, encode_data_segment,
    encode_download_initiate_segmented, encode_upload_request, encode_upload_segment_request,
};
use compensator_core::can::{Frame, NodeId, cob_id};
use firmware::access::Key;
use firmware::node::dictionary::{Object, index};
use firmware::refusal::Explained;
use joint_trace::CanFrame;
use std::time::Duration;
use unlock::LOCKED;

pub use unlock::{KEY_VARIABLE, KeyFileError, key_of, read_key};

/// Time limit for the answer of a node.
pub const ANSWER_TIMEOUT: Duration = Duration::from_millis(1000);

/// Error of reading or writing an object; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum SdoError {
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The node did not answer.
    #[error("node {node} does not answer; check the bus and the node number")]
    Silent { node: u8 },
    /// The node refused the request.
    #[error("{object}: refused: {} (abort code {code:08X}){}", abort_words(*.code), reason(.why))]
    Refused { object: String, code: u32, why: String },
    /// The object needs the service level, and the key of the node is another one.
    #[error(
        "{object}: needs the service level, and the key of node {node} is not the one that was given{}; use --key FILE or {KEY_VARIABLE}",
        reason(.why)
    )]
    WrongKey { object: String, node: u8, why: String },
    /// The object needs the service level, and the node accepts no response for a while after a wrong one.
    #[error(
        "{object}: needs the service level, and node {node} accepts no response now, because the last one was wrong; repeat in up to 60 s"
    )]
    UnlockDelayed { object: String, node: u8 },
    /// The answer does not follow the protocol.
    #[error("{object}: the answer of node {node} violates CiA 301")]
    Protocol { object: String, node: u8 },
    /// The CRC of a block transfer is wrong.
    #[error("{object}: the value of node {node} was damaged on the bus (CRC); repeat the transfer")]
    Crc { object: String, node: u8 },
    /// The value has another length than its type.
    #[error("{object}: {found} bytes, expected {expected}")]
    Length { object: String, found: usize, expected: usize },
}

/// Returns a reason as object 2028h contains it in words; empty if it is none.
pub fn reason_in_words(bytes: &[u8]) -> String {
    Explained::parse(bytes).map(|reason| reason.to_string()).unwrap_or_default()
}

fn reason(why: &str) -> String {
    if why.is_empty() { String::new() } else { format!(": {why}") }
}

/// Returns the text of an abort code (CiA 301, table 22).
fn abort_words(code: u32) -> &'static str {
    match code {
        0x0503_0000 => "toggle bit not alternated",
        0x0504_0000 => "protocol timed out",
        0x0504_0001 => "unknown command",
        0x0504_0002 => "invalid block size",
        0x0504_0003 => "invalid sequence number",
        0x0504_0004 => "CRC error",
        0x0504_0005 => "out of memory",
        LOCKED => "locked",
        0x0601_0001 => "write only",
        0x0601_0002 => "read only",
        0x0602_0000 => "no such object",
        0x0604_0041 => "cannot be mapped to a PDO",
        0x0604_0042 => "longer than a PDO",
        0x0606_0000 => "flash write failed",
        0x0607_0012 => "too many bytes",
        0x0607_0013 => "too few bytes",
        0x0609_0011 => "no such sub-index",
        0x0609_0030 => "value out of range",
        0x0609_0031 => "value too high",
        0x0609_0032 => "value too low",
        0x0800_0020 => "not possible",
        0x0800_0022 => "not possible in this state",
        _ => "refused",
    }
}

/// A client of one node.
pub struct Client<B> {
    bus: B,
    node: NodeId,
    key: Key,
}

impl<B: Bus> Client<B> {
    /// Creates a client of this node. It unlocks a locked node with the default key.
    pub fn new(bus: B, node: NodeId) -> Self {
        Self { bus, node, key: Key::DEFAULT }
    }

    /// Unlocks a locked node with this key.
    #[must_use]
    pub fn with_key(self, key: Key) -> Self {
        Self { key, ..self }
    }

    /// Returns the bus.
    pub fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Returns the bus.
    pub fn into_bus(self) -> B {
        self.bus
    }

    /// Sends a network command (CiA 301, 7.2.8.2) to this node.
    ///
    /// # Errors
    /// Returns the error of [`Bus::send`].
    pub fn command(&mut self, command: canopen_rs::NmtCommand) -> Result<(), BusError> {
        let frame = Frame::new(0, &[command as u8, self.node.number()]).expect("a short frame");
        self.bus.send(&frame.into())
    }

    /// Reads a value.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn read(&mut self, at: Address) -> Result<Vec<u8>, SdoError> {
        let value = self.upload(at);
        self.with_reason(value)
    }

    fn upload(&mut self, at: Address) -> Result<Vec<u8>, SdoError> {
        let answer = self.exchange(at, encode_upload_request(at))?;
        if let Some(value) = expedited(&answer) {
            return Ok(value.to_vec());
        }
        let (_, length) =
            decode_upload_initiate_segmented_response(&answer).map_err(|_| self.protocol(at))?;
        let mut value = Vec::with_capacity((length as usize).min(1 << 16));
        let mut toggle = false;
        loop {
            let answer = self.exchange(at, encode_upload_segment_request(toggle))?;
            let segment = decode_data_segment(&answer).map_err(|_| self.protocol(at))?;
            if segment.toggle != toggle {
                return Err(self.protocol(at));
            }
            value.extend_from_slice(segment.data);
            if segment.last {
                break;
            }
            toggle = !toggle;
        }
        let (found, expected) = (value.len(), length as usize);
        if found != expected {
            return Err(SdoError::Length { object: name(at), found, expected });
        }
        Ok(value)
    }

    /// Writes a value. If the node refuses it because it is locked, the client unlocks it and writes again.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn write(&mut self, at: Address, value: &[u8]) -> Result<(), SdoError> {
        let done = self.unlocked(at, |client| client.download(at, value));
        self.with_reason(done)
    }

    fn download(&mut self, at: Address, value: &[u8]) -> Result<(), SdoError> {
        if (1..=4).contains(&value.len()) {
            let answer = self.exchange(at, download_request(at, value))?;
            return decode_download_response(&answer).map(|_| ()).map_err(|_| self.protocol(at));
        }
        let begin = encode_download_initiate_segmented(at, value.len() as u32);
        let answer = self.exchange(at, begin)?;
        decode_download_response(&answer).map_err(|_| self.protocol(at))?;
        let count = value.chunks(7).count().max(1);
        for place in 0..count {
            let chunk = value.chunks(7).nth(place).unwrap_or_default();
            let toggle = place % 2 == 1;
            let segment = encode_data_segment(chunk, toggle, place + 1 == count)
                .map_err(|_| self.protocol(at))?;
            let answer = self.exchange(at, segment)?;
            if decode_download_segment_response(&answer) != Ok(toggle) {
                return Err(self.protocol(at));
            }
        }
        Ok(())
    }

    /// Reads a number of up to four bytes.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn read_number(&mut self, at: Address) -> Result<u32, SdoError> {
        let value = self.read(at)?;
        let mut word = [0; 4];
        let place = word.get_mut(..value.len()).filter(|place| !place.is_empty());
        let (found, expected) = (value.len(), 4);
        let place = place.ok_or_else(|| SdoError::Length { object: name(at), found, expected })?;
        place.copy_from_slice(&value);
        Ok(u32::from_le_bytes(word))
    }

    /// Reads an `f32`.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn read_float(&mut self, at: Address) -> Result<f32, SdoError> {
        self.read_number(at).map(f32::from_bits)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn read_text(&mut self, at: Address) -> Result<String, SdoError> {
        let bytes = self.read(at)?;
        Ok(String::from_utf8_lossy(&bytes).trim_end().to_owned())
    }

    /// Reads why the node refused the last request, in words; empty if it refused none.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn read_refusal(&mut self) -> Result<String, SdoError> {
        Ok(reason_in_words(&self.read(Address::new(index::REFUSAL, 0))?))
    }

    /// Adds the reason of the node to a refusal whose code is not specific.
    fn with_reason<T>(&mut self, outcome: Result<T, SdoError>) -> Result<T, SdoError> {
        match outcome {
            Err(SdoError::Refused { object, code, .. })
                if matches!(
                    code,
                    LOCKED | 0x0606_0000 | 0x0609_0030..=0x0609_0032 | 0x0800_0020 | 0x0800_0022
                ) =>
            {
                let why = self.upload(Address::new(index::REFUSAL, 0)).unwrap_or_default();
                let why = reason_in_words(&why);
                Err(SdoError::Refused { object, code, why })
            }
            other => other,
        }
    }

    /// Sends a request and waits for its answer.
    fn exchange(&mut self, at: Address, request: [u8; 8]) -> Result<[u8; 8], SdoError> {
        let answer = self.answer_to(request)?;
        let Ok((_, code)) = decode_abort(&answer) else { return Ok(answer) };
        Err(SdoError::Refused { object: name(at), code, why: String::new() })
    }

    fn answer_to(&mut self, request: [u8; 8]) -> Result<[u8; 8], SdoError> {
        self.send_request(request)?;
        self.receive_answer(ANSWER_TIMEOUT, |data| answers(&request, data))?.ok_or(self.silent())
    }

    fn send_request(&mut self, request: [u8; 8]) -> Result<(), SdoError> {
        let identifier = cob_id::SDO_REQUEST + u16::from(self.node.number());
        let frame = Frame::new(identifier, &request).expect("an identifier of 11 bits");
        Ok(self.bus.send(&CanFrame::from(frame))?)
    }

    /// Waits for a frame of the node's server that `is_expected`. Drops all other frames.
    fn receive_answer(
        &mut self,
        timeout: Duration,
        is_expected: impl Fn(&[u8; 8]) -> bool,
    ) -> Result<Option<[u8; 8]>, SdoError> {
        let identifier = cob_id::SDO_ANSWER + u16::from(self.node.number());
        let until_ns = self.bus.now_ns().saturating_add(timeout.as_nanos() as u64);
        while let Some(received) = self.bus.receive(until_ns)? {
            let answer = received.frame.to_joint();
            let answer = answer.filter(|frame| frame.identifier() == identifier);
            let data = answer.and_then(|frame| frame.data().try_into().ok());
            if let Some(data) = data.filter(&is_expected) {
                return Ok(Some(data));
            }
        }
        Ok(None)
    }

    fn silent(&self) -> SdoError {
        SdoError::Silent { node: self.node.number() }
    }

    fn protocol(&self, at: Address) -> SdoError {
        SdoError::Protocol { object: name(at), node: self.node.number() }
    }
}

/// Returns the request that writes one to four bytes in an expedited transfer (CiA 301, 7.2.4.3.3).
pub fn download_request(at: Address, value: &[u8]) -> [u8; 8] {
    let [low, high] = at.index.to_le_bytes();
    let mut request = [0x23 | ((4 - value.len()) as u8) << 2, low, high, at.subindex, 0, 0, 0, 0];
    request[4..4 + value.len()].copy_from_slice(value);
    request
}

/// Returns the value of an upload whose answer holds it, with or without its size; `None` for a transfer in segments.
pub fn expedited(answer: &[u8; 8]) -> Option<&[u8]> {
    let unused = if answer[0] & 1 != 0 { usize::from(answer[0] >> 2 & 3) } else { 0 };
    answer.get(4..8 - unused).filter(|_| answer[0] & 0xE2 == 0x42)
}

/// Returns true if a frame can be the answer to this request, not one to another tool on the bus. The first answer of a
/// transfer names its object; the others have only their kind.
fn answers(request: &[u8; 8], answer: &[u8; 8]) -> bool {
    const KIND: u8 = 0xE0;
    let begins = matches!(request[0] & KIND, 0x20 | 0x40 | 0xA0 | 0xC0);
    if begins { request[1..4] == answer[1..4] } else { matches!(answer[0] & KIND, 0 | 0x20 | 0x80) }
}

/// Returns the name and address of an object, for example `compensator.scale (2022h:1)`.
pub fn name(at: Address) -> String {
    let address = format!("{:04X}h:{}", at.index, at.subindex);
    let Some(object) = Object::find(at.index) else { return address };
    match object.entry(at.subindex) {
        Some(_) if object.highest_sub_index() == 0 => format!("{} ({address})", object.name),
        Some(entry) => format!("{}.{} ({address})", object.name, entry.name),
        None => format!("{} ({address})", object.name),
    }
}

#[cfg(test)]
mod tests {
    use super::answers;

    #[test]
    fn answers_with_frame_for_another_request_returns_false() {
        let request = [0x40, 0x22, 0x20, 1, 0, 0, 0, 0];
        assert!(answers(&request, &[0x43, 0x22, 0x20, 1, 0, 0, 0, 0]));
        assert!(answers(&request, &[0x80, 0x22, 0x20, 1, 0, 0, 9, 6]));
        assert!(!answers(&request, &[0x43, 0x02, 0x20, 2, 0, 0, 0, 0]));
        // A segment does not name its object, but it does not begin a transfer.
        let segment = [0x60, 0, 0, 0, 0, 0, 0, 0];
        assert!(answers(&segment, &[0x00, 1, 2, 3, 4, 5, 6, 7]));
        assert!(!answers(&segment, &[0x43, 0x22, 0x20, 1, 0, 0, 0, 0]));
    }
}
