//! Judges what `diagnose` hands over: a model of two thirds of a machine's runs predicts the others, beside its rivals.
//!
//! ```text
//! tests/bench transfer                                                        builds host-sim, then as here:
//! cargo run -p friction-grading --example transfer -- HOST_SIM                the excerpts of tests/data; with LONG_TESTS the full files
//! cargo run ... -- HOST_SIM --folder DIR --answers ANSWERS.json               also other machines' logs, with their arguments
//! ```
//!
//! An error is the RMSE over the moving test rows that the product predicts. The product is called as a user calls it. Exit code 1
//! if a limit is missed.

use clap::Parser;
use compensator_core::TermKind;
use friction_fit::spec::parse_rigid_body;
use friction_grading::GradingError;
use friction_grading::contest_logs::read_json;
use friction_grading::transfer_log::TransferLog;
use friction_grading::transfer_product::{Product, hand_over};
use friction_grading::transfer_rivals::{plain, trees};
use measured_logs::MeasuredLogs;
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Limits of the product's error as a share of plain's, geometric mean over the machines of a set, and the most machines where it
/// is worse. A mean below its limits asks for tighter ones.
struct Limits {
    share: RangeInclusive<f64>,
    worse: usize,
}

const EXCERPT_LIMITS: Limits = Limits { share: 0.45..=0.6, worse: 5 };
const FULL_LIMITS: Limits = Limits { share: 0.43..=0.57, worse: 3 };

/// Share of plain's error above which a model counts as worse.
const WORSE: f64 = 1.02;

/// Logs by the arguments that their authors' description asks for.
const LOGS: &[(&str, &str)] = &[
    (
        "",
        "damper-1 damper-1-actuators damper-2 damper-3 damper-4 damper-5 damper-quakes robot-current robot-current-j3 worm-drive",
    ),
    (
        "--rigid-body offset",
        "bus-servo mr-damper rolling-motor screw-antibacklash seal-kdn seal-oring seal-xring seal-xring-7bar",
    ),
    ("--rigid-body inertia,offset", "bldc-cogging pendulum"),
    ("--rigid-body inertia,load,offset", "robot-axis1 robot-axis2 robot-axis3"),
    ("--columns torque_nm=drive_voltage_v --rigid-body load,offset", "servo-pendulum"),
    (EMPS, "emps-pulses emps-train"),
];

const EMPS: &str = "--columns time_s=t_s,position_m=q_m,force_n=motor_force_N,velocity_m_s=vel_m_per_s,acceleration_m_s2=acc_m_per_s2 \
     --rigid-body inertia,offset";

/// Judges what `diagnose` hands over on measured logs.
#[derive(Parser)]
struct Arguments {
    /// The program
    host_sim: PathBuf,
    /// Folder of further logs, which no limit concerns: machines whose licence is unclear
    #[arg(long, requires = "answers")]
    folder: Option<PathBuf>,
    /// JSON file with the arguments of each of them: {"FILE.csv": {"args": [..]}}
    #[arg(long, requires = "folder")]
    answers: Option<PathBuf>,
    /// Only logs with this text in their name; without limits
    #[arg(long)]
    only: Option<String>,
}

/// A log with the arguments of the command line.
struct Machine {
    path: PathBuf,
    arguments: Vec<String>,
    is_of_repository: bool,
}

/// What is known of a log: the arguments with which it is read.
#[derive(Deserialize)]
struct Answer {
    args: Vec<String>,
}

/// Errors on a machine's test rows, in the unit of its torque.
struct Judged {
    name: String,
    is_of_repository: bool,
    plain: f64,
    trees: f64,
    /// The product's error and what it handed over.
    product: Result<(f64, Product), GradingError>,
}

fn main() -> ExitCode {
    run(&Arguments::parse()).unwrap_or_else(|error| {
        eprintln!("{error}");
        ExitCode::FAILURE
    })
}

fn run(arguments: &Arguments) -> Result<ExitCode, GradingError> {
    let logs = MeasuredLogs::of_this_run();
    let mut machines = machines(&logs, arguments)?;
    if let Some(only) = &arguments.only {
        machines.retain(|machine| machine.name().contains(only));
    }
    let judged: Result<Vec<Judged>, GradingError> = machines
        .par_iter()
        .map(|machine| judge(&arguments.host_sim, machine).inspect(|of| eprintln!("{}", of.name)))
        .collect();
    let judged = judged?;
    println!(
        "machine                      plain  product  trees  handed over: causes (errors as shares of plain's)"
    );
    judged.iter().for_each(|of| println!("{}", of.line()));
    let of_repository = || judged.iter().filter(|of| of.is_of_repository);
    println!(
        "{}",
        summary(if logs.is_full() { "full files" } else { "excerpts" }, of_repository())
    );
    if arguments.folder.is_some() {
        let unclear = judged.iter().filter(|of| !of.is_of_repository);
        println!("{}", summary("licence unclear", unclear));
        println!("{}", summary("all", judged.iter()));
    }
    if arguments.only.is_some() {
        return Ok(ExitCode::SUCCESS);
    }
    let limits = if logs.is_full() { FULL_LIMITS } else { EXCERPT_LIMITS };
    let missed = limits.missed(of_repository());
    missed.iter().for_each(|why| println!("missed: {why}"));
    Ok(if missed.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns the machines of the repository, with the arguments of the full files' `right-answers.json` where they are read, and
/// those of the given folder.
fn machines(logs: &MeasuredLogs, arguments: &Arguments) -> Result<Vec<Machine>, GradingError> {
    let file = logs.folder().join("right-answers.json");
    let answers: HashMap<String, Answer> =
        if file.is_file() { read_json(&file)? } else { HashMap::new() };
    let tables = LOGS.iter().flat_map(|(arguments, names)| {
        names.split(' ').map(|name| {
            let file = format!("{name}.csv");
            let usual = || arguments.split_whitespace().map(str::to_owned).collect();
            let arguments = answers.get(&file).map_or_else(usual, |answer| answer.args.clone());
            Machine { path: logs.file(&file), arguments, is_of_repository: true }
        })
    });
    let mut machines: Vec<Machine> = tables.collect();
    if let (Some(folder), Some(answers)) = (&arguments.folder, &arguments.answers) {
        for (file, Answer { args }) in read_json::<HashMap<String, Answer>>(answers)? {
            let path = folder.join(file);
            machines.push(Machine { path, arguments: args, is_of_repository: false });
        }
    }
    machines.retain(|machine| machine.path.is_file());
    machines.sort_by_key(|machine| (!machine.is_of_repository, machine.name()));
    Ok(machines)
}

impl Machine {
    fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the value of an argument, or an empty text.
    fn argument(&self, name: &str) -> &str {
        let mut pairs = self.arguments.windows(2);
        pairs.find(|pair| pair[0] == name).map_or("", |pair| &pair[1])
    }
}

/// Fits the rivals and the product to the training rows, and judges them by the test rows that the product predicts.
fn judge(host_sim: &Path, machine: &Machine) -> Result<Judged, GradingError> {
    let name = machine.name();
    let renamed = machine.argument("--columns").split(',').filter_map(|pair| pair.split_once('='));
    let plain_name = |theirs: &str| theirs.split(':').next().unwrap_or_default().to_owned();
    let renamed: Vec<(String, String)> =
        renamed.map(|(ours, theirs)| (ours.to_owned(), plain_name(theirs))).collect();
    let log = TransferLog::read(&machine.path, &renamed)?;
    let rigid_body: Vec<TermKind> = parse_rigid_body(machine.argument("--rigid-body"))?;
    let product = hand_over(host_sim, &log, &machine.arguments);
    let is_predicted = |row: &usize| match &product {
        Ok(product) => product.predicted[*row].is_finite(),
        Err(_) => true,
    };
    let rows: Vec<usize> = log.judging_rows().into_iter().filter(is_predicted).collect();
    let prediction = plain(&log, &rigid_body);
    let of_trees = trees(&log, &rows);
    Ok(Judged {
        plain: log.rmse(&rows, |row| prediction[row]),
        trees: log.rmse(&rows, |row| of_trees[row]),
        product: product.map(|of| (log.rmse(&rows, |row| of.predicted[row]), of)),
        is_of_repository: machine.is_of_repository,
        name,
    })
}

impl Judged {
    /// Returns the product's error as a share of plain's; `None` without a prediction.
    fn share(&self) -> Option<f64> {
        self.product.as_ref().ok().map(|(error, _)| error / self.plain)
    }

    /// Returns true if the product is worse than plain, or predicts nothing.
    fn is_worse(&self) -> bool {
        self.share().is_none_or(|share| share > WORSE)
    }

    fn line(&self) -> String {
        let share = self.share().map_or("-".into(), |share| format!("{share:.3}"));
        let text = match &self.product {
            Ok((_, product)) => product.describe(),
            Err(why) => why.to_string(),
        };
        let trees = self.trees / self.plain;
        format!("{:22} {:11.4e}  {share:>7}  {trees:5.3}  {text}", self.name, self.plain)
    }
}

fn geometric_mean(shares: impl Iterator<Item = f64>) -> f64 {
    let logarithms: Vec<f64> = shares.map(f64::ln).collect();
    (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp()
}

fn summary<'a>(title: &str, judged: impl Iterator<Item = &'a Judged> + Clone) -> String {
    let product = geometric_mean(judged.clone().filter_map(Judged::share));
    let trees = geometric_mean(judged.clone().map(|of| of.trees / of.plain));
    let worse: Vec<&str> =
        judged.clone().filter(|of| of.is_worse()).map(|of| of.name.as_str()).collect();
    let (bad, all, worse) = (worse.len(), judged.count(), worse.join(", "));
    format!(
        "{title}: product {product:.3}, trees {trees:.3}; product worse on {bad} of {all}: {worse}"
    )
}

impl Limits {
    /// Returns a line for each limit that is missed.
    fn missed<'a>(&self, judged: impl Iterator<Item = &'a Judged> + Clone) -> Vec<String> {
        let share = geometric_mean(judged.clone().filter_map(Judged::share));
        let worse = judged.filter(|of| of.is_worse()).count();
        let mut missed = Vec::new();
        if !self.share.contains(&share) {
            let (low, high) = (self.share.start(), self.share.end());
            missed.push(format!("the product's share {share:.3}, expected {low} to {high}"));
        }
        if worse > self.worse {
            missed.push(format!("worse than plain on {worse}, expected at most {}", self.worse));
        }
        missed
    }
}
