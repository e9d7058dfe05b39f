//! Costs of the image in closed loop: the current loop's interrupt, its parts, and the background's tick.

use crate::cycles::Cost;
use crate::machine::{HandlerRun, Machine};
use crate::world::World;

/// Exception number of the current loop's interrupt: ADC1_2.
pub const LOOP_EXCEPTION: usize = 16 + 18;

/// Largest and total costs since the recording began.
#[derive(Clone, Debug, Default)]
pub struct Costs {
    /// Most expensive run of the interrupt, each estimate for itself.
    pub worst: Cost,
    /// Sum of all runs.
    pub total: [u64; 2],
    /// Number of runs.
    pub runs: u64,
    /// Largest number of instructions of a run.
    pub instructions: u32,
    /// Latest end of a run after the trigger of its period, by the upper estimate, cycles.
    pub latest_end: u64,
    /// Most expensive millisecond of the background, without interrupts.
    pub background: Cost,
    /// Blocks of the most expensive run: address and cost. They lack entry, return and registers.
    pub blocks: Vec<(u32, Cost)>,
}

impl Costs {
    /// Adds what a machine recorded in the last millisecond. `period` is that of the PWM, cycles; `top` the time of one
    /// of its triggers.
    pub fn add<W: World>(&mut self, machine: &mut Machine<W>, period: u64) {
        let top = machine.chip().timer1.last_trigger();
        for run in machine.take_runs() {
            if run.exception == LOOP_EXCEPTION {
                self.add_run(&run, top, period);
            }
        }
        let background = machine.take_thread_cost();
        self.background.lower = self.background.lower.max(background.lower);
        self.background.upper = self.background.upper.max(background.upper);
    }

    fn add_run(&mut self, run: &HandlerRun, top: u64, period: u64) {
        self.worst.lower = self.worst.lower.max(run.cost.lower);
        self.worst.upper = self.worst.upper.max(run.cost.upper);
        self.total[0] += u64::from(run.cost.lower);
        self.total[1] += u64::from(run.cost.upper);
        self.instructions = self.instructions.max(run.instructions);
        self.runs += 1;
        // All triggers have the same phase.
        let since_trigger = (run.from + period - top % period) % period;
        self.latest_end = self.latest_end.max(since_trigger + (run.until - run.from));
    }
}
