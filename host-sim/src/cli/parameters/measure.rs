//! What a measurement and a friction run share: their arguments, limits, orders and reasons to end.
//!
//! Both are run by the driver, which keeps the limits that are written to it before (objects of
//! [`CommissioningRunObject`]). An order starts the run, orders to continue keep it alive, and it ends by itself, by the order
//! to stop, or without an order for 0.1 s. Then the driver states the reason.

use super::{Driver, Result};
use crate::cli::error::{Refusal, in_file, unfit};
use crate::cli::output::is_answered_yes;
use canopen_rs::Address;
use clap::Args;
use firmware::driver::commissioning::AbortReason;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject;
use joint_bus::codes::{FIRST_FAULT, code_names};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Period of the keep-alive orders.
pub(super) const KEEP_ALIVE_PERIOD: Duration = Duration::from_millis(20);

/// Order that stops a run.
pub(super) const ORDER_STOP: u8 = 0;
/// Order that keeps a run alive.
pub(super) const ORDER_CONTINUE: u8 = 2;

/// Arguments of a measurement and of a friction run.
#[derive(Args)]
pub(super) struct MeasureArguments {
    /// Measure the motor at low current: THE JOINT MOVES
    ///
    /// The results are shown, and stored and confirmed after you answer yes.
    #[arg(long)]
    pub(super) measure: bool,
    /// Stroke through the range and write a trace for `identify`: THE JOINT MOVES
    ///
    /// The joint moves through its range in both directions at decreasing speeds. It must be commissioned; with --measure,
    /// that is done first. No parameter is changed.
    #[arg(long)]
    friction_run: bool,
    /// Maximum current of a run, A [default: 30 % of the motor's current limit]
    #[arg(long, value_name = "A")]
    current: Option<f32>,
    /// Maximum travel of the joint to either side during the measurement, rad [default: 0.5]
    #[arg(long, value_name = "RAD", requires = "measure")]
    pub(super) travel: Option<f32>,
    /// Maximum travel to either side of the start position during the friction run, rad [default: 0.5]
    #[arg(long, value_name = "RAD", requires = "friction_run")]
    pub(super) range: Option<f32>,
    /// Speed of the first strokes of the friction run, rad/s [default: 2]
    #[arg(long, value_name = "RAD/S", requires = "friction_run")]
    speed: Option<f32>,
    /// Folder for the friction run's trace.log; it is created if missing [default: out]
    #[arg(long, value_name = "DIR", requires = "friction_run")]
    out: Option<PathBuf>,
    /// Do not ask for confirmation: move the joint, then store and confirm the results
    #[arg(long)]
    yes: bool,
}

impl MeasureArguments {
    /// Creates the folder of the friction run's trace, and returns its path; `None` without `--friction-run`.
    pub(super) fn friction_trace(&self) -> Result<Option<PathBuf>> {
        if !self.friction_run {
            return Ok(None);
        }
        let out = self.out.as_deref().unwrap_or(Path::new("out"));
        std::fs::create_dir_all(out).map_err(in_file(out))?;
        Ok(Some(out.join(TRACE_FILE)))
    }

    /// Checks the options that require a run.
    ///
    /// # Errors
    /// Returns one line if `--current` or `--yes` is given without a run.
    pub(super) fn check(&self) -> Result {
        let given = self.current.is_some() || self.yes;
        if given && !self.measure && !self.friction_run {
            return Err(unfit("--current, --yes", "require --measure or --friction-run"));
        }
        Ok(())
    }

    /// Asks the user a question and returns true for yes. With `--yes`, the question is not asked.
    pub(super) fn is_confirmed(&self, question: &str) -> Result<bool> {
        if self.yes {
            return Ok(true);
        }
        if !std::io::stdin().is_terminal() {
            return Err(Refusal::NoTerminal(question.to_owned()).into());
        }
        Ok(is_answered_yes(question)?)
    }
}

/// A run that ended early.
#[derive(Debug, thiserror::Error)]
#[error("ended: {name}: {meaning}{faults}; the bridge is open, no parameter was changed")]
pub(super) struct RunEnded {
    name: &'static str,
    meaning: &'static str,
    /// The faults in brackets; empty without any.
    faults: String,
}

/// File name of the trace.
const TRACE_FILE: &str = "trace.log";

impl Driver {
    /// Writes the limits of a run to the driver.
    pub(super) fn set_limits(&mut self, how: &MeasureArguments, travel: Option<f32>) -> Result {
        use CommissioningRunObject as R;
        for (place, value) in
            [(R::CURRENT, how.current), (R::TRAVEL, travel), (R::SPEED, how.speed)]
        {
            if let Some(value) = value {
                let at = Address::new(index::COMMISSIONING_RUN, place);
                self.client.write(at, &value.to_le_bytes())?;
            }
        }
        Ok(())
    }

    pub(super) fn order(&mut self, order: u8) -> Result {
        let at = Address::new(index::COMMISSIONING_RUN, CommissioningRunObject::ORDER);
        Ok(self.client.write(at, &[order])?)
    }

    pub(super) fn float(&mut self, place: u8) -> Result<f32> {
        self.number(index::COMMISSIONING_RUN, place).map(f32::from_bits)
    }

    /// Returns the reason why a run ended.
    pub(super) fn end_reason(&mut self) -> Result<RunEnded> {
        let number = self.number(index::COMMISSIONING_RUN, CommissioningRunObject::REASON)? as u8;
        let (name, meaning) = AbortReason::describe(number)
            .unwrap_or(("unknown", "reason of another firmware version"));
        let faults = code_names(self.number(index::STATE, 3)?, FIRST_FAULT);
        let faults =
            if faults.is_empty() { String::new() } else { format!(" ({})", faults.join(", ")) };
        Ok(RunEnded { name, meaning, faults })
    }
}
