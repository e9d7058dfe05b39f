//! Join of files that hold one channel each: `effort.csv`, `position.csv`, `velocity.csv`.
//!
//! Files belong to one recording if their paths are equal but for a word that names a quantity, in the name of the file or of
//! a folder: `effort/07.csv` and `position/07.csv`, or `run7_tau.csv` and `run7_q.csv`. Their rows are joined by their times.
//! Rows of equal times become one row. If the channels have clocks of their own, each sample keeps its time, and the empty
//! cells are treated as in every log with merged channels.

use super::contract::TIME;
use super::date::parse_stamp;
use super::error::{DataError, listed};
use super::guess;
use super::options::{ReadOptions, refers_to};
use super::statistics::median_step;
use super::table::{Cells, Table};
use crate::setting::Setting;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Maximum difference of two times of one row, in steps between rows.
const SAME_TIME_STEPS: f64 = 0.05;

/// Minimum share of rows with a sample of each file, for the files to have one clock.
const MIN_COMMON_SHARE: f64 = 0.9;

/// Minimum share of the shortest file that is at times of all files.
const MIN_OVERLAP: f64 = 0.5;

/// Maximum number of rows, and share of the rows, that the longest of files without times has more than the shortest.
const MAX_EXTRA_ROWS: f64 = 10.0;
const MAX_EXTRA_SHARE: f64 = 0.01;

/// The files of one recording.
#[derive(Debug, PartialEq)]
pub(super) struct Recording {
    /// The part of the paths that tells it from the others, or the words of its channels.
    pub name: String,
    pub files: Vec<ChannelFile>,
}

/// A file of a recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChannelFile {
    /// Its index among all files.
    pub index: usize,
    /// The word of its channel.
    pub word: String,
}

/// A joined recording.
pub(super) struct Joined {
    pub table: Table,
    /// The joined files, for the report.
    pub files: String,
    /// How they were joined, as the end of a sentence.
    pub in_words: String,
}

impl Recording {
    /// Returns true if the names of its files are those of several measured quantities.
    pub fn has_channels(&self) -> bool {
        self.files.len() > 1 && self.files.iter().all(|of| guess::is_channel(&of.word))
    }
}

/// Groups files into recordings.
///
/// # Errors
/// If the paths do not show which files belong together.
pub(super) fn recordings(files: &[PathBuf]) -> Result<Vec<Recording>, DataError> {
    let mut groups: BTreeMap<String, Vec<ChannelFile>> = BTreeMap::new();
    for (index, file) in files.iter().enumerate() {
        let (key, word) = key_and_channel(file);
        groups.entry(key).or_default().push(ChannelFile { index, word });
    }
    let is_alone = groups.values().all(|group| group.len() == 1);
    if is_alone {
        // Names without a word of a channel: one recording.
        let channels = groups.into_values().flatten().collect();
        groups = BTreeMap::from([(String::new(), channels)]);
    }
    let most = groups.values().map(Vec::len).max().unwrap_or_default();
    let refused = |at: usize, found: String| {
        DataError::file(
            files[at].clone(),
            found,
            format!(
                "for {}, files of each recording whose names differ in one word: effort_1.csv, velocity_1.csv",
                Setting::Join.alone()
            ),
        )
    };
    if let Some(short) = groups.values().find(|group| group.len() < most) {
        let found = format!("{} of {most} channels of its recording", short.len());
        return Err(refused(short[0].index, found));
    }
    for group in groups.values() {
        let is_second = |(place, of): &(usize, &ChannelFile)| {
            group[..*place].iter().any(|known| known.word == of.word)
        };
        if let Some((_, ChannelFile { index, word })) = group.iter().enumerate().find(is_second) {
            return Err(refused(*index, format!("a second channel {word} of its recording")));
        }
    }
    let keys: Vec<Vec<String>> =
        groups.keys().map(|key| key.split('/').map(str::to_owned).collect()).collect();
    let common = (0..).take_while(|at| {
        let part = keys[0].get(*at);
        keys.len() > 1 && part.is_some() && keys.iter().all(|key| key.get(*at) == part)
    });
    let common = common.count();
    let name = |key: &[String], files: &[ChannelFile]| match keys.len() {
        1 => files.iter().map(|of| of.word.as_str()).collect::<Vec<_>>().join("+"),
        _ => key[common..].join("-"),
    };
    let mut found: Vec<Recording> = keys
        .iter()
        .zip(groups.into_values())
        .map(|(key, files)| Recording { name: name(key, &files), files })
        .collect();
    found.sort_by_key(|recording| recording.files[0].index);
    Ok(found)
}

/// Returns the path without the word of its channel, and this word. A path without such a word is its own channel.
fn key_and_channel(file: &Path) -> (String, String) {
    let parts: Vec<String> = file
        .with_extension("")
        .components()
        .map(|part| part.as_os_str().to_string_lossy().into_owned())
        .collect();
    for (place, part) in parts.iter().enumerate().rev() {
        let words = words(part);
        let named = words.iter().filter(|word| guess::is_channel(word));
        let Some(word) = named.max_by_key(|word| word.len()) else { continue };
        let rest = part.replacen(word.as_str(), "", 1);
        let rest = rest.trim_matches(['_', '-', '.', ' ']);
        let mut key = parts.clone();
        key[place] = rest.to_owned();
        key.retain(|part| !part.is_empty());
        return (key.join("/"), word.to_lowercase());
    }
    (parts.join("/"), parts.last().cloned().unwrap_or_default())
}

/// Returns the parts of a name that are letters alone.
fn words(name: &str) -> Vec<String> {
    let parts = name.split(|c: char| !c.is_alphabetic());
    parts.filter(|part| !part.is_empty()).map(str::to_owned).collect()
}

/// A file as a table with its clock.
struct Channel {
    file: String,
    word: String,
    time_name: Option<String>,
    /// Times in the unit of the column, from the earliest of all files; empty if the rows are counted.
    times: Vec<f64>,
    columns: Vec<(String, Cells)>,
    rows: usize,
}

/// Joins the tables of a recording, each with the word of its channel. `name` is its name in messages.
///
/// # Errors
/// If no table has a column of times, or the times do not overlap.
pub(super) fn join_tables(
    name: &str,
    tables: Vec<(String, Table)>,
    options: &ReadOptions,
) -> Result<Joined, DataError> {
    let mut channels: Vec<Channel> = tables
        .into_iter()
        .map(|(word, table)| channel(word, table, options))
        .collect::<Result<_, _>>()?;
    let files: Vec<String> = channels.iter().map(|channel| channel.file.clone()).collect();
    name_columns(&mut channels);
    let is_timed = |channel: &Channel| !channel.times.is_empty();
    if options.rate_hz.is_none() && !channels.iter().any(is_timed) {
        return Err(no_times(&channels[0]));
    }
    let is_one_length = channels.iter().all(|channel| channel.rows == channels[0].rows);
    // With a rate, the clock matters only where the lengths differ.
    let is_counted = options.rate_hz.is_some() && is_one_length;
    let rows = if is_counted || !channels.iter().all(is_timed) {
        counted_rows(&channels)?
    } else {
        matched_rows(&channels, options.max_bad_share)?
    };
    let mut columns = Vec::new();
    for (at, channel) in channels.iter_mut().enumerate() {
        for (name, cells) in std::mem::take(&mut channel.columns) {
            columns.push((name, cells.select(rows.rows.iter().map(|row| row[at]))));
        }
    }
    if let Some(time) = time_column(&channels, &rows) {
        columns.insert(0, time);
    }
    let table = Table { name: name.into(), columns };
    Ok(Joined { table, files: listed(&files), in_words: rows.in_words })
}

/// The rows of the joined table: the row of each file, if it has one there.
struct MatchedRows {
    rows: Vec<Vec<Option<usize>>>,
    in_words: String,
}

/// Returns the column of the times: the one that `--columns` names, or else the first with the name of a time.
pub(super) fn time_place(names: &[String], options: &ReadOptions) -> Option<usize> {
    let given = options.columns.iter().find(|(ours, _)| ours == TIME).map(|(_, theirs)| theirs);
    let is_given = |name: &String| given.is_some_and(|given| refers_to(given, name));
    let is_time = |name: &String| guess::quantity(name) == Some(TIME);
    names.iter().position(is_given).or_else(|| names.iter().position(is_time))
}

/// Returns the error of a file without times.
fn no_times(channel: &Channel) -> DataError {
    let names: Vec<&str> = channel.columns.iter().map(|(name, _)| name.as_str()).collect();
    let pair = Setting::Columns.suggested(format!("{TIME}=NAME"));
    let expected = format!("a column of times, as {pair}, or {}", Setting::Rate.suggested("200Hz"));
    DataError::file(&channel.file, format!("only the columns {}", listed(&names)), expected)
}

/// Splits a table into its clock and its other columns.
fn channel(word: String, table: Table, options: &ReadOptions) -> Result<Channel, DataError> {
    let Table { name: file, mut columns } = table;
    let rows = columns.first().map_or(0, |(_, cells)| cells.len());
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    // A file without a header has its times first.
    let has_no_header = columns.len() > 1 && names[0] == "1";
    let place = time_place(&names, options).or_else(|| has_no_header.then_some(0));
    let Some(place) = place else {
        return Ok(Channel { file, word, time_name: None, times: Vec::new(), columns, rows });
    };
    let (time_name, cells) = columns.remove(place);
    let times = times(&file, &time_name, &cells)?;
    Ok(Channel { file, word, time_name: Some(time_name), times, columns, rows })
}

/// Returns the times of a column in its unit, or in s for dates.
pub(super) fn times(file: &str, name: &str, cells: &Cells) -> Result<Vec<f64>, DataError> {
    let stamp = |row: usize| parse_stamp(&cells.text(row), None).ok().flatten();
    let seconds = |row: usize| stamp(row).map(|stamp| stamp.nanoseconds() as f64 / 1e9);
    let time = |row: usize| cells.number(row).or_else(|| seconds(row)).unwrap_or(f64::NAN);
    let times: Vec<f64> = (0..cells.len()).map(time).collect();
    if times.iter().any(|time| !time.is_nan()) {
        return Ok(times);
    }
    Err(DataError::file(file, format!("no time in column {name}"), "numbers or dates"))
}

/// Gives the columns of all files distinct names: a name that occurs in two files gets the word of its channel.
fn name_columns(channels: &mut [Channel]) {
    let names: Vec<Vec<String>> = channels
        .iter()
        .map(|channel| channel.columns.iter().map(|(name, _)| name.clone()).collect())
        .collect();
    for (at, channel) in channels.iter_mut().enumerate() {
        let is_alone = channel.columns.len() == 1;
        for (name, _) in &mut channel.columns {
            let is_number = name.bytes().all(|byte| byte.is_ascii_digit());
            let is_twice =
                names.iter().enumerate().any(|(of, names)| of != at && names.contains(name));
            if is_alone && (is_number || is_twice) {
                *name = channel.word.clone();
            } else if is_number || is_twice {
                *name = format!("{}_{name}", channel.word);
            }
        }
    }
}

/// Joins files row by row. Rows at the end that a shorter file does not have are left out.
fn counted_rows(channels: &[Channel]) -> Result<MatchedRows, DataError> {
    let order = |(at, channel): (usize, &Channel)| (channel.rows, at);
    let (rows, shortest) = channels.iter().enumerate().map(order).min().unwrap_or_default();
    let (most, longest) = channels.iter().enumerate().map(order).max().unwrap_or_default();
    let (shortest, longest) = (&channels[shortest].file, &channels[longest].file);
    let extra = most - rows;
    if extra as f64 > (MAX_EXTRA_SHARE * most as f64).max(MAX_EXTRA_ROWS) {
        return Err(DataError::file(
            longest,
            format!("{most} rows"),
            format!("{rows} as in {shortest}"),
        ));
    }
    let mut in_words = format!("the number of their rows: {rows} rows");
    if extra > 0 {
        in_words += &format!(", as in {shortest}; the last {extra} of {longest} are left out");
    }
    let rows: Vec<_> = (0..rows).map(|row| vec![Some(row); channels.len()]).collect();
    Ok(MatchedRows { rows, in_words })
}

/// The rows of a file that have a time, in the order of their times.
struct SortedRows {
    rows: Vec<usize>,
    times: Vec<f64>,
}

impl SortedRows {
    fn of(channel: &Channel) -> Self {
        let is_timed = |row: &usize| !channel.times[*row].is_nan();
        let mut rows: Vec<usize> = (0..channel.times.len()).filter(is_timed).collect();
        rows.sort_by(|a, b| channel.times[*a].total_cmp(&channel.times[*b]));
        let times = rows.iter().map(|row| channel.times[*row]).collect();
        Self { rows, times }
    }

    fn range(&self) -> RangeInclusive<f64> {
        self.times[0]..=self.times[self.times.len() - 1]
    }
}

/// Returns the number of rows without a time, at most `max_bad_share` of each file.
fn untimed_rows(channels: &[Channel], max_bad_share: f64) -> Result<usize, DataError> {
    let mut untimed = 0;
    for channel in channels {
        let count = channel.times.iter().filter(|time| time.is_nan()).count();
        if count as f64 > max_bad_share * channel.rows as f64 {
            let found = format!("no time in {count} of {} rows", channel.rows);
            return Err(DataError::file(&channel.file, found, "numbers or dates"));
        }
        untimed += count;
    }
    Ok(untimed)
}

/// Joins files by their times. Rows without a time, at most `max_bad_share` of a file, are left out.
fn matched_rows(channels: &[Channel], max_bad_share: f64) -> Result<MatchedRows, DataError> {
    let left_out = match untimed_rows(channels, max_bad_share)? {
        0 => String::new(),
        untimed => format!(", {untimed} rows without a time are left out"),
    };
    let sorted: Vec<SortedRows> = channels.iter().map(SortedRows::of).collect();
    let common = common_times(channels, &sorted)?;
    let steps = sorted.iter().filter_map(|of| median_step(&of.times));
    let tolerance = SAME_TIME_STEPS * steps.fold(f64::INFINITY, f64::min);
    let tolerance = if tolerance.is_finite() { tolerance } else { 0.0 };
    let within = common.start() - tolerance..=common.end() + tolerance;
    let mut rows = rows_of_equal_times(&sorted, &within, tolerance);
    let is_whole = |row: &Vec<Option<usize>>| row.iter().all(Option::is_some);
    let (all, whole) = (rows.len(), rows.iter().filter(|row| is_whole(row)).count());
    if (whole as f64) < MIN_COMMON_SHARE * all as f64 {
        let in_words = format!(
            "their times, which differ: {all} rows, {whole} of them with a value in each{left_out}"
        );
        return Ok(MatchedRows { rows, in_words });
    }
    let outside = |of: &SortedRows| of.times.iter().filter(|time| !within.contains(time)).count();
    let others = all - whole + sorted.iter().map(outside).max().unwrap_or_default();
    rows.retain(is_whole);
    let mut in_words = format!("their equal times: {whole} rows");
    if others > 0 {
        in_words += &format!(", {others} times without a row in each are left out");
    }
    Ok(MatchedRows { rows, in_words: in_words + &left_out })
}

/// Returns the rows of each time in a range, for times that differ by at most a tolerance: that of each file, if it has one.
fn rows_of_equal_times(
    sorted: &[SortedRows],
    within: &RangeInclusive<f64>,
    tolerance: f64,
) -> Vec<Vec<Option<usize>>> {
    let start = |of: &SortedRows| of.times.partition_point(|time| time < within.start());
    let mut next: Vec<usize> = sorted.iter().map(start).collect();
    let mut rows = Vec::new();
    loop {
        let heads = sorted.iter().zip(&next).filter_map(|(of, at)| of.times.get(*at).copied());
        let Some(time) = heads.min_by(f64::total_cmp).filter(|time| time <= within.end()) else {
            return rows;
        };
        let row = sorted.iter().zip(&mut next).map(|(of, next)| {
            let at = *next;
            let is_here = of.times.get(at).is_some_and(|head| *head <= time + tolerance);
            *next += usize::from(is_here);
            is_here.then(|| of.rows[at])
        });
        rows.push(row.collect());
    }
}

/// Returns the range of times that all files have.
fn common_times(
    channels: &[Channel],
    sorted: &[SortedRows],
) -> Result<RangeInclusive<f64>, DataError> {
    let ranges: Vec<RangeInclusive<f64>> = sorted.iter().map(SortedRows::range).collect();
    let from = ranges.iter().map(|of| *of.start()).fold(f64::NEG_INFINITY, f64::max);
    let to = ranges.iter().map(|of| *of.end()).fold(f64::INFINITY, f64::min);
    let shortest = ranges.iter().map(|of| of.end() - of.start()).fold(f64::INFINITY, f64::min);
    if to >= from && to - from >= MIN_OVERLAP * shortest {
        return Ok(from..=to);
    }
    let in_words = |at: usize| format!("times {} to {}", ranges[at].start(), ranges[at].end());
    let is_apart = |of: &RangeInclusive<f64>| *of.end() < from || *of.start() > to;
    let other = ranges.iter().position(is_apart).unwrap_or(1);
    let first = usize::from(other == 0);
    Err(DataError::file(
        &channels[other].file,
        in_words(other),
        format!("{} as in {}: files of one clock", in_words(first), channels[first].file),
    ))
}

/// Returns the column of times of the joined table: that of the first file, or numbers if its rows are not in all rows.
fn time_column(channels: &[Channel], rows: &MatchedRows) -> Option<(String, Cells)> {
    let name = channels.iter().find_map(|channel| channel.time_name.clone())?;
    let name = if name.bytes().all(|byte| byte.is_ascii_digit()) { "time".into() } else { name };
    let time = |row: &Vec<Option<usize>>| {
        let of =
            row.iter().zip(channels).find_map(|(row, channel)| channel.times.get((*row)?).copied());
        of.unwrap_or(f64::NAN)
    };
    Some((name, Cells::Numbers(rows.rows.iter().map(time).collect())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_with_stamps_returns_seconds() {
        let cells = Cells::Stamps(vec![Some(1_500_000_000), None]);
        let found = times("f", "t", &cells).expect("times");
        assert!(found[0] == 1.5 && found[1].is_nan(), "{found:?}");
    }
}
