//! Command-line arguments of the commands that read measured data, and the reading itself.
//!
//! [`LogArguments`] names the files and their columns.
//! [`DataArguments::read`] reads the files, checks the log, reports its problems before any fit, and returns tracks that are
//! ready to fit.

use super::error::{Result, found, in_part};
use super::fit_arguments::{FitArguments, LossChoice};
use super::output::print_message;
use super::progress::in_stages;
use super::table;
use super::values::{Expected, expected, number};
use super::words::text_in_options;
use clap::Args;
use clap::builder::{PossibleValuesParser, Resettable, Str};
use friction_diagnose::prepare::{Error, PrepareOptions, Prepared, Source, corrections, prepare};
use friction_fit::Loss;
use joint_log::log_check::LogFindingKind;
use joint_log::{
    DataError, JOINT, MAX_BAD_SHARE, Preset, ReadOptions, ServoTorque, SplitRule, TorqueConstant,
};
use std::path::PathBuf;

/// The logs, and how they are read.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Reading the log")]
pub struct LogArguments {
    /// Log files: CSV, JSON lines, Parquet, Arrow, MCAP or CAN traces; also in gzip or zip
    #[arg(required = true, value_name = "DATA", help_heading = Resettable::<Str>::Reset)]
    pub data: Vec<PathBuf>,
    /// Names and units of the file's columns: `torque_nm=tau_3:mNm,time_s=t:ms`; `help` lists the columns
    ///
    /// `:-Nm` reverses the sign; `:0.229rpm` is the size of one count, `:4096counts` the counts of a turn, `:0.1degC-40` a scale
    /// and an offset; `velocity[2]` is an element of a cell that contains a list. `1=time_s` names a column by its number;
    /// `time_s=dt:us:step` adds up the steps between rows.
    #[arg(long, value_name = "a=b:unit,..", value_delimiter = ',')]
    pub columns: Vec<String>,
    /// Tool that wrote the log; supplies names and units of columns that `--columns` does not name
    #[arg(long, value_name = "TOOL", value_parser = PossibleValuesParser::new(Preset::ALL.map(Preset::name)), hide_possible_values = true)]
    pub from: Option<String>,
    /// Rate of the rows of a log without a time column: `200Hz`
    #[arg(long, value_name = "RATE", value_parser = rate_hz)]
    pub rate: Option<f64>,
    /// Join files that hold one channel each (`effort.csv`, `position.csv`) by their times
    #[arg(long)]
    pub join: bool,
    /// Use only rows where COLUMN has one of the values, such as `joint=2`
    ///
    /// `joint=2` selects one joint, as `--joint 2` does. May be repeated.
    #[arg(long = "where", value_name = "COLUMN=VALUE,..")]
    pub only: Vec<String>,
    /// Read one joint of a log with several: its number or name. By default all are processed in turn
    #[arg(long, value_name = "JOINT")]
    pub joint: Option<String>,
    /// Skip the first N lines of text of each file, above the header
    #[arg(long, value_name = "N", default_value_t = 0, hide_short_help = true)]
    pub skip_lines: usize,
    /// Torque of 100 %, for columns in percent: `--columns torque_nm=0x6077:0.1% --rated-torque 1.2Nm`
    #[arg(long, value_name = "TORQUE", value_parser = rated_torque_nm, hide_short_help = true)]
    pub rated_torque: Option<f64>,
    /// Torque of one ampere, for columns in amperes: `--columns torque_nm=i_q:A --torque-constant 0.105Nm/A`
    #[arg(long, value_name = "Nm/A", value_parser = TorqueConstant::parse)]
    pub torque_constant: Option<TorqueConstant>,
    /// Compute the torque of a log without one by the servo's law: `pd,kp=40,kd=1.5,target=q_des` (Nm/rad, Nm s/rad)
    #[arg(long, value_name = "LAW", value_parser = ServoTorque::parse, hide_short_help = true)]
    pub torque_from: Option<ServoTorque>,
    /// Maximum share of bad rows, which are left out: `--bad-rows 10%`
    #[arg(long, value_name = "PERCENT", value_parser = share_of_rows, hide_short_help = true)]
    pub bad_rows: Option<f64>,
    /// Drop the first N samples of each run
    #[arg(long, value_name = "N", default_value_t = 0, hide_short_help = true)]
    pub skip: usize,
    /// Source of the motion: reconstructed from position and velocity, or the unchanged velocity column
    ///
    /// By default the reconstructed motion, unless the torque follows the logged one more closely. `predict` uses that of the
    /// model.
    #[arg(long, value_name = "WHICH", value_enum, hide_short_help = true)]
    pub motion: Option<MotionFrom>,
    /// Log problems to report without correction
    ///
    /// velocity-noise, velocity-lag, quantised (for these the motion is used as logged), wrapped-angle, outlier, held-channel,
    /// torque-lag. `unit-suspect` reads a log whose units contradict each other.
    #[arg(long, value_name = "KIND,..", value_delimiter = ',', hide_short_help = true)]
    pub as_logged: Vec<String>,
    /// Number of threads; 0 uses all cores
    #[arg(long, value_name = "N", default_value_t = 0, hide_short_help = true)]
    pub threads: usize,
}

/// The logs, and how to read, fit and split them.
#[derive(Args, Clone, Debug)]
pub struct DataArguments {
    #[command(flatten)]
    pub log: LogArguments,
    #[command(flatten)]
    pub fit: FitArguments,
}

/// The value of `--columns` that lists the columns.
const COLUMNS_HELP: &str = "help";

/// Parses a torque with its unit, Nm.
fn rated_torque_nm(text: &str) -> Result<f64, Expected> {
    let torque_nm = joint_log::parse_value("torque_nm", text)
        .map_err(|error| expected(text_in_options(&error.to_string())))?;
    let is_torque = torque_nm.is_finite() && torque_nm > 0.0;
    is_torque.then_some(torque_nm).ok_or_else(|| expected("a positive torque"))
}

/// Parses a share of the rows in percent.
fn share_of_rows(text: &str) -> Result<f64, Expected> {
    let percent = text.trim().trim_end_matches('%');
    let is_share = |percent: &f64| (0.0..100.0).contains(percent);
    Ok(number(percent, is_share, "a percentage below 100, such as 10%")? / 100.0)
}

/// Parses a rate with its unit, Hz.
fn rate_hz(text: &str) -> Result<f64, Expected> {
    joint_log::parse_rate_hz(text).ok_or_else(|| expected("a rate as 200Hz or 1kHz"))
}

/// Source of the motion.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFrom {
    /// Reconstructed from all motion columns.
    Smoothed,
    /// The unchanged velocity column.
    Logged,
}

/// The data of a command.
pub enum LogInputs {
    /// The log of one joint.
    One(Box<Prepared>),
    /// The logs of several joints, each with the joint's name.
    Several(Vec<(String, Prepared)>),
}

impl DataArguments {
    /// Reads, checks and splits the log of one joint, or of each joint of a log with several. `default_split` applies if
    /// the user gives no split.
    ///
    /// # Errors
    /// Returns one line for the user.
    pub fn read(&self, default_split: &SplitRule) -> Result<LogInputs> {
        let options = self.options(default_split)?;
        let (column, joints) = match self.read_one(&options, None) {
            Err(Error::Data(DataError::SeveralJoints { column, joints, .. })) => (column, joints),
            input => return Ok(LogInputs::One(Box::new(input?))),
        };
        let each = joints.into_iter().map(|joint| {
            let mut alone = options.clone();
            alone.read.only.retain(|(known, _)| *known != column);
            alone.read.only.push((column.clone(), vec![joint.clone()]));
            let input = self.read_one(&alone, Some(&joint));
            let input = input.map_err(in_part(format!("joint {joint}")))?;
            Ok((joint, input))
        });
        each.collect::<Result<_>>().map(LogInputs::Several)
    }

    /// Reads the log of one joint, which is the only one or has this name.
    fn read_one(&self, options: &PrepareOptions, joint: Option<&str>) -> Result<Prepared, Error> {
        let files: Vec<PathBuf> = self.log.data.iter().chain(&self.fit.test).cloned().collect();
        let mut input = in_stages(self.log.threads, || prepare(&Source::Files(files), options))?;
        input.joint = joint.map(str::to_owned);
        // Printed after the last possible error, so that an error stays the only line.
        print_log(&input);
        if input.loss == Loss::Huber && self.fit.loss == LossChoice::Auto {
            let has_spikes = input.data.runs.iter().any(|run| !run.torque_spikes.is_empty());
            let reason =
                if has_spikes { "of the spikes" } else { "a held channel leaves few rows" };
            let line = format!("the loss is huber because {reason}; --loss squares changes it");
            print_lines(&input, [line].into_iter());
        }
        Ok(input)
    }

    /// Returns how a log is read, checked and split.
    ///
    /// # Errors
    /// Returns one line for the user.
    pub fn options(&self, default_split: &SplitRule) -> Result<PrepareOptions> {
        self.fit.complete(self.log.options()?, default_split)
    }
}

impl LogArguments {
    /// Returns how a log is read and checked.
    fn options(&self) -> Result<PrepareOptions> {
        let corrections =
            corrections(self.motion.map(|from| from == MotionFrom::Smoothed), &self.as_logged)
                .map_err(in_part("--as-logged"))?;
        Ok(PrepareOptions {
            read: self.read_options()?,
            columns: self.columns.clone(),
            corrections,
            ..PrepareOptions::default()
        })
    }

    /// Returns the kinds of `--as-logged`, which are not corrected. Unknown names are reported when the log is read.
    pub fn kinds_as_logged(&self) -> Vec<LogFindingKind> {
        self.as_logged.iter().filter_map(|name| LogFindingKind::parse(name.trim())).collect()
    }

    /// Returns how the files are read.
    fn read_options(&self) -> Result<ReadOptions> {
        Ok(ReadOptions {
            columns: self.column_pairs()?,
            only: self.row_filters()?,
            skip: self.skip,
            skip_lines: self.skip_lines,
            preset: self.from.as_deref().and_then(Preset::parse),
            rated_torque_nm: self.rated_torque,
            torque_constant: self.torque_constant,
            torque_from: self.torque_from.clone(),
            max_bad_share: self.bad_rows.unwrap_or(MAX_BAD_SHARE),
            rate_hz: self.rate,
            join: self.join,
        })
    }

    /// Returns the description of the columns that `--columns help` asks for; `None` if it is not asked for.
    ///
    /// # Errors
    /// Returns one line if a file cannot be read.
    pub fn described_columns(&self) -> Result<Option<String>> {
        if self.columns.iter().all(|text| text.trim() != COLUMNS_HELP) {
            return Ok(None);
        }
        let others = self.columns.iter().filter(|text| text.trim() != COLUMNS_HELP).cloned();
        let options = Self { columns: others.collect(), ..self.clone() }.read_options()?;
        let described = self.data.iter().map(|file| {
            let survey = joint_log::survey(file, &options)?;
            Ok(table::columns(file, &survey))
        });
        described.collect::<Result<Vec<_>>>().map(|texts| Some(texts.join("\n")))
    }

    fn column_pairs(&self) -> Result<Vec<(String, String)>> {
        let pair = |text: &String| match text.split_once('=') {
            Some((ours, theirs)) if !ours.is_empty() && !theirs.is_empty() => {
                Ok((ours.trim().to_owned(), theirs.trim().to_owned()))
            }
            _ => Err(found("--columns", format!("{text:?}"), "NAME=COLUMN or NAME=COLUMN:UNIT")),
        };
        self.columns.iter().map(pair).collect()
    }

    /// Parses `--where` into columns and their accepted values.
    fn row_filters(&self) -> Result<Vec<(String, Vec<String>)>> {
        let choice = |text: &String| {
            let parts = text.split_once('=').map(|(column, values)| {
                let values: Vec<String> = values.split(',').map(|v| v.trim().to_owned()).collect();
                (column.trim().to_owned(), values)
            });
            parts
                .filter(|(column, _)| !column.is_empty())
                .ok_or_else(|| found("--where", format!("{text:?}"), "COLUMN=VALUE"))
        };
        let joint = self.joint.iter().map(|joint| Ok((JOINT.to_owned(), vec![joint.clone()])));
        self.only.iter().map(choice).chain(joint).collect()
    }
}

/// Prints the columns of a log and its problems on standard error, so that standard output contains the result only.
fn print_log(input: &Prepared) {
    let findings = input.log_findings.iter();
    let problems = findings.map(|finding| format!("{}: {}", finding.kind.name(), finding.in_words));
    print_lines(input, input.overview.iter().cloned().chain(problems));
}

/// Prints lines about a log, with the joint's name if the log has several.
fn print_lines(input: &Prepared, lines: impl Iterator<Item = String>) {
    let joint = input.joint.as_ref().map_or(String::new(), |joint| format!("joint {joint}: "));
    lines.for_each(|line| print_message(&format!("log: {joint}{line}")));
}
