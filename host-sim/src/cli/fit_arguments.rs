//! Command-line arguments of the commands that fit models: rigid-body parts, held-out rows, loss, seed.

use super::error::Result;
use clap::Args;
use friction_diagnose::prepare::PrepareOptions;
use friction_fit::Loss;
use friction_fit::spec::parse_rigid_body;
use joint_log::SplitRule;
use std::path::PathBuf;

/// How models are fitted to logs and judged on them.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Fit and held-out rows")]
pub struct FitArguments {
    /// Rigid-body parts of the torque besides friction: inertia,gravity,load,offset,delay,gain
    #[arg(long, value_name = "PARTS", default_value = "", hide_default_value = true)]
    pub rigid_body: String,
    /// Files to hold out
    ///
    /// By default whole runs are held out, or time blocks of a single run; `diagnose` holds out each run once.
    #[arg(long, value_name = "DATA", num_args = 1..)]
    pub test: Vec<PathBuf>,
    /// Hold out the runs where COLUMN has one of the values
    ///
    /// COLUMN is `run` or a column that is constant within each run.
    #[arg(long, value_name = "COLUMN=VALUE,..", conflicts_with_all = ["test", "tail"])]
    pub hold_out: Option<String>,
    /// Hold out the end of each run; SHARE is between 0 and 1
    #[arg(long, value_name = "SHARE", conflicts_with = "test", hide_short_help = true)]
    pub tail: Option<f64>,
    /// Use every N-th sample of the residual, after an anti-aliasing filter; the simulation runs at the full rate
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000), hide_short_help = true)]
    pub decimate: u32,
    /// Loss of the fits
    ///
    /// `squares`; `huber`, where errors of single rows beyond 2.5 standard deviations count linearly; `auto` uses huber if the
    /// torque has many spikes.
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = LossChoice::Auto, hide_short_help = true)]
    pub loss: LossChoice,
    /// Seed of the choice of held-out runs; the same seed gives the same result
    #[arg(long, value_name = "N", default_value_t = 0, hide_short_help = true)]
    pub seed: u64,
}

impl FitArguments {
    /// Completes the options of reading with those of the fit. `default_split` applies if the user gives no split.
    ///
    /// # Errors
    /// Returns one line for the user.
    pub fn complete(
        &self,
        reading: PrepareOptions,
        default_split: &SplitRule,
    ) -> Result<PrepareOptions> {
        Ok(PrepareOptions {
            split: self.split_rule(default_split)?,
            seed: self.seed,
            rigid_body: parse_rigid_body(&self.rigid_body)?,
            decimate: self.decimate.max(1) as usize,
            loss: match self.loss {
                LossChoice::Auto => None,
                LossChoice::Squares => Some(Loss::Squares),
                LossChoice::Huber => Some(Loss::Huber),
            },
            ..reading
        })
    }

    /// Returns the rule that the user gave, or `default_split`.
    fn split_rule(&self, default_split: &SplitRule) -> Result<SplitRule> {
        if !self.test.is_empty() {
            return Ok(SplitRule::Files(self.test.clone()));
        }
        if let Some(text) = &self.hold_out {
            return Ok(SplitRule::parse_hold_out(text)?);
        }
        Ok(self.tail.map_or_else(|| default_split.clone(), |share| SplitRule::Tail { share }))
    }
}

/// Loss of the fits.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LossChoice {
    /// Huber's loss if the torque has many spikes, else squares.
    #[default]
    Auto,
    /// Squared errors.
    Squares,
    /// Huber's loss.
    Huber,
}
