//! What a build leaves out: each is refused in one line that names the feature and the command with it.

use std::process::Command;

/// A feature, whether this build has it, and arguments that need it.
const CASES: [(&str, bool, &[&str]); 7] = [
    ("papers", cfg!(feature = "papers"), &["paper", "damper", "--quick"]),
    ("monitor", cfg!(feature = "monitor"), &["monitor", "--view", "paged", "--seconds", "0.1"]),
    ("update", cfg!(feature = "update"), &["update", "joint.package", "--bus", "no-such-bus0"]),
    ("update", cfg!(feature = "update"), &["sign", "--new-key", "signing.key"]),
    ("update", cfg!(feature = "update"), &["update", "--help"]),
    ("network", cfg!(feature = "network"), &["identify", "log.csv", "--model", "lugre-lstm"]),
    ("onnx", cfg!(feature = "onnx"), &["export", "params.toml", "--to", "onnx"]),
];

#[test]
fn command_that_needs_an_absent_feature_returns_one_line_error() {
    for (feature, is_built, arguments) in CASES.iter().filter(|(_, is_built, _)| !is_built) {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let output = command.current_dir(folder.path()).args(*arguments).output().expect("starts");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(!is_built && output.status.code() == Some(2), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty() && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
        let with = format!("cargo run --release --features {feature} -- {}\n", arguments.join(" "));
        assert!(stderr.starts_with("error: ") && stderr.ends_with(&with), "{stderr}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{arguments:?}");
    }
}
