//! Request and result of a simulation.

use crate::log::Log;
use crate::scenarios::{Hide, HideError};
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

impl Request {
    /// Refuses the options that only the simulation `underwater-joint` has.
    ///
    /// # Errors
    /// Returns an error if the request has one of them.
    pub fn refuse_effects(&self) -> Result<(), SimulationError> {
        let options = if !self.hide.is_empty() {
            "--hide: this machine has its own effects; use --hide with `underwater-joint`"
        } else if self.unloaded || self.steady {
            "--unloaded, --steady: only supported by `underwater-joint`"
        } else {
            return Ok(());
        };
        Err(SimulationError::Unsupported { options })
    }
}

/// A simulated log and its ground truth.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// The log.
    pub log: Log,
    /// Content of `truth.json`.
    pub truth: Value,
    /// Description of the hidden effects, one line each. Empty if the request hides none.
    pub hidden: Vec<String>,
}

/// Why a simulation is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// The effects cannot be hidden in one log.
    #[error(transparent)]
    Hide(#[from] HideError),
    /// The log would have too many rows.
    #[error("--runs x --seconds x --rate: more than {} rows", rows(*most))]
    TooManyRows {
        /// Largest number of rows.
        most: f64,
    },
    /// The log with hidden effects would have too many rows.
    #[error("--runs x --seconds x --rate: more than {} rows with --hide", rows(*most))]
    TooManyRowsWithHide {
        /// Largest number of rows.
        most: f64,
    },
    /// The log would be too long.
    #[error("--runs x --seconds: more than {most_s} s with --hide")]
    TooLong {
        /// Longest time, s.
        most_s: f64,
    },
    /// The machine does not support an option.
    #[error("{options}")]
    Unsupported {
        /// The options, and where they are supported.
        options: &'static str,
    },
    /// The value of an option is not supported.
    #[error("{option} {found}: expected {expected}")]
    Value {
        /// The option, after the name of the machine if its values depend on it.
        option: &'static str,
        /// Found value.
        found: f64,
        /// Supported values.
        expected: String,
    },
}

/// Returns a number of rows, short if it is large.
fn rows(count: f64) -> String {
    if count < 1e8 { count.to_string() } else { format!("{count:e}") }
}

/// A machine, or an experiment on one.
#[derive(Clone, Copy, Debug)]
pub struct Simulation {
    /// Name on the command line and in `truth.json`.
    pub name: &'static str,
    /// Description: one sentence without a full stop.
    pub about: &'static str,
    /// See [`Simulation::simulate`].
    pub run: fn(&Request) -> Result<Simulated, SimulationError>,
}

impl Simulation {
    /// Runs the simulation.
    ///
    /// # Errors
    /// Returns an error if the simulation does not support the request.
    pub fn simulate(&self, request: &Request) -> Result<Simulated, SimulationError> {
        (self.run)(request)
    }
}
