//! The binary as a script sees it: exit codes, one-line errors, and complete result files.
//!
//! A command returns either 0 and a result, or 2 and one line on standard error. The tests generate their logs; `logs` and
//! `laboratory_logs` contain the tests with unusual ones.

mod laboratory_logs;
mod logs;
mod units;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::snapshot;
use compensator_core::compensator::Compensator;
use compensator_core::record;
use compensator_core::{FrictionModel, LawKind};
use host_sim::driver_file;
use rayon::prelude::*;
use serde_json::Value;
use tempfile::TempDir;

const HEADER: &str = "time_s,velocity_rad_s,torque_nm\n";

/// A temporary folder with the files of a test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("written");
    }

    /// Writes the log of a joint with Coulomb and viscous friction that moves back and forth in three runs.
    fn write_joint(&self) {
        let mut text = format!("run,{HEADER}");
        for run in 0..3 {
            for (t, v, y) in rows(200) {
                // Each run has a different speed and the corresponding viscous torque.
                let faster = v * f64::from(run);
                let _ = writeln!(text, "{run},{t:?},{:?},{:?}", v + faster, y + 0.2 * faster);
            }
        }
        self.write("joint.csv", text);
    }

    /// Runs the program in this folder. Returns exit code, standard output and standard error.
    fn run(&self, arguments: &str) -> (Option<i32>, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        command.args(arguments.split_whitespace()).current_dir(self.0.path());
        let Output { status, stdout, stderr } = command.output().expect("host-sim starts");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        // Findings of the log check are also on standard error, one per line; they are not errors.
        let stderr = text(stderr);
        let errors = stderr.lines().filter(|line| !line.starts_with("log: "));
        (status.code(), text(stdout), errors.map(|line| format!("{line}\n")).collect())
    }

    /// Runs a command that must succeed. Returns its standard output.
    fn run_successfully(&self, arguments: &str) -> String {
        let (code, stdout, stderr) = self.run(arguments);
        assert_eq!((code, stderr.as_str()), (Some(0), ""), "{arguments}");
        stdout
    }

    /// Runs a command that must fail with exit code 2, one line, and no new file. Returns the line.
    fn run_rejected(&self, arguments: &str) -> String {
        let before = self.files();
        let (code, stdout, stderr) = self.run(arguments);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{arguments}: {stderr}");
        assert_one_line(&stderr);
        assert_eq!(self.files(), before, "{arguments}");
        stderr
    }

    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.run_successfully(&format!("{arguments} --json")))
            .expect("JSON alone")
    }

    /// Returns all files, including those in `out`.
    fn files(&self) -> Vec<PathBuf> {
        let inside = |folder: &Path| -> Vec<PathBuf> {
            fs::read_dir(folder).map_or(vec![], |all| all.flatten().map(|f| f.path()).collect())
        };
        let mut all = inside(self.0.path());
        all.extend(inside(&self.path("out")));
        all.sort();
        all
    }
}

fn assert_one_line(stderr: &str) {
    assert!(stderr.starts_with("error: "), "{stderr}");
    assert!(stderr.ends_with('\n') && stderr.lines().count() == 1, "{stderr}");
}

/// Time, velocity and torque of a joint at 100 Hz, with a ripple that no model contains.
fn rows(count: u32) -> impl Iterator<Item = (f64, f64, f64)> {
    (0..count).map(|i| {
        let t = f64::from(i) * 0.01;
        let v = (3.0 * t).sin();
        (t, v, 0.5 * v.signum() + 0.2 * v + 0.01 * (40.0 * t).sin())
    })
}

fn csv(rows: impl Iterator<Item = (f64, f64, f64)>) -> String {
    rows.fold(HEADER.to_owned(), |text, (t, v, y)| text + &format!("{t:?},{v:?},{y:?}\n"))
}

fn number<'a>(value: &'a Value, path: &str) -> &'a Value {
    value.pointer(path).unwrap_or_else(|| panic!("{path} is not in {value}"))
}

/// Checks `fit.json` or `compare.json` and each of its models against schema 1.
fn assert_schema(document: &Value, models: usize) {
    assert_eq!(document["schema"], 1);
    for key in ["runs", "rows", "rows_left_out"] {
        assert!(document["data"][key].is_u64(), "data.{key}");
    }
    assert!(["Nm", "N"].iter().any(|unit| document["data"]["unit"] == *unit));
    for key in ["train_runs", "test_runs"] {
        let names = document["data"][key].as_array().expect("a list");
        assert!(!names.is_empty() && names.iter().all(Value::is_string), "data.{key}");
    }
    let all = document["models"].as_array().expect("a list");
    assert_eq!(all.len(), models);
    for model in all {
        assert!(model["model"].is_string());
        assert!(model["seconds"].is_f64() && model["bic"].is_f64(), "{model}");
        assert!(model["verdicts"].as_array().expect("a list").iter().all(Value::is_string));
        for (name, parameter) in model["params"].as_object().expect("an object") {
            assert!(parameter["value"].is_number(), "{name}: {parameter}");
            assert!(parameter["unit"].is_string(), "{name}: {parameter}");
            let error = &parameter["std_error"];
            assert!(error.is_number() || error.is_null(), "{name}: {parameter}");
            let states = ["determined", "not-determined", "at-start", "at-bound"];
            assert!(states.iter().any(|state| parameter["state"] == *state), "{name}");
        }
        for side in ["train", "test"] {
            for key in ["rmse", "sse", "nrmse_std", "nrmse_range", "relative_error_percent"] {
                assert!(model[side][key].is_number(), "{side}.{key}: {model}");
            }
        }
    }
}

/// Checks that a driver accepts a parameter file: it survives the f32 record and can be built.
fn assert_deployable(file: &Path) {
    let read = driver_file::read(file).unwrap_or_else(|error| panic!("{error}"));
    let record = record::emit(&read.friction());
    let back = record::parse(&record).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(record::emit(&back), record, "{}", file.display());
    let model: Result<FrictionModel<f32>, _> = back.model.build(50e-6);
    model.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let compensator = Compensator::<f32>::build(&back, 50e-6);
    compensator.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
}

#[test]
fn identify_and_compare_with_bad_input_return_one_line_error() {
    let folder = Folder::new();
    folder.write_joint();
    folder.write("empty.csv", "");
    folder.write("header.csv", HEADER);
    folder.write("foreign.csv", "time_s,dq_3,torque_nm\n0,1,2\n1,2,3\n");
    folder.write("both.csv", "time_s,velocity_rad_s,torque_nm,force_n\n0,1,2,3\n");
    let mut text = csv(rows(40));
    text += "0.5,off,1\n0.51,off,1\n0.52,off,1\n";
    folder.write("text.csv", text);
    folder.write("back.csv", csv(rows(40).map(|(t, v, y)| (-t, v, y))));
    folder.write("one.csv", "time_s,velocity_rad_s,torque_nm\n0,1,2\n");
    fs::create_dir(folder.path("folder")).expect("made");
    folder.write("broken.parquet", "PAR1 and nothing of the kind PAR1");
    folder.write("luger.toml", "schema = 1\njoint = \"revolute\"\nmodel = \"luger\"\n");
    let mut messages = String::new();
    for (arguments, words) in [
        ("identify none.csv --model linear", &["none.csv"][..]),
        ("identify empty.csv --model linear", &["empty.csv"]),
        ("identify header.csv --model linear", &["header.csv"]),
        ("identify foreign.csv --model linear", &["foreign.csv", "velocity_rad_s", "--columns"]),
        ("identify both.csv --model linear", &["both.csv", "force_n"]),
        ("identify text.csv --model linear", &["row 42", "velocity_rad_s", "\"off\""]),
        ("identify back.csv --model linear", &["row 3", "time_s"]),
        ("identify one.csv --model linear", &["1 rows"]),
        ("identify folder --model linear", &["folder"]),
        ("identify broken.parquet --model linear", &["broken.parquet"]),
        ("identify joint.csv joint.csv --model linear", &["joint.csv"]),
        ("identify joint.csv --test joint.csv --model linear", &["joint.csv"]),
        ("identify joint.csv --model luger", &["luger", "lugre-asymmetric"]),
        ("identify joint.csv --model lugre+rust", &["rust", "pressure-coulomb"]),
        ("identify joint.csv --model linear --columns nonsense", &["nonsense", "NAME=COLUMN"]),
        ("identify joint.csv --model linear --columns torque_nm=tau", &["tau"]),
        ("identify joint.csv --model linear --columns speed=velocity_rad_s", &["speed"]),
        ("identify joint.csv --model linear --rigid-body mass", &["mass", "inertia"]),
        ("identify joint.csv --model linear --keep mass", &["--keep", "mass"]),
        ("identify joint.csv --model linear --hold-out kp=1", &["kp", "run"]),
        ("identify joint.csv --model linear --hold-out run=7", &["run=7", "0, 1, 2"]),
        ("identify joint.csv --model linear --tail 1.5", &["1.5"]),
        ("identify joint.csv --model linear --skip 1000", &["--skip 1000"]),
        ("identify joint.csv --model linear --start none.toml", &["none.toml"]),
        ("identify joint.csv --model linear --start luger.toml", &["luger.toml", "luger"]),
        ("compare joint.csv --models linear,luger", &["luger"]),
        ("compare none.csv", &["none.csv"]),
    ] {
        let message = folder.run_rejected(arguments);
        for word in words {
            assert!(message.contains(word), "{arguments}: {message}");
        }
        let _ = write!(messages, "{arguments}\n{message}");
    }
    snapshot::check("identify-compare", "bad input", &messages);
}

#[test]
fn bad_usage_returns_one_line_error_and_help_succeeds() {
    let folder = Folder::new();
    let mut messages = String::new();
    for (arguments, word) in [
        ("identify joint.csv --model linear --modle lugre", "'--modle'"),
        ("identify joint.csv", "--model"),
        ("identify --model linear", "<DATA>"),
        ("identify joint.csv --model linear --skip minus", "'minus'"),
        ("identify joint.csv --model linear --decimate 0", "'0'"),
        ("identify joint.csv --model linear --tail 0.3 --hold-out run=1", "--tail"),
        ("simulate underwater-joint --rate -5", "-5"),
        ("simulate submarine", "underwater-joint"),
        ("simulate underwater-joint --runs 1000 --seconds 1000 --rate 1000", "1e8 rows"),
        ("identfy joint.csv", "identfy"),
    ] {
        let message = folder.run_rejected(arguments);
        assert!(message.contains(word), "{arguments}: {message}");
        // Which scenarios a message lists depends on the features.
        if !arguments.starts_with("simulate submarine") {
            let _ = write!(messages, "{arguments}\n{message}");
        }
    }
    snapshot::check("usage", "bad usage", &messages);
    assert_eq!(folder.run("").0, Some(2));
    for command in ["", "identify", "compare", "simulate"] {
        assert!(folder.run_successfully(&format!("{command} --help")).contains("Usage:"));
    }
    assert!(folder.run_successfully("--version").starts_with("host-sim "));
}

#[test]
fn identify_with_few_bad_rows_leaves_them_out_and_counts_them() {
    let folder = Folder::new();
    let mut text = csv(rows(200));
    text += "2.5,off,1\n2.51,NaN,1\n1.0,1,1\n2.52,1\n";
    folder.write("few.csv", text);
    let document = folder.json("identify few.csv --model linear");
    assert_eq!(document["data"]["rows"], 200);
    assert_eq!(document["data"]["rows_left_out"], 4);
}

#[test]
fn out_folder_that_cannot_be_written_leaves_no_file() {
    let folder = Folder::new();
    folder.write_joint();
    folder.write("taken", "a file");
    let message = folder.run_rejected("identify joint.csv --model linear --out taken");
    assert!(message.contains("taken"), "{message}");
    assert_eq!(fs::read(folder.path("taken")).expect("still there"), b"a file");
    folder.run_rejected("simulate underwater-joint --runs 1 --seconds 0.1 --out taken/deeper");

    // If the second of two files cannot be written, the first must not be written either.
    fs::create_dir_all(folder.path("out/identify-joint/params.toml")).expect("made");
    let message = folder.run_rejected("identify joint.csv --model linear");
    assert!(message.contains("params.toml"), "{message}");

    folder.run_successfully("identify joint.csv --model linear --out made/on/the/way");
    let made = fs::read_dir(folder.path("made/on/the/way")).expect("a folder").flatten();
    let made: Vec<String> =
        made.map(|file| file.file_name().into_string().expect("a plain name")).collect();
    assert!(["fit.json", "params.toml"].iter().all(|name| made.iter().any(|m| m == name)));
    assert!(!made.iter().any(|name| name.starts_with('.')), "temporary files left: {made:?}");
}

#[test]
fn json_output_follows_schema_and_equals_the_file() {
    let folder = Folder::new();
    folder.write_joint();
    let document = folder.json("identify joint.csv --model linear");
    assert_schema(&document, 1);
    assert_eq!(document["data"]["rows"], 600);
    assert_eq!(document["data"]["runs"], 3);
    assert_eq!(document["data"]["test_runs"], serde_json::json!(["1"]));
    assert_eq!(document["models"][0]["model"], "linear");
    let coulomb = number(&document, "/models/0/params/coulomb_torque/value").as_f64();
    assert!(coulomb.is_some_and(|torque| (torque - 0.5).abs() < 0.05), "{document}");
    let written = fs::read_to_string(folder.path("out/identify-joint/fit.json")).expect("written");
    assert_eq!(serde_json::from_str::<Value>(&written).expect("JSON"), document);

    let document = folder.json("compare joint.csv --models linear,atan,linear+torque-offset");
    assert_schema(&document, 3);
    assert_eq!(document["models"][2]["model"], "linear+torque-offset");
    assert!(folder.path("out/compare-joint/compare.json").exists());
    assert_schema(&folder.json("compare joint.csv"), LawKind::ALL.len());
}

#[test]
fn identify_hands_over_plain_friction_where_the_model_errs_clearly_more() {
    let folder = Folder::new();
    folder.write_joint();
    let fitted = folder.json("identify joint.csv --model stribeck --out good");
    assert_eq!(fitted["handed_over"], "baseline");
    let good = folder.path("good/params.toml");
    assert!(fs::read_to_string(&good).expect("written").contains("model = \"stribeck\""));
    // A static level of five times the friction, at all speeds.
    let wrong = "schema = 1\njoint = \"revolute\"\nmodel = \"stribeck\"\n[parameters]\ncoulomb_torque = 0.5\n\
                 static_torque = 2.5\nstribeck_velocity = 50.0\nviscous_friction = 0.2\n";
    folder.write("wrong.toml", wrong);
    let kept = "--start wrong.toml --keep static_torque,stribeck_velocity --out bad";
    let fitted = folder.json(&format!("identify joint.csv --model stribeck {kept}"));
    assert_eq!(fitted["handed_over"], "plain");
    let error = |at: &str| number(&fitted, at).as_f64().expect("a number");
    assert!(error("/plain/test_rmse") < 0.5 * error("/models/0/test/rmse"), "{fitted}");
    let written = fs::read_to_string(folder.path("bad/params.toml")).expect("written");
    assert!(written.contains("model = \"linear\""), "{written}");
    assert!(error("/prediction/rmse") < error("/models/0/train/rmse"), "{fitted}");
}

#[test]
fn closed_standard_output_is_not_an_error() {
    let folder = Folder::new();
    folder.write_joint();
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(["identify", "joint.csv", "--model", "linear"]).current_dir(folder.0.path());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("ends");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    let has_only_findings = stderr.lines().all(|line| line.starts_with("log: "));
    assert!(output.status.code() == Some(0) && has_only_findings, "{stderr}");
}

#[test]
fn params_toml_is_accepted_by_driver_and_as_start_of_next_fit() {
    let folder = Folder::new();
    folder.run_successfully("simulate underwater-joint --runs 3 --seconds 2 --rate 500 --out .");
    LawKind::ALL.par_iter().for_each(|law| {
        let name = law.name();
        let fit = |arguments: &str, out: &str| {
            let document = folder.json(&format!("identify data.csv --model {name} {arguments}"));
            assert_deployable(&folder.path(out).join("params.toml"));
            // Of the parameters in the file: the passive form, if the rows alone give a law that a driver must not run.
            let form = document.pointer("/models/0/driver_form").filter(|form| form.is_object());
            let of_file = form.unwrap_or(&document["models"][0]);
            number(of_file, "/train/rmse").as_f64().expect("a number")
        };
        let first = fit(&format!("--out {name}"), name);
        let again = format!("{name}-again");
        let second = fit(&format!("--start {name}/params.toml --out {again}"), &again);
        assert!(second <= first * 1.001, "{name}: {first} and from there {second}");
    });
    // The file also contains terms and rigid-body parts, and a start file may have another model.
    let model = "--model lugre+pressure-coulomb --rigid-body offset,inertia";
    folder.run_successfully(&format!(
        "identify data.csv {model} --start lugre/params.toml --out terms"
    ));
    let read = driver_file::read(&folder.path("terms/params.toml")).expect("accepted");
    let full = "lugre+torque-offset+unmodelled-inertia+pressure-coulomb";
    assert_eq!(read.spec.full_name(), full);
    assert_deployable(&folder.path("terms/params.toml"));
}

#[test]
fn same_seed_gives_identical_files_on_any_number_of_threads() {
    let folder = Folder::new();
    let simulated = |seed: u32, out: &str| {
        let how = "simulate underwater-joint --runs 3 --seconds 1 --rate 400";
        folder.run_successfully(&format!("{how} --seed {seed} --out {out}"));
        let file = |name: &str| fs::read(folder.path(out).join(name)).expect("written");
        (file("data.csv"), file("truth.json"))
    };
    let first = simulated(5, "a");
    assert_eq!(first, simulated(5, "b"));
    assert_ne!(first, simulated(6, "c"));

    let fitted = |seed: u32, threads: u32| {
        let how = format!("--seed {seed} --threads {threads} --out fit");
        let mut document = folder.json(&format!("identify a/data.csv --model lugre {how}"));
        document["models"][0]["seconds"] = Value::Null;
        let params = fs::read_to_string(folder.path("fit/params.toml")).expect("written");
        // The comments contain the date.
        let params: String = params.lines().filter(|line| !line.starts_with('#')).collect();
        (document.to_string(), params)
    };
    let first = fitted(0, 1);
    assert_eq!(first, fitted(0, 1));
    assert_eq!(first, fitted(0, 2), "the number of threads must not change the result");
    assert_ne!(first.0, fitted(1, 2).0, "another seed holds out another run");
}
