//! Grades the diagnosis on scenarios with hidden effects: `cargo run --release -p friction-grading --example benchmark -- --help`.

use clap::Parser;
use friction_grading::{Grade, GradingError, TUNING_SEED, end, grade_scenario};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use unkind_worlds::planned::{Kind, benchmark, draw};

/// Grades the diagnosis on scenarios with hidden effects.
#[derive(Parser)]
struct Arguments {
    /// Base of the seeds
    #[arg(default_value_t = TUNING_SEED)]
    seed: u64,
    /// Scenarios of each kind
    #[arg(default_value_t = 1)]
    per_kind: usize,
    /// Only kinds with this text in their name
    #[arg(default_value = "")]
    filter: String,
    /// Writes the logs to this folder instead of grading them
    folder: Option<PathBuf>,
}

fn main() -> ExitCode {
    end(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), GradingError> {
    let scenarios: Vec<(Kind, u64)> = benchmark(arguments.seed, arguments.per_kind)
        .filter(|(kind, _)| format!("{kind:?}").contains(&arguments.filter))
        .collect();
    if let Some(folder) = &arguments.folder {
        for (index, (kind, seed)) in scenarios.iter().enumerate() {
            let scenario = draw(*kind, *seed);
            println!(
                "{index} {:?} {:?} {} Hz noise {}",
                scenario.truth.hidden,
                scenario.truth.seal,
                scenario.truth.rate_hz,
                scenario.truth.noise_nm
            );
            let path = folder.join(format!("{index}.csv"));
            std::fs::write(&path, scenario.log.csv()).map_err(GradingError::io(&path))?;
        }
        return Ok(());
    }
    let grades = scenarios.into_par_iter().map(|(kind, seed)| grade_scenario(kind, seed));
    let mut grades = grades.collect::<Result<Vec<Grade>, GradingError>>()?;
    grades.sort_by_key(|grade| format!("{:?}", grade.kind));
    report(&grades);
    Ok(())
}

/// Prints each grade, and the counts of each kind.
fn report(grades: &[Grade]) {
    let mut by_kind: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    let (mut inside, mut sized, mut low) = (0, 0, 0);
    for grade in grades {
        let entry = by_kind.entry(grade.kind.name()).or_default();
        entry.1 += 1;
        entry.0 += usize::from(grade.right);
        sized += usize::from(grade.sizes.is_some());
        inside += usize::from(grade.sizes.is_some_and(|sizes| sizes.is_inside()));
        low += usize::from(grade.error_over_noise <= 1.2);
        println!(
            "{} {:?} seed {} rows {} visible {:.2} named {:?} confusable {:?} error/noise {:.3} {:.1} s size {:?}",
            if grade.right { "ok   " } else { "WRONG" },
            grade.kind,
            grade.seed,
            grade.rows,
            grade.visible,
            grade.named,
            grade.confusable,
            grade.error_over_noise,
            grade.seconds,
            grade.sizes
        );
        if !grade.right {
            println!("      hidden {:?}; candidates {}", grade.hidden, grade.candidates);
        }
    }
    for (kind, (right, all)) in by_kind {
        println!("{kind}: {right} of {all}");
    }
    println!(
        "sizes inside {inside} of {sized}; error within 1.2 of noise {low} of {}",
        grades.len()
    );
}
