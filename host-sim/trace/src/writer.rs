//! Samples as the lines of a CAN log.
//!
//! A sample becomes the frames a driver would have been told it by, all with the sample's time as their
//! stamp: RPDOs for what is measured, then the SYNC, then the driver's answer where there is one. A run
//! begins with its number.

use crate::candump::{CanFrame, Fraction, Line};
use crate::samples::TraceSample;
use crate::text::{TextFormat, TextWriter};
use compensator_core::can::{Entry, Message, Node, Sync};
use std::io::{self, Write};

/// Writes the frames of one joint.
#[derive(Debug)]
pub struct Writer<'a, W> {
    out: W,
    interface: &'a [u8],
    node: Node,
    fraction: Fraction,
    lines: TextWriter,
    text: Vec<u8>,
    run: Option<u32>,
}

impl<'a, W: Write> Writer<'a, W> {
    /// A writer for a joint on an interface.
    pub fn new(out: W, interface: &'a str, node: Node, fraction: Fraction) -> Self {
        let interface = interface.as_bytes();
        let lines = TextWriter::default();
        Self { out, interface, node, fraction, lines, text: Vec::new(), run: None }
    }

    /// The same in another format than candump's.
    #[must_use]
    pub fn in_format(mut self, format: TextFormat) -> Self {
        self.lines = TextWriter::new(format);
        self
    }

    /// Puts a message at the end of the log.
    ///
    /// # Errors
    /// As the writer below.
    pub fn message(&mut self, time_ns: u64, message: &Message) -> io::Result<()> {
        self.append(time_ns, message);
        self.flush_text()
    }

    /// Writes a sample: the run's number where another begins, the PDOs of what is measured, the SYNC,
    /// and the driver's answer where there is one.
    ///
    /// # Errors
    /// As the writer below.
    pub fn sample(&mut self, sample: &TraceSample) -> io::Result<()> {
        let (time_ns, node) = (sample.time_ns, self.node);
        let TraceSample { motion, torque, seal, surroundings, .. } = *sample;
        if sample.run != self.run
            && let Some(run) = sample.run
        {
            self.append(time_ns, &Message::Entry(node, Entry::Run(run)));
            self.run = sample.run;
        }
        self.append(time_ns, &Message::Motion(node, motion));
        self.append(time_ns, &Message::Torque(node, torque));
        if !(seal.radial_force_n.is_nan() && seal.pressure_diff_pa.is_nan()) {
            self.append(time_ns, &Message::Seal(node, seal));
        }
        if !(surroundings.temperature_c.is_nan() && surroundings.auxiliary.is_nan()) {
            self.append(time_ns, &Message::Surroundings(node, surroundings));
        }
        let sync = Sync::of(sample.sequence);
        if sync.counter == 1 {
            self.append(time_ns, &Message::Entry(node, Entry::Sequence(sample.sequence)));
        }
        self.append(time_ns, &Message::Sync(sync));
        if let Some(answer) = sample.answer {
            self.append(time_ns, &Message::Answer(node, answer));
        }
        if let Some(status) = sample.status {
            self.append(time_ns, &Message::Status(node, status));
        }
        self.flush_text()
    }

    fn append(&mut self, time_ns: u64, message: &Message) {
        let frame = CanFrame::from(message.emit());
        let line = Line { time_ns, interface: self.interface, frame, direction: None };
        self.lines.emit(&line, self.fraction, &mut self.text);
    }

    /// Ends the log, and hands what was written on to where it goes.
    ///
    /// # Errors
    /// As the writer below.
    pub fn finish(mut self) -> io::Result<()> {
        self.lines.end(&mut self.text);
        self.flush_text()?;
        self.out.flush()
    }

    fn flush_text(&mut self) -> io::Result<()> {
        self.out.write_all(&self.text)?;
        self.text.clear();
        Ok(())
    }
}
