//! Tables without a header, whose columns are numbered, and the suggestions for columns with other names.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{
    ColumnPair, ColumnSummary, Dataset, JointKind, Quantity, ReadOptions, read, survey,
};
use std::f64::consts::TAU;

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

/// Returns the suggested pair of a column as `--columns` takes it.
fn suggestion(column: &ColumnSummary) -> Option<String> {
    column.suggestion.as_ref().map(ColumnPair::to_string)
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
    let found: Vec<(&str, Option<String>)> =
        columns.iter().map(|column| (&*column.name, suggestion(column))).collect();
    let expected = [
        ("1", Some("1=time_s")),
        ("2", Some("2=position_rad")),
        ("3", None),
        ("4", Some("4=velocity_rad_s:deg/s")),
        ("5", Some("5=torque_nm")),
    ];
    assert_eq!(found, expected.map(|(name, pair)| (name, pair.map(str::to_owned))));
    let velocity = ColumnPair {
        quantity: "velocity_rad_s",
        column: "4".into(),
        unit: Some("deg/s".into()),
        is_step: false,
        is_numbered: true,
    };
    assert_eq!(columns[3].suggestion, Some(velocity));
}

#[test]
fn survey_with_step_column_suggests_to_add_it_up() {
    let folder = Folder::new();
    let rows = "3500,1,2\n".repeat(50);
    let path = folder.write("log.csv", format!("timestep [us],w,T\n{rows}"));
    let columns = survey(&path, &ReadOptions::default()).unwrap().columns;
    assert_eq!(suggestion(&columns[0]).as_deref(), Some("time_s=timestep [us]:us:step"));
}

#[test]
fn read_with_apostrophe_in_name_proposes_the_name_unquoted() {
    let row = |row: u32| {
        let t = 0.005 * f64::from(row);
        let (q, v) = (2.0 * (3.0 * t).sin(), 6.0 * (3.0 * t).cos());
        format!("{t:.5},{:.5},{:.5},{:.5}\n", q.to_degrees(), v * 60.0 / TAU, v.signum())
    };
    let text = "time,angle,motor's speed,T\n".to_owned() + &(0..400).map(row).collect::<String>();
    let error = read_log(&text, &[]).unwrap_err();
    message::require(&error, &["position_rad=angle:deg,velocity_rad_s=motor's speed:rpm"]);
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

/// Names of a column, each with the factor and the offset from the contract's unit to that of the name.
type Names = [(&'static str, f64, f64); 5];

const DEGREES: f64 = 360.0 / TAU;

const TIMES: Names = [
    ("t_s", 1.0, 0.0),
    ("t_ms", 1e3, 0.0),
    ("time_us", 1e6, 0.0),
    ("t", 1.0, 0.0),
    ("Time [ms]", 1e3, 0.0),
];

/// Position, velocity and target of each kind of joint.
const OF_JOINT: [[Names; 3]; 2] = [
    [
        [
            ("q_deg", DEGREES, 0.0),
            ("pos_rad", 1.0, 0.0),
            ("angle_mrad", 1e3, 0.0),
            ("theta_rev", 1.0 / TAU, 0.0),
            ("q", 1.0, 0.0),
        ],
        [
            ("w_rpm", 60.0 / TAU, 0.0),
            ("dq_deg_s", DEGREES, 0.0),
            ("omega_rad_s", 1.0, 0.0),
            ("speed_rps", 1.0 / TAU, 0.0),
            ("vel_deg_per_s", DEGREES, 0.0),
        ],
        [
            ("tau_Nm", 1.0, 0.0),
            ("tau_mNm", 1e3, 0.0),
            ("torque_kNm", 1e-3, 0.0),
            ("M_Nm", 1.0, 0.0),
            ("trq [Ncm]", 1e2, 0.0),
        ],
    ],
    [
        [
            ("x_mm", 1e3, 0.0),
            ("pos_m", 1.0, 0.0),
            ("s_cm", 1e2, 0.0),
            ("Position (mm)", 1e3, 0.0),
            ("x_inch", 1.0 / 0.0254, 0.0),
        ],
        [
            ("v_mm_s", 1e3, 0.0),
            ("vel_mm_per_s", 1e3, 0.0),
            ("v_m_s", 1.0, 0.0),
            ("speed [m/min]", 60.0, 0.0),
            ("v", 1.0, 0.0),
        ],
        [
            ("F_N", 1.0, 0.0),
            ("force_kN", 1e-3, 0.0),
            ("F_mN", 1e3, 0.0),
            ("load_cell_N", 1.0, 0.0),
            ("force", 1.0, 0.0),
        ],
    ],
];

const TEMPERATURES: Names = [
    ("T_degC", 1.0, 0.0),
    ("temp_K", 1.0, 273.15),
    ("oil_degF", 1.8, 32.0),
    ("temp_c", 1.0, 0.0),
    ("Temp [°C]", 1.0, 0.0),
];

const PRESSURES: Names = [
    ("p_bar", 1e-5, 0.0),
    ("p_kPa", 1e-3, 0.0),
    ("p_MPa", 1e-6, 0.0),
    ("p_psi", 1.0 / 6_894.757_293_168, 0.0),
    ("pressure_pa", 1.0, 0.0),
];

const RUNS: [&str; 5] = ["exp", "trial_no", "run", "run_id", "Experiment"];

/// Returns run, time, position, velocity, target, temperature and pressure of a row in the units of the contract.
fn measured(row: usize) -> [f64; 7] {
    let t = 0.005 * row as f64;
    let (q, v) = (0.2 * (3.0 * t).sin(), 0.6 * (3.0 * t).cos());
    [(row / 200) as f64, t, q, v, 0.5 * v.signum() + 0.01 * q, 20.0 + 0.1 * t, 2e5 + 1e4 * t]
}

#[test]
fn survey_with_units_in_names_suggests_pairs_that_read_the_log() {
    for drawn in 0..50 {
        let (kind, pick) = (drawn % 2, |stride: usize| drawn / 2 * stride % 5 + drawn / 10 % 5);
        let names = |of: &Names, stride| of[pick(stride) % 5];
        let [position, velocity, target] = &OF_JOINT[kind];
        let columns = [
            (RUNS[pick(3) % 5], 1.0, 0.0),
            names(&TIMES, 1),
            names(position, 2),
            names(velocity, 3),
            names(target, 4),
            names(&TEMPERATURES, 1),
            names(&PRESSURES, 2),
        ];
        let header = columns.map(|(name, ..)| name).join(",");
        let line = |row: usize| {
            let cells = measured(row).into_iter().zip(columns);
            let cells =
                cells.map(|(value, (_, factor, offset))| format!("{:?}", value * factor + offset));
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        let text = format!("{header}\n") + &(0..400).map(line).collect::<String>();
        let folder = Folder::new();
        let found = survey(&folder.write("log.csv", &text), &ReadOptions::default()).unwrap();
        let pairs: Vec<String> = found.columns.iter().filter_map(suggestion).collect();
        let pairs: Vec<&str> = pairs.iter().map(String::as_str).collect();
        let data = read_log(&text, &pairs).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(
            data.joint,
            [JointKind::Revolute, JointKind::Prismatic][kind],
            "{header} {pairs:?}"
        );
        assert_eq!((data.runs.len(), data.covariates.len()), (2, 0), "{header} {pairs:?}");
        let run = &data.runs[1];
        let quantities = [Quantity::Position, Quantity::Temperature, Quantity::Pressure];
        let read = [&run.time_s, &run.velocity, &run.torque].map(Vec::as_slice).into_iter();
        let read = read.chain(quantities.map(|of| run.get(of).expect(&header)));
        let [_, t, q, v, y, c, p] = measured(250);
        for (values, expected) in read.zip([t, v, y, q, c, p]) {
            assert!((values[50] / expected - 1.0).abs() < 1e-9, "{header} {pairs:?}: {expected}");
        }
    }
}

#[test]
fn survey_with_doubtful_units_reports_them() {
    let line = |row: usize| {
        let [_, t, q, v, y, ..] = measured(row);
        format!("{t},{q},{v},{y},{}\n", t.exp())
    };
    let rows: String = (0..400).map(line).collect();
    let surveyed = |header: &str| {
        let path = Folder::new();
        survey(&path.write("log.csv", format!("{header}\n{rows}")), &ReadOptions::default())
            .unwrap()
    };
    let mut reports = String::new();
    for (header, at, expected) in [
        ("t,pos_nm,v_m_s,F_N,exp", 1, None),
        ("t,x_mm,v_mm_s,force_mn,exp", 3, Some("force_n=force_mn:UNIT")),
        ("t,x_mm,w_rpm,F_N,exp", 2, Some("velocity_rad_s=w_rpm:rpm")),
    ] {
        let found = surveyed(header);
        assert_eq!(suggestion(&found.columns[at]).as_deref(), expected, "{header}");
        assert_eq!(found.columns[4].suggestion, None, "an exponential is no experiment");
        assert_eq!(found.notes.len(), 1, "{header} {:?}", found.notes);
        reports += &format!("{header}: {}\n", found.notes[0]);
    }
    let text = format!("t,x_mm,v_mm_s,force_mn,exp\n{rows}");
    let pairs =
        ["time_s=t", "position_m=x_mm:mm", "velocity_m_s=v_mm_s:mm/s", "force_n=force_mn:UNIT"];
    let error = read_log(&text, &pairs).unwrap_err();
    assert!(error.contains("UNIT") && error.contains("mN"), "{error}");
    crate::snapshot::check("columns", "doubtful units", &reports);
}
