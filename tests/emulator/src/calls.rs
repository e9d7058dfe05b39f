//! What each call of a function takes, with the functions that it calls, and without the exceptions that preempt it.

use crate::cycles::Cost;

/// An address at which no instruction is.
const NOWHERE: u32 = 1;

/// A finished call.
#[derive(Clone, Copy, Debug, Default)]
pub struct Call {
    /// Number of instructions, from the first of the function to its return.
    pub instructions: u32,
    /// Cycles.
    pub cost: Cost,
}

/// Counts the calls of a function.
#[derive(Debug)]
pub(crate) struct CallCounter {
    /// Address of the function, and of the instruction after the present call.
    entry: u32,
    return_to: u32,
    /// Depth of exceptions, and what its context had taken, at the begin of the present call.
    begin: (usize, Call),
    finished: Vec<Call>,
}

impl CallCounter {
    /// Creates the counter of the function at this address.
    pub fn of(entry: u32) -> Self {
        let begin = (0, Call::default());
        Self { entry, return_to: NOWHERE, begin, finished: Vec::new() }
    }

    /// Returns true if a block at this address begins or ends a call.
    pub const fn is_at(&self, address: u32) -> bool {
        address == self.entry || address == self.return_to
    }

    /// Begins a call whose link register is `link`, or ends it, at this depth of exceptions. `taken` is what its context has
    /// taken so far.
    pub fn reach(&mut self, address: u32, link: u32, depth: usize, taken: Call) {
        if address == self.entry {
            self.return_to = link & !1;
            self.begin = (depth, taken);
        } else if depth == self.begin.0 {
            let begin = &self.begin.1;
            let cost = Cost {
                lower: taken.cost.lower.saturating_sub(begin.cost.lower),
                upper: taken.cost.upper.saturating_sub(begin.cost.upper),
            };
            let instructions = taken.instructions.saturating_sub(begin.instructions);
            self.finished.push(Call { instructions, cost });
            self.return_to = NOWHERE;
        }
    }

    /// Takes the calls that ended since the last call of this function.
    pub fn take(&mut self) -> Vec<Call> {
        std::mem::take(&mut self.finished)
    }
}
