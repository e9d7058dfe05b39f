//! Any text as a CAN log, of whatever format it looks like: lines that are read are written and read as the same; whole logs are planned.

#![no_main]

use compensator_core::can::Node;
use joint_bus::replay::Plan;
use joint_trace::Assembler;
use joint_trace::candump::{self, CanFrame, Fraction};
use joint_trace::{Frames, TextFormat, TextReader};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let (mut assembler, mut good, mut stamps) = (Assembler::default(), 0, Vec::new());
    let mut lines = TextReader::new(TextFormat::of(data).unwrap_or_default());
    for text in data.split(|byte| *byte == b'\n') {
        let Frames::Line(line) = lines.read(text) else { continue };
        good += 1;
        stamps.push(line.time_ns);
        if let CanFrame::Data { length, .. } = line.frame {
            assert!(length <= 8);
        }
        let mut written = Vec::new();
        candump::emit(&line, Fraction::Nanoseconds, &mut written);
        let again = candump::parse(&written).expect("what is written is read");
        assert_eq!(again, line, "{}", String::from_utf8_lossy(&written));
        let mut twice = Vec::new();
        candump::emit(&again, Fraction::Nanoseconds, &mut twice);
        assert_eq!(twice, written);
        // To the joint's frame and back.
        if let Some(frame) = line.frame.to_joint() {
            assert_eq!(CanFrame::from(frame), line.frame);
        }
        if let Some(sample) = assembler.take(0, &line) {
            assert!(stamps.contains(&sample.time_ns), "a sample at a time no frame has");
        }
    }
    match Plan::parse(data, Node::FIRST) {
        Ok(plan) => {
            assert!(plan.samples >= 2 && plan.samples <= good);
            assert!(plan.frames.len() as u64 <= good);
            assert!(plan.frames.is_sorted_by_key(|planned| planned.due_ns));
            assert!(plan.recorded.is_empty() || plan.recorded.len() as u64 == plan.samples);
            assert!(plan.period_s.is_finite() && plan.period_s >= 0.0);
            assert!(plan.passed_over.bad_lines * 20 <= plan.lines);
        }
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
});
