//! Flash controller and both banks: lock, program, erase, errors, check bits (RM0440, 3).
//!
//! [`Flash::content`] is what the banks hold. The core executes and reads a plain copy of it, which the machine updates
//! after each operation ([`Flash::take_change`]). A power cut ends the operation that runs: what it wrote then has wrong
//! check bits. [`Flash::record_cuts`] records what each operation would leave of the parameter store.
//! [`Flash::record_operations`] records the operations themselves, from which [`Content::apply`] and [`Content::tear`] make
//! the content of both banks for any cut. So one run of an image shows all cuts.

use super::wiring::ChipTraits;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;
use std::rc::Rc;

/// Start of the flash.
pub const BASE: u32 = 0x0800_0000;
/// Length of a bank, bytes.
pub const BANK_BYTES: u32 = 256 << 10;
/// Length of both banks, bytes.
pub const FLASH_BYTES: u32 = 2 * BANK_BYTES;
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

/// Content of the parameter store at the end of the flash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreContent {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Double words with wrong check bits, by their offset in the flash.
    pub torn: Vec<u32>,
}

/// Content of both banks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Content {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Double words with wrong check bits, by their offsets.
    pub torn: BTreeSet<u32>,
}

/// An operation of the controller. Offsets are from the start of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Erase of the page at this offset.
    Erase(u32),
    /// Programming of a double word.
    Program(u32, [u8; 8]),
}

impl Default for Content {
    fn default() -> Self {
        Self { bytes: vec![0xFF; FLASH_BYTES as usize], torn: BTreeSet::new() }
    }
}

impl Content {
    /// Writes bytes at an address, as a debugger does.
    ///
    /// # Panics
    /// They are not in the flash.
    pub fn load(&mut self, address: u32, bytes: &[u8]) {
        let at = (address - BASE) as usize;
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn part(&mut self, offset: u32, length: u32) -> &mut [u8] {
        let range = offset as usize..(offset + length) as usize;
        self.bytes.get_mut(range).unwrap_or_default()
    }

    /// Carries out an operation.
    pub fn apply(&mut self, operation: &Operation) {
        match operation {
            Operation::Erase(page) => {
                self.part(*page, PAGE_BYTES).fill(0xFF);
                self.torn.retain(|at| !(*page..page + PAGE_BYTES).contains(at));
            }
            Operation::Program(at, unit) => self.part(*at, 8).copy_from_slice(unit),
        }
    }

    /// Begins an operation, during which the power is cut.
    pub fn tear(&mut self, operation: &Operation) {
        match operation {
            Operation::Erase(page) => {
                // Half of the page is erased; the double word between is undefined.
                self.part(*page, PAGE_BYTES / 2).fill(0xFF);
                self.torn.insert(page + PAGE_BYTES / 2);
            }
            Operation::Program(at, unit) => {
                self.part(*at, 4).copy_from_slice(&unit[..4]);
                self.torn.insert(*at);
            }
        }
    }
}

/// The controller.
#[derive(Clone, Debug)]
pub struct Flash {
    /// Content of the banks.
    pub content: Content,
    /// Place of the parameter store.
    store: Range<usize>,
    /// Bank from which the core executes: it waits for the operations there.
    pub running_bank: u32,
    registers: [u32; 32],
    keys_seen: usize,
    first_word: Option<(u32, u32)>,
    busy_until: u64,
    ecc_error: bool,
    /// Parts that changed, which the core's memory must follow.
    changes: Vec<Range<u32>>,
    /// Time for which the core waits, cycles.
    stall: u64,
    cuts: Option<Rc<RefCell<Vec<StoreContent>>>>,
    operations: Option<Rc<RefCell<Vec<Operation>>>>,
}

impl Default for Flash {
    fn default() -> Self {
        let mut registers = [0; 32];
        registers[CR as usize / 4] = LOCKED | 1 << 30;
        registers[OPTR as usize / 4] = OPTIONS;
        Self {
            content: Content::default(),
            store: 0..0,
            running_bank: 0,
            registers,
            keys_seen: 0,
            first_word: None,
            busy_until: 0,
            ecc_error: false,
            changes: Vec::new(),
            stall: 0,
            cuts: None,
            operations: None,
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

    /// Returns the flash of a chip.
    pub fn of(chip: &ChipTraits) -> Self {
        let end = chip.flash_bytes as usize;
        Self { store: end - chip.store_bytes as usize..end, ..Self::default() }
    }

    /// Replaces the content, before power-on.
    pub fn with(self, content: Content) -> Self {
        Self { content, ..self }
    }

    /// Returns the flash after a reset, with the content and the records of this one.
    pub fn after_reset(&self) -> Self {
        let (content, operations) = (self.content.clone(), self.operations.clone());
        Self { content, operations, store: self.store.clone(), ..Self::default() }
    }

    /// Takes a part that changed since the last call.
    pub fn take_change(&mut self) -> Option<Range<u32>> {
        self.changes.pop()
    }

    /// Takes the time for which the core waits for its own bank, cycles.
    pub fn take_stall(&mut self) -> u64 {
        std::mem::take(&mut self.stall)
    }

    /// Checks the double word at an address, which is read. A torn one raises an error.
    pub fn check_bits(&mut self, address: u32) {
        if self.content.torn.contains(&(address.wrapping_sub(BASE) & !7)) {
            self.registers[ECCR as usize / 4] |= ECC_DETECTED;
            self.ecc_error = true;
        }
    }

    /// Records the operations from now on.
    pub fn record_operations(&mut self) -> Rc<RefCell<Vec<Operation>>> {
        Rc::clone(self.operations.insert(Rc::default()))
    }

    /// Records from now on what the store holds if the power is cut: during each operation, and after it.
    pub fn record_cuts(&mut self) -> Rc<RefCell<Vec<StoreContent>>> {
        Rc::clone(self.cuts.insert(Rc::default()))
    }

    /// Returns the content of the parameter store.
    pub fn store(&self) -> StoreContent {
        let torn = self.content.torn.iter().copied().collect();
        StoreContent { bytes: self.content.bytes[self.store.clone()].to_vec(), torn }
    }

    /// Sets the content of the parameter store.
    pub fn set_store(&mut self, content: &StoreContent) {
        self.content.bytes[self.store.clone()].copy_from_slice(&content.bytes);
        self.content.torn = content.torn.iter().copied().collect();
    }

    /// Carries an operation out, and records it and the cuts during it and after it.
    fn carry_out(&mut self, operation: Operation, now: u64) {
        if let Some(operations) = &self.operations {
            operations.borrow_mut().push(operation);
        }
        let (part, cycles) = match operation {
            Operation::Erase(page) => (page..page + PAGE_BYTES, ERASE_CYCLES),
            Operation::Program(at, _) => (at..at + 8, PROGRAM_CYCLES),
        };
        if self.cuts.is_some() {
            let before = self.content.clone();
            self.content.tear(&operation);
            self.record_cut();
            self.content = before;
        }
        self.content.apply(&operation);
        self.record_cut();
        if part.start / BANK_BYTES == self.running_bank {
            self.stall += cycles;
        }
        self.changes.push(part);
        self.set_status(BUSY);
        self.busy_until = now + cycles;
    }

    fn record_cut(&self) {
        if let Some(cuts) = &self.cuts {
            cuts.borrow_mut().push(self.store());
        }
    }

    /// Writes a word. The second word of a double word programs both.
    pub fn program(&mut self, address: u32, word: u32, now: u64) {
        let offset = address.wrapping_sub(BASE) & !7;
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
        let unit = (u64::from(first) | u64::from(word) << 32).to_le_bytes();
        let is_erased = self.content.part(offset, 8).iter().all(|byte| *byte == 0xFF)
            && !self.content.torn.contains(&offset);
        // Zeros may be written over anything.
        if !is_erased && unit != [0; 8] {
            return self.set_status(PROGRAM_ERROR);
        }
        self.carry_out(Operation::Program(offset, unit), now);
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
        let (page, bank) = (control >> 3 & 0x7F, control >> 11 & 1);
        self.carry_out(Operation::Erase(bank * BANK_BYTES + page * PAGE_BYTES), now);
    }
}

#[cfg(test)]
mod tests {
    use super::super::wiring::STM32G474;
    use super::*;

    fn unlocked() -> Flash {
        let mut flash = Flash::of(&STM32G474);
        flash.write(KEYR, KEYS[0], 0);
        flash.write(KEYR, KEYS[1], 0);
        flash
    }

    #[test]
    fn program_of_used_double_word_is_refused() {
        let mut flash = unlocked();
        flash.write(CR, 1, 0);
        for (value, expected) in [(0x1122_3344, 0), (5, PROGRAM_ERROR)] {
            flash.program(BASE + 8, value, 0);
            flash.program(BASE + 12, value, 0);
            assert_eq!(flash.read(SR) & PROGRAM_ERROR, expected);
        }
        assert_eq!(flash.content.bytes[8..12], 0x1122_3344u32.to_le_bytes());
        assert_ne!(flash.read(SR) & BUSY, 0);
        flash.process(PROGRAM_CYCLES);
        assert_eq!(flash.read(SR) & BUSY, 0);
    }

    #[test]
    fn program_with_power_cut_leaves_double_word_with_ecc_error() {
        let mut flash = unlocked();
        let cuts = flash.record_cuts();
        flash.write(CR, 1, 0);
        let at = BASE + flash.store.start as u32 + 16;
        flash.program(at, 1, 0);
        flash.program(at + 4, 2, 0);
        let cuts = cuts.take();
        assert_eq!(cuts.len(), 2);
        for (cut, has_error) in cuts.iter().zip([true, false]) {
            flash.set_store(cut);
            flash.check_bits(at);
            assert_eq!(flash.take_ecc_error(), has_error);
        }
    }

    #[test]
    fn operation_in_own_bank_stalls_the_core() {
        for (running_bank, is_stalled) in [(1, true), (0, false)] {
            let mut flash = unlocked();
            flash.running_bank = running_bank;
            flash.write(CR, 1 << 1 | 1 << 11 | START, 0);
            assert_eq!(flash.take_stall() > 0, is_stalled);
        }
    }

    #[test]
    fn erase_while_locked_changes_nothing() {
        let mut flash = Flash::default();
        flash.content.bytes[BANK_BYTES as usize] = 7;
        flash.write(CR, 1 << 1 | 1 << 11 | START, 0);
        assert_eq!(flash.content.bytes[BANK_BYTES as usize], 7);
        let mut flash = unlocked();
        flash.content.bytes[BANK_BYTES as usize] = 7;
        flash.write(CR, 1 << 1 | 1 << 11 | START, 0);
        assert_eq!(flash.content.bytes[BANK_BYTES as usize], 0xFF);
    }
}
