//! CRC-32 (ISO-HDLC) of records and parameter sets.
//!
//! A driver computes it between two frames of its bus: four bits at a time, with a table of 64 bytes. The crate `crc` has
//! single bits, or tables of 1 kB and more.

const TABLE: [u32; 16] = {
    let mut table = [0; 16];
    let mut number = 0;
    while number < table.len() {
        let mut word = number as u32;
        let mut bit = 0;
        while bit < 4 {
            word = word >> 1 ^ if word & 1 == 1 { 0xEDB8_8320 } else { 0 };
            bit += 1;
        }
        table[number] = word;
        number += 1;
    }
    table
};

/// The CRC of the bytes so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc32(u32);

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc32 {
    /// Returns the CRC of no bytes.
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Appends bytes.
    // Called in several places: not inlined, to reduce the size of an image.
    #[inline(never)]
    pub fn update(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let word = self.0 ^ u32::from(*byte);
            let word = word >> 4 ^ TABLE[(word & 0xF) as usize];
            self.0 = word >> 4 ^ TABLE[(word & 0xF) as usize];
        }
    }

    /// Returns the value.
    pub const fn value(self) -> u32 {
        !self.0
    }
}

/// Returns the CRC of these bytes.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc32::new();
    crc.update(bytes);
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc32_of_the_check_text_and_of_parts_is_that_of_the_standard() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
        let mut parts = Crc32::new();
        parts.update(b"1234");
        parts.update(b"56789");
        assert_eq!(parts.value(), 0xCBF4_3926);
    }
}
