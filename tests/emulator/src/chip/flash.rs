//! Flash controller and second bank: lock, program, erase, errors, check bits (RM0440, 3).
//!
//! The first bank holds the image and is plain memory of the machine. A power cut ends the operation that runs: what it
//! wrote then has wrong check bits. The content that a cut would leave is recorded for every operation, so that one run
//! of the image shows all cuts: [`Flash::record_cuts`].

use std::cell::RefCell;
use std::rc::Rc;

/// Start of the second bank.
pub const BANK_2: u32 = 0x0804_0000;
/// Length of a bank, bytes.
pub const BANK_BYTES: u32 = 256 << 10;
/// End of the second bank.
pub const BANK_2_END: u32 = BANK_2 + BANK_BYTES;
const PAGE_BYTES: u32 = 2048;

const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;
const OPTR: u32 = 0x20;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

const BUSY: u32 = 1 << 16;
const END: u32 = 1;
const PROGRAM_ERROR: u32 = 1 << 3;
const SEQUENCE_ERROR: u32 = 1 << 7;
const LOCKED: u32 = 1 << 31;
const START: u32 = 1 << 16;
const ECC_DETECTED: u32 = 1 << 31;
/// Option bytes: two banks, highest brown-out level, else as delivered.
const OPTIONS: u32 = 0xFFEF_FCAA;

/// Duration of a page erase and of a program operation (data sheet, largest), cycles.
const ERASE_CYCLES: u64 = 24_500 * 170;
const PROGRAM_CYCLES: u64 = 85 * 170;

/// Length of the parameter store, at the end of the bank, bytes.
pub const STORE_BYTES: usize = 4 * PAGE_BYTES as usize;
const STORE_AT: usize = BANK_BYTES as usize - STORE_BYTES;

/// Content of the parameter store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreContent {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Double words with wrong check bits, by their offset in the bank.
    pub torn: Vec<u32>,
}

/// The controller.
#[derive(Clone, Debug)]
pub struct Flash {
    /// Content of the second bank.
    pub bank: Vec<u8>,
    torn: Vec<u32>,
    registers: [u32; 32],
    keys_seen: usize,
    first_word: Option<(u32, u32)>,
    busy_until: u64,
    ecc_error: bool,
    cuts: Option<Rc<RefCell<Vec<StoreContent>>>>,
}

impl Default for Flash {
    fn default() -> Self {
        let mut registers = [0; 32];
        registers[CR as usize / 4] = LOCKED | 1 << 30;
        registers[OPTR as usize / 4] = OPTIONS;
        Self {
            bank: vec![0xFF; BANK_BYTES as usize],
            torn: Vec::new(),
            registers,
            keys_seen: 0,
            first_word: None,
            busy_until: 0,
            ecc_error: false,
            cuts: None,
        }
    }
}

impl Flash {
    fn register(&self, offset: u32) -> u32 {
        self.registers[offset as usize / 4]
    }

    fn set_status(&mut self, flags: u32) {
        self.registers[SR as usize / 4] |= flags;
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        if self.busy_until > 0 { self.busy_until } else { u64::MAX }
    }

    /// Ends the operation that is due.
    pub fn process(&mut self, now: u64) {
        if self.busy_until > 0 && self.busy_until <= now {
            self.busy_until = 0;
            let status = &mut self.registers[SR as usize / 4];
            *status = *status & !BUSY | END;
        }
    }

    /// Takes an error of the check bits since the last call.
    pub fn take_ecc_error(&mut self) -> bool {
        std::mem::take(&mut self.ecc_error)
    }

    /// Reads a word of the second bank. A torn double word raises an error.
    pub fn read_bank(&mut self, address: u32) -> u32 {
        let offset = (address - BANK_2) & !3;
        if self.torn.contains(&(offset & !7)) {
            self.registers[ECCR as usize / 4] |= ECC_DETECTED;
            self.ecc_error = true;
        }
        let at = offset as usize;
        self.bank
            .get(at..at + 4)
            .map_or(u32::MAX, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// Records from now on what the store holds if the power is cut: during each operation, and after it.
    pub fn record_cuts(&mut self) -> Rc<RefCell<Vec<StoreContent>>> {
        Rc::clone(self.cuts.insert(Rc::default()))
    }

    /// Returns the content of the parameter store.
    pub fn store(&self) -> StoreContent {
        StoreContent { bytes: self.bank[STORE_AT..].to_vec(), torn: self.torn.clone() }
    }

    /// Sets the content of the parameter store.
    pub fn set_store(&mut self, content: &StoreContent) {
        self.bank[STORE_AT..].copy_from_slice(&content.bytes);
        self.torn.clone_from(&content.torn);
    }

    /// Records a cut during an operation, which writes these bytes and leaves the double word at `torn` undefined. Both
    /// are offsets in the bank.
    fn record_cut(&self, at: usize, written: &[u8], torn: u32) {
        let Some(cuts) = &self.cuts else { return };
        let mut content = self.store();
        if let Some(at) = at.checked_sub(STORE_AT) {
            content.bytes[at..at + written.len()].copy_from_slice(written);
        }
        content.torn.push(torn);
        cuts.borrow_mut().push(content);
    }

    /// Begins the time of an operation, whose effect is there.
    fn begin(&mut self, now: u64, cycles: u64) {
        if let Some(cuts) = &self.cuts {
            cuts.borrow_mut().push(self.store());
        }
        self.set_status(BUSY);
        self.busy_until = now + cycles;
    }

    /// Writes a word of the second bank. The second word of a double word programs both.
    pub fn program(&mut self, address: u32, word: u32, now: u64) {
        if self.register(CR) & 1 == 0 || self.register(CR) & LOCKED != 0 {
            return self.set_status(SEQUENCE_ERROR);
        }
        let Some((first_at, first)) = self.first_word.take() else {
            self.first_word = Some((address, word));
            return;
        };
        if first_at & 7 != 0 || address != first_at + 4 {
            return self.set_status(SEQUENCE_ERROR);
        }
        let offset = first_at - BANK_2;
        let at = offset as usize;
        let bytes = [first.to_le_bytes(), word.to_le_bytes()].concat();
        let is_erased = self.bank[at..at + 8].iter().all(|byte| *byte == 0xFF);
        // Zeros may be written over anything.
        if !is_erased && bytes.iter().any(|byte| *byte != 0) {
            return self.set_status(PROGRAM_ERROR);
        }
        self.record_cut(at, &bytes[..4], offset);
        self.bank[at..at + 8].copy_from_slice(&bytes);
        self.begin(now, PROGRAM_CYCLES);
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> u32 {
        self.registers.get(offset as usize / 4).copied().unwrap_or(0)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, word: u32, now: u64) {
        let place = offset as usize / 4;
        match offset {
            KEYR => {
                self.keys_seen =
                    if KEYS.get(self.keys_seen) == Some(&word) { self.keys_seen + 1 } else { 0 };
                if self.keys_seen == KEYS.len() {
                    self.registers[CR as usize / 4] &= !LOCKED;
                    self.keys_seen = 0;
                }
            }
            // Flags are cleared by ones; the busy flag by the end of the operation.
            SR => self.registers[place] &= !(word & !BUSY),
            ECCR => {
                let flags = word & (3 << 30 | 3 << 28);
                self.registers[place] &= !flags;
            }
            CR => {
                // The lock is set by a one, and cleared by the keys only.
                let lock = (self.registers[place] | word) & LOCKED;
                self.registers[place] = word & !(LOCKED | START) | lock;
                if word & START != 0 && lock == 0 && word & 1 << 1 != 0 {
                    self.erase(word, now);
                }
            }
            OPTR => {}
            _ => {
                if let Some(register) = self.registers.get_mut(place) {
                    *register = word;
                }
            }
        }
    }

    fn erase(&mut self, control: u32, now: u64) {
        let (page, is_second_bank) = (control >> 3 & 0x7F, control >> 11 & 1 == 1);
        if !is_second_bank {
            return self.set_status(SEQUENCE_ERROR);
        }
        let start = (page * PAGE_BYTES) as usize;
        let offsets = page * PAGE_BYTES..(page + 1) * PAGE_BYTES;
        // Half of the page is erased; the double word between is undefined.
        let half = PAGE_BYTES / 2;
        self.record_cut(start, &[0xFF; PAGE_BYTES as usize / 2], page * PAGE_BYTES + half);
        self.bank[start..start + PAGE_BYTES as usize].fill(0xFF);
        self.torn.retain(|offset| !offsets.contains(offset));
        self.begin(now, ERASE_CYCLES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unlocked() -> Flash {
        let mut flash = Flash::default();
        flash.write(KEYR, KEYS[0], 0);
        flash.write(KEYR, KEYS[1], 0);
        flash
    }

    #[test]
    fn program_of_used_double_word_is_refused() {
        let mut flash = unlocked();
        flash.write(CR, 1, 0);
        for (value, expected) in [(0x1122_3344, 0), (5, PROGRAM_ERROR)] {
            flash.program(BANK_2 + 8, value, 0);
            flash.program(BANK_2 + 12, value, 0);
            assert_eq!(flash.read(SR) & PROGRAM_ERROR, expected);
        }
        assert_eq!(flash.read_bank(BANK_2 + 8), 0x1122_3344);
        assert_ne!(flash.read(SR) & BUSY, 0);
        flash.process(PROGRAM_CYCLES);
        assert_eq!(flash.read(SR) & BUSY, 0);
    }

    #[test]
    fn program_with_power_cut_leaves_double_word_with_ecc_error() {
        let mut flash = unlocked();
        let cuts = flash.record_cuts();
        flash.write(CR, 1, 0);
        let at = BANK_2 + STORE_AT as u32 + 16;
        flash.program(at, 1, 0);
        flash.program(at + 4, 2, 0);
        let cuts = cuts.take();
        assert_eq!(cuts.len(), 2);
        for (cut, has_error) in cuts.iter().zip([true, false]) {
            flash.set_store(cut);
            flash.read_bank(at);
            assert_eq!(flash.take_ecc_error(), has_error);
        }
    }

    #[test]
    fn erase_while_locked_changes_nothing() {
        let mut flash = Flash::default();
        flash.bank[0] = 7;
        flash.write(CR, 1 << 1 | 1 << 11 | START, 0);
        assert_eq!(flash.bank[0], 7);
        let mut flash = unlocked();
        flash.bank[0] = 7;
        flash.write(CR, 1 << 1 | 1 << 11 | START, 0);
        assert_eq!(flash.bank[0], 0xFF);
    }
}
