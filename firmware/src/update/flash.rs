//! Reading parts of a flash in chunks.

use core::ops::Range;
use embedded_storage::nor_flash::NorFlash;

/// Length of a chunk, bytes.
const CHUNK_BYTES: usize = 256;

/// Passes a part of the flash on in chunks. Returns false at an unreadable double word: the image is damaged.
pub(super) fn read_chunks<F: NorFlash>(
    flash: &mut F,
    part: Range<u32>,
    mut pass_on: impl FnMut(&[u8]),
) -> bool {
    let mut bytes = [0; CHUNK_BYTES];
    let mut at = part.start;
    while at < part.end {
        let length = CHUNK_BYTES.min((part.end - at) as usize);
        let Some(chunk) = bytes.get_mut(..length) else { break };
        if flash.read(at, chunk).is_err() {
            return false;
        }
        pass_on(chunk);
        at += length as u32;
    }
    true
}

/// Returns true if every byte reads as erased.
pub(super) fn is_blank<F: NorFlash>(flash: &mut F, from: u32, length: u32) -> bool {
    let mut bytes = [0; CHUNK_BYTES];
    (from..from + length)
        .step_by(CHUNK_BYTES)
        .all(|at| flash.read(at, &mut bytes).is_ok() && bytes.iter().all(|byte| *byte == 0xFF))
}
