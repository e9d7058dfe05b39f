//! Forms of tables other than a header with a row for each sample.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{Dataset, ReadOptions, read, survey};
use std::fmt::Write;

const ROWS: u32 = 300;
const STEP_S: f64 = 0.001;

fn time(row: u32) -> f64 {
    STEP_S * f64::from(row)
}

fn velocity(time_s: f64) -> f64 {
    2.0 * (9.0 * time_s).sin()
}

fn torque(time_s: f64) -> f64 {
    0.4 * velocity(time_s).signum() + 0.2 * velocity(time_s)
}

fn try_read(text: &str, options: &ReadOptions) -> Result<Dataset, String> {
    let folder = Folder::new();
    let path = folder.write("log.csv", text);
    read(&[path], options, &|_, _| {}).map_err(|error| plain(&folder, &error))
}

fn with_columns(pairs: &str) -> ReadOptions {
    let pairs = pairs.split(',').filter_map(|pair| pair.split_once('='));
    let columns = pairs.map(|(ours, theirs)| (ours.to_owned(), theirs.to_owned())).collect();
    ReadOptions { columns, ..ReadOptions::default() }
}

/// Requires that all rows hold the velocity and the torque of their times.
#[track_caller]
fn check_rows(data: &Dataset, rows: usize, tolerance: f64) {
    assert_eq!((data.bad_rows.count, data.rows), (0, rows), "{:?}", data.bad_rows.first.first());
    for run in &data.runs {
        for ((time_s, found), torque_nm) in run.time_s.iter().zip(&run.velocity).zip(&run.torque) {
            assert!((found - velocity(*time_s)).abs() < tolerance, "{time_s}: {found}");
            assert!((torque_nm - torque(*time_s)).abs() < tolerance, "{time_s}: {torque_nm}");
        }
    }
}

/// Writes a line for each value.
fn long(header: &str, line: impl Fn(&str, f64, f64) -> String) -> String {
    let mut text = format!("{header}\n");
    for time_s in (0..ROWS).map(time) {
        for (name, value) in [("velocity_rad_s", velocity(time_s)), ("torque_nm", torque(time_s))] {
            let _ = writeln!(text, "{}", line(name, time_s, value));
        }
    }
    text
}

#[test]
fn read_with_long_table_makes_a_column_of_each_name() {
    let influx = "#group,false,false,true\n#datatype,string,dateTime:RFC3339,double\n,result,table,_time,_value,_field,_measurement";
    for text in [
        long("Timestamp,Key,Value", |name, time, value| {
            format!("{time:.3},/arm/{name},{value:.7}")
        }),
        long("value;signal;t;unit", |name, time, value| format!("{value:.7};{name};{time:.3};x")),
        long(
            "\"VarName\";\"TimeString\";\"VarValue\";\"Validity\";\"Time_ms\"",
            |name, time, value| {
                let days = (40_000.0 + time / 86_400.0) * 1e6;
                format!("\"{name}\";\"06.07.2009 00:00:00\";{value:.7};1;{days:.4}")
                    .replace('.', ",")
            },
        ),
        long("timestamp,topic,data", |name, time, value| format!("{time:.3},{name},{value:.7}")),
        long("", |name, time, value| format!("{time:.3};{name};{value:.7}")),
        long("t,quoi,value", |name, time, value| format!("{time:.3},{name},{value:.7}")),
        long("ts_ms,point,val", |name, time, value| format!("{:.0},{name},{value:.7}", 1e3 * time)),
        long("time,device,metric,value,quality", |name, time, value| {
            format!(
                "{time:.3},plc1,{name},{value:.7},{}",
                if value > 0.0 { "good" } else { "poor" }
            )
        }),
        long(influx, |name, time, value| {
            let table = u8::from(name == "torque_nm");
            format!(",,{table},2024-03-14T09:00:{time:06.3}Z,{value:.7},{name},arm")
        }),
    ] {
        let data = try_read(&text, &ReadOptions::default()).unwrap();
        let data =
            if text.contains("2024") || text.contains("2009") { shifted(data) } else { data };
        // Stamps of WinCC have steps of 8.6 us.
        check_rows(&data, ROWS as usize, 2e-4);
        assert_eq!(data.covariates, Vec::<String>::new(), "{}", &text[..80]);
        assert!(
            data.notes.iter().any(|note| note.contains("one value a line")),
            "{:?}",
            data.notes
        );
    }
}

/// Counts the times from the first row, as the log's dates do.
fn shifted(mut data: Dataset) -> Dataset {
    let first = data.runs[0].time_s[0];
    data.runs[0].time_s.iter_mut().for_each(|time| *time -= first);
    data
}

#[test]
fn read_with_long_table_by_series_and_recording_sorts_rows() {
    // One series after the other, each with two recordings.
    let mut text = "ts,field,value\n".to_owned();
    for (name, of) in [("velocity_rad_s", velocity as fn(f64) -> f64), ("torque_nm", torque)] {
        for later_s in [0.0, 4e-4] {
            (0..ROWS).map(|row| time(row) + later_s).for_each(|time| {
                let _ = writeln!(text, "{time:.4},{name},{:.7}", of(time));
            });
        }
    }
    let data = try_read(&text, &ReadOptions::default()).unwrap();
    check_rows(&data, 2 * ROWS as usize, 1e-5);
    assert_eq!(data.runs.len(), 2);
}

#[test]
fn read_with_long_table_of_separate_clocks_merges_them() {
    let text = long("ts,field,value", |name, time, value| match name {
        "torque_nm" => format!("{:.4},{name},{:.7}", time + 0.0003, torque(time + 0.0003)),
        name => format!("{time:.4},{name},{value:.7}"),
    });
    let data = try_read(&text, &ReadOptions::default()).unwrap();
    check_rows(&data, ROWS as usize - 1, 1e-3);
}

#[test]
fn read_with_long_table_of_several_joints_and_runs_keeps_them_apart() {
    let each = |header: &str, values: [&str; 2]| {
        let text = values.map(|of| {
            let line =
                |name: &str, time: f64, value: f64| format!("{time:.3},{of},{name},{value:.7}");
            long("", line).trim_start().to_owned()
        });
        format!("{header}\n{}", text.concat())
    };
    let runs = try_read(&each("time,run,name,value", ["a", "b"]), &ReadOptions::default()).unwrap();
    check_rows(&runs, 2 * ROWS as usize, 1e-5);
    assert_eq!(runs.runs.iter().map(|run| &*run.name).collect::<Vec<_>>(), ["a", "b"]);
    let text = each("time,joint,name,value", ["knee", "hip"]);
    let error = try_read(&text, &ReadOptions::default()).unwrap_err();
    assert!(error.contains("2 joints"), "{error}");
    let only = vec![("joint".to_owned(), vec!["hip".to_owned()])];
    let hip = try_read(&text, &ReadOptions { only, ..ReadOptions::default() }).unwrap();
    assert_eq!(hip.runs[0].len(), ROWS as usize);
}

#[test]
fn read_with_long_table_without_the_contract_names_returns_error_with_them() {
    let text = long("time,name,value,unit", |name, time, value| {
        let (name, value, unit) = match name {
            "torque_nm" => ("tau", 1e3 * value, "mNm"),
            _ => ("speed", value.to_degrees(), "deg/s"),
        };
        format!("{time:.3},MAIN.axis.{name},{value:.7},{unit}")
    });
    let error = try_read(&text, &ReadOptions::default()).unwrap_err();
    let parts = ["speed [deg/s]", "tau [mNm]", "long table"];
    message::check("reading", "long table without contract names", &error, &parts);
    for pairs in [
        "time_s=time,velocity_rad_s=speed [deg/s]:deg/s,torque_nm=tau [mNm]:mNm",
        "time_s=time,velocity_rad_s=MAIN.axis.speed:deg/s,torque_nm=MAIN.axis.tau:mNm",
    ] {
        check_rows(&try_read(&text, &with_columns(pairs)).unwrap(), ROWS as usize, 1e-5);
    }
    let folder = Folder::new();
    let found = survey(&folder.write("log.csv", &text), &ReadOptions::default()).unwrap();
    let names: Vec<&str> = found.columns.iter().map(|column| &*column.name).collect();
    assert_eq!(names, ["time", "speed [deg/s]", "tau [mNm]"]);
}

#[test]
fn read_with_bad_value_of_long_table_reports_its_line() {
    let text = long("time,name,value", |name, time, value| {
        let is_bad = name == "torque_nm" && (time - 0.1).abs() < 1e-9;
        if is_bad {
            format!("{time:.3},{name},off")
        } else {
            format!("{time:.3},{name},{value:.7}")
        }
    });
    let data = try_read(&text, &ReadOptions::default()).unwrap();
    let bad = &data.bad_rows.first[0];
    assert_eq!((bad.row, &*bad.column, &*bad.found), (202, "torque_nm", "\"off\""));
    assert_eq!(data.bad_rows.count, 1);
}

#[test]
fn read_with_state_beside_one_measurement_is_no_long_table() {
    let state = |row: u32| if (row / 20).is_multiple_of(2) { "idle" } else { "moving" };
    let line = |row| format!("{:.3},{},{:.7}\n", time(row), state(row), velocity(time(row)));
    let rows: String = (0..ROWS).map(line).collect();
    let error = try_read(&format!("t,state,value\n{rows}"), &ReadOptions::default()).unwrap_err();
    assert!(error.contains("t, state, value") && !error.contains("long"), "{error}");
}

#[test]
fn read_with_words_of_a_long_table_in_a_wide_one_reads_it() {
    let rows: String = (0..ROWS)
        .map(|row| {
            format!(
                "{:.3},a,{},{:.7},{:.7}\n",
                time(row),
                row,
                velocity(time(row)),
                torque(time(row))
            )
        })
        .collect();
    let data = try_read(
        &format!("time_s,name,value,velocity_rad_s,torque_nm\n{rows}"),
        &ReadOptions::default(),
    );
    check_rows(&data.unwrap(), ROWS as usize, 1e-5);
    let error =
        try_read(&format!("time_s,name,value,x,y\n{rows}"), &ReadOptions::default()).unwrap_err();
    assert!(
        error.contains("columns time_s, name, value, x, y") && !error.contains("long"),
        "{error}"
    );
}

/// Values of a channel at every `every`th row of 0.2 ms, or empty cells.
fn at_rate(row: u32, every: u32, of: fn(f64) -> f64) -> String {
    let is_there = row.is_multiple_of(every);
    if is_there { format!("{:.7}", of(f64::from(row) * 2e-4)) } else { String::new() }
}

#[test]
fn read_with_faster_channel_beside_velocity_and_torque_leaves_no_row_out() {
    for (extra, fast) in
        [("current", torque as fn(f64) -> f64), ("position_rad", |time| 0.2 * time)]
    {
        let rows: String = (0..5 * ROWS)
            .map(|row| {
                let [fast, velocity, torque] = [(1, fast), (5, velocity), (5, torque)]
                    .map(|(every, of)| at_rate(row, every, of));
                format!("{:.4},{fast},{velocity},{torque}\n", f64::from(row) * 2e-4)
            })
            .collect();
        let text = format!("time_s,{extra},velocity_rad_s,torque_nm\n{rows}");
        let data = try_read(&text, &ReadOptions::default()).unwrap();
        assert_eq!((data.bad_rows.count, data.runs[0].len()), (0, ROWS as usize), "{extra}");
    }
}

#[test]
fn read_with_slow_channel_in_the_first_rows_returns_error() {
    for slow in [&["torque_nm"][..], &["velocity_rad_s", "torque_nm"]] {
        let of = |row: u32, name: &str| {
            let (is_slow, is_velocity) = (slow.contains(&name), name.starts_with('v'));
            let time_s = f64::from(row) * if is_slow { 1e-3 } else { 2e-4 };
            let value = if is_velocity { velocity(time_s) } else { torque(time_s) };
            if is_slow && row >= ROWS { String::new() } else { value.to_string() }
        };
        let line = |row: u32| {
            let [velocity, torque] = ["velocity_rad_s", "torque_nm"].map(|name| of(row, name));
            format!("{:.4},{row},{velocity},{torque}\n", f64::from(row) * 2e-4)
        };
        let rows: String = (0..5 * ROWS).map(line).collect();
        let text = format!("time_s,current,velocity_rad_s,torque_nm\n{rows}");
        let error = try_read(&text, &ReadOptions::default()).unwrap_err();
        let error = error.replace(slow[0], "SLOW");
        let parts = ["log.csv", "SLOW", "first 300 of 1500 rows", "1/5"];
        message::check("reading", "slow channel in the first rows", &error, &parts);
    }
}

#[test]
fn read_with_clock_for_each_rate_merges_channels() {
    for (fast, slow) in
        [("velocity_rad_s", "torque_nm"), ("torque_nm", "velocity_rad_s"), ("current", "x")]
    {
        let of = |name: &str| if name.starts_with('v') { velocity } else { torque };
        let mut header = format!("time,{fast}");
        let slow: Vec<String> = match slow {
            "x" => vec!["velocity_rad_s".into(), "torque_nm".into()],
            slow => vec![slow.into(), "temperature_c".into()],
        };
        slow.iter().for_each(|name| {
            let _ = write!(header, ",time,{name}");
        });
        let mut text = format!("{header}\n");
        for row in 0..5 * ROWS {
            let t = f64::from(row) * 2e-4;
            let _ = write!(text, "{t:.4},{:.7}", of(fast)(t));
            // The slow channels end early, with empty cells or with none.
            for name in slow.iter().filter(|_| row < ROWS || row % 2 == 0) {
                let t = f64::from(row) * 1e-3;
                let sample =
                    if row < ROWS { format!("{t:.4},{:.7}", of(name)(t)) } else { ",".into() };
                let _ = write!(text, ",{sample}");
            }
            text.push('\n');
        }
        let data = try_read(&text, &with_columns("time_s=time")).unwrap();
        let rows = if fast == "torque_nm" { 5 * (ROWS as usize - 1) + 1 } else { ROWS as usize };
        let found: usize = data.runs.iter().map(|run| run.len()).sum();
        assert_eq!((data.bad_rows.count, found), (0, rows), "{header}");
    }
}

/// Returns a log of two channels with clocks of their own. `stamp` writes a time in ms.
fn twincat(stamp: impl Fn(&str, u32) -> String) -> String {
    let line = |row: u32| {
        let (velocity, torque) = (velocity(time(row)), torque(time(row)));
        format!("{},{velocity},{},{torque}\n", stamp("velocity", row), stamp("torque", row))
    };
    format!("t1,velocity_rad_s,t2,torque_nm\n{}", (0..ROWS).map(line).collect::<String>())
}

#[test]
fn read_with_filetime_of_each_channel_counts_from_the_first() {
    // 2024-05-01 12:00:00 UTC; the torque is sampled 0.1 us, one tick, later.
    let first = 133_590_384_000_000_000_u64;
    let stamp = |name: &str, row| {
        (first + 10_000 * u64::from(row) + u64::from(name == "torque")).to_string()
    };
    let data = try_read(&twincat(stamp), &with_columns("time_s=t1:ms")).unwrap();
    check_rows(&data, data.rows, 1e-3);
    // The last velocity is before the last torque, and is left out or interpolated with it.
    let end_s = data.runs[0].time_s.last().unwrap();
    assert!((end_s - time(data.rows as u32 - 1)).abs() < 1e-6 && data.rows >= 299, "{end_s}");
    let note = data.notes.iter().find(|note| note.contains("times count from")).unwrap();
    assert!(note.contains("2024-05-01 12:00:00 UTC"), "{note}");
}

#[test]
fn read_with_plain_stamps_among_filetime_leaves_them_out() {
    let first = 133_590_384_000_000_000_u64;
    for is_file_time in [true, false] {
        let stamp = |_: &str, row: u32| match (row == 7) != is_file_time {
            true => (first + 10_000 * u64::from(row)).to_string(),
            false => row.to_string(),
        };
        let data = try_read(&twincat(stamp), &with_columns("time_s=t1:ms")).unwrap();
        assert_eq!((data.rows, data.bad_rows.count), (299, 2), "{is_file_time}");
        assert!(data.bad_rows.first[0].expected.contains("FILETIME"));
    }
}

#[test]
fn read_with_colons_between_cells_reads_them() {
    let rows: String = (0..ROWS)
        .map(|row| {
            format!("{:.3}:{:.7}:{:.7}\n", time(row), velocity(time(row)), torque(time(row)))
        })
        .collect();
    for (header, rows) in [
        ("time_s:velocity_rad_s:torque_nm", rows.clone()),
        ("time_s : velocity_rad_s : torque_nm", rows.replace(':', " : ")),
        ("time_s:velocity_rad_s:torque_nm", rows.replace('.', ",")),
    ] {
        let data = try_read(&format!("{header}\n{rows}"), &ReadOptions::default()).unwrap();
        check_rows(&data, ROWS as usize, 1e-5);
    }
}

#[test]
fn read_with_test_of_sysid_names_the_missing_torque() {
    let rows: Vec<String> = (0..50)
        .map(|row| {
            format!(
                "[{},{},{},{}]",
                time(row),
                12.0 * torque(time(row)),
                time(row),
                velocity(time(row))
            )
        })
        .collect();
    let rows = rows.join(",");
    let text = format!(
        "{{\"fast-forward\":[{rows}],\"slow-forward\":[{rows}],\"sysid\":true,\"test\":\"Arm\",\"units\":\"Radians\"}}"
    );
    for text in [text.clone(), text.replace(":[[", ":\n[[").replacen('{', "{\n", 1)] {
        let error = try_read(&text, &ReadOptions::default()).unwrap_err();
        let parts = ["voltage (V)", "torque_nm", "no torque", "torque_nm=voltage (V):0.1Nm"];
        message::check("reading", "test of SysId", &error, &parts);
        let data = try_read(&text, &with_columns("torque_nm=voltage (V):0.08333333333Nm")).unwrap();
        check_rows(&data, 100, 1e-9);
        assert_eq!(data.runs.len(), 2);
        let error = try_read(&text, &with_columns("torque_nm=voltage (V)")).unwrap_err();
        assert!(error.contains("volts") && error.contains("1 V"), "{error}");
    }
}

#[test]
fn read_with_stamps_of_a_channel_that_are_no_times_rejects_them() {
    let mut text = "t1,velocity_rad_s,t2,torque_nm\n".to_owned();
    for row in 0..ROWS {
        let (time_s, stamp) = (time(row), ["", "inf", "-nan", "1e38"].get(row as usize / 10));
        let stamp = stamp
            .filter(|of| row % 10 == 0 && !of.is_empty())
            .map_or(time_s.to_string(), |of| (*of).to_owned());
        let _ = writeln!(text, "{stamp},{},{time_s},{}", velocity(time_s), torque(time_s));
    }
    let data = try_read(&text, &with_columns("time_s=t1")).unwrap();
    let found: Vec<(u64, &str)> =
        data.bad_rows.first.iter().map(|cell| (cell.row, &*cell.found)).collect();
    assert_eq!(found, [(12, "\"inf\""), (22, "\"-nan\""), (32, "\"1e38\"")]);
    assert_eq!(data.rows, ROWS as usize - 3);
}

#[test]
fn survey_with_numbers_returns_them_as_written() {
    let folder = Folder::new();
    let path = folder.write("log.csv", "time_s,v,n\n0.10,007,nan\n0.20,1e3,-\n");
    let found = survey(&path, &ReadOptions::default()).unwrap();
    let samples: Vec<Vec<String>> = found.columns.into_iter().map(|of| of.samples).collect();
    assert_eq!(samples, [vec!["0.10", "0.20"], vec!["007", "1e3"], vec![]]);
}
