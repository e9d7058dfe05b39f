//! Logs whose time column is no clock, and logs without one.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{Dataset, ReadOptions, read};

const ROWS: u32 = 300;

/// Returns a log of a joint with a column `dt`, given the cell of each row.
fn log(dt: impl Fn(u32) -> String) -> String {
    let row = |row| {
        let (speed, sign) = (f64::from(row) * 0.02, if row % 40 < 20 { 1.0 } else { -1.0 });
        format!("{},{:.4},{:.4}\n", dt(row), sign * speed.sin(), sign * 0.5)
    };
    format!("dt [us],velocity_rad_s,torque_nm\n{}", (0..ROWS).map(row).collect::<String>())
}

fn read_log(text: &str, pairs: &[(&str, &str)], rate_hz: Option<f64>) -> Result<Dataset, String> {
    let folder = Folder::new();
    let columns = pairs.iter().map(|(ours, theirs)| ((*ours).into(), (*theirs).into())).collect();
    let options = ReadOptions { columns, rate_hz, ..ReadOptions::default() };
    let path = folder.write("log.csv", text);
    read(&[path], &options, &|_, _| {}).map_err(|error| plain(&folder, &error))
}

#[test]
fn read_with_step_column_as_time_returns_error_with_option() {
    let constant = log(|_| "3500".into());
    let uneven = log(|row| (3490 + row * 37 % 21).to_string());
    for (text, pairs) in [
        (&constant, [("time_s", "dt [us]:us")]),
        (&uneven, [("time_s", "dt [us]:us")]),
        (&constant, [("time_s", "dt [us]:s")]),
    ] {
        let error = read_log(text, &pairs, None).unwrap_err();
        let parts = ["log.csv", "dt [us]", "time_s=dt [us]:us:step", "3.500 ms"];
        message::require(&error, &parts);
    }
    let error = read_log(&constant, &[("time_s", "dt [us]:us")], None).unwrap_err();
    message::check("clocks", "step as time", &error, &["300 rows"]);
}

#[test]
fn read_with_steps_adds_them_up() {
    let data = read_log(&log(|_| "3500".into()), &[("time_s", "dt [us]:us:step")], None).unwrap();
    let time = &data.runs[0].time_s;
    assert_eq!((time.len(), time[0], time[2], time[299]), (300, 0.0, 0.007, 1.0465));
    let source = &data.sources[0];
    assert_eq!(
        (&*source.name, &*source.header, source.unit.as_deref()),
        ("time_s", "dt [us]", Some("us"))
    );
}

#[test]
fn read_with_clock_that_stands_still_returns_error_with_option() {
    let error = read_log(&log(|_| "0".into()), &[("time_s", "dt [us]:us")], None).unwrap_err();
    let parts = ["log.csv", "dt [us]", "0 s", "300 rows", "rate 200Hz", "200Hz"];
    message::check("clocks", "clock stands still", &error, &parts);
    let halts = log(|row| if row < 150 { row } else { 150 + row.saturating_sub(250) }.to_string());
    let error = read_log(&halts, &[("time_s", "dt [us]:ms")], None).unwrap_err();
    let parts = ["dt [us]", "0.1500 s", "152 to 252", "rate 200Hz"];
    message::check("clocks", "clock stands still in some rows", &error, &parts);
}

#[test]
fn read_with_rate_counts_rows_and_leaves_out_the_time_column() {
    let text = log(|_| "0".into()).replace("dt [us]", "time_s");
    let data = read_log(&text, &[], Some(200.0)).unwrap();
    assert_eq!((data.runs[0].time_s[1], data.runs[0].time_s[299]), (0.005, 1.495));
    assert_eq!(data.left_out_columns[0].name, "time_s");
    assert!(data.sources.iter().all(|source| source.name != "time_s"));
    let without = "velocity_rad_s,torque_nm\n1,2\n3,4\n";
    assert_eq!(read_log(without, &[], Some(1000.0)).unwrap().runs[0].time_s, [0.0, 0.001]);
    let error = read_log(&text, &[("time_s", "time_s")], Some(200.0)).unwrap_err();
    let parts = ["rate 200Hz", "columns time_s=time_s"];
    message::check("clocks", "rate and time column", &error, &parts);
}

#[test]
fn read_with_rate_keeps_time_of_rows_that_are_left_out() {
    let mut rows: Vec<String> = (0..100).map(|row| format!("{row},2")).collect();
    rows[3] = "x,2".into();
    let data =
        read_log(&format!("velocity_rad_s,torque_nm\n{}\n", rows.join("\n")), &[], Some(100.0));
    assert_eq!(data.unwrap().runs[0].time_s[2..4], [0.02, 0.04]);
}

/// Returns a candump log of a joint at 1 kHz, with the stamps of `candump -td`.
fn trace_with_deltas() -> String {
    let row = |row: u32| {
        let (velocity, torque) = ((0.05 * row as f32).sin(), 0.1 + 0.001 * (row % 7) as f32);
        let hex = |value: f32| value.to_le_bytes().map(|byte| format!("{byte:02X}")).concat();
        format!(
            "(000.001000) vcan0 481#{}{}\n(000.000000) vcan0 681#{}0000C07F\n(000.000000) vcan0 080#{:02X}\n",
            hex(0.01 * row as f32),
            hex(velocity),
            hex(torque),
            row % 240 + 1
        )
    };
    (0..200).map(row).collect()
}

#[test]
fn read_with_candump_stamps_since_the_frame_before_adds_them_up() {
    let data = read_log(&trace_with_deltas(), &[], None).unwrap();
    let time = &data.runs[0].time_s;
    assert!(time.len() > 190, "{}", time.len());
    assert!(time.windows(2).all(|pair| (pair[1] - pair[0] - 0.001).abs() < 1e-9), "{time:?}");
    message::check("clocks", "stamps since the frame before", &data.notes.join("\n"), &["log.csv"]);
}

#[test]
fn read_with_candump_stamps_of_zero_returns_error() {
    let still = trace_with_deltas().replace("(000.001000)", "(000.000000)");
    let error = read_log(&still, &[], None).unwrap_err();
    message::check("clocks", "stamps of zero", &error, &["column time_s", "0 s", "rows"]);
}

#[test]
fn read_with_clock_that_wraps_continues_it() {
    for (unit, bits, step) in [("us", 32, 5000_u64), ("ms", 16, 10), ("us", 31, 1000)] {
        let range = 1_u64 << bits;
        let text = log(|row| ((range - 100 * step + u64::from(row) * step) % range).to_string());
        let data = read_log(&text, &[("time_s", &format!("dt [us]:{unit}"))], None).unwrap();
        assert_eq!((data.runs.len(), data.rows, data.bad_rows.count), (1, 300, 0), "{unit}");
        let length = data.runs[0].time_s[299] - data.runs[0].time_s[0];
        let expected = 299.0 * step as f64 * if unit == "us" { 1e-6 } else { 1e-3 };
        assert!((length - expected).abs() < 1e-6, "{unit}: {length}");
        message::check("clocks", "clock wraps", &data.notes[0], &[&format!("{bits} bits"), " 1 "]);
    }
}

/// Returns rows of a joint at 100 Hz.
fn rows(range: std::ops::Range<u32>) -> Vec<String> {
    let row = |row: u32| {
        let velocity = (0.03 * f64::from(row)).sin();
        format!("{:.2},{velocity:.4},{:.4}\n", 0.01 * f64::from(row), 0.5 * velocity.signum())
    };
    range.map(row).collect()
}

#[test]
fn read_with_rows_written_twice_leaves_them_out() {
    let header = "time_s,velocity_rad_s,torque_nm\n".to_owned();
    let all = rows(0..300);
    let once = read_log(&(header.clone() + &all.concat()), &[], None).unwrap();
    let twice: String = all.iter().map(|row| row.repeat(2)).collect();
    let some: String =
        (0..300).map(|row| all[row].repeat(1 + usize::from(row % 50 == 7))).collect();
    let appended = all.concat().repeat(2);
    let overlapping = rows(0..200).concat() + &rows(120..300).concat();
    for (text, repeated) in [(twice, 300), (some, 6), (appended, 300), (overlapping, 80)] {
        let data = read_log(&(header.clone() + &text), &[], None).unwrap();
        assert_eq!(data.runs, once.runs, "{repeated}");
        let note = format!("log.csv: {repeated} of {} rows", 300 + repeated);
        let found = data.notes.iter().find(|of| of.contains(&note));
        let found = found.unwrap_or_else(|| panic!("{:?}", data.notes));
        message::check("clocks", "rows written twice", found, &["log.csv"]);
    }
}

#[test]
fn read_with_equal_rows_of_a_coarse_clock_keeps_them() {
    // At rest in the first stamps, then moving.
    let row = |row: u32| {
        let velocity = 0.1 * f64::from(row.saturating_sub(60));
        format!("{:.1},{velocity},0.5\n", 0.1 * f64::from(row / 10))
    };
    let text: String = (0..300).map(row).collect();
    let data = read_log(&format!("time_s,velocity_rad_s,torque_nm\n{text}"), &[], None).unwrap();
    assert_eq!(data.rows, 300);
    // Two recordings that start at rest.
    let row = |row: u32| {
        format!("{:.2},{},0.5\n", 0.01 * f64::from(row), f64::from(row.saturating_sub(40)))
    };
    let one: String = (0..100).map(row).collect();
    let other = one.replace(",0.5", ",0.6").replacen(",0.6", ",0.5", 30);
    let data =
        read_log(&format!("time_s,velocity_rad_s,torque_nm\n{one}{other}"), &[], None).unwrap();
    assert_eq!((data.rows, data.runs.len()), (200, 2));
}
