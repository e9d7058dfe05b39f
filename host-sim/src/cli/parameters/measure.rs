//! What a measurement and a friction run share: their arguments, limits, orders and reasons to end.

use super::{Driver, sdo_message};
use canopen_rs::Address;
use clap::Args;
use firmware::driver::commissioning::AbortReason;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject;
use std::io::{BufRead, IsTerminal, Write};
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
    measure: bool,
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
    /// Returns true if the motor is to be measured.
    pub(super) fn is_requested(&self) -> bool {
        self.measure
    }

    /// Returns the path of the friction run's trace; `None` without `--friction-run`.
    pub(super) fn friction_trace(&self) -> Result<Option<PathBuf>, String> {
        if !self.friction_run {
            return Ok(None);
        }
        trace_path(self.out.as_deref().unwrap_or(Path::new("out"))).map(Some)
    }

    /// Checks the options that require a run.
    ///
    /// # Errors
    /// Returns one line if `--current` or `--yes` is given without a run.
    pub(super) fn check(&self) -> Result<(), String> {
        let given = self.current.is_some() || self.yes;
        if given && !self.measure && !self.friction_run {
            return Err("--current, --yes: require --measure or --friction-run".into());
        }
        Ok(())
    }

    /// Asks the user a question and returns true for yes. With `--yes`, the question is not asked.
    pub(super) fn is_confirmed(&self, question: &str) -> Result<bool, String> {
        if self.yes {
            return Ok(true);
        }
        if !std::io::stdin().is_terminal() {
            return Err(format!(
                "{question} Standard input is not a terminal: use --yes to confirm"
            ));
        }
        eprint!("{question} [y/N] ");
        let _ = std::io::stderr().flush();
        let mut answer = String::new();
        std::io::stdin().lock().read_line(&mut answer).map_err(|error| error.to_string())?;
        Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
    }
}

/// File name of the trace.
const TRACE_FILE: &str = "trace.log";

/// Creates the folder and returns the path of the trace.
fn trace_path(out: &Path) -> Result<PathBuf, String> {
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    Ok(out.join(TRACE_FILE))
}

impl Driver {
    /// Writes the limits of a run to the driver.
    pub(super) fn set_limits(
        &mut self,
        how: &MeasureArguments,
        travel: Option<f32>,
    ) -> Result<(), String> {
        use CommissioningRunObject as R;
        for (place, value) in
            [(R::CURRENT, how.current), (R::TRAVEL, travel), (R::SPEED, how.speed)]
        {
            if let Some(value) = value {
                let at = Address::new(index::COMMISSIONING_RUN, place);
                self.client.write(at, &value.to_le_bytes()).map_err(sdo_message)?;
            }
        }
        Ok(())
    }

    pub(super) fn order(&mut self, order: u8) -> Result<(), String> {
        let at = Address::new(index::COMMISSIONING_RUN, CommissioningRunObject::ORDER);
        self.client.write(at, &[order]).map_err(sdo_message)
    }

    pub(super) fn float(&mut self, place: u8) -> Result<f32, String> {
        self.number(index::COMMISSIONING_RUN, place).map(f32::from_bits)
    }

    /// Returns the reason why a run ended, as one line.
    pub(super) fn end_reason(&mut self) -> Result<String, String> {
        let number = self.number(index::COMMISSIONING_RUN, CommissioningRunObject::REASON)? as u8;
        let (name, meaning) = AbortReason::describe(number)
            .unwrap_or(("unknown", "reason of another firmware version"));
        let faults = super::status::codes(self.number(index::STATE, 3)?, 1);
        let faults =
            if faults.is_empty() { String::new() } else { format!(" ({})", faults.join(", ")) };
        Ok(format!(
            "ended: {name}: {meaning}{faults}; the bridge is open, no parameter was changed"
        ))
    }
}
