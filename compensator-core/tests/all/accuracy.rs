//! Accuracy of the bristle step, measured against a fine reference and compared with a table.
//!
//! The integrator limits the accuracy of a friction model in a current loop. For example, explicit Euler works at
//! 20 kHz but diverges at 1 kHz for the same joint. `accuracy/steps.tsv` lists the errors of the core's step in three
//! number types, and of two alternative schemes, for several motions. This test recomputes every value. It fails if
//! a value differs by more than 10 % from the table, in *either* direction: an error that suddenly vanishes
//! indicates a defective test.
//!
//! After an intended change, run `UPDATE_TABLES=1 cargo test -p compensator-core --test all accuracy::`, and review the
//! difference in git.

use crate::support::Seal;
use crate::support::motion::{self, Motion, RECORD_PERIOD, SUBSTEPS};
use crate::support::network;
use crate::support::schemes::{self, Scheme, Step};
use compensator_core::{Fixed, LawKind, Parameters};
use std::fmt::Write as _;

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/accuracy/steps.tsv");

/// Maximum ratio between a value and its entry in the table, in either direction.
const TOLERANCE: f64 = 1.1;

/// Sample rates, and the sample period in records of the reference.
const RATES: [(&str, usize); 2] = [("20 kHz", 1), ("1 kHz", 20)];

const SCHEMES: [&str; 5] = ["core f64", "core f32", "core Fixed", "explicit Euler", "exact ZOH"];

/// Errors of one scheme for one motion.
struct Run {
    /// Friction minus reference, in % of `F_S`. Empty if the scheme diverged.
    errors: Vec<f64>,
}

impl Run {
    fn rms(&self) -> Option<f64> {
        let sum: f64 = self.errors.iter().map(|error| error * error).sum();
        (!self.errors.is_empty()).then(|| (sum / self.errors.len() as f64).sqrt())
    }

    fn largest(&self) -> Option<f64> {
        self.errors.iter().map(|error| error.abs()).reduce(f64::max)
    }

    /// Returns the largest difference from another run, in % of `F_S`.
    fn largest_difference(&self, other: &Run) -> Option<f64> {
        self.errors.iter().zip(&other.errors).map(|(a, b)| (a - b).abs()).reduce(f64::max)
    }
}

fn run(mut scheme: Scheme, motion: &Motion, stride: usize) -> Run {
    let period = RECORD_PERIOD * stride as f64;
    let mut force_before = motion.first_force;
    let mut errors = Vec::new();
    for point in motion.points.iter().skip(stride - 1).step_by(stride) {
        let force = point.input.radial_force;
        let change = force - force_before;
        force_before = force;
        let friction = scheme(&Step { input: point.input, radial_force_change: change, period });
        let error = 100.0 * (friction - point.friction) / motion.seal.static_level;
        if error.is_nan() || error.abs() > 1000.0 {
            return Run { errors: Vec::new() };
        }
        errors.push(error);
    }
    Run { errors }
}

fn runs(motion: &Motion, stride: usize) -> [Run; 5] {
    let loaded = motion.seal.bend_per_newton != 0.0;
    let law = if loaded { LawKind::ImprovedLugre } else { LawKind::Lugre };
    let period = RECORD_PERIOD * stride as f64;
    let exact: Parameters<f64> = motion.seal.parameters(law);
    let written: Parameters<f32> = motion.seal.parameters(law);
    [
        schemes::core::<f64>(&exact, period),
        schemes::core::<f32>(&written, period),
        schemes::core::<Fixed>(&written, period),
        schemes::explicit(&motion.seal),
        schemes::zero_order_hold(&motion.seal),
    ]
    .map(|scheme| run(scheme, motion, stride))
}

/// A row of the table.
struct Row {
    /// Place of its section in [`SECTIONS`].
    section: usize,
    /// The motion with the rate.
    name: String,
    /// A value of each column; `None` if the scheme diverged.
    values: Vec<Option<f64>>,
}

/// A section of the table.
struct Section {
    title: &'static str,
    columns: &'static [&'static str],
}

const NUMBER_TYPES: &[&str] = &["core f32", "core Fixed"];
const SECTIONS: [Section; 4] = [
    Section { title: "RMS error against the reference, % of F_S", columns: &SCHEMES },
    Section { title: "Largest error against the reference, % of F_S", columns: &SCHEMES },
    Section { title: "Largest distance from the core's f64 step, % of F_S", columns: NUMBER_TYPES },
    Section {
        title: "Largest distance of a network's factors from f64, % of 1",
        columns: NUMBER_TYPES,
    },
];

fn measured() -> Vec<Row> {
    let mut rows = Vec::new();
    for motion in motion::all() {
        for (rate, stride) in RATES {
            let runs = runs(&motion, stride);
            let name = format!("{}, {rate}", motion.name);
            let sections = [
                runs.iter().map(Run::rms).collect(),
                runs.iter().map(Run::largest).collect(),
                runs[1..3].iter().map(|run| run.largest_difference(&runs[0])).collect(),
            ];
            for (section, values) in sections.into_iter().enumerate() {
                rows.push(Row { section, name: name.clone(), values });
            }
        }
    }
    let exact = network::factors::<f64>();
    let largest_difference = |factors: Vec<[f64; 3]>| {
        let pairs = factors.iter().flatten().zip(exact.iter().flatten());
        pairs.map(|(a, b)| 100.0 * (a - b).abs()).reduce(f64::max)
    };
    let values = vec![
        largest_difference(network::factors::<f32>()),
        largest_difference(network::factors::<Fixed>()),
    ];
    rows.push(Row { section: 3, name: "8 cells, 10,000 evaluations".into(), values });
    rows
}

fn written(rows: &[Row]) -> String {
    let mut text = String::new();
    for (section, Section { title, columns }) in SECTIONS.iter().enumerate() {
        let separator = if section == 0 { "" } else { "\n" };
        writeln!(text, "{separator}# {title}\nmotion\t{}", columns.join("\t")).unwrap();
        for Row { name, values, .. } in rows.iter().filter(|row| row.section == section) {
            let cells: Vec<String> = values.iter().map(|number| cell(*number)).collect();
            writeln!(text, "{name}\t{}", cells.join("\t")).unwrap();
        }
    }
    text
}

/// Formats a value with three significant digits, or `diverges`.
fn cell(number: Option<f64>) -> String {
    let Some(number) = number else { return "diverges".into() };
    let decimals = (2 - number.log10().floor() as i32).clamp(0, 12) as usize;
    format!("{number:.decimals$}")
}

fn read(text: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut section = 0;
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("# ") {
            section = SECTIONS.iter().position(|known| known.title == title).expect(line);
        }
        if !line.contains('\t') || line.starts_with("motion") {
            continue;
        }
        let mut cells = line.split('\t');
        let name = cells.next().unwrap().to_string();
        let number = |cell: &str| (cell != "diverges").then(|| cell.parse().expect("a number"));
        rows.push(Row { section, name, values: cells.map(number).collect() });
    }
    rows.sort_by_key(|row| row.section);
    rows
}

#[test]
fn accuracy_of_every_scheme_matches_table() {
    let mut rows = measured();
    rows.sort_by_key(|row| row.section);
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(TABLE, written(&rows)).expect("the table can be written");
    }
    let table = read(&std::fs::read_to_string(TABLE).expect("the table is in git"));
    let names =
        |rows: &[Row]| rows.iter().map(|row| (row.section, row.name.clone())).collect::<Vec<_>>();
    assert_eq!(names(&rows), names(&table));
    for (Row { section, name, values }, then) in rows.iter().zip(&table) {
        let Section { title, columns } = SECTIONS[*section];
        assert_eq!(values.len(), then.values.len(), "{title}: {name}");
        for ((now, then), column) in values.iter().zip(&then.values).zip(columns) {
            let same = match (now, then) {
                (Some(now), Some(then)) => (1.0 / TOLERANCE..TOLERANCE).contains(&(now / then)),
                (None, None) => true,
                _ => false,
            };
            assert!(same, "{title}: {name}, {column}: now {now:?}, in the table {then:?}");
        }
    }
}

/// The reference must be more accurate than the schemes. With half the step, it changes by less than 1 % of the
/// smallest error in the table.
#[test]
fn reference_with_half_step_changes_negligibly() {
    let seal = Seal::JOINT.unloaded();
    let coarse = motion::prescribed("", seal, SUBSTEPS, motion::reversal);
    let fine = motion::prescribed("", seal, 2 * SUBSTEPS, motion::reversal);
    let moved =
        coarse.points.iter().zip(&fine.points).map(|(a, b)| (a.friction - b.friction).abs());
    let moved = 100.0 * moved.fold(0.0, f64::max) / seal.static_level;
    assert!((1e-16..7e-6).contains(&moved), "{moved:e}");
}

/// Checks the conclusions of the table, which must also hold after an update.
#[test]
fn core_is_first_order_and_stable_where_explicit_euler_diverges() {
    for motion in motion::all() {
        let fast = runs(&motion, 1).map(|run| run.rms());
        let slow = runs(&motion, 20).map(|run| run.rms());
        let name = motion.name;
        for number in 0..3 {
            let column = SCHEMES[number];
            let at_20_khz = fast[number].expect("the core never diverges");
            let at_1_khz = slow[number].expect("the core never diverges");
            // The velocity resolution of fixed point is 1e-6 rad/s: 1 % of the creep velocity in stick-slip.
            let limit = if column == "core Fixed" { 0.3 } else { 0.05 };
            assert!((0.003..limit).contains(&at_20_khz), "{name}, {column}: {at_20_khz}");
            assert!((0.05..0.8).contains(&at_1_khz), "{name}, {column}: {at_1_khz}");
        }
        let growth = slow[0].unwrap() / fast[0].unwrap();
        assert!((15.0..25.0).contains(&growth), "{name}: {growth} for a period 20 times as long");
        let explicit_diverges = name != "presliding";
        assert_eq!(slow[3].is_none(), explicit_diverges, "{name}");
        if ["reversal", "varying load and pressure"].contains(&name) {
            assert!(
                fast[0] < fast[4] && slow[0] < slow[4],
                "{name}: the core is more accurate than the exact hold"
            );
        }
    }
}
