//! `fleet`: diagnoses the logs of many joints and campaigns, and compares them on one page.

use super::error::{Result, found as found_in, in_file};
use super::input::DataArguments;
use super::output::{pretty, print_formatted, print_message, print_text};
use super::progress::{LINE_EVERY, duration_in_words, in_stages, with_lines};
use super::table;
use super::words::in_options;
use friction_diagnose::prepare::Error;
use friction_fit::spec::Spec;
use friction_results::fleet::statistics::Limit;
use friction_results::fleet::{
    Ageing, FleetJob, FleetOptions, FleetRow, LEVELS, find_jobs, jobs_of_table, mixed_forms,
    read_ageing, run_task, summarise, write_fleet,
};
use joint_log::SplitRule;
use joint_log::work;
use rayon::prelude::*;
use serde_json::json;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Arguments of `fleet`.
#[derive(clap::Args)]
pub struct FleetArguments {
    /// Folder of the results; a second call computes only what is missing or has changed
    ///
    /// It gets `fleet.parquet`, `fleet.html`, and a folder for each joint and campaign.
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
pub fn run(arguments: &FleetArguments) -> Result {
    let limits =
        arguments.limit.iter().map(|text| parse_limit(text)).collect::<Result<Vec<_>, _>>()?;
    let mut options = FleetOptions::new(arguments.out.clone());
    options.prepare = arguments.data.options(&SplitRule::LeaveOneRunOut)?;
    options.model = arguments.model.as_deref().map(Spec::parse).transpose()?;
    options.fixed_model = Spec::parse(&arguments.fixed_model)?;
    options.worded = |error| in_options(&error);
    std::fs::create_dir_all(&arguments.out).map_err(in_file(&arguments.out))?;
    let pieces = tempfile::Builder::new().prefix(".unfinished-").tempdir_in(&arguments.out);
    let pieces = pieces.map_err(in_file(&arguments.out))?;
    let jobs = find_all(&arguments.data.log.data, &arguments.out, pieces.path())?;
    let data = arguments.data.log.data.iter().map(PathBuf::as_path);
    let folders: Vec<&Path> = data.filter(|of| of.is_dir()).collect();
    let ageing = read_ageing(&folders, &arguments.out)?;
    let rows = diagnose_all(&jobs, &options, arguments.data.log.threads)?;
    write_fleet(&arguments.out, &rows, &ageing, &limits)?;
    print(arguments, &rows, &ageing, &limits)
}

/// Returns the logs of all folders and tables. The logs of a table are copied to `pieces`.
fn find_all(data: &[PathBuf], out: &Path, pieces: &Path) -> Result<Vec<FleetJob>> {
    let mut all: Vec<FleetJob> = Vec::new();
    for (at, root) in data.iter().enumerate() {
        let found = match root.is_file() {
            true => {
                let folder = pieces.join(at.to_string());
                std::fs::create_dir(&folder).map_err(in_file(&folder))?;
                jobs_of_table(root, &folder)?
            }
            false => find_jobs(root, out)?,
        };
        if let Some(line) = mixed_forms(root, &found).filter(|_| root.is_dir()) {
            print_message(&format!("fleet: {line}"));
        }
        let names = |job: &FleetJob| (job.joint.clone(), job.campaign.clone());
        if let Some(twice) = found.iter().find(|job| all.iter().any(|of| names(of) == names(job))) {
            let FleetJob { joint, campaign, .. } = twice;
            let twice = format!("joint {joint}, campaign {campaign:?} a second time");
            let expected = "once in all folders and tables";
            return Err(found_in(root.display().to_string(), twice, expected));
        }
        all.extend(found);
    }
    Ok(all)
}

/// Diagnoses all logs. In a pipe, a line every 30 s says how far it is.
fn diagnose_all(
    jobs: &[FleetJob],
    options: &FleetOptions,
    threads: usize,
) -> Result<Vec<FleetRow>> {
    let (begin, count) = (Instant::now(), AtomicUsize::new(0));
    let state = || {
        let done = count.load(Ordering::Relaxed);
        let left = match done {
            0 => String::new(),
            done => {
                let each_s = begin.elapsed().as_secs_f64() / done as f64;
                format!(", about {} left", duration_in_words(each_s * (jobs.len() - done) as f64))
            }
        };
        format!("diagnosed {done} of {} logs{left}", jobs.len())
    };
    let work = || {
        work::report_stage(&state());
        let run = |job: &FleetJob| {
            let rows = run_task(job, options);
            count.fetch_add(1, Ordering::Relaxed);
            work::report_stage(&state());
            rows
        };
        let rows: Vec<Vec<FleetRow>> = jobs.par_iter().map(run).collect();
        Ok::<_, Error>(rows.concat())
    };
    // A defect in one log is the reason in its row; the trace of its panic would stand between the lines of the others.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let computed = match std::io::stderr().is_terminal() {
        true => in_stages(threads, work),
        false => {
            with_lines(LINE_EVERY, || eprintln!("fleet: {}", state()), || in_stages(threads, work))
        }
    };
    std::panic::set_hook(hook);
    Ok(computed?)
}

/// Parses a limit of a level.
fn parse_limit(text: &str) -> Result<Limit> {
    let expected = || {
        let expected = format!("LEVEL=VALUE with a level of {}", LEVELS.join(", "));
        found_in("--limit", format!("{text:?}"), expected)
    };
    let (level, value) = text.split_once('=').ok_or_else(expected)?;
    let value = value.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let is_known = LEVELS.contains(&level.trim());
    let value = value.filter(|_| is_known).ok_or_else(expected)?;
    Ok(Limit { level: level.trim().into(), value })
}

fn print(
    arguments: &FleetArguments,
    rows: &[FleetRow],
    ageing: &[Ageing],
    limits: &[Limit],
) -> Result {
    let out = arguments.out.display();
    let fleet = summarise(rows, ageing, limits);
    let joints = &fleet.joints;
    if arguments.json {
        let document = json!({
            "schema": 1, "rows": rows, "ageing": ageing, "shared": fleet.shared, "notes": fleet.notes,
            "joints": joints,
        });
        return print_text(&pretty(&document)?);
    }
    let mut text = format!("{}\n", fleet.in_words());
    for joint in joints.iter().filter(|joint| !joint.reasons.is_empty()) {
        text += &format!("- {}: {}\n", joint.joint, joint.reasons.join("; "));
    }
    text += &table::joints(joints);
    let failed: Vec<&FleetRow> = rows.iter().filter(|row| !row.is_ok()).collect();
    let named = rows.iter().filter(|row| row.is_ok() && row.cause != "none").count();
    text += &format!(
        "{} logs diagnosed, {} failed; {named} name a cause\n",
        rows.len() - failed.len(),
        failed.len()
    );
    for row in failed {
        let reason = row.error.as_deref().unwrap_or_default();
        let campaign = if row.campaign.is_empty() { "" } else { ", campaign " };
        text += &format!("failed: joint {}{campaign}{}: {reason}\n", row.joint, row.campaign);
    }
    print_formatted(&format!("{text}written: {out}/fleet.parquet, {out}/fleet.html\n"))
}
