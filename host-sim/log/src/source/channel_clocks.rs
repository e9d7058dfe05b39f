//! Tables with a time column for each channel: `t1,ch1,t2,ch2`.
//!
//! Oscilloscopes and TwinCAT Scope write such tables. A row of the file is then not an instant: its cells have stamps
//! of their own. The groups (a time column and the channels after it) are merged onto one clock. Samples of equal
//! stamps form one row; the others leave cells empty, which `close` fills as for every log with merged channels.

use crate::column_names::ColumnNames;
use crate::columns::{FINITE, is_missing_value};
use crate::error::{listed, quoted};
use crate::log_table::{LogTable, TableRows};
use crate::options::ReadOptions;

/// Words of a time column.
const TIME_WORDS: [&str; 3] = ["t", "time", "timestamp"];

/// A time column and its channels, as columns of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Group {
    time: usize,
    channels: std::ops::Range<usize>,
}

/// Stamps of at least this size are FILETIME: 100 ns since 1601. It is the year 1918.
const MIN_FILETIME: f64 = 1e17;

/// Limit of a stamp: FILETIME is a signed number of 64 bits.
const MAX_STAMP: f64 = 9e18;

/// 1970 in FILETIME.
const FILETIME_OF_1970: i128 = 116_444_736_000_000_000;

/// Returns the groups of a header with several time columns; `None` if it is an ordinary table.
fn groups(names: &ColumnNames, options: &ReadOptions) -> Option<Vec<Group>> {
    let names = &names.names;
    let first = clock_name(names.first()?)?;
    let starts: Vec<usize> =
        (0..names.len()).filter(|at| clock_name(&names[*at]).as_deref() == Some(&*first)).collect();
    let ends = starts.iter().skip(1).copied().chain([names.len()]);
    let groups: Vec<Group> = starts
        .iter()
        .zip(ends)
        .map(|(&time, end)| Group { time, channels: time + 1..end })
        .collect();
    // A user who names the clock of another channel wants that clock alone.
    let is_other = |(ours, theirs): &(String, String)| {
        let theirs = theirs.rsplit_once(':').map_or(&**theirs, |(head, _)| head);
        ours == "time_s" && starts[1..].iter().any(|at| names[*at] == theirs && theirs != names[0])
    };
    let has_channels = groups.iter().all(|group| !group.channels.is_empty());
    (groups.len() > 1 && has_channels && !options.columns.iter().any(is_other)).then_some(groups)
}

/// Returns the name of a time column without its number; `None` for another column.
fn clock_name(name: &str) -> Option<String> {
    let lower = name.trim().to_lowercase();
    let is_part = |c: char| !c.is_alphanumeric();
    let word =
        lower.split(is_part).next()?.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let rest: String = lower.chars().filter(|c| !c.is_ascii_digit()).collect();
    TIME_WORDS.contains(&&*word).then(|| rest.trim_end_matches(is_part).to_owned())
}

/// A sample of a group: its time, and its row in the file.
struct Sample {
    time: f64,
    row: usize,
}

/// A cell that makes a sample invalid.
struct BadSample {
    /// Its column in the merged table.
    column: usize,
    found: String,
    expected: String,
}

/// What the stamps of a file count, by the first of them.
#[derive(Clone, Copy)]
enum Stamps {
    /// The unit of the first clock.
    Plain,
    /// 100 ns since 1601. The times count from the first stamp, in milliseconds, the unit of TwinCAT Scope.
    FileTime { first: i128 },
}

impl Stamps {
    /// Returns the time of a stamp with the text of its cell, or what was expected instead.
    fn time(self, stamp: f64, text: &[u8]) -> Result<f64, &'static str> {
        match self {
            Self::Plain if stamp < MIN_FILETIME => Ok(stamp),
            Self::FileTime { first } if stamp >= MIN_FILETIME => {
                Ok((ticks(stamp, text) - first) as f64 / 1e4)
            }
            Self::Plain => Err("a time that is no FILETIME, as the first"),
            Self::FileTime { .. } => Err("FILETIME, as the first time"),
        }
    }
}

/// Returns the ticks of a FILETIME, of which an `f64` holds no more than sixteen digits.
fn ticks(stamp: f64, text: &[u8]) -> i128 {
    let whole = std::str::from_utf8(text).ok().and_then(|text| text.parse().ok());
    // A number with a point or an exponent is not written to the last digit.
    whole.unwrap_or(stamp as i128)
}

/// A table whose channels have clocks of their own.
pub(super) struct ChannelClocks {
    groups: Vec<Group>,
    /// The columns of the merged table, as columns of the file: the first clock, then all channels.
    kept: Vec<usize>,
}

impl ChannelClocks {
    /// Returns the clocks of a header with several time columns; `None` if it is an ordinary table.
    pub fn find(names: &ColumnNames, options: &ReadOptions) -> Option<Self> {
        let groups = groups(names, options)?;
        let channels = groups.iter().flat_map(|group| group.channels.clone());
        let kept = [groups[0].time].into_iter().chain(channels).collect();
        Some(Self { groups, kept })
    }

    /// Returns the names of the merged table.
    pub fn names(&self, of_file: &ColumnNames) -> ColumnNames {
        let unit = |at: &usize| of_file.units.get(*at).cloned().unwrap_or_default();
        ColumnNames {
            names: self.kept.iter().map(|at| of_file.names[*at].clone()).collect(),
            units: self.kept.iter().map(unit).collect(),
            ..*of_file
        }
    }

    /// Returns the cells of the merged table's columns.
    pub fn cells<'a>(&self, cells: &[&'a [u8]]) -> Vec<&'a [u8]> {
        self.kept.iter().map(|at| cells.get(*at).copied().unwrap_or_default()).collect()
    }

    /// Returns a note on the merged columns.
    pub fn note(&self, of_file: &ColumnNames) -> String {
        let clocks: Vec<&str> =
            self.groups.iter().map(|group| &*of_file.names[group.time]).collect();
        let count = clocks.len();
        let is_one = clocks.iter().all(|name| *name == clocks[0]);
        let names = if is_one { clocks[0].to_owned() } else { listed(&clocks) };
        format!(
            "{count} time columns ({names}) are merged onto one clock: each is that of the channels after it"
        )
    }

    /// Adds the rows of the file, merged onto one clock, to a table. Returns a note on the origin of the times, if the file
    /// states it.
    pub fn merge(&self, file: &LogTable, table: &mut TableRows) -> Option<String> {
        let mut stamps = None;
        let mut samples: Vec<Vec<Sample>> = self.groups.iter().map(|_| Vec::new()).collect();
        for row in 0..file.lines.len() {
            for (group, samples) in self.groups.iter().zip(&mut samples) {
                match self.sample(file, group, row, samples.last(), &mut stamps) {
                    Ok(sample) => samples.extend(sample),
                    Err(BadSample { column, found, expected }) => {
                        table.reject_row(file.lines[row], Some(column), found, &expected);
                    }
                }
            }
        }
        let mut next = vec![0; samples.len()];
        loop {
            let heads = samples.iter().zip(&next).filter_map(|(samples, at)| samples.get(*at));
            let order =
                |a: &&Sample, b: &&Sample| a.time.total_cmp(&b.time).then(a.row.cmp(&b.row));
            let Some(&Sample { time, row }) = heads.min_by(order) else { break };
            let row_now = |(samples, at): (&Vec<Sample>, &mut usize)| {
                let sample = samples.get(*at).filter(|sample| sample.time == time)?;
                *at += 1;
                Some(sample.row)
            };
            let rows: Vec<Option<usize>> = samples.iter().zip(&mut next).map(row_now).collect();
            table.add_numbers(file.lines[row], |at| {
                let column = self.kept[at];
                let group = self.groups.iter().position(|group| group.channels.contains(&column));
                // The first column is the clock.
                group.map_or(Some(time), |group| file.columns[column].number(rows[group]?))
            });
        }
        let Some(Stamps::FileTime { first }) = stamps else { return None };
        let origin = crate::clock::format_origin((first - FILETIME_OF_1970) * 100);
        Some(format!("times count from {origin}"))
    }

    /// Returns the sample of a group in a row of the file; `None` if there is none, or it repeats the last one. The first
    /// sample of the file sets what its `stamps` count.
    fn sample(
        &self,
        file: &LogTable,
        group: &Group,
        row: usize,
        last: Option<&Sample>,
        stamps: &mut Option<Stamps>,
    ) -> Result<Option<Sample>, BadSample> {
        let bad = |column, found, expected: String| Err(BadSample { column, found, expected });
        let text = |column: usize| file.columns[column].text(row);
        let number = |column: usize, row: usize| file.columns[column].number(row);
        let stamp = number(group.time, row).filter(|stamp| stamp.abs() < MAX_STAMP);
        let clock = text(group.time);
        let Some(stamp) = stamp else {
            // A slower channel has fewer samples.
            return if clock.is_empty() { Ok(None) } else { bad(0, quoted(&clock), FINITE.into()) };
        };
        let kind = stamps.get_or_insert_with(|| match stamp < MIN_FILETIME {
            true => Stamps::Plain,
            false => Stamps::FileTime { first: ticks(stamp, &clock) },
        });
        let time = match kind.time(stamp, &clock) {
            Ok(time) => time,
            Err(expected) => return bad(0, quoted(&clock), expected.into()),
        };
        if let Some(last) = last.filter(|last| time < last.time) {
            return bad(0, time.to_string(), format!("a time not before {}", last.time));
        }
        let is_word = |(_, column): &(usize, &usize)| {
            group.channels.contains(*column)
                && number(**column, row).is_none()
                && !is_missing_value(&text(**column))
        };
        if let Some((column, of_file)) = self.kept.iter().enumerate().find(is_word) {
            return bad(column, quoted(&text(*of_file)), FINITE.into());
        }
        let bits = |column: usize, row: usize| number(column, row).map(f64::to_bits);
        // A slower channel may be repeated until its next sample.
        let is_repeated = last.is_some_and(|last| {
            let is_same = |column: usize| bits(column, row) == bits(column, last.row);
            last.time == time && group.channels.clone().all(is_same)
        });
        Ok((!is_repeated).then_some(Sample { time, row }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grouped(header: &str) -> Option<Vec<(usize, std::ops::Range<usize>)>> {
        let names: Vec<String> = header.split(',').map(str::to_owned).collect();
        let groups = groups(&names.into(), &ReadOptions::default())?;
        Some(groups.into_iter().map(|group| (group.time, group.channels)).collect())
    }

    #[test]
    fn groups_with_time_column_per_channel_returns_them() {
        let expected = Some(vec![(0, 1..2), (2, 3..5)]);
        for header in [
            "t1,v,t2,tau,q",
            "time,v,time,tau,q",
            "Time (ms) 1,v,Time (ms) 2,tau,q",
            "t_1,v,t_2,tau,q",
        ] {
            assert_eq!(grouped(header), expected, "{header}");
        }
    }

    #[test]
    fn groups_with_one_clock_returns_none() {
        for header in [
            "time_s,v,tau",
            "time,v,tau,timestamp,x",
            "x,t1,v,t2,tau",
            "t1,t2,v,tau",
            "t1,v,tau,t2",
            "",
        ] {
            assert_eq!(grouped(header), None, "{header}");
        }
        let names = ["t1", "v", "t2", "tau"].map(str::to_owned).to_vec();
        let columns = vec![("time_s".to_owned(), "t2:ms".to_owned())];
        let options = ReadOptions { columns, ..ReadOptions::default() };
        assert_eq!(groups(&names.into(), &options), None);
    }
}
