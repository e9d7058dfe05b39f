//! Tables with a time column for each channel: `t1,ch1,t2,ch2`.
//!
//! Oscilloscopes and TwinCAT Scope write such tables. A row of the file is then not an instant: its cells have stamps
//! of their own. The groups (a time column and the channels after it) are merged onto one clock. Samples of equal
//! stamps form one row; the others leave cells empty, which `close` fills as for every log with merged channels.

use super::records::{RecordPosition, is_blank};
use crate::column_names::ColumnNames;
use crate::columns::{FINITE, is_missing_value};
use crate::error::quoted;
use crate::log_table::TableRows;
use crate::options::ReadOptions;

/// Words of a time column.
const TIME_WORDS: [&str; 3] = ["t", "time", "timestamp"];

/// A time column and its channels, as columns of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
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
pub(super) fn groups(names: &ColumnNames, options: &ReadOptions) -> Option<Vec<Group>> {
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

/// The samples of one group.
#[derive(Debug, Default)]
struct GroupSamples {
    time: Vec<f64>,
    lines: Vec<u64>,
    /// Values of all channels, row by row.
    values: Vec<f64>,
}

/// A table whose channels have clocks of their own.
pub(super) struct ChannelClocks {
    groups: Vec<Group>,
    samples: Vec<GroupSamples>,
    /// The columns of the merged table, as columns of the file: the first clock, then all channels.
    kept: Vec<usize>,
    /// The first stamp, if stamps are FILETIME.
    first_filetime: Option<i128>,
}

impl ChannelClocks {
    pub fn new(groups: Vec<Group>) -> Self {
        let samples = groups.iter().map(|_| GroupSamples::default()).collect();
        let channels = groups.iter().flat_map(|group| group.channels.clone());
        let kept = [groups[0].time].into_iter().chain(channels).collect();
        Self { groups, samples, kept, first_filetime: None }
    }

    /// Returns the names of the merged table.
    pub fn names(&self, of_file: &ColumnNames) -> ColumnNames {
        let unit = |at: &usize| of_file.units.get(*at).cloned().unwrap_or_default();
        ColumnNames {
            names: self.kept.iter().map(|at| of_file.names[*at].clone()).collect(),
            units: self.kept.iter().map(unit).collect(),
            is_twincat_scope: of_file.is_twincat_scope,
            is_numbered: of_file.is_numbered,
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
        let names = if clocks.iter().all(|name| *name == clocks[0]) {
            clocks[0].to_owned()
        } else {
            crate::error::listed(&clocks)
        };
        format!(
            "{count} time columns ({names}) are merged onto one clock: each is that of the channels after it"
        )
    }

    /// Adds the samples of a record. `number` parses a cell.
    pub fn add(
        &mut self,
        table: &mut TableRows,
        position: &RecordPosition,
        record: &csv::ByteRecord,
        number: &dyn Fn(&[u8]) -> Option<f64>,
    ) {
        // TwinCAT Scope marks the end of a file.
        if is_blank(record) || record.as_slice().trim_ascii() == b"EOF" {
            return;
        }
        for at in 0..self.groups.len() {
            if let Err((column, found, expected)) =
                self.add_sample(at, position.line, record, number)
            {
                table.reject_row(position.line, Some(column), found, &expected);
            }
        }
    }

    /// Adds the sample of one group.
    ///
    /// # Errors
    /// The column of the merged table, what was found there and what was expected.
    fn add_sample(
        &mut self,
        at: usize,
        line: u64,
        record: &csv::ByteRecord,
        number: &dyn Fn(&[u8]) -> Option<f64>,
    ) -> Result<(), (usize, String, String)> {
        let Group { time, channels } = self.groups[at].clone();
        let cell = |column: usize| record.get(column).unwrap_or_default().trim_ascii();
        if cell(time).is_empty() {
            // A slower channel has fewer samples.
            return Ok(());
        }
        let stamp = number(cell(time)).filter(|stamp| stamp.abs() < MAX_STAMP);
        let stamp = stamp.ok_or_else(|| (0, quoted(cell(time)), FINITE.to_owned()))?;
        let time = self.time(cell(time), stamp);
        let last = self.samples[at].time.last().copied();
        if let Some(last) = last.filter(|last| time < *last) {
            return Err((0, time.to_string(), format!("a time not before {last}")));
        }
        let is_word =
            |channel: &usize| number(cell(*channel)).is_none() && !is_missing_value(cell(*channel));
        if let Some(channel) = channels.clone().find(is_word) {
            let column = self.kept.iter().position(|kept| *kept == channel).unwrap_or_default();
            return Err((column, quoted(cell(channel)), FINITE.to_owned()));
        }
        let samples = &mut self.samples[at];
        let values: Vec<f64> =
            channels.map(|channel| number(cell(channel)).unwrap_or(f64::NAN)).collect();
        let before = samples.values.len().checked_sub(values.len());
        let before = before.map(|start| &samples.values[start..]).unwrap_or_default();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        if last == Some(time) && bits(before) == bits(&values) {
            // A slower channel may be repeated until its next sample.
            return Ok(());
        }
        samples.values.extend(values);
        samples.time.push(time);
        samples.lines.push(line);
        Ok(())
    }

    /// Returns the time of a stamp in the column's unit. FILETIME becomes milliseconds, the unit of TwinCAT Scope.
    fn time(&mut self, cell: &[u8], stamp: f64) -> f64 {
        if self.first_filetime.is_none() && stamp < MIN_FILETIME {
            return stamp;
        }
        let ticks = std::str::from_utf8(cell).ok().and_then(|text| text.parse().ok());
        let ticks: i128 = ticks.unwrap_or(stamp as i128);
        (ticks - *self.first_filetime.get_or_insert(ticks)) as f64 / 1e4
    }

    /// Adds the merged rows. Returns a note on the origin of the times, if the file states it.
    pub fn finish(self, table: &mut TableRows) -> Option<String> {
        let mut next = vec![0; self.groups.len()];
        let mut row = vec![f64::NAN; self.kept.len()];
        let offsets: Vec<usize> = self
            .groups
            .iter()
            .scan(1, |offset, group| {
                let own = *offset;
                *offset += group.channels.len();
                Some(own)
            })
            .collect();
        loop {
            let times = self.samples.iter().zip(&next).map(|(of, at)| of.time.get(*at).copied());
            let Some(time) = times.flatten().min_by(f64::total_cmp) else { break };
            row.fill(f64::NAN);
            row[0] = time;
            let mut line = u64::MAX;
            for (group, samples) in self.samples.iter().enumerate() {
                let at = next[group];
                if samples.time.get(at) != Some(&time) {
                    continue;
                }
                let width = self.groups[group].channels.len();
                let values = &samples.values[at * width..(at + 1) * width];
                row[offsets[group]..offsets[group] + width].copy_from_slice(values);
                line = line.min(samples.lines[at]);
                next[group] += 1;
            }
            let text = |at: usize| row[at].to_string().into_bytes().into();
            table.add_row(
                line,
                |at| Some(row[at]),
                |at| if row[at].is_nan() { b"".into() } else { text(at) },
            );
        }
        self.first_filetime.map(|ticks| {
            let origin = crate::clock::format_origin((ticks - FILETIME_OF_1970) * 100);
            format!("times count from {origin}")
        })
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
