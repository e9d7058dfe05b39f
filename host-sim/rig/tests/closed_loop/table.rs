//! The table of results in `docs/src/reference/closed-loop.md`.

use std::fmt::Write as _;
use std::path::PathBuf;

/// A result with its limits.
#[derive(Clone, Debug)]
pub struct ScenarioRow {
    /// Number of the scenario in the list of fifteen.
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

    /// Cells of the table before the value and after it. The procedure is left out where it repeats the row above.
    fn cells(&self, above: Option<&ScenarioRow>) -> (String, String) {
        let repeats =
            above.is_some_and(|above| above.scenario == self.scenario && above.did == self.did);
        let procedure = if repeats { "" } else { self.did.as_str() };
        let met = if self.is_outside { "**no**" } else { "yes" };
        let limits = format!("{} to {}", format_value(self.least), format_value(self.most));
        (format!("| {procedure} | {} | ", self.figure), format!(" | {limits} | {met} |"))
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
            let (before, after) = row.cells(None);
            format!("{before}{}{after}", format_value(row.value))
        })
        .collect();
    assert!(out.is_empty(), "rows that contradict their limits:\n{}", out.join("\n"));
}

/// Titles of the scenarios, from 1.
const TITLES: [&str; 16] = [
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
];

const HEAD: &str = "# Closed-loop scenarios\n\n\
All results are simulated: the shipped driver controls the simulated joint in virtual time.\n\
[The driver in closed loop](../explanation/closed-loop.md) explains the setup and summarises the results.\n\n\
Each result has limits on both sides. They follow from the capabilities of the parts, not from earlier results.\n\
For a quantity that answers a question, 1 means yes and 0 means no.\n\
`UPDATE_TABLES=1 cargo test -p joint-rig --test closed_loop` writes this page. Without the variable, the test\n\
compares every result with its limits and with this page.\n";

const COLUMNS: &str = "| procedure | quantity | result | limits | met |\n|---|---|---|---|---|\n";

fn path() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "..", "docs", "src", "reference", "closed-loop.md"]
        .iter()
        .collect()
}

/// Rows of one scenario, as lines: cells before the value, the value, cells after it.
fn lines(rows: &[&ScenarioRow]) -> Vec<(String, f64, String)> {
    let above = std::iter::once(None).chain(rows.iter().map(|row| Some(*row)));
    rows.iter()
        .zip(above)
        .map(|(row, above)| {
            let (before, after) = row.cells(above);
            (before, row.value, after)
        })
        .collect()
}

/// The page: a heading and a table for each scenario.
fn page(rows: &[&ScenarioRow]) -> String {
    let mut text = HEAD.to_owned();
    for scenario in rows.chunk_by(|one, next| one.scenario == next.scenario) {
        let number = usize::from(scenario[0].scenario);
        let _ = write!(text, "\n## {number}. {}\n\n{COLUMNS}", TITLES[number - 1]);
        for (before, value, after) in lines(scenario) {
            let _ = writeln!(text, "{before}{}{after}", format_value(value));
        }
    }
    text
}

/// Compares the page in git with these rows, or writes it if `UPDATE_TABLES` is set.
pub fn compare<'a>(rows: impl Iterator<Item = &'a ScenarioRow>) {
    let mut rows: Vec<&ScenarioRow> = rows.collect();
    rows.sort_by_key(|row| row.scenario);
    let expected = page(&rows);
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(path(), expected).expect("docs can be written");
        return;
    }
    let known = std::fs::read_to_string(path()).expect("docs/src/reference/closed-loop.md");
    let update = "UPDATE_TABLES=1 writes the page";
    let is_row = |line: &&str| line.starts_with('|') && !COLUMNS.contains(line);
    let words =
        |page: &str| page.lines().filter(|line| !is_row(line)).collect::<Vec<_>>().join("\n");
    assert_eq!(words(&known), words(&expected), "{update}");
    let found: Vec<&str> = known.lines().filter(is_row).collect();
    assert_eq!(found.len(), rows.len(), "{update}");
    let expected = rows.chunk_by(|one, next| one.scenario == next.scenario).flat_map(lines);
    for (line, (before, value, after)) in found.into_iter().zip(expected) {
        let figure =
            line.strip_prefix(before.as_str()).and_then(|l| l.strip_suffix(after.as_str()));
        let figure = figure.unwrap_or_else(|| panic!("{update}: {line} is not {before}..{after}"));
        let figure: f64 = figure.parse().expect("a number");
        // Another compiler may change the last digits.
        let apart = (figure - value).abs();
        let same = apart <= 0.05 * figure.abs().max(value.abs()) + 1e-6;
        assert!(same, "{update}: {line} is now {}", format_value(value));
    }
}
