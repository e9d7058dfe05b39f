//! What is asked of a simulation, and what it gives.

use crate::log::Log;
use crate::scenarios::Hide;
use serde_json::Value;

/// What is asked of a simulation. What is `None` is drawn, or the simulation's own.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// The same seed and request, the same log.
    pub seed: u64,
    /// Number of runs.
    pub runs: Option<usize>,
    /// Length of each, s.
    pub seconds: Option<f64>,
    /// Sample rate, Hz.
    pub rate_hz: Option<f64>,
    /// Standard deviation of the torque sensor, Nm.
    pub noise_nm: Option<f64>,
    /// No side load and no pressure.
    pub unloaded: bool,
    /// Steady sliding only.
    pub steady: bool,
    /// What is to be hidden in it.
    pub hide: Vec<Hide>,
}

/// A log and the truth behind it.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// What was logged.
    pub log: Log,
    /// The same as `data.csv`, rounded as its sensors round.
    pub csv: String,
    /// `truth.json`.
    pub truth: Value,
    /// What is hidden, a line each; empty where nothing was asked to be.
    pub hidden: Vec<String>,
}

/// A machine, or an experiment on one.
pub trait Simulation: Sync {
    /// Its name on the command line and in `truth.json`.
    fn name(&self) -> &'static str;

    /// What it is, in a sentence without its end.
    fn about(&self) -> &'static str;

    /// Runs it.
    ///
    /// # Errors
    /// One line: what of the request it cannot do.
    fn simulate(&self, request: &Request) -> Result<Simulated, String>;
}
