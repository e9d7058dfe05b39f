//! Every proposal that a survey or an error prints is typed in. The values that are read must be those of the log, or one of the
//! offered alternatives gives them.

use super::folder::Folder;
use joint_log::setting::{Message, Reference, Setting};
use joint_log::{ColumnPair, Dataset, ReadOptions, read, survey};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Deepest sequence of errors, each of which proposes what to type next.
const MAX_STEPS: usize = 3;

/// Number of rows of a drawn log.
const ROWS: usize = 600;

/// Time, position, velocity and torque of a row, in the units of the contract. The motor turns many times if `turns` is large.
fn truth(row: usize, turns: f64, step_s: f64) -> [f64; 4] {
    let t = step_s * row as f64;
    // The same motion in a log of any rate.
    let phase = 3.0 * 0.005 * row as f64;
    let (q, v) = (TAU * turns * phase.sin(), TAU * turns * 0.015 / step_s * phase.cos());
    [t, q, v, 0.5 * v.signum() + 0.1 * (v / (TAU * turns)).clamp(-5.0, 5.0)]
}

/// A column: its name, and its value from time, position, velocity and torque.
type Column = (&'static str, fn([f64; 4]) -> f64);

const T: Column = ("t", |[t, ..]| t);
const T_MS: Column = ("t", |[t, ..]| 1e3 * t);
const Q: Column = ("angle", |[_, q, ..]| q);
const Q_DEG: Column = ("angle", |[_, q, ..]| q.to_degrees());
const V: Column = ("speed", |[_, _, v, _]| v);
const V_RPM: Column = ("speed", |[_, _, v, _]| v * 60.0 / TAU);
const V_DEG: Column = ("speed", |[_, _, v, _]| v.to_degrees());
const M: Column = ("torque", |[.., torque]| torque);
const KT: Column = ("Kt_Nm", |_| 0.105);
const KT_WORDS: Column = ("torque constant", |_| 0.105);
const VOLTAGE: Column = ("v_motor", |[_, _, v, torque]| 0.1 * v + 3.0 * torque);
const VOLTAGE_BRACKETS: Column = ("V [V]", |[_, _, v, torque]| 0.1 * v + 3.0 * torque);
const BUS: Column = ("Vdc", |[_, q, ..]| 24.0 + 0.01 * q.sin());
const SECOND_SPEED: Column = ("speed_cmd", |[_, _, v, _]| 1.1 * v);
const SECOND_TIME: Column = ("timestamp_us", |[t, ..]| 1e6 * t);

/// Columns of drawn logs, turns of the motor, and the step of the rows, s.
const LOGS: [(&[Column], f64, f64); 20] = [
    (&[T, Q, V, M], 0.3, 0.005),
    (&[T, Q, V, M], 20.0, 0.005),
    (&[T, Q, V, M], 600.0, 0.005),
    (&[T, Q_DEG, V_DEG, M], 0.3, 0.005),
    (&[T, Q_DEG, V_DEG, M], 40.0, 0.005),
    (&[T, Q_DEG, V_RPM, M], 0.3, 0.005),
    (&[T, Q, V_RPM, M], 600.0, 0.005),
    (&[T, Q_DEG, V, M], 0.4, 0.005),
    (&[T_MS, Q, V_RPM, M], 1.0, 0.005),
    (&[T, Q, V, M], 0.3, 1.0),
    (&[T_MS, Q, V, M], 0.3, 0.001),
    (&[T, V_RPM, M], 30.0, 0.005),
    (&[T, V, M], 30.0, 0.005),
    (&[T, Q, V, M, KT], 0.3, 0.005),
    (&[T, KT_WORDS, Q, V, M], 0.3, 0.005),
    (&[T, VOLTAGE, Q, V, M], 0.3, 0.005),
    (&[T, VOLTAGE_BRACKETS, Q, M], 0.3, 0.005),
    (&[T, BUS, Q, V, M], 2.0, 0.005),
    (&[T, SECOND_SPEED, Q, V, M], 0.3, 0.005),
    (&[SECOND_TIME, T, Q, V, M], 0.3, 0.005),
];

fn cells(columns: &[Column], row: [f64; 4]) -> Vec<String> {
    columns.iter().map(|(_, of)| format!("{:?}", of(row))).collect()
}

/// Returns a log as a table, with a header or with numbers for names.
fn table(columns: &[Column], rows: &[[f64; 4]], separator: &str, has_header: bool) -> String {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let header = if has_header { names.join(separator) + "\n" } else { String::new() };
    header + &rows.iter().map(|row| cells(columns, *row).join(separator) + "\n").collect::<String>()
}

/// Returns a log as JSON lines, with the columns inside an object.
fn json_lines(columns: &[Column], rows: &[[f64; 4]]) -> String {
    let line = |row: &[f64; 4]| {
        let cells = columns.iter().zip(cells(columns, *row));
        let fields: Vec<String> =
            cells.map(|((name, _), cell)| format!("\"{name}\":{cell}")).collect();
        format!("{{\"seq\":\"a\",\"state\":{{{}}}}}\n", fields.join(","))
    };
    rows.iter().map(line).collect()
}

/// Pairs of `--columns`, as the command line splits them.
fn pairs(text: &str) -> Vec<(String, String)> {
    let pair = |text: &str| {
        let (ours, theirs) = text.split_once('=').unwrap_or_else(|| panic!("no pair: {text}"));
        (ours.to_owned(), theirs.to_owned())
    };
    text.split(',').map(pair).collect()
}

/// Returns options with a proposal; `None` if it has a part that the user must know.
fn with(options: &ReadOptions, setting: Setting, value: &str) -> Option<ReadOptions> {
    let mut options = options.clone();
    if ["NAME", "UNIT", "COLUMN"].iter().any(|part| value.contains(part)) {
        return None;
    }
    let number = |unit: &str| value.strip_suffix(unit)?.parse::<f64>().ok();
    match setting {
        Setting::Columns if value == "help" => return None,
        Setting::Columns => {
            let new = pairs(value);
            options.columns.retain(|(name, _)| new.iter().all(|(ours, _)| ours != name));
            options.columns.extend(new);
        }
        Setting::BadRows => options.max_bad_share = number("%")? / 100.0,
        Setting::Where => {
            let (column, of) = value.split_once('=')?;
            options.only.push((column.into(), vec![of.into()]));
        }
        _ => return None,
    }
    Some(options)
}

/// Returns the greatest relative error of what is read; `None` if the columns of the truth are not all read.
fn error(data: &Dataset, rows: &[[f64; 4]]) -> f64 {
    let times = data.runs.iter().flat_map(|run| &run.time_s);
    let read = times.zip(data.runs.iter().flat_map(|run| run.velocity.iter().zip(&run.torque)));
    let first = rows[0][0];
    let start = data.runs[0].time_s[0];
    let scale = |of: usize| rows.iter().map(|row| row[of].abs()).fold(0.0f64, f64::max);
    let (v_most, torque_most) = (scale(2), scale(3));
    // A velocity that is derived from the position has an error.
    let is_logged = data.sources.iter().any(|source| source.name.starts_with("velocity"));
    read.map(|(t, (v, torque))| {
        let time = t - start + first;
        let at = rows.partition_point(|row| row[0] < time - 1e-9).min(rows.len() - 1);
        let [right_t, _, right_v, right_torque] = rows[at];
        let of_velocity = if is_logged { (v - right_v).abs() / v_most } else { 0.0 };
        ((time - right_t).abs() / 1e-3)
            .max(of_velocity)
            .max((torque - right_torque).abs() / torque_most)
    })
    .fold(0.0, f64::max)
}

/// Reads a log and types in what each error proposes. Returns the errors of what is read by each sequence of proposals; a
/// sequence that ends in an error has an infinite one.
fn typed(
    path: &Path,
    options: &ReadOptions,
    rows: &[[f64; 4]],
    steps: usize,
) -> Vec<(String, f64)> {
    let refused = match read(&[path.to_owned()], options, &|_, _| {}) {
        Ok(data) => return vec![(String::new(), error(&data, rows))],
        Err(error) => error,
    };
    let proposals = std::cell::RefCell::new(Vec::new());
    let text = refused.worded(&|reference: Reference| {
        if reference.is_suggestion || reference.setting == Setting::Where {
            proposals.borrow_mut().push((reference.setting, reference.value.to_owned()));
        }
        format!("{} {}", reference.setting.name(), reference.value)
    });
    if steps == 0 {
        return vec![(format!("refused: {text}"), f64::INFINITY)];
    }
    let mut found = Vec::new();
    for (setting, value) in proposals.into_inner() {
        let Some(next) = with(options, setting, &value) else { continue };
        let then = typed(path, &next, rows, steps - 1);
        found.extend(
            then.into_iter()
                .map(|(text, error)| (format!("{} {value}; {text}", setting.name()), error)),
        );
    }
    found
}

/// Largest error of a value that is read as proposed.
const ROUNDING: f64 = 1e-6;

/// Types in the suggestions for the columns, with each alternative. Returns what is wrong.
fn complaints(path: &Path, rows: &[[f64; 4]], is_offered: bool) -> Vec<String> {
    let mut wrong = Vec::new();
    let options = ReadOptions::default();
    let found = survey(path, &options).expect("a table");
    let sets: Vec<Vec<String>> = found
        .columns
        .iter()
        .filter_map(|column| Some((column.suggestion.as_ref()?, &column.alternatives)))
        .map(|(first, others)| {
            std::iter::once(first).chain(others).map(ColumnPair::to_string).collect()
        })
        .collect();
    let most = sets.iter().map(Vec::len).max().unwrap_or_default();
    let set =
        |at: usize| sets.iter().map(|of| of[at.min(of.len() - 1)].clone()).collect::<Vec<_>>();
    let all: Vec<String> = (0..most).map(|at| set(at).join(",")).collect();
    let ends: Vec<(String, f64)> = all
        .iter()
        .filter_map(|all| Some((all, with(&options, Setting::Columns, all)?)))
        .flat_map(|(all, options)| {
            let ends = typed(path, &options, rows, 1);
            ends.into_iter().map(move |(text, error)| (format!("{all}; {text}"), error))
        })
        .collect();
    let of_errors = typed(path, &options, rows, MAX_STEPS);
    for (name, ends, is_offered) in
        [("suggestions", &ends, is_offered), ("errors", &of_errors, false)]
    {
        let is_right = ends.iter().any(|(_, error)| *error < ROUNDING);
        if !is_right && (is_offered || !ends.is_empty()) {
            wrong.push(format!("{name}: {ends:?}\n  {:?}", found.notes));
        }
    }
    wrong
}

#[test]
fn proposals_for_drawn_tables_read_the_truth() {
    let mut wrong = Vec::new();
    for (number, (columns, turns, step_s)) in LOGS.into_iter().enumerate() {
        let rows: Vec<[f64; 4]> = (0..ROWS).map(|row| truth(row, turns, step_s)).collect();
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        let forms = [(",", true), (";", true), ("\t", true), (",", false)];
        let tables = forms.map(|(separator, has_header)| {
            ("log.csv", table(columns, &rows, separator, has_header), has_header)
        });
        for (file, text, has_names) in
            tables.into_iter().chain([("log.jsonl", json_lines(columns, &rows), true)])
        {
            let folder = Folder::new();
            // Without names, a column may be open.
            let found = complaints(&folder.write(file, text), &rows, has_names);
            wrong.extend(
                found.iter().map(|of| format!("{number} {names:?} {file} {has_names}: {of}")),
            );
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn proposals_for_rows_that_are_bad_leave_them_out() {
    for share in [0.08, 0.3, 0.6, 0.9] {
        let rows: Vec<[f64; 4]> = (0..ROWS).map(|row| truth(row, 0.3, 0.005)).collect();
        let mut text = "time_s,position_rad,velocity_rad_s,torque_nm\n".to_owned();
        for (at, row) in rows.iter().enumerate() {
            let is_bad = ((at * 7919) % 1000) as f64 >= 1000.0 * (1.0 - share);
            let cells = row.map(|cell| if is_bad { "off".into() } else { format!("{cell:?}") });
            text += &(cells.join(",") + "\n");
        }
        let folder = Folder::new();
        let path = folder.write("log.csv", text);
        let ends = typed(&path, &ReadOptions::default(), &rows, MAX_STEPS);
        let is_right =
            ends.iter().any(|(text, error)| text.contains("bad rows") && *error < ROUNDING);
        assert!(is_right, "{share}: {ends:?}");
    }
}

#[test]
fn proposals_for_several_joints_read_each() {
    let rows: Vec<[f64; 4]> = (0..ROWS).map(|row| truth(row, 0.3, 0.005)).collect();
    let line = |(at, row): (usize, &[f64; 4])| {
        let of = |joint: &str, scale: f64| {
            let [t, q, v, torque] = *row;
            format!("{t:?},{joint},{q:?},{v:?},{:?}\n", scale * torque)
        };
        of("hip", 1.0) + &of("knee", if at == 0 { 1.0 } else { 2.0 })
    };
    let header = "time_s,joint,position_rad,velocity_rad_s,torque_nm\n".to_owned();
    let text = header + &rows.iter().enumerate().map(line).collect::<String>();
    let folder = Folder::new();
    let path = folder.write("log.csv", text);
    let ends = typed(&path, &ReadOptions::default(), &rows, MAX_STEPS);
    assert!(ends.iter().any(|(text, error)| text.contains("hip") && *error < ROUNDING), "{ends:?}");
}

/// Makes documents of JSON of a log, with the names of the contract.
fn documents(rows: &[[f64; 4]]) -> Vec<(&'static str, String)> {
    const NAMES: [&str; 4] = ["time_s", "position_rad", "velocity_rad_s", "torque_nm"];
    let object = |row: &[f64; 4]| {
        let fields: Vec<String> =
            NAMES.iter().zip(row).map(|(name, value)| format!("\"{name}\": {value:?}")).collect();
        format!("{{{}}}", fields.join(", "))
    };
    let objects: Vec<String> = rows.iter().map(object).collect();
    let column = |at: usize| rows.iter().map(|row| format!("{:?}", row[at])).collect::<Vec<_>>();
    let lists: Vec<String> =
        (0..4).map(|at| format!("\"{}\": [{}]", NAMES[at], column(at).join(", "))).collect();
    let indexed: Vec<String> = (0..4)
        .map(|at| {
            let cells: Vec<String> = column(at)
                .iter()
                .enumerate()
                .map(|(row, cell)| format!("\"{row}\":{cell}"))
                .collect();
            format!("\"{}\":{{{}}}", NAMES[at], cells.join(","))
        })
        .collect();
    let arrays: Vec<String> = rows.iter().map(|row| format!("{row:?}")).collect();
    vec![
        ("a list of objects", format!("[{}]", objects.join(","))),
        ("a list of objects in lines", format!("[\n  {}\n]\n", objects.join(",\n  "))),
        (
            "objects inside",
            format!(
                "{{\n \"rig\": {{\"name\": \"a b\", \"ids\": [1, 2]}},\n \"my log\": {{\"samples\": [\n{}\n]}}}}",
                objects.join(",\n")
            ),
        ),
        ("objects of several lines", objects.join("\n").replace(", ", ",\n ").replace('{', "{\n")),
        ("lists", format!("{{\n{}\n}}", lists.join(",\n"))),
        ("lists in a line", format!("{{{}}}", lists.join(", "))),
        ("lists inside", format!("{{\n\"unit\": \"SI\",\n\"data\": {{{}}}}}", lists.join(","))),
        ("columns of pandas", format!("{{{}}}", indexed.join(","))),
        (
            "split of pandas",
            format!(
                "{{\"columns\":[\"{}\"],\"index\":[0,1],\"data\":[{}]}}",
                NAMES.join("\",\""),
                arrays.join(",")
            ),
        ),
        ("a list of lists", format!("[{}]", arrays.join(","))),
    ]
}

#[test]
fn proposals_for_json_documents_make_a_log() {
    if Command::new("jq").arg("--version").output().is_err() {
        println!("jq is not installed");
        return;
    }
    // A column alone is longer than what is looked at.
    let rows: Vec<[f64; 4]> = (0..8000).map(|row| truth(row, 0.3, 0.005)).collect();
    for (name, text) in documents(&rows) {
        let folder = Folder::new();
        let path = folder.write("log.json", text);
        let refused =
            read(std::slice::from_ref(&path), &ReadOptions::default(), &|_, _| {}).unwrap_err();
        let refused = refused.to_string();
        let (_, command) = refused.split_once("jq ").unwrap_or_else(|| panic!("{name}: {refused}"));
        let (command, output) = command.rsplit_once(" > ").expect("an output");
        let script = format!("jq {command} > {output}");
        let done =
            Command::new("sh").args(["-c", &script]).current_dir(&folder.0).output().unwrap();
        assert!(
            done.status.success(),
            "{name}: {script}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
        let made: PathBuf = folder.0.join(output);
        let ends = typed(&made, &ReadOptions::default(), &rows, MAX_STEPS);
        assert!(ends.iter().any(|(_, error)| *error < ROUNDING), "{name}: {script}: {ends:?}");
    }
}

#[test]
fn survey_with_row_of_units_suggests_them() {
    let folder = Folder::new();
    let rows: String = (0..ROWS)
        .map(|row| truth(row, 0.3, 0.005))
        .map(|[t, q, v, torque]| {
            let (q, v) = (q.to_degrees(), v * 60.0 / TAU);
            format!("{:.1};{q:.4};{v:.4};{torque:.4}\n", 1e3 * t)
        })
        .collect();
    for units in ["ms;deg;rpm;Nm", "[ms];[deg];[rpm];[Nm]"] {
        let file = folder.write("log.csv", format!("Zeit;Achse 1;Achse 2;Moment\n{units}\n{rows}"));
        let found = survey(&file, &ReadOptions::default()).expect("a survey");
        let pairs: Vec<String> =
            found.columns.iter().flat_map(|of| &of.suggestion).map(ColumnPair::to_string).collect();
        let expected = [
            "time_s=Zeit:ms",
            "position_rad=Achse 1:deg",
            "velocity_rad_s=Achse 2:rpm",
            "torque_nm=Moment:Nm",
        ];
        assert_eq!(pairs, expected, "{units}");
        assert!(found.columns.iter().all(|of| of.alternatives.is_empty() && of.texts == 0));
    }
}
