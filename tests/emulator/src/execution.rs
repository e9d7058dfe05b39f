//! State of the execution, and what Unicorn calls: registers, blocks, faults.

use crate::calls::{Call, CallCounter};
use crate::chip::dma::{Memory, NoMemory};
use crate::chip::{Chip, REGISTER_REGIONS};
use crate::cycles::{self, Block, Cost};
use crate::nvic::NMI;
use crate::world::World;
use unicorn_engine::{HookType, MemType, Prot, RegisterARM, TlbEntry, TlbType, Unicorn, uc_error};

/// Start of the flash, and its length in the largest chip.
pub const FLASH: (u32, u32) = (0x0800_0000, 512 << 10);
/// Start of the RAM, and its length in the largest chip; the alias of CCM is behind it.
pub const RAM: (u32, u32) = (0x2000_0000, 96 << 10);
/// Start of CCM on the instruction bus, and its length in the largest chip.
pub const CCM: (u32, u32) = (0x1000_0000, 32 << 10);

/// First of the values of LR that return from an exception.
pub(crate) const RETURN_BASE: u32 = 0xFFFF_FFE0;

/// Cost of one run of an exception handler, without those that preempted it. That of thread mode grows until it is taken, and
/// stays at its largest value after 25 s.
#[derive(Clone, Copy, Debug, Default)]
pub struct HandlerRun {
    /// Exception number; 0 is thread mode.
    pub exception: usize,
    /// Cycles.
    pub cost: Cost,
    /// Number of instructions.
    pub instructions: u32,
    /// Time at which it was entered, cycles.
    pub from: u64,
    /// Time at which it was left, cycles.
    pub until: u64,
}

/// RAM with the alias of CCM behind it, of the largest chip.
const RAM_ADDRESSES: std::ops::Range<u64> = RAM.0 as u64..(RAM.0 + RAM.1 + CCM.1) as u64;

/// State of an IT block in the status register.
const IT_STATE: u64 = 0x0600_FC00;

/// The instruction `dsb sy`.
const DSB: [u8; 4] = [0xBF, 0xF3, 0x4F, 0x8F];

/// Unicorn's number of an exception return.
const EXCEPTION_EXIT: u32 = 8;

/// State of the execution beside the registers.
pub(crate) struct Context<W> {
    pub chip: Chip<W>,
    pub blocks: Vec<Block>,
    /// Index of the block at each halfword of the flash, plus one, and of CCM.
    pub places: [Vec<u32>; 2],
    /// Runs in progress, the innermost last; the first is thread mode.
    pub runs: Vec<HandlerRun>,
    /// The floating-point state of the present context is in use (CONTROL.FPCA), per level.
    pub fpu_in_use: Vec<bool>,
    /// Address after the last block.
    pub sequence: u32,
    pub sleeps: bool,
    pub stop_at: u64,
    pub leaves_exception: bool,
    pub fault: Option<String>,
    /// The exception whose blocks are recorded.
    pub profiled: Option<usize>,
    /// Blocks of its present run with their costs, and of its most expensive run.
    pub blocks_of_run: Vec<(usize, Cost)>,
    pub blocks_of_worst: Vec<(usize, Cost)>,
    pub worst: u32,
    /// Calls of the functions that are counted.
    pub calls: Vec<CallCounter>,
}

/// The core's memory as DMA accesses it.
pub(crate) struct CoreMemory<'a, W: 'static>(pub Unicorn<'a, Context<W>>);

impl<W> Memory for CoreMemory<'_, W> {
    fn read_half(&mut self, address: u32) -> Result<u16, NoMemory> {
        let mut bytes = [0; 2];
        self.0.mem_read(address.into(), &mut bytes).map_err(|_| NoMemory)?;
        Ok(u16::from_le_bytes(bytes))
    }

    fn write_half(&mut self, address: u32, value: u16) -> Result<(), NoMemory> {
        self.0.mem_write(address.into(), &value.to_le_bytes()).map_err(|_| NoMemory)
    }
}

pub(crate) fn map_memory<W: World>(
    core: &mut Unicorn<'static, Context<W>>,
    ccm: &mut [u8],
) -> Result<(), uc_error> {
    let chip = core.get_data().chip.wiring.chip;
    core.mem_map(FLASH.0.into(), chip.flash_bytes.into(), Prot::READ | Prot::EXEC)?;
    // Unicorn looks for code to discard at each store to a page that may hold code. The image runs from flash and from
    // CCM on the instruction bus only, so the pages of the RAM hold none.
    core.ctl_set_tlb_type(TlbType::VIRTUAL)?;
    core.add_tlb_hook(1, 0, |core, address, access| {
        // Before this call, Unicorn restores the state of an IT block, which its code has taken over and does not clear
        // again: the conditions would apply to the block that follows.
        if access != MemType::FETCH
            && let Ok(status) = core.reg_read(RegisterARM::CPSR)
            && status & IT_STATE != 0
        {
            let _ = core.reg_write(RegisterARM::CPSR, status & !IT_STATE);
        }
        let perms =
            if RAM_ADDRESSES.contains(&address) { Prot::READ | Prot::WRITE } else { Prot::ALL };
        Some(TlbEntry { paddr: address, perms })
    })?;
    core.mem_map(RAM.0.into(), chip.ram_bytes.into(), Prot::READ | Prot::WRITE)?;
    let alias = RAM.0 + chip.ram_bytes;
    let both = [(CCM.0, Prot::ALL), (alias, Prot::READ | Prot::WRITE)];
    for (address, access) in both.into_iter().filter(|_| chip.ccm_bytes > 0) {
        // SAFETY: the machine owns the memory, which does not move, for as long as Unicorn.
        #[allow(unsafe_code)]
        unsafe {
            core.mem_map_ptr(
                address.into(),
                chip.ccm_bytes.into(),
                access,
                ccm.as_mut_ptr().cast(),
            )?;
        }
    }
    for (start, length) in REGISTER_REGIONS {
        core.mmio_map(
            start.into(),
            length.into(),
            Some(move |core: &mut Unicorn<'_, Context<W>>, offset: u64, size: usize| {
                let context = core.get_data_mut();
                let (value, cost) = context.chip.read(start + offset as u32, size);
                context.charge(cost);
                value.into()
            }),
            Some(
                move |core: &mut Unicorn<'_, Context<W>>, offset: u64, size: usize, value: u64| {
                    let context = core.get_data_mut();
                    let cost = context.chip.write(start + offset as u32, size, value as u32);
                    context.charge(cost);
                    follow_flash(core);
                },
            ),
        )?;
    }
    Ok(())
}

/// Copies what changed in the flash to the core's memory.
pub(crate) fn follow_flash<W: World>(core: &mut Unicorn<'_, Context<W>>) {
    while let Some(part) = core.get_data_mut().chip.flash.take_change() {
        let range = part.start as usize..part.end as usize;
        let context = core.get_data_mut();
        context.places[0][range.start / 2..range.end / 2].fill(0);
        let bytes = context.chip.flash.content.bytes[range].to_vec();
        let _ = core.mem_write((FLASH.0 + part.start).into(), &bytes);
    }
}

impl<W: World> Context<W> {
    fn charge(&mut self, cost: Cost) {
        self.chip.now += u64::from(cost.upper);
        if let Some(run) = self.runs.last_mut() {
            run.cost.add(cost);
        }
    }

    /// Returns the block at an address if it is known with this size.
    fn known_block(&self, address: u32, size: u32) -> Option<usize> {
        let place = place_of(address)?;
        let number = self.places[place.0].get(place.1)?.checked_sub(1)? as usize;
        (self.blocks[number].bytes == size).then_some(number)
    }

    fn add_block(&mut self, address: u32, code: &[u8]) -> usize {
        self.blocks.push(Block::decode(address, code));
        if let Some((region, place)) = place_of(address)
            && let Some(number) = self.places[region].get_mut(place)
        {
            *number = self.blocks.len() as u32;
        }
        self.blocks.len() - 1
    }

    /// Charges a block.
    fn begin_block(&mut self, address: u32, place: usize) {
        let block = &self.blocks[place];
        let mut cost = block.cost;
        if address != self.sequence {
            cost.add(cycles::REFILL);
        }
        self.sequence = address + block.bytes;
        if (FLASH.0..FLASH.0 + FLASH.1).contains(&address) {
            cost.upper += self.chip.caches.fetch(self.chip.flash_access, address, block.bytes);
            for &constant in &block.constants {
                cost.upper += self.chip.caches.load(self.chip.flash_access, constant);
            }
        }
        if block.uses_fpu
            && let Some(in_use) = self.fpu_in_use.last_mut()
        {
            *in_use = true;
        }
        self.sleeps = block.waits;
        self.chip.now += u64::from(cost.upper);
        let instructions = block.instructions;
        if let Some(run) = self.runs.last_mut() {
            run.cost.add(cost);
            run.instructions = run.instructions.saturating_add(instructions);
            if self.profiled == Some(run.exception) {
                self.blocks_of_run.push((place, cost));
            }
        }
    }
}

/// Returns the region of code and the place in it of an address. Code in RAM is not expected, and decoded each time.
const fn place_of(address: u32) -> Option<(usize, usize)> {
    if address >= FLASH.0 && address < FLASH.0 + FLASH.1 {
        Some((0, (address - FLASH.0) as usize / 2))
    } else if address >= CCM.0 && address < CCM.0 + CCM.1 {
        Some((1, (address - CCM.0) as usize / 2))
    } else {
        None
    }
}

pub(crate) fn is_allowed<W: World>(core: &Unicorn<'_, Context<W>>, exception: usize) -> bool {
    let mask = |register: RegisterARM| core.reg_read(register).unwrap_or(0) as u32;
    let (primask, basepri) = (mask(RegisterARM::PRIMASK), mask(RegisterARM::BASEPRI));
    core.get_data().chip.nvic.is_allowed(exception, primask, basepri)
}

pub(crate) fn add_hooks<W: World>(core: &mut Unicorn<'static, Context<W>>) -> Result<(), uc_error> {
    core.add_block_hook(1, 0, |core, address, size| {
        follow_flash(core);
        let context = core.get_data_mut();
        if context.chip.now >= context.chip.next_event() {
            let mut memory = CoreMemory(core.clone());
            core.get_data_mut().chip.process_events(&mut memory);
        }
        let context = core.get_data_mut();
        let is_due = context.chip.now >= context.stop_at || context.chip.is_reset_requested();
        let ready = context.chip.ready_exception();
        if is_due || ready.is_some_and(|exception| is_allowed(core, exception)) {
            let _ = core.emu_stop();
            return;
        }
        if core.get_data().calls.iter().any(|calls| calls.is_at(address as u32)) {
            let link = core.reg_read(RegisterARM::LR).unwrap_or(0) as u32;
            let Context { calls, runs, .. } = core.get_data_mut();
            let (depth, run) = (runs.len(), runs.last().copied().unwrap_or_default());
            let taken = Call { instructions: run.instructions, cost: run.cost };
            let reached = calls.iter_mut().filter(|calls| calls.is_at(address as u32));
            reached.for_each(|calls| calls.reach(address as u32, link, depth, taken));
        }
        let context = core.get_data_mut();
        if let Some(place) = context.known_block(address as u32, size) {
            return context.begin_block(address as u32, place);
        }
        let code = core.mem_read_as_vec(address, size as usize).unwrap_or_default();
        let context = core.get_data_mut();
        let place = context.add_block(address as u32, &code);
        context.begin_block(address as u32, place);
    })?;
    core.add_intr_hook(|core, number| {
        let context = core.get_data_mut();
        if number == EXCEPTION_EXIT {
            context.leaves_exception = true;
        } else {
            context.fault = Some(format!("exception {number} of the core"));
        }
        let _ = core.emu_stop();
    })?;
    // Not for RAM: a hook on its addresses would make each of its stores a call.
    for (from, to) in [(0, RAM_ADDRESSES.start - 1), (RAM_ADDRESSES.end, u64::from(u32::MAX))] {
        core.add_mem_hook(HookType::MEM_INVALID, from, to, |core, kind, address, _, value| {
            let is_flash = (FLASH.0..FLASH.0 + FLASH.1).contains(&(address as u32));
            if kind == MemType::WRITE_PROT && is_flash {
                core.get_data_mut().chip.program_flash(address as u32, value as u32);
                return true;
            }
            let at = core.reg_read(RegisterARM::PC).unwrap_or(0);
            if address < u64::from(RETURN_BASE) {
                core.get_data_mut().fault = Some(format!("{kind:?} of {address:#x} at {at:#x}"));
            }
            false
        })?;
    }
    Ok(())
}

/// Makes the non-maskable interrupt precede the barriers (DSB) of the images, which wait for the access that causes it: an
/// ECC error of the flash. Everything else is taken between two blocks.
pub(crate) fn add_barrier_hooks<W: World>(
    core: &mut Unicorn<'static, Context<W>>,
) -> Result<(), uc_error> {
    let bytes = &core.get_data().chip.flash.content.bytes;
    let halves = (0..bytes.len() - DSB.len()).step_by(2);
    let places: Vec<u64> =
        halves.filter(|&at| bytes[at..].starts_with(&DSB)).map(|at| at as u64).collect();
    for offset in places {
        let address = u64::from(FLASH.0) + offset;
        core.add_code_hook(address, address, |core, _, _| {
            if core.get_data().chip.ready_exception() == Some(NMI) {
                let _ = core.emu_stop();
            }
        })?;
    }
    Ok(())
}

/// Watches the torn double words, whose reads raise an error.
pub(crate) fn watch_torn<W: World>(
    core: &mut Unicorn<'static, Context<W>>,
) -> Result<(), uc_error> {
    let torn = core.get_data().chip.flash.content.torn.clone();
    for offset in torn {
        let first = u64::from(FLASH.0 + offset);
        core.add_mem_hook(HookType::MEM_READ, first, first + 7, |core, _, address, _, _| {
            core.get_data_mut().chip.check_flash(address as u32);
            true
        })?;
    }
    Ok(())
}
