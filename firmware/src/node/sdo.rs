//! The SDO server: how a tool reads and writes the objects of a driver (CiA 301, 7.2.4).
//!
//! A value of up to four bytes travels in one frame, a longer one in segments of seven. The frames are
//! coded by `canopen-rs`; the server is ours, because it must ask the driver *before* it answers a
//! write: parameters are refused while the joint is armed, out of range, or where they do not fit
//! together, and the answer says so. One transfer at a time; one that is begun anew, or that rests for
//! [`TIMEOUT_US`], ends the one before. Block transfer is not offered, as CiA 301 allows.

use canopen_rs::Address;
use canopen_rs::sdo::{
    SdoAbortCode, decode_data_segment, encode_abort, encode_data_segment, encode_download_response,
    encode_download_segment_response, encode_upload_initiate_segmented_response,
};
use heapless::Vec;

/// Longest value, bytes: the record of a network.
pub const LONGEST: usize = compensator_core::network::record::LENGTH;
const _: () = assert!(compensator_core::record::LENGTH <= LONGEST);

/// A transfer that rests this long is over, us.
pub const TIMEOUT_US: u64 = 1_000_000;

/// Bytes of data in a segment.
const SEGMENT: usize = 7;

/// Bits of the command byte (CiA 301, 7.2.4.3).
mod bit {
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

/// Why a transfer ends without success: the abort codes of CiA 301 this driver gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// A segment came twice or one is missing.
    Toggle = 0x0503_0000,
    /// Not a request that fits here.
    Command = 0x0504_0001,
    /// The value is longer than the driver can hold.
    Memory = 0x0504_0005,
    /// The object can only be written.
    WriteOnly = 0x0601_0001,
    /// The object can only be read.
    ReadOnly = 0x0601_0002,
    /// There is no such object.
    NoObject = 0x0602_0000,
    /// The flash would not take it.
    Hardware = 0x0606_0000,
    /// The value has too many bytes.
    TooLong = 0x0607_0012,
    /// The value has too few bytes.
    TooShort = 0x0607_0013,
    /// There is no such sub-index.
    NoSubIndex = 0x0609_0011,
    /// Out of range, or refused with others: the refusal object says which and why.
    Value = 0x0609_0030,
    /// Above its range.
    TooHigh = 0x0609_0031,
    /// Below its range.
    TooLow = 0x0609_0032,
    /// The request is understood and not granted.
    Refused = 0x0800_0020,
    /// Not while the joint is armed.
    State = 0x0800_0022,
}

/// A value on its way.
pub type Value = Vec<u8, LONGEST>;

/// The driver's objects, as the server sees them.
pub trait Objects {
    /// Whether the object can be written and how long its value is; asked before any data is taken.
    ///
    /// # Errors
    /// Why it cannot be written.
    fn may_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort>;

    /// Writes a value, little-endian.
    ///
    /// # Errors
    /// Why it is refused; nothing is changed then.
    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort>;

    /// Reads a value, little-endian.
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read(&mut self, at: Address, value: &mut Value) -> Result<(), Abort>;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    None,
    /// To the driver: what is here so far is in the buffer.
    Download {
        at: Address,
        declared: Option<usize>,
        toggle: bool,
    },
    /// From the driver: so many bytes of the buffer are sent.
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
    value: Value,
    last_us: u64,
    aborts: u32,
}

impl Default for SdoServer {
    fn default() -> Self {
        Self::new()
    }
}

impl SdoServer {
    /// No transfer yet.
    pub const fn new() -> Self {
        Self { transfer: Transfer::None, value: Vec::new(), last_us: 0, aborts: 0 }
    }

    /// How many transfers were refused or broken off by the driver.
    pub const fn aborts(&self) -> u32 {
        self.aborts
    }

    /// Answers a request; nothing is said to a client that breaks off.
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
        let outcome = match command & bit::COMMAND {
            bit::DOWNLOAD => self.begin_download(at, request, objects).map_err(|abort| (at, abort)),
            bit::UPLOAD => self.begin_upload(at, objects).map_err(|abort| (at, abort)),
            bit::DOWNLOAD_SEGMENT => self.download_segment(request, objects),
            bit::UPLOAD_SEGMENT => self.upload_segment(command & bit::TOGGLE != 0),
            bit::ABORT => {
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
        let sized = command & bit::SIZED != 0;
        if command & bit::EXPEDITED != 0 {
            let unused = if sized { usize::from(command >> 2 & 3) } else { 0 };
            let length = data.len() - unused;
            objects.may_write(at, sized.then_some(length))?;
            objects.write(at, data.get(..length).unwrap_or_default())?;
        } else {
            let declared = sized.then_some(u32::from_le_bytes(data) as usize);
            if declared.is_some_and(|length| length > LONGEST) {
                return Err(Abort::Memory);
            }
            objects.may_write(at, declared)?;
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
            let command = bit::UPLOAD | unused << 2 | bit::EXPEDITED | bit::SIZED;
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

/// The frame that breaks a transfer off. `canopen-rs` knows fewer codes, so the code is put in here.
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

    /// One object of any length at 2000h, one that refuses what begins with 0xBD at 2001h.
    #[derive(Default)]
    struct Shelf(std::vec::Vec<u8>);

    impl Objects for Shelf {
        fn may_write(&mut self, at: Address, _: Option<usize>) -> Result<(), Abort> {
            if matches!(at.index, 0x2000 | 0x2001) { Ok(()) } else { Err(Abort::NoObject) }
        }
        fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
            if at.index == 0x2001 && value.first() == Some(&0xBD) {
                return Err(Abort::Value);
            }
            self.0 = value.to_vec();
            Ok(())
        }
        fn read(&mut self, at: Address, value: &mut Value) -> Result<(), Abort> {
            self.may_write(at, None)?;
            value.extend_from_slice(&self.0).map_err(|_| Abort::Memory)
        }
    }

    const AT: Address = Address::new(0x2000, 0);

    fn code(answer: Option<[u8; 8]>) -> u32 {
        decode_abort(&answer.unwrap()).unwrap().1
    }

    fn download(server: &mut SdoServer, shelf: &mut Shelf, data: &[u8]) {
        let begin = encode_download_initiate_segmented(AT, data.len() as u32);
        assert_eq!(server.answer(&begin, 0, shelf), Some(encode_download_response(AT)));
        let count = data.chunks(7).count();
        for (index, chunk) in data.chunks(7).enumerate() {
            let toggle = index % 2 == 1;
            let segment = encode_data_segment(chunk, toggle, index + 1 == count).unwrap();
            let answer = server.answer(&segment, 0, shelf).unwrap();
            assert_eq!(decode_download_segment_response(&answer), Ok(toggle));
        }
    }

    fn upload(server: &mut SdoServer, shelf: &mut Shelf) -> std::vec::Vec<u8> {
        let first = server.answer(&encode_upload_request(AT), 0, shelf).unwrap();
        if first[0] & bit::EXPEDITED != 0 {
            return first[4..8 - usize::from(first[0] >> 2 & 3)].to_vec();
        }
        let mut data = std::vec::Vec::new();
        let mut toggle = false;
        loop {
            let answer = server.answer(&encode_upload_segment_request(toggle), 0, shelf).unwrap();
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
    fn what_is_refused_is_refused_before_or_after_its_data() {
        let (mut server, mut shelf) = (SdoServer::new(), Shelf::default());
        let unknown = [0x23, 0x34, 0x12, 0, 1, 2, 3, 4];
        assert_eq!(code(server.answer(&unknown, 0, &mut shelf)), Abort::NoObject as u32);
        let refused = [0x23, 0x01, 0x20, 0, 0xBD, 2, 3, 4];
        assert_eq!(code(server.answer(&refused, 0, &mut shelf)), Abort::Value as u32);
        assert!(shelf.0.is_empty());
        let too_long = encode_download_initiate_segmented(AT, LONGEST as u32 + 1);
        assert_eq!(code(server.answer(&too_long, 0, &mut shelf)), Abort::Memory as u32);
        assert_eq!(code(server.answer(&[0xC0; 8], 0, &mut shelf)), Abort::Command as u32);
        assert_eq!(server.aborts(), 4);
    }

    #[test]
    fn a_broken_transfer_leaves_the_old_value() {
        let (mut server, mut shelf) = (SdoServer::new(), Shelf::default());
        download(&mut server, &mut shelf, b"the value before");
        let begin = encode_download_initiate_segmented(AT, 20);
        server.answer(&begin, 0, &mut shelf);
        let segment = encode_data_segment(b"new one", false, false).unwrap();
        server.answer(&segment, 0, &mut shelf);
        // The same segment again.
        assert_eq!(code(server.answer(&segment, 0, &mut shelf)), Abort::Toggle as u32);
        // A last segment too early.
        server.answer(&begin, 0, &mut shelf);
        let early = encode_data_segment(b"new one", false, true).unwrap();
        assert_eq!(code(server.answer(&early, 0, &mut shelf)), Abort::TooShort as u32);
        // More than was declared.
        server.answer(&encode_download_initiate_segmented(AT, 5), 0, &mut shelf);
        assert_eq!(code(server.answer(&segment, 0, &mut shelf)), Abort::TooLong as u32);
        // A client that fell silent for too long, and one that breaks off.
        server.answer(&begin, 0, &mut shelf);
        let late = server.answer(&segment, TIMEOUT_US + 1, &mut shelf);
        assert_eq!(code(late), Abort::Command as u32);
        server.answer(&begin, 0, &mut shelf);
        assert_eq!(server.answer(&abort_frame(AT, Abort::Refused), 0, &mut shelf), None);
        assert_eq!(code(server.answer(&segment, 0, &mut shelf)), Abort::Command as u32);
        assert_eq!(upload(&mut server, &mut shelf), b"the value before");
    }

    proptest! {
        #[test]
        fn every_length_goes_in_and_comes_out(
            data in proptest::collection::vec(any::<u8>(), 1..=LONGEST),
        ) {
            let (mut server, mut shelf) = (SdoServer::new(), Shelf::default());
            download(&mut server, &mut shelf, &data);
            prop_assert_eq!(upload(&mut server, &mut shelf), data);
        }

        #[test]
        fn garbage_is_answered_or_passed_over(
            requests in proptest::collection::vec(any::<[u8; 8]>(), 0..200),
        ) {
            let (mut server, mut shelf) = (SdoServer::new(), Shelf::default());
            for request in requests {
                let answer = server.answer(&request, 0, &mut shelf);
                prop_assert_eq!(answer.is_none(), request[0] & bit::COMMAND == bit::ABORT);
            }
        }
    }
}
