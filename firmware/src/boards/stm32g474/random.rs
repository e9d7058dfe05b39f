//! Random bytes of the chip's generator (RM0440, 26), for the challenges of the access levels.
//!
//! The generator has the clock of the internal 48 MHz oscillator, which the start enables. It is used once and then off.

use embassy_stm32::pac;

/// Words of a seed.
const WORDS: usize = 4;
/// Maximum number of reads of the status until a word is ready: about 1 ms. A word takes a few microseconds.
const LONGEST_WAIT: u32 = 20_000;

/// Returns 16 random bytes; `None`, with a warning in the log, if the generator reports an error or does not answer.
pub fn seed() -> Option<[u8; 4 * WORDS]> {
    pac::RCC.ahb2enr().modify(|w| w.set_rngen(true));
    pac::RNG.cr().modify(|w| w.set_rngen(true));
    let mut bytes = [0; 4 * WORDS];
    let is_complete = bytes.as_chunks_mut::<4>().0.iter_mut().all(|place| match word() {
        Some(word) => {
            *place = word.to_le_bytes();
            true
        }
        None => false,
    });
    pac::RNG.cr().modify(|w| w.set_rngen(false));
    pac::RCC.ahb2enr().modify(|w| w.set_rngen(false));
    if !is_complete {
        defmt::warn!("no random numbers: the challenges depend on key and time");
    }
    is_complete.then_some(bytes)
}

fn word() -> Option<u32> {
    for _ in 0..LONGEST_WAIT {
        let status = pac::RNG.sr().read();
        // The clock is too slow, or the bits are not random.
        if status.cecs() || status.secs() || status.ceis() || status.seis() {
            return None;
        }
        if status.drdy() {
            // 0 stands for an error between the two reads.
            return Some(pac::RNG.dr().read()).filter(|word| *word != 0);
        }
    }
    None
}
