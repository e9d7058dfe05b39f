//! The core: it executes instructions, takes exceptions and advances time.
//!
//! Unicorn executes until an event is due, an exception can be taken, or the core sleeps; this module decides what
//! follows. An event or an exception is taken between two basic blocks. Stacking, the return values and the priorities
//! are those of the ARMv7-M architecture (DDI 0403, B1.5); only the main stack is used, as by the image.

use crate::calls::{Call, CallCounter};
use crate::chip::Chip;
use crate::cycles::{self, Cost};
use crate::error::EmulatorError;
pub use crate::execution::{CCM, FLASH, HandlerRun, RAM};
use crate::execution::{
    Context, CoreMemory, RETURN_BASE, add_barrier_hooks, add_hooks, follow_flash, is_allowed,
    map_memory, watch_torn,
};
use crate::image::Image;
use crate::nvic::HARD_FAULT;
use crate::world::World;
use unicorn_engine::{Arch, ArmCpuModel, Mode, RegisterARM, Unicorn};

/// Content of RAM before the start.
const PAINT: u32 = 0xA5A5_5A5A;

const FPU_ACTIVE: u32 = 1 << 4;

/// Memory protection unit: control, base address and attributes of region 0.
const MPU_CTRL: u32 = 0xE000_ED94;
const MPU_RBAR: u32 = 0xE000_ED9C;
const MPU_RASR: u32 = 0xE000_EDA0;
/// Status of faults, and its bit for the stack of an exception.
const CFSR: u32 = 0xE000_ED28;
const STACKING_REFUSED: u32 = 1 << 4;

/// Reason why [`Machine::run`] returned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The requested time has come.
    Time,
    /// The software or the watchdog requested a reset.
    Reset,
    /// The core is locked up: a fault in the handler of a fault.
    Lockup(String),
}

/// What locked the core up.
struct Lockup(String);

/// A processor with its chip.
pub struct Machine<W: World + 'static> {
    core: Unicorn<'static, Context<W>>,
    /// Memory that two addresses show; Unicorn refers to it until it is dropped.
    _ccm: Box<[u8]>,
    last_runs: Vec<HandlerRun>,
    /// Records every finished handler.
    pub records_runs: bool,
    pc: u32,
    /// Handlers in which the core may not run: thread mode is stopped until then.
    thread_stalled_until: u64,
    /// Vector table of the start.
    vectors: u32,
}

impl<W: World + 'static> Machine<W> {
    /// Loads an image, and starts it as a boot program does.
    ///
    /// # Errors
    /// Returns one line if the emulator cannot be set up or the image has no code.
    pub fn new(image: &Image, mut chip: Chip<W>) -> Result<Self, EmulatorError> {
        image.load(&mut chip.flash.content);
        let first = image.segments.iter().map(|segment| segment.address).min();
        Self::start(chip, first.ok_or(EmulatorError::NoCode)?)
    }

    /// Powers a chip up: the core begins at the start of the flash.
    ///
    /// # Errors
    /// Returns one line if the emulator cannot be set up.
    pub fn power_up(chip: Chip<W>) -> Result<Self, EmulatorError> {
        Self::start(chip, FLASH.0)
    }

    /// Starts a chip after a reset, from where this machine did: flash and RAM keep their content. After a power cut RAM has
    /// any content.
    ///
    /// # Errors
    /// Returns one line if the emulator cannot be set up.
    pub fn restarted(&self, mut chip: Chip<W>, has_memory: bool) -> Result<Self, EmulatorError> {
        chip.flash = self.chip().flash.after_reset();
        let mut next = Self::start(chip, self.vectors)?;
        for (first, length) in self.memories() {
            let mut content = self.read_memory(first, length as usize);
            if !has_memory {
                // Marsaglia's xorshift over what was there.
                let mut noise = first | 1;
                content.iter_mut().for_each(|byte| {
                    noise ^= noise << 13;
                    noise ^= noise >> 17;
                    noise ^= noise << 5;
                    *byte ^= noise as u8;
                });
            }
            next.write_memory(first, &content);
        }
        Ok(next)
    }

    fn start(mut chip: Chip<W>, vectors: u32) -> Result<Self, EmulatorError> {
        chip.set_vector_table(vectors);
        let context = Context {
            chip,
            blocks: Vec::new(),
            places: [FLASH, CCM].map(|(_, length)| vec![0; length as usize / 2]),
            runs: vec![HandlerRun::default()],
            fpu_in_use: vec![false],
            sequence: 0,
            sleeps: false,
            stop_at: 0,
            leaves_exception: false,
            fault: None,
            profiled: None,
            blocks_of_run: Vec::new(),
            blocks_of_worst: Vec::new(),
            worst: 0,
            calls: Vec::new(),
        };
        let failed = EmulatorError::Processor;
        let mut core = Unicorn::new_with_data(Arch::ARM, Mode::THUMB | Mode::MCLASS, context)
            .map_err(failed)?;
        core.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32).map_err(failed)?;
        let mut ccm =
            vec![0u8; core.get_data().chip.wiring.chip.ccm_bytes as usize].into_boxed_slice();
        map_memory(&mut core, &mut ccm).map_err(failed)?;
        add_hooks(&mut core).map_err(failed)?;
        add_barrier_hooks(&mut core).map_err(failed)?;
        watch_torn(&mut core).map_err(failed)?;
        // No address ends the execution: Unicorn would otherwise discard its code after each run.
        core.ctl_exits_enable().map_err(failed)?;
        let mut content = core.get_data().chip.flash.content.bytes.clone();
        content.truncate(core.get_data().chip.wiring.chip.flash_bytes as usize);
        core.mem_write(FLASH.0.into(), &content).map_err(failed)?;
        let mut machine = Self {
            core,
            _ccm: ccm,
            last_runs: Vec::new(),
            records_runs: false,
            pc: 0,
            thread_stalled_until: 0,
            vectors,
        };
        let ram_bytes = machine.memories()[0].1 as usize;
        machine.write_memory(RAM.0, &PAINT.to_le_bytes().repeat(ram_bytes / 4));
        let stack = machine.word(vectors);
        machine.set(RegisterARM::SP, stack);
        machine.pc = machine.word(vectors + 4) & !1;
        Ok(machine)
    }

    /// Start and length of RAM and of CCM.
    fn memories(&self) -> [(u32, u32); 2] {
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

    /// Time, cycles since the reset.
    pub fn now(&self) -> u64 {
        self.chip().now
    }

    /// Returns true if the core waits for an interrupt.
    pub fn is_asleep(&self) -> bool {
        self.core.get_data().sleeps
    }

    /// Address of the next instruction.
    pub fn pc(&self) -> u32 {
        self.pc
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

    fn set(&mut self, register: RegisterARM, value: u32) {
        self.core.reg_write(register, value.into()).expect("a register of the core");
    }

    fn get(&self, register: RegisterARM) -> u32 {
        self.core.reg_read(register).expect("a register of the core") as u32
    }

    /// Takes the finished handlers since the last call, if they are recorded.
    pub fn take_runs(&mut self) -> Vec<HandlerRun> {
        std::mem::take(&mut self.last_runs)
    }

    /// Takes the cost of thread mode since the last call, without sleep.
    pub fn take_thread_cost(&mut self) -> Cost {
        let runs = &mut self.core.get_data_mut().runs;
        runs.first_mut().map_or(Cost::default(), |thread| std::mem::take(&mut thread.cost))
    }

    /// Records the blocks of this exception. `None` ends the recording.
    pub fn profile(&mut self, exception: Option<usize>) {
        let context = self.core.get_data_mut();
        context.profiled = exception;
        context.worst = 0;
    }

    /// Returns the blocks of the most expensive run since the recording began, by the upper estimate: address and cost.
    pub fn worst_blocks(&self) -> Vec<(u32, Cost)> {
        let context = self.core.get_data();
        let blocks = context.blocks_of_worst.iter();
        blocks.map(|&(place, cost)| (context.blocks[place].address, cost)).collect()
    }

    /// Counts the calls of the functions at these addresses, from now on.
    pub fn count_calls(&mut self, functions: &[u32]) {
        self.core.get_data_mut().calls = functions.iter().copied().map(CallCounter::of).collect();
    }

    /// Takes the calls of each of these functions that ended since the last call.
    pub fn take_calls(&mut self) -> Vec<Vec<Call>> {
        self.core.get_data_mut().calls.iter_mut().map(CallCounter::take).collect()
    }

    /// Continues at this address, as a jump to a wrong place does.
    pub fn jump(&mut self, address: u32) {
        self.pc = address;
        self.core.get_data_mut().sleeps = false;
    }

    /// Moves the stack, as a chain of calls does.
    pub fn set_stack_pointer(&mut self, address: u32) {
        self.set(RegisterARM::SP, address);
    }

    /// Returns true if the memory protection refuses these addresses of the stack to an exception: they are in its
    /// region 0, the only one in use, and it acts (ARMv7-M, B3.5).
    fn refuses_stack(&self, exception: usize, addresses: std::ops::Range<u32>) -> bool {
        let register = |address| self.chip().plain(address);
        let (base, attributes) = (register(MPU_RBAR) & !0x1F, register(MPU_RASR));
        let end = base + (2 << (attributes >> 1 & 0x1F));
        let is_enabled = register(MPU_CTRL) & attributes & 1 == 1;
        is_enabled && exception > HARD_FAULT && addresses.start < end && addresses.end > base
    }

    /// Stops thread mode for this time, cycles; interrupts are taken.
    pub fn stall_thread(&mut self, cycles: u64) {
        self.thread_stalled_until = self.now() + cycles;
    }

    /// Returns the largest use of the stack since the start, bytes, from the words that changed: RAM is painted before the
    /// start.
    pub fn stack_used(&self) -> u32 {
        let memory = self.read_memory(RAM.0, self.memories()[0].1 as usize);
        let words: Vec<_> = memory.chunks_exact(4).collect();
        let untouched = |word: &[u8]| word == PAINT.to_le_bytes();
        // The longest run of painted words lies between the statics and the stack.
        let (mut longest, mut end, mut length) = (0, words.len(), 0);
        for (at, word) in words.iter().enumerate() {
            length = if untouched(word) { length + 1 } else { 0 };
            if length > longest {
                (longest, end) = (length, at + 1);
            }
        }
        4 * (words.len() - end) as u32
    }

    /// Runs for this time, cycles.
    pub fn run(&mut self, cycles: u64) -> StopReason {
        let until = self.now() + cycles;
        loop {
            let now = self.now();
            if now >= self.chip().next_event() {
                self.process_events();
            }
            if self.chip().is_reset_requested() {
                return StopReason::Reset;
            }
            if let Some(exception) = self.takeable() {
                self.enter(exception);
                continue;
            }
            if now >= until {
                return StopReason::Time;
            }
            if self.must_wait(until) {
                continue;
            }
            if let Err(Lockup(reason)) = self.execute(until) {
                return StopReason::Lockup(reason);
            }
        }
    }

    /// Processes the events that are due.
    fn process_events(&mut self) {
        let mut memory = CoreMemory(self.core.clone());
        self.chip_mut().process_events(&mut memory);
    }

    /// Advances time without instructions if the core sleeps or is stalled. Returns true if it did.
    fn must_wait(&mut self, until: u64) -> bool {
        let now = self.now();
        let stalled = self.thread_stalled_until;
        let context = self.core.get_data_mut();
        if context.sleeps && context.chip.nvic.wakes() {
            context.sleeps = false;
        }
        let is_thread = context.chip.nvic.depth() == 0;
        let mut target = until.min(context.chip.next_event());
        if is_thread && stalled > now {
            target = target.min(stalled);
        } else if !context.sleeps {
            return false;
        }
        context.chip.now = target.max(now + 1);
        true
    }

    fn execute(&mut self, until: u64) -> Result<(), Lockup> {
        let start = u64::from(self.pc | 1);
        self.core.get_data_mut().stop_at = until;
        let result = self.core.emu_start(start, 0, 0, 0);
        self.pc = self.get(RegisterARM::PC) & !1;
        follow_flash(&mut self.core);
        let context = self.core.get_data_mut();
        context.chip.update_lines();
        if let Some(reason) = context.fault.take() {
            return self.fault(reason);
        }
        if std::mem::take(&mut context.leaves_exception) {
            return self.leave();
        }
        match result {
            Ok(()) => Ok(()),
            Err(_) if self.pc >= RETURN_BASE => self.leave(),
            Err(error) => self.fault(format!("{error:?} at {:#x}", self.pc)),
        }
    }

    fn fault(&mut self, reason: String) -> Result<(), Lockup> {
        if self.chip().nvic.current() == HARD_FAULT || self.chip().nvic.is_active(HARD_FAULT) {
            return Err(Lockup(reason));
        }
        self.chip_mut().last_fault = Some(reason);
        self.enter(HARD_FAULT);
        Ok(())
    }

    fn takeable(&self) -> Option<usize> {
        self.chip().ready_exception().filter(|&exception| is_allowed(&self.core, exception))
    }

    /// Takes an exception: it saves the state on the stack and continues at the handler.
    fn enter(&mut self, exception: usize) {
        let uses_fpu = self.core.get_data().fpu_in_use.last().copied().unwrap_or(false);
        let words: u32 = if uses_fpu { 26 } else { 8 };
        let stack = self.get(RegisterARM::SP);
        // Its aliases with flags in their names can only be written.
        let status = self.get(RegisterARM::XPSR) | 1 << 24;
        let frame = (stack - 4 * words) & !7;
        if self.refuses_stack(exception, frame..stack) {
            self.chip_mut().write(CFSR, 4, STACKING_REFUSED);
            self.chip_mut().last_fault = Some(format!("stack at {frame:#x}"));
            return self.enter(HARD_FAULT);
        }
        let is_realigned = frame + 4 * words != stack;
        use RegisterARM::{LR, R0, R1, R2, R3, R12};
        let mut saved: Vec<u32> =
            [R0, R1, R2, R3, R12, LR].into_iter().map(|register| self.get(register)).collect();
        saved.push(self.pc);
        saved.push(status | u32::from(is_realigned) << 9);
        if uses_fpu {
            saved.extend((0..16).map(|number| self.get_float(number)));
            saved.push(self.get(RegisterARM::FPSCR));
            saved.push(0);
        }
        let bytes: Vec<u8> = saved.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.write_memory(frame, &bytes);
        self.set(RegisterARM::SP, frame);
        let is_nested = self.chip().nvic.depth() > 0;
        let link =
            0xFFFF_FFE1 | if is_nested { 0 } else { 8 } | if uses_fpu { 0 } else { FPU_ACTIVE };
        self.set(RegisterARM::LR, link);
        self.set(RegisterARM::XPSR_NZCVQG, 1 << 24 | exception as u32);
        self.pc = self.word(self.chip().vector_table() + 4 * exception as u32) & !1;
        let context = self.core.get_data_mut();
        context.sleeps = false;
        context.chip.nvic.enter(exception);
        context.chip.update_lines();
        context.fpu_in_use.push(false);
        context.sequence = self.pc;
        let from = context.chip.now;
        let mut cost = cycles::EXCEPTION_ENTRY;
        if uses_fpu {
            cost.lower += cycles::LAZY_STACKING.lower;
            cost.upper += cycles::LAZY_STACKING.upper;
        }
        context.chip.now += u64::from(cost.upper);
        context.runs.push(HandlerRun { exception, cost, instructions: 0, from, until: 0 });
    }

    /// Returns from an exception: it restores the state from the stack.
    fn leave(&mut self) -> Result<(), Lockup> {
        let link = self.pc | 1;
        let context = self.core.get_data_mut();
        if context.chip.nvic.depth() == 0 {
            return Err(Lockup("return from an exception in thread mode".into()));
        }
        context.chip.nvic.leave();
        context.fpu_in_use.pop();
        let has_fpu = link & FPU_ACTIVE == 0;
        if let Some(present) = context.fpu_in_use.last_mut() {
            *present = has_fpu;
        }
        let mut cost = cycles::EXCEPTION_RETURN;
        if has_fpu {
            cost.lower += cycles::LAZY_STACKING.lower;
            cost.upper += cycles::LAZY_STACKING.upper;
        }
        context.chip.now += u64::from(cost.upper);
        if let Some(mut run) = context.runs.pop() {
            run.cost.lower = run.cost.lower.saturating_add(cost.lower);
            run.cost.upper = run.cost.upper.saturating_add(cost.upper);
            run.until = context.chip.now;
            if context.profiled == Some(run.exception) {
                if run.cost.upper > context.worst {
                    context.worst = run.cost.upper;
                    std::mem::swap(&mut context.blocks_of_worst, &mut context.blocks_of_run);
                }
                context.blocks_of_run.clear();
            }
            if self.records_runs {
                self.last_runs.push(run);
            }
        }
        self.unstack(has_fpu);
        let context = self.core.get_data_mut();
        context.sequence = self.pc;
        context.chip.update_lines();
        Ok(())
    }

    fn unstack(&mut self, has_fpu: bool) {
        let frame = self.get(RegisterARM::SP);
        let word = |machine: &Self, at: u32| machine.word(frame + 4 * at);
        use RegisterARM::{LR, R0, R1, R2, R3, R12};
        for (at, register) in [R0, R1, R2, R3, R12, LR].into_iter().enumerate() {
            let value = word(self, at as u32);
            self.set(register, value);
        }
        self.pc = word(self, 6) & !1;
        let status = word(self, 7);
        if has_fpu {
            for number in 0..16 {
                let value = word(self, 8 + number);
                self.set_float(number, value);
            }
            let fpscr = word(self, 24);
            self.set(RegisterARM::FPSCR, fpscr);
        }
        let words = if has_fpu { 26 } else { 8 };
        let realigned = if status >> 9 & 1 == 1 { 4 } else { 0 };
        self.set(RegisterARM::SP, frame + 4 * words + realigned);
        self.set(RegisterARM::XPSR_NZCVQG, status & !(1 << 9));
    }

    fn get_float(&self, number: u32) -> u32 {
        let read = self.core.reg_read(RegisterARM::S0 as i32 + number as i32);
        read.expect("a register of the FPU") as u32
    }

    fn set_float(&mut self, number: u32, value: u32) {
        let written = self.core.reg_write(RegisterARM::S0 as i32 + number as i32, value.into());
        written.expect("a register of the FPU");
    }
}
