//! `tune --from TOOL LOG..`: a friction feed-forward for a drive of another maker, from a log of its own tool.
//!
//! The drive cannot be commanded from here. So the log must hold the standard motion, and the trial is left to the user.

use super::each_joint::{JointResult, each_joint};
use super::error::{Result, found};
use super::fit_arguments::FitArguments;
use super::input::{DataArguments, LogArguments, MotionFrom};
use super::output::OutputArguments;
use clap::Args;
use friction_diagnose::prepare::Prepared;
use friction_results::feed_forward::{Drive, FeedForward, fit_for_feed_forward};
use joint_log::log_check::LogFindingKind;
use joint_log::{Preset, Quantity, SplitRule, TorqueConstant};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Rigid-body parts of the torque, unless the user gives others. Gravity is added if the log shows it.
const RIGID_BODY: &str = "inertia,offset";

/// The tool that recorded the log.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForeignTool {
    /// tview, register dumps or Python of mjbots' moteus, or candump of its bus
    Moteus,
    /// odrivetool or Python of ODrive, or candump of its CAN Simple bus
    #[value(name = "odrive")]
    ODrive,
    /// candump of a joint of this project, an ODrive or a moteus
    Candump,
}

/// Logs of drives of other makers.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Logs of other drives")]
pub struct ForeignArguments {
    /// Logs of the standard motion, recorded with the drive's own tool
    #[arg(value_name = "LOG", requires = "from")]
    pub logs: Vec<PathBuf>,
    /// Make a friction feed-forward for another drive, from the logs of this tool
    #[arg(long, value_name = "TOOL", value_enum, requires = "logs")]
    pub from: Option<ForeignTool>,
    /// Names and units of columns that the tool's preset does not know, as in `identify`
    #[arg(long, value_name = "a=b:unit,..", value_delimiter = ',', requires = "from")]
    pub columns: Vec<String>,
    /// Torque of one ampere, for logs of a current: the drive's own torque constant
    #[arg(long, value_name = "Nm/A", value_parser = TorqueConstant::parse, requires = "from")]
    pub torque_constant: Option<TorqueConstant>,
    /// Read one joint of a log with several: its number or name
    #[arg(long, value_name = "JOINT", requires = "from")]
    pub joint: Option<String>,
    /// Rigid-body parts of the torque besides friction; by default inertia, offset and, if the log shows it, gravity
    #[arg(long, value_name = "PARTS", requires = "from", hide_short_help = true)]
    pub rigid_body: Option<String>,
    /// Files to hold out; by default whole runs, or time blocks of a single run
    #[arg(long, value_name = "LOG", num_args = 1.., requires = "from", hide_short_help = true)]
    pub test: Vec<PathBuf>,
}

impl ForeignArguments {
    /// Returns the logs and how to read and split them.
    fn data(&self, tool: ForeignTool) -> DataArguments {
        let preset = match tool {
            ForeignTool::Moteus => Some(Preset::Moteus),
            ForeignTool::ODrive => Some(Preset::ODrive),
            ForeignTool::Candump => None,
        };
        let log = LogArguments {
            data: self.logs.clone(),
            columns: self.columns.clone(),
            from: preset.map(|preset| preset.name().to_owned()),
            joint: self.joint.clone(),
            torque_constant: self.torque_constant,
            motion: Some(MotionFrom::Smoothed),
            // A table with a sign that was guessed would drive the joint instead of helping it.
            as_logged: vec![LogFindingKind::SignSuspect.name().to_owned()],
            ..LogArguments::default()
        };
        let fit = FitArguments {
            rigid_body: self.rigid_body.clone().unwrap_or_else(|| RIGID_BODY.to_owned()),
            test: self.test.clone(),
            ..FitArguments::default()
        };
        DataArguments { log, fit }
    }
}

/// Runs the command. Exit code 1 if the table of a joint has no gain on held-out rows.
///
/// # Errors
/// Returns one line if the logs cannot be read, or are no base of a feed-forward.
pub fn run_foreign(
    tool: ForeignTool,
    arguments: &ForeignArguments,
    output: &OutputArguments,
) -> Result<ExitCode> {
    let data = arguments.data(tool);
    let is_without_gain = AtomicBool::new(false);
    each_joint("tune", &data, output, &SplitRule::default(), |input| {
        refuse_reversed_sign(input)?;
        let fit = fit_for_feed_forward(input)?;
        let made = FeedForward::new(drive(tool, input), &fit, input)?;
        if !made.judged.has_gain() {
            is_without_gain.store(true, Ordering::Relaxed);
        }
        Ok(JointResult { files: made.files(&fit, input)?, text: made.text() })
    })?;
    Ok(ExitCode::from(u8::from(is_without_gain.into_inner())))
}

/// Returns the drive of a log. A CAN log states it by the signals that were read.
fn drive(tool: ForeignTool, input: &Prepared) -> Drive {
    match (tool, torque_source(input)) {
        (ForeignTool::Moteus, _) | (ForeignTool::Candump, Some(("TORQUE", _))) => Drive::Moteus,
        (ForeignTool::ODrive, _)
        | (ForeignTool::Candump, Some(("Torque_Estimate" | "Iq_Measured", _))) => Drive::ODrive,
        (ForeignTool::Candump, _) => Drive::Joint,
    }
}

/// Returns the name of the torque's column in the log, and its unit if one was given.
fn torque_source(input: &Prepared) -> Option<(&str, Option<&str>)> {
    let torque = Quantity::Torque.name(input.data.joint);
    let source = input.data.sources.iter().find(|source| source.name == torque)?;
    Some((&source.header, source.unit.as_deref()))
}

/// Refuses a log whose torque drives the motion, because the drive would be commanded with the wrong sign.
fn refuse_reversed_sign(input: &Prepared) -> Result {
    let mut findings = input.log_findings.iter();
    let Some(finding) = findings.find(|finding| finding.kind == LogFindingKind::SignSuspect) else {
        return Ok(());
    };
    let torque = Quantity::Torque.name(input.data.joint);
    let (header, unit) = torque_source(input).unwrap_or((torque, None));
    let unit = unit.unwrap_or(input.data.joint.torque_unit());
    let turned = unit.strip_prefix('-').map_or_else(|| format!("-{unit}"), str::to_owned);
    let file = input.data.files.first().map(|file| format!("{}: ", file.display()));
    let percent = -100.0 * finding.value;
    Err(found(
        file.unwrap_or_default() + torque,
        format!(
            "a torque that drives the motion ({percent:.0} % of the power comes out of the joint)"
        ),
        format!(
            "one that is positive when it drives positive velocity: if only the log has the other sign, \
             --columns {torque}={header}:{turned}"
        ),
    ))
}
