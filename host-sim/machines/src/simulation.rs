//! Request and result of a simulation.

use crate::log::Log;
use crate::scenarios::Hide;
use serde_json::Value;

/// Options of a simulation. `None` selects a random value or the default of the simulation.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Seed. The same seed and request give the same log.
    pub seed: u64,
    /// Number of runs.
    pub runs: Option<usize>,
    /// Length of each run, s.
    pub seconds: Option<f64>,
    /// Sample rate, Hz.
    pub rate_hz: Option<f64>,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: Option<f64>,
    /// True to simulate without side load and pressure.
    pub unloaded: bool,
    /// True to simulate steady sliding only.
    pub steady: bool,
    /// Effects to hide.
    pub hide: Vec<Hide>,
}

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// The log.
    pub log: Log,
    /// Content of `data.csv`, rounded to the resolution of the sensors.
    pub csv: String,
    /// Content of `truth.json`.
    pub truth: Value,
    /// Description of the hidden effects, one line each. Empty if the request hides none.
    pub hidden: Vec<String>,
}

/// A machine, or an experiment on one.
pub trait Simulation: Sync {
    /// Returns the name on the command line and in `truth.json`.
    fn name(&self) -> &'static str;

    /// Returns a description: one sentence without a full stop.
    fn about(&self) -> &'static str;

    /// Runs the simulation.
    ///
    /// # Errors
    /// Returns a message of one line if the simulation does not support the request.
    fn simulate(&self, request: &Request) -> Result<Simulated, String>;
}
