//! Errors of the models on logs of real machines, compared with a table in the repository.
//!
//! Every run fits the excerpts of `tests/data` (`measured/figures-excerpts.tsv`), `LONG_TESTS=1` the full files
//! (`measured/figures.tsv`). Every number of the table is computed again and must be within [`LIMITS`] of it, in both
//! directions: a sudden decrease of an error usually indicates a fault of the test. Published figures for the same rows must
//! be reproduced ([`FigureRow::published`], [`Case::limits`]).
//! `UPDATE_TABLES=1 cargo test -p friction-fit --test all measured_figures` writes the table.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use friction_fit::spec::{Spec, parse_rigid_body};
use friction_fit::{FitOptions, Metrics, Rows, Track, identify, tracks};
use joint_log::{Dataset, Part, ReadOptions, SplitRule, read, split};
use measured_logs::MeasuredLogs;
use rayon::prelude::*;

/// Limits of an error over that in the table. A change of the fit that moves errors by a per cent needs no new table.
const LIMITS: RangeInclusive<f64> = 0.85..=1.05;

/// Minimum speed of sliding rows, rad/s. At lower speeds the pendulum of the servo sticks.
const MIN_SLIDING_SPEED_RAD_S: f64 = 0.22;

/// A model, and the published figure for the same rows.
struct FigureRow {
    model: &'static str,
    published: &'static str,
}

const fn row(model: &'static str) -> FigureRow {
    FigureRow { model, published: "" }
}

const fn published_row(model: &'static str, published: &'static str) -> FigureRow {
    FigureRow { model, published }
}

/// Selection or modification of the rows after reading.
#[derive(Clone, Copy, PartialEq)]
enum RowSelection {
    AsMeasured,
    /// Commanded speed, from the name of the run, instead of the measured one.
    CommandedSpeed,
    /// Sliding rows only.
    Sliding,
}

/// A log, the options for reading and splitting it, and the models fitted to it.
struct Case {
    title: &'static str,
    notes: &'static str,
    /// The file, or the training file and the test file.
    files: &'static [&'static str],
    columns: &'static str,
    rigid_body: &'static str,
    /// First rows that are skipped and decimation of the residual, for the full files. The excerpts have been decimated so.
    skip: usize,
    decimate: usize,
    rule: fn(&Dataset, &[PathBuf]) -> SplitRule,
    selection: RowSelection,
    /// Unit of the printed errors, and its number per unit of the log.
    unit: (&'static str, f64),
    rows: &'static [FigureRow],
    limits: &'static [Limit],
    /// Limits on the excerpt.
    excerpt_limits: &'static [Limit],
}

/// Model, column of the table, lower and upper limit.
type Limit = (&'static str, usize, f64, f64);

impl Case {
    const DEFAULT: Case = Case {
        title: "",
        notes: "",
        files: &[],
        columns: "",
        rigid_body: "",
        skip: 0,
        decimate: 1,
        rule: |_, _| SplitRule::default(),
        selection: RowSelection::AsMeasured,
        unit: ("N", 1.0),
        rows: &[],
        limits: &[],
        excerpt_limits: &[],
    };
}

const WORM: Case = Case {
    files: &["worm-drive.csv"],
    rigid_body: "offset",
    unit: ("mNm", 1e3),
    rows: &[row("linear"), row("stribeck"), row("lugre"), row("linear+direction-asymmetry")],
    ..Case::DEFAULT
};

const SERVO: Case = Case {
    files: &["servo-pendulum.csv"],
    columns: "torque_nm=drive_voltage_v",
    rigid_body: "load,offset",
    rule: |_, _| SplitRule::parse_hold_out("kp=400").expect("a rule"),
    unit: ("V", 1.0),
    rows: &[row("linear"), row("stribeck"), row("lugre"), row("linear+load-torque-coulomb")],
    ..Case::DEFAULT
};

const CASES: [Case; 9] = [
    Case {
        title: "O-ring of a pneumatic cylinder, last 30 % of each run held out",
        notes: "`seal-oring.csv --rigid-body offset --tail 0.3`. The README's model includes a force that follows the pressure in both directions alike: \
                least squares on Coulomb, viscous, offset, pressure and pressure times direction gives \
                1.775 N. A force that does not change its sign with the motion is an error of force or \
                bore area and not friction, so no model here contains it.",
        files: &["seal-oring.csv"],
        rigid_body: "offset",
        rule: |_, _| SplitRule::Tail { share: 0.3 },
        rows: &[
            published_row("linear", "2.79 N"),
            row("stribeck"),
            row("lugre"),
            published_row("linear+pressure-coulomb", "1.76 N (pressure terms)"),
            row("lugre+pressure-coulomb"),
            row("improved-lugre"),
        ],
        limits: &[("linear", 1, 2.785, 2.795)],
        ..Case::DEFAULT
    },
    Case {
        title: "Lip seal of a pneumatic cylinder, last 30 % of each run held out",
        notes: "`seal-kdn.csv --rigid-body offset --tail 0.3`. As for the O-ring: with the part of the pressure that does not change its sign, least \
                squares gives 0.755 N.",
        files: &["seal-kdn.csv"],
        rigid_body: "offset",
        rule: |_, _| SplitRule::Tail { share: 0.3 },
        rows: &[
            published_row("linear", "1.57 N"),
            row("stribeck"),
            row("lugre"),
            published_row("linear+pressure-coulomb", "0.74 N (pressure terms)"),
            row("lugre+pressure-coulomb"),
            row("improved-lugre"),
        ],
        limits: &[("linear", 1, 1.565, 1.575)],
        ..Case::DEFAULT
    },
    Case {
        title: "EMPS, the published protocol",
        notes: "`emps-train.csv --test emps-pulses.csv --rigid-body inertia,offset --skip 49 --decimate 10`, \
                columns mapped. The README's relative errors are those of a decimated log; here the \
                residual is decimated, which does not depend on the phase of the decimation.",
        files: &["emps-train.csv", "emps-pulses.csv"],
        columns: "time_s=t_s,position_m=q_m,velocity_m_s=vel_m_per_s,acceleration_m_s2=acc_m_per_s2,\
                  force_n=motor_force_N",
        rigid_body: "inertia,offset",
        skip: 49,
        decimate: 10,
        rule: |_, files| SplitRule::Files(vec![files[1].clone()]),
        rows: &[
            published_row("linear", "4.0834 %, 5.9824 % held out"),
            row("stribeck"),
            row("lugre"),
            row("lugre-asymmetric"),
            published_row("linear+direction-asymmetry", "3.1117 %, 5.39 % held out"),
        ],
        limits: &[
            ("linear", 2, 3.9834, 4.1834),
            ("linear", 3, 5.8824, 6.0824),
            ("linear+direction-asymmetry", 2, 3.0117, 3.2117),
            ("linear+direction-asymmetry", 3, 5.29, 5.49),
        ],
        // The published protocol filters before it decimates; the excerpts are not filtered.
        excerpt_limits: &[("linear", 2, 4.2, 4.5), ("linear+direction-asymmetry", 2, 3.4, 3.75)],
        ..Case::DEFAULT
    },
    Case {
        title: "Worm drive, some runs held out",
        notes: "`worm-drive.csv --rigid-body offset`, the default split.",
        rows: &[row("linear"), row("stribeck"), row("lugre"), row("linear+direction-asymmetry")],
        ..WORM
    },
    Case {
        title: "Worm drive, every second speed held out",
        notes: "`worm-drive.csv --rigid-body offset`, with the runs at 2, 6, 10, .. 180 rpm held out in both directions. Below 10 rpm the \
                motor moves in jerks: measured speeds change their sign in many rows, where a law \
                without memory reverses its torque, but the machine did not.",
        rule: every_second_speed,
        ..WORM
    },
    Case {
        title: "Worm drive, commanded speeds, every second held out",
        notes: "The probable rows of the README's figures: the README specifies neither rows nor split. \
                With the commanded speed instead of the measured one and *without* an offset all three \
                figures are reproduced. With an offset, Coulomb and viscous friction alone reach the \
                error of the asymmetry (0.165 mNm), because the offset is the asymmetry of the Coulomb \
                part.",
        rigid_body: "",
        rule: every_second_speed,
        selection: RowSelection::CommandedSpeed,
        rows: &[
            published_row("linear", "0.492 mNm"),
            row("linear+torque-offset"),
            published_row("linear+direction-asymmetry", "0.164 mNm"),
            published_row("stribeck+direction-asymmetry", "0.154 mNm"),
        ],
        limits: &[("linear", 1, 0.487, 0.497), ("linear+direction-asymmetry", 1, 0.159, 0.169)],
        excerpt_limits: &[
            ("linear", 1, 0.487, 0.497),
            ("linear+direction-asymmetry", 1, 0.159, 0.169),
        ],
        ..WORM
    },
    Case {
        title: "Servo with a pendulum, gain 400 held out",
        notes: "`servo-pendulum.csv --columns torque_nm=drive_voltage_v --rigid-body load,offset --hold-out \
                kp=400`. In four of ten rows the pendulum is held at rest, where the position loop determines the \
                voltage. These rows and the inertia cause most of the error.",
        ..SERVO
    },
    Case {
        title: "Servo with a pendulum and its inertia, gain 400 held out",
        notes: "The same with `--rigid-body load,offset,inertia`.",
        rigid_body: "load,offset,inertia",
        ..SERVO
    },
    Case {
        title: "Servo with a pendulum and its inertia, sliding rows alone, gain 400 held out",
        notes: "The probable rows of the README's figures, which the README does not specify. For rows \
                above 0.22 rad/s, with load, inertia and offset in the base, and \"load\" as the \
                friction caused by the load, our figures are within 4 % of them.",
        rigid_body: "load,offset,inertia",
        selection: RowSelection::Sliding,
        rows: &[
            published_row("linear", "0.700 V"),
            row("stribeck"),
            published_row("linear+load-torque-coulomb", "0.537 V"),
        ],
        limits: &[("linear", 1, 0.67, 0.73), ("linear+load-torque-coulomb", 1, 0.51, 0.565)],
        excerpt_limits: &[
            ("linear", 1, 0.67, 0.73),
            ("linear+load-torque-coulomb", 1, 0.51, 0.565),
        ],
        ..SERVO
    },
];

/// Returns the commanded speed of a run of the worm drive, rpm, from its name, such as `-180@2020-07-06T15:31:50`.
fn commanded_rpm(name: &str) -> f64 {
    let rpm = name.split('@').next().and_then(|text| text.parse().ok());
    rpm.unwrap_or_else(|| panic!("{name} begins with a speed"))
}

fn every_second_speed(data: &Dataset, _: &[PathBuf]) -> SplitRule {
    let mut speeds: Vec<f64> = data.runs.iter().map(|r| commanded_rpm(&r.name).abs()).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    let held: Vec<f64> = speeds.into_iter().skip(1).step_by(2).collect();
    let runs = data.runs.iter().filter(|run| held.contains(&commanded_rpm(&run.name).abs()));
    SplitRule::HoldOut { column: "run".into(), values: runs.map(|run| run.name.clone()).collect() }
}

/// Returns the sliding stretches of some parts.
fn sliding(data: &Dataset, parts: &[Part]) -> Vec<Part> {
    let mut found: Vec<Part> = Vec::new();
    for part in parts {
        let velocity = &data.runs[part.run].velocity;
        for at in part.rows.clone().filter(|&at| velocity[at].abs() > MIN_SLIDING_SPEED_RAD_S) {
            match found.last_mut() {
                Some(last) if last.run == part.run && last.rows.end == at => last.rows.end = at + 1,
                _ => found.push(Part { run: part.run, rows: at..at + 1 }),
            }
        }
    }
    found
}

/// Returns the training tracks and the test tracks of a case.
fn load(case: &Case, logs: &MeasuredLogs) -> (Vec<Track>, Vec<Track>) {
    let files: Vec<PathBuf> = case.files.iter().map(|name| logs.file(name)).collect();
    let pairs = case.columns.split(',').filter_map(|pair| pair.split_once('='));
    let columns = pairs.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned())).collect();
    let skip = if logs.is_full() { case.skip } else { 0 };
    let options = ReadOptions { columns, skip, ..ReadOptions::default() };
    let mut data = read(&files, &options, &|_, _| {}).expect("readable");
    if case.selection == RowSelection::CommandedSpeed {
        for run in &mut data.runs {
            let speed = commanded_rpm(&run.name) * std::f64::consts::TAU / 60.0;
            run.velocity.fill(speed);
        }
    }
    let mut split = split(&data, &(case.rule)(&data, &files), 0).expect("a split");
    if case.selection == RowSelection::Sliding {
        split.train = sliding(&data, &split.train);
        split.test = sliding(&data, &split.test);
    }
    (tracks(&data.select(&split.train)), tracks(&data.select(&split.test)))
}

type Figures = [f64; 4];

/// Returns RMSE and relative error of the training rows and of the held-out rows, in the order of the table.
fn figures(case: &Case, train: Metrics, test: Metrics) -> Figures {
    let factor = case.unit.1;
    let relative = |of: Metrics| of.relative_error_percent;
    [train.rmse * factor, test.rmse * factor, relative(train), relative(test)]
}

fn fit(
    case: &Case,
    model: &str,
    (train, test): &(Vec<Track>, Vec<Track>),
    decimate: usize,
) -> Figures {
    let parts = parse_rigid_body(case.rigid_body).expect("known parts");
    let spec = Spec::parse(model).expect("a model").on(&parts);
    let base = spec.parameters().expect("few terms");
    let rows = |tracks| Rows { tracks, decimate };
    let outcome = identify(&spec, &base, rows(train), rows(test), &FitOptions::default());
    figures(case, outcome.train, outcome.test)
}

fn format_table(all: &[(usize, &FigureRow, Figures)], logs: &MeasuredLogs) -> String {
    let mut text = String::new();
    for (at, case) in CASES.iter().enumerate() {
        let unit = case.unit.0;
        let separator = if at == 0 { "" } else { "\n" };
        // The notes compare the figures of the full files with those that their README states.
        let notes = if logs.is_full() { case.notes } else { "The excerpts in `tests/data`." };
        let _ = write!(
            text,
            "{separator}# {}\n{}\nmodel\tfitted, {unit}\theld out, {unit}\tfitted, %\theld out, %\tREADME\n",
            case.title, notes
        );
        for (_, row, [a, b, c, d]) in all.iter().filter(|(case, ..)| *case == at) {
            let published = if logs.is_full() { row.published } else { "" };
            let model = row.model;
            let _ = writeln!(text, "{model}\t{a:.4}\t{b:.4}\t{c:.4}\t{d:.4}\t{published}");
        }
    }
    text
}

/// Parses the table: figures by section and model.
fn parse_table(text: &str) -> HashMap<(String, String), Figures> {
    let (mut section, mut found) = (String::new(), HashMap::new());
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("# ") {
            section = title.to_owned();
        }
        let cells: Vec<&str> = line.split('\t').collect();
        let numbers: Vec<f64> =
            cells.iter().skip(1).take(4).filter_map(|cell| cell.parse().ok()).collect();
        if let Ok(figures) = numbers.try_into() {
            found.insert((section.clone(), cells[0].to_owned()), figures);
        }
    }
    found
}

#[test]
fn figures_of_measured_logs_match_table() {
    let logs = MeasuredLogs::of_this_run();
    let loaded: Vec<_> = CASES.iter().map(|case| load(case, &logs)).collect();
    let jobs: Vec<(usize, &FigureRow)> = CASES
        .iter()
        .enumerate()
        .flat_map(|(at, case)| case.rows.iter().map(move |row| (at, row)))
        .collect();
    let all: Vec<(usize, &FigureRow, Figures)> = jobs
        .into_par_iter()
        .map(|(at, row)| {
            let case = &CASES[at];
            let decimate = if logs.is_full() { case.decimate } else { 1 };
            (at, row, fit(case, row.model, &loaded[at], decimate))
        })
        .collect();

    let name = if logs.is_full() { "figures.tsv" } else { "figures-excerpts.tsv" };
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("measured").join(name);
    if std::env::var_os("UPDATE_TABLES").is_some() {
        fs::write(&table, format_table(&all, &logs)).expect("written");
    }
    let text = fs::read_to_string(&table).expect("the table");
    let mut known = parse_table(&text);
    let mut wrong = Vec::new();
    for (at, row, figures) in &all {
        let case = &CASES[*at];
        let what = format!("{}: {}", case.title, row.model);
        match known.remove(&(case.title.to_owned(), row.model.to_owned())) {
            None => wrong.push(format!("{what}: not in the table")),
            Some(before) => {
                let has_changed = |(now, then): (&f64, &f64)| !LIMITS.contains(&(now / then));
                if figures.iter().zip(&before).any(has_changed) {
                    wrong.push(format!("{what}: now {figures:.4?}, in the table {before:.4?}"));
                }
            }
        }
        let limits = if logs.is_full() { case.limits } else { case.excerpt_limits };
        for (_, column, least, most) in limits.iter().filter(|limit| limit.0 == row.model) {
            let found = figures[*column];
            if !(*least..=*most).contains(&found) {
                wrong.push(format!("{what}: {found:.4} is not within {least}..{most}"));
            }
        }
    }
    wrong.extend(known.keys().map(|key| format!("{key:?}: in the table, but not fitted")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
