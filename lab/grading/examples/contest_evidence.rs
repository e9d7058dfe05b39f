//! Runs the contest on logs with known causes, prints the verdicts of a plain rule, and writes the evidence for a calibration.
//!
//! ```text
//! cargo run --release -p unkind-worlds --example write_worlds -- mixed 43001 2000 DIR
//! cargo run --release -p friction-grading --example contest_evidence -- DIR --measured ../shared/data --out evidence.tsv
//! ```

use clap::Parser;
use friction_grading::contest_logs::{self, KnownLog};
use friction_grading::contest_verdicts::Grades;
use friction_grading::evidence_table::{EvidenceRow, emit};
use friction_grading::{GradingError, end};
use rayon::prelude::*;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Collects the evidence of contests.
#[derive(Parser)]
struct Arguments {
    /// Folders of worlds, each a pair of NAME.csv and NAME.json
    folders: Vec<PathBuf>,
    /// Folders of measured logs
    #[arg(long)]
    measured: Vec<PathBuf>,
    /// Most worlds of each folder
    #[arg(long, default_value_t = usize::MAX)]
    worlds: usize,
    /// Only logs with this text in their name
    #[arg(long, default_value = "")]
    only: String,
    /// File of the evidence
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Least inclusion of the plain rule.
const MIN_INCLUSION: f64 = 0.5;
/// Least materiality of the plain rule.
const MIN_MATERIALITY: f64 = 0.04;

fn main() -> ExitCode {
    end(run(&Arguments::parse()))
}

/// Collects the evidence. A log that the product refuses has none: it is named, and counted.
fn run(arguments: &Arguments) -> Result<(), GradingError> {
    let mut logs: Vec<KnownLog> = Vec::new();
    for folder in &arguments.folders {
        logs.extend(contest_logs::worlds(folder)?.into_iter().take(arguments.worlds));
    }
    for folder in &arguments.measured {
        logs.extend(contest_logs::measured(folder)?);
    }
    logs.retain(|log| log.name.contains(&arguments.only));
    let (begin, done, refused) = (Instant::now(), AtomicUsize::new(0), AtomicUsize::new(0));
    let evidence = |log: &KnownLog| {
        let rows = log.evidence().inspect_err(|why| {
            eprintln!("REFUSED {why}");
            refused.fetch_add(1, Ordering::Relaxed);
        });
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        if count % 100 == 0 {
            eprintln!("{count} of {}, {:.0} s", logs.len(), begin.elapsed().as_secs_f64());
        }
        rows.unwrap_or_default()
    };
    let rows: Vec<EvidenceRow> = logs.par_iter().flat_map_iter(evidence).collect();
    println!("{} of {} logs are refused\n", refused.into_inner(), logs.len());
    // The rank of a named candidate is its materiality.
    let score = |row: &EvidenceRow| {
        if row.inclusion >= MIN_INCLUSION { row.materiality } else { f64::NEG_INFINITY }
    };
    let scores: Vec<f64> = rows.iter().map(score).collect();
    println!("{}", Grades::new(&rows, &scores, MIN_MATERIALITY).tables());
    if let Some(path) = &arguments.out {
        std::fs::write(path, emit(&rows)).map_err(GradingError::io(path))?;
    }
    Ok(())
}
