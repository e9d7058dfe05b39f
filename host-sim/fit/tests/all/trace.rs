//! Round trip of measured data through a CAN log.
//!
//! A data set that is written as a log and read again must be equal to the rounding of `f32`, run by run and column by
//! column. Then faults of a bus or a file are put into a valid log, one at a time. The message must name the file, the
//! line, what was found and what was expected.

use super::message;
use compensator_core::Flags;
use compensator_core::can::{AnswerFrame, NodeId, StatusFrame};
use friction_fit::{tracks, tracks_with};
use joint_log::{
    Dataset, EmitOptions, JointKind, Measured, Quantity, ReadOptions, Run, contract, emit, read,
};
use joint_trace::{Assembler, Fraction, TextFormat, TraceSample, Writer, candump};
use std::path::PathBuf;

/// Two runs that overlap in time, with every column and a covariate.
fn measured() -> Dataset {
    let run = |name: &str, rows: usize, phase: f64| {
        let column = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..rows).map(|row| of(row as f64 * 1e-3 + phase)).collect()
        };
        Run {
            name: name.into(),
            file: 0,
            time_s: (0..rows).map(|row| row as f64 / 1e3).collect(),
            velocity: column(&|t| (3.0 * t).sin()),
            torque: column(&|t| 1.5 * (3.0 * t).sin().signum() + 0.1 * t),
            extra: vec![column(&|t| 7.0 * t), column(&|t| t * t)],
            ..Run::default()
        }
        .with(Quantity::Position, column(&|t| -(3.0 * t).cos() / 3.0))
        .with(Quantity::RadialForce, column(&|t| 40.0 + t))
        .with(Quantity::Pressure, column(&|t| 2e5 + 1e3 * t))
        .with(Quantity::Temperature, column(&|t| 12.0 + 0.01 * t))
        .with(Quantity::LoadTorque, column(&|t| 5.0 * t.sin()))
    };
    let runs = vec![run("3", 700, 0.0), run("8", 300, 0.4)];
    Dataset {
        joint: JointKind::Revolute,
        rows: 1000,
        rows_read: 1000,
        runs,
        files: vec![],
        bad_rows: Default::default(),
        covariates: vec!["flow".into(), "gap".into()],
        left_out_columns: vec![],
        notes: vec![],
        torque_law: None,
        torque_constant: None,
        sources: vec![],
    }
}

fn log_of(data: &Dataset, options: &EmitOptions) -> Vec<u8> {
    let mut log = Vec::new();
    emit(data, options, &mut log).unwrap();
    log
}

fn gap() -> EmitOptions {
    EmitOptions { auxiliary: Some("gap".into()), ..EmitOptions::default() }
}

/// A file that is deleted at the end of the test.
struct Log(tempfile::TempDir);

impl Log {
    fn new(text: &[u8]) -> Self {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("trace.log"), text).unwrap();
        Self(directory)
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("trace.log")
    }

    fn read(&self) -> Result<Dataset, String> {
        let nothing = |_: u64, _: u64| {};
        let message = read(&[self.path()], &ReadOptions::default(), &nothing);
        message.map_err(|error| {
            error.to_string().replace(&self.path().display().to_string(), "trace.log")
        })
    }
}

#[test]
fn emit_then_read_returns_same_data() {
    let data = measured();
    let back = Log::new(&log_of(&data, &gap())).read().unwrap();
    assert_eq!(back.joint, JointKind::Revolute);
    assert_eq!((back.rows, back.bad_rows.count), (1000, 0));
    assert_eq!(back.covariates, ["auxiliary"]);
    assert!(back.left_out_columns.is_empty() && back.notes.is_empty(), "{:?}", back.notes);
    assert_eq!(back.runs.len(), 2);
    let rounded = |column: &[f64]| -> Vec<f64> {
        column.iter().map(|value| f64::from(*value as f32)).collect()
    };
    for (run, found) in data.runs.iter().zip(&back.runs) {
        assert_eq!(found.name, run.name);
        for (row, time) in run.time_s.iter().enumerate() {
            let since = found.time_s[row] - found.time_s[0];
            assert!((since - time).abs() < 1e-12, "{row}: {since} {time}");
        }
        assert_eq!(found.velocity, rounded(&run.velocity));
        assert_eq!(found.torque, rounded(&run.torque));
        for quantity in contract::optional() {
            assert_eq!(found.get(quantity), run.get(quantity).map(rounded).as_deref());
        }
        assert_eq!(found.extra, [rounded(&run.extra[1])]);
    }
    // The first run keeps its clock bit for bit; the second begins a second after its end.
    assert_eq!(back.runs[0].time_s, data.runs[0].time_s);
    assert_eq!(back.runs[1].time_s[0], 1.699);
    let carried = tracks_with(&back, Some("auxiliary"));
    assert_eq!(carried[0].samples[30].auxiliary, back.runs[0].extra[0][30]);
    assert_eq!(tracks(&back)[0].samples[30].auxiliary, 0.0);
}

#[test]
fn emit_in_every_format_reads_back_the_same_data() {
    let data = measured();
    let back = |format| {
        let log = log_of(&data, &EmitOptions { format, ..gap() });
        assert_eq!(TextFormat::of(&log), Some(format));
        Log::new(&log).read().unwrap()
    };
    let candump = back(TextFormat::Candump);
    for format in [TextFormat::Asc, TextFormat::Trc] {
        let other = back(format);
        assert_eq!(other.runs, candump.runs, "{format:?}");
        assert_eq!((other.bad_rows.count, &other.notes), (0, &candump.notes));
    }
}

#[test]
fn emit_with_missing_columns_writes_no_frames_for_them() {
    let mut data = measured();
    data.joint = JointKind::Prismatic;
    for run in &mut data.runs {
        run.measured = Measured::default();
    }
    let log = log_of(&data, &EmitOptions::default());
    let lines = log.iter().filter(|byte| **byte == b'\n').count();
    // Joint kind, two runs with full sample numbers, and three frames per row.
    assert_eq!(lines, 1 + 2 + 3 + 2 + 3 * 1000);
    let back = Log::new(&log).read().unwrap();
    assert_eq!(back.joint, JointKind::Prismatic);
    assert!(back.runs[0].measured == Measured::default());
    assert!(back.covariates.is_empty() && back.left_out_columns.is_empty());
    assert!(back.runs[1].velocity.len() == 300);
}

#[test]
fn emit_with_fine_stamps_uses_nanoseconds_and_keeps_gaps() {
    let mut data = measured();
    data.runs.truncate(1);
    data.runs[0].time_s.iter_mut().skip(350).for_each(|time| *time += 2.0);
    let start = EmitOptions { start_s: 1_436_509_052, ..gap() };
    let log = log_of(&data, &start);
    assert!(log.starts_with(b"(1436509052.000000) vcan0 601#"));
    assert_eq!(tracks(&Log::new(&log).read().unwrap()).len(), 2, "a gap parts tracks");
    data.runs[0].time_s.iter_mut().for_each(|time| *time *= 1.0 / 3.0);
    let log = log_of(&data, &start);
    assert!(log.starts_with(b"(1436509052.000000000) vcan0 601#"));
    let back = Log::new(&log).read().unwrap();
    for (found, time) in back.runs[0].time_s.iter().zip(&data.runs[0].time_s) {
        assert!((found - time).abs() < 1e-9);
    }
}

/// Returns a log that also holds the driver's answers.
fn answered() -> Vec<u8> {
    let mut log = Vec::new();
    let mut writer = Writer::new(&mut log, "can0", NodeId::new(5).unwrap(), Fraction::Nanoseconds);
    for sequence in 0..1000u32 {
        let mut sample = TraceSample::EMPTY;
        sample.time_ns = 1_000_000_007 + u64::from(sequence) * 50_001;
        (sample.run, sample.sequence) = (Some(1 + sequence / 600), sequence % 600);
        sample.motion.velocity_rad_s = (sequence as f32 * 0.01).sin();
        sample.torque.torque_nm = sequence as f32;
        let friction = sequence as f32 * 1.5;
        sample.answer = Some(AnswerFrame {
            friction_torque_nm: friction,
            feed_forward_current_a: 0.9 * friction,
        });
        let flags = if sequence % 7 == 0 { Flags::SLEW_LIMITED } else { Flags::empty() };
        sample.status = Some(StatusFrame { flags, sequence: sample.sequence });
        writer.sample(&sample).unwrap();
    }
    log
}

fn samples_of(log: &[u8]) -> Vec<TraceSample> {
    let mut assembler = Assembler::default();
    let mut samples = Vec::new();
    for (at, line) in log.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()).enumerate() {
        samples.extend(assembler.push(at as u64 + 1, &candump::parse(line).unwrap()));
    }
    let (last, summary) = assembler.finish();
    samples.extend(last);
    assert_eq!(summary.lost, 0);
    samples
}

#[test]
fn writer_with_log_of_answers_reproduces_it_byte_for_byte() {
    let log = answered();
    let samples = samples_of(&log);
    assert_eq!(samples.len(), 1000);
    assert!(samples.iter().all(|sample| sample.answer.is_some() && sample.status.is_some()));
    assert_eq!(samples[999].status.unwrap().sequence, 399);
    let mut again = Vec::new();
    let mut writer =
        Writer::new(&mut again, "can0", NodeId::new(5).unwrap(), Fraction::Nanoseconds);
    samples.iter().for_each(|sample| writer.sample(sample).unwrap());
    assert!(again == log);
}

#[test]
fn read_with_driver_answers_leaves_them_out() {
    let data = Log::new(&answered()).read().unwrap();
    assert!(data.covariates.is_empty());
    let left_out: Vec<&str> = data.left_out_columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(left_out, ["friction_torque_nm", "feed_forward_current_a", "flags"]);
    message::check("traces", "answers of the driver", &data.left_out_columns[0].why, &["driver"]);
}

#[test]
fn read_with_faulty_log_reports_file_and_line() {
    let text = String::from_utf8(log_of(&measured(), &gap())).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let with = |at: usize, line: &str| {
        let mut lines = lines.clone();
        lines[at] = line;
        Log::new((lines.join("\n") + "\n").as_bytes()).read()
    };
    // Lines 1 to 3 are the joint's kind, the run and its first sample's motion.
    let first_row = lines.iter().position(|line| line.contains(" 080#02")).unwrap();
    let motion = first_row - 4;
    assert!(lines[motion].contains(" 481#"));
    let mut cells = String::new();
    let (invalid, nan) = ("(0.001) vcan0 20#00", "(0.001000) vcan0 481#0000C07F00000000");
    for (at, line, bad_row, parts) in [
        (motion, "(0.001000) vcan0 481#00", first_row, &["481", "1 ", "8"][..]),
        (motion, "", first_row, &[]),
        (motion, invalid, motion, &[invalid]),
        (motion, nan, first_row, &[]),
        (motion + 2, "(0.001000) vcan0 401#00", first_row, &["401", "1 ", "8"]),
    ] {
        let data = with(at, line).unwrap();
        let cell = data.bad_rows.first[0].to_string();
        // A line that is no frame is bad, and so is the sample that lacks it.
        let count = if bad_row == motion { 2 } else { 1 };
        assert_eq!(data.bad_rows.count, count, "{cell}");
        let row = format!("row {}, ", bad_row + 1);
        message::require(&cell, &[&["trace.log", &row, "column "][..], parts].concat());
        cells += &format!("{line} => {cell}\n");
    }
    message::check("traces", "bad rows", &cells, &[]);
    let silent = with(first_row, "(0.001000) vcan0 080#00").unwrap();
    message::check("traces", "sample missing", &silent.notes[0], &["trace.log", "1 "]);
    let remark =
        with(first_row, "DROPCOUNT: dropped 1 CAN frame on 'vcan0' socket (total drops 1)");
    let notes = remark.unwrap().notes.join("; ");
    message::check("traces", "remark between the frames", &notes, &[": 1 ", ": 1 "]);
    let other = with(motion, "(0.001000) vcan0 482#0000803F0000803F").unwrap_err();
    let parts = ["trace.log", "1 on vcan0", "2 on vcan0"];
    message::check("traces", "two joints", &other, &parts);
    let refused = |log: &str| Log::new(log.as_bytes()).read().unwrap_err();
    let frames = "080 (1), 123 (1)";
    let parts = ["trace.log", frames, "480 + node", "680 + node", "080", "joint.dbc"];
    let foreign = refused("(1.5) can0 123#00\n(1.6) can0 080#01\n");
    message::check("traces", "no frames of a joint", &foreign, &parts);
    let parts = ["trace.log", "row 1,", "(all)", "\"(1.5) can0 123\"", "1 of 1 ", "5 %"];
    message::check("traces", "line without data", &refused("(1.5) can0 123\n"), &parts);
}

#[test]
fn emit_with_invalid_options_returns_error() {
    let data = measured();
    for (options, word) in [
        (EmitOptions { interface: "can 0".into(), ..gap() }, "can 0"),
        (EmitOptions { interface: String::new(), ..gap() }, "interface"),
        (EmitOptions { auxiliary: Some("depth".into()), ..gap() }, "\"depth\""),
    ] {
        let error = emit(&data, &options, std::io::sink()).unwrap_err().to_string();
        assert!(error.contains(word) && error.lines().count() == 1, "{error}");
    }
    let mut late = measured();
    late.runs[1].time_s.iter_mut().for_each(|time| *time += 1e9);
    let error = emit(&late, &gap(), std::io::sink()).unwrap_err().to_string();
    assert!(error.contains("run 8"), "{error}");
}

#[test]
fn read_with_mapped_columns_renames_them() {
    let log = Log::new(&log_of(&measured(), &gap()));
    let columns = vec![("torque_nm".to_owned(), "load_torque_nm".to_owned())];
    let options = ReadOptions { columns, ..ReadOptions::default() };
    let data = read(&[log.path()], &options, &|_, _| {}).unwrap();
    assert_eq!(data.runs[0].torque[10], f64::from((5.0 * 0.01f64.sin()) as f32));
}

/// A fixed random generator, so that every run tries the same logs (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }
}

#[test]
fn read_with_damaged_log_returns_data_or_error_of_one_line() {
    let mut data = measured();
    data.runs.iter_mut().for_each(|run| *run = run.slice(0..60));
    let sound = log_of(&data, &gap());
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut refused = 0;
    for round in 0..400 {
        let mut log = sound.clone();
        for _ in 0..1 + random.below(if round % 2 == 0 { 3 } else { 60 }) {
            let at = random.below(log.len());
            match random.below(4) {
                0 => log[at] = b"(). #R_0F\n\xFF"[random.below(11)],
                1 => log[at] = random.below(256) as u8,
                2 if at > 0 => drop(log.drain(at..(at + random.below(90)).min(log.len()))),
                _ => log.truncate(at.max(1)),
            }
        }
        match Log::new(&log).read() {
            Ok(data) => assert!(data.rows > 0),
            Err(message) => {
                refused += 1;
                assert_eq!(message.lines().count(), 1, "{message}");
            }
        }
    }
    assert!((20..380).contains(&refused), "{refused}");
}
