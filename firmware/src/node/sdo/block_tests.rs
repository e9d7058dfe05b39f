//! Tests of transfers in blocks, with a client that loses, repeats and corrupts frames.

use super::*;
use canopen_rs::sdo::decode_abort;
use proptest::prelude::*;
use std::vec::Vec as StdVec;

const BUFFERED: Address = Address::new(0x2000, 0);
/// Taken and read in parts.
const STREAMED: Address = Address::new(0x2010, 1);
const TICK_US: u64 = 1000;

#[derive(Default)]
struct TestObjects {
    value: StdVec<u8>,
    parts: StdVec<u8>,
    longest_part: usize,
    ended: u32,
    /// Length from which a part is refused.
    refused_from: Option<usize>,
}

impl Objects for TestObjects {
    fn check_write(&mut self, at: Address, _: Option<usize>) -> Result<(), Abort> {
        if matches!(at, BUFFERED | STREAMED) { Ok(()) } else { Err(Abort::NoObject) }
    }

    fn write(&mut self, _: Address, value: &[u8]) -> Result<(), Abort> {
        self.value = value.to_vec();
        Ok(())
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        self.check_write(at, None)?;
        value.extend_from_slice(&self.value).map_err(|_| Abort::Memory)
    }

    fn takes_parts(&self, at: Address) -> bool {
        at == STREAMED
    }

    fn write_part(&mut self, _: Address, offset: usize, part: &[u8]) -> Result<(), Abort> {
        if offset == 0 {
            self.parts.clear();
        }
        assert_eq!(offset, self.parts.len(), "a gap");
        assert!((1..=MAX_PART_BYTES).contains(&part.len()));
        if self.refused_from.is_some_and(|limit| offset + part.len() > limit) {
            return Err(Abort::Hardware);
        }
        self.longest_part = self.longest_part.max(part.len());
        self.parts.extend_from_slice(part);
        Ok(())
    }

    fn end_stream(&mut self, _: Address, length: usize) -> Result<(), Abort> {
        assert_eq!(length, self.parts.len());
        self.value = self.parts.clone();
        self.ended += 1;
        Ok(())
    }

    fn stream_length(&mut self, at: Address) -> Result<Option<usize>, Abort> {
        Ok((at == STREAMED).then_some(self.value.len()))
    }

    fn read_part(&mut self, _: Address, offset: usize, part: &mut [u8]) -> Result<(), Abort> {
        part.copy_from_slice(&self.value[offset..offset + part.len()]);
        Ok(())
    }
}

/// CRC-16/XMODEM, bit by bit.
fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc: u16, _| {
            if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 }
        })
    })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Arrives,
    IsLost,
    IsRepeated,
    IsCorrupted,
}

/// A server behind a channel with faults; only segments are affected.
struct Link {
    server: SdoServer,
    objects: TestObjects,
    now_us: u64,
    fates: std::vec::IntoIter<Fate>,
    corrupted: u32,
}

impl Link {
    fn new(fates: StdVec<Fate>) -> Self {
        Self {
            server: SdoServer::new(),
            objects: TestObjects::default(),
            now_us: 0,
            fates: fates.into_iter(),
            corrupted: 0,
        }
    }

    fn request(&mut self, request: [u8; 8]) -> Option<[u8; 8]> {
        self.server.answer(&request, self.now_us, &mut self.objects)
    }

    /// Applies the fate of a segment; returns what arrives.
    fn pass(&mut self, mut segment: [u8; 8]) -> StdVec<[u8; 8]> {
        match self.fates.next().unwrap_or(Fate::Arrives) {
            Fate::Arrives => vec![segment],
            Fate::IsLost => vec![],
            Fate::IsRepeated => vec![segment, segment],
            Fate::IsCorrupted => {
                self.corrupted += 1;
                segment[1] ^= 0x10;
                vec![segment]
            }
        }
    }

    /// Waits for what the server sends by itself.
    fn wait(&mut self) -> Option<[u8; 8]> {
        for _ in 0..1100 {
            self.now_us += TICK_US;
            if let Some(frame) = self.server.tick(self.now_us, &mut self.objects) {
                return Some(frame);
            }
        }
        None
    }

    fn write(&mut self, at: Address, data: &[u8], declares: bool) -> Result<(), u32> {
        let [low, high] = at.index.to_le_bytes();
        let [a, b, c, d] = if declares { (data.len() as u32).to_le_bytes() } else { [0; 4] };
        let command = if declares { 0xC6 } else { 0xC4 };
        let answer = self.request([command, low, high, at.subindex, a, b, c, d]);
        let answer = checked(answer)?;
        assert_eq!(answer[..5], [0xA4, low, high, at.subindex, 127]);
        let mut done = 0;
        while done < data.len() {
            let mut confirmation = None;
            for (place, chunk) in data[done..].chunks(7).take(127).enumerate() {
                let mut segment = [0xEE; 8];
                let is_last = done + 7 * place + chunk.len() == data.len();
                segment[0] = (place as u8 + 1) | if is_last { 0x80 } else { 0 };
                segment[1..=chunk.len()].copy_from_slice(chunk);
                for arrived in self.pass(segment) {
                    // Only the repetition of a last segment may arrive after the confirmation.
                    let answer = self.request(arrived);
                    assert!(confirmation.is_none() || answer.is_none(), "{answer:02X?}");
                    confirmation = confirmation.or(answer);
                }
            }
            let answer = confirmation.or_else(|| self.wait());
            let answer = checked(answer)?;
            assert_eq!((answer[0], answer[2]), (0xA2, 127));
            done = (done + 7 * usize::from(answer[1])).min(data.len());
        }
        let unused = data.len().next_multiple_of(7) - data.len();
        let [low, high] = crc(data).to_le_bytes();
        let answer = self.request([0xC1 | (unused as u8) << 2, low, high, 0, 0, 0, 0, 0]);
        assert_eq!(checked(answer)?[0], 0xA1);
        Ok(())
    }

    fn read(&mut self, at: Address, segments: u8) -> Result<StdVec<u8>, u32> {
        let [low, high] = at.index.to_le_bytes();
        let answer = self.request([0xA4, low, high, at.subindex, segments, 0, 0, 0]);
        let answer = checked(answer)?;
        assert_eq!(answer[..4], [0xC6, low, high, at.subindex]);
        let length = u32::from_le_bytes(answer[4..].try_into().unwrap()) as usize;
        assert_eq!(self.request([0xA3, 0, 0, 0, 0, 0, 0, 0]), None);
        let mut data = StdVec::new();
        loop {
            let (mut good, mut is_last) = (0, false);
            while let Some(segment) = self.server.next_segment(&mut self.objects) {
                if segment[0] == 0x80 {
                    return checked(Some(segment)).map(|_| data);
                }
                for arrived in self.pass(segment) {
                    if arrived[0] & 0x7F == good + 1 {
                        good += 1;
                        is_last = arrived[0] & 0x80 != 0;
                        data.extend_from_slice(&arrived[1..]);
                    }
                }
            }
            let answer = self.request([0xA2, good, segments, 0, 0, 0, 0, 0]);
            if !is_last {
                assert_eq!(answer, None);
                continue;
            }
            let answer = checked(answer)?;
            assert_eq!(answer[0] & 0xE3, 0xC1);
            data.truncate(data.len() - usize::from(answer[0] >> 2 & 7));
            assert_eq!(data.len(), length);
            if crc(&data) != u16::from_le_bytes([answer[1], answer[2]]) {
                return Err(Abort::Crc.code());
            }
            assert_eq!(self.request([0xA1, 0, 0, 0, 0, 0, 0, 0]), None);
            return Ok(data);
        }
    }
}

/// Returns the frame, or the code of an abort.
fn checked(frame: Option<[u8; 8]>) -> Result<[u8; 8], u32> {
    let frame = frame.expect("an answer");
    match decode_abort(&frame) {
        Ok((_, code)) => Err(code),
        Err(_) => Ok(frame),
    }
}

fn counting(length: usize) -> StdVec<u8> {
    (0..length).map(|place| (place * 7 + place / 251) as u8).collect()
}

#[test]
fn image_longer_than_the_buffer_is_taken_and_read_in_parts() {
    let mut link = Link::new(vec![]);
    let image = counting(190_003);
    link.write(STREAMED, &image, true).unwrap();
    assert_eq!((link.objects.ended, link.objects.longest_part), (1, MAX_PART_BYTES));
    assert!(link.objects.value == image);
    assert!(link.read(STREAMED, 127).unwrap() == image);
    assert_eq!(link.write(BUFFERED, &image, true), Err(Abort::Memory.code()));
    assert_eq!(link.write(BUFFERED, &image, false), Err(Abort::Memory.code()));
    assert_eq!(link.read(Address::new(0x3000, 0), 127), Err(Abort::NoObject.code()));
    assert_eq!(link.read(STREAMED, 0), Err(Abort::BlockSize.code()));
    assert_eq!(link.read(STREAMED, 128), Err(Abort::BlockSize.code()));
}

#[test]
fn refused_part_ends_the_transfer_and_its_value_is_not_ended() {
    let mut link = Link::new(vec![]);
    link.objects.refused_from = Some(2000);
    assert_eq!(link.write(STREAMED, &counting(5000), true), Err(Abort::Hardware.code()));
    assert_eq!(link.objects.ended, 0);
    // Less and more than declared.
    for (sent, code) in [(30, Abort::TooShort), (40, Abort::TooLong)] {
        link.request([0xC6, 0x10, 0x20, 1, 33, 0, 0, 0]);
        let mut answer = None;
        for place in 0..sent / 7 {
            let last = if place + 1 == sent / 7 { 0x80 } else { 0 };
            answer = answer.or(link.request([(place + 1) | last, 1, 2, 3, 4, 5, 6, 7]));
        }
        if decode_abort(&answer.unwrap()).is_err() {
            let [low, high] =
                crc(&[1, 2, 3, 4, 5, 6, 7].repeat(usize::from(sent / 7))).to_le_bytes();
            answer = link.request([0xC1, low, high, 0, 0, 0, 0, 0]);
        }
        assert_eq!(checked(answer), Err(code.code()));
    }
    assert_eq!(link.objects.ended, 0);
}

#[test]
fn client_that_leaves_is_aborted_after_the_timeout() {
    let mut link = Link::new(vec![]);
    link.request([0xC4, 0x10, 0x20, 1, 0, 0, 0, 0]);
    link.request([1, 1, 2, 3, 4, 5, 6, 7]);
    // What arrived is confirmed first, then the transfer is aborted.
    assert_eq!(checked(link.wait()).unwrap()[..3], [0xA2, 1, 127]);
    assert!(link.now_us < 250_000);
    // Requests of the next client are taken for segments until then, and do not extend the transfer.
    assert_eq!(link.request([0x40, 0, 0x20, 0, 0, 0, 0, 0]), None);
    assert_eq!(checked(link.wait()).unwrap()[..3], [0xA2, 0, 127]);
    assert_eq!(checked(link.wait()), Err(Abort::TimedOut.code()));
    assert!((1_000_000..1_010_000).contains(&link.now_us), "{} us", link.now_us);
    link.objects.value = vec![1, 2, 3];
    assert!(link.request([0x40, 0, 0x20, 0, 0, 0, 0, 0]).is_some());
    // The same for a client that reads; an abort ends both without an answer.
    link.objects.value = counting(100);
    link.request([0xA4, 0x10, 0x20, 1, 127, 0, 0, 0]);
    assert_eq!(checked(link.wait()), Err(Abort::TimedOut.code()));
    for begin in [[0xA4, 0x10, 0x20, 1, 127, 0, 0, 0], [0xC4, 0x10, 0x20, 1, 0, 0, 0, 0]] {
        assert!(link.request(begin).is_some());
        assert_eq!(link.request([0x80, 0x10, 0x20, 1, 0, 0, 4, 5]), None);
        assert_eq!(link.wait(), None);
    }
}

#[test]
fn upload_within_the_threshold_switches_to_segments() {
    let mut link = Link::new(vec![]);
    link.objects.value = counting(20);
    let answer = checked(link.request([0xA4, 0, 0x20, 0, 127, 20, 0, 0])).unwrap();
    assert_eq!((answer[0], answer[4]), (0x41, 20));
    assert_eq!(checked(link.request([0x60, 0, 0, 0, 0, 0, 0, 0])).unwrap()[1..], counting(7));
    let answer = checked(link.request([0xA4, 0, 0x20, 0, 127, 19, 0, 0])).unwrap();
    assert_eq!((answer[0], answer[4]), (0xC6, 20));
    // A segment that was not sent cannot be confirmed.
    link.request([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    while link.server.next_segment(&mut link.objects).is_some() {}
    let answer = link.request([0xA2, 9, 127, 0, 0, 0, 0, 0]);
    assert_eq!(checked(answer), Err(Abort::Sequence.code()));
}

fn fates(corrupts: bool) -> impl Strategy<Value = StdVec<Fate>> {
    let fate = prop_oneof![
        20 => Just(Fate::Arrives),
        1 => Just(Fate::IsLost),
        1 => Just(Fate::IsRepeated),
        u32::from(corrupts) => Just(Fate::IsCorrupted),
    ];
    proptest::collection::vec(fate, 0..400)
}

proptest! {
    #[test]
    fn value_arrives_complete_over_a_channel_that_loses_and_repeats_segments(
        length in 1usize..4000, declares: bool, segments in 1u8..=127, fates in fates(false),
    ) {
        let data = counting(length);
        for at in [BUFFERED, STREAMED] {
            let mut link = Link::new(fates.clone());
            let outcome = link.write(at, &data, declares);
            if at == BUFFERED && length > MAX_VALUE_BYTES {
                prop_assert_eq!(outcome, Err(Abort::Memory.code()));
                continue;
            }
            // A client whose segments are all lost is aborted; the value is not written then.
            if outcome == Err(Abort::TimedOut.code()) {
                prop_assert!(link.objects.value.is_empty());
                continue;
            }
            prop_assert_eq!(outcome, Ok(()));
            prop_assert!(link.objects.value == data);
            link.fates = fates.clone().into_iter();
            prop_assert!(link.read(at, segments).unwrap() == data);
        }
    }

    #[test]
    fn corrupted_segment_is_found_by_the_crc(length in 1usize..1800, fates in fates(true)) {
        let data = counting(length);
        for at in [BUFFERED, STREAMED] {
            let mut link = Link::new(fates.clone());
            let outcome = link.write(at, &data, true);
            let is_written = outcome.is_ok();
            prop_assert_eq!(is_written, !link.objects.value.is_empty());
            if is_written {
                prop_assert!(link.objects.value == data, "a wrong value is taken");
            }
            if link.corrupted == 0 {
                prop_assert!(matches!(outcome, Ok(()) | Err(0x0504_0000)));
            }
        }
    }
}
