//! The log of the image: frames of defmt in the buffer that a debugger reads (RTT).

use super::start::started;
use crate::common::image;
use emulated_board::chip::CORE_HZ;

/// Places in the control block of RTT, bytes: address and length of the first channel's buffer, and where it is written next.
const BUFFER: u32 = 28;
const LENGTH: u32 = 32;
const WRITE: u32 = 36;

/// Decodes a frame of rzCOBS, which is read from its end; `None` if it is damaged.
fn decode(frame: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = frame.iter().rev().copied();
    let mut decoded = Vec::new();
    while let Some(code) = bytes.next() {
        match code {
            0 => return None,
            // The bits of seven bytes: those that are zero are left out.
            0x01..=0x7F => {
                for place in (0..7).rev() {
                    let is_zero = code >> place & 1 == 1;
                    decoded.push(if is_zero { 0 } else { bytes.next()? });
                }
            }
            // A zero behind this number of bytes, and the longest run without one.
            0x80..=0xFE => {
                decoded.push(0);
                for _ in 0..(code & 0x7F) + 7 {
                    decoded.push(bytes.next()?);
                }
            }
            0xFF => {
                for _ in 0..134 {
                    decoded.push(bytes.next()?);
                }
            }
        }
    }
    decoded.reverse();
    Some(decoded)
}

/// Returns the text of a line by its number, as the table in the image's file has it.
fn text(number: u16) -> Option<&'static str> {
    let lines = image().symbols.iter().filter(|symbol| symbol.name.contains(r#""tag":"defmt_"#));
    let mut found = lines.filter(|symbol| symbol.address == u32::from(number));
    found.next().map(|symbol| symbol.name.as_str())
}

#[test]
fn log_of_the_image_begins_with_its_start() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    let block = image().find("_SEGGER_RTT").expect("a control block").address;
    let [buffer, length, write] = [BUFFER, LENGTH, WRITE].map(|at| machine.word(block + at));
    assert!(write > 0 && write <= length, "{write} of {length} bytes");
    let bytes = machine.read_memory(buffer, write as usize);
    let frames: Vec<&[u8]> =
        bytes.split(|byte| *byte == 0).filter(|part| !part.is_empty()).collect();
    let lines: Vec<&str> = frames
        .iter()
        .map(|frame| {
            let decoded = decode(frame).unwrap_or_else(|| panic!("damaged: {frame:x?}"));
            let number = u16::from_le_bytes([decoded[0], decoded[1]]);
            text(number).unwrap_or_else(|| panic!("no line {number}: {decoded:x?}"))
        })
        .collect();
    println!("measured: {} lines of the log", lines.len());
    assert!(lines.iter().any(|line| line.contains("start as node")), "{lines:?}");
}
