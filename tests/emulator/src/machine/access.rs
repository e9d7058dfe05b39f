//! Access to the state of a machine: its chip, its memory, and the registers of its core.

use super::Machine;
use crate::chip::Chip;
use crate::execution::{CCM, RAM};
use crate::world::World;
use unicorn_engine::RegisterARM;

impl<W: World + 'static> Machine<W> {
    /// Start and length of RAM and of CCM.
    pub(super) fn memories(&self) -> [(u32, u32); 2] {
        let chip = self.chip().wiring.chip;
        [(RAM.0, chip.ram_bytes), (CCM.0, chip.ccm_bytes)]
    }

    /// The chip.
    pub fn chip(&self) -> &Chip<W> {
        &self.core.get_data().chip
    }

    /// The chip, to change its surroundings.
    pub fn chip_mut(&mut self) -> &mut Chip<W> {
        &mut self.core.get_data_mut().chip
    }

    /// Reads a word of memory, not of a register.
    ///
    /// # Panics
    /// Panics if the chip has no memory there.
    pub fn word(&self, address: u32) -> u32 {
        let mut bytes = [0; 4];
        let read = self.core.mem_read(address.into(), &mut bytes);
        read.unwrap_or_else(|error| panic!("no word at {address:#x}: {error:?}"));
        u32::from_le_bytes(bytes)
    }

    /// Writes memory, not registers.
    ///
    /// # Panics
    /// Panics if the chip has no memory there.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) {
        let written = self.core.mem_write(address.into(), bytes);
        written.unwrap_or_else(|error| panic!("no memory at {address:#x}: {error:?}"));
    }

    /// Reads memory, not registers.
    ///
    /// # Panics
    /// Panics if the chip has no memory there.
    pub fn read_memory(&self, address: u32, length: usize) -> Vec<u8> {
        let read = self.core.mem_read_as_vec(address.into(), length);
        read.unwrap_or_else(|error| panic!("no memory at {address:#x}: {error:?}"))
    }

    pub(super) fn set(&mut self, register: RegisterARM, value: u32) {
        self.core.reg_write(register, value.into()).expect("a register of the core");
    }

    pub(super) fn get(&self, register: RegisterARM) -> u32 {
        self.core.reg_read(register).expect("a register of the core") as u32
    }

    /// Returns a register of the FPU, by its number.
    pub(super) fn get_float(&self, number: u32) -> u32 {
        let read = self.core.reg_read(RegisterARM::S0 as i32 + number as i32);
        read.expect("a register of the FPU") as u32
    }

    /// Sets a register of the FPU, by its number.
    pub(super) fn set_float(&mut self, number: u32, value: u32) {
        let written = self.core.reg_write(RegisterARM::S0 as i32 + number as i32, value.into());
        written.expect("a register of the FPU");
    }
}
