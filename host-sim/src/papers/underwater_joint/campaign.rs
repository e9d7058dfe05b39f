//! The bench runs: what is learned from, and what is judged by.

use crate::simulated::dataset;
use friction_identification::data::Dataset;
use simulated_machines::Log;
use simulated_machines::joint_plant::Bench;
use simulated_machines::joint_plant::bench::Amount;

/// The bench runs of one machine.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// Without side load and pressure.
    pub unloaded: Dataset,
    /// All that is learned from: the unloaded runs, the factorial, some repeats of the eight kinds.
    pub all: Dataset,
    /// What the diagnosis looks at: unloaded runs and factorial, in which everything moves.
    pub diagnosed: Dataset,
    /// Other repeats of the eight kinds: no fit has seen them.
    pub held_out: Dataset,
}

impl Campaign {
    /// Measures a machine.
    pub fn measure(bench: &Bench, amount: &Amount) -> Self {
        let measured = bench.measure(amount);
        let mut all: Log = measured.unloaded.clone();
        all.runs.extend(measured.factorial.runs);
        let diagnosed = dataset(&all);
        all.runs.extend(measured.learned.runs);
        Self {
            unloaded: dataset(&measured.unloaded),
            all: dataset(&all),
            diagnosed,
            held_out: dataset(&measured.held_out),
        }
    }
}
