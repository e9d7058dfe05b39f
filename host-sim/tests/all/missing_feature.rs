//! What a cargo feature adds is refused in a build without it: one line with the feature and the command, exit code 2.
#![cfg(not(feature = "papers"))]

use std::process::Command;

#[test]
fn paper_commands_without_feature_name_feature_and_command() {
    for (arguments, refused) in [
        ("paper damper --quick", "paper: "),
        ("simulate manipulator --runs 2", "simulate manipulator: "),
        ("simulate damper", "simulate damper: "),
        ("identify log.csv --model lugre --inside manipulator", "--inside: "),
        ("compare log.csv --inside manipulator", "--inside: "),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let output = command.args(arguments.split(' ')).output().expect("it runs");
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        let error = String::from_utf8(output.stderr).expect("text");
        assert_eq!(error.lines().count(), 1, "{arguments}: {error}");
        let with_feature = format!("cargo run --release --features papers -- {arguments}");
        assert!(error.contains(refused) && error.contains(&with_feature), "{arguments}: {error}");
    }
}
