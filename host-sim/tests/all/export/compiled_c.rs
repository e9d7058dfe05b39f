//! The exported C header in a program that reads rows and prints torques.

use compensator_core::Sample;
use friction_fit::params::ParameterFile;
use friction_results::export::{ExportFormat, export};
use std::io::Write as _;
use std::process::{Command, Stdio};

/// A row of a log that the C code computes.
pub struct CRow {
    /// Measured torque, from which the state starts; `None` but for the first row of a run.
    pub start_torque_nm: Option<f32>,
    pub sample: Sample<f32>,
}

impl From<Sample<f32>> for CRow {
    fn from(sample: Sample<f32>) -> Self {
        Self { start_torque_nm: None, sample }
    }
}

/// Returns the torques of the compiled header. Without a start, the state begins at zero.
pub fn run_c(file: &ParameterFile, period_s: f32, rows: &[CRow]) -> Vec<f64> {
    let folder = tempfile::tempdir().expect("a folder");
    let header = export(file, ExportFormat::C, "params.toml").expect("exported").content;
    let header = String::from_utf8(header).expect("text");
    std::fs::write(folder.path().join("friction.h"), &header).expect("written");
    let inputs = |field: &str| header.contains(&format!("float {field};\n"));
    let columns = [
        ("velocity_rad_s", true),
        ("position_rad", inputs("position_rad")),
        ("radial_force_n", inputs("radial_force_n")),
        ("pressure_diff_pa", inputs("pressure_diff_pa")),
        ("temperature_c", inputs("temperature_c")),
        ("load_torque_nm", inputs("load_torque_nm")),
        ("acceleration_rad_s2", inputs("acceleration_rad_s2")),
        ("campaign_time_s", inputs("campaign_time_s")),
    ];
    let mut program = "#include \"friction.h\"\n#include <stdio.h>\nint main(void) {\n\
         const friction_state zero = {0};\nfriction_state state = {0};\nfriction_inputs in = {0};\nfloat x[8], torque;\nint starts;\n\
         while (scanf(\"%d %f %f %f %f %f %f %f %f %f\", &starts, &torque, x, x+1, x+2, x+3, x+4, x+5, x+6, x+7) == 10) {\n"
        .to_owned();
    for (at, (field, _)) in columns.iter().enumerate().filter(|(_, (_, is_there))| *is_there) {
        program += &format!("in.{field} = x[{at}];\n");
    }
    program += &format!(
        "if (starts) {{ state = zero; friction_start(&state, &in, torque, {period_s:?}f); }}\n\
         printf(\"%.9g\\n\", friction_step(&state, &in, {period_s:?}f));\n}}\nreturn 0;\n}}\n"
    );
    let (source, binary) = (folder.path().join("main.c"), folder.path().join("main"));
    std::fs::write(&source, program).expect("written");
    let strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror"];
    let mut compile = Command::new("cc");
    compile.args(strict).arg(&source).arg("-o").arg(&binary).arg("-lm");
    let compiled = compile.output().expect("cc, from the package gcc or build-essential");
    assert!(compiled.status.success(), "{}\n{header}", String::from_utf8_lossy(&compiled.stderr));
    let mut text = String::new();
    for CRow { start_torque_nm: start, sample: s } in rows {
        text += &format!(
            "{} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}\n",
            i32::from(start.is_some()),
            start.unwrap_or_default(),
            s.velocity_rad_s,
            s.position_rad,
            s.radial_force_n,
            s.pressure_diff_mpa * 1e6,
            s.temperature_c,
            s.load_torque_nm,
            s.acceleration_rad_s2,
            s.campaign_time_h * 3600.0
        );
    }
    let mut run = Command::new(&binary);
    let mut child = run.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
    let mut stdin = child.stdin.take().expect("piped");
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = child.wait_with_output().expect("it ends");
    writer.join().expect("a writer").expect("read to the end");
    assert!(output.status.success(), "{}", output.status);
    let text = String::from_utf8(output.stdout).expect("text");
    let torques: Vec<f64> = text.lines().map(|line| line.parse().expect("a number")).collect();
    assert_eq!(torques.len(), rows.len(), "a torque for each row");
    torques
}
