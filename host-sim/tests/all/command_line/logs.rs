//! Logs as they occur: other formats, gaps, uneven sampling, and logs without information.
//!
//! The format of a file must not change a parameter, and gaps must not move it. Every law also fits a set of degenerate logs:
//! constant, huge, tiny, unordered or empty columns. Each must give a deployable model or one line that rejects the log.

use super::{Folder, HEADER, assert_deployable, assert_one_line, assert_schema, csv, number, rows};
use compensator_core::LawKind;
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use rayon::prelude::*;
use serde_json::{Map, Value};
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// Parameters by name, rounded to seven significant digits.
fn values(document: &Value) -> Map<String, Value> {
    let params = document["models"][0]["params"].as_object().expect("an object");
    let round = |value: &Value| format!("{:.6e}", value["value"].as_f64().expect("a number"));
    params.iter().map(|(name, value)| (name.clone(), Value::String(round(value)))).collect()
}

#[test]
fn identify_gives_same_parameters_for_every_file_format() {
    let folder = Folder::new();
    let text = csv(rows(300));
    folder.write("joint.csv", &text);
    let known = folder.json("identify joint.csv --model lugre");
    // A single run is split into time blocks, so it is both a training and a test run.
    assert_eq!(known["data"]["train_runs"], serde_json::json!(["joint"]));
    assert_eq!(known["data"]["test_runs"], serde_json::json!(["joint"]));

    folder.write("foreign.csv", text.replace(HEADER, "t,dq_3,tau_3\n"));
    let columns = "--columns time_s=t,velocity_rad_s=dq_3,torque_nm=tau_3";
    let foreign = folder.json(&format!("identify foreign.csv --model lugre {columns}"));
    assert_eq!(values(&foreign), values(&known));

    write_parquet(&folder.path("joint.parquet"), rows(300));
    let table = folder.json("identify joint.parquet --model lugre");
    assert_eq!(values(&table), values(&known));

    folder.write("slide.csv", text.replace(HEADER, "time_s,velocity_m_s,force_n\n"));
    let prismatic = folder.json("identify slide.csv --model lugre");
    assert_eq!(values(&prismatic), values(&known));
    assert_eq!(prismatic["data"]["unit"], "N");
    let unit = |name: &str| number(&prismatic, &format!("/models/0/params/{name}/unit"));
    assert_eq!((unit("coulomb_torque"), unit("bristle_stiffness")), (&"N".into(), &"N/m".into()));
    assert_deployable(&folder.path("out/identify-slide/params.toml"));
}

fn write_parquet(path: &Path, rows: impl Iterator<Item = (f64, f64, f64)>) {
    let fields = ["time_s", "velocity_rad_s", "torque_nm"].map(|f| format!("REQUIRED DOUBLE {f};"));
    let schema = parse_message_type(&format!("message log {{ {} }}", fields.concat()));
    let (file, properties) = (fs::File::create(path).expect("made"), WriterProperties::new());
    let schema = Arc::new(schema.expect("a schema"));
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).expect("opened");
    let rows: Vec<[f64; 3]> = rows.map(|(t, v, y)| [t, v, y]).collect();
    let mut group = writer.next_row_group().expect("a group");
    for at in 0..3 {
        let values: Vec<f64> = rows.iter().map(|row| row[at]).collect();
        let mut column = group.next_column().expect("readable").expect("a column");
        column.typed::<DoubleType>().write_batch(&values, None, None).expect("written");
        column.close().expect("closed");
    }
    group.close().expect("closed");
    writer.close().expect("closed");
}

#[test]
fn identify_with_gaps_and_uneven_sampling_finds_true_parameters() {
    let folder = Folder::new();
    // Steps of 6 to 14 ms, and a gap of one second after every 150 rows in which the joint keeps moving.
    let mut t = 0.0;
    let uneven = (0..900u32).map(|i| {
        t += 0.006 + 0.008 * f64::from(i * 37 % 101) / 101.0 + f64::from(u8::from(i % 150 == 149));
        let v = (3.0 * t).sin();
        (t, v, 0.5 * v.signum() + 0.2 * v)
    });
    folder.write("uneven.csv", csv(uneven));
    for model in ["linear", "lugre"] {
        let document = folder.json(&format!("identify uneven.csv --model {model}"));
        assert_schema(&document, 1);
        for (name, truth) in [("coulomb_torque", 0.5), ("viscous_friction", 0.2)] {
            let found = number(&document, &format!("/models/0/params/{name}/value"));
            let found = found.as_f64().expect("a number");
            assert!((found - truth).abs() < 0.03, "{model}: {name} = {found}");
        }
    }
}

/// Degenerate logs, each with its description.
fn degenerate_logs() -> Vec<(&'static str, String)> {
    type Row = (f64, f64, f64);
    let with = |change: fn(f64, Row) -> Row| {
        csv(rows(60).enumerate().map(|(i, row)| change(i as f64, row)))
    };
    let columns = |names: &str, cells: fn(f64) -> String| {
        let header = HEADER.replace('\n', &format!(",{names}\n"));
        rows(60).enumerate().fold(header, |text, (i, (t, v, y))| {
            text + &format!("{t:?},{v:?},{y:?},{}\n", cells(i as f64))
        })
    };
    let all = "radial_force_n,pressure_diff_pa,temperature_c,load_torque_nm,position_rad";
    vec![
        ("constant velocity", with(|_, (t, _, y)| (t, 1.0, y))),
        ("at rest", with(|_, (t, _, y)| (t, 0.0, y))),
        ("zero torque", with(|_, (t, v, _)| (t, v, 0.0))),
        ("all zero", with(|_, (t, _, _)| (t, 0.0, 0.0))),
        ("constant torque", with(|_, (t, v, _)| (t, v, 3.0))),
        ("friction of the wrong sign", with(|_, (t, v, y)| (t, v, -y))),
        ("one direction", with(|_, (t, v, y)| (t, v.abs(), y.abs()))),
        ("alternating sign", with(|i, (t, v, y)| (t, v * (-1f64).powf(i), y))),
        ("huge torque", with(|_, (t, v, y)| (t, v, y * 1e300))),
        ("huge velocity", with(|_, (t, v, y)| (t, v * 1e300, y))),
        ("tiny torque", with(|_, (t, v, y)| (t, v, y * 1e-300))),
        ("tiny velocity", with(|_, (t, v, y)| (t, v * 1e-300, y))),
        ("large torque", with(|_, (t, v, y)| (t, v, y * 1e9))),
        ("large velocity", with(|_, (t, v, y)| (t, v * 1e9, y))),
        ("small torque", with(|_, (t, v, y)| (t, v, y * 1e-9))),
        ("small velocity", with(|_, (t, v, y)| (t, v * 1e-9, y))),
        ("a spike", with(|i, (t, v, y)| (t, v, if i == 30.0 { 1e12 } else { y }))),
        ("constant time", with(|_, (_, v, y)| (7.0, v, y))),
        ("repeated time", with(|i, (_, v, y)| ((i / 4.0).floor(), v, y))),
        ("one sample per year", with(|i, (_, v, y)| (i * 3.15e7, v, y))),
        ("one sample per picosecond", with(|i, (_, v, y)| (i * 1e-12, v, y))),
        ("time since 1970", with(|_, (t, v, y)| (t + 1.7e9, v, y))),
        ("a gap after every row", with(|i, (_, v, y)| (i * i * i * i, v, y))),
        ("only noise", with(|i, (t, _, _)| (t, (i * i * 7.3).sin(), (i * i * 3.1).cos()))),
        ("two rows", csv(rows(2))),
        ("three rows", csv(rows(3))),
        ("five rows", csv(rows(5))),
        ("columns of zero", columns(all, |_| "0,0,0,0,0".into())),
        ("constant columns", columns(all, |_| "30,2e5,20,1,0.5".into())),
        ("huge columns", columns(all, |i| format!("{0:e},-{0:e},{0:e},1e200,1e200", i * 1e100))),
        (
            "columns with missing values",
            columns(all, |i| if i == 9.0 { ",,x,,".into() } else { "1,2,3,4,5".into() }),
        ),
        ("covariates", columns("a,b,c", |i| format!("{i},text,{}", i % 2.0))),
        (
            "runs of one row",
            csv(rows(60)).lines().enumerate().fold(String::new(), |text, (i, row)| {
                text + &if i == 0 { format!("run,{row}\n") } else { format!("{},{row}\n", i / 2) }
            }),
        ),
    ]
}

#[test]
fn identify_with_degenerate_log_never_panics() {
    let folder = Folder::new();
    let mut cases = Vec::new();
    for (at, (name, content)) in degenerate_logs().into_iter().enumerate() {
        folder.write(&format!("{at}.csv"), content);
        cases.extend(LawKind::ALL.iter().map(|law| (at, name, law.name())));
    }
    let failures: Vec<String> = cases
        .par_iter()
        .filter_map(|(at, name, model)| {
            // The rigid-body parts read columns that the laws do not read.
            let parts = if *model == "linear" { "inertia,gravity,load,offset" } else { "" };
            let how = format!("identify {at}.csv --model {model} --starts 1 --threads 1");
            let how = format!("{how} --rigid-body={parts}");
            let (code, stdout, stderr) = folder.run(&format!("{how} --out {at}-{model} --json"));
            let checked = std::panic::catch_unwind(|| match code {
                Some(0) => {
                    assert_eq!(stderr, "");
                    assert_schema(&serde_json::from_str(&stdout).expect("JSON alone"), 1);
                    assert_deployable(&folder.path(&format!("{at}-{model}")).join("params.toml"));
                }
                Some(2) => {
                    assert_eq!(stdout, "");
                    assert_one_line(&stderr);
                }
                _ => panic!("exit code {code:?}: {stderr}"),
            });
            checked.err().map(|why| {
                let why = why.downcast_ref::<String>().map_or("", |why| why);
                format!("{name}, {model}: {}", &why[..why.len().min(300)])
            })
        })
        .collect();
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), cases.len(), failures.join("\n"));
}
