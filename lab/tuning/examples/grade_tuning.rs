//! Grades `tune` on drawn joints and writes a table: `cargo run --release -p tuned-joints --example grade_tuning -- --seed N`.

use clap::Parser;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tuned_joints::{
    Case, Fault, FaultGrade, GainInterval, Grade, GradeError, SHOWN_BY_MOTION, Start, grade,
    grade_fault, summary,
};

/// Seeds of a part. More joints would be those of the next part.
const SEEDS_OF_PART: u64 = 1000;

/// Arguments.
#[derive(Parser)]
struct Arguments {
    /// First seed
    #[arg(long)]
    seed: u64,
    /// Joints with a hidden effect, as commissioned
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(..=SEEDS_OF_PART))]
    hidden: u64,
    /// Joints with a hidden effect that appeared after they were tuned
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u64).range(..=SEEDS_OF_PART))]
    late: u64,
    /// Clean joints that are tuned already
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(..=SEEDS_OF_PART))]
    clean: u64,
    /// Joints with a fault in the middle
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(..=SEEDS_OF_PART))]
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
        seed: first + SEEDS_OF_PART + at,
        hidden: hidden(at),
        start: Start::TunedBefore,
    });
    let clean = (0..arguments.clean).map(|at| Case {
        seed: first + 2 * SEEDS_OF_PART + at,
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

/// Returns a grade, or reports why a joint has none. The summary counts it as not graded.
fn or_reported<T>(grade: Result<T, GradeError>, seed: u64, joint: &str) -> Option<T> {
    grade.inspect_err(|why| eprintln!("seed {seed} {joint}: not graded: {why}")).ok()
}

fn fault_grades(arguments: &Arguments) -> Vec<FaultGrade> {
    let graded = |at: u64| {
        let seed = arguments.seed + 3 * SEEDS_OF_PART + at;
        let fault = Fault::ALL[at as usize % Fault::ALL.len()];
        let share = 0.05 + 0.65 * (at as f64 + 0.5) / arguments.faults as f64;
        or_reported(grade_fault(seed, fault, share), seed, fault.name())
    };
    (0..arguments.faults).into_par_iter().filter_map(graded).collect()
}

fn main() {
    let arguments = Arguments::parse();
    let cases = cases(&arguments);
    let graded = |case: &Case| or_reported(grade(case), case.seed, case.hidden.unwrap_or("clean"));
    let graded: Vec<Grade> = cases.par_iter().filter_map(graded).collect();
    let mut text = format!("{HEADER}\n");
    for one in &graded {
        text += &(row(one) + "\n");
    }
    let faults = fault_grades(&arguments);
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
    let Arguments { seed, hidden, late, clean, faults: requested_faults, .. } = arguments;
    let mut table = format!(
        "Simulated: seed {seed}, by `cargo run --release -p tuned-joints --example grade_tuning -- --seed {seed} --hidden {hidden} \
         --late {late} --clean {clean} --faults {requested_faults}`.\n\nwhat\tjoints\tfigure\tgoal\n"
    );
    for row in summary::rows(&cases, &graded, requested_faults as usize, &faults) {
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
