//! The header comments of `params.toml`: the source data of the parameters, the date, and warnings.
//!
//! The comments allow a later reader to judge the file without the other results of the run.

use friction_diagnose::prepare::Prepared;
use friction_fit::clock::since_epoch;
use friction_fit::{Measurement, Outcome, params};
use joint_log::log_check::LogFinding;
use joint_log::{Dataset, utc_minute};

/// The origin of fitted parameters.
pub struct Provenance<'a> {
    /// The command that fitted them.
    pub command: &'a str,
    /// The fitted log.
    pub data: &'a Dataset,
    /// SHA-256 of the files, in order.
    pub hashes: &'a [String],
    /// Problems of the log itself.
    pub log_findings: &'a [LogFinding],
    /// Verdicts of the fit.
    pub verdicts: &'a [String],
}

impl Provenance<'_> {
    /// Returns the comment lines, followed by an empty line.
    pub fn comments(&self) -> String {
        let now = since_epoch().as_secs();
        let mut lines = vec![format!(
            "{} of host-sim {}, {} UTC",
            self.command,
            env!("CARGO_PKG_VERSION"),
            utc_minute(now)
        )];
        let files = self.data.files.iter().zip(self.hashes);
        lines.extend(files.map(|(file, hash)| {
            let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
            format!("from {name}, SHA-256 {hash}")
        }));
        lines.push(format!("{} rows in {} runs", self.data.rows, self.data.runs.len()));
        let log = self.log_findings.iter().map(|finding| ("the log", finding.in_words.as_str()));
        let fit = self.verdicts.iter().map(|verdict| ("warning", verdict.as_str()));
        lines.extend(log.chain(fit).map(|(prefix, text)| format!("{prefix}: {text}")));
        // A name from the log may contain a line break, which would end the comment.
        let one_line = |line: &String| line.split_whitespace().collect::<Vec<_>>().join(" ");
        lines.iter().map(|line| format!("# {}\n", one_line(line))).collect::<String>() + "\n"
    }
}

/// Returns the text of `params.toml`: the parameters of a fit, what lies between shaft and log, and their origin as comments.
pub fn parameter_file(
    command: &str,
    input: &Prepared,
    fit: &Outcome,
    auxiliary: Option<&str>,
    measurement: &Measurement,
) -> String {
    let from = Provenance {
        command,
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &input.log_findings,
        verdicts: &fit.verdicts,
    };
    let mut text = from.comments() + &params::emit(fit, &input.data, auxiliary);
    let is_motion_logged = input.is_motion_logged;
    let measurement = Measurement { is_motion_logged, ..measurement.clone() };
    if !measurement.is_exact() {
        measurement.emit(Measurement::OF_FILE, &mut text);
    }
    text
}
