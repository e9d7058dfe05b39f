//! Lines of adapters, invalid lines, and arbitrary bytes.

use super::*;
use proptest::collection::vec;
use proptest::prelude::*;
use std::vec::Vec;

fn written(header: &FrameHeader, data: &[u8]) -> Option<Vec<u8>> {
    let mut out = [0; MAX_LINE_BYTES + 1];
    emit(header, data, &mut out).map(|length| out[..length].to_vec())
}

fn header(kind: FrameKind, identifier: u32, extended: bool, length: u8) -> FrameHeader {
    FrameHeader { kind, identifier, extended, length }
}

#[test]
fn emit_and_parse_of_every_frame_kind_agree() {
    let cases: [(&[u8], FrameHeader, &[u8]); 8] = [
        (b"t2013A0B1C2\r", header(FrameKind::Data, 0x201, false, 3), &[0xA0, 0xB1, 0xC2]),
        (b"t0000\r", header(FrameKind::Data, 0, false, 0), &[]),
        (b"T1FFFFFFF1FF\r", header(FrameKind::Data, 0x1FFF_FFFF, true, 1), &[0xFF]),
        (b"r7FF8\r", header(FrameKind::Remote, 0x7FF, false, 8), &[]),
        (b"R000000010\r", header(FrameKind::Remote, 1, true, 0), &[]),
        (b"d1239000102030405060708090A0B\r", header(FrameKind::Flexible, 0x123, false, 12), &{
            let mut bytes = [0; 12];
            bytes.iter_mut().zip(0..).for_each(|(byte, at)| *byte = at);
            bytes
        }),
        (b"D000001230\r", header(FrameKind::Flexible, 0x123, true, 0), &[]),
        (b"b1231AA\r", header(FrameKind::Switched, 0x123, false, 1), &[0xAA]),
    ];
    for (text, header, data) in cases {
        assert_eq!(written(&header, data).as_deref(), Some(text));
        let Ok(SlcanLine::Frame(view)) = parse(&text[..text.len() - 1]) else {
            panic!("{text:?} is a frame")
        };
        assert_eq!((view.header(), view.stamp_ms()), (header, None));
        assert_eq!(view.bytes().collect::<Vec<u8>>(), data);
    }
    let longest = written(&header(FrameKind::Switched, 1, true, 64), &[0x5A; 64]).unwrap();
    assert_eq!(longest.len() + 4, MAX_LINE_BYTES + 1, "a stamp is not written");
}

#[test]
fn parse_accepts_time_stamps_and_lower_case() {
    let Ok(SlcanLine::Frame(view)) = parse(b"t1ff2abCD12c4") else { panic!("a frame") };
    assert_eq!(view.stamp_ms(), Some(0x12C4));
    assert_eq!(view.frame(), Frame::new(0x1FF, &[0xAB, 0xCD]));
    let Ok(SlcanLine::Frame(view)) = parse(b"r1ff2EA5F") else { panic!("a frame") };
    assert_eq!((view.stamp_ms(), view.frame()), (Some(59_999), None));
}

#[test]
fn commands_and_answers_are_parsed_and_emitted() {
    let rate = BitRate::new(6).unwrap();
    assert_eq!(rate.bits_per_second(), 500_000);
    assert_eq!((BitRate::new(9), BitRate::MEGABIT.bits_per_second()), (None, 1_000_000));
    for (text, command) in [
        (&b"O\r"[..], AdapterCommand::Open),
        (b"L\r", AdapterCommand::Listen),
        (b"C\r", AdapterCommand::Close),
        (b"S6\r", AdapterCommand::BitRate(rate)),
        (b"Y5\r", AdapterCommand::DataRate(5)),
        (b"V\r", AdapterCommand::Version),
        (b"N\r", AdapterCommand::SerialNumber),
        (b"F\r", AdapterCommand::Status),
        (b"Z0\r", AdapterCommand::Stamps(false)),
        (b"Z1\r", AdapterCommand::Stamps(true)),
    ] {
        let mut out = [0; 3];
        let length = emit_command(command, &mut out).unwrap();
        assert_eq!(&out[..length], text);
        assert_eq!(parse(&text[..length - 1]), Ok(SlcanLine::Command(command)));
        assert_eq!(emit_command(command, &mut out[..length - 1]), None, "too small");
    }
    assert_eq!(emit_command(AdapterCommand::DataRate(10), &mut [0; 3]), None, "no digit");
    assert_eq!(parse(b""), Ok(SlcanLine::Done));
    assert_eq!(parse(b"z"), Ok(SlcanLine::Sent { extended: false }));
    assert_eq!(parse(b"Z"), Ok(SlcanLine::Sent { extended: true }));
    assert_eq!(parse(b"V1013"), Ok(SlcanLine::Report { letter: b'V', text: b"1013" }));
    assert_eq!(parse(b"F00"), Ok(SlcanLine::Report { letter: b'F', text: b"00" }));
}

#[test]
fn parse_with_invalid_line_names_the_invalid_part() {
    for (line, error) in [
        (&b"x"[..], LineError::Unknown(b'x')),
        (b"t", LineError::Identifier),
        (b"t80", LineError::Identifier),
        (b"t8000", LineError::Identifier),
        (b"t12G0", LineError::Identifier),
        (b"T200000000", LineError::Identifier),
        (b"t123", LineError::Length),
        (b"t123x", LineError::Length),
        (b"t1239001122334455667788", LineError::Length),
        (b"r1239", LineError::Length),
        (b"t1231", LineError::Data),
        (b"t1231A", LineError::Data),
        (b"t1231AAB", LineError::Data),
        (b"t1231AG", LineError::Data),
        (b"t1231AA12345", LineError::Data),
        (b"t1231AA12G4", LineError::Data),
        (b"S9", LineError::Argument),
        (b"S", LineError::Argument),
        (b"Z2", LineError::Argument),
        (b"OO", LineError::Argument),
        (b"z1", LineError::Argument),
    ] {
        assert_eq!(parse(line), Err(error), "{line:?}");
        assert!(!std::format!("{error}").is_empty());
    }
}

#[test]
fn emit_with_invalid_header_returns_none() {
    assert_eq!(written(&header(FrameKind::Data, 0x800, false, 0), &[]), None);
    assert_eq!(written(&header(FrameKind::Data, 0x2000_0000, true, 0), &[]), None);
    assert_eq!(written(&header(FrameKind::Data, 1, false, 2), &[1]), None);
    assert_eq!(written(&header(FrameKind::Data, 1, false, 12), &[0; 12]), None);
    assert_eq!(written(&header(FrameKind::Remote, 1, false, 9), &[]), None);
    assert_eq!(written(&header(FrameKind::Flexible, 1, false, 9), &[0; 9]), None);
    assert!(written(&header(FrameKind::Flexible, 1, false, 12), &[0; 12]).is_some());
}

/// Parts of a text as split with a limit of sixteen bytes.
fn pieces(text: &[u8]) -> Vec<std::string::String> {
    let mut splitter = LineSplitter::<16>::new();
    let piece_text = |byte: &u8| {
        splitter.push(*byte).map(|piece| match piece {
            LinePiece::Line(line) => std::string::String::from_utf8_lossy(line).into_owned(),
            other => std::format!("{other:?}"),
        })
    };
    text.iter().filter_map(piece_text).collect()
}

#[test]
fn splitter_splits_bytes_into_lines() {
    assert_eq!(pieces(b"t1230\rO\r\r"), ["t1230", "O", ""]);
    assert_eq!(pieces(b"O\r\nC\r\n"), ["O", "C"]);
    assert_eq!(pieces(b"t12\x07z\r"), ["Refused", "z"]);
    assert_eq!(pieces(b"0123456789ABCDEF\r"), ["0123456789ABCDEF"]);
    assert_eq!(pieces(b"0123456789ABCDEF0\rO\r"), ["Overlong", "O"]);
    let mut splitter = LineSplitter::<4>::new();
    assert!(!splitter.has_partial_line());
    splitter.push(b't');
    assert!(splitter.has_partial_line());
    splitter.push(b'\r');
    assert!(!splitter.has_partial_line());
}

/// Answers of an adapter to a text, and the frames it accepts.
fn answers(adapter: &mut Adapter, text: &[u8]) -> (Vec<u8>, Vec<Frame>) {
    let (mut answers, mut frames) = (Vec::new(), Vec::new());
    for reply in text.iter().filter_map(|byte| adapter.push(*byte)) {
        answers.extend_from_slice(reply.answer);
        frames.extend(reply.frame);
    }
    (answers, frames)
}

#[test]
fn adapter_executes_commands() {
    let mut adapter = Adapter::new();
    assert_eq!(answers(&mut adapter, b"t1230\r").0, b"\x07", "closed");
    assert_eq!(answers(&mut adapter, b"\rC\rS8\rO\r").0, b"\r\x07\r\r");
    assert!(adapter.is_open());
    assert_eq!(answers(&mut adapter, b"O\rS6\r").0, b"\x07\x07", "open already");
    let (answered, frames) = answers(&mut adapter, b"t2011AB\rT000000010\rr1230\rd1230\r");
    assert_eq!(answered, b"z\rZ\rz\r\x07");
    assert_eq!(frames, [Frame::new(0x201, &[0xAB]).unwrap()]);
    assert_eq!((adapter.foreign(), adapter.refused()), (2, 5));
    assert_eq!(answers(&mut adapter, b"V\rN\rF\rZ0\rZ1\r").0, b"V1013\rN0001\rF00\r\r\x07");
    assert_eq!(answers(&mut adapter, b"C\rL\rt1230\r").0, b"\r\r\x07", "it listens");
    let overlong = [b't'; MAX_CLASSIC_LINE_BYTES + 1];
    assert_eq!(answers(&mut adapter, &overlong).0, b"");
    assert_eq!(answers(&mut adapter, b"\rF\r").0, b"\x07F00\r");
}

fn any_header() -> impl Strategy<Value = (FrameHeader, Vec<u8>)> {
    let kind = prop_oneof![
        Just(FrameKind::Data),
        Just(FrameKind::Remote),
        Just(FrameKind::Flexible),
        Just(FrameKind::Switched)
    ];
    (kind, any::<u32>(), any::<bool>(), any::<u8>(), vec(any::<u8>(), 64)).prop_map(
        |(kind, identifier, extended, code, mut data)| {
            let identifier = identifier & if extended { LAST_EXTENDED } else { LAST_STANDARD };
            let codes = if matches!(kind, FrameKind::Data | FrameKind::Remote) { 9 } else { 16 };
            let length = LENGTHS[usize::from(code % codes)];
            data.truncate(if kind == FrameKind::Remote { 0 } else { usize::from(length) });
            (header(kind, identifier, extended, length), data)
        },
    )
}

proptest! {
    #[test]
    fn parse_of_emitted_frame_restores_it((header, data) in any_header(), stamp in any::<Option<u16>>()) {
        let mut text = written(&header, &data).expect("legal");
        prop_assert_eq!(text.pop(), Some(DONE));
        if let Some(stamp) = stamp {
            text.extend_from_slice(std::format!("{stamp:04X}").as_bytes());
        }
        let Ok(SlcanLine::Frame(view)) = parse(&text) else { panic!("{text:?} is a frame") };
        prop_assert_eq!((view.header(), view.stamp_ms()), (header, stamp));
        prop_assert_eq!(view.bytes().collect::<Vec<u8>>(), data);
    }

    #[test]
    fn parse_of_emitted_joint_frame_restores_it(identifier in 0..=0x7FFu16, data in vec(any::<u8>(), 0..=8)) {
        let frame = Frame::new(identifier, &data).unwrap();
        let mut out = [0; MAX_CLASSIC_LINE_BYTES + 1];
        let length = emit_frame(&frame, &mut out).expect("fits");
        let Ok(SlcanLine::Frame(view)) = parse(&out[..length - 1]) else { panic!("a frame") };
        prop_assert_eq!(view.frame(), Some(frame));
    }

    #[test]
    fn adapter_with_arbitrary_bytes_never_panics(bytes in vec(any::<u8>(), 0..300)) {
        let _ = parse(&bytes);
        let mut adapter = Adapter::<8>::new();
        bytes.iter().for_each(|byte| { adapter.push(*byte); });
    }

    #[test]
    fn parse_with_line_like_text_round_trips(text in "[tTrRdDbBSOLCVNFZz][0-9A-Fa-f]{0,30}") {
        if let Ok(SlcanLine::Frame(view)) = parse(text.as_bytes()) {
            let data: Vec<u8> = view.bytes().collect();
            let again = written(&view.header(), &data).expect("what was read can be written");
            let plain = &text.as_bytes()[..again.len() - 1];
            prop_assert!(again[..plain.len()].eq_ignore_ascii_case(plain));
        }
    }
}
