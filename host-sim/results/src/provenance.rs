//! The header comments of `params.toml`: the source data of the parameters, the date, and warnings.
//!
//! The comments allow a later reader to judge the file without the other results of the run.

use friction_diagnose::prepare::Prepared;
use friction_fit::clock::since_epoch;
use friction_fit::{Measurement, Outcome, params};
use joint_log::utc_minute;

/// Returns the comment lines of a fit, followed by an empty line.
fn comments(command: &str, input: &Prepared, verdicts: &[String]) -> String {
    let now = since_epoch().as_secs();
    let mut lines = vec![format!(
        "{command} of host-sim {}, {} UTC",
        env!("CARGO_PKG_VERSION"),
        utc_minute(now)
    )];
    let files = input.data.files.iter().zip(&input.hashes);
    lines.extend(files.map(|(file, hash)| {
        let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
        format!("from {name}, SHA-256 {hash}")
    }));
    lines.push(format!("{} rows in {} runs", input.data.rows, input.data.runs.len()));
    lines.extend(input.log_findings.iter().map(|finding| format!("the log: {}", finding.in_words)));
    lines.extend(verdicts.iter().map(|verdict| format!("warning: {verdict}")));
    // A name from the log may contain a line break, which would end the comment.
    let one_line = |line: &String| line.split_whitespace().collect::<Vec<_>>().join(" ");
    lines.iter().map(|line| format!("# {}\n", one_line(line))).collect::<String>() + "\n"
}

/// Returns the text of `params.toml`: the parameters of a fit, what lies between shaft and log, and their origin as comments.
pub fn parameter_file(
    command: &str,
    input: &Prepared,
    fit: &Outcome,
    auxiliary: Option<&str>,
    measurement: &Measurement,
) -> String {
    let mut text =
        comments(command, input, &fit.verdicts) + &params::emit(fit, &input.data, auxiliary);
    let is_motion_logged = input.is_motion_logged;
    let measurement = Measurement { is_motion_logged, ..measurement.clone() };
    if !measurement.is_exact() {
        measurement.emit(Measurement::OF_FILE, &mut text);
    }
    text
}
