//! `predict`: the torque of a fitted model on every row of a log.

use super::fit_arguments::FitArguments;
use super::input::{DataArguments, LogArguments, LogInputs};
use super::output::{OutputArguments, pretty, print_formatted, print_text};
use super::progress::in_stages;
use super::words::in_options;
use crate::driver_file;
use friction_diagnose::prepare::{Error, Prepared};
use friction_fit::Resolution;
use friction_fit::params::ParameterFile;
use friction_fit::prediction::{LogPrediction, PredictionOptions, PredictionStart, predict_log};
use friction_results::rows::RowTable;
use friction_results::table_file::TableFormat;
use friction_results::{ROWS_FILE, write_atomically};
use joint_log::number::significant;
use joint_log::work;
use joint_log::{Quantity, SplitRule};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `predict`.
#[derive(clap::Args)]
pub struct PredictArguments {
    /// Model file, as written by `identify`, `compare` and `diagnose`
    #[arg(value_name = "PARAMS.TOML")]
    params: PathBuf,
    /// Result file, `.parquet` or `.csv`; by default `rows.parquet` in a folder such as `out/predict-my-log`
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the result as JSON instead of text
    #[arg(long)]
    json: bool,
    /// State of the model at the start of each run and after each gap
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = Start::Fitted)]
    start: Start,
    /// Steps of the model per row; by default those of the fit
    ///
    /// The steps are without extrapolation. 1 as in a driver or an exported model.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    substeps: Option<u32>,
    #[command(flatten)]
    pub(super) log: LogArguments,
}

/// State of the model at the start of a run.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Start {
    /// The bristle torque that fits the whole run best, as in `diagnose`
    Fitted,
    /// The first predicted torque is the first measured torque, as far as the static level permits
    FirstTorque,
    /// No bristle torque
    Rest,
}

/// Runs the command.
pub fn run(arguments: &PredictArguments) -> Result<(), String> {
    check_arguments(arguments)?;
    let default = OutputArguments::default().of_run("predict", &arguments.log.data);
    let file = arguments.out.clone().unwrap_or_else(|| default.folder().join(ROWS_FILE));
    let format = row_format(&file)?;
    let model = driver_file::read(&arguments.params).map_err(|error| error.to_string())?;
    let log = DataArguments { log: arguments.log.clone(), fit: FitArguments::without_fit() };
    let input = match log.read(&SplitRule::LeaveOneRunOut)? {
        LogInputs::One(input) => input,
        LogInputs::Several(joints) => {
            let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
            return Err(format!(
                "predict: found the joints {}, expected one: select it with --where joint=NAME",
                names.join(", ")
            ));
        }
    };
    let options = PredictionOptions {
        start: match arguments.start {
            Start::Fitted => PredictionStart::Fitted,
            Start::FirstTorque => PredictionStart::FirstTorque,
            Start::Rest => PredictionStart::Rest,
        },
        resolution: arguments
            .substeps
            .map(|steps| Resolution { substeps: steps as usize, extrapolated: false }),
    };
    let with_path = |error| format!("{}: {error}", arguments.params.display());
    let (predicted, as_exported) = in_stages(arguments.log.threads, || {
        work::report_stage("predicting");
        let by = |options| predict_log(&model, &input.data, options).map_err(with_path);
        Ok::<_, Error>((by(&options)?, by(&PredictionOptions::AS_EXPORTED)?))
    })
    .map_err(in_options)?;
    let content = RowTable::new(&input.data, &predicted).emit(format)?;
    match &arguments.out {
        Some(file) => write_file(file, &content)?,
        None => default.write_bytes(&[(ROWS_FILE, &content)])?,
    }
    let start = clap::ValueEnum::to_possible_value(&arguments.start);
    let start = start.map_or(String::new(), |value| value.get_name().to_owned());
    if arguments.json {
        return print_text(&document(&file, &model, &input, [&predicted, &as_exported], &start)?);
    }
    print_formatted(&text(&file, &model, &input, [&predicted, &as_exported]))
}

/// Rejects a result file that is one of the inputs.
fn check_arguments(arguments: &PredictArguments) -> Result<(), String> {
    let same_as_out = |input: &&PathBuf| {
        let out = arguments.out.as_ref().and_then(|out| out.canonicalize().ok());
        out.is_some() && input.canonicalize().ok() == out
    };
    match arguments.log.data.iter().chain([&arguments.params]).find(same_as_out) {
        Some(input) => {
            Err(format!("--out: {} is an input, expected another file", input.display()))
        }
        None => Ok(()),
    }
}

fn row_format(file: &Path) -> Result<TableFormat, String> {
    match file.extension().and_then(|name| name.to_str()) {
        Some("parquet") => Ok(TableFormat::Parquet),
        Some("csv") => Ok(TableFormat::Csv),
        _ => Err(format!(
            "--out: found {}, expected a name ending in .parquet or .csv",
            file.display()
        )),
    }
}

fn write_file(file: &Path, content: &[u8]) -> Result<(), String> {
    let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    }
    write_atomically(file, content).map_err(|error| failed(file, error))
}

fn unit(input: &Prepared) -> &'static str {
    Quantity::Torque.info().units[input.data.joint as usize]
}

fn document(
    file: &Path,
    model: &ParameterFile,
    input: &Prepared,
    [predicted, as_exported]: [&LogPrediction; 2],
    start: &str,
) -> Result<String, String> {
    let runs: Vec<_> = predicted
        .run_metrics(&input.data)
        .map(|(run, metrics)| json!({ "run": run, "rows": metrics.rows, "rmse": metrics.rmse }))
        .collect();
    let document = json!({
        "schema": 1, "file": file, "model": model.spec.full_name(), "unit": unit(input), "start": start,
        "rows": predicted.metrics.rows, "metrics": predicted.metrics, "runs": runs,
        "as_exported_rmse": as_exported.metrics.rmse, "remarks": predicted.remarks,
    });
    pretty(&document)
}

/// Most runs that the terminal lists.
const MAX_LISTED_RUNS: usize = 12;

fn text(
    file: &Path,
    model: &ParameterFile,
    input: &Prepared,
    [predicted, as_exported]: [&LogPrediction; 2],
) -> String {
    let (metrics, unit) = (&predicted.metrics, unit(input));
    let mut text = format!(
        "{} on {} rows: RMSE {} {unit}, {:.1} % of the torque's standard deviation\n",
        model.spec.full_name(),
        metrics.rows,
        significant(metrics.rmse, 4),
        100.0 * metrics.nrmse_std
    );
    text += &format!(
        "as an exported model computes it, with one step per row and from the first torque: {} {unit}\n",
        significant(as_exported.metrics.rmse, 4)
    );
    let mut runs: Vec<_> = predicted.run_metrics(&input.data).collect();
    if runs.len() > 1 {
        runs.sort_by(|a, b| b.1.rmse.total_cmp(&a.1.rmse));
        let worst = runs.iter().take(MAX_LISTED_RUNS);
        let listed: Vec<String> =
            worst.map(|(run, own)| format!("{run} {}", significant(own.rmse, 3))).collect();
        let more = if runs.len() > MAX_LISTED_RUNS { ", .." } else { "" };
        text += &format!("RMSE of each run, largest first: {}{more}\n", listed.join(", "));
    }
    predicted.remarks.iter().for_each(|remark| text += &format!("- {remark}\n"));
    text + &format!("written: {}\n", file.display())
}
