//! Columns in other units: currents, units by size, and what the program says to type.

use super::{Folder, number};
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
    let expected = "expected the torque constant, from the motor's data sheet: --columns torque_nm=i_q:A with \
                    --torque-constant 0.105Nm/A, or --columns torque_nm=i_q:0.105Nm";
    for unit in ["", ":A"] {
        let line = folder.run_rejected(&format!("identify drive.csv {columns}{unit}"));
        assert!(line.trim_end().ends_with(expected), "{line}");
    }
    let missing = folder.run_rejected("identify drive.csv");
    assert!(missing.contains("torque_nm=i_q:A with the motor's torque constant"), "{missing}");
    for ending in [":A --torque-constant 0.105Nm/A", " --torque-constant 105mNm/A", ":0.105Nm"] {
        let coulomb = coulomb_nm(&folder, &format!("drive.csv {columns}{ending}"));
        assert!((coulomb - 0.8).abs() < 0.02, "{ending}: {coulomb}");
    }
}

#[test]
fn torque_constant_without_current_is_rejected() {
    let folder = Folder::new();
    write(&folder, "joint.csv", "time_s,position_rad,velocity_rad_s,torque_nm", |row| row.to_vec());
    let line = folder.run_rejected("identify joint.csv --torque-constant 0.105Nm/A");
    assert!(line.contains("found no torque_nm in amperes, expected --columns torque_nm=NAME:A"));
    let line = folder.run_rejected("identify joint.csv --torque-constant 0.105");
    assert!(line.contains("a positive torque of one ampere, such as 0.105Nm/A"), "{line}");
}

#[test]
fn columns_help_suggests_currents_and_units_by_size() {
    let folder = Folder::new();
    write(&folder, "drive.csv", "time,angle,speed,current [A]", |[t, q, v, torque]| {
        vec![t, q.to_degrees(), v * 30.0 / std::f64::consts::PI, torque / 0.105]
    });
    let help = folder.run_successfully("identify drive.csv --columns help");
    for expected in [
        "position_rad=angle:deg",
        "velocity_rad_s=speed:rpm",
        "'torque_nm=current [A]:A'",
        "The units of angle, speed are by the sizes of their values: check them.",
        "current [A] is a current: add the motor's torque constant, as --torque-constant 0.105Nm/A.",
    ] {
        assert!(help.contains(expected), "{expected} in {help}");
    }
    let line = folder.run_rejected("identify drive.csv");
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
    let line = folder.run_rejected("identify lost.csv");
    assert!(line.contains("at most 5 % may be; --bad-rows 8% leaves them out"), "{line}");
    let coulomb = coulomb_nm(&folder, "lost.csv --bad-rows 8%");
    assert!((coulomb - 0.8).abs() < 0.02, "{coulomb}");
    let line = folder.run_rejected("identify lost.csv --bad-rows 100%");
    assert!(line.contains("a percentage below 100, such as 10%"), "{line}");
}
