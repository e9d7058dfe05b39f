//! `fleet`: diagnoses the logs of many joints and campaigns, and compares them on one page.

use super::input::DataArguments;
use super::output::{pretty, print_formatted, print_text};
use super::progress::in_stages;
use super::words::in_options;
use friction_diagnose::prepare::Error;
use friction_fit::spec::Spec;
use friction_results::fleet::statistics::{Limit, outliers, trends};
use friction_results::fleet::{
    FleetJob, FleetOptions, FleetRow, LEVELS, find_jobs, run_task, write_fleet,
};
use joint_log::SplitRule;
use joint_log::work;
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Arguments of `fleet`.
#[derive(clap::Args)]
pub struct FleetArguments {
    /// Folder of the results: `fleet.parquet`, `fleet.html`, and a folder for each joint and campaign. A second call computes
    /// only what is missing or has changed
    #[arg(long, value_name = "DIR", default_value = "out/fleet")]
    out: PathBuf,
    /// Print the result as JSON instead of text
    #[arg(long)]
    json: bool,
    /// Base model of the diagnoses; by default selected for each log
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// Model of the levels whose trends are tested; the same for all joints and campaigns
    #[arg(long, value_name = "MODEL", default_value = "lugre")]
    fixed_model: String,
    /// Level of the fixed model at which a joint needs service: `coulomb_torque=3.0`, in Nm or N
    #[arg(long, value_name = "LEVEL=VALUE,..", value_delimiter = ',')]
    limit: Vec<String>,
    #[command(flatten)]
    data: DataArguments,
}

/// Runs the command.
pub fn run(arguments: &FleetArguments) -> Result<(), String> {
    let limits =
        arguments.limit.iter().map(|text| parse_limit(text)).collect::<Result<Vec<_>, _>>()?;
    let mut options = FleetOptions::new(arguments.out.clone());
    options.prepare = arguments.data.options(&SplitRule::LeaveOneRunOut)?;
    options.model = arguments.model.as_deref().map(Spec::parse).transpose().map_err(in_options)?;
    options.fixed_model = Spec::parse(&arguments.fixed_model).map_err(in_options)?;
    options.worded = |error| in_options(error);
    let folders = arguments.data.log.data.iter().map(|root| find_jobs(root, &arguments.out));
    let jobs: Vec<FleetJob> = folders.collect::<Result<Vec<_>, _>>()?.concat();
    let failed = |error: std::io::Error| format!("{}: {error}", arguments.out.display());
    std::fs::create_dir_all(&arguments.out).map_err(failed)?;
    let rows = in_stages(arguments.data.log.threads, || {
        let done = AtomicUsize::new(0);
        work::report_stage(&format!("diagnosing {} logs", jobs.len()));
        let run = |job: &FleetJob| {
            let rows = run_task(job, &options);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            work::report_stage(&format!("diagnosed {done} of {} logs", jobs.len()));
            rows
        };
        let rows: Vec<Vec<FleetRow>> = jobs.par_iter().map(run).collect();
        Ok::<_, Error>(rows.concat())
    })
    .map_err(in_options)?;
    write_fleet(&arguments.out, &rows, &limits)?;
    print(arguments, &rows, &limits)
}

/// Parses a limit of a level.
fn parse_limit(text: &str) -> Result<Limit, String> {
    let expected = || {
        let levels = LEVELS.join(", ");
        format!("--limit: found {text:?}, expected LEVEL=VALUE with a level of {levels}")
    };
    let (level, value) = text.split_once('=').ok_or_else(expected)?;
    let value = value.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let is_known = LEVELS.contains(&level.trim());
    let value = value.filter(|_| is_known).ok_or_else(expected)?;
    Ok(Limit { level: level.trim().into(), value })
}

fn print(arguments: &FleetArguments, rows: &[FleetRow], limits: &[Limit]) -> Result<(), String> {
    let out = arguments.out.display();
    if arguments.json {
        let document = json!({ "schema": 1, "rows": rows });
        return print_text(&pretty(&document)?);
    }
    let failed: Vec<&FleetRow> = rows.iter().filter(|row| !row.is_ok()).collect();
    let named = rows.iter().filter(|row| row.is_ok() && row.cause != "none").count();
    let mut text = format!(
        "{} logs diagnosed, {} failed; {named} name a cause\n",
        rows.len() - failed.len(),
        failed.len()
    );
    for trend in trends(rows, limits).iter().filter(|trend| trend.is_significant) {
        text += &format!(
            "trend: joint {}: {} changes by {:.2} % per {}\n",
            trend.joint,
            LEVELS[trend.level],
            100.0 * trend.slope / trend.now,
            trend.unit.name()
        );
    }
    for outlier in outliers(rows) {
        text += &format!(
            "far from the other joints: joint {}: {} {:.4}, median {:.4}\n",
            rows[outlier.row].joint, LEVELS[outlier.level], outlier.value, outlier.median
        );
    }
    for row in failed {
        let reason = row.error.as_deref().unwrap_or_default();
        text += &format!("failed: joint {} {}: {reason}\n", row.joint, row.campaign);
    }
    print_formatted(&format!("{text}written: {out}/fleet.parquet, {out}/fleet.html\n"))
}
