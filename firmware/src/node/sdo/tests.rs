//! Tests of the server: transfers in one frame and in segments. Those in blocks are in `block_tests`.

use super::abort::abort_frame;
use super::*;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, decode_download_segment_response, encode_data_segment,
    encode_download_initiate_segmented, encode_download_response, encode_upload_request,
    encode_upload_segment_request,
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
    assert_eq!(server.answer(&begin, 0, objects), Some(encode_download_response(OBJECT_ADDRESS)));
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
    assert_eq!(code(server.answer(&unknown, 0, &mut objects)), Abort::NoObject.code());
    let refused = [0x23, 0x01, 0x20, 0, 0xBD, 2, 3, 4];
    assert_eq!(code(server.answer(&refused, 0, &mut objects)), Abort::Value.code());
    assert!(objects.0.is_empty());
    let too_long = encode_download_initiate_segmented(OBJECT_ADDRESS, MAX_VALUE_BYTES as u32 + 1);
    assert_eq!(code(server.answer(&too_long, 0, &mut objects)), Abort::Memory.code());
    assert_eq!(code(server.answer(&[0xE0; 8], 0, &mut objects)), Abort::Command.code());
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
    assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::Toggle.code());
    // The last segment arrives too early.
    server.answer(&begin, 0, &mut objects);
    let early = encode_data_segment(b"new one", false, true).unwrap();
    assert_eq!(code(server.answer(&early, 0, &mut objects)), Abort::TooShort.code());
    // More than was declared.
    server.answer(&encode_download_initiate_segmented(OBJECT_ADDRESS, 5), 0, &mut objects);
    assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::TooLong.code());
    // A client that pauses for too long, and one that aborts.
    server.answer(&begin, 0, &mut objects);
    let late = server.answer(&segment, TIMEOUT_US + 1, &mut objects);
    assert_eq!(code(late), Abort::Command.code());
    server.answer(&begin, 0, &mut objects);
    assert_eq!(server.answer(&abort_frame(OBJECT_ADDRESS, Abort::Refused), 0, &mut objects), None);
    assert_eq!(code(server.answer(&segment, 0, &mut objects)), Abort::Command.code());
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
    fn every_request_outside_of_blocks_but_abort_gets_an_answer(
        requests in proptest::collection::vec(any::<[u8; 8]>(), 0..200),
    ) {
        let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
        for request in requests {
            let command = request[0] & command_bits::COMMAND;
            let is_block = matches!(command, command_bits::BLOCK_DOWNLOAD | command_bits::BLOCK_UPLOAD);
            if !is_block {
                let answer = server.answer(&request, 0, &mut objects);
                prop_assert_eq!(answer.is_none(), command == command_bits::ABORT);
            }
        }
    }

    #[test]
    fn server_serves_after_any_requests_and_a_pause(
        requests in proptest::collection::vec((0u8..8, any::<u8>(), any::<[u8; 4]>()), 0..200),
    ) {
        let (mut server, mut objects) = (SdoServer::new(), TestObjects::default());
        let mut now_us = 0;
        for (command, bits, [a, b, c, d]) in requests {
            now_us += u64::from(bits) * 100;
            let request = [command << 5 | bits & 0x1F, 0x00, 0x20, 0, a, b, c, d];
            let _ = server.answer(&request, now_us, &mut objects);
            let _ = server.tick(now_us, &mut objects);
            let _ = server.next_segment(&mut objects);
        }
        // Ticks do not extend a transfer for ever.
        for _ in 0..200 {
            let _ = server.next_segment(&mut objects);
        }
        now_us += TIMEOUT_US + 1;
        let _ = server.tick(now_us, &mut objects);
        let request = encode_upload_request(Address::new(0x3000, 0));
        let answer = server.answer(&request, now_us, &mut objects);
        prop_assert_eq!(code(answer), Abort::NoObject.code());
    }
}
