//! Logs as laboratories keep them: without a clock, without a header, and in a file for each channel.

use crate::snapshot;

use super::{Folder, HEADER, csv, number, rows};
use std::fmt::Write as _;

/// Returns the Coulomb torque of a fit, Nm.
fn coulomb_nm(folder: &Folder, arguments: &str) -> f64 {
    let fit = folder.json(&format!("identify {arguments} --model linear"));
    number(&fit, "/models/0/params/coulomb_torque/value").as_f64().expect("a number")
}

#[test]
fn commands_with_log_without_clock_return_error_with_the_words_to_type() {
    let folder = Folder::new();
    folder.write("joint.csv", csv(rows(300)));
    folder.write("still.csv", csv(rows(300).map(|(_, v, y)| (0.0, v, y))));
    folder.write(
        "steps.csv",
        csv(rows(300).map(|(_, v, y)| (10_000.0, v, y))).replace("time_s", "dt"),
    );
    let expected = coulomb_nm(&folder, "joint.csv");
    let mut messages = String::new();
    for command in ["diagnose", "compare", "identify --model linear"] {
        let (name, others) = command.split_once(' ').unwrap_or((command, ""));
        let still = folder.run_rejected(&format!("{name} still.csv {others}"));
        assert!(still.contains("time_s") && still.contains("--rate 200Hz"), "{still}");
        let steps =
            folder.run_rejected(&format!("{name} steps.csv --columns time_s=dt:us {others}"));
        assert!(steps.contains("--columns time_s=dt:us:step"), "{steps}");
        messages += &[still, steps].concat();
    }
    snapshot::check("log", "no clock", &messages);
    assert!((coulomb_nm(&folder, "still.csv --rate 100Hz") - expected).abs() < 1e-3);
    assert!((coulomb_nm(&folder, "steps.csv --columns time_s=dt:us:step") - expected).abs() < 1e-3);
    let line = folder.run_rejected("identify still.csv --model linear --rate 100");
    assert!(line.contains("200Hz"), "{line}");
    snapshot::check("log", "rate without a unit", &line);
}

#[test]
fn commands_with_log_without_header_take_numbered_columns() {
    let folder = Folder::new();
    folder.write("joint.csv", csv(rows(300)));
    folder.write("bare.csv", csv(rows(300)).replace(HEADER, ""));
    let line = folder.run_rejected("identify bare.csv --model linear");
    assert!(line.contains("bare.csv") && line.contains("--columns 1=time_s"), "{line}");
    snapshot::check("log", "no header", &line);
    let listed = folder.run_successfully("identify bare.csv --model linear --columns help");
    assert!(listed.contains("1=time_s") && listed.contains("3=torque_nm"), "{listed}");
    let pairs = "--columns 1=time_s,2=velocity_rad_s,3=torque_nm";
    let (found, expected) =
        (coulomb_nm(&folder, &format!("bare.csv {pairs}")), coulomb_nm(&folder, "joint.csv"));
    assert!((found - expected).abs() < 1e-9);
}

#[test]
fn commands_with_file_for_each_channel_join_them() {
    let folder = Folder::new();
    folder.write("joint.csv", csv(rows(300)));
    let mut files =
        [("velocity", String::from("t,velocity\n")), ("effort", String::from("t,effort\n"))];
    for (t, v, y) in rows(300) {
        for (text, value) in files.iter_mut().zip([v, y]) {
            let _ = writeln!(text.1, "{t:?},{value:?}");
        }
    }
    files.iter().for_each(|(name, text)| folder.write(&format!("{name}.csv"), text));
    let line = folder.run_rejected("identify velocity.csv effort.csv --model linear");
    let columns = "--columns time_s=t,velocity_rad_s=velocity,torque_nm=effort";
    assert!(line.contains("--join") && line.contains(columns), "{line}");
    snapshot::check("log", "a file for each channel", &line);
    let found = coulomb_nm(&folder, &format!("velocity.csv effort.csv --join {columns}"));
    assert!((found - coulomb_nm(&folder, "joint.csv")).abs() < 1e-9);
}
