//! The SDO server: tools read and write the objects of a driver through it (CiA 301, 7.2.4).
//!
//! A value of up to four bytes travels in one frame, a longer one in segments of seven bytes. `canopen-rs`
//! codes the frames. The server is our own, because it must ask the driver *before* it confirms a write:
//! the driver refuses parameters while the joint is armed, out of range, or inconsistent with others, and
//! the answer must contain that. One transfer is active at a time. A new request, or a pause of
//! [`TIMEOUT_US`], ends the previous one. Block transfer is not supported, which CiA 301 allows.

use canopen_rs::Address;
use canopen_rs::sdo::{
    SdoAbortCode, decode_data_segment, encode_abort, encode_data_segment, encode_download_response,
    encode_download_segment_response, encode_upload_initiate_segmented_response,
};
use heapless::Vec;

/// Maximum length of a value, bytes: a network's record.
pub const MAX_VALUE_BYTES: usize = compensator_core::network::record::LENGTH;
const _: () = assert!(compensator_core::record::LENGTH <= MAX_VALUE_BYTES);

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
    pub const EXPEDITED: u8 = 0x02;
    pub const SIZED: u8 = 0x01;
    pub const TOGGLE: u8 = 0x10;
}

/// Reasons to abort a transfer: the abort codes of CiA 301 that this driver uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// A segment is repeated or missing.
    Toggle = 0x0503_0000,
    /// The request is unknown or does not fit the transfer.
    Command = 0x0504_0001,
    /// The value exceeds the driver's buffer.
    Memory = 0x0504_0005,
    /// The object can only be written.
    WriteOnly = 0x0601_0001,
    /// The object can only be read.
    ReadOnly = 0x0601_0002,
    /// The object does not exist.
    NoObject = 0x0602_0000,
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

/// Buffer for one value.
pub type ValueBuffer = Vec<u8, MAX_VALUE_BYTES>;

/// Access of the server to the driver's objects.
pub trait Objects {
    /// Checks that the object can be written with this length. The server calls it before it accepts data.
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
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    None,
    /// To the driver. The buffer holds the data received so far.
    Download {
        at: Address,
        declared: Option<usize>,
        toggle: bool,
    },
    /// From the driver. `sent` bytes of the buffer are sent.
    Upload {
        at: Address,
        sent: usize,
        toggle: bool,
    },
}

/// The server of one driver.
#[derive(Debug)]
pub struct SdoServer {
    transfer: Transfer,
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

    /// Answers a request. An abort by the client has no answer.
    pub fn answer(
        &mut self,
        request: &[u8; 8],
        now_us: u64,
        objects: &mut impl Objects,
    ) -> Option<[u8; 8]> {
        if now_us.saturating_sub(self.last_us) > TIMEOUT_US {
            self.transfer = Transfer::None;
        }
        self.last_us = now_us;
        let [command, low, high, sub_index, ..] = *request;
        let at = Address::new(u16::from_le_bytes([low, high]), sub_index);
        let outcome = match command & command_bits::COMMAND {
            command_bits::DOWNLOAD => {
                self.begin_download(at, request, objects).map_err(|abort| (at, abort))
            }
            command_bits::UPLOAD => self.begin_upload(at, objects).map_err(|abort| (at, abort)),
            command_bits::DOWNLOAD_SEGMENT => self.download_segment(request, objects),
            command_bits::UPLOAD_SEGMENT => {
                self.upload_segment(command & command_bits::TOGGLE != 0)
            }
            command_bits::ABORT => {
                self.transfer = Transfer::None;
                return None;
            }
            _ => Err((at, Abort::Command)),
        };
        Some(outcome.unwrap_or_else(|(at, abort)| {
            self.transfer = Transfer::None;
            self.aborts = self.aborts.saturating_add(1);
            abort_frame(at, abort)
        }))
    }

    fn begin_download(
        &mut self,
        at: Address,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        let [command, _, _, _, data @ ..] = *request;
        let sized = command & command_bits::SIZED != 0;
        if command & command_bits::EXPEDITED != 0 {
            let unused = if sized { usize::from(command >> 2 & 3) } else { 0 };
            let length = data.len() - unused;
            objects.check_write(at, sized.then_some(length))?;
            objects.write(at, data.get(..length).unwrap_or_default())?;
        } else {
            let declared = sized.then_some(u32::from_le_bytes(data) as usize);
            if declared.is_some_and(|length| length > MAX_VALUE_BYTES) {
                return Err(Abort::Memory);
            }
            objects.check_write(at, declared)?;
            self.value.clear();
            self.transfer = Transfer::Download { at, declared, toggle: false };
        }
        Ok(encode_download_response(at))
    }

    fn download_segment(
        &mut self,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], (Address, Abort)> {
        let Transfer::Download { at, declared, toggle } = self.transfer else {
            return Err((Address::new(0, 0), Abort::Command));
        };
        let fail = |abort| (at, abort);
        let segment = decode_data_segment(request).map_err(|_| fail(Abort::Command))?;
        if segment.toggle != toggle {
            return Err(fail(Abort::Toggle));
        }
        self.value.extend_from_slice(segment.data).map_err(|_| fail(Abort::Memory))?;
        if declared.is_some_and(|length| self.value.len() > length) {
            return Err(fail(Abort::TooLong));
        }
        self.transfer = Transfer::Download { at, declared, toggle: !toggle };
        if segment.last {
            self.transfer = Transfer::None;
            if declared.is_some_and(|length| self.value.len() < length) {
                return Err(fail(Abort::TooShort));
            }
            objects.write(at, &self.value).map_err(fail)?;
        }
        Ok(encode_download_segment_response(toggle))
    }

    fn begin_upload(&mut self, at: Address, objects: &mut impl Objects) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        self.value.clear();
        objects.read(at, &mut self.value)?;
        if (1..=4).contains(&self.value.len()) {
            let unused = (4 - self.value.len()) as u8;
            let mut answer = [0; 8];
            let [low, high] = at.index.to_le_bytes();
            let command =
                command_bits::UPLOAD | unused << 2 | command_bits::EXPEDITED | command_bits::SIZED;
            let head = [command, low, high, at.subindex];
            for (place, byte) in answer.iter_mut().zip(head.iter().chain(&self.value)) {
                *place = *byte;
            }
            return Ok(answer);
        }
        self.transfer = Transfer::Upload { at, sent: 0, toggle: false };
        Ok(encode_upload_initiate_segmented_response(at, self.value.len() as u32))
    }

    fn upload_segment(&mut self, asked: bool) -> Result<[u8; 8], (Address, Abort)> {
        let Transfer::Upload { at, sent, toggle } = self.transfer else {
            return Err((Address::new(0, 0), Abort::Command));
        };
        if asked != toggle {
            return Err((at, Abort::Toggle));
        }
        let end = (sent + SEGMENT).min(self.value.len());
        let last = end == self.value.len();
        let data = self.value.get(sent..end).unwrap_or_default();
        let answer = encode_data_segment(data, toggle, last).map_err(|_| (at, Abort::Command))?;
        self.transfer =
            if last { Transfer::None } else { Transfer::Upload { at, sent: end, toggle: !toggle } };
        Ok(answer)
    }
}

/// Returns the frame that aborts a transfer. `canopen-rs` has fewer abort codes, so the code is inserted
/// here.
fn abort_frame(at: Address, abort: Abort) -> [u8; 8] {
    let [a, b, c, d, ..] = encode_abort(at, SdoAbortCode::General);
    let [e, f, g, h] = (abort as u32).to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen_rs::sdo::{
        decode_abort, decode_download_segment_response, encode_data_segment,
        encode_download_initiate_segmented, encode_upload_request, encode_upload_segment_request,
    };
    use proptest::prelude::*;

    /// One object of any length at 2000h, and one at 2001h that refuses values that begin with 0xBD.
    #[derive(Default)]
    struct TestObjects(std::vec::Vec<u8>);

    impl Objects for TestObjects {
        fn check_write(&mut self, at: Address, _: Option<usize>) -> Result<(), Abort> {
            if matches!(at.index, 0x2000 | 0x2001) { Ok(()) } else { Err(Abort::NoObject) }
        }
        fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
            if at.index == 0x2001 && value.first() == Some(&0xBD) {
                return Err(Abort::Value);
            }
            self.0 = value.to_vec();
            Ok(())
        }
        fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
            self.check_write(at, None)?;
            value.extend_from_slice(&self.0).map_err(|_| Abort::Memory)
        }
    }

    const OBJECT_ADDRESS: Address = Address::new(0x2000, 0);

    fn code(answer: Option<[u8; 8]>) -> u32 {
        decode_abort(&answer.unwrap()).unwrap().1
    }

    fn download(server: &mut SdoServer, objects: &mut TestObjects, data: &[u8]) {
        let begin = encode_download_initiate_segmented(OBJECT_ADDRESS, data.len() as u32);
        assert_eq!(
            server.answer(&begin, 0, objects),
            Some(encode_download_response(OBJECT_ADDRESS))
        );
        let count = data.chunks(7).count();
        for (index, chunk) in data.chunks(7).enumerate() {
            let toggle = index % 2 == 1;
            let segment = encode_data_segment(chunk, toggle, index + 1 == count).unwrap();
            let answer = server.answer(&segment, 0, objects).unwrap();
            assert_eq!(decode_download_segment_response(&answer), Ok(toggle));
        }
    }

    fn upload(server: &mut SdoServer, objects: &mut TestObjects) -> std::vec::Vec<u8> {
        let first = server.answer(&encode_upload_request(OBJECT_ADDRESS), 0, objects).unwrap();
        if first[0] & command_bits::EXPEDITED != 0 {
            return first[4..8 - usize::from(first[0] >> 2 & 3)].to_vec();
        }
        let mut data = std::vec::Vec::new();
        let mut toggle = false;
        loop {
            let answer = server.answer(&encode_upload_segment_request(toggle), 0, objects).unwrap();
            let segment = decode_data_segment(&answer).unwrap();
            assert_eq!(segment.toggle, toggle);
            data.extend_from_slice(segment.data);
            if segment.last {
                return data;
            }
            toggle = !toggle;
        }
    }

    #[test]
    fn refused_write_is_aborted_before_or_after_its_data() {
        let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
        let unknown = [0x23, 0x34, 0x12, 0, 1, 2, 3, 4];
        assert_eq!(code(server.answer(&unknown, 0, &mut objects)), Abort::NoObject as u32);
        let refused = [0x23, 0x01, 0x20, 0, 0xBD, 2, 3, 4];
        assert_eq!(code(server.answer(&refused, 0, &mut objects)), Abort::Value as u32);
        assert!(objects.0.is_empty());
        let too_long =
            encode_download_initiate_segmented(OBJECT_ADDRESS, MAX_VALUE_BYTES as u32 + 1);
        assert_eq!(code(server.answer(&too_long, 0, &mut objects)), Abort::Memory as u32);
        assert_eq!(code(server.answer(&[0xC0; 8], 0, &mut objects)), Abort::Command as u32);
        assert_eq!(server.aborts(), 4);
    }

    #[test]
    fn interrupted_download_keeps_the_previous_value() {
        let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
        download(&mut server, &mut objects, b"the value before");
        let begin = encode_download_initiate_segmented(OBJECT_ADDRESS, 20);
        server.answer(&begin, 0, &mut objects);
        let segment = encode_data_segment(b"new one", false, false).unwrap();
        server.answer(&segment, 0, &mut objects);
        // The same segment is repeated.
        assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::Toggle as u32);
        // The last segment arrives too early.
        server.answer(&begin, 0, &mut objects);
        let early = encode_data_segment(b"new one", false, true).unwrap();
        assert_eq!(code(server.answer(&early, 0, &mut objects)), Abort::TooShort as u32);
        // More than was declared.
        server.answer(&encode_download_initiate_segmented(OBJECT_ADDRESS, 5), 0, &mut objects);
        assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::TooLong as u32);
        // A client that pauses for too long, and one that aborts.
        server.answer(&begin, 0, &mut objects);
        let late = server.answer(&segment, TIMEOUT_US + 1, &mut objects);
        assert_eq!(code(late), Abort::Command as u32);
        server.answer(&begin, 0, &mut objects);
        assert_eq!(
            server.answer(&abort_frame(OBJECT_ADDRESS, Abort::Refused), 0, &mut objects),
            None
        );
        assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::Command as u32);
        assert_eq!(upload(&mut server, &mut objects), b"the value before");
    }

    proptest! {
        #[test]
        fn download_then_upload_returns_values_of_every_length(
            data in proptest::collection::vec(any::<u8>(), 1..=MAX_VALUE_BYTES),
        ) {
            let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
            download(&mut server, &mut objects, &data);
            prop_assert_eq!(upload(&mut server, &mut objects), data);
        }

        #[test]
        fn every_request_but_abort_gets_an_answer(
            requests in proptest::collection::vec(any::<[u8; 8]>(), 0..200),
        ) {
            let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
            for request in requests {
                let answer = server.answer(&request, 0, &mut objects);
                prop_assert_eq!(answer.is_none(), request[0] & command_bits::COMMAND == command_bits::ABORT);
            }
        }
    }
}
