//! Exceptions of the core: faults, entry with stacking, and return (DDI 0403, B1.5). Only the main stack is used, as by the
//! image.
//!
//! An entry saves eight words, or 26 if the floating-point unit is in use, and the return value tells the return which. The
//! memory protection may refuse the stack to it, which is a hard fault.

use super::{Lockup, Machine};
use crate::cycles;
use crate::execution::{HandlerRun, is_allowed};
use crate::nvic::HARD_FAULT;
use crate::world::World;
use unicorn_engine::RegisterARM;

/// Bit of a return value whose absence states that the frame holds the registers of the FPU.
const FPU_ACTIVE: u32 = 1 << 4;

/// Memory protection unit: control, base address and attributes of region 0.
const MPU_CTRL: u32 = 0xE000_ED94;
const MPU_RBAR: u32 = 0xE000_ED9C;
const MPU_RASR: u32 = 0xE000_EDA0;
/// Status of faults, and its bit for the stack of an exception.
const CFSR: u32 = 0xE000_ED28;
const STACKING_REFUSED: u32 = 1 << 4;

impl<W: World + 'static> Machine<W> {
    /// Returns true if the memory protection refuses these addresses of the stack to an exception: they are in its
    /// region 0, the only one in use, and it acts (ARMv7-M, B3.5).
    fn refuses_stack(&self, exception: usize, addresses: std::ops::Range<u32>) -> bool {
        let register = |address| self.chip().plain(address);
        let (base, attributes) = (register(MPU_RBAR) & !0x1F, register(MPU_RASR));
        let end = base + (2 << (attributes >> 1 & 0x1F));
        let is_enabled = register(MPU_CTRL) & attributes & 1 == 1;
        is_enabled && exception > HARD_FAULT && addresses.start < end && addresses.end > base
    }

    /// Takes a hard fault, or locks the core up if its handler is active.
    pub(super) fn fault(&mut self, reason: String) -> Result<(), Lockup> {
        if self.chip().nvic.current() == HARD_FAULT || self.chip().nvic.is_active(HARD_FAULT) {
            return Err(Lockup(reason));
        }
        self.chip_mut().last_fault = Some(reason);
        self.enter(HARD_FAULT);
        Ok(())
    }

    /// Returns the exception that preempts now.
    pub(super) fn takeable(&self) -> Option<usize> {
        self.chip().ready_exception().filter(|&exception| is_allowed(&self.core, exception))
    }

    /// Takes an exception: it saves the state on the stack and continues at the handler.
    pub(super) fn enter(&mut self, exception: usize) {
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
            cost.add(cycles::LAZY_STACKING);
        }
        context.chip.now += u64::from(cost.upper);
        context.runs.push(HandlerRun { exception, cost, instructions: 0, from, until: 0 });
    }

    /// Returns from an exception: it restores the state from the stack.
    pub(super) fn leave(&mut self) -> Result<(), Lockup> {
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
            cost.add(cycles::LAZY_STACKING);
        }
        context.chip.now += u64::from(cost.upper);
        if let Some(mut run) = context.runs.pop() {
            run.cost.add(cost);
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

    /// Restores the state that the exception has saved. `has_fpu` is true if that of the FPU is part of it.
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
}
