//! Commissioning and friction run of a simulated joint, and the fit of `identify` to the resulting trace. The reference
//! is the plant's own friction, which is not a LuGre model.

use crate::snapshot;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::path::Path;
use std::process::{Command, Output};

fn host_sim(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).output().expect("runs")
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&[output.stdout.as_slice(), &output.stderr].concat()).into_owned()
}

fn commission(arguments: &[&str]) -> Output {
    host_sim(&[&["params", "commission", "--bus", "loop", "--motor", "--yes"], arguments].concat())
}

/// Friction of the plant's seal and gear at a steady speed, Nm, averaged over both directions and the range of the run.
fn steady_nm(speed_rad_s: f64) -> f64 {
    let mut plant = JointPlant::new(&Parameters::default(), Load::Free, 1);
    let around = plant.around;
    let (dt, end_rad) = (50e-6, 0.45);
    let mut position: f64 = -end_rad;
    let (mut sum, mut count, mut way) = (0.0, 0.0, 1.0);
    for _pass in 0..4 {
        while position * way < end_rad {
            position += way * speed_rad_s * dt;
            let torque = plant.seal.step(way * speed_rad_s, position, &around, dt);
            if position * way > -0.3 {
                (sum, count) = (sum + way * torque, count + 1.0);
            }
        }
        way = -way;
    }
    sum / count
}

/// Friction of the fitted law at a steady speed, Nm.
fn fitted_nm(fit: &serde_json::Value, speed_rad_s: f64) -> f64 {
    let of = |name: &str| fit["models"][0]["params"][name]["value"].as_f64().expect("a number");
    let (coulomb, static_nm) = (of("coulomb_torque"), of("static_torque"));
    let slow = (-(speed_rad_s / of("stribeck_velocity")).powi(2)).exp();
    coulomb + (static_nm - coulomb) * slow + of("viscous_friction") * speed_rad_s
}

fn identify(folder: &Path) -> serde_json::Value {
    let trace = folder.join("trace.log");
    let [trace, out] = [trace.as_path(), folder].map(|path| path.to_str().expect("text"));
    let arguments =
        ["identify", trace, "--model", "lugre", "--rigid-body", "inertia,offset", "--out", out];
    let done = host_sim(&arguments);
    assert!(done.status.success(), "{}", words(&done));
    let text = std::fs::read_to_string(folder.join("fit.json")).expect("fit.json");
    serde_json::from_str(&text).expect("JSON")
}

#[test]
fn identify_on_friction_run_trace_finds_plant_friction() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("text");
    let done = commission(&["--measure", "--friction-run", "--range", "0.5", "--out", out]);
    assert!(done.status.success(), "{}", words(&done));
    snapshot::check("friction-run", "measurement and friction run", &words(&done));
    let fit = identify(folder.path());
    for speed_rad_s in [0.05, 0.1, 0.3, 1.0, 2.0] {
        let (truth, found) = (steady_nm(speed_rad_s), fitted_nm(&fit, speed_rad_s));
        println!("{speed_rad_s} rad/s: {found:.3} Nm of {truth:.3}");
        let ratio = found / truth;
        assert!((0.96..1.04).contains(&ratio), "{speed_rad_s} rad/s: {found} Nm of {truth}");
    }
    let inertia = fit["models"][0]["params"]["inertia"]["value"].as_f64().expect("a number");
    let truth = JointPlant::new(&Parameters::default(), Load::Free, 1).inertia_kg_m2();
    println!("{inertia:.4} of {truth:.4} kg m^2");
    // With a torque at each tenth SYNC, the fit finds a tenth too much or more.
    assert!((0.93..1.05).contains(&(inertia / truth)), "{inertia} of {truth} kg m^2");
}

#[test]
fn friction_run_with_bad_arguments_returns_one_line_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("text");
    let mut messages = String::new();
    for (arguments, found) in [
        (&["--friction-run"][..], "node 1"),
        (&["--range", "0.5"], "--friction-run"),
        (&[], "--measure or --friction-run"),
        (&["--friction-run", "--confirm"], "--confirm"),
        (&["--measure", "--friction-run", "--range", "9"], "0.001 to 6.3"),
        (&["--measure", "--friction-run", "--speed", "99"], "0.01 to 12"),
        // 1.5 A are too small to move the joint, so commissioning ends with an error.
        (&["--measure", "--friction-run", "--current", "1.5"], "ended: "),
    ] {
        let folder = ["--out", out];
        let runs = arguments.contains(&"--friction-run");
        let refused = commission(&[arguments, if runs { &folder } else { &[] }].concat());
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}: {}", words(&refused));
        assert!(words(&refused).contains(found), "{arguments:?}: {}", words(&refused));
        messages += &words(&refused);
    }
    snapshot::check("friction-run", "bad arguments", &messages);
    let no_motor = host_sim(&[
        "params",
        "commission",
        "--bus",
        "loop",
        "--friction-run",
        "--yes",
        "--out",
        out,
    ]);
    assert_eq!(no_motor.status.code(), Some(2));
}
