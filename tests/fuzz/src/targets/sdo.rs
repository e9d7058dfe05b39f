//! Fuzzes the SDO server with any requests at any time.
//!
//! The server answers every request except an abort and those of a block transfer. It writes a value completely or not
//! at all. After any input and a pause, a correct transfer succeeds.

use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, encode_data_segment, encode_download_initiate_segmented,
    encode_upload_request, encode_upload_segment_request,
};
use firmware::node::sdo::{Abort, MAX_VALUE_BYTES, Objects, SdoServer, TIMEOUT_US, ValueBuffer};

/// A dictionary: 2000h holds a value of any length, 2001h a value of four bytes, 2002h rejects every access.
#[derive(Default)]
struct TestDictionary {
    long_value: Vec<u8>,
    word: [u8; 4],
    /// Written values, in order.
    written: Vec<Vec<u8>>,
}

impl Objects for TestDictionary {
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        match (at.index, length) {
            (0x2000 | 0x2002, _) | (0x2001, None | Some(4)) => Ok(()),
            (0x2001, _) => Err(Abort::TooShort),
            _ => Err(Abort::NoObject),
        }
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        assert!(value.len() <= MAX_VALUE_BYTES);
        match at.index {
            0x2000 => self.long_value = value.to_vec(),
            0x2001 => self.word = value.try_into().map_err(|_| Abort::TooLong)?,
            _ => return Err(Abort::Value),
        }
        self.written.push(value.to_vec());
        Ok(())
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let bytes = match at.index {
            0x2000 => &self.long_value[..],
            0x2001 => &self.word[..],
            0x2002 => return Err(Abort::WriteOnly),
            _ => return Err(Abort::NoObject),
        };
        value.extend_from_slice(bytes).map_err(|_| Abort::Memory)
    }
}

/// Writes and reads back a value as a configuration tool does. Every request must succeed.
fn exchange(server: &mut SdoServer, dictionary: &mut TestDictionary, value: &[u8], now_us: u64) {
    let at = Address::new(0x2000, 0);
    let mut send = |request: &[u8; 8], dictionary: &mut TestDictionary| {
        let answer = server.answer(request, now_us, dictionary).expect("an answer");
        assert!(decode_abort(&answer).is_err(), "{request:02X?} aborted: {answer:02X?}");
        answer
    };
    send(&encode_download_initiate_segmented(at, value.len() as u32), dictionary);
    let count = value.chunks(7).count();
    for (position, chunk) in value.chunks(7).enumerate() {
        let segment = encode_data_segment(chunk, position % 2 == 1, position + 1 == count);
        send(&segment.expect("a segment holds seven bytes"), dictionary);
    }
    assert_eq!(dictionary.long_value, value);
    let first = send(&encode_upload_request(at), dictionary);
    let mut found = Vec::new();
    if first[0] & 2 != 0 {
        found.extend_from_slice(&first[4..8 - usize::from(first[0] >> 2 & 3)]);
    } else {
        assert_eq!(
            u32::from_le_bytes(first[4..].try_into().expect("four bytes")),
            value.len() as u32
        );
        let mut toggle = false;
        loop {
            let answer = send(&encode_upload_segment_request(toggle), dictionary);
            let segment = decode_data_segment(&answer).expect("a segment");
            assert_eq!(segment.toggle, toggle);
            found.extend_from_slice(segment.data);
            if segment.last {
                break;
            }
            toggle = !toggle;
        }
    }
    assert_eq!(found, value);
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let (mut server, mut dictionary, mut now_us) =
        (SdoServer::new(), TestDictionary::default(), 0u64);
    let mut may_be_in_blocks = false;
    // Nine bytes for each step: the square root of the delay in units of 100 us, and the request.
    for step in data.as_chunks::<9>().0 {
        let [delay, request @ ..] = *step;
        now_us += u64::from(delay) * u64::from(delay) * 100;
        let (writes, aborts) = (dictionary.written.len(), server.aborts());
        let before = (dictionary.long_value.clone(), dictionary.word);
        let answer = server.answer(&request, now_us, &mut dictionary);
        may_be_in_blocks |= matches!(request[0] & 0xE0, 0xA0 | 0xC0);
        if !may_be_in_blocks {
            assert_eq!(answer.is_none(), request[0] & 0xE0 == 0x80, "request {request:02X?}");
        }
        let aborted = answer.is_some_and(|answer| decode_abort(&answer).is_ok());
        assert_eq!(server.aborts() - aborts, u32::from(aborted));
        if aborted {
            assert_eq!(
                (dictionary.long_value.clone(), dictionary.word),
                before,
                "a rejected write changed a value"
            );
        }
        assert!(dictionary.written.len() - writes <= 1);
        let _ = server.tick(now_us, &mut dictionary);
        for _ in 0..delay {
            let _ = server.next_segment(&mut dictionary);
        }
    }
    // After any input and a pause, a new transfer succeeds.
    while server.next_segment(&mut dictionary).is_some() {}
    now_us += TIMEOUT_US + 1;
    let _ = server.tick(now_us, &mut dictionary);
    let value = data.get(..data.len().min(MAX_VALUE_BYTES)).filter(|value| !value.is_empty());
    exchange(&mut server, &mut dictionary, value.unwrap_or(b"a value of some length"), now_us);
}
