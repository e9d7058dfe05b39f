//! The header comments of `params.toml`: the source data of the parameters, the date, and warnings.
//!
//! The comments allow a later reader to judge the file without the other results of the run.

use friction_diagnose::prepare::Prepared;
use friction_fit::Outcome;
use friction_fit::clock::since_epoch;
use friction_fit::params;
use joint_log::Dataset;
use joint_log::log_check::LogFinding;

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
            minute(now)
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

/// Returns the text of `params.toml`: the parameters of a fit, and their origin as comments.
pub fn parameter_file(
    command: &str,
    input: &Prepared,
    fit: &Outcome,
    auxiliary: Option<&str>,
) -> String {
    let from = Provenance {
        command,
        data: &input.data,
        hashes: &input.hashes,
        log_findings: &input.log_findings,
        verdicts: &fit.verdicts,
    };
    from.comments() + &params::emit(fit, &input.data, auxiliary)
}

/// Formats seconds since 1970 as `2026-11-22 12:34`. The calendar follows Hinnant's `civil_from_days`: eras of 400 years
/// that start in March, so that the leap day is the last day of a year.
fn minute(epoch_s: u64) -> String {
    let (days, second) = (epoch_s / 86_400 + 719_468, epoch_s % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    let year = year_of_era + 400 * era + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02}", second / 3600, second / 60 % 60)
}

#[cfg(test)]
mod tests {
    use super::minute;

    #[test]
    fn minute_formats_epoch_seconds_as_calendar_time() {
        for (epoch_s, text) in [
            (0, "1970-01-01 00:00"),
            (951_782_399, "2000-02-28 23:59"),
            (951_782_400, "2000-02-29 00:00"),
            (951_868_800, "2000-03-01 00:00"),
            (1_795_350_600, "2026-11-22 12:30"),
            (4_107_542_399, "2100-02-28 23:59"),
            (4_107_542_400, "2100-03-01 00:00"),
        ] {
            assert_eq!(minute(epoch_s), text);
        }
    }
}
