//! An exported model gives the same torque as the original model.
//!
//! Every law runs through one motion, alone and with every term that the format supports. The record and the Rust
//! constants must be bit-identical to the core. The C header is compiled and must agree within 1e-4 of the largest
//! torque. The simulator formats are compared with the core in steady sliding.

use crate::snapshot;
use compensator_core::configuration::Configuration;
use compensator_core::{
    Compensator, Inputs, LawKind, ModelState, ParameterId as Id, Parameters, Reading, Sample,
    TermKind, record,
};
use friction_fit::params::{self, ParameterFile, emit_model};
use friction_fit::prediction::{PredictionOptions, PredictionStart, predict_log};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, identify, tracks};
use friction_results::export::{ExportFormat, export};
use host_sim::driver_file;
use joint_log::setting::plain;
use joint_log::{Dataset, JointKind};
use std::io::Write as _;
use std::process::{Command, Stdio};

const PERIOD_S: f32 = 1e-3;
const ROWS: usize = 4000;

/// Terms that the C header supports. A test below checks that it rejects all others.
const C_TERMS: [TermKind; 15] = [
    TermKind::Backlash,
    TermKind::RadialForceCoulomb,
    TermKind::RadialForceRate,
    TermKind::PressureCoulomb,
    TermKind::TemperatureViscous,
    TermKind::PositionRipple,
    TermKind::GravityImbalance,
    TermKind::DirectionAsymmetry,
    TermKind::QuadraticDrag,
    TermKind::DwellTimeStatic,
    TermKind::TimeDrift,
    TermKind::LoadTorqueCoulomb,
    TermKind::StribeckShape,
    TermKind::TorqueRipple,
    TermKind::TemperatureCoulomb,
];

/// A model of this law in which every parameter has an effect.
fn joint(law: LawKind, terms: &[TermKind]) -> Parameters<f32> {
    let mut joint = Parameters::<f32>::new(law);
    for (id, value) in [
        (Id::CoulombTorque, 1.5),
        (Id::StaticTorque, 2.1),
        (Id::CoulombTorqueNegative, 1.3),
        (Id::StaticTorqueNegative, 1.8),
        (Id::StribeckVelocity, 0.07),
        (Id::BristleStiffness, 900.0),
        (Id::BristleDamping, 0.4),
        (Id::ViscousFriction, 0.8),
        (Id::QuadraticFriction, 0.05),
        (Id::CubicFriction, 0.01),
        (Id::AtanTorque, 0.3),
        (Id::AtanSlope, 20.0),
        (Id::RadialForceCoulomb, 4e-3),
        (Id::RadialForceStaticExcess, 1e-3),
        (Id::PressureCoulomb, 2.4e-6),
        (Id::PressureStaticExcess, 3e-7),
        (Id::RadialForceRate, 2e-5),
        (Id::TemperatureViscosity, 0.03),
        (Id::TemperatureCoulomb, 0.01),
        (Id::RippleSine, 0.1),
        (Id::RippleCosine, -0.06),
        (Id::RippleOrder, 3.0),
        (Id::GravitySine, 0.4),
        (Id::GravityCosine, 0.2),
        (Id::CoulombAsymmetry, 0.08),
        (Id::ViscousAsymmetry, -0.1),
        (Id::TorqueOffset, 0.12),
        (Id::QuadraticDrag, 0.07),
        (Id::DwellGain, 0.1),
        (Id::DwellTime, 0.2),
        (Id::DriftAmplitude, 0.2),
        (Id::DriftTime, 7200.0),
        (Id::DriftRate, 1e-7),
        (Id::LoadCoulomb, 0.03),
        (Id::LoadGain, 0.9),
        (Id::Inertia, 0.05),
        (Id::StribeckExponent, 1.4),
        (Id::BacklashTravel, 0.05),
        (Id::BacklashStiffnessRatio, 0.1),
        (Id::TorqueRippleSine1, 0.15),
        (Id::TorqueRippleOrder2, 7.0),
        (Id::TorqueRippleCosine2, 0.1),
    ] {
        joint.set(id, value);
    }
    for term in terms {
        assert!(joint.add_term(*term), "{term:?}");
    }
    // Passivity is not tested here.
    joint.choices.allow_active = true;
    joint
}

fn file(model: &Parameters<f32>) -> ParameterFile {
    let settings = "\n[compensator]\nscale = 0.9\ntorque_limit_nm = 6\ntorque_constant_nm_per_a = 1\n\
         current_limit_a = 26\ngravity = true\n";
    let text = emit_model(model, JointKind::Revolute) + settings;
    driver_file::parse(&text).expect("a legal model")
}

/// A motion back and forth with rests, under varying loads.
fn samples() -> Vec<Sample<f32>> {
    let mut force_before = None;
    (0..ROWS)
        .map(|row| {
            let t = row as f32 * PERIOD_S;
            let rests = (row / 500) % 4 == 3;
            let force = 40.0 + 30.0 * (5.0 * t).sin();
            let change = force - force_before.replace(force).unwrap_or(force);
            Sample {
                velocity_rad_s: if rests { 0.0 } else { 1.2 * (4.0 * t).sin() },
                position_rad: -0.3 * (4.0 * t).cos(),
                position_weight: 1.0,
                radial_force_n: force,
                radial_force_change_n: change,
                pressure_diff_mpa: 0.1 + 0.05 * t.sin(),
                temperature_c: 8.0 + 2.0 * t,
                load_torque_nm: 3.0 * (0.9 * t).cos(),
                acceleration_rad_s2: 4.8 * (4.0 * t).cos(),
                campaign_time_h: 1.0 + t / 3600.0,
                ..Sample::default()
            }
        })
        .collect()
}

/// Torques of the core in double precision, so that the reference is free of `float` rounding. Without the offset of the law `atan`,
/// which is not compensated.
fn torques_of_core(model: &Parameters<f32>) -> Vec<f64> {
    let built =
        model.convert::<f64>().compensated().build::<f64>(f64::from(PERIOD_S)).expect("it builds");
    let mut state = ModelState::default();
    samples().iter().map(|sample| built.step(&mut state, &sample.map(f64::from))).collect()
}

/// Torques of the compiled C header, from a state of zero.
fn torques_of_c(model: &Parameters<f32>) -> Vec<f64> {
    let rows: Vec<(Option<f32>, Sample<f32>)> =
        samples().into_iter().map(|sample| (None, sample)).collect();
    run_c(&file(model), PERIOD_S, &rows)
}

/// Torques of the compiled C header. A row with a measured torque is the first one of a run.
fn run_c(file: &ParameterFile, period_s: f32, rows: &[(Option<f32>, Sample<f32>)]) -> Vec<f64> {
    let folder = tempfile::tempdir().expect("a folder");
    let header = export(file, ExportFormat::C, "params.toml").expect("exported").content;
    let header = String::from_utf8(header).expect("text");
    std::fs::write(folder.path().join("friction.h"), &header).expect("written");
    let inputs = |field: &str| header.contains(&format!("float {field};\n"));
    let columns = [
        ("velocity_rad_s", true),
        ("position_rad", inputs("position_rad")),
        ("radial_force_n", header.contains("in->radial_force_n")),
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
    for (start, s) in rows {
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
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(|line| line.parse().expect("a number")).collect()
}

fn assert_close(model: &Parameters<f32>) {
    let (core, c) = (torques_of_core(model), torques_of_c(model));
    assert_eq!(core.len(), c.len());
    let largest = core.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
    assert!(largest > 1.0, "torque too small for a comparison");
    for (row, (core, c)) in core.iter().zip(&c).enumerate() {
        let apart = (core - c).abs();
        assert!(
            apart < 1e-4 * largest,
            "{:?} {:?}: row {row}: core {core}, C {c}",
            model.law,
            model.terms
        );
    }
}

#[test]
fn export_to_c_of_every_law_matches_core() {
    for law in LawKind::ALL {
        assert_close(&joint(*law, &[]));
        let mut other = joint(*law, &[]);
        other.choices.damping_fades = true;
        other.choices.printed_extended = true;
        assert_close(&other);
    }
}

#[test]
fn export_to_c_of_every_supported_term_matches_core() {
    for terms in C_TERMS.chunks(6) {
        for law in [LawKind::Lugre, LawKind::Stribeck] {
            let of_law: Vec<TermKind> =
                terms.iter().copied().filter(|term| !law.includes(*term)).collect();
            assert_close(&joint(law, &of_law));
        }
    }
}

#[test]
fn export_to_c_of_unsupported_term_returns_error_with_its_name() {
    let is_unsupported = |kind: &&TermKind| kind.is_compensated() && !C_TERMS.contains(kind);
    for kind in TermKind::ALL.iter().filter(is_unsupported) {
        let model = joint(LawKind::Lugre, &[*kind]);
        let error = export(&file(&model), ExportFormat::C, "params.toml")
            .expect_err("it has a memory")
            .to_string();
        assert!(error.contains(kind.name()) && plain(&error).contains("format rust"), "{error}");
        assert!(export(&file(&model), ExportFormat::Rust, "params.toml").is_ok());
    }
}

#[test]
fn export_to_record_is_read_back_from_the_store() {
    let model = joint(LawKind::ImprovedLugre, &[TermKind::PositionRipple]);
    let file = file(&model);
    let bytes = export(&file, ExportFormat::Record, "params.toml").expect("exported").content;
    let mut store = firmware::store::Store::open(firmware::store::memory::MemoryFlash::<2>::new());
    store.save(&bytes, &[0; firmware::store::IDENTITY_BYTES]).expect("saved");
    let mut kept = [0; firmware::store::MAX_PAYLOAD];
    let length = store.load(&mut kept).expect("loaded").length;
    let configuration = record::parse(&kept[..length]).expect("a record");
    assert_eq!(configuration, file.friction());
    assert_eq!(torques_of_core(&configuration.model), torques_of_core(&model));
}

/// Output of `export --to rust` for the model of the example loop; compiled here and in the example.
#[rustfmt::skip]
#[path = "../../../firmware/examples/bare_loop/src/friction.rs"]
mod exported;

fn torques(configuration: &Configuration) -> Vec<u32> {
    let mut compensator = Compensator::<f32>::build(configuration, PERIOD_S).expect("it builds");
    compensator.set_enabled(true);
    let step = |sample: Sample<f32>| {
        let mut inputs = Inputs::velocity(sample.velocity_rad_s);
        inputs.pressure_diff_mpa = Reading::fresh(sample.pressure_diff_mpa);
        compensator.step(&inputs).compensation_torque_nm.to_bits()
    };
    samples().into_iter().map(step).collect()
}

#[test]
fn export_to_rust_is_bit_identical_to_the_file() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware/examples/bare_loop");
    let read = driver_file::read(format!("{folder}/params.toml").as_ref()).expect("a model");
    let written = export(&read, ExportFormat::Rust, "params.toml").expect("exported").content;
    let in_git = std::fs::read(format!("{folder}/src/friction.rs")).expect("in git");
    let how = "host-sim export params.toml --to rust --out src";
    assert!(written == in_git, "src/friction.rs is out of date, regenerate it: {how}");
    assert_eq!(exported::configuration(), read.friction());
    let torques = torques(&exported::configuration());
    assert_eq!(torques, self::torques(&read.friction()));
    assert!(torques.iter().any(|bits| f32::from_bits(*bits) > 1.0));
}

fn attribute(text: &str, name: &str) -> f64 {
    let at = text.find(&format!("{name}=\"")).expect(name) + name.len() + 2;
    text[at..].split('"').next().unwrap_or_default().parse().expect("a number")
}

#[test]
fn export_to_simulators_matches_steady_sliding() {
    let linear = file(&joint(LawKind::Linear, &[]));
    for (format, dry) in [(ExportFormat::Mujoco, "frictionloss"), (ExportFormat::Urdf, "friction")]
    {
        let written = export(&linear, format, "params.toml").expect("exported");
        let text = String::from_utf8(written.content).expect("text");
        assert!((attribute(&text, dry) - 1.5).abs() < 1e-6, "{text}");
        assert!((attribute(&text, "damping") - 0.8).abs() < 1e-6, "{text}");
        assert!(written.notes.is_empty(), "{:?}", written.notes);
    }
    let lugre = joint(LawKind::Lugre, &[TermKind::PressureCoulomb]);
    let text =
        export(&file(&lugre), ExportFormat::Mujoco, "params.toml").expect("exported").content;
    let text = String::from_utf8(text).expect("text");
    assert!(
        text.contains("bristles") && text.contains("left out") && text.contains("pressure-coulomb")
    );
    // Well above the Stribeck velocity, the line agrees with the law within a few percent.
    let line = attribute(&text, "frictionloss") + 6.0 * attribute(&text, "damping");
    assert!((line - (1.5 + 0.8 * 6.0)).abs() < 0.03 * line, "{line}");
}

/// A log of a joint that starts under a torque: Maxwell-slip elements, a pressure that preloads them, an offset of one direction.
fn log(pressure_coulomb: f64, asymmetry: f64) -> Dataset {
    const STEP_S: f64 = 0.005;
    let names = ["time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"].map(String::from);
    let run = |run: usize| {
        let mut columns = vec![Vec::new(); names.len()];
        let mut elements = [0.0f64; 5];
        // The joint holds a torque from its past.
        elements.iter_mut().for_each(|element| *element = 0.15 - 0.1 * run as f64);
        for row in 0..1200 {
            let time = row as f64 * STEP_S;
            let moving = if row < 150 { 0.02 } else { 1.0 };
            let velocity = moving * (0.6 + 0.3 * run as f64) * (2.0 * time).sin();
            let pressure = 1e5 * (1.0 + (0.7 * time + run as f64).sin());
            let level = 1.2 + 0.4 * (-(velocity / 0.08).abs()).exp() + pressure_coulomb * pressure;
            let level = level * (1.0 + asymmetry * velocity.signum());
            for (at, element) in elements.iter_mut().enumerate() {
                let most = level * (0.12 + 0.04 * at as f64);
                let stiffness = 60.0 * (1.0 + at as f64);
                *element = (*element + stiffness * velocity * STEP_S).clamp(-most, most);
            }
            let noise = 0.004 * (((row * 7919 + run * 31) % 1000) as f64 / 500.0 - 1.0);
            let torque = elements.iter().sum::<f64>() + 0.3 * velocity + noise;
            for (column, value) in columns.iter_mut().zip([time, velocity, torque, pressure]) {
                column.push(value);
            }
        }
        (run.to_string(), columns)
    };
    Dataset::from_columns(&names, (0..3).map(run)).expect("a valid log")
}

#[test]
fn export_gives_the_same_error_on_a_log_in_every_form() {
    for (model, data) in [
        ("lugre+pressure-coulomb", log(2e-6, 0.0)),
        ("lugre+direction-asymmetry+pressure-coulomb", log(1e-6, 0.15)),
    ] {
        let spec = Spec::parse(model).expect("a model");
        let tracks = tracks(&data);
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let base = spec.parameters().expect("parameters");
        let fit = identify(&spec, &base, rows, rows, &FitOptions::default());
        let file = driver_file::parse(&params::emit(&fit, &data, None)).expect("a legal model");
        let predicted = predict_log(&file, &data, &PredictionOptions::AS_EXPORTED).expect("rows");
        let from_zero =
            PredictionOptions { start: PredictionStart::Rest, ..PredictionOptions::AS_EXPORTED };
        let from_zero = predict_log(&file, &data, &from_zero).expect("rows").metrics.rmse;
        let expected = predicted.metrics.rmse;
        assert!(from_zero > 1.05 * expected, "a start of no use: {from_zero} {expected}");

        let mut in_rows: Vec<(Option<f32>, Sample<f32>)> = Vec::new();
        let mut measured = Vec::new();
        let mut in_rust = Vec::new();
        for track in &tracks {
            let period_s = track.period_s as f32;
            let built = file.friction().model.build::<f32>(period_s).expect("a legal model");
            let samples = track.samples.iter().map(|sample| sample.map(|value| value as f32));
            let samples: Vec<Sample<f32>> = samples.collect();
            let first = track.torque[0] as f32;
            let mut state = built.state_for_torque(ModelState::default(), &samples[0], first);
            in_rust.extend(samples.iter().map(|s| f64::from(built.step(&mut state, s))));
            measured.extend(&track.torque);
            let start = |at: usize| (at == 0).then_some(first);
            in_rows.extend(samples.into_iter().enumerate().map(|(at, s)| (start(at), s)));
        }
        let in_c = run_c(&file, tracks[0].period_s as f32, &in_rows);
        let rmse = |torques: &[f64]| {
            let squares = torques.iter().zip(&measured).map(|(a, b): (&f64, &f64)| (a - b).powi(2));
            (squares.sum::<f64>() / measured.len() as f64).sqrt()
        };
        for (form, torques) in [("Rust", &in_rust), ("C", &in_c)] {
            assert_eq!(torques.len(), measured.len(), "{form}");
            let found = rmse(torques);
            let apart = (found / expected - 1.0).abs();
            assert!(apart < 2e-4, "{model} in {form}: {found}, expected {expected}");
        }
    }
}

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
        let in_c = run_c(&file, PERIOD_S, &[(None, at(0.0)), (None, at(100.0))]);
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
    let guide = include_str!("../../../docs/src/how-to/embed-the-compensator.md");
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

#[test]
fn export_to_mujoco_writes_inertia_as_armature() {
    let model = joint(LawKind::Linear, &[TermKind::UnmodelledInertia]);
    let text = |inertia: f32, format| {
        let model = model.clone().with(Id::Inertia, inertia);
        let written = export(&file(&model), format, "params.toml").expect("exported");
        String::from_utf8(written.content).expect("text")
    };
    let written = text(0.25, ExportFormat::Mujoco);
    assert!((attribute(&written, "armature") - 0.25).abs() < 1e-6, "{written}");
    assert!((attribute(&written, "frictionloss") - 1.5).abs() < 1e-6, "{written}");
    assert!(written.contains("kg m^2") && !written.contains("left out"), "{written}");
    // A negative one is no inertia, and a URDF joint has no attribute for it.
    for left_out in [text(-0.1, ExportFormat::Mujoco), text(0.25, ExportFormat::Urdf)] {
        assert!(!left_out.contains("armature") && left_out.contains("unmodelled-inertia"));
    }
}

#[test]
fn export_to_simulator_takes_covariates_at_the_means_of_the_log() {
    let model = joint(LawKind::Stribeck, &[TermKind::PressureCoulomb, TermKind::TorqueOffset]);
    let text = emit_model(&model, JointKind::Revolute) + "\n[log_means]\npressure_diff_pa = 2e5\n";
    let with_means = driver_file::parse(&text).expect("a legal model");
    let mujoco = |file: &ParameterFile| {
        let written = export(file, ExportFormat::Mujoco, "params.toml").expect("exported");
        String::from_utf8(written.content).expect("text")
    };
    let (with, without) = (mujoco(&with_means), mujoco(&file(&model)));
    let added = attribute(&with, "frictionloss") - attribute(&without, "frictionloss");
    assert!((added - 2.4e-6 * 2e5).abs() < 1e-3, "{added}");
    assert!(
        with.contains("pressure_diff_pa = 2.00e5") || with.contains("pressure_diff_pa = 2"),
        "{with}"
    );
    assert!(
        !without.contains("pressure_diff_pa =") && without.contains("pressure-coulomb"),
        "{without}"
    );
    assert!(with.contains("torque-offset"), "{with}");
    snapshot::check("export", "to MuJoCo with means", &with);
    snapshot::check("export", "to MuJoCo without means", &without);
}
