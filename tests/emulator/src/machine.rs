//! The core: it executes instructions, takes exceptions and advances time.
//!
//! Unicorn executes until an event is due, an exception can be taken, or the core sleeps; this module decides what
//! follows. An event or an exception is taken between two basic blocks.

mod access;
mod exceptions;

use crate::calls::{Call, CallCounter};
use crate::chip::Chip;
use crate::cycles::Cost;
use crate::error::EmulatorError;
pub use crate::execution::{CCM, FLASH, HandlerRun, RAM};
use crate::execution::{
    Context, CoreMemory, RETURN_BASE, add_barrier_hooks, add_hooks, follow_flash, map_memory,
    watch_torn,
};
use crate::image::Image;
use crate::world::World;
use unicorn_engine::{Arch, ArmCpuModel, Mode, RegisterARM, Unicorn};

/// Content of RAM before the start.
const PAINT: u32 = 0xA5A5_5A5A;

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
}
