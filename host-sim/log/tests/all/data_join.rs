//! Files that hold one channel each, joined by their times.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{Cells, Dataset, Quantity, ReadOptions, Table, read, read_tables};
use std::path::PathBuf;

const ROWS: u32 = 200;

fn time(row: u32) -> f64 {
    0.01 * f64::from(row)
}

fn position(row: u32) -> f64 {
    2.0 * (3.0 * time(row)).sin()
}

fn velocity(row: u32) -> f64 {
    6.0 * (3.0 * time(row)).cos()
}

fn torque(row: u32) -> f64 {
    0.5 * velocity(row).signum()
}

/// Returns a file of two columns, with the stamps of some rows later by `late_s`.
fn file(header: &str, values: fn(u32) -> f64, late_s: f64) -> String {
    let row = |row| format!("{:.5},{:.6}\n", time(row) + late_s, values(row));
    format!("{header}{}", (0..ROWS).map(row).collect::<String>())
}

const PAIRS: &str = "time_s=time,torque_nm=effort,velocity_rad_s=velocity,position_rad=position";

fn options(pairs: &str) -> ReadOptions {
    let pairs = pairs.split(',').filter_map(|pair| pair.split_once('='));
    let columns = pairs.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned())).collect();
    ReadOptions { columns, join: true, ..ReadOptions::default() }
}

fn read_with(folder: &Folder, files: &[PathBuf], options: &ReadOptions) -> Result<Dataset, String> {
    read(files, options, &|_, _| {}).map_err(|error| plain(folder, &error))
}

/// A channel: its word, its values and how late its clock is, s.
type Channel = (&'static str, fn(u32) -> f64, f64);

/// Writes the three channels of a recording. `name` is the name of each channel's file.
fn write(
    folder: &Folder,
    header: &str,
    late_s: f64,
    name: impl Fn(&str) -> String,
) -> Vec<PathBuf> {
    let channels: [Channel; 3] =
        [("effort", torque, 0.0), ("position", position, late_s), ("velocity", velocity, -late_s)];
    let write = |(word, values, late_s): Channel| {
        folder.write(&name(word), file(&header.replace("WORD", word), values, late_s))
    };
    channels.map(write).to_vec()
}

#[test]
fn read_with_join_of_channels_with_one_clock_joins_rows() {
    for header in ["time,WORD\n", "time,value\n", ""] {
        let folder = Folder::new();
        let files = write(&folder, header, 0.0, |word| format!("{word}.csv"));
        let data = read_with(&folder, &files, &options(PAIRS)).unwrap();
        assert_eq!((data.runs.len(), data.rows, data.bad_rows.count), (1, 200, 0), "{header:?}");
        let run = &data.runs[0];
        assert_eq!((&*run.name, run.time_s[3]), ("effort+position+velocity", 0.03));
        assert!((run.velocity[3] - velocity(3)).abs() < 1e-5);
        assert!((run.get(Quantity::Position).unwrap()[3] - position(3)).abs() < 1e-5);
        assert_eq!(data.files, files);
        let parts = ["effort.csv", "position.csv", "velocity.csv", "200 rows"];
        message::check("joins", "equal times", &data.notes[0], &parts);
    }
}

#[test]
fn read_with_join_of_many_recordings_makes_runs() {
    for name in [
        |word: &str, run: u32| format!("{word}/1.{run:02}.csv"),
        |word: &str, run: u32| format!("1.{run:02}_{word}.csv"),
    ] {
        let folder = Folder::new();
        let mut files: Vec<PathBuf> =
            (1..=4).flat_map(|run| write(&folder, "", 0.0, |word| name(word, run))).collect();
        // The shell lists folder by folder.
        files.sort();
        let data = read_with(&folder, &files, &options(PAIRS)).unwrap();
        let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
        // Their dots begin no extension.
        assert_eq!(names, ["1.01", "1.02", "1.03", "1.04"]);
        assert!(data.runs.iter().all(|run| run.len() == 200));
        let more = data.notes.iter().find(|note| note.starts_with("1 ")).expect("a note");
        message::check("joins", "one more recording than is shown", more, &[]);
    }
}

#[test]
fn read_with_join_of_channels_with_own_clocks_merges_them() {
    let folder = Folder::new();
    let files = write(&folder, "time,WORD\n", 0.003, |word| format!("{word}.csv"));
    let data = read_with(&folder, &files, &options(PAIRS)).unwrap();
    let run = &data.runs[0];
    assert!(data.rows > 190 && data.bad_rows.count == 0, "{} {:?}", data.rows, data.bad_rows);
    message::check("joins", "different times", &data.notes[0], &["effort.csv", " rows"]);
    // The velocity of a row is interpolated between two stamps that are 3 ms early.
    let expected = |t: f64| 6.0 * (3.0 * (t + 0.003)).cos();
    let off = run.time_s.iter().zip(&run.velocity).map(|(t, v)| (v - expected(*t)).abs());
    assert!(off.fold(0.0, f64::max) < 0.01);
}

#[test]
fn read_with_join_of_times_apart_returns_error() {
    let folder = Folder::new();
    let files = write(&folder, "time,WORD\n", 5.0, |word| format!("{word}.csv"));
    let error = read_with(&folder, &files, &options(PAIRS)).unwrap_err();
    let parts = ["effort.csv", "0 to 1.99", "5 to 6.99", "position.csv"];
    message::check("joins", "times apart", &error, &parts);
    let mut files = write(&folder, "", 0.0, |word| format!("{word}/1.csv"));
    files.push(folder.write("effort/2.csv", file("", torque, 0.0)));
    let error = read_with(&folder, &files, &options(PAIRS)).unwrap_err();
    message::check("joins", "missing channels", &error, &["effort/2.csv", "1 of 3"]);
}

#[test]
fn read_with_channels_apart_returns_error_with_the_option() {
    let folder = Folder::new();
    let files = write(&folder, "time,WORD\n", 0.0, |word| format!("{word}.csv"));
    let error = read_with(&folder, &files, &ReadOptions::default()).unwrap_err();
    let pairs = "columns time_s=time,velocity_rad_s=velocity,torque_nm=effort";
    let parts = ["effort.csv", "time, effort", "join", pairs];
    message::check("joins", "channels apart without join", &error, &parts);
}

#[test]
fn read_with_runs_of_one_channel_suggests_no_join() {
    let folder = Folder::new();
    let run = |name: &str| folder.write(name, file("time,velocity\n", velocity, 0.0));
    let files = [run("velocity_1.csv"), run("velocity_2.csv")];
    let error = read_with(&folder, &files, &ReadOptions::default()).unwrap_err();
    assert!(!error.contains("join"), "{error}");
    let error = read_with(&folder, &files, &options(PAIRS)).unwrap_err();
    message::check("joins", "channel twice", &error, &["velocity_2.csv", "velocity"]);
}

#[test]
fn read_with_join_of_rows_without_times_needs_rate() {
    let folder = Folder::new();
    let one = |word: &str, values: fn(u32) -> f64| {
        let rows: String = (0..ROWS).map(|row| format!("{}\n", values(row))).collect();
        folder.write(&format!("{word}.txt"), format!("{word}\n{rows}"))
    };
    let files = [one("effort", torque), one("velocity", velocity)];
    let pairs = options("torque_nm=effort,velocity_rad_s=velocity");
    let error = read_with(&folder, &files, &pairs).unwrap_err();
    let parts = ["effort.txt", "columns time_s=NAME", "rate 200Hz"];
    message::check("joins", "rows without times", &error, &parts);
    let data = read_with(&folder, &files, &ReadOptions { rate_hz: Some(100.0), ..pairs }).unwrap();
    assert_eq!((data.rows, data.runs[0].time_s[2]), (200, 0.02));
}

#[test]
fn read_with_join_of_different_lengths_reports_the_rows_left_out() {
    let one = |word: &str, values: fn(u32) -> f64, rows: u32, is_timed: bool| {
        let stamp = |row| if is_timed { format!("{:.2},", time(row)) } else { String::new() };
        let lines: String =
            (0..rows).map(|row| format!("{}{}\n", stamp(row), values(row))).collect();
        let header = if is_timed { "time," } else { "" };
        (format!("{word}.csv"), format!("{header}{word}\n{lines}"))
    };
    let rated =
        ReadOptions { rate_hz: Some(100.0), ..options("torque_nm=effort,velocity_rad_s=velocity") };
    let timed = options("time_s=time,torque_nm=effort,velocity_rad_s=velocity");
    for (is_timed, options, section) in [
        ([false, false], &rated, "different lengths"),
        ([false, true], &timed, "different lengths"),
        ([true, true], &timed, "different lengths with a clock"),
    ] {
        let folder = Folder::new();
        let files = [
            one("effort", torque, ROWS, is_timed[0]),
            one("velocity", velocity, ROWS - 3, is_timed[1]),
        ];
        let files = files.map(|(name, text)| folder.write(&name, text));
        let data = read_with(&folder, &files, options).unwrap();
        assert_eq!((data.rows, data.bad_rows.count), (197, 0));
        let run = &data.runs[0];
        assert!(
            (run.time_s[150] - 1.5).abs() < 1e-9
                && (run.velocity[150] - velocity(150)).abs() < 1e-9
        );
        message::check("joins", section, &data.notes[0], &[]);
    }
    let folder = Folder::new();
    let files = [one("effort", torque, ROWS, false), one("velocity", velocity, 150, false)];
    let files = files.map(|(name, text)| folder.write(&name, text));
    let error = read_with(&folder, &files, &rated).unwrap_err();
    message::check(
        "joins",
        "other lengths",
        &error,
        &["effort.csv", "200 rows", "150 as in velocity.csv"],
    );
}

#[test]
fn read_with_join_of_rows_without_a_time_reports_or_refuses_them() {
    let folder = Folder::new();
    let write = |broken: u32| {
        let row = |row: u32| match row % broken {
            1 => format!("?,{}\n", torque(row)),
            _ => format!("{:.5},{}\n", time(row), torque(row)),
        };
        let rows: String = (0..ROWS).map(row).collect();
        let effort = folder.write("effort.csv", format!("time,effort\n{rows}"));
        vec![effort, folder.write("velocity.csv", file("time,velocity\n", velocity, 0.0))]
    };
    let pairs = options("time_s=time,torque_nm=effort,velocity_rad_s=velocity");
    let data = read_with(&folder, &write(100), &pairs).unwrap();
    assert_eq!(data.rows, 198);
    message::check("joins", "few rows without a time", &data.notes[0], &["2 rows"]);
    let error = read_with(&folder, &write(10), &pairs).unwrap_err();
    message::check("joins", "rows without a time", &error, &["effort.csv", "20 of 200"]);
}

#[test]
fn read_tables_with_join_joins_them() {
    let table = |word: &str, values: fn(u32) -> f64| Table {
        name: word.into(),
        columns: vec![
            ("time".into(), Cells::Numbers((0..ROWS).map(time).collect())),
            (word.into(), Cells::Numbers((0..ROWS).map(values).collect())),
        ],
    };
    let tables = [table("effort", torque), table("velocity", velocity)];
    let pairs = options("time_s=time,torque_nm=effort,velocity_rad_s=velocity");
    let data = read_tables(&tables, &pairs).unwrap();
    assert_eq!((data.rows, data.runs[0].velocity[5]), (200, velocity(5)));
}
