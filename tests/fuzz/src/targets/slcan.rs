//! Arbitrary bytes on a serial line: every parsed line, written again, parses as the same line.

use compensator_core::can::slcan::{
    Adapter, LinePiece, LineSplitter, MAX_LINE_BYTES, SlcanLine, emit, emit_command, emit_frame,
    parse,
};

fn round_trip(line: &[u8]) {
    let mut out = [0; MAX_LINE_BYTES + 1];
    match parse(line) {
        Ok(SlcanLine::Frame(view)) => {
            let header = view.header();
            let data: Vec<u8> = view.bytes().collect();
            let length =
                emit(&header, &data, &mut out).expect("a frame that was read can be written");
            let text = &out[..length - 1];
            assert_eq!(out[length - 1], b'\r');
            // Equal to the input except for case and the time stamp.
            let stamp = if view.stamp_ms().is_some() { 4 } else { 0 };
            assert!(text[1..].eq_ignore_ascii_case(&line[1..line.len() - stamp]));
            assert_eq!(text[0], line[0]);
            match parse(text) {
                Ok(SlcanLine::Frame(again)) => {
                    assert_eq!(again.header(), header);
                    assert!(again.bytes().eq(data.iter().copied()));
                    assert_eq!(again.frame(), view.frame());
                }
                other => panic!("{other:?}"),
            }
            if let Some(frame) = view.frame() {
                let mut other = [0; MAX_LINE_BYTES + 1];
                assert_eq!(emit_frame(&frame, &mut other), Some(length));
                assert_eq!(out, other);
            }
            // The buffer is never exceeded.
            for room in 0..length {
                assert_eq!(emit(&header, &data, &mut out[..room]), None);
            }
        }
        Ok(SlcanLine::Command(command)) => {
            let length = emit_command(command, &mut out).expect("there is room");
            assert_eq!(parse(&out[..length - 1]), Ok(SlcanLine::Command(command)));
        }
        Ok(SlcanLine::Done) => assert!(line.is_empty()),
        Ok(SlcanLine::Sent { .. } | SlcanLine::Report { .. }) | Err(_) => {}
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let mut splitter = LineSplitter::<MAX_LINE_BYTES>::new();
    let (mut adapter, mut ends, mut replies) = (Adapter::<MAX_LINE_BYTES>::new(), 0, 0);
    for byte in data {
        ends += usize::from(matches!(byte, b'\r' | 7));
        if let Some(LinePiece::Line(line)) = splitter.push(*byte) {
            assert!(line.len() <= MAX_LINE_BYTES);
            round_trip(line);
        }
        let was_open = adapter.is_open();
        if let Some(answer) = adapter.push(*byte) {
            replies += 1;
            assert!(was_open || answer.frame.is_none(), "a frame through a closed adapter");
            assert!(!answer.answer.is_empty() || answer.frame.is_none());
        }
    }
    // Every line has exactly one answer.
    assert_eq!(replies, ends);
    data.split(|byte| *byte == b'\r').for_each(round_trip);
}
