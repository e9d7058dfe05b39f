//! Grades the finding of a gear's play from two positions on drawn joints, and calibrates its probability.
//!
//! ```text
//! cargo run --release -p friction-grading --example two_positions -- --calibrate          play_calibration.toml
//! cargo run --release -p friction-grading --example two_positions -- --seed S --update    graded/two-positions.tsv
//! cargo run --release -p friction-grading --example two_positions -- --seed S             prints only
//! ```
//!
//! The seeds of the calibration are constant. Those of a grade are chosen after the last change of the diagnosis.

use clap::Parser;
use friction_diagnose::two_positions::FIGURES;
use friction_grading::calibration_tables;
use friction_grading::gear_play::{PlayCase, cases, fit, table};

/// Grades or calibrates.
#[derive(Parser)]
struct Arguments {
    /// Number of joints
    #[arg(long, default_value_t = 1000)]
    joints: usize,
    /// First seed of the joints
    #[arg(long, default_value_t = CALIBRATION_SEED)]
    seed: u64,
    /// Fits the calibration and writes its table
    #[arg(long)]
    calibrate: bool,
    /// Writes the table of the grades
    #[arg(long)]
    update: bool,
    /// Prints each joint
    #[arg(long)]
    list: bool,
}

/// First seed of the joints of the calibration.
const CALIBRATION_SEED: u64 = 20_000;

fn main() -> Result<(), String> {
    let arguments = Arguments::parse();
    let cases = cases(arguments.seed, arguments.joints);
    if arguments.list {
        println!(
            "joint\tseed\tplay\ttorsion\tfound\tlost motion\tprobability\t{}",
            FIGURES.join("\t")
        );
        cases.iter().for_each(print);
    }
    let write = |path: &str, text: &str| {
        let path = format!("{}/{path}", env!("CARGO_MANIFEST_DIR"));
        std::fs::write(&path, text).map_err(|e| format!("{path}: {e}"))
    };
    if arguments.calibrate {
        let table = calibration_tables::of_play(&fit(&cases));
        return write("../../host-sim/diagnose/play_calibration.toml", &table);
    }
    let text = table(arguments.seed, &cases);
    println!("{text}");
    if arguments.update { write("graded/two-positions.tsv", &text) } else { Ok(()) }
}

fn print(case: &PlayCase) {
    let (name, seed, play) = (case.fault.name(), case.seed, case.joint.gear.play_rad);
    let found = case.found.as_ref().map_or_else(String::new, |found| {
        let figures: Vec<String> =
            found.figures.iter().map(|figure| format!("{figure:.2}")).collect();
        format!(
            "{:.2e}\t{:.2e}\t{:.3}\t{}",
            found.play.value,
            found.lost_motion,
            found.probability,
            figures.join("\t")
        )
    });
    println!("{name}\t{seed}\t{play:.2e}\t{:.2e}\t{found}", case.torsion_rad());
}
