//! Grades `tune` on drawn joints and writes a table: `cargo run --release -p tuned-joints --example grade_tuning -- --seed N`.

use clap::Parser;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tuned_joints::{
    Case, Fault, FaultGrade, GainInterval, Grade, SHOWN_BY_MOTION, Start, grade, grade_fault,
    summary,
};

/// Arguments.
#[derive(Parser)]
struct Arguments {
    /// First seed
    #[arg(long)]
    seed: u64,
    /// Joints with a hidden effect, as commissioned
    #[arg(long, default_value_t = 100)]
    hidden: u64,
    /// Joints with a hidden effect that appeared after they were tuned
    #[arg(long, default_value_t = 40)]
    late: u64,
    /// Clean joints that are tuned already
    #[arg(long, default_value_t = 20)]
    clean: u64,
    /// Joints with a fault in the middle
    #[arg(long, default_value_t = 20)]
    faults: u64,
    /// Folder of tuning-benchmark.tsv
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/graded"))]
    out: PathBuf,
    /// Folder of tuning-sessions.tsv, which has every session
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/figures"))]
    sessions: PathBuf,
}

fn cases(arguments: &Arguments) -> Vec<Case> {
    let hidden = |at: u64| Some(SHOWN_BY_MOTION[(at % SHOWN_BY_MOTION.len() as u64) as usize]);
    let first = arguments.seed;
    let fresh = (0..arguments.hidden).map(|at| Case {
        seed: first + at,
        hidden: hidden(at),
        start: Start::Commissioned,
    });
    let late = (0..arguments.late).map(|at| Case {
        seed: first + 1000 + at,
        hidden: hidden(at),
        start: Start::TunedBefore,
    });
    let clean = (0..arguments.clean).map(|at| Case {
        seed: first + 2000 + at,
        hidden: None,
        start: Start::TunedBefore,
    });
    fresh.chain(late).chain(clean).collect()
}

fn row(graded: &Grade) -> String {
    let Grade { case, claimed, true_gains, rival_ratio, .. } = graded;
    let mut line = format!(
        "{}\t{}\t{}\t{}\t{}\t{}\t{:.2}",
        case.seed,
        case.hidden.unwrap_or("none"),
        if case.start == Start::Commissioned { "commissioned" } else { "tuned" },
        graded.family,
        graded.is_saved,
        graded.cause,
        graded.probability
    );
    for GainInterval { gain, low, high } in claimed.both().into_iter().chain(true_gains.both()) {
        let _ = write!(line, "\t{gain:.3}\t{low:.3}\t{high:.3}");
    }
    let ratios = rival_ratio
        .map_or([[f64::NAN; 2]; 2], |ratio| [ratio.by_truth.both(), ratio.by_encoder.both()]);
    for number in ratios.as_flattened() {
        let _ = write!(line, "\t{number:.3}");
    }
    let _ = write!(line, "\t{:.0}\t{}", graded.seconds, graded.why_not);
    line
}

const HEADER: &str = "seed\thidden\tstart\tfamily\tsaved\tcause\tprobability\treversal_gain\treversal_low\treversal_high\trms_gain\trms_low\trms_high\ttrue_reversal_gain\ttrue_reversal_low\ttrue_reversal_high\ttrue_rms_gain\ttrue_rms_low\ttrue_rms_high\trival_reversal_ratio\trival_rms_ratio\trival_reversal_encoder\trival_rms_encoder\tseconds\twhy_not";

fn main() {
    let arguments = Arguments::parse();
    let graded: Vec<Grade> = cases(&arguments)
        .par_iter()
        .filter_map(|case| match grade(case) {
            Ok(graded) => Some(graded),
            Err(why) => {
                eprintln!("seed {} {:?}: {why}", case.seed, case.hidden);
                None
            }
        })
        .collect();
    let mut text = format!("{HEADER}\n");
    for one in &graded {
        text += &(row(one) + "\n");
    }
    let requests: Vec<(u64, Fault, f64)> = (0..arguments.faults)
        .map(|at| {
            let share = 0.05 + 0.65 * (at as f64 + 0.5) / arguments.faults as f64;
            (arguments.seed + 3000 + at, Fault::ALL[(at % 4) as usize], share)
        })
        .collect();
    let faults: Vec<FaultGrade> = requests
        .par_iter()
        .filter_map(|(seed, fault, share)| match grade_fault(*seed, *fault, *share) {
            Ok(graded) => Some(graded),
            Err(why) => {
                eprintln!("seed {seed} {}: {why}", fault.name());
                None
            }
        })
        .collect();
    text += "\nseed\tfault\tat_s\tnoticed\tsafe\tformer_set\twhy\n";
    for grade in &faults {
        let FaultGrade { seed, fault, at_s, is_noticed, is_safe, is_former, why } = grade;
        let fault = fault.name();
        let _ = writeln!(
            text,
            "{seed}\t{fault}\t{at_s:.0}\t{is_noticed}\t{is_safe}\t{is_former}\t{why}"
        );
    }
    write(&arguments.sessions, "tuning-sessions.tsv", &text);
    let mut table = format!(
        "Simulated: seed {0}, by `cargo run --release -p tuned-joints --example grade_tuning -- --seed {0}`.\n\n\
         what\tjoints\tfigure\tgoal\n",
        arguments.seed
    );
    for row in summary::rows(&graded, &faults) {
        table += &(row.join("\t") + "\n");
    }
    write(&arguments.out, "tuning-benchmark.tsv", &table);
    print!("{table}");
}

fn write(folder: &Path, name: &str, text: &str) {
    let written =
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(folder.join(name), text));
    written.unwrap_or_else(|error| panic!("{name}: {error}"));
}
