use super::*;
use crate::Assembler;
use crate::frame::Direction;

fn frames<'a>(format: TextFormat, text: &'a str) -> Vec<Frames<'a>> {
    let mut reader = TextReader::new(format);
    text.lines().map(|line| reader.read(line.as_bytes())).collect()
}

/// Returns a frame with identifier 0x201 and two bytes, received at 1.234 ms on bus 1.
fn example() -> Line<'static> {
    let bytes = [0x80, 0x3F, 0, 0, 0, 0, 0, 0];
    let frame = CanFrame::Data { identifier: 0x201, extended: false, length: 2, bytes };
    let direction = Some(Direction::Received);
    Line { time_ns: 1_234_000, interface: b"1", frame, direction }
}

#[test]
fn reader_with_asc_file_returns_its_frames() {
    let text = "date Wed May 1 12:00:00.000 pm 2024\nbase hex  timestamps absolute\n\
        Begin Triggerblock Wed May 1\n   0.000000 Start of measurement\n\
        0.001234 1  201             Rx   d 2 80 3F  Length = 230000 BitCount = 120 ID = 513\n\
        0.002000 1  18FF1234x       Tx   d 0\n0.003000 1  ErrorFrame\n0.003 1 123 Rx r 8\n\
        0.004000 1  201 Rx d 2 80 zz\n0.005 CANFD 1 Rx\nEnd TriggerBlock";
    assert_eq!(TextFormat::of(text.as_bytes()), Some(TextFormat::Asc));
    let found = frames(TextFormat::Asc, text);
    assert_eq!(found[4], Frames::Line(example()));
    assert!(matches!(
        found[5],
        Frames::Line(Line {
            frame: CanFrame::Data { identifier: 0x18FF_1234, extended: true, .. },
            ..
        })
    ));
    assert!(matches!(found[6], Frames::Line(Line { frame: CanFrame::Error { .. }, .. })));
    assert!(matches!(
        found[7],
        Frames::Line(Line { frame: CanFrame::Remote { length: 8, .. }, .. })
    ));
    assert_eq!(found[8], Frames::Bad(LineError::Data));
    for other in [0, 1, 2, 3, 9, 10] {
        assert_eq!(found[other], Frames::None, "{other}");
    }
    let relative =
        "base dec timestamps relative\n0.001 1 513 Rx d 2 128 63\n0.000234 1 513 Rx d 2 128 63";
    assert_eq!(frames(TextFormat::Asc, relative)[2], Frames::Line(example()));
}

#[test]
fn reader_with_each_trc_version_returns_the_same_frame() {
    for text in [
        ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1.234 DT 1 0201 Rx - 2 80 3F",
        ";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n 1 1.234 DT 0201 Rx 2 80 3F",
        ";$FILEVERSION=1.3\n;\n 1) 1.234 1 Rx 0201 - 2 80 3F",
        ";$FILEVERSION=1.1\n;\n 1) 1.234 Rx 0201 2 80 3F",
    ] {
        assert_eq!(TextFormat::of(text.as_bytes()), Some(TextFormat::Trc));
        assert_eq!(frames(TextFormat::Trc, text)[2], Frames::Line(example()), "{text}");
    }
    let text =
        ";$FILEVERSION=1.1\n 1) 1.2 Rx 0201 8 RTR\n 2) 1.2 Warng 0 8 BUSLIGHT\n 3) 1.2 Rx 0201 2 8";
    let found = frames(TextFormat::Trc, text);
    assert!(matches!(found[1], Frames::Line(Line { frame: CanFrame::Remote { .. }, .. })));
    assert_eq!(found[2..], [Frames::None, Frames::Bad(LineError::Data)]);
}

#[test]
fn reader_of_default_view_without_stamps_returns_frames_at_zero() {
    let text = "  can0  201   [2]  80 3F\n\tcontroller-problem{}\n  can0  201   [2]  80\n";
    let of = |text: &'static str| TextReader::of(text.as_bytes());
    let mut reader = of(text);
    assert!(reader.lacks_stamps() && !of("(1.0)  can0  201   [2]  80 3F\n").lacks_stamps());
    let found: Vec<Frames> = text.lines().map(|line| reader.read(line.as_bytes())).collect();
    let line = Line { time_ns: 0, interface: b"can0", direction: None, ..example() };
    assert_eq!(found, [Frames::Line(line), Frames::None, Frames::None]);
}

#[test]
fn reader_after_writer_returns_the_same_lines() {
    for format in [TextFormat::Candump, TextFormat::Asc, TextFormat::Trc] {
        for (fraction, time_ns) in
            [(Fraction::Microseconds, 12_345_678_000), (Fraction::Nanoseconds, 12_345_678_901)]
        {
            let mut writer = TextWriter::new(format);
            let mut text = Vec::new();
            let wide = CanFrame::Data {
                identifier: 0x18FF_1234,
                extended: true,
                length: 8,
                bytes: [1, 2, 3, 4, 5, 6, 7, 255],
            };
            let lines = [
                Line { time_ns: 0, ..example() },
                Line { time_ns, ..example() },
                Line { time_ns, frame: wide, ..example() },
            ];
            lines.iter().for_each(|line| writer.emit(line, fraction, &mut text));
            writer.end(&mut text);
            assert_eq!(TextFormat::of(&text), Some(format));
            let mut reader = TextReader::new(format);
            let read = text.split(|byte| *byte == b'\n').map(|line| reader.read(line));
            let read: Vec<Line> = read
                .filter_map(|frames| match frames {
                    Frames::Line(line) => Some(line),
                    Frames::None => None,
                    Frames::Bad(error) => panic!("{error}"),
                })
                .collect();
            let plain = |line: &Line| (line.time_ns, line.frame);
            let expected: Vec<_> = lines.iter().map(plain).collect();
            assert_eq!(read.iter().map(plain).collect::<Vec<_>>(), expected, "{format:?}");
        }
    }
}

/// The frames of a joint with telemetry in CAN FD and of other nodes, as `candump -L` logs them.
const CANDUMP: &str = include_str!("../../fixtures/telemetry.log");

/// The same frames, written by `can.ASCWriter` of python-can 4.6.1.
const PYTHON_CAN: &str = include_str!("../../fixtures/telemetry.asc");

/// The same frames in the columns of PEAK's version 2.1. python-can writes no CAN FD in TRC; a check on vcan reads the
/// file with it.
const PEAK: &str = include_str!("../../fixtures/telemetry.trc");

fn lines_of(format: TextFormat, text: &str) -> Vec<Line<'_>> {
    assert_eq!(TextFormat::of(text.as_bytes()), Some(format));
    let mut reader = TextReader::new(format);
    let lines = text.lines().map(|line| reader.read(line.as_bytes()));
    let frame = |read| match read {
        Frames::Line(line) => Some(line),
        Frames::None => None,
        Frames::Bad(error) => panic!("{error}"),
    };
    lines.filter_map(frame).collect()
}

/// Returns what all formats state of a frame.
fn stated(lines: &[Line]) -> Vec<(u64, CanFrame)> {
    lines.iter().map(|line| (line.time_ns, line.frame)).collect()
}

fn written(format: TextFormat, lines: &[Line]) -> String {
    let (mut writer, mut text) = (TextWriter::new(format), Vec::new());
    lines.iter().for_each(|line| writer.emit(line, Fraction::Microseconds, &mut text));
    writer.end(&mut text);
    String::from_utf8(text).unwrap()
}

#[test]
fn reader_with_fd_frames_of_other_tools_returns_the_frames_of_candump() {
    let expected = stated(&lines_of(TextFormat::Candump, CANDUMP));
    assert_eq!(expected.len(), 13);
    let telemetry = expected.iter().filter(|(_, frame)| frame.to_telemetry().is_some());
    assert_eq!(telemetry.count(), 4);
    for (format, text) in [(TextFormat::Asc, PYTHON_CAN), (TextFormat::Trc, PEAK)] {
        assert_eq!(stated(&lines_of(format, text)), expected, "{format:?}");
    }
}

#[test]
fn assembler_with_fd_frames_in_each_format_returns_the_same_samples() {
    let samples = |format, text| {
        let mut assembler = Assembler::default();
        let lines = lines_of(format, text);
        let samples: Vec<_> = lines.iter().filter_map(|line| assembler.push(0, line)).collect();
        (samples.len(), format!("{samples:?}"))
    };
    let expected = samples(TextFormat::Candump, CANDUMP);
    assert_eq!(expected.0, 3);
    assert_eq!(samples(TextFormat::Asc, PYTHON_CAN), expected);
    assert_eq!(samples(TextFormat::Trc, PEAK), expected);
}

#[test]
fn writer_with_fd_frames_writes_the_lines_of_other_tools() {
    let frames = lines_of(TextFormat::Candump, CANDUMP);
    assert_eq!(written(TextFormat::Trc, &frames), PEAK);
    let words = |text: &str| -> Vec<String> {
        let events = text.lines().filter(|line| line.contains(" Rx "));
        events.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    };
    assert_eq!(words(&written(TextFormat::Asc, &frames)), words(PYTHON_CAN));
}

#[test]
fn reader_after_writer_of_every_kind_of_frame_returns_it() {
    let mut frames = lines_of(TextFormat::Candump, CANDUMP);
    let error = CanFrame::Error { class: 0, length: 0, bytes: [0; 8] };
    let remote = CanFrame::Remote { identifier: 0x123, extended: false, length: 3 };
    for (frame, direction) in [(error, None), (remote, Some(Direction::Sent))] {
        frames.insert(0, Line { time_ns: 0, interface: b"can0", frame, direction });
    }
    for format in [TextFormat::Asc, TextFormat::Trc] {
        let text = written(format, &frames);
        let found = lines_of(format, &text);
        let mut expected = stated(&frames);
        if format == TextFormat::Trc {
            assert_eq!(expected.remove(1).1, error);
        }
        assert_eq!(stated(&found), expected, "{format:?}");
        assert_eq!(found[0].direction, Some(Direction::Sent), "{format:?}");
    }
    // Nine bytes have no length code.
    let CanFrame::Flexible { identifier, extended, flags, bytes, .. } = example_fd() else {
        panic!()
    };
    let odd = CanFrame::Flexible { identifier, extended, flags, length: 9, bytes };
    for format in [TextFormat::Asc, TextFormat::Trc] {
        let text = written(format, &[Line { frame: odd, ..example() }]);
        assert_eq!(lines_of(format, &text)[0].frame, example_fd(), "{format:?}");
    }
}

/// Returns twelve bytes, of which the last three are 0, with a switched bit rate.
fn example_fd() -> CanFrame {
    let mut bytes = [0; 64];
    (0..9).for_each(|at| bytes[at] = at as u8 + 1);
    CanFrame::Flexible { identifier: 0x381, extended: false, flags: 1, length: 12, bytes }
}

/// Events of CANoe 9 and 15: with the name of a message, with figures after the data, and a classic frame, a remote
/// request and an error of a channel that is configured for CAN FD.
#[test]
fn reader_with_fd_events_of_canoe_returns_their_frames() {
    const DATA: &str = "01 02 03 04 05 06 07 08 09 00 00 00";
    const FIGURES: &str = "a800f6c9 46500250 4b140250 20011736 2001040d";
    let one = |base: &str, event: &str| {
        let text = format!("base {base} timestamps absolute\n0.045522 {event}\n");
        let lines = lines_of(TextFormat::Asc, &text);
        assert_eq!((lines[0].time_ns, lines[0].interface), (45_522_000, &b"62"[..]));
        lines[0].frame
    };
    for event in [
        format!(
            "CANFD  62 Rx        381  BrakeSnData_4     1 0 9 12 {DATA}  104812  132   323000 {FIGURES}"
        ),
        format!("CANFD  62 Rx        381                    1 0 9 12 {DATA}"),
        format!("CANFD  62 Tx        381                    1 0 9 12 {DATA}  0 0 0 {FIGURES}"),
    ] {
        assert_eq!(one("hex", &event), example_fd(), "{event}");
    }
    let decimal = "CANFD 62 Rx 897 1 0 9 12 1 2 3 4 5 6 7 8 9 0 0 0";
    assert_eq!(one("dec", decimal), example_fd());
    let classic = format!("CANFD 62 Rx 201 0 0 2 2 80 3f 102203 133 220000 {FIGURES}");
    assert_eq!(one("hex", &classic), example().frame);
    let remote = format!("CANFD 62 Tx 50005x 0 0 5 0 140000 73 200050 {FIGURES}");
    let expected = CanFrame::Remote { identifier: 0x50005, extended: true, length: 5 };
    assert_eq!(one("hex", &remote), expected);
    let error = "CANFD 62 Rx ErrorFrame Not Acknowledge error, dominant error flag fffe c7 31ca";
    assert!(matches!(one("hex", error), CanFrame::Error { .. }));
}

#[test]
fn reader_with_length_in_bytes_or_as_code_returns_the_same_frame() {
    for (columns, line) in [
        ("N,O,T,B,I,d,R,L,D", "1 1.234 FB 1 0381 Rx - 9 01 02 03 04 05 06 07 08 09 00 00 00"),
        ("N,O,T,I,d,l,D", "1 1.234 FB 0381 Rx 12 01 02 03 04 05 06 07 08 09 00 00 00"),
    ] {
        let text = format!(";$FILEVERSION=2.0\n;$COLUMNS={columns}\n{line}\n");
        assert_eq!(lines_of(TextFormat::Trc, &text)[0].frame, example_fd(), "{columns}");
    }
    // A classic frame with a code above 8, and lines that are no frames.
    let text = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n\
        1 1.0 DT 1 0201 Rx - 15 01 02 03 04 05 06 07 08\n\
        2 2.0 ER 1 - Rx - 5 04 00 02 00 00\n3 3.0 ST 1 - Rx - 4 00 00 00 08\n\
        4 4.0 EV 1 User-defined event for bus 1\n5 5.0 EC 1 - Rx - 2 02 02\n6 6.0 RR 1 0100 Rx - 3\n";
    let found = lines_of(TextFormat::Trc, text);
    assert!(matches!(found[0].frame, CanFrame::Data { length: 8, .. }));
    assert!(matches!(found[1].frame, CanFrame::Remote { identifier: 0x100, length: 3, .. }));
    assert_eq!(found.len(), 2);
    let old = ";$FILEVERSION=1.0\n1) 1841 0001 1 07\n2) 1842 0008 4 ERROR 00 19 08 08\n\
        3) 1843 FFFFFFFF 4 00 00 00 04 BUSLIGHT\n4) 1844 0100 3 RTR\n";
    assert_eq!(lines_of(TextFormat::Trc, old).len(), 2);
}

#[test]
fn reader_with_malformed_fd_frames_returns_what_is_malformed() {
    let in_asc = |event: &str| {
        let mut reader = TextReader::new(TextFormat::Asc);
        reader.read(b"base hex timestamps absolute");
        match reader.read(format!("0.1 CANFD 1 Rx {event}").as_bytes()) {
            Frames::Bad(error) => error,
            other => panic!("{event}: {other:?}"),
        }
    };
    let in_trc = |line: &str| {
        let mut reader = TextReader::new(TextFormat::Trc);
        reader.read(b";$FILEVERSION=2.1");
        reader.read(b";$COLUMNS=N,O,T,B,I,d,R,L,D");
        match reader.read(format!("1 1.0 {line}").as_bytes()) {
            Frames::Bad(error) => error,
            other => panic!("{line}: {other:?}"),
        }
    };
    for (event, expected) in [
        ("800 1 0 1 1 00", LineError::Identifier),
        ("20000000x 1 0 1 1 00", LineError::Identifier),
        ("xyz 1 0 1 1 00", LineError::Identifier),
        ("381 Name", LineError::Data),
        ("381 Name Second 1 0 1 1 00", LineError::Data),
        ("381 1 2 1 1 00", LineError::Data),
        ("381 1 0 g 64 00", LineError::Length),
        ("381 1 0 10 64 00", LineError::Length),
        ("381 1 0 9 9 00", LineError::Length),
        ("381 1 0 f 65 00", LineError::Length),
        ("381 1 0 f", LineError::Length),
        ("381 1 0 9 12 01 02 03", LineError::Data),
        ("381 1 0 2 2 01 1zz", LineError::Data),
        ("381 1 0 2 2 01 100", LineError::Data),
    ] {
        assert_eq!(in_asc(event), expected, "{event}");
    }
    for (line, expected) in [
        ("FB 1 0800 Rx - 1 00", LineError::Identifier),
        ("FB 1 20000000 Rx - 1 00", LineError::Identifier),
        ("FB 1 0381 Rx - 16 00", LineError::Length),
        ("FB 1 0381 Rx - x 00", LineError::Length),
        ("FB 1 0381 Rx -", LineError::Data),
        ("FB 1 0381 Rx - 9 01 02", LineError::Data),
        ("FB 1 0381 Rx - 2 01 GG", LineError::Data),
    ] {
        assert_eq!(in_trc(line), expected, "{line}");
    }
}

/// Returns the times of the frames of a candump log with these stamps, µs.
fn times_us(stamps_us: impl Iterator<Item = u64>) -> Vec<u64> {
    let line =
        |stamp: u64| format!("({:03}.{:06}) can0 080#01\n", stamp / 1_000_000, stamp % 1_000_000);
    let text: String = stamps_us.map(line).collect();
    let mut reader = TextReader::of(text.as_bytes());
    let time = |line| match reader.read(line) {
        Frames::Line(line) => line.time_ns / 1000,
        other => panic!("{other:?}"),
    };
    text.lines().map(str::as_bytes).map(time).collect()
}

#[test]
fn reader_with_stamps_since_the_frame_before_adds_them_up() {
    let found = times_us((0..60).map(|frame| if frame % 3 == 2 { 800 } else { frame % 2 }));
    assert_eq!(found[..6], [0, 1, 801, 802, 802, 1602]);
    assert!(found.is_sorted());
}

#[test]
fn reader_with_stamps_of_one_clock_keeps_them() {
    let kept: [fn(u64) -> u64; 4] = [
        |frame| 1000 * frame,
        // A clock that restarts, one that stands still, and the logs of two interfaces with clocks of their own.
        |frame| 1000 * (frame % 50),
        |_| 1000,
        |frame| 1000 * frame + 7_000_000 * (frame % 2),
    ];
    for stamp in kept {
        let stamps: Vec<u64> = (0..100).map(stamp).collect();
        assert_eq!(times_us(stamps.iter().copied()), stamps);
    }
}
