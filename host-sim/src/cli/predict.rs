//! `predict`: the torque of a fitted model on every row of a log.

use super::error::{Result, found, in_part, unfit};
use super::fit_arguments::{FitArguments, LossChoice};
use super::input::{DataArguments, LogArguments, LogInputs, MotionFrom};
use super::network;
use super::output::{OutputArguments, pretty, print_formatted, print_text, write_file};
use super::predict_adapted::{self, AdaptArguments, MAX_LISTED_RUNS};
use super::progress::in_stages;
use crate::driver_file;
use friction_diagnose::prepare::Prepared;
use friction_fit::Resolution;
use friction_fit::params::ParameterFile;
use friction_fit::prediction::{
    AdaptationOptions, AdaptedPrediction, LogPrediction, PredictionOptions, PredictionStart,
    log_tracks, predict_adapted,
};
use friction_results::ROWS_FILE;
use friction_results::rows::RowTable;
use friction_results::table_file::TableFormat;
use joint_log::number::significant;
use joint_log::work;
use joint_log::{Dataset, SplitRule};
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
    /// Computes the driver's model, also if the file has a linear model that errs less
    #[arg(long)]
    driver: bool,
    #[command(flatten)]
    adapt: AdaptArguments,
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
pub fn run(arguments: &PredictArguments) -> Result {
    check_arguments(arguments)?;
    let default = OutputArguments::default().of_run("predict", &arguments.log.data);
    let file = arguments.out.clone().unwrap_or_else(|| default.folder().join(ROWS_FILE));
    let format = row_format(&file)?;
    let model = driver_file::read(&arguments.params)?;
    let mut log = arguments.log.clone();
    log.motion = log.motion.or(Some(match model.measurement.is_motion_logged {
        true => MotionFrom::Logged,
        false => MotionFrom::Smoothed,
    }));
    // Squares: no loss is chosen, because nothing is fitted.
    let fit = FitArguments { loss: LossChoice::Squares, ..FitArguments::default() };
    let log = DataArguments { log, fit };
    let input = match log.read(&SplitRule::LeaveOneRunOut)? {
        LogInputs::One(input) => input,
        LogInputs::Several(joints) => {
            let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
            let joints = format!("the joints {}", names.join(", "));
            return Err(found("predict", joints, "one: select it with --where joint=NAME"));
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
        of_driver: arguments.driver,
    };
    let results = in_stages(arguments.log.threads, || {
        work::report_stage("predicting");
        let results = Results::compute(&model, &input.data, &options, arguments.adapt.options());
        results.map_err(in_part(arguments.params.display()))
    })?;
    let table = match &results.adapted {
        Some(adapted) => RowTable::adapted(&input.data, adapted),
        None => RowTable::new(&input.data, &results.predicted),
    };
    let content = table.emit(format)?;
    match &arguments.out {
        Some(file) => write_file(file, &content)?,
        None => default.write(&[(ROWS_FILE, &content)])?,
    }
    let start = clap::ValueEnum::to_possible_value(&arguments.start);
    let start = start.map_or(String::new(), |value| value.get_name().to_owned());
    if arguments.json {
        return print_text(&document(&file, &model, &input, &results, &start)?);
    }
    print_formatted(&text(&file, &model, &input, &results))
}

/// The predictions of a log.
struct Results {
    /// With the gains, if they follow the log.
    predicted: LogPrediction,
    /// The fixed set, as an exported model computes it.
    as_exported: LogPrediction,
    /// How the gains followed the log.
    adapted: Option<AdaptedPrediction>,
}

impl Results {
    fn compute(
        model: &ParameterFile,
        data: &Dataset,
        options: &PredictionOptions,
        adapt: Option<AdaptationOptions>,
    ) -> Result<Self> {
        let tracks = log_tracks(model, data)?;
        let fixed = |options| network::predict_tracks(model, data, &tracks, options);
        let as_exported = fixed(&PredictionOptions::AS_EXPORTED)?;
        let Some(adapt) = adapt else {
            return Ok(Self { predicted: fixed(options)?, as_exported, adapted: None });
        };
        let adapted =
            predict_adapted(model, data, &tracks, options, &adapt).map_err(in_part("--adapt"))?;
        Ok(Self { predicted: adapted.prediction.clone(), as_exported, adapted: Some(adapted) })
    }
}

/// Rejects a result file that is one of the inputs.
fn check_arguments(arguments: &PredictArguments) -> Result {
    let same_as_out = |input: &&PathBuf| {
        let out = arguments.out.as_ref().and_then(|out| out.canonicalize().ok());
        out.is_some() && input.canonicalize().ok() == out
    };
    match arguments.log.data.iter().chain([&arguments.params]).find(same_as_out) {
        Some(input) => {
            let reason = format!("{} is an input, expected another file", input.display());
            Err(unfit("--out", reason))
        }
        None => Ok(()),
    }
}

fn row_format(file: &Path) -> Result<TableFormat> {
    match file.extension().and_then(|name| name.to_str()) {
        Some("parquet") => Ok(TableFormat::Parquet),
        Some("csv") => Ok(TableFormat::Csv),
        _ => {
            let expected = "a name ending in .parquet or .csv";
            Err(found("--out", file.display().to_string(), expected))
        }
    }
}

fn document(
    file: &Path,
    model: &ParameterFile,
    input: &Prepared,
    results: &Results,
    start: &str,
) -> Result<String> {
    let Results { predicted, as_exported, adapted } = results;
    let runs: Vec<_> = predicted
        .run_metrics(&input.data)
        .map(|(run, metrics)| json!({ "run": run, "rows": metrics.rows, "rmse": metrics.rmse }))
        .collect();
    let mut document = json!({
        "schema": 1, "file": file, "model": model.spec.full_name(), "unit": input.data.joint.torque_unit(), "start": start,
        "rows": predicted.metrics.rows, "metrics": predicted.metrics, "runs": runs,
        "as_exported_rmse": as_exported.metrics.rmse, "remarks": predicted.remarks,
    });
    if let Some(adapted) = adapted {
        document["adaptation"] = predict_adapted::document(adapted, &input.data);
    }
    pretty(&document)
}

fn text(file: &Path, model: &ParameterFile, input: &Prepared, results: &Results) -> String {
    let Results { predicted, as_exported, adapted } = results;
    let (metrics, unit) = (&predicted.metrics, input.data.joint.torque_unit());
    let mut text = format!(
        "{}{} on {} rows: RMSE {} {unit}, {:.1} % of the torque's standard deviation\n",
        model.spec.full_name(),
        if adapted.is_some() { " with adapted gains" } else { "" },
        metrics.rows,
        significant(metrics.rmse, 4),
        100.0 * metrics.nrmse_std
    );
    if let Some(adapted) = adapted {
        text += &predict_adapted::text(adapted, &input.data, unit);
    }
    let set = if adapted.is_some() { "the fixed set " } else { "" };
    text += &format!(
        "{set}as an exported model computes it, with one step per row and from the first torque: {} {unit}\n",
        significant(as_exported.metrics.rmse, 4)
    );
    let mut runs: Vec<_> = predicted.run_metrics(&input.data).collect();
    if adapted.is_none() && runs.len() > 1 {
        runs.sort_by(|a, b| b.1.rmse.total_cmp(&a.1.rmse));
        let worst = runs.iter().take(MAX_LISTED_RUNS);
        let listed: Vec<String> =
            worst.map(|(run, metrics)| format!("{run} {}", significant(metrics.rmse, 3))).collect();
        let more = if runs.len() > MAX_LISTED_RUNS { ", .." } else { "" };
        text += &format!("RMSE of each run, largest first: {}{more}\n", listed.join(", "));
    }
    predicted.remarks.iter().for_each(|remark| text += &format!("- {remark}\n"));
    text + &format!("written: {}\n", file.display())
}
