//! A log in a format that the build does not read is refused in one line with the feature and the command, exit code 2.

use std::fs;
use std::process::Command;

#[test]
fn identify_with_format_left_out_names_feature_and_command() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, head, feature, is_enabled) in [
        ("my.mcap", &b"\x89MCAP0\r\n"[..], "mcap", cfg!(feature = "mcap")),
        ("my.arrow", b"ARROW1\0\0", "arrow", cfg!(feature = "arrow")),
    ] {
        fs::write(folder.path().join(name), head).expect("a file");
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let command = command.current_dir(&folder).args(["identify", name, "--model", "linear"]);
        let output = command.output().expect("it runs");
        assert_eq!(output.status.code(), Some(2), "{name}");
        let error = String::from_utf8(output.stderr).expect("text");
        assert!(error.lines().count() == 1 && error.contains(name), "{name}: {error}");
        let refusal = format!("--features {feature} -- identify {name} --model linear\n");
        // Cargo unites the features of packages that are built together: Python's reads all formats.
        let is_damaged = !error.contains("--features");
        assert!(error.ends_with(&refusal) || is_damaged, "{name}: {error}");
        assert!(is_damaged || !is_enabled, "{name}: {error}");
    }
}
