//! Tables without a header, whose columns are numbered.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{Dataset, ReadOptions, read, survey};

/// Rows of time, position, a constant, velocity in degrees per second, and torque.
fn rows(by: &str) -> String {
    let row = |row: u32| {
        let t = 0.005 * f64::from(row);
        let (q, v) = (2.0 * (3.0 * t).sin(), 6.0 * (3.0 * t).cos());
        let cells = [t, q, 7.0, v.to_degrees(), 0.5 * v.signum() + 0.01 * q];
        cells.map(|cell| format!("{cell:.5}")).join(by) + "\n"
    };
    (0..400).map(row).collect()
}

fn read_log(text: &str, pairs: &[&str]) -> Result<Dataset, String> {
    let folder = Folder::new();
    let pair =
        |text: &&str| text.split_once('=').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
    let options =
        ReadOptions { columns: pairs.iter().map(pair).collect(), ..ReadOptions::default() };
    let path = folder.write("log.csv", text);
    read(&[path], &options, &|_, _| {}).map_err(|error| plain(&folder, &error))
}

#[test]
fn read_without_header_takes_numbered_columns() {
    let left = ["1=time_s", "2=position_rad", "4=velocity_rad_s:deg/s", "5=torque_nm"];
    let right = ["time_s=1", "position_rad=2", "velocity_rad_s=4:deg/s", "torque_nm=5"];
    for by in [",", ";", "\t", "  "] {
        let text = rows(by);
        let data = read_log(&text, &left).unwrap();
        assert_eq!((data.rows, data.bad_rows.count), (400, 0), "the first row is a row");
        assert_eq!((data.runs[0].time_s[1], data.covariates.len()), (0.005, 1));
        assert!((data.runs[0].velocity[0] - 6.0).abs() < 1e-4);
        assert_eq!(read_log(&text, &right).unwrap().runs, data.runs);
        let below = read_log(&format!("# recorded by hand\n{text}"), &left).unwrap();
        assert_eq!(below.runs, data.runs);
    }
}

#[test]
fn read_with_header_takes_number_of_column() {
    let text = format!("a,b,c,d,e\n{}", rows(","));
    let pairs = ["time_s=1", "3=temperature_c", "velocity_rad_s=4:deg/s", "torque_nm=e"];
    let data = read_log(&text, &pairs).unwrap();
    assert_eq!((data.rows, data.covariates), (400, vec!["b".to_owned()]));
    let error = read_log(&text, &["time_s=6", "velocity_rad_s=4", "torque_nm=e"]).unwrap_err();
    let parts = ["columns time_s=6", "column 6", "a, b, c, d, e"];
    message::check("columns", "number without a column", &error, &parts);
}

#[test]
fn read_without_header_returns_error_with_the_guessed_columns() {
    let five = read_log(&rows(","), &[]).unwrap_err();
    let guess = "columns 1=time_s,2=position_rad,4=velocity_rad_s:deg/s,5=torque_nm";
    let parts = ["log.csv", "time_s, velocity_rad_s, torque_nm", guess, "columns help"];
    message::check("columns", "no header", &five, &parts);
    let few = read_log("0,1,2\n3,4,5\n", &[]).unwrap_err();
    message::require(&few, &["columns 1=time_s,2=velocity_rad_s,3=torque_nm"]);
}

#[test]
fn survey_without_header_numbers_columns() {
    let folder = Folder::new();
    let path = folder.write("log.csv", rows(","));
    let columns = survey(&path, &ReadOptions::default()).unwrap().columns;
    let found: Vec<(&str, Option<&str>)> =
        columns.iter().map(|column| (&*column.name, column.suggestion.as_deref())).collect();
    let expected = [
        ("1", Some("1=time_s")),
        ("2", Some("2=position_rad")),
        ("3", None),
        ("4", Some("4=velocity_rad_s:deg/s")),
        ("5", Some("5=torque_nm")),
    ];
    assert_eq!(found, expected);
}

#[test]
fn survey_with_step_column_suggests_to_add_it_up() {
    let folder = Folder::new();
    let rows = "3500,1,2\n".repeat(50);
    let path = folder.write("log.csv", format!("timestep [us],w,T\n{rows}"));
    let columns = survey(&path, &ReadOptions::default()).unwrap().columns;
    assert_eq!(columns[0].suggestion.as_deref(), Some("'time_s=timestep [us]:us:step'"));
}

#[test]
fn read_with_groups_above_the_names_joins_both() {
    let rows: String =
        (0..50).map(|row| format!("{}.0,{row},1,2,{row},3,4\n", 0.01 * f64::from(row))).collect();
    let names = "pos,vel,torque,pos,vel,torque";
    let pairs = ["time_s=time", "velocity_rad_s=joint 2 vel", "torque_nm=joint 2 torque"];
    let rows = rows.replace(".0,", ",");
    for (header, lines) in [
        (format!(",joint 1,,,joint 2,,\ntime,{names}\n"), 2),
        (format!("time,joint 1,joint 1,joint 1,joint 2,joint 2,joint 2\n,{names}\n"), 2),
        (format!(",joint 1,joint 1,joint 1,joint 2,joint 2,joint 2\n,{names}\ntime,,,,,,\n"), 3),
        (format!("# a rig\n,joint 1,,,joint 2,,\ntime,{names}\n"), 3),
    ] {
        let data = read_log(&format!("{header}{rows}x,1,2,3,4,5,6\n"), &pairs).unwrap();
        let run = &data.runs[0];
        assert_eq!((data.rows, run.velocity[0], run.torque[0]), (50, 3.0, 4.0), "{header}");
        assert_eq!(data.bad_rows.first[0].row, lines + 51, "{header}");
        assert!(data.covariates.contains(&"joint 1 pos".to_owned()), "{:?}", data.covariates);
    }
    let semicolons = format!(";joint 1;;;joint 2;;\ntime,{names}\n{rows}").replace(',', ";");
    assert_eq!(read_log(&semicolons, &pairs).unwrap().rows, 50);
}

#[test]
fn read_with_trace_of_codesys_joins_its_variables() {
    let samples = |values: fn(u32) -> f64| -> String {
        (0..200).map(|row| format!("; {}; {}\n", 10 * row, values(row))).collect()
    };
    let text = format!(
        "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\n0.Variable; PLC_PRG.v\n0.Data; \n{}1.Variable; \
         PLC_PRG.M\n1.Data; \n{}",
        samples(|row| (0.05 * f64::from(row)).sin()),
        samples(|row| 0.5 * (0.05 * f64::from(row)).sin().signum())
    );
    let data = read_log(&text, &["velocity_rad_s=PLC_PRG.v", "torque_nm=PLC_PRG.M"]).unwrap();
    assert_eq!((data.rows, data.runs[0].time_s[2]), (200, 0.02));
    let parts = ["CODESYS", "2 variables"];
    message::check("columns", "trace of CODESYS", &data.notes.join("\n"), &parts);
    let error =
        read_log(&text.replace("; 10; 0.5", "; 10; off"), &["torque_nm=PLC_PRG.M"]).unwrap_err();
    let parts = ["log.csv", "\"; 10; off\"", "line"];
    message::check("columns", "text in a trace of CODESYS", &error, &parts);
}

#[test]
fn read_with_units_beside_the_header_takes_them() {
    let rows: String = (0..50).map(|row| format!("{row},60,2\n")).collect();
    let pairs = ["time_s=t", "velocity_rad_s=w", "torque_nm=M"];
    for header in ["t,w,M\nms,rpm,mNm\n", "ms,rpm,mNm\nt,w,M\n", "[ms],[rpm],[mNm]\nt,w,M\n"] {
        let data = read_log(&format!("{header}{rows}"), &pairs).unwrap();
        let run = &data.runs[0];
        assert_eq!((data.rows, run.time_s[1], run.torque[0]), (50, 0.001, 0.002), "{header}");
        assert!((run.velocity[0] - std::f64::consts::TAU).abs() < 1e-12);
    }
    let error = read_log(&format!("t,w,M\nms,rpm,A\n{rows}"), &pairs).unwrap_err();
    message::check("columns", "amperes beside the header", &error, &["column M", "torque_nm=M"]);
    let error = read_log(&format!("t,w,M\nms,rpm,bananas\n{rows}"), &pairs).unwrap_err();
    message::check("columns", "unknown unit beside the header", &error, &["column M", "bananas"]);
}
