//! The bench runs to fit and to evaluate.

use joint_log::Dataset;
use joint_rig::simulated::dataset;
use paper_machines::bench::{Amount, Bench};
use simulated_machines::Log;

/// The bench runs of one machine.
#[derive(Clone, Debug)]
pub struct BenchRuns {
    /// Runs without side load and pressure.
    pub unloaded: Dataset,
    /// All runs to fit: unloaded runs, the factorial, and some repeats of the eight kinds.
    pub all: Dataset,
    /// Runs to diagnose: unloaded runs and the factorial, in which every covariate varies.
    pub diagnosed: Dataset,
    /// Other repeats of the eight kinds, for evaluation.
    pub held_out: Dataset,
}

impl BenchRuns {
    /// Measures a machine on the bench.
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
