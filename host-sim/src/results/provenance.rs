//! What stands above the parameters in `params.toml`: from what they were fitted, when, and what to beware of.
//!
//! Comments, which no reader of the file takes for parameters; so whoever finds the file a year later, without the
//! folder it lay in, knows whether to trust it.

use friction_identification::data::Dataset;
use friction_identification::log_check::LogFinding;
use std::time::{SystemTime, UNIX_EPOCH};

/// What the parameters of a file come from.
pub struct Provenance<'a> {
    /// The command that fitted them.
    pub command: &'a str,
    /// The log.
    pub data: &'a Dataset,
    /// SHA-256 of its files, in their order.
    pub hashes: &'a [String],
    /// What is wrong with the log itself.
    pub log_findings: &'a [LogFinding],
    /// What is to be said of the fit.
    pub verdicts: &'a [String],
}

impl Provenance<'_> {
    /// Comment lines, with an empty line behind them.
    pub fn comments(&self) -> String {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
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
        lines.extend(log.chain(fit).map(|(whose, words)| format!("{whose}: {words}")));
        // A name or a word of the log may hold a line's end, which would end the comment.
        let one_line = |line: &String| line.split_whitespace().collect::<Vec<_>>().join(" ");
        lines.iter().map(|line| format!("# {}\n", one_line(line))).collect::<String>() + "\n"
    }
}

/// A time of the epoch, s, as `2026-11-22 12:34`. Days to the calendar after Hinnant's `civil_from_days`: eras of
/// 400 years that begin in March, so that the leap day is the last.
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
    fn a_time_is_that_of_the_calendar() {
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
