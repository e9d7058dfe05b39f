//! Any requests at any time to an SDO server: it answers, takes values whole or not at all, and is well again.

#![no_main]

use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, encode_data_segment, encode_download_initiate_segmented,
    encode_upload_request, encode_upload_segment_request,
};
use firmware::node::sdo::{Abort, LONGEST, Objects, SdoServer, Value};
use libfuzzer_sys::fuzz_target;

/// A value at 2000h of any length, one of four bytes at 2001h, one that refuses all at 2002h.
#[derive(Default)]
struct Shelf {
    any: Vec<u8>,
    word: [u8; 4],
    /// What was written, in its order.
    written: Vec<Vec<u8>>,
}

impl Objects for Shelf {
    fn may_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        match (at.index, length) {
            (0x2000 | 0x2002, _) | (0x2001, None | Some(4)) => Ok(()),
            (0x2001, _) => Err(Abort::TooShort),
            _ => Err(Abort::NoObject),
        }
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        assert!(value.len() <= LONGEST);
        match at.index {
            0x2000 => self.any = value.to_vec(),
            0x2001 => self.word = value.try_into().map_err(|_| Abort::TooLong)?,
            _ => return Err(Abort::Value),
        }
        self.written.push(value.to_vec());
        Ok(())
    }

    fn read(&mut self, at: Address, value: &mut Value) -> Result<(), Abort> {
        let bytes = match at.index {
            0x2000 => &self.any[..],
            0x2001 => &self.word[..],
            0x2002 => return Err(Abort::WriteOnly),
            _ => return Err(Abort::NoObject),
        };
        value.extend_from_slice(bytes).map_err(|_| Abort::Memory)
    }
}

/// Writes and reads as a tool does; all of it must succeed.
fn exchange(server: &mut SdoServer, shelf: &mut Shelf, value: &[u8], now_us: u64) {
    let at = Address::new(0x2000, 0);
    let mut ask = |request: &[u8; 8], shelf: &mut Shelf| {
        let answer = server.answer(request, now_us, shelf).expect("an answer");
        assert!(decode_abort(&answer).is_err(), "{request:02X?} aborted: {answer:02X?}");
        answer
    };
    ask(&encode_download_initiate_segmented(at, value.len() as u32), shelf);
    let count = value.chunks(7).count();
    for (place, chunk) in value.chunks(7).enumerate() {
        let segment = encode_data_segment(chunk, place % 2 == 1, place + 1 == count);
        ask(&segment.expect("seven bytes fit"), shelf);
    }
    assert_eq!(shelf.any, value);
    let first = ask(&encode_upload_request(at), shelf);
    let mut found = Vec::new();
    if first[0] & 2 != 0 {
        found.extend_from_slice(&first[4..8 - usize::from(first[0] >> 2 & 3)]);
    } else {
        assert_eq!(u32::from_le_bytes(first[4..].try_into().expect("four")), value.len() as u32);
        let mut toggle = false;
        loop {
            let answer = ask(&encode_upload_segment_request(toggle), shelf);
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

fuzz_target!(|data: &[u8]| {
    let (mut server, mut shelf, mut now_us) = (SdoServer::new(), Shelf::default(), 0u64);
    // Nine bytes a request: how much later, and what.
    for step in data.as_chunks::<9>().0 {
        let [later, request @ ..] = *step;
        now_us += u64::from(later) * u64::from(later) * 100;
        let (writes, aborts) = (shelf.written.len(), server.aborts());
        let before = (shelf.any.clone(), shelf.word);
        let answer = server.answer(&request, now_us, &mut shelf);
        assert_eq!(answer.is_none(), request[0] & 0xE0 == 0x80, "silent to {request:02X?}");
        let aborted = answer.is_some_and(|answer| decode_abort(&answer).is_ok());
        assert_eq!(server.aborts() - aborts, u32::from(aborted));
        if aborted {
            assert_eq!(
                (shelf.any.clone(), shelf.word),
                before,
                "a refused write changed something"
            );
        }
        assert!(shelf.written.len() - writes <= 1);
    }
    // Whatever was, a tool that begins anew is served.
    let value = data.get(..data.len().min(LONGEST)).filter(|value| !value.is_empty());
    exchange(&mut server, &mut shelf, value.unwrap_or(b"a value of some length"), now_us);
});
