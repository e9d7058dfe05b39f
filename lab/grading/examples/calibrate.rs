//! Fits the calibration of the diagnosis to simulated worlds.
//!
//! ```text
//! cargo run --release -p friction-grading --example calibrate -- --worlds 2000          host-sim/diagnose/calibration.toml
//! cargo run --release -p friction-grading --example calibrate -- --worlds 20 --check    a reduced run that writes nothing
//! ```
//!
//! The cases of each world are appended to `--cases`, so that an interrupted run continues where it ended. Delete the file
//! after a change of the diagnosis.

use clap::Parser;
use friction_diagnose::calibration::{Calibration, Case, Logistic, out_of_fold};
use friction_grading::evidence_cases::{WorldCases, world_cases};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Fits the calibration.
#[derive(Parser)]
struct Arguments {
    /// Number of worlds
    #[arg(long, default_value_t = 2000)]
    worlds: usize,
    /// Base of their seeds, which must differ from those of gradings
    #[arg(long, default_value_t = 29)]
    seed: u64,
    /// File of the cases
    #[arg(long, default_value = "target/calibration-cases.jsonl")]
    cases: PathBuf,
    /// Number of worlds computed at once
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Largest share of worlds with a wrong name. At 0.02, measured logs lose right names that are given with 0.6 to 0.7
    #[arg(long, default_value_t = 0.07)]
    wrong: f64,
    /// Fits and prints, but does not write the table
    #[arg(long)]
    check: bool,
    /// Only fits the worlds that the file already holds
    #[arg(long)]
    fit_only: bool,
}

fn main() -> Result<(), String> {
    let arguments = Arguments::parse();
    let seeds: Vec<u64> = unkind_worlds::seeds(arguments.seed).take(arguments.worlds).collect();
    let mut worlds = known(&arguments, &seeds);
    println!("{} of {} worlds are known", worlds.len(), seeds.len());
    if !arguments.fit_only {
        let open: Vec<u64> =
            seeds.iter().copied().filter(|s| worlds.iter().all(|w| w.seed != *s)).collect();
        worlds.extend(diagnosed(&arguments, &open)?);
    }
    let findings: Vec<Case> = worlds.iter().flat_map(|world| world.findings.clone()).collect();
    let candidates: Vec<Case> = worlds.iter().flat_map(|world| world.candidates.clone()).collect();
    let finding = Logistic::fit(&findings);
    let naming_threshold = threshold(&worlds, &findings, &finding, arguments.wrong);
    let calibration = Calibration {
        name: format!("calibration.toml, {} simulated worlds", worlds.len()),
        naming_threshold,
        finding,
        candidate: Logistic::fit(&candidates),
    };
    println!("{}", calibration.emit());
    println!("{}", reliability(&findings, &calibration.finding));
    if arguments.check {
        return Ok(());
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../host-sim/diagnose/calibration.toml");
    std::fs::write(path, calibration.emit()).map_err(|e| format!("{path}: {e}"))
}

/// Returns the worlds that the file of the cases holds.
fn known(arguments: &Arguments, seeds: &[u64]) -> Vec<WorldCases> {
    let text = std::fs::read_to_string(&arguments.cases).unwrap_or_default();
    let worlds = text.lines().filter_map(WorldCases::parse);
    worlds.filter(|world| seeds.contains(&world.seed)).collect()
}

/// Diagnoses worlds and appends their cases to the file.
fn diagnosed(arguments: &Arguments, seeds: &[u64]) -> Result<Vec<WorldCases>, String> {
    let path = &arguments.cases;
    let failed = |e: std::io::Error| format!("{}: {e}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
    let (next, done) = (AtomicUsize::new(0), Mutex::new((Vec::new(), file)));
    std::thread::scope(|scope| {
        for _ in 0..arguments.threads.max(1) {
            scope.spawn(|| {
                while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let Ok(world) = world_cases(seed).map_err(|why| eprintln!("FAILED {why}"))
                    else {
                        continue;
                    };
                    if let Ok(mut done) = done.lock() {
                        let _ = writeln!(done.1, "{}", world.emit());
                        done.0.push(world);
                        eprintln!("{} of {}", done.0.len(), seeds.len());
                    }
                }
            });
        }
    });
    Ok(done.into_inner().map(|done| done.0).unwrap_or_default())
}

/// Returns the lowest threshold at which at most this share of the worlds has a wrong name, by probabilities that each
/// fold's weights have not seen.
///
/// The first cause at or above the threshold is the name of a world.
fn threshold(worlds: &[WorldCases], findings: &[Case], model: &Logistic, wrong: f64) -> f64 {
    let mut probabilities =
        out_of_fold(findings).into_iter().map(|(odds, is_real)| (model.calibrated(odds), is_real));
    let by_world: Vec<Vec<(f64, bool)>> =
        worlds.iter().map(|w| probabilities.by_ref().take(w.findings.len()).collect()).collect();
    let named = |threshold: f64| {
        by_world.iter().filter_map(move |world| world.iter().find(|(p, _)| *p >= threshold))
    };
    let thresholds = (30..100).map(|percent| f64::from(percent) / 100.0);
    for threshold in thresholds.clone().step_by(5) {
        let names = named(threshold).count();
        let real = named(threshold).filter(|(_, is_real)| *is_real).count();
        let seen = worlds.iter().filter(|world| world.is_detectable).count();
        println!(
            "threshold {threshold:.2}: {real} real and {} wrong names, {seen} detectable",
            names - real
        );
    }
    let is_low = |threshold: &f64| {
        let false_names = named(*threshold).filter(|(_, is_real)| !is_real).count();
        false_names as f64 <= wrong * worlds.len() as f64
    };
    thresholds.clone().find(is_low).unwrap_or(0.99)
}

/// Returns the reliability of out-of-fold probabilities: count, mean probability and frequency by bin, and the Brier score.
fn reliability(findings: &[Case], model: &Logistic) -> String {
    let pairs: Vec<(f64, f64)> = out_of_fold(findings)
        .into_iter()
        .map(|(odds, is_real)| (model.calibrated(odds), f64::from(u8::from(is_real))))
        .collect();
    let mut text = String::from("| probability | causes | mean | real |\n|---|---|---|---|\n");
    for bin in 0..10 {
        let (low, high) = (0.1 * f64::from(bin), 0.1 * f64::from(bin + 1));
        let own: Vec<&(f64, f64)> = pairs.iter().filter(|(p, _)| (low..high).contains(p)).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| {
            own.iter().map(|pair| of(pair)).sum::<f64>() / own.len().max(1) as f64
        };
        text += &format!(
            "| {low:.1} to {high:.1} | {} | {:.2} | {:.2} |\n",
            own.len(),
            mean(|p| p.0),
            mean(|p| p.1)
        );
    }
    let brier = pairs.iter().map(|(p, real)| (p - real).powi(2)).sum::<f64>();
    text + &format!("\nBrier score {:.3}\n", brier / pairs.len().max(1) as f64)
}
