//! A value that a client writes: collected in the server's buffer, or passed on in parts.

use super::{Abort, MAX_PART_BYTES, MAX_VALUE_BYTES, Objects, SEGMENT, ValueBuffer};
use canopen_rs::Address;

/// State of a value that arrives. The server's buffer holds what was not passed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Incoming {
    pub at: Address,
    /// Length that the client states, bytes.
    declared: Option<usize>,
    /// The object takes parts.
    is_streamed: bool,
    /// Bytes passed on to the object.
    passed: usize,
}

impl Incoming {
    /// Begins a value of this length, and clears the buffer.
    pub fn begin(
        at: Address,
        declared: Option<usize>,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<Self, Abort> {
        buffer.clear();
        objects.check_write(at, declared)?;
        let is_streamed = objects.takes_parts(at);
        if !is_streamed && declared.is_some_and(|length| length > MAX_VALUE_BYTES) {
            return Err(Abort::Memory);
        }
        Ok(Self { at, declared, is_streamed, passed: 0 })
    }

    /// Appends data. `padding` bytes of it may lie beyond the end of the value.
    #[inline(never)]
    pub fn append(
        &self,
        data: &[u8],
        padding: usize,
        buffer: &mut ValueBuffer,
    ) -> Result<(), Abort> {
        buffer.extend_from_slice(data).map_err(|_| Abort::Memory)?;
        let length = self.passed + buffer.len();
        if self.declared.is_some_and(|declared| length > declared.saturating_add(padding)) {
            return Err(Abort::TooLong);
        }
        if buffer.len() > MAX_VALUE_BYTES + padding { Err(Abort::Memory) } else { Ok(()) }
    }

    /// Passes the buffer on, except its last `kept` bytes, if the object takes parts.
    pub fn pass_on(
        &mut self,
        kept: usize,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<(), Abort> {
        let length = buffer.len().saturating_sub(kept);
        if !self.is_streamed || length == 0 {
            return Ok(());
        }
        let (part, rest) = buffer.split_at(length);
        objects.write_part(self.at, self.passed, part)?;
        self.passed += length;
        // The kept bytes are those of a segment.
        let mut last = [0; SEGMENT];
        let count = rest.len().min(SEGMENT);
        for (place, byte) in last.iter_mut().zip(rest) {
            *place = *byte;
        }
        buffer.clear();
        buffer.extend_from_slice(last.get(..count).unwrap_or_default()).map_err(|_| Abort::Memory)
    }

    /// Passes the buffer on once it holds a part, if the object takes parts.
    pub fn pass_on_full_part(
        &mut self,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<(), Abort> {
        if buffer.len() < MAX_PART_BYTES { Ok(()) } else { self.pass_on(0, buffer, objects) }
    }

    /// Ends the value: checks its length, and writes it or its last part.
    pub fn finish(
        mut self,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<(), Abort> {
        let length = self.passed + buffer.len();
        match self.declared {
            Some(declared) if length < declared => return Err(Abort::TooShort),
            Some(declared) if length > declared => return Err(Abort::TooLong),
            _ => {}
        }
        if !self.is_streamed && length > MAX_VALUE_BYTES {
            return Err(Abort::Memory);
        }
        if !self.is_streamed {
            // The joint may have been locked or armed since the begin of the transfer.
            objects.check_write(self.at, Some(length))?;
            return objects.write(self.at, buffer);
        }
        self.pass_on(0, buffer, objects)?;
        objects.end_stream(self.at, length)
    }
}
