//! Of a model of the complete drive torque, the friction is exported, and gravity if asked.

use super::PERIOD_S;
use super::compiled_c::run_c;
use compensator_core::{Compensator, Inputs, Reading, Sample, record};
use friction_results::export::{ExportFormat, export};
use host_sim::driver_file;
use joint_log::setting::plain;
use std::process::Command;

/// A model of a complete drive torque: friction, and every rigid-body part.
const DRIVE_TORQUE: &str = "schema = 1\njoint = \"revolute\"\n\
    model = \"stribeck+unmodelled-inertia+gravity-imbalance+torque-offset+load-gain+channel-delay+pressure-coulomb\"\n\
    [parameters]\ncoulomb_torque = 1.5\nstatic_torque = 2\npressure_coulomb = 2e-6\n\
    [rigid_body]\ninertia = 0.5\ngravity_sine = 3\ngravity_cosine = 1\ntorque_offset = 0.7\nload_gain = 0.9\n\
    channel_delay = 2e-3\n[compensator]\nscale = 1\ntorque_limit_nm = 60\ntorque_constant_nm_per_a = 0.9\n\
    current_limit_a = 60\n";

#[test]
fn export_of_drive_torque_takes_friction_alone_and_gravity_only_if_asked() {
    let gravity = format!("{DRIVE_TORQUE}gravity = true\n");
    for (text, gravity_nm) in [(DRIVE_TORQUE, 0.0), (gravity.as_str(), 3.0f64)] {
        let file = driver_file::parse(text).expect("a legal model");
        let written = export(&file, ExportFormat::C, "params.toml").expect("exported");
        let header = String::from_utf8(written.content).expect("text");
        assert!(!header.contains("acceleration") && !header.contains("load_torque"), "{header}");
        assert!(header.contains("FRICTION_TORQUE_CONSTANT_NM_PER_A 0.9f"), "{header}");
        let note = written.notes.last().expect("a note");
        assert!(
            note.contains("inertia, load, offset, delay") || note.contains("inertia, offset"),
            "{note}"
        );
        assert_eq!(note.contains("gravity"), gravity_nm == 0.0, "{note}");
        let at = |acceleration: f32| Sample {
            velocity_rad_s: 2.0,
            position_rad: std::f32::consts::FRAC_PI_2,
            acceleration_rad_s2: acceleration,
            load_torque_nm: 5.0,
            pressure_diff_mpa: 0.1,
            ..Sample::default()
        };
        let in_c = run_c(&file, PERIOD_S, &[at(0.0).into(), at(100.0).into()]);
        for torque in in_c {
            assert!((torque - 1.7 - gravity_nm).abs() < 1e-3, "{torque}");
        }
        let record = export(&file, ExportFormat::Record, "params.toml").expect("exported").content;
        let read = record::parse(&record).expect("a record");
        assert_eq!(read.compensator.torque_constant_nm_per_a, 0.9);
        let mut compensator = Compensator::<f32>::build(&read, PERIOD_S).expect("it builds");
        compensator.set_enabled(true);
        for acceleration in [0.0, 100.0, -100.0] {
            let mut inputs = Inputs::velocity(2.0);
            inputs.position_rad = Reading::fresh(std::f32::consts::FRAC_PI_2);
            inputs.acceleration_rad_s2 = Reading::fresh(acceleration);
            inputs.load_torque_nm = Reading::fresh(5.0);
            inputs.pressure_diff_mpa = Reading::fresh(0.1);
            let output = compensator.step(&inputs);
            let torque = f64::from(output.friction_torque_nm);
            assert!((torque - 1.7 - gravity_nm).abs() < 1e-3, "{acceleration}: {torque}");
        }
    }
}

#[test]
fn c_example_of_the_guide_compiles_with_an_exported_header() {
    let guide = include_str!("../../../../docs/src/how-to/embed-the-compensator.md");
    let (_, example) = guide.split_once("```c\n").expect("a block");
    let (example, _) = example.split_once("```").expect("its end");
    let folder = tempfile::tempdir().expect("a folder");
    let file = driver_file::parse(DRIVE_TORQUE).expect("a legal model");
    let header = export(&file, ExportFormat::C, "params.toml").expect("exported").content;
    std::fs::write(folder.path().join("friction.h"), header).expect("written");
    std::fs::write(folder.path().join("loop.c"), example).expect("written");
    let strict = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-c"];
    let compiled =
        Command::new("cc").args(strict).arg("loop.c").current_dir(folder.path()).output();
    let compiled = compiled.expect("cc, from the package gcc or build-essential");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
}

#[test]
fn export_with_a_current_asks_for_the_settings_that_the_file_lacks() {
    let (model, _) = DRIVE_TORQUE.split_once("[compensator]").expect("a section");
    let lacking =
        driver_file::parse(&format!("{model}[compensator]\nscale = 0.7\n")).expect("legal");
    for format in [ExportFormat::Record, ExportFormat::Rust] {
        let error =
            export(&lacking, format, "params.toml").expect_err("settings are missing").to_string();
        assert!(plain(&error).contains("torque_constant_nm_per_a=VALUE"), "{error}");
        assert!(!error.contains("scale"), "{error}");
    }
    assert!(export(&lacking, ExportFormat::C, "params.toml").is_ok());
}
