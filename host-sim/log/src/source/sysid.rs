//! Tests that WPILib's SysId saves as JSON: an object with an array of rows for each test.
//!
//! ```text
//! {"sysid": true, "test": "Arm", "units": "Rotations", "slow-forward": [[0.02, 0.1, 0.0, 0.0], ..], ..}
//! ```
//!
//! A row holds time, voltage, position and velocity; that of a drivetrain both sides of each and the angle of the robot. A
//! voltage is no torque, so a file is read only with the value of a volt, or to show its columns.

use super::format::{Input, LogFormat};
use crate::contract::{RUN, TIME};
use crate::error::DataError;
use crate::log_table::LogTable;
use crate::setting::Setting;
use crate::table::{Cells, Table};
use crate::unit::conversion;
use serde_json::Value;
use std::io::BufReader;

/// Keys of which a file has one near its start.
const KEYS: [&[u8]; 5] = [
    b"\"sysid\"",
    b"\"slow-forward\"",
    b"\"slow-backward\"",
    b"\"fast-forward\"",
    b"\"fast-backward\"",
];

/// Columns of a mechanism after the time. POSITION and VELOCITY stand for names with the unit of the file.
const MECHANISM: [&str; 3] = ["voltage (V)", "POSITION", "VELOCITY"];

/// Columns of a drivetrain after the time.
const DRIVETRAIN: [&str; 8] = [
    "left voltage (V)",
    "right voltage (V)",
    "left_POSITION",
    "right_POSITION",
    "left_VELOCITY",
    "right_VELOCITY",
    "robot_angle",
    "robot_angular_rate",
];

/// Units of SysId, as `--columns` takes them. Others stay as they are, in columns without a unit.
const UNITS: [(&str, &str); 4] =
    [("rotations", "rev"), ("radians", "rad"), ("degrees", "deg"), ("meters", "m")];

/// Names of position and velocity, of both kinds of joint.
const MOTIONS: [(&str, &str); 2] =
    [("position_rad", "velocity_rad_s"), ("position_m", "velocity_m_s")];

pub(super) const FORMAT: LogFormat = LogFormat { matches: is_sysid, read };

/// Returns true if a file that begins with `head` is one of SysId.
pub(super) fn is_sysid(head: &[u8]) -> bool {
    let has = |key: &[u8]| head.windows(key.len()).any(|part| part == key);
    head.trim_ascii_start().starts_with(b"{") && KEYS.into_iter().any(has)
}

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let path = input.request.path;
    let refused = |found: String, expected: &str| DataError::file(path, found, expected);
    let document: Value = serde_json::from_reader(BufReader::new(input.file))
        .map_err(|error| refused(format!("damaged JSON: {error}"), "a file of SysId"))?;
    let table = table(path.display().to_string(), &document)
        .ok_or_else(|| refused("no test with rows of numbers".into(), "a file of SysId"))?;
    let of_volt = Setting::Columns.suggested(format!("torque_nm={}:0.1Nm", table.columns[2].0));
    let hint = format!(
        "a voltage is no torque: log the motor's torque or current, or state the torque of 1 V, as {of_volt}"
    );
    let table = LogTable::of_table(&input.request, table.into_columns());
    let table = table.map_err(|error| error.with_hint(&hint))?;
    let notes = vec![format!("{}: a file of SysId, each test is a run", path.display())];
    Ok(LogTable { notes, hint: Some(hint), ..table })
}

/// Makes a table of all tests.
fn table(name: String, document: &Value) -> Option<Table> {
    let numbers =
        |row: &Value| row.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
    let tests = document.as_object()?.iter();
    let tests = tests.filter_map(|(test, rows)| Some((test, rows.as_array()?)));
    let rows = tests.flat_map(|(test, rows)| rows.iter().map(move |row| (test, row)));
    let rows: Vec<(&String, Vec<f64>)> =
        rows.map(|(test, row)| Some((test, numbers(row)?))).collect::<Option<_>>()?;
    let width = rows.first()?.1.len();
    let columns: &[&str] = match width {
        4 => &MECHANISM,
        9 => &DRIVETRAIN,
        _ => return None,
    };
    let unit = document.get("units").and_then(Value::as_str).unwrap_or_default().to_lowercase();
    let unit = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, unit)| *unit);
    let unit = MOTIONS.iter().find_map(|(q, v)| Some((conversion(q, unit?).ok()?, *q, *v)));
    let (position, velocity) = unit.map_or(("position", "velocity"), |of| (of.1, of.2));
    let value = |row: &[f64], at: usize, is_motion: bool| {
        let value = row.get(at).copied().unwrap_or(f64::NAN);
        unit.filter(|_| is_motion).map_or(value, |(factor, ..)| factor.apply(value))
    };
    let named = columns.iter().enumerate().map(|(at, column)| {
        let name = column.replace("POSITION", position).replace("VELOCITY", velocity);
        let is_motion = name != *column;
        let values = rows.iter().map(|(_, row)| value(row, at + 1, is_motion));
        (name, Cells::Numbers(values.collect()))
    });
    let runs = Cells::Texts(rows.iter().map(|(test, _)| (*test).clone()).collect());
    let times = Cells::Numbers(rows.iter().map(|(_, row)| value(row, 0, false)).collect());
    let first = [(RUN.to_owned(), runs), (TIME.to_owned(), times)];
    Some(Table { name, columns: first.into_iter().chain(named).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_of_each_kind_of_test_returns_runs_in_si_units() {
        let of = |text: &str| {
            assert!(is_sysid(text.as_bytes()), "{text}");
            table("f".into(), &serde_json::from_str(text).unwrap())
        };
        let found = of(
            r#"{"fast-forward": [[1, 7, 0.5, 2]], "slow-forward": [[0, 1, 0, 0], [0.02, 2, 0.25, 1]], "sysid": true, "units": "Rotations"}"#,
        )
        .unwrap();
        let column =
            |name: &str| found.columns.iter().find(|(of, _)| of == name).unwrap().1.clone();
        let rev = std::f64::consts::TAU;
        assert_eq!(column("velocity_rad_s"), Cells::Numbers(vec![2.0 * rev, 0.0, rev]));
        assert_eq!(column("voltage (V)"), Cells::Numbers(vec![7.0, 1.0, 2.0]));
        assert_eq!(column("run").text_of(2), "slow-forward");
        let drivetrain =
            of(r#"{"slow-forward": [[0, 1, 2, 3, 4, 5, 6, 7, 8]], "units": "Meters"}"#).unwrap();
        let names: Vec<&str> = drivetrain.columns.iter().map(|(name, _)| &**name).collect();
        assert_eq!(
            names[4..8],
            ["left_position_m", "right_position_m", "left_velocity_m_s", "right_velocity_m_s"]
        );
        assert!(of(r#"{"slow-forward": [[0, 1, 0, 0], []]}"#).is_some(), "a row without values");
        for text in [
            r#"{"sysid": true}"#,
            r#"{"slow-forward": [[0, "x", 1, 2]]}"#,
            r#"{"slow-forward": [[0, 1]]}"#,
        ] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
