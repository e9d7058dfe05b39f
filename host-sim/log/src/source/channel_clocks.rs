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
use std::borrow::Cow;

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

/// Limit of a stamp: FILETIME has 64 bits.
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

/// A cell that makes a sample invalid: its column in the merged table, what was found there and what was expected.
type BadSample = (usize, String, String);

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
        let mut first_filetime = None;
        let mut samples: Vec<Vec<Sample>> = self.groups.iter().map(|_| Vec::new()).collect();
        for row in 0..file.lines.len() {
            for (group, samples) in self.groups.iter().zip(&mut samples) {
                match self.sample(file, group, row, samples.last(), &mut first_filetime) {
                    Ok(sample) => samples.extend(sample),
                    Err((column, found, expected)) => {
                        table.reject_row(file.lines[row], Some(column), found, &expected);
                    }
                }
            }
        }
        let mut next = vec![0; samples.len()];
        loop {
            let heads = samples.iter().zip(&next).filter_map(|(samples, at)| samples.get(*at));
            let Some(time) = heads.map(|sample| sample.time).min_by(f64::total_cmp) else { break };
            let row_now = |(samples, at): (&Vec<Sample>, &mut usize)| {
                let sample = samples.get(*at).filter(|sample| sample.time == time)?;
                *at += 1;
                Some(sample.row)
            };
            let rows: Vec<Option<usize>> = samples.iter().zip(&mut next).map(row_now).collect();
            let line = rows.iter().flatten().map(|row| file.lines[*row]).min();
            table.add_numbers(line.unwrap_or_default(), |at| {
                let column = self.kept[at];
                let group = self.groups.iter().position(|group| group.channels.contains(&column));
                // The first column is the clock.
                group.map_or(Some(time), |group| file.columns[column].number(rows[group]?))
            });
        }
        first_filetime.map(|ticks: i128| {
            let origin = crate::clock::format_origin((ticks - FILETIME_OF_1970) * 100);
            format!("times count from {origin}")
        })
    }

    /// Returns the sample of a group in a row of the file; `None` if there is none, or it repeats the last one.
    fn sample(
        &self,
        file: &LogTable,
        group: &Group,
        row: usize,
        last: Option<&Sample>,
        first_filetime: &mut Option<i128>,
    ) -> Result<Option<Sample>, BadSample> {
        let text = |column: usize| file.columns[column].text(row);
        let number = |column: usize, row: usize| file.columns[column].number(row);
        let stamp = number(group.time, row).filter(|stamp| stamp.abs() < MAX_STAMP);
        let Some(stamp) = stamp else {
            let text = text(group.time);
            // A slower channel has fewer samples.
            let is_bad = !text.is_empty();
            return if is_bad { Err((0, quoted(&text), FINITE.into())) } else { Ok(None) };
        };
        let time = time(|| text(group.time), stamp, first_filetime);
        if let Some(last) = last.filter(|last| time < last.time) {
            return Err((0, time.to_string(), format!("a time not before {}", last.time)));
        }
        let is_word =
            |column: &usize| number(*column, row).is_none() && !is_missing_value(&text(*column));
        if let Some(channel) = group.channels.clone().find(is_word) {
            let column = self.kept.iter().position(|kept| *kept == channel).unwrap_or_default();
            return Err((column, quoted(&text(channel)), FINITE.into()));
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

/// Returns the time of a stamp in the column's unit. FILETIME becomes milliseconds, the unit of TwinCAT Scope.
fn time<'c>(
    cell: impl FnOnce() -> Cow<'c, [u8]>,
    stamp: f64,
    first_filetime: &mut Option<i128>,
) -> f64 {
    if first_filetime.is_none() && stamp < MIN_FILETIME {
        return stamp;
    }
    let ticks = std::str::from_utf8(&cell()).ok().and_then(|text| text.parse().ok());
    let ticks: i128 = ticks.unwrap_or(stamp as i128);
    (ticks - *first_filetime.get_or_insert(ticks)) as f64 / 1e4
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
