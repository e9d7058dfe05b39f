//! Columns in other units: currents, units by size, and what the program says to type.

use super::{Folder, number};
use crate::snapshot;
use std::fmt::Write as _;

/// Time, position, velocity and torque of a joint with Coulomb friction of 0.8 Nm and viscous friction of 0.3 Nm s/rad.
fn joint() -> impl Iterator<Item = [f64; 4]> {
    (0..1200).map(|row| {
        let t = 0.01 * f64::from(row);
        let position = (0.9 * t).sin() + 0.3 * (2.3 * t).sin();
        let velocity = 0.9 * (0.9 * t).cos() + 0.69 * (2.3 * t).cos();
        [t, position, velocity, 0.8 * velocity.signum() + 0.3 * velocity + 0.01 * (40.0 * t).sin()]
    })
}

/// Writes the joint's log with the columns that `cells` makes of a row.
fn write(folder: &Folder, name: &str, header: &str, cells: impl Fn([f64; 4]) -> Vec<f64>) {
    let mut text = format!("{header}\n");
    for row in joint() {
        let cells: Vec<String> = cells(row).iter().map(|cell| format!("{cell:?}")).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    folder.write(name, text);
}

fn coulomb_nm(folder: &Folder, arguments: &str) -> f64 {
    let fit = folder.json(&format!("identify {arguments} --model linear"));
    number(&fit, "/models/0/params/coulomb_torque/value").as_f64().expect("a number")
}

#[test]
fn torque_in_amperes_without_constant_names_what_to_type() {
    let folder = Folder::new();
    write(&folder, "drive.csv", "t,q,dq,i_q", |[t, q, v, torque]| vec![t, q, v, torque / 0.105]);
    let columns = "--columns time_s=t,position_rad=q,velocity_rad_s=dq,torque_nm=i_q";
    let mut lines = String::new();
    for unit in ["", ":A"] {
        let line = folder.run_rejected(&format!("diagnose drive.csv {columns}{unit}"));
        for expected in ["torque_nm=i_q:A", "--torque-constant 0.105Nm/A", "torque_nm=i_q:0.105Nm"]
        {
            assert!(line.contains(expected), "{expected}: {line}");
        }
        lines += &line;
    }
    let missing = folder.run_rejected("diagnose drive.csv");
    assert!(missing.contains("torque_nm=i_q:A"), "{missing}");
    snapshot::check("units", "torque in amperes without a constant", &(lines + &missing));
    for ending in [":A --torque-constant 0.105Nm/A", " --torque-constant 105mNm/A", ":0.105Nm"] {
        let coulomb = coulomb_nm(&folder, &format!("drive.csv {columns}{ending}"));
        assert!((coulomb - 0.8).abs() < 0.02, "{ending}: {coulomb}");
    }
}

#[test]
fn torque_constant_without_current_is_rejected() {
    let folder = Folder::new();
    write(&folder, "joint.csv", "time_s,position_rad,velocity_rad_s,torque_nm", |row| row.to_vec());
    let needless = folder.run_rejected("diagnose joint.csv --torque-constant 0.105Nm/A");
    assert!(needless.contains("--columns torque_nm=NAME:A"), "{needless}");
    let bare = folder.run_rejected("diagnose joint.csv --torque-constant 0.105");
    assert!(bare.contains("--torque-constant") && bare.contains("0.105Nm/A"), "{bare}");
    snapshot::check("units", "torque constant without a current", &(needless + &bare));
}

#[test]
fn columns_help_suggests_currents_and_units_by_size() {
    let folder = Folder::new();
    write(&folder, "drive.csv", "time,angle,speed,current [A]", |[t, q, v, torque]| {
        vec![t, q.to_degrees(), v * 30.0 / std::f64::consts::PI, torque / 0.105]
    });
    let help = folder.run_successfully("diagnose drive.csv --columns help");
    for expected in [
        "position_rad=angle:deg",
        "velocity_rad_s=speed:rpm",
        "'torque_nm=current [A]:A'",
        "angle, speed",
        "--torque-constant 0.105Nm/A",
    ] {
        assert!(help.contains(expected), "{expected} in {help}");
    }
    snapshot::check("units", "help of columns", &help);
    let line = folder.run_rejected("diagnose drive.csv");
    assert!(line.contains("position_rad=angle:deg,velocity_rad_s=speed:rpm"), "{line}");
}

#[test]
fn bad_rows_above_the_limit_are_left_out_if_allowed() {
    let folder = Folder::new();
    write(
        &folder,
        "lost.csv",
        "time_s,position_rad,velocity_rad_s,torque_nm",
        |[t, q, v, torque]| {
            let is_lost = ((100.0 * t).round() as i64 * 7919 % 101) < 8;
            vec![t, q, v, if is_lost { f64::NAN } else { torque }]
        },
    );
    let line = folder.run_rejected("diagnose lost.csv");
    assert!(line.contains("5 %") && line.contains("--bad-rows 8%"), "{line}");
    let coulomb = coulomb_nm(&folder, "lost.csv --bad-rows 8%");
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
    let all = folder.run_rejected("diagnose lost.csv --bad-rows 100%");
    assert!(all.contains("--bad-rows") && all.contains("100%"), "{all}");
    snapshot::check("units", "bad rows above the limit", &(line + &all));
}

const CONTRACT: &str = "time_s,position_rad,velocity_rad_s,torque_nm";

#[test]
fn log_with_contradicting_units_is_rejected_unless_confirmed() {
    let folder = Folder::new();
    write(&folder, "degrees.csv", CONTRACT, |[t, q, v, torque]| vec![t, q, v.to_degrees(), torque]);
    let line = folder.run_rejected("diagnose degrees.csv");
    for expected in ["--columns velocity_rad_s=velocity_rad_s:deg/s", "--as-logged unit-suspect"] {
        assert!(line.contains(expected), "{expected}: {line}");
    }
    snapshot::check("units", "velocity in degrees per second", &line);
    let coulomb = coulomb_nm(&folder, "degrees.csv --columns velocity_rad_s=velocity_rad_s:deg/s");
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
    let found = folder.json("diagnose degrees.csv --as-logged unit-suspect");
    assert_eq!(number(&found, "/log/0/kind"), "unit-suspect", "{found}");
    assert_eq!(number(&found, "/log/0/corrected"), false);
}

#[test]
fn velocity_with_sign_bit_is_recognised_by_the_position() {
    let folder = Folder::new();
    let register = |value: f64, count: f64| {
        let counts = (value / count).round();
        if counts < 0.0 { 1024.0 - counts } else { counts }
    };
    let count = 0.111 * std::f64::consts::PI / 30.0;
    write(
        &folder,
        "servo.csv",
        "time_s,position_rad,Present Speed,torque_nm",
        |[t, q, v, torque]| vec![t, q, register(v, count), torque],
    );
    let columns = "--columns velocity_rad_s=Present_Speed";
    let text = std::fs::read_to_string(folder.path("servo.csv")).expect("a log");
    folder.write("servo.csv", text.replace("Present Speed", "Present_Speed"));
    let line = folder.run_rejected(&format!("diagnose servo.csv {columns}:0.111rpm"));
    for expected in ["bit 10", "--columns 'velocity_rad_s=Present_Speed:sign10 0.111rpm'"] {
        assert!(line.contains(expected), "{expected}: {line}");
    }
    snapshot::check("units", "velocity with a sign bit", &line);
    // The arguments of a test have no blanks.
    let coulomb = coulomb_nm(&folder, &format!("servo.csv {columns}:sign10*0.111rpm"));
    assert!((coulomb - 0.8).abs() < 0.03, "{coulomb}");
}

#[test]
fn torque_of_a_servo_is_computed_from_its_gains() {
    let folder = Folder::new();
    let (kp, kd) = (40.0, 1.5);
    write(&folder, "servo.csv", "time_s,position_rad,velocity_rad_s,q_des", |[t, q, v, torque]| {
        vec![t, q, v, q + (torque + kd * v) / kp]
    });
    let line = folder.run_rejected("diagnose servo.csv");
    assert!(line.contains("--torque-from pd,kp=40,kd=1.5,target=q_des"), "{line}");
    let law = "--torque-from pd,kp=40,kd=1.5,target=q_des";
    let coulomb = coulomb_nm(&folder, &format!("servo.csv {law}"));
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
    let found = folder.json(&format!("diagnose servo.csv {law}"));
    let log = number(&found, "/log").as_array().expect("a list");
    let computed = log.iter().find(|one| one["kind"] == "computed-torque").expect("a finding");
    let words = computed["in_words"].as_str().expect("a sentence");
    assert!(words.contains("40 Nm/rad (target - q) - 1.5 Nm s/rad v"), "{words}");
    let line = folder.run_rejected("diagnose servo.csv --torque-from pd,kp=40,target=nothing");
    assert!(line.contains("nothing") && line.contains("time_s, "), "{line}");
    snapshot::check("units", "target of a servo that is no column", &line);
}

#[test]
fn force_beside_an_angle_names_the_lever() {
    let folder = Folder::new();
    write(
        &folder,
        "lever.csv",
        "time_s,position_rad,velocity_rad_s,force_n",
        |[t, q, v, torque]| vec![t, q, v, torque / 0.2],
    );
    let line = folder.run_rejected("diagnose lever.csv");
    for expected in ["0.2 m", "--columns torque_nm=force_n:0.2Nm"] {
        assert!(line.contains(expected), "{expected}: {line}");
    }
    snapshot::check("units", "force beside an angle", &line);
    let coulomb = coulomb_nm(&folder, "lever.csv --columns torque_nm=force_n:0.2Nm");
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
}

#[test]
fn torque_a_thousand_times_off_is_doubted_by_its_inertia() {
    let folder = Folder::new();
    write(&folder, "milli.csv", CONTRACT, |[t, q, v, torque]| {
        let acceleration = -0.81 * (0.9 * t).sin() - 0.69 * 2.3 * (2.3 * t).sin();
        vec![t, q, v, 1e3 * (torque + 0.55 * acceleration)]
    });
    let found = folder.json("diagnose milli.csv --rigid-body inertia");
    let log = number(&found, "/log").as_array().expect("a list");
    let doubt = log.iter().find(|one| one["kind"] == "unit-suspect").expect("a finding");
    let words = doubt["in_words"].as_str().expect("a sentence");
    assert!(words.contains("--columns torque_nm=torque_nm:mNm"), "{words}");
}

#[test]
fn next_experiment_prints_a_command_that_writes_a_motion_within_the_log() {
    let linear = "time_s,position_m,velocity_m_s,force_n";
    for (header, column, size) in [(CONTRACT, "position_rad", 1.0), (linear, "position_m", 0.05)] {
        let folder = Folder::new();
        write(&folder, "joint.csv", header, |[t, q, v, torque]| {
            vec![t, size * q, size * v, torque]
        });
        let found = folder.json("diagnose joint.csv");
        let next = number(&found, "/next_experiment").as_str().expect("a text").to_owned();
        let (_, command) = next.split_once("host-sim ").expect(&next);
        let (command, _) = command.split_once(" (").expect(&next);
        folder.run_successfully(command);
        let motion = std::fs::read_to_string(folder.0.path().join("motion/motion.csv")).unwrap();
        assert!(motion.starts_with(&format!("time_s,{column}\n")), "{next}");
        let at = |line: &str| line.split_once(',').unwrap().1.parse::<f64>().unwrap();
        let positions: Vec<f64> = motion.lines().skip(1).map(at).collect();
        let range = positions.iter().fold(0.0f64, |most, at| most.max(at.abs()));
        let speed =
            positions.windows(2).fold(0.0f64, |most, w| most.max((w[1] - w[0]).abs() / 0.005));
        assert!((0.7..1.21).contains(&(range / size)), "{next}: {range}");
        assert!((1.2..1.6).contains(&(speed / size)), "{next}: {speed}");
    }
}

#[test]
fn next_experiment_names_the_rigid_body_that_lowers_the_held_out_error() {
    let folder = Folder::new();
    write(&folder, "arm.csv", CONTRACT, |[t, q, v, torque]| {
        let acceleration = -0.81 * (0.9 * t).sin() - 0.69 * 2.3 * (2.3 * t).sin();
        vec![t, q, v, torque + 2.4 * q.sin() + 0.3 * acceleration + 0.2]
    });
    let next = |found: &serde_json::Value| {
        number(found, "/next_experiment").as_str().expect("a text").to_owned()
    };
    let said = next(&folder.json("diagnose arm.csv"));
    let (_, option) = said.split_once("--rigid-body ").expect(&said);
    let parts = option.split([':', ' ']).next().expect("parts");
    assert_eq!(parts, "inertia,gravity,offset", "{said}");
    let error = said.split_once(" to ").and_then(|(_, rest)| rest.split(' ').next());
    let error: f64 = error.expect(&said).parse().expect(&said);
    let typed = folder.json(&format!("diagnose arm.csv --model linear --rigid-body {parts}"));
    let reached = number(&typed, "/baseline/test_rmse").as_f64().expect("a number");
    assert!(error < 0.1 && reached < 1.3 * error, "{reached}: {said}");
    assert!(!next(&typed).contains("--rigid-body"), "{}", next(&typed));
    write(&folder, "joint.csv", CONTRACT, |row| row.to_vec());
    let said = next(&folder.json("diagnose joint.csv"));
    assert!(!said.contains("--rigid-body"), "a joint without gravity: {said}");
}
