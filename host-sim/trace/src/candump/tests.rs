use super::*;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

fn data(identifier: u32, extended: bool, data: &[u8]) -> CanFrame {
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    CanFrame::Data { identifier, extended, length: data.len() as u8, bytes }
}

fn flexible(identifier: u32, extended: bool, flags: u8, data: &[u8]) -> CanFrame {
    let mut bytes = [0; 64];
    bytes[..data.len()].copy_from_slice(data);
    CanFrame::Flexible { identifier, extended, flags, length: data.len() as u8, bytes }
}

fn frame_of(text: &str) -> CanFrame {
    let line = format!("(1436509052.249713) vcan0 {text}");
    parse(line.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}")).frame
}

#[test]
fn parse_with_each_form_of_frame_returns_it() {
    assert_eq!(frame_of("044#2A366C2BBA"), data(0x44, false, &[0x2A, 0x36, 0x6C, 0x2B, 0xBA]));
    assert_eq!(frame_of("7ff#"), data(0x7FF, false, &[]));
    assert_eq!(frame_of("00000123#01"), data(0x123, true, &[1]));
    assert_eq!(
        frame_of("1FFFFFFF#11.22.33"),
        data(MAX_EXTENDED_IDENTIFIER, true, &[0x11, 0x22, 0x33])
    );
    let all = [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88];
    assert_eq!(frame_of("123#1122334455667788_E"), data(0x123, false, &all));
    let remote = |length| CanFrame::Remote { identifier: 0x123, extended: false, length };
    assert_eq!(frame_of("123#R"), remote(0));
    assert_eq!(frame_of("123#r4"), remote(4));
    assert_eq!(frame_of("123#R8_F"), remote(8));
    assert_eq!(frame_of("123##0"), flexible(0x123, false, 0, &[]));
    assert_eq!(frame_of("123##5AABB"), flexible(0x123, false, 5, &[0xAA, 0xBB]));
    assert_eq!(frame_of("123##3.AA.BB"), flexible(0x123, false, 3, &[0xAA, 0xBB]));
    let long: String = "5A".repeat(64);
    assert_eq!(
        frame_of(&format!("12345678##1{long}")),
        flexible(0x1234_5678, true, 1, &[0x5A; 64])
    );
    let bytes = [0, 0x0C, 0, 0, 0, 0, 0, 0];
    let error = CanFrame::Error { class: 4, length: 8, bytes };
    assert_eq!(frame_of("20000004#000C000000000000"), error);
}

#[test]
fn parse_with_stamp_interface_and_direction_returns_them() {
    let read = |line: &'static str| parse(line.as_bytes()).unwrap();
    let line = read("(1436509052.249713) vcan0 044#");
    assert_eq!((line.time_ns, line.interface), (1_436_509_052_249_713_000, &b"vcan0"[..]));
    assert_eq!(line.direction, None);
    let line = read("(1436509052.249713123)   can0 044#00 T\r\n");
    assert_eq!((line.time_ns, line.interface), (1_436_509_052_249_713_123, &b"can0"[..]));
    assert_eq!(line.direction, Some(Direction::Sent));
    let line = read("  (0.5) x 123#R1 R");
    assert_eq!((line.time_ns, line.direction), (500_000_000, Some(Direction::Received)));
}

#[test]
fn parse_of_default_view_returns_the_frame_of_the_log() {
    for (view, log) in [
        ("123   [3]  11 22 33", "123#112233"),
        ("     123   [3]  11 22 33            '.\"3'", "123#112233"),
        ("12345678   [2]  27 20   '' '", "12345678#2720"),
        ("123   [0] ", "123#"),
        ("123   {E}  11 22 33 44 55 66 77 88", "123#1122334455667788_E"),
        ("123   [2]  00010001 00100010", "123#1122"),
        ("123   [3]  33`22`11", "123#112233"),
        ("123  [08]  11 22 33 44 55 66 77 88", "123##01122334455667788"),
        ("123   [0]  remote request", "123#R"),
        ("12345678   [4]  remote request", "12345678#R4"),
        ("20000004   [8]  00 0C 00 00 00 00 00 00   ERRORFRAME", "20000004#000C000000000000"),
        ("RX - -  123   [1]  11", "123#11 R"),
        ("TX B E  123  [01]  11", "123##311 T"),
    ] {
        for stamp in ["1764497532.123456", "2025-11-30 10:12:12.123456"] {
            let line = |text: &str| format!(" ({stamp})  can0  {text}");
            let (view, log) = (line(view), line(log));
            assert_eq!(parse(view.as_bytes()), parse(log.as_bytes()), "{view}");
            assert_eq!(parse(view.as_bytes()).unwrap().time_ns, 1_764_497_532_123_456_000);
        }
        let unstamped = format!("  can0  {view}\r\n");
        let found = parse_unstamped(unstamped.as_bytes()).unwrap();
        assert_eq!((found.interface, found.frame), (&b"can0"[..], frame_of(log)), "{view}");
    }
    for (date, seconds) in [("2000-02-29 00:00:00.0", 951_782_400), ("1970-01-01 00:00:01.0", 1)] {
        let line = format!("({date}) can0 123#");
        assert_eq!(parse(line.as_bytes()).unwrap().time_ns, seconds * 1_000_000_000, "{date}");
    }
}

#[test]
fn parse_unstamped_with_other_text_returns_error() {
    for text in [
        "",
        "can0",
        "can0 123#11",
        "(1.5) can0 123 [1] 11",
        "t v [1]",
        "x 0.5 [3]  1 2 3",
        "a,b [1]",
    ] {
        assert!(parse_unstamped(text.as_bytes()).is_err(), "{text}");
    }
}

#[test]
fn parse_with_malformed_line_returns_the_malformed_part() {
    use LineError::{Data, Direction, Identifier, Interface, Length, Time};
    for (line, wrong) in [
        ("", Time),
        ("1436509052.249713 can0 123#", Time),
        ("(1436509052) can0 123#", Time),
        ("(1436509052.) can0 123#", Time),
        ("(-1.5) can0 123#", Time),
        ("(1.1234567890) can0 123#", Time),
        ("(99999999999999999999.5) can0 123#", Time),
        ("(18000000000.0) can0 123#", Time),
        ("(1.5", Time),
        ("(1.5)", Interface),
        ("(1.5)can0 123#", Interface),
        ("(1.5) can0", Identifier),
        ("(1.5) can0 1234#", Identifier),
        ("(1.5) can0 12G#", Identifier),
        ("(1.5) can0 800#", Identifier),
        ("(1.5) can0 40000000#", Identifier),
        ("(1.5) can0 123", Identifier),
        ("(1.5) can0 123#1", Data),
        ("(1.5) can0 123#1G", Data),
        ("(1.5) can0 123#112233445566778899", Data),
        ("(1.5) can0 123#11_E", Data),
        ("(1.5) can0 123#R9", Data),
        ("(1.5) can0 123##", Data),
        ("(1.5) can0 123##G11", Data),
        ("(1.5) can0 20000004#R", Data),
        ("(1.5) can0 123#11 X", Direction),
        ("(2026-13-01 10:11:12.5) can0 123#", Time),
        ("(2026-11-30 10:11:12) can0 123#", Time),
        ("(1.5) can0 1234 [1] 11", Identifier),
        ("(1.5) can0 123 [9] 11 22 33 44 55 66 77 88 99", Length),
        ("(1.5) can0 123 [65] 11", Length),
        ("(1.5) can0 20000004 [01] 11", Length),
        ("(1.5) can0 20000004 [1] remote request", Data),
        ("(1.5) can0 123 [x] 11", Length),
        ("(1.5) can0 123 [2] 11", Data),
        ("(1.5) can0 123 [1] 1G", Data),
        ("(1.5) can0 123#11 R T", Direction),
    ] {
        assert_eq!(parse(line.as_bytes()).map(|_| ()), Err(wrong), "{line}");
    }
    let long = format!("(1.5) can0 123##1{}", "5A".repeat(65));
    assert_eq!(parse(long.as_bytes()), Err(Data));
}

/// Draws a random frame of any kind.
fn any_frame(random: &mut Pcg64Mcg) -> CanFrame {
    let extended: bool = random.random();
    let last = if extended { MAX_EXTENDED_IDENTIFIER } else { MAX_STANDARD_IDENTIFIER };
    let identifier = random.random_range(0..=last);
    let bytes: [u8; 64] = random.random();
    match random.random_range(0..4) {
        0 => data(identifier, extended, &bytes[..random.random_range(0..=8)]),
        1 => CanFrame::Remote { identifier, extended, length: random.random_range(0..=8) },
        2 => {
            let (flags, length) = (random.random_range(0..16), random.random_range(0..=64));
            flexible(identifier, extended, flags, &bytes[..length])
        }
        _ => {
            let class = random.random_range(0..=MAX_EXTENDED_IDENTIFIER);
            CanFrame::Error { class, length: 8, bytes: random.random() }
        }
    }
}

#[test]
fn parse_after_emit_returns_the_same_line() {
    let mut random = Pcg64Mcg::new(1);
    let mut text = Vec::new();
    for _ in 0..20_000 {
        let time_ns = random.random_range(0..MAX_TIME_S * 1_000_000_000);
        let direction =
            [None, Some(Direction::Sent), Some(Direction::Received)][random.random_range(0..3)];
        let frame = any_frame(&mut random);
        let line = Line { time_ns, interface: b"can0", frame, direction };
        text.clear();
        emit(&line, Fraction::Nanoseconds, &mut text);
        assert_eq!(parse(&text), Ok(line));
        let line = Line { time_ns: time_ns / 1000 * 1000, ..line };
        text.clear();
        emit(&line, Fraction::Microseconds, &mut text);
        assert_eq!(parse(&text), Ok(line));
    }
}

#[test]
fn parse_with_random_damage_does_not_panic() {
    let mut random = Pcg64Mcg::new(2);
    let mut text = Vec::new();
    for _ in 0..200_000 {
        text.clear();
        emit(
            &Line {
                time_ns: random.random_range(0..1 << 60),
                interface: b"can0",
                frame: any_frame(&mut random),
                direction: None,
            },
            Fraction::Nanoseconds,
            &mut text,
        );
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..text.len());
            match random.random_range(0..3) {
                0 => text[at] = b"()#.R_ 0Fgx\xFF"[random.random_range(0..12)],
                1 => text.truncate(at.max(1)),
                _ => text.insert(at, random.random()),
            }
        }
        let _ = parse(&text);
    }
}
