//! Runs the contest on a log and prints one line of JSON.
//!
//! ```text
//! cargo run --release -p friction-diagnose --example contest -- DATA [--columns a=b,..] [--rigid-body inertia,gravity,load,offset]
//!     [--skip N] [--decimate N] [--motion logged]
//! ```

use friction_diagnose::contest::{Figures, Outcome, RigidBody, Rows, contest};
use joint_log::log_check::{self, Corrections};
use joint_log::{Dataset, ReadOptions, read};
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::error::Error;
use std::path::PathBuf;

/// Arguments of the program.
#[derive(Default)]
struct Arguments {
    files: Vec<PathBuf>,
    read: ReadOptions,
    rigid_body: RigidBody,
    decimate: usize,
    is_motion_logged: bool,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut arguments = Arguments { decimate: 1, ..Arguments::default() };
    let mut given = std::env::args().skip(1);
    while let Some(word) = given.next() {
        let mut value = || given.next().ok_or_else(|| format!("{word}: expected a value"));
        match word.as_str() {
            "--columns" => {
                for pair in value()?.split(',') {
                    let (ours, theirs) = pair.split_once('=').ok_or("--columns: expected a=b")?;
                    arguments.read.columns.push((ours.into(), theirs.into()));
                }
            }
            "--rigid-body" => arguments.rigid_body = rigid_body(&value()?)?,
            "--skip" => {
                arguments.read.skip = value()?.parse().map_err(|e| format!("--skip: {e}"))?
            }
            "--decimate" => {
                arguments.decimate = value()?.parse().map_err(|e| format!("--decimate: {e}"))?
            }
            "--motion" => arguments.is_motion_logged = value()? == "logged",
            file => arguments.files.push(file.into()),
        }
    }
    Ok(arguments)
}

fn rigid_body(list: &str) -> Result<RigidBody, Box<dyn Error>> {
    let mut parts = RigidBody::default();
    for part in list.split(',').filter(|part| !part.is_empty()) {
        match part {
            "inertia" => parts.inertia = true,
            "gravity" => parts.gravity = true,
            "load" => parts.load = true,
            "offset" => parts.offset = true,
            _ => return Err(format!("--rigid-body: unknown part {part}").into()),
        }
    }
    Ok(parts)
}

/// Processor time of the process, s.
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = arguments()?;
    let begin = processor_s();
    let data = read(&arguments.files, &arguments.read, &|_, _| {}).map_err(|e| e.to_string())?;
    let correct = Corrections::of_motion(arguments.is_motion_logged.then_some(false));
    let data: Dataset = log_check::check(data, correct).data;
    let read = processor_s();
    let mut rows = Rows::new(&data, arguments.rigid_body, arguments.decimate);
    let outcome = contest(&mut rows);
    let seconds = [read - begin, processor_s() - read];
    println!("{}", describe(&outcome, rows.len(), seconds));
    Ok(())
}

fn describe(outcome: &Outcome, rows: usize, seconds: [f64; 2]) -> Value {
    json!({
        "law": outcome.law,
        "correction": outcome.finalists.first().map(|best| format!("{:?}", best.correction)),
        "reversed": outcome.is_reversed,
        "base_rmse": outcome.base_rmse,
        "rmse": outcome.rmse,
        "gain": 1.0 - outcome.rmse / outcome.base_rmse,
        "error_ratio": outcome.error_ratio,
        "noise_floor": outcome.noise_floor,
        "floors": outcome.floors,
        "base_floors": outcome.base_floors,
        "rows": rows,
        "runs": outcome.runs,
        "hypotheses": outcome.hypotheses,
        "seconds": { "read": seconds[0], "contest": seconds[1] },
        "causes": outcome.causes.iter().map(figures).collect::<Vec<_>>(),
    })
}

fn figures(figures: &Figures) -> Value {
    let confusable = figures.confusable_with.iter().map(|key| key.cause).collect::<Vec<_>>();
    json!({
        "cause": figures.key.cause,
        "follows": figures.key.follows(),
        "detail": figures.detail.to_string(),
        "in_best": figures.is_in_best,
        "inclusion": figures.inclusion,
        "materiality": figures.materiality(),
        "alone": figures.alone,
        "last": figures.last,
        "irreplaceable": figures.irreplaceable,
        "last_in_errors": figures.last_in_errors,
        "torque_share": figures.torque_share,
        "laws": figures.laws,
        "beside_slip": figures.beside_slip,
        "size_in_errors": figures.size_in_errors,
        "confusable_with": confusable,
    })
}
