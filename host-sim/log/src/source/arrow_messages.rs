//! Check of the lengths in an Arrow stream before it is decoded.
//!
//! The library allocates what a message states: the length of its body, and for a compressed buffer its unpacked
//! length. In a damaged file these may be larger than any memory, and a failed allocation ends the process.

use arrow_ipc::{Message, RecordBatch, root_as_message};
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};

/// Maximum unpacked length of a buffer: this many bytes, plus [`MAX_RATIO`] times its packed length.
const MAX_SMALL_BYTES: i64 = 1 << 30;

/// Maximum ratio of the lengths. Constant columns pack to a hundredth.
const MAX_RATIO: i64 = 200;

/// Mark before the length of a message.
const CONTINUATION: u32 = 0xffff_ffff;

/// Checks the lengths in all messages of a stream that begins at `start`.
///
/// # Errors
/// If a length is impossible, or if the file cannot be read.
pub(super) fn check_lengths(file: &File, start: u64) -> io::Result<()> {
    let size = file.metadata()?.len();
    let mut reader = BufReader::new(file);
    reader.seek(SeekFrom::Start(start))?;
    let mut at = start;
    while let Some(length) = metadata_length(&mut reader)? {
        let rest = size.saturating_sub(at + 8);
        if u64::from(length) > rest {
            return Err(damaged("a message longer than the file"));
        }
        let mut metadata = vec![0; length as usize];
        reader.read_exact(&mut metadata)?;
        let message = root_as_message(&metadata).map_err(|_| damaged("a damaged message"))?;
        let body = at + 8 + u64::from(length);
        let body_bytes = u64::try_from(message.bodyLength()).unwrap_or(u64::MAX);
        if body_bytes > size.saturating_sub(body) {
            return Err(damaged("a message longer than the file"));
        }
        if let Some(batch) = batch(&message).filter(|batch| batch.compression().is_some()) {
            check_buffers(&mut reader, &batch, body, body_bytes)?;
        }
        at = body + body_bytes;
        reader.seek(SeekFrom::Start(at))?;
    }
    Ok(())
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, what)
}

/// Returns the length of the next message's metadata; `None` at the end of the stream.
fn metadata_length(reader: &mut impl Read) -> io::Result<Option<u32>> {
    let mut word = [0; 4];
    if reader.read(&mut word)? < word.len() {
        return Ok(None);
    }
    // Versions before 0.15 have no continuation mark.
    if u32::from_le_bytes(word) != CONTINUATION {
        return Err(damaged("a message without its mark"));
    }
    reader.read_exact(&mut word)?;
    let length = u32::from_le_bytes(word);
    Ok((length > 0).then_some(length))
}

/// Returns the columns of a message.
fn batch<'a>(message: &Message<'a>) -> Option<RecordBatch<'a>> {
    let of_dictionary = || message.header_as_dictionary_batch().and_then(|batch| batch.data());
    message.header_as_record_batch().or_else(of_dictionary)
}

/// Checks the unpacked lengths of compressed buffers. Each stands before the packed bytes; -1 means not packed.
fn check_buffers(
    reader: &mut (impl Read + Seek),
    batch: &RecordBatch,
    body: u64,
    body_bytes: u64,
) -> io::Result<()> {
    for buffer in batch.buffers().iter().flatten() {
        let (offset, length) = (buffer.offset(), buffer.length());
        let end = offset.checked_add(length).and_then(|end| u64::try_from(end).ok());
        if offset < 0 || length < 0 || end.is_none_or(|end| end > body_bytes) {
            return Err(damaged("a buffer outside its message"));
        }
        if length == 0 {
            continue;
        }
        let mut unpacked = [0; 8];
        reader.seek(SeekFrom::Start(body + offset.unsigned_abs()))?;
        reader.read_exact(&mut unpacked)?;
        let limit = MAX_SMALL_BYTES.saturating_add(length.saturating_mul(MAX_RATIO));
        if !(-1..=limit).contains(&i64::from_le_bytes(unpacked)) {
            return Err(damaged("a buffer that unpacks to far more than its size"));
        }
    }
    Ok(())
}
