//! The trend of a joint's learnt friction level: the file of `params trend --write`, which `fleet` reads.
//!
//! A driver learns gains on the levels of its parameter set, and keeps some of them over restarts. Time is the time of
//! learning, which is the time of sliding: a seal wears while it slides.

mod slope;

pub use slope::{MIN_ENTRIES, RobustSlope, robust_slope};

use crate::ResultError;
use crate::files::pretty;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Version of the JSON document.
pub const SCHEMA: u32 = 1;

/// Ends of the names of files that `fleet` reads: `trend.json` in the folder of a joint, or `JOINT.trend.json`.
pub const FILE_ENDS: [&str; 2] = ["trend.json", "trend.csv"];

/// Columns of the CSV file; that of the level ends with its unit.
const COLUMNS: [&str; 7] = [
    "learnt_h",
    "level",
    "level_gain",
    "level_std_deviation",
    "viscous_gain",
    "changed_term",
    "changed_term_gain",
];

/// Learnt levels at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LevelEntry {
    /// Time of learning, h.
    pub learnt_h: f64,
    /// Learnt Coulomb level, in the unit of the trend.
    pub level: f64,
    /// Gain on the level of the set that was in use.
    pub level_gain: f64,
    /// Standard deviation of that gain.
    pub level_std_deviation: f64,
    /// Gain on the viscous friction of that set.
    pub viscous_gain: f64,
    /// Term whose gain differs most from 1, as the present set names it; `None` without terms.
    pub changed_term: Option<String>,
    /// Gain of that term.
    pub changed_term_gain: Option<f64>,
}

/// Trend of a joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelTrend {
    /// Version of the document.
    pub schema: u32,
    /// Unit of the level: Nm, or N for a prismatic joint.
    pub unit: String,
    /// Entries in the order of time.
    pub entries: Vec<LevelEntry>,
}

impl LevelTrend {
    /// Returns times in units of 100 h and levels.
    pub fn points(&self) -> Vec<(f64, f64)> {
        self.entries.iter().map(|entry| (entry.learnt_h / 100.0, entry.level)).collect()
    }

    /// Reads a file by the end of its name, `.json` or `.csv`.
    ///
    /// # Errors
    /// One line that names the file.
    pub fn read(path: &Path) -> Result<Self, TrendError> {
        let parsed = || {
            let text = std::fs::read_to_string(path)?;
            let parse = match Format::of(path)? {
                Format::Csv => Self::parse_csv,
                Format::Json => Self::parse_json,
            };
            parse(&text)?.checked()
        };
        parsed().map_err(|fault| TrendError { file: path.to_owned(), fault })
    }

    /// Returns the content of a file by the end of its name, `.json` or `.csv`.
    ///
    /// # Errors
    /// One line that names the file, if its name has another end.
    pub fn emit(&self, path: &Path) -> Result<String, TrendError> {
        let text = Format::of(path).and_then(|format| match format {
            Format::Csv => Ok(self.emit_csv()),
            Format::Json => pretty(self).map_err(TrendFault::Emit),
        });
        text.map_err(|fault| TrendError { file: path.to_owned(), fault })
    }

    fn parse_json(text: &str) -> Result<Self, TrendFault> {
        let parsed: Self = serde_json::from_str(text).map_err(TrendFault::Json)?;
        match parsed.schema {
            SCHEMA => Ok(parsed),
            found => Err(TrendFault::Schema(found)),
        }
    }

    fn emit_csv(&self) -> String {
        let unit = self.unit.to_lowercase();
        let names =
            COLUMNS.map(|name| if name == "level" { format!("level_{unit}") } else { name.into() });
        let mut text = names.join(",") + "\n";
        for entry in &self.entries {
            let LevelEntry {
                learnt_h, level, level_gain, level_std_deviation, viscous_gain, ..
            } = entry;
            let term = entry.changed_term.as_deref().unwrap_or_default();
            let gain = entry.changed_term_gain.map_or(String::new(), |gain| gain.to_string());
            let _ = writeln!(
                text,
                "{learnt_h},{level},{level_gain},{level_std_deviation},{viscous_gain},{term},{gain}"
            );
        }
        text
    }

    fn parse_csv(text: &str) -> Result<Self, TrendFault> {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let header = lines.next().map_or("", |(_, line)| line);
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let place = |name: &str| names.iter().position(|found| *found == name);
        let unit = if place("level_n").is_some() { "N" } else { "Nm" };
        let level = format!("level_{}", unit.to_lowercase());
        let column = |name: &str| {
            let name = if name == "level" { &level } else { name };
            place(name).ok_or_else(|| TrendFault::Columns(header.to_owned(), name.to_owned()))
        };
        let places = COLUMNS.map(column);
        let places = places.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut entries = Vec::new();
        for (at, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let cell = |column: usize| cells.get(places[column]).copied().unwrap_or_default();
            let number = |column: usize| {
                let (name, text) = (COLUMNS[column], cell(column));
                text.parse::<f64>().map_err(|_| TrendFault::Number(at + 1, name, text.to_owned()))
            };
            let term = Some(cell(5).to_owned()).filter(|name| !name.is_empty());
            entries.push(LevelEntry {
                learnt_h: number(0)?,
                level: number(1)?,
                level_gain: number(2)?,
                level_std_deviation: number(3)?,
                viscous_gain: number(4)?,
                changed_term_gain: term.is_some().then(|| number(6)).transpose()?,
                changed_term: term,
            });
        }
        Ok(Self { schema: SCHEMA, unit: unit.into(), entries })
    }

    /// Checks the values of a file.
    fn checked(self) -> Result<Self, TrendFault> {
        for (number, entry) in (1..).zip(&self.entries) {
            let is_legal =
                entry.learnt_h.is_finite() && entry.level.is_finite() && entry.level > 0.0;
            if !is_legal {
                return Err(TrendFault::Entry(number, entry.clone()));
            }
        }
        let in_order = self.entries.windows(2).all(|pair| pair[0].learnt_h < pair[1].learnt_h);
        if in_order { Ok(self) } else { Err(TrendFault::Order) }
    }
}

/// Format of a file.
enum Format {
    Json,
    Csv,
}

impl Format {
    /// Returns the format by the end of a name.
    fn of(path: &Path) -> Result<Self, TrendFault> {
        let end = path.extension().unwrap_or_default().to_ascii_lowercase();
        match end.to_str() {
            Some("json") => Ok(Self::Json),
            Some("csv") => Ok(Self::Csv),
            _ => Err(TrendFault::UnknownEnd),
        }
    }
}

/// Why a file is not a trend.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", file.display())]
pub struct TrendError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    pub fault: TrendFault,
}

crate::error::as_line!(TrendError);

/// What is wrong with the file of a trend.
#[derive(Debug, thiserror::Error)]
pub enum TrendFault {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// A number of the trend is not finite.
    #[error(transparent)]
    Emit(ResultError),
    /// The end of its name is not that of a format.
    #[error("expected a name with the end .json or .csv")]
    UnknownEnd,
    /// It is another document.
    #[error("expected a file of `params trend --write`: {0}")]
    Json(serde_json::Error),
    /// It has this version.
    #[error("found schema {0}, expected {SCHEMA}")]
    Schema(u32),
    /// The header lacks a column.
    #[error("found the columns {0:?}, expected {1} and the others of `params trend --write`")]
    Columns(String, String),
    /// In a line and column, a text is no number.
    #[error("line {0}: {1}: found {2:?}, expected a number")]
    Number(usize, &'static str, String),
    /// An entry has an impossible time or level.
    #[error(
        "entry {}: found learnt_h {} and level {}, expected a time and a level above 0",
        .0,
        .1.learnt_h,
        .1.level
    )]
    Entry(usize, LevelEntry),
    /// The times do not rise.
    #[error("found times of learning that do not rise, expected the trend of one joint")]
    Order,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot;

    fn trend() -> LevelTrend {
        let entry = |number: u32| LevelEntry {
            learnt_h: f64::from(number) * 0.25,
            level: 4.0 + 0.1 * f64::from(number),
            level_gain: 1.02,
            level_std_deviation: 0.012,
            viscous_gain: 0.99,
            changed_term: (number > 1).then(|| "pressure-coulomb".into()),
            changed_term_gain: (number > 1).then_some(1.2),
        };
        LevelTrend { schema: SCHEMA, unit: "N".into(), entries: (1..4).map(entry).collect() }
    }

    #[test]
    fn read_of_emitted_trend_returns_the_trend() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["trend.json", "trend.csv"] {
            let path = folder.path().join(name);
            std::fs::write(&path, trend().emit(&path).unwrap()).unwrap();
            assert_eq!(LevelTrend::read(&path).unwrap(), trend(), "{name}");
        }
        let refused = trend().emit(Path::new("trend.toml")).unwrap_err().to_string();
        assert!(["trend.toml", ".json", ".csv"].iter().all(|name| refused.contains(name)));
        snapshot::check("trend", "a file of another kind", &refused);
    }

    #[test]
    fn document_of_a_trend_has_the_keys_of_its_schema() {
        use serde_json::Value;
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../schemas/trend.schema.json");
        let schema: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        let document: Value = serde_json::from_str(&pretty(&trend()).unwrap()).unwrap();
        let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&document), keys(&schema["properties"]));
        let entry = &schema["properties"]["entries"]["items"];
        assert_eq!(keys(&document["entries"][2]), keys(&entry["properties"]));
    }

    #[test]
    fn read_of_bad_files_reports_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let mut backwards = trend();
        backwards.entries.swap(0, 1);
        let backwards = backwards.emit_csv();
        let header = "learnt_h,level_n,level_gain,level_std_deviation,viscous_gain,changed_term,changed_term_gain";
        let cases = [
            ("trend.json", "{}", "`params trend --write`"),
            ("trend.json", "{\"schema\":2,\"unit\":\"Nm\",\"entries\":[]}", "schema 2"),
            ("trend.csv", "a,b\n1,2\n", "learnt_h"),
            ("trend.csv", &format!("{header}\n1,x,1,0,1,,\n"), "line 2: level: "),
            ("trend.csv", &format!("{header}\n1,-2,1,0,1,,\n"), "entry 1: "),
            ("trend.csv", &backwards, "rise"),
        ];
        let mut messages = String::new();
        for (name, content, expected) in cases {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            let line = LevelTrend::read(&path).unwrap_err().to_string();
            assert!(line.contains(expected) && line.contains(name), "{line}");
            assert_eq!(line.lines().count(), 1);
            messages += &format!("{line}\n");
        }
        snapshot::check("trend", "bad files", &messages);
    }
}
