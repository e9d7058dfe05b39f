//! Fuzzes the readers of CAN logs with any text.
//!
//! The format is detected from the text. Every line that is read must survive writing and reading again, in each format
//! that can state it, and the replay plan of the whole log must be consistent.

use compensator_core::can::NodeId;
use compensator_core::can::fd::LENGTHS;
use joint_bus::replay::Plan;
use joint_trace::Assembler;
use joint_trace::{
    CanFrame, Direction, Fraction, Frames, Line, TextFormat, TextReader, TextWriter, candump,
};

/// Checks that the line survives in a format that states no names of interfaces.
fn check_format(format: TextFormat, line: &Line) {
    let mut expected = *line;
    match &mut expected.frame {
        // Without its class and details in ASC, and left out of TRC.
        CanFrame::Error { .. } => return,
        // Two flags are stated, and only lengths that have a code.
        CanFrame::Flexible { flags, length, .. } => {
            *flags &= 3;
            if !LENGTHS.contains(length) {
                return;
            }
        }
        CanFrame::Data { .. } | CanFrame::Remote { .. } => {}
    }
    expected.interface = b"1";
    expected.direction = Some(line.direction.unwrap_or(Direction::Received));
    let mut text = Vec::new();
    TextWriter::new(format).emit(&expected, Fraction::Nanoseconds, &mut text);
    let mut lines = TextReader::new(format);
    let read = text
        .split(|byte| *byte == b'\n')
        .map(|text| lines.read(text))
        .find(|of| *of != Frames::None);
    assert_eq!(read, Some(Frames::Line(expected)), "{}", String::from_utf8_lossy(&text));
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let (mut assembler, mut valid_lines, mut times_ns) = (Assembler::default(), 0, Vec::new());
    // A CAN FD frame of telemetry stands for several frames of a joint.
    let mut joint_frames = 0;
    let mut lines = TextReader::of(data);
    for text in data.split(|byte| *byte == b'\n') {
        let Frames::Line(line) = lines.read(text) else { continue };
        valid_lines += 1;
        joint_frames += line.frame.to_telemetry().map_or(1, |telemetry| telemetry.frames().count());
        times_ns.push(line.time_ns);
        if let CanFrame::Data { length, .. } = line.frame {
            assert!(length <= 8);
        }
        let mut written = Vec::new();
        candump::emit(&line, Fraction::Nanoseconds, &mut written);
        let again = candump::parse(&written).expect("a written line is read");
        assert_eq!(again, line, "{}", String::from_utf8_lossy(&written));
        let mut rewritten = Vec::new();
        candump::emit(&again, Fraction::Nanoseconds, &mut rewritten);
        assert_eq!(rewritten, written);
        for format in [TextFormat::Asc, TextFormat::Trc] {
            check_format(format, &line);
        }
        // The conversion to a joint's frame is reversible.
        if let Some(frame) = line.frame.to_joint() {
            assert_eq!(CanFrame::from(frame), line.frame);
        }
        if let Some(sample) = assembler.push(0, &line) {
            assert!(times_ns.contains(&sample.time_ns), "no frame has the time of the sample");
        }
    }
    match Plan::parse(data, NodeId::FIRST) {
        Ok(plan) => {
            assert!(plan.samples >= 2 && plan.samples <= valid_lines);
            assert!(plan.frames.len() <= joint_frames);
            assert!(plan.frames.is_sorted_by_key(|planned| planned.due_ns));
            assert!(plan.recorded.is_empty() || plan.recorded.len() as u64 == plan.samples);
            assert!(plan.period_s.is_finite() && plan.period_s >= 0.0);
            assert!(plan.skipped.bad_lines * 20 <= plan.lines);
        }
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
}
