//! Grades the adaptation and writes its tables: `cargo run --release -p drifting-joints --example grade_adaptation -- --seed N`.

use clap::Parser;
use compensator_core::adaptation::Gains;
use drifting_joints::GradeError;
use drifting_joints::drift::{Drift, MomentGrade, SteadyGrade, grade_drift, grade_steady};
use drifting_joints::lies::{LieGrade, PreparedJoint, grade_lie};
use drifting_joints::summary;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

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
    #[arg(long, default_value_t = DRIFTING.usual)]
    drifting: u64,
    /// Joints that do not change, over two hours; 0 leaves its tables
    #[arg(long, default_value_t = STEADY.usual)]
    steady: u64,
    /// Courses that lie; 0 leaves its tables
    #[arg(long, default_value_t = LIES.usual)]
    lies: u64,
    /// Folder of the summaries
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/graded"))]
    out: PathBuf,
    /// Folder of the tables of all courses
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/figures"))]
    courses: PathBuf,
}

/// A part of the tables, and the option that sets its number of joints or courses.
struct Part {
    /// End of the names of its tables.
    name: &'static str,
    option: &'static str,
    usual: u64,
    /// Most with `--quick`.
    quick: u64,
}

const DRIFTING: Part = Part { name: "drifts", option: "--drifting", usual: 24, quick: 6 };
const STEADY: Part = Part { name: "steady", option: "--steady", usual: 20, quick: 6 };
const LIES: Part = Part { name: "lies", option: "--lies", usual: 1000, quick: 100 };

impl Part {
    /// Returns the number of joints or courses of a given number.
    fn count(&self, arguments: &Arguments, given: u64) -> u64 {
        if arguments.quick { given.min(self.quick) } else { given }
    }

    /// Returns the options that give the numbers of this part again.
    fn options(&self, arguments: &Arguments, given: u64) -> String {
        let mut options = format!("--seed {}", arguments.seed);
        if arguments.quick {
            options += " --quick";
        }
        if given != self.usual {
            options += &format!(" {} {given}", self.option);
        }
        options
    }
}

/// Courses per joint of those that lie.
const COURSES_PER_JOINT: u64 = 25;

/// Number of joints and courses that could not be graded.
static FAILURES: AtomicU64 = AtomicU64::new(0);

/// Returns a grade. A failure is counted, and its reason goes to the standard error.
fn found<T>(what: &str, graded: Result<T, GradeError>) -> Option<T> {
    let count = |why: &GradeError| {
        eprintln!("{what}: {why}");
        FAILURES.fetch_add(1, Ordering::Relaxed);
    };
    graded.inspect_err(count).ok()
}

fn drifts(arguments: &Arguments, joints: u64) -> Vec<MomentGrade> {
    let cases: Vec<(u64, Drift)> =
        (0..joints).flat_map(|at| Drift::ALL.map(|drift| (arguments.seed + at, drift))).collect();
    let grade = |(seed, drift): &(u64, Drift)| {
        found(&format!("seed {seed} {drift:?}"), grade_drift(*seed, *drift))
    };
    cases.par_iter().filter_map(grade).flatten().collect()
}

fn steady(arguments: &Arguments, joints: u64) -> Vec<SteadyGrade> {
    let parts = if arguments.quick { 3 } else { 12 };
    let grade = |at: u64| {
        let seed = arguments.seed + 1000 + at;
        found(&format!("seed {seed}"), grade_steady(seed, parts))
    };
    (0..joints).into_par_iter().filter_map(grade).collect()
}

fn lies(arguments: &Arguments, courses: u64) -> Vec<LieGrade> {
    let draw = |at: u64| {
        let seed = arguments.seed + 2000 + at;
        found(&format!("seed {seed}"), PreparedJoint::draw(seed))
    };
    let joints: Vec<Option<PreparedJoint>> =
        (0..courses.div_ceil(COURSES_PER_JOINT)).into_par_iter().map(draw).collect();
    let grade = |course: u64| {
        let joint = joints[course as usize % joints.len()].as_ref()?;
        let seed = arguments.seed.wrapping_mul(1600) + course;
        found(&format!("course {course}"), grade_lie(joint, seed))
    };
    (0..courses).into_par_iter().filter_map(grade).collect()
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

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // A part without courses leaves its tables as they are.
    let given = arguments.drifting;
    if given > 0 {
        let grades = drifts(&arguments, DRIFTING.count(&arguments, given));
        let rows = summary::drift_rows(&grades);
        write_part(&arguments, &DRIFTING, given, &drift_table(&grades), &rows);
    }
    let given = arguments.steady;
    if given > 0 {
        let grades = steady(&arguments, STEADY.count(&arguments, given));
        let rows = summary::steady_rows(&grades);
        write_part(&arguments, &STEADY, given, &steady_table(&grades), &rows);
    }
    let given = arguments.lies;
    if given > 0 {
        let grades = lies(&arguments, LIES.count(&arguments, given));
        let rows = summary::lie_rows(&grades);
        write_part(&arguments, &LIES, given, &lie_table(&grades), &rows);
    }
    match FAILURES.load(Ordering::Relaxed) {
        0 => ExitCode::SUCCESS,
        failures => {
            eprintln!("{failures} joints or courses could not be graded: the tables lack them");
            ExitCode::FAILURE
        }
    }
}

/// Writes the courses of a part and its summary, and prints the summary. `given` is the value of the part's option.
fn write_part(
    arguments: &Arguments,
    part: &Part,
    given: u64,
    courses: &str,
    rows: &[summary::Row],
) {
    let mut summary = format!(
        "Simulated: seed {}, by `cargo run --release -p drifting-joints --example grade_adaptation -- {}`.\n\n\
         what\tcourses\tfigure\tgoal\n",
        arguments.seed,
        part.options(arguments, given)
    );
    for row in rows {
        summary += &(row.join("\t") + "\n");
    }
    print!("{summary}");
    write(&arguments.courses, &format!("adaptation-{}-courses.tsv", part.name), courses);
    write(&arguments.out, &format!("adaptation-{}.tsv", part.name), &summary);
}

fn write(folder: &Path, name: &str, text: &str) {
    let written =
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(folder.join(name), text));
    written.unwrap_or_else(|error| panic!("{name}: {error}"));
}
