//! Progress of the commands: shown on a terminal, and absent from a pipe.
#![cfg(target_os = "linux")]

use crate::monitor::OnTerminal;
use std::path::Path;
use std::process::Command;

/// Returns a command in a folder.
fn host_sim(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.current_dir(folder).args(arguments);
    command
}

const SIMULATE: [&str; 8] =
    ["simulate", "underwater-joint", "--runs", "3", "--seconds", "6", "--out", "out"];
const IDENTIFY: [&str; 4] = ["identify", "out/data.csv", "--model", "lugre"];
const COMPARE: [&str; 4] = ["compare", "out/data.csv", "--models", "dahl"];
const DIAGNOSE: [&str; 2] = ["diagnose", "out/data.csv"];
const REPLAY: [&str; 2] = ["replay", "out/trace.log"];
#[cfg(feature = "papers")]
const PAPER: [&str; 3] = ["paper", "manipulator", "--quick"];

#[test]
fn commands_on_terminal_show_progress_and_expected_duration() {
    let folder = tempfile::tempdir().unwrap();
    let shows = |arguments: &[&str], words: &[&str], end: &str| {
        let mut command = OnTerminal::start(&mut host_sim(folder.path(), arguments));
        words.iter().for_each(|word| command.wait_for(word));
        command.wait_for(end);
    };
    shows(&SIMULATE, &["simulating underwater-joint"], "written: ");
    shows(&IDENTIFY, &["checking ", "fitting lugre to ", "writing the report"], "written: ");
    shows(&COMPARE, &["fitting dahl to ", "writing the report"], "written: ");
    shows(&DIAGNOSE, &["checking ", "comparing hypotheses", "fitting the base model"], "written: ");
    let samples = ["18000 samples (2 min 18 s", "samples, "];
    shows(&REPLAY, &samples, "bit for bit");
}

#[test]
#[cfg(feature = "papers")]
fn paper_on_terminal_shows_progress_and_expected_duration() {
    let folder = tempfile::tempdir().unwrap();
    // The run itself takes a minute; it ends with this test.
    let mut paper = OnTerminal::start(&mut host_sim(folder.path(), &PAPER));
    paper.wait_for("60 s on two cores");
    paper.wait_for("of about 60 s");
}

#[test]
fn commands_in_pipe_print_no_progress() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&SIMULATE[..], &IDENTIFY, &COMPARE, &REPLAY] {
        let output = host_sim(folder.path(), arguments).output().expect("starts");
        let messages = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(output.status.success(), "{arguments:?}: {messages}");
        let others: Vec<&str> = messages.lines().filter(|l| !l.starts_with("log: ")).collect();
        assert!(others.is_empty(), "{arguments:?}: {others:?}");
        assert!(!messages.contains(['\r', '\x1b']), "{arguments:?}: {messages:?}");
    }
}
