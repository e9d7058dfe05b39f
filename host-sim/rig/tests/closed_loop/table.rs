//! Limits and results of the scenarios. The limits stand at each row in the source; a run writes its results with them to
//! `target/figures/`, of which the build of the book makes `docs/src/reference/closed-loop.md`.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// A result with its limits.
#[derive(Clone, Debug)]
pub struct ScenarioRow {
    /// Number of the scenario in [`TITLES`].
    pub scenario: u8,
    /// Procedure.
    pub did: String,
    /// Quantity, with its unit.
    pub figure: &'static str,
    /// Result.
    pub value: f64,
    /// Limits.
    pub least: f64,
    pub most: f64,
    /// The result is known to be outside its limits: the table states this, and the test requires it until it is corrected.
    pub is_outside: bool,
}

/// A row that is known to be outside its limits.
pub fn outside_row(
    scenario: u8,
    did: &str,
    figure: &'static str,
    value: f64,
    limits: std::ops::RangeInclusive<f64>,
) -> ScenarioRow {
    ScenarioRow { is_outside: true, ..unchecked(scenario, did, figure, value, limits) }
}

/// A row with inclusive limits. With `STOP_AT_FIRST_ROW`, one outside of them ends the test: a mutation is then found as soon as
/// it shows.
pub fn row(
    scenario: u8,
    did: &str,
    figure: &'static str,
    value: f64,
    limits: std::ops::RangeInclusive<f64>,
) -> ScenarioRow {
    let row = unchecked(scenario, did, figure, value, limits);
    if std::env::var_os("STOP_AT_FIRST_ROW").is_some() {
        check(std::slice::from_ref(&row));
    }
    row
}

fn unchecked(
    scenario: u8,
    did: &str,
    figure: &'static str,
    value: f64,
    limits: std::ops::RangeInclusive<f64>,
) -> ScenarioRow {
    ScenarioRow {
        scenario,
        did: did.to_owned(),
        figure,
        value,
        least: *limits.start(),
        most: *limits.end(),
        is_outside: false,
    }
}

impl ScenarioRow {
    fn holds(&self) -> bool {
        self.least <= self.value && self.value <= self.most
    }

    /// Limits and verdict, as cells of the table.
    fn verdict(&self) -> (String, &'static str) {
        let limits = format!("{} to {}", format_value(self.least), format_value(self.most));
        (limits, if self.is_outside { "**no**" } else { "yes" })
    }
}

/// Formats a value with three significant digits.
fn format_value(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".into();
    }
    let places = (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Fails with every row outside its limits, and with a row marked as outside that is within them.
pub fn check(rows: &[ScenarioRow]) {
    let out: Vec<String> = rows
        .iter()
        .filter(|row| row.holds() == row.is_outside)
        .map(|row| {
            let ((limits, _), value) = (row.verdict(), format_value(row.value));
            format!("{}, {}: {value}, {limits}", row.did, row.figure)
        })
        .collect();
    assert!(out.is_empty(), "rows that contradict their limits:\n{}", out.join("\n"));
}

/// Titles of the scenarios, from 1.
const TITLES: [&str; 31] = [
    "Power-up, arming and disarming",
    "Start from blank flash",
    "Wrong wiring",
    "Commissioning by the driver",
    "Drift of the current sensors",
    "Voltage limit",
    "Braking into the bus capacitor",
    "Bus undervoltage",
    "Encoder faults",
    "Delayed background task",
    "Late and missed interrupts",
    "Failure of the processor",
    "Faults of the load and pressure sensors",
    "Errors of the friction model",
    "Winding temperature at stall",
    "Cyclic synchronous velocity (CSV)",
    "Reactions to a stop",
    "Holding brake",
    "Position limits and following error",
    "Position modes: CSP, PP, homing",
    "Trial of a parameter set, and undo of a tuning",
    "Adaptation of the friction levels",
    "Feed-forward from a master",
    "Dead time of the bridge",
    "Profile modes, changes of the mode, and touch probe",
    "Kinds of encoders",
    "Bandwidth and limits of the current loop",
    "Brake test",
    "Compact node on the B-G431B-ESC1",
    "Encoder at the joint's side of the gear",
    "Compensation without a command",
];

const COLUMNS: &str = "procedure\tquantity\tresult\tlimits\tmet\n";

/// Files of the results of the firmware's library, and of the image on the emulated board.
pub const LIBRARY_FILE: &str = "closed-loop.tsv";
#[allow(dead_code)] // Only the emulated board's tests use it.
pub const IMAGE_FILE: &str = "closed-loop-image.tsv";

/// The file: a block of a title, column names and rows for each scenario, with an empty line between two of them.
fn emit(rows: &[&ScenarioRow]) -> String {
    let mut text = String::new();
    for scenario in rows.chunk_by(|one, next| one.scenario == next.scenario) {
        let number = usize::from(scenario[0].scenario);
        let separator = if text.is_empty() { "" } else { "\n" };
        let _ = write!(text, "{separator}# {number}. {}\n{COLUMNS}", TITLES[number - 1]);
        let mut above = "";
        for row in scenario {
            let procedure = if row.did == above { "" } else { &row.did };
            let ((limits, met), value) = (row.verdict(), format_value(row.value));
            let _ = writeln!(text, "{procedure}\t{}\t{value}\t{limits}\t{met}", row.figure);
            above = &row.did;
        }
    }
    text
}

/// Writes the results to a file of `target/figures/`, and returns the scenarios that have some. No two rows may have the same name.
pub fn write<'a>(file: &str, rows: impl Iterator<Item = &'a ScenarioRow>) -> BTreeSet<u8> {
    let mut rows: Vec<&ScenarioRow> = rows.collect();
    rows.sort_by_key(|row| row.scenario);
    let mut names = BTreeSet::new();
    for row in &rows {
        assert!(names.insert((row.scenario, &row.did, row.figure)), "twice: {row:?}");
        assert!(row.least <= row.most, "{row:?}");
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("figures");
    std::fs::create_dir_all(&folder).expect("a folder for the figures");
    std::fs::write(folder.join(file), emit(&rows)).expect("the file can be written");
    rows.iter().map(|row| row.scenario).collect()
}

/// Numbers of all scenarios.
pub fn scenarios() -> BTreeSet<u8> {
    (1..=TITLES.len() as u8).collect()
}
