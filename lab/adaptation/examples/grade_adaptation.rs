//! Grades the adaptation and writes its tables: `cargo run --release -p drifting-joints --example grade_adaptation -- --seed N`.

use clap::Parser;
use compensator_core::adaptation::Gains;
use drifting_joints::GradeError;
use drifting_joints::drift::{Drift, MomentGrade, SteadyGrade, grade_drift, grade_steady};
use drifting_joints::lies::{LieGrade, PreparedJoint, grade_lie};
use drifting_joints::summary;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Arguments.
#[derive(Parser)]
struct Arguments {
    /// First seed
    #[arg(long)]
    seed: u64,
    /// A few courses only
    #[arg(long)]
    quick: bool,
    /// Joints per drift; 0 leaves its tables
    #[arg(long, default_value_t = 24)]
    drifting: u64,
    /// Joints that do not change, over two hours; 0 leaves its tables
    #[arg(long, default_value_t = 20)]
    steady: u64,
    /// Courses that lie; 0 leaves its tables
    #[arg(long, default_value_t = 1000)]
    lies: u64,
    /// Folder of the summaries
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/graded"))]
    out: PathBuf,
    /// Folder of the tables of all courses
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/figures"))]
    courses: PathBuf,
}

/// Courses per joint of those that lie.
const COURSES_PER_JOINT: u64 = 25;

fn found<T>(what: &str, graded: Result<T, GradeError>) -> Option<T> {
    graded.inspect_err(|why| eprintln!("{what}: {why}")).ok()
}

fn drifts(arguments: &Arguments) -> Vec<MomentGrade> {
    let cases: Vec<(u64, Drift)> = (0..arguments.drifting)
        .flat_map(|at| Drift::ALL.map(|drift| (arguments.seed + at, drift)))
        .collect();
    let grade = |(seed, drift): &(u64, Drift)| {
        found(&format!("seed {seed} {drift:?}"), grade_drift(*seed, *drift))
    };
    cases.par_iter().filter_map(grade).flatten().collect()
}

fn steady(arguments: &Arguments) -> Vec<SteadyGrade> {
    let parts = if arguments.quick { 3 } else { 12 };
    let grade =
        |at: u64| found(&format!("seed {at}"), grade_steady(arguments.seed + 1000 + at, parts));
    (0..arguments.steady).into_par_iter().filter_map(grade).collect()
}

fn lies(arguments: &Arguments) -> Vec<LieGrade> {
    let joints: Vec<PreparedJoint> = (0..arguments.lies.div_ceil(COURSES_PER_JOINT))
        .into_par_iter()
        .filter_map(|at| {
            found(&format!("seed {at}"), PreparedJoint::draw(arguments.seed + 2000 + at))
        })
        .collect();
    let grade = |course: u64| {
        let joint = joints.get(course as usize % joints.len().max(1))?;
        found(
            &format!("course {course}"),
            grade_lie(joint, arguments.seed.wrapping_mul(1600) + course),
        )
    };
    (0..arguments.lies).into_par_iter().filter_map(grade).collect()
}

fn drift_table(grades: &[MomentGrade]) -> String {
    let mut text = "seed\tfamily\tdrift\ttime_s\toff_mrad\tfixed_mrad\tadaptive_mrad\ttuned_anew_mrad\tobserver_mrad\tlevel\tviscous\ttrue_level\n".to_owned();
    for grade in grades {
        let head = format!(
            "{}\t{}\t{}\t{:.0}",
            grade.seed,
            grade.family,
            grade.drift.name(),
            grade.time_s
        );
        let rms = grade.rms_rad.map(|rms| format!("{:.4}", 1e3 * rms)).join("\t");
        let Gains { level, viscous, .. } = grade.learnt;
        text += &format!("{head}\t{rms}\t{level:.3}\t{viscous:.3}\t{:.3}\n", grade.true_level);
    }
    text
}

fn steady_table(grades: &[SteadyGrade]) -> String {
    let mut text = "seed\tfamily\tlevel_error\tadaptive_per_fixed\tlargest_of_ten_minutes\tlevel\tviscous\ttrue_level\n".to_owned();
    for grade in grades {
        let Gains { level, viscous, .. } = grade.learnt;
        let gains = [f64::from(level), f64::from(viscous), grade.true_level];
        let numbers = [grade.level_error, grade.ratio, grade.worst_ratio].into_iter().chain(gains);
        let numbers: Vec<String> = numbers.map(|number| format!("{number:.3}")).collect();
        text += &format!("{}\t{}\t{}\n", grade.seed, grade.family, numbers.join("\t"));
    }
    text
}

fn lie_table(grades: &[LieGrade]) -> String {
    let mut text = "course\tlies\toff_mrad\tfixed_mrad\tadaptive_mrad\ttorque_per_bound\toff_stopped\tfixed_stopped\tadaptive_stopped\toff_ringing_s\tfixed_ringing_s\tadaptive_ringing_s\tlevel\tviscous\n".to_owned();
    for grade in grades {
        let lies: Vec<&str> = grade.lies.iter().map(|lie| lie.name()).collect();
        let rms = grade.rms_rad.map(|rms| format!("{:.3}", 1e3 * rms)).join("\t");
        let stopped = grade.is_stopped.map(|is_stopped| is_stopped.to_string()).join("\t");
        let ringing = grade.ringing_s.map(|seconds| format!("{seconds:.0}")).join("\t");
        let Gains { level, viscous, .. } = grade.learnt;
        text += &format!(
            "{}\t{}\t{rms}\t{:.3}\t{stopped}\t{ringing}\t{level:.2}\t{viscous:.2}\n",
            grade.course,
            lies.join(" + "),
            grade.torque_share
        );
    }
    text
}

fn main() {
    let mut arguments = Arguments::parse();
    if arguments.quick {
        arguments.drifting = arguments.drifting.min(6);
        arguments.steady = arguments.steady.min(6);
        arguments.lies = arguments.lies.min(100);
    }
    // A part without courses leaves its tables as they are.
    if arguments.drifting > 0 {
        let grades = drifts(&arguments);
        let rows = summary::drift_rows(&grades);
        write_part(&arguments, "drifts", &drift_table(&grades), &rows);
    }
    if arguments.steady > 0 {
        let grades = steady(&arguments);
        let rows = summary::steady_rows(&grades);
        write_part(&arguments, "steady", &steady_table(&grades), &rows);
    }
    if arguments.lies > 0 {
        let grades = lies(&arguments);
        let rows = summary::lie_rows(&grades);
        write_part(&arguments, "lies", &lie_table(&grades), &rows);
    }
}

/// Writes the courses of a part and its summary, and prints the summary.
fn write_part(arguments: &Arguments, part: &str, courses: &str, rows: &[summary::Row]) {
    let mut summary = format!(
        "Simulated: seed {0}, by `cargo run --release -p drifting-joints --example grade_adaptation -- --seed {0}`.\n\n\
         what\tcourses\tfigure\tgoal\n",
        arguments.seed
    );
    for row in rows {
        summary += &(row.join("\t") + "\n");
    }
    print!("{summary}");
    write(&arguments.courses, &format!("adaptation-{part}-courses.tsv"), courses);
    write(&arguments.out, &format!("adaptation-{part}.tsv"), &summary);
}

fn write(folder: &Path, name: &str, text: &str) {
    let written =
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(folder.join(name), text));
    written.unwrap_or_else(|error| panic!("{name}: {error}"));
}
