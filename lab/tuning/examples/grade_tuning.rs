//! Grades `tune` on drawn joints and writes a table: `cargo run --release -p tuned-joints --example grade_tuning -- --seed N`.

use clap::Parser;
use rayon::prelude::*;
use std::fmt::Write;
use tuned_joints::{Case, Fault, Grade, SHOWN_BY_MOTION, Start, grade, grade_fault};

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
    /// File of the sessions
    #[arg(long)]
    out: std::path::PathBuf,
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
    let Grade { case, claimed: [reversal, rms], true_gains, rival_ratio, .. } = graded;
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
    for number in reversal.iter().chain(rms).chain(true_gains).chain(rival_ratio) {
        let _ = write!(line, "\t{number:.3}");
    }
    let _ = write!(line, "\t{:.0}\t{}", graded.seconds, graded.why_not);
    line
}

const HEADER: &str = "seed\thidden\tstart\tfamily\tsaved\tcause\tprobability\treversal_gain\treversal_low\treversal_high\trms_gain\trms_low\trms_high\ttrue_reversal_gain\ttrue_rms_gain\trival_reversal_ratio\trival_rms_ratio\tseconds\twhy_not";

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

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
    let faults: Vec<(u64, Fault, f64)> = (0..arguments.faults)
        .map(|at| {
            let seed = arguments.seed + 3000 + at;
            (
                seed,
                Fault::ALL[(at % 4) as usize],
                0.1 + 0.6 * (at as f64 + 0.5) / arguments.faults as f64,
            )
        })
        .collect();
    text += "\nseed\tfault\tat_s\tnoticed\tsafe\tformer_set\twhy\n";
    for one in faults
        .par_iter()
        .map(|(seed, fault, share)| grade_fault(*seed, *fault, *share))
        .collect::<Vec<_>>()
    {
        match one {
            Ok(own) => {
                let _ = writeln!(
                    text,
                    "{}\t{}\t{:.0}\t{}\t{}\t{}\t{}",
                    own.seed,
                    own.fault.name(),
                    own.at_s,
                    own.is_noticed,
                    own.is_safe,
                    own.is_former,
                    own.why
                );
            }
            Err(why) => eprintln!("fault: {why}"),
        }
    }
    std::fs::write(&arguments.out, &text).expect("the table can be written");
    let part = |hidden: bool, start: Start| -> Vec<&Grade> {
        graded
            .iter()
            .filter(|own| own.case.hidden.is_some() == hidden && own.case.start == start)
            .collect()
    };
    for (name, own) in [
        ("hidden, commissioned", part(true, Start::Commissioned)),
        ("hidden, tuned before", part(true, Start::TunedBefore)),
        ("clean, tuned before", part(false, Start::TunedBefore)),
    ] {
        let saved = own.iter().filter(|own| own.is_saved).count();
        let gains =
            [0, 1].map(|place| median(own.iter().map(|own| own.true_gains[place]).collect()));
        let worst = own.iter().flat_map(|own| own.true_gains).fold(f64::INFINITY, f64::min);
        let rival =
            [0, 1].map(|place| median(own.iter().map(|own| own.rival_ratio[place]).collect()));
        let right = own.iter().filter(|own| Some(own.cause.as_str()) == own.case.hidden).count();
        println!(
            "{name}: {} joints, saved {saved}, true gain {:.2} reversals {:.2} rms (median), worst {worst:.2}, rival {:.2} {:.2}, right cause {right}",
            own.len(),
            gains[0],
            gains[1],
            rival[0],
            rival[1]
        );
    }
}
