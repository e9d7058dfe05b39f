//! The results in `closed-loop.tsv`, of which the build of the book makes `docs/src/reference/closed-loop.md`.

use std::fmt::Write as _;
use std::path::PathBuf;

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
    ScenarioRow { is_outside: true, ..row(scenario, did, figure, value, limits) }
}

/// A row with inclusive limits.
pub fn row(
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
const TITLES: [&str; 30] = [
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
];

const COLUMNS: &str = "procedure\tquantity\tlibrary\timage\tlimits\tmet\n";

/// Text of a result that does not exist.
const NO_RESULT: &str = "-";

/// Columns of results, by their place between the cells before and after them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// The firmware's library.
    Library,
    /// The image on the emulated board.
    #[allow(dead_code)] // Only the emulated board's tests use it.
    Image,
}

/// A row of the file: its cells without the results, and both results as texts.
#[derive(Clone, Debug, PartialEq)]
struct FileRow {
    scenario: u8,
    did: String,
    figure: String,
    limits: String,
    met: String,
    results: [String; 2],
}

impl FileRow {
    fn of(row: &ScenarioRow) -> Self {
        let (limits, met) = row.verdict();
        Self {
            scenario: row.scenario,
            did: row.did.clone(),
            figure: row.figure.to_owned(),
            limits,
            met: met.to_owned(),
            results: [NO_RESULT.to_owned(), NO_RESULT.to_owned()],
        }
    }

    fn is_about(&self, other: &Self) -> bool {
        (self.scenario, &self.did, &self.figure) == (other.scenario, &other.did, &other.figure)
    }
}

fn path() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../../host-sim/rig/tests/closed_loop/closed-loop.tsv"]
        .iter()
        .collect()
}

/// Reads the rows of the file.
fn parse(text: &str) -> Vec<FileRow> {
    let (mut rows, mut scenario, mut did) = (Vec::new(), 0, String::new());
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("# ") {
            scenario = title.split('.').next().and_then(|number| number.parse().ok()).unwrap_or(0);
        }
        let cells: Vec<&str> = line.split('\t').collect();
        let [procedure, figure, library, image, limits, met] = cells[..] else { continue };
        if COLUMNS.contains(line) {
            continue;
        }
        if !procedure.is_empty() {
            did = procedure.to_owned();
        }
        rows.push(FileRow {
            scenario,
            did: did.clone(),
            figure: figure.to_owned(),
            limits: limits.to_owned(),
            met: met.to_owned(),
            results: [library.to_owned(), image.to_owned()],
        });
    }
    rows
}

/// The file: a block of a title, column names and rows for each scenario, with an empty line between two of them.
fn emit(rows: &[FileRow]) -> String {
    let mut text = String::new();
    for scenario in rows.chunk_by(|one, next| one.scenario == next.scenario) {
        let number = usize::from(scenario[0].scenario);
        let separator = if text.is_empty() { "" } else { "\n" };
        let _ = write!(text, "{separator}# {number}. {}\n{COLUMNS}", TITLES[number - 1]);
        let mut above = "";
        for row in scenario {
            let procedure = if row.did == above { "" } else { &row.did };
            let [library, image] = &row.results;
            let FileRow { figure, limits, met, .. } = row;
            let _ = writeln!(text, "{procedure}\t{figure}\t{library}\t{image}\t{limits}\t{met}");
            above = &row.did;
        }
    }
    text
}

/// Returns true if a result agrees with the file. Another compiler may change the last digits. Every change of the image moves
/// its samples, and with them the noise of the sensors; so its results may also move by three tenths, within a tenth of their
/// limits. A measured difference of two currents moved by a quarter when one function of the image changed.
fn agree(known: &str, row: &ScenarioRow, driver: Driver) -> bool {
    let Ok(known) = known.parse::<f64>() else { return false };
    let share = 0.05 * known.abs().max(row.value.abs());
    let of_noise = match driver {
        Driver::Library => 0.0,
        Driver::Image => (6.0 * share).min(0.1 * (row.most - row.least)),
    };
    (known - row.value).abs() <= share.max(of_noise) + 1e-6
}

/// Compares one column of the file in git with these results, or writes it if `UPDATE_TABLES` is set. The library's
/// results are all rows of the file; the image's may be some of them.
pub fn compare<'a>(driver: Driver, rows: impl Iterator<Item = &'a ScenarioRow>) {
    let mut rows: Vec<&ScenarioRow> = rows.collect();
    rows.sort_by_key(|row| row.scenario);
    let known = parse(&std::fs::read_to_string(path()).unwrap_or_default());
    let column = driver as usize;
    let mut expected: Vec<FileRow> = match driver {
        Driver::Library => rows.iter().map(|row| FileRow::of(row)).collect(),
        Driver::Image => known.clone(),
    };
    for row in &mut expected {
        if let Some(known) = known.iter().find(|known| known.is_about(row)) {
            row.results.clone_from(&known.results);
        }
    }
    let update = "UPDATE_TABLES=1 writes closed-loop.tsv";
    let mut changed = Vec::new();
    for row in rows {
        let about = FileRow::of(row);
        let place = expected.iter_mut().find(|place| place.is_about(&about));
        let place = place.unwrap_or_else(|| panic!("{update}: no row for {about:?}"));
        if !agree(&place.results[column], row, driver) {
            let (before, now) = (&place.results[column], format_value(row.value));
            changed.push(format!("{}, {}: {before} is now {now}", row.did, row.figure));
            place.results[column] = now;
        }
    }
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(path(), emit(&expected)).expect("the file can be written");
        return;
    }
    assert!(changed.is_empty(), "{update}:\n{}", changed.join("\n"));
    let text = std::fs::read_to_string(path()).expect("closed-loop.tsv");
    assert_eq!(text, emit(&expected), "{update}");
}
