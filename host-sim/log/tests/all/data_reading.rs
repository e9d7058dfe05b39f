//! Rules of the data contract, each on a file of a few rows.
//!
//! Every test writes its file into a directory of its own and reads it through the public interface. It checks what a
//! user sees: runs, the position of bad rows, errors of one line.

use std::cell::RefCell;
use std::path::{MAIN_SEPARATOR, PathBuf};

use super::folder::{Folder, plain};
use super::message;
use joint_log::{
    DataError, Dataset, JointKind, LeftOutColumn, Measured, Quantity, ReadOptions, read,
};

fn read_with(files: &[PathBuf], options: &ReadOptions) -> Result<Dataset, DataError> {
    read(files, options, &|_, _| {})
}

fn try_text(text: impl AsRef<[u8]>) -> Result<Dataset, String> {
    let folder = Folder::new();
    let path = folder.write("log.csv", text);
    read_with(&[path], &ReadOptions::default()).map_err(|error| plain(&folder, &error))
}

fn text(text: impl AsRef<[u8]>) -> Dataset {
    try_text(text).unwrap()
}

fn refused(text: impl AsRef<[u8]>) -> String {
    try_text(text).unwrap_err()
}

/// `header`, then 100 good rows of a revolute joint, then `rows`.
fn after_100_rows(rows: &str) -> String {
    let good: String = (0..100).map(|i| format!("{}.0,1.0,2.0\n", i)).collect();
    format!("time_s,velocity_rad_s,torque_nm\n{good}{rows}")
}

/// Returns row, column, found and expected of the first bad row.
fn first_bad(data: &Dataset) -> (u64, &str, &str, &str) {
    let cell = &data.bad_rows.first[0];
    (cell.row, &cell.column, &cell.found, &cell.expected)
}

/// Compares the message of the first bad row.
#[track_caller]
fn check_first_bad(section: &str, data: &Dataset, parts: &[&str]) {
    let folder = format!("{}{}", data.files[0].parent().unwrap().display(), MAIN_SEPARATOR);
    let cell = data.bad_rows.first[0].to_string().replace(&folder, "");
    message::check("reading", section, &cell, parts);
}

const PLAIN: &str = "time_s,velocity_rad_s,torque_nm\n0.0,1.0,2.0\n0.1,1.5,2.5\n";

#[test]
fn read_with_plain_file_returns_one_run_named_after_it() {
    let data = text(PLAIN);
    assert_eq!(data.joint, JointKind::Revolute);
    assert_eq!((data.rows, data.rows_read, data.bad_rows.count), (2, 2, 0));
    let run = &data.runs[0];
    assert_eq!(run.name, "log");
    assert_eq!(run.time_s, [0.0, 0.1]);
    assert_eq!(run.velocity, [1.0, 1.5]);
    assert_eq!(run.torque, [2.0, 2.5]);
    assert!(run.measured == Measured::default());
}

#[test]
fn read_with_every_contract_column_returns_its_quantity() {
    let data = text(
        "run,time_s,velocity_m_s,force_n,position_m,acceleration_m_s2,radial_force_n,\
         pressure_diff_pa,temperature_c,load_torque_nm,flow\nA,0,1,2,3,4,5,6,7,8,9\n",
    );
    assert_eq!(data.joint, JointKind::Prismatic);
    assert_eq!(data.joint.torque_unit(), "N");
    let run = &data.runs[0];
    assert_eq!((run.velocity[0], run.torque[0]), (1.0, 2.0));
    assert_eq!(run.get(Quantity::Position), Some(&[3.0][..]));
    assert_eq!(run.get(Quantity::Acceleration), Some(&[4.0][..]));
    assert_eq!(run.get(Quantity::RadialForce), Some(&[5.0][..]));
    assert_eq!(run.get(Quantity::Pressure), Some(&[6.0][..]));
    assert_eq!(run.get(Quantity::Temperature), Some(&[7.0][..]));
    assert_eq!(run.get(Quantity::LoadTorque), Some(&[8.0][..]));
    assert_eq!(
        (data.covariates.as_slice(), &run.extra[0][..]),
        (&["flow".to_string()][..], &[9.0][..])
    );
}

#[test]
fn read_with_any_text_notation_returns_same_data() {
    let plain = text(PLAIN);
    let crlf = PLAIN.replace('\n', "\r\n");
    let semicolons = PLAIN.replace(',', ";");
    let tabs = PLAIN.replace(',', "\t");
    let quoted = "\"time_s\",\"velocity_rad_s\",\"torque_nm\"\r\n\"0.0\",\"1.0\",\"2.0\"\r\n\"0.1\",1.5,\"2.5\"\r\n";
    let blanks =
        "\n\r\n time_s , velocity_rad_s,torque_nm \n\n 0.0 , 1.0,2.0\n\n\n0.1,1.5,+2.5e0\n,,\n\n";
    let no_last_end = PLAIN.trim_end();
    let marked = format!("\u{feff}{PLAIN}");
    let remarks = format!("# made by a logger\n// kp 3\n{PLAIN}# the end\n");
    let in_remark = format!("# {PLAIN}");
    let units = PLAIN.replacen('\n', "\n s,(rad/s),N·m\n", 1);
    for other in [
        &crlf,
        &semicolons,
        &tabs,
        quoted,
        blanks,
        no_last_end,
        &marked,
        &remarks,
        &in_remark,
        &units,
    ] {
        let data = text(other);
        assert_eq!(data.runs, plain.runs, "{other:?}");
        assert_eq!(data.bad_rows.count, 0);
    }
}

#[test]
fn read_with_utf_16_returns_same_data_as_utf_8() {
    let plain = text(PLAIN);
    for mark in ["\u{feff}", ""] {
        let units: Vec<u16> = format!("{mark}{PLAIN}").encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        assert_eq!(text(little).runs, plain.runs);
        assert_eq!(text(big).runs, plain.runs);
    }
}

#[test]
fn read_with_comments_counts_rows_as_an_editor() {
    let rows = after_100_rows("x,1,2\n");
    let data = text(format!("# one\n\n# two\n{rows}"));
    assert_eq!(first_bad(&data).0, 102 + 3);
}

#[test]
fn read_with_row_of_units_converts_values() {
    let data = text("time_s,velocity_rad_s,torque_nm,flow\nms,rpm,mNm,l/min\n0,60,1500,3\n");
    let run = &data.runs[0];
    assert!((run.velocity[0] - std::f64::consts::TAU).abs() < 1e-12);
    assert_eq!((run.torque[0], run.extra[0][0], data.bad_rows.count), (1.5, 3.0, 0));
    message::check("reading", "row of units", &data.notes[0], &[]);
}

#[test]
fn read_with_decimal_comma_converts_and_notes_it() {
    let data = text("time_s;velocity_rad_s;torque_nm\n0,0;1,0;2,0\n0,1;1,5;-2,5e-1\n");
    assert_eq!(data.runs[0].torque, [2.0, -0.25]);
    message::check("reading", "decimal comma", &data.notes[0], &[]);
}

#[test]
fn read_with_unsupported_file_names_its_type() {
    let check = |section, content: &[u8], part: &str| {
        message::check("reading", section, &refused(content), &["log.csv", part]);
    };
    check("empty file", b"", "");
    check("header without rows", b"time_s,velocity_rad_s,torque_nm\r\n\r\n", "");
    check("UTF-16 cut off", b"\xff\xfet\0i\0m\0", " tim");
    check("damaged gzip archive", b"\x1f\x8b\x08rest", "gzip");
    check("damaged Parquet file", b"PAR1nonsensePAR1", "Parquet");
    let folder = Folder::new();
    let error = |files: &[PathBuf]| read_with(files, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error(&[]), DataError::Request { what, .. } if what == "data"));
    message::check("reading", "no file", &error(&[]).to_string(), &["CSV", "Parquet"]);
    let directory = error(std::slice::from_ref(&folder.0));
    assert!(matches!(&directory, DataError::File { file, .. } if *file == folder.0));
    let found = directory.to_string().replace(&folder.0.display().to_string(), "FOLDER");
    message::check("reading", "directory", &found, &["FOLDER"]);
    let missing = error(&[folder.0.join("none.csv")]);
    let DataError::Io { file, source } = &missing else { panic!("{missing}") };
    assert_eq!(source.kind(), std::io::ErrorKind::NotFound);
    assert_eq!(*file, folder.0.join("none.csv"));
    message::check("reading", "missing file", &plain(&folder, &missing), &["none.csv"]);
}

#[test]
fn read_with_bad_cell_leaves_out_row_and_reports_it() {
    for (row, column, found) in [
        ("abc,1,2", "time_s", "\"abc\""),
        ("200,NaN,2", "velocity_rad_s", "\"NaN\""),
        ("200,1,-inf", "torque_nm", "\"-inf\""),
        ("200,1,", "torque_nm", "an empty cell"),
        ("200,1e999,2", "velocity_rad_s", "\"1e999\""),
    ] {
        let data = text(after_100_rows(&format!("{row}\n200.5,1,2\n")));
        assert_eq!((data.rows, data.rows_read, data.bad_rows.count), (101, 102, 1));
        assert_eq!(first_bad(&data), (102, column, found, "a finite number"));
    }
}

#[test]
fn read_with_ragged_rows_leaves_them_out() {
    let data = text(after_100_rows("100,1\n101,1,2,3\n102,1,2\n"));
    assert_eq!((data.rows, data.bad_rows.count), (101, 2));
    assert_eq!(first_bad(&data).0, 102);
    check_first_bad("too few cells", &data, &["row 102", "(all)", "2 cells", "3 cells"]);
    assert_eq!(data.bad_rows.first[1].found, "4 cells");
}

#[test]
fn read_with_blank_lines_counts_rows_as_an_editor() {
    // Blank lines, CRLF and a quoted cell over three lines all come before the bad row.
    let rows = after_100_rows("").replace('\n', "\r\n");
    let rows = rows.replacen("\r\n0.0,1.0,2.0\r\n", "\r\n\r\n\r\n0.0,1.0,\"2.0\r\n\r\n\"\r\n", 1);
    let data = text(rows.clone() + "x,1,2\r\n");
    assert_eq!(data.rows, 100);
    let line = rows.matches('\n').count() as u64 + 1;
    assert_eq!(first_bad(&data).0, line);
    let data = text(rows + "\r\n\r\nx,1,2");
    assert_eq!(first_bad(&data).0, line + 2);
}

#[test]
fn read_with_unclosed_quote_reports_one_bad_row() {
    // The cell extends to the end of the file, in any column.
    for rows in ["100,1,\"2\n101,1,2\n102,1,2\n", "100,\"1,2\n101,1,2", "100,1,\"2"] {
        let data = text(after_100_rows(rows));
        assert_eq!((data.rows, data.bad_rows.count), (100, 1));
        let (row, column, found, _) = first_bad(&data);
        assert_eq!((row, column), (102, "(all)"));
        assert!(!found.ends_with("cells"), "{found}");
        check_first_bad("quote never closed", &data, &["row 102", "3 cells"]);
    }
    let data = text(after_100_rows("100,\"1,2\n101,1,2\n102\",1,2\n103,1,2\n"));
    check_first_bad("quoted cell over rows", &data, &["row 102", " 2 lines"]);
    assert_eq!((data.rows, data.bad_rows.count), (101, 1));
}

#[test]
fn read_with_time_running_backwards_leaves_out_row() {
    let data = text(after_100_rows("98.5,1,2\n99.0,1,2\n99.5,1,2\n"));
    assert_eq!((data.rows, data.bad_rows.count), (102, 1));
    let (row, column, found, _) = first_bad(&data);
    assert_eq!((row, column, found), (102, "time_s", "98.5"));
    check_first_bad("time backwards", &data, &["98.5", " 99 ", "row 101"]);
    message::check("reading", "time stamp repeated", &data.notes[0], &["1 rows"]);
}

#[test]
fn read_with_interleaved_runs_keeps_separate_clocks() {
    let data = text(
        "time_s,run,velocity_rad_s,torque_nm\n100,b,1,1\n0,7,2,2\n101,b,3,3\n1,7,4,4\n0, a b ,5,5\n",
    );
    let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["b", "7", "a b"]);
    assert_eq!(data.runs[0].velocity, [1.0, 3.0]);
    assert_eq!(data.runs[1].velocity, [2.0, 4.0]);
    assert_eq!(data.bad_rows.count, 0);
}

#[test]
fn read_with_row_without_run_leaves_it_out() {
    let rows: String = (0..50).map(|i| format!("a,{i},1,2\n")).collect();
    let data = text(format!("run,time_s,velocity_rad_s,torque_nm\n{rows},50,1,2\n"));
    let (row, column, found, _) = first_bad(&data);
    assert_eq!((row, column, found), (52, "run", "an empty cell"));
    check_first_bad("row without run", &data, &["row 52", "run"]);
}

#[test]
fn read_with_over_five_percent_bad_rows_returns_error() {
    let bad = |n: usize| after_100_rows(&"x,1,2\n".repeat(n));
    assert_eq!(text(bad(5)).bad_rows.count, 5);
    assert_eq!(text(bad(5)).bad_rows.first.len(), 5);
    let parts = ["log.csv", "row 102", "column time_s", "\"x\"", "6 of 106", "5 %", "bad rows 6%"];
    message::check("reading", "too many bad rows", &refused(bad(6)), &parts);
}

#[test]
fn read_with_missing_covariate_values_fills_and_notes_them() {
    let good: String = (0..40).map(|i| format!("{i},1,2,{i},x,7\n")).collect();
    let head = "time_s,velocity_rad_s,torque_nm,temperature_c,note,kp\n";
    let data = text(format!("{head}{good}40,1,2,,x,8\n41,1,2,43,x,\n42,1,2,off,x,8\n"));
    assert_eq!((data.rows, data.bad_rows.count), (43, 0));
    let run = &data.runs[0];
    assert_eq!(run.get(Quantity::Temperature).unwrap()[39..], [39.0, 41.0, 43.0, 43.0]);
    assert_eq!(run.extra[0][39..], [7.0, 8.0, 8.0, 8.0], "a setting is held");
    let parts = ["temperature_c", "41 of 43", "row 44", "\"off\"", "kp", "42 of 43"];
    message::check("reading", "covariates filled", &data.notes.join("\n"), &parts);
}

#[test]
fn read_with_columns_without_numbers_leaves_them_out() {
    let data = text(
        "run,time_s,velocity_rad_s,torque_nm,shape,temperature_c,note,\n\
         a,0,1,2,sine,,x,\na,1,1,2,sine,nan,y,\nb,0,1,2,step,,z,\n",
    );
    assert_eq!((data.rows, data.bad_rows.count), (3, 0));
    let left: Vec<&str> = data.left_out_columns.iter().map(|column| &*column.name).collect();
    assert_eq!(left, ["number 8", "shape", "temperature_c", "note"]);
    let why = |column: &LeftOutColumn| format!("{}: {}\n", column.name, column.why);
    let why: String = data.left_out_columns.iter().map(why).collect();
    message::check("reading", "columns left out", &why, &["label", "temperature_c"]);
    assert_eq!(data.runs[0].labels, [("shape".to_string(), "sine".to_string())]);
    assert_eq!(data.constant_columns(), ["run", "shape"]);
}

#[test]
fn read_with_invalid_header_reports_row_one() {
    let two_targets = refused("time_s,velocity_rad_s,torque_nm,force_n\n0,1,2,3\n");
    let parts = ["log.csv", "row 1,", "column force_n", "torque_nm"];
    message::check("reading", "two targets", &two_targets, &parts);
    let twice = refused("time_s,a,a\n");
    message::check("reading", "name twice", &twice, &["row 1,", "column a", "2 and 3"]);
    let guessed = "columns time_s=t,velocity_rad_s=v,torque_nm=NAME";
    message::check("reading", "short names", &refused("t,v,f\n0,1,2\n"), &["t, v, f", guessed]);
}

#[test]
fn read_with_mapped_columns_translates_header() {
    let folder = Folder::new();
    let path = folder.write("servo.csv", "time_s,velocity_rad_s,drive_voltage_v\n0,1,2\n");
    let pair = |text: &str| {
        let (name, foreign) = text.split_once('=').unwrap();
        (name.to_string(), foreign.to_string())
    };
    let options =
        ReadOptions { columns: vec![pair("torque_nm=drive_voltage_v")], ..Default::default() };
    let data = read_with(std::slice::from_ref(&path), &options).unwrap();
    assert_eq!((data.joint, data.runs[0].torque[0]), (JointKind::Revolute, 2.0));
    let options = ReadOptions { columns: vec![pair("torque_nm=tau")], ..Default::default() };
    let error = read_with(&[path], &options).unwrap_err().to_string();
    message::require(&error, &["columns torque_nm=tau:", " tau,", "time_s"]);
}

#[test]
fn read_with_several_files_joins_them() {
    let folder = Folder::new();
    let head = "run,time_s,velocity_rad_s,torque_nm";
    let first =
        folder.write("one/log.csv", format!("{head},temperature_c,flow,kp\n1,0,1,2,20,5,7\n"));
    let second = folder.write("two/log.csv", format!("{head},kp,temperature_c\n1,0,3,4,8,21\n"));
    let third =
        folder.write("x.csv", "time_s,velocity_rad_s,torque_nm,temperature_c,kp\n0,5,6,22,9\n");
    let data = read_with(&[first.clone(), second, third], &ReadOptions::default()).unwrap();
    let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["log:1", "log-2:1", "x"]);
    assert_eq!(data.covariates, ["kp"]);
    let kp: Vec<f64> = data.runs.iter().map(|run| run.extra[0][0]).collect();
    assert_eq!(kp, [7.0, 8.0, 9.0]);
    assert_eq!(data.runs[1].get(Quantity::Temperature), Some(&[21.0][..]));
    assert_eq!(data.runs.iter().map(|run| run.file).collect::<Vec<_>>(), [0, 1, 2]);
    message::check("reading", "covariate of one file", &data.notes.join("\n"), &["flow"]);

    let slides = folder.write("slides.csv", "time_s,velocity_m_s,force_n\n0,1,2\n");
    let error = read_with(&[first.clone(), slides], &ReadOptions::default()).unwrap_err();
    let parts = ["slides.csv", "force_n", "torque_nm", "log.csv"];
    message::check("reading", "files of two joint kinds", &plain(&folder, &error), &parts);
    let error = read_with(&[first.clone(), first], &ReadOptions::default()).unwrap_err();
    message::check("reading", "file twice", &plain(&folder, &error), &["one/log.csv"]);
}

#[test]
fn read_with_skip_drops_rows_of_each_run() {
    let folder = Folder::new();
    let rows: String =
        (0..60).map(|i| format!("{},{i},{i},2\n", if i < 40 { "a" } else { "b" })).collect();
    let path = folder.write("log.csv", format!("run,time_s,velocity_rad_s,torque_nm\n{rows}"));
    let with = |skip| {
        let options = ReadOptions { skip, ..Default::default() };
        read_with(std::slice::from_ref(&path), &options)
    };
    let data = with(5).unwrap();
    assert_eq!((data.runs[0].time_s[0], data.runs[1].time_s[0], data.rows), (5.0, 45.0, 50));
    assert_eq!(data.rows_read, 60);
    let data = with(20).unwrap();
    assert_eq!(data.runs.len(), 1);
    message::check("reading", "runs shorter than skip", &data.notes.join("\n"), &["skip", ": b"]);
    let error = with(100).unwrap_err().to_string();
    message::check("reading", "no row after skip", &error, &["skip 100"]);
}

#[test]
fn read_reports_progress_from_zero_to_total() {
    let folder = Folder::new();
    let files = [folder.write("a.csv", PLAIN), folder.write("b.csv", PLAIN)];
    let seen = RefCell::new(Vec::new());
    read(&files, &ReadOptions::default(), &|done, total| seen.borrow_mut().push((done, total)))
        .unwrap();
    let (seen, total) = (seen.into_inner(), 2 * PLAIN.len() as u64);
    assert_eq!((seen[0], *seen.last().unwrap()), ((0, total), (total, total)));
    assert!(seen.windows(2).all(|pair| pair[0].0 <= pair[1].0));
}
