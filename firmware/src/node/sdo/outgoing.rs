//! A value that a client reads: from the server's buffer, or from its object in parts.

use super::{Abort, Objects, SEGMENT, ValueBuffer};
use canopen_rs::Address;

/// A value that is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Outgoing {
    pub at: Address,
    /// Length of the value, bytes.
    pub length: usize,
    /// The object is read in parts; otherwise the buffer holds the value.
    is_streamed: bool,
}

impl Outgoing {
    /// Begins to read a value. Reads it into the buffer if its object has no parts.
    pub fn begin(
        at: Address,
        buffer: &mut ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<Self, Abort> {
        buffer.clear();
        if let Some(length) = objects.stream_length(at)? {
            return Ok(Self { at, length, is_streamed: true });
        }
        objects.read(at, buffer)?;
        Ok(Self { at, length: buffer.len(), is_streamed: false })
    }

    /// Returns the data of the segment at this offset, and how many bytes of it are used.
    pub fn segment(
        &self,
        offset: usize,
        buffer: &ValueBuffer,
        objects: &mut impl Objects,
    ) -> Result<([u8; SEGMENT], usize), Abort> {
        let mut data = [0; SEGMENT];
        let count = self.length.saturating_sub(offset).min(SEGMENT);
        let part = data.get_mut(..count).unwrap_or_default();
        if self.is_streamed {
            objects.read_part(self.at, offset, part)?;
        } else {
            for (place, byte) in part.iter_mut().zip(buffer.iter().skip(offset)) {
                *place = *byte;
            }
        }
        Ok((data, count))
    }
}
