//! Samples written as the lines of a CAN log.
//!
//! A sample becomes the frames that transmit it to a driver, all with the time stamp of the sample: the PDOs of its
//! measured quantities, the SYNC, and the driver's answer if there is one. A run begins with its number.

use crate::frame::{CanFrame, Fraction, Line, TextFormat};
use crate::samples::TraceSample;
use crate::text::TextWriter;
use compensator_core::can::{Message, NodeId, SyncFrame, TraceEntry};
use std::io::{self, Write};

/// Writes the frames of one joint.
#[derive(Debug)]
pub struct Writer<'a, W> {
    out: W,
    interface: &'a [u8],
    node: NodeId,
    fraction: Fraction,
    lines: TextWriter,
    text: Vec<u8>,
    run: Option<u32>,
}

impl<'a, W: Write> Writer<'a, W> {
    /// Creates a writer for one joint on one interface, in the format of candump.
    pub fn new(out: W, interface: &'a str, node: NodeId, fraction: Fraction) -> Self {
        let interface = interface.as_bytes();
        let lines = TextWriter::default();
        Self { out, interface, node, fraction, lines, text: Vec::new(), run: None }
    }

    /// Selects another text format.
    #[must_use]
    pub fn in_format(mut self, format: TextFormat) -> Self {
        self.lines = TextWriter::new(format);
        self
    }

    /// Appends a message to the log.
    ///
    /// # Errors
    /// Returns the error of the underlying writer.
    pub fn message(&mut self, time_ns: u64, message: &Message) -> io::Result<()> {
        self.append(time_ns, message);
        self.flush_text()
    }

    /// Writes a sample: the run number if a new run begins, the PDOs of the measured quantities, the SYNC, and the
    /// driver's answer if there is one.
    ///
    /// # Errors
    /// Returns the error of the underlying writer.
    pub fn sample(&mut self, sample: &TraceSample) -> io::Result<()> {
        let (time_ns, node) = (sample.time_ns, self.node);
        let TraceSample { motion, torque, seal, surroundings, .. } = *sample;
        if sample.run != self.run
            && let Some(run) = sample.run
        {
            self.append(time_ns, &Message::Entry(node, TraceEntry::Run(run)));
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
        let sync = SyncFrame::of(sample.sequence);
        if sync.counter == 1 {
            self.append(time_ns, &Message::Entry(node, TraceEntry::Sequence(sample.sequence)));
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

    /// Writes the end of the log and flushes the underlying writer.
    ///
    /// # Errors
    /// Returns the error of the underlying writer.
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
