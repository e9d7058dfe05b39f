//! The table of figures: `docs/closed-loop.md`.

use std::fmt::Write as _;
use std::path::PathBuf;

/// A figure with its limits.
#[derive(Clone, Debug)]
pub struct Row {
    /// Number of the scenario in the list of fifteen.
    pub scenario: u8,
    /// What was done.
    pub did: String,
    /// What is counted, with its unit.
    pub figure: &'static str,
    /// What came out.
    pub value: f64,
    /// Limits.
    pub least: f64,
    pub most: f64,
    /// It is known not to hold: said in the table, and held to until it is mended.
    pub falls_short: bool,
}

/// A row that is known not to hold.
pub fn short_of(
    scenario: u8,
    did: &str,
    figure: &'static str,
    value: f64,
    limits: std::ops::RangeInclusive<f64>,
) -> Row {
    Row { falls_short: true, ..row(scenario, did, figure, value, limits) }
}

/// A row; `limits` are what is allowed, both ends included.
pub fn row(
    scenario: u8,
    did: &str,
    figure: &'static str,
    value: f64,
    limits: std::ops::RangeInclusive<f64>,
) -> Row {
    Row {
        scenario,
        did: did.to_owned(),
        figure,
        value,
        least: *limits.start(),
        most: *limits.end(),
        falls_short: false,
    }
}

impl Row {
    fn holds(&self) -> bool {
        self.least <= self.value && self.value <= self.most
    }

    /// What stands in the table before the figure, and after it.
    fn around(&self) -> (String, String) {
        let before = format!("| {} | {} | {} | ", self.scenario, self.did, self.figure);
        let met = if self.falls_short { "**falls short**" } else { "holds" };
        (before, format!(" | {} to {} | {met} |", short(self.least), short(self.most)))
    }
}

/// Three digits that count.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".into();
    }
    let places = (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Fails with every row that is out of its limits, and with one that fell short and no longer does.
pub fn hold(rows: &[Row]) {
    let out: Vec<String> = rows
        .iter()
        .filter(|row| row.holds() == row.falls_short)
        .map(|row| {
            let (before, after) = row.around();
            format!("{before}{}{after}", short(row.value))
        })
        .collect();
    assert!(out.is_empty(), "not as they are said to be:\n{}", out.join("\n"));
}

const HEAD: &str = "# The driver in closed loop\n\n\
Simulated: the shipped driver (`Driver`, background, queues, `LoopTask`, shunt and encoder code) on the simulated joint, orders over CAN\n\
frames, virtual time. Made by `UPDATE_TABLES=1 cargo test -p host-sim --test closed_loop`; the same test without the variable holds every figure\n\
against its limits and against this table. Limits are set from what the parts can do. What a figure means where it is no success is said below the table.\n\n\
| scenario | what was done | figure | came out | limits | |\n|---|---|---|---|---|---|\n";

const FOOT: &str = include_str!("notes.md");

fn path() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "docs", "closed-loop.md"].iter().collect()
}

/// Holds the table in git against these rows, or writes it.
pub fn compare<'a>(rows: impl Iterator<Item = &'a Row>) {
    let mut rows: Vec<&Row> = rows.collect();
    rows.sort_by_key(|row| row.scenario);
    if std::env::var_os("UPDATE_TABLES").is_some() {
        let mut text = HEAD.to_owned();
        for row in &rows {
            let (before, after) = row.around();
            let _ = writeln!(text, "{before}{}{after}", short(row.value));
        }
        std::fs::write(path(), text + FOOT).expect("docs can be written");
        return;
    }
    let known = std::fs::read_to_string(path()).expect("docs/closed-loop.md");
    let update = "UPDATE_TABLES=1 writes the table anew";
    assert!(known.starts_with(HEAD) && known.ends_with(FOOT), "{update}");
    let lines: Vec<&str> =
        known[HEAD.len()..].lines().take_while(|line| line.starts_with('|')).collect();
    assert_eq!(lines.len(), rows.len(), "{update}");
    for (line, row) in lines.into_iter().zip(rows) {
        let (before, after) = row.around();
        let figure =
            line.strip_prefix(before.as_str()).and_then(|l| l.strip_suffix(after.as_str()));
        let figure = figure.unwrap_or_else(|| panic!("{update}: {line} is not {before}..{after}"));
        let figure: f64 = figure.parse().expect("a number");
        // Another compiler's last digits may differ; a fifth of the limits' width is another result.
        let apart = (figure - row.value).abs();
        let same = apart <= 0.05 * figure.abs().max(row.value.abs()) + 1e-6;
        assert!(same, "{update}: {line} came out as {}", short(row.value));
    }
}
