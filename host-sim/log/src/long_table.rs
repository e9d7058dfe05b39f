//! Long tables: a line for each value, with its time and the name of what is measured.
//!
//! Time-series databases, historians and loggers of PLCs write them, some with units and tags. The table with a column for each
//! name is made of one and read as any other. A row holds the values of one time stamp. Series with stamps of their own leave
//! cells empty, which `close` treats as in every log with merged channels.

use super::contract::{self, RUN, TIME};
use super::join::{time_place, times};
use super::name_words::{DATE_NAMES, JOINT_NAMES, is_among, parts};
use super::options::{ReadOptions, refers_to};
use super::size::time_unit;
use super::table::{Cells, Table};
use super::unit;
use std::cmp::{Ordering, Reverse};
use std::collections::HashMap;
use std::hash::Hash;

/// Words of a column with the names of what is measured.
const NAME_WORDS: &str = "name names tagname varname field key variable var signal tag channel topic metric parameter param \
                          sensor point item series measurement label path node quantity property symbol attribute id kanal";

/// Words of a column with the values.
const VALUE_WORDS: &str = "value values val wert valeur valor varvalue reading data";

/// Words of a column with the units of the values.
const UNIT_WORDS: &str = "unit units uom einheit unite egu";

/// Columns of WinCC: the names, and a time in millionths of a day beside one in seconds.
const WINCC_NAME: &str = "VarName";
const WINCC_TIME: &str = "Time_ms";
const WINCC_UNIT: &str = "0.0864s";

/// Maximum number of names. More indicate that the column holds something else.
const MAX_NAMES: usize = 1000;

/// Maximum number of rows of a long table whose header does not name the columns, as a share of its lines.
const MAX_UNNAMED_SHARE: f64 = 0.6;

/// Minimum number of samples of a series before a time near its start is that of another recording.
const MIN_SAMPLES: usize = 10;

/// The columns of a table that is long by its header.
#[derive(Clone, Debug)]
pub(super) struct LongTable {
    time: usize,
    /// Columns that may hold the names, or a part of them.
    names: Vec<usize>,
    /// Columns that may hold the values.
    values: Vec<usize>,
    /// True if the header names both.
    is_named: bool,
    units: Option<usize>,
    /// Columns that tell rows of equal times apart: runs and joints.
    keys: Vec<usize>,
    /// How the table with a column for each name is to be read.
    pub options: ReadOptions,
}

impl LongTable {
    /// Returns the columns of a table that may be long by its header.
    pub fn find(header: &[String], options: &ReadOptions) -> Option<Self> {
        let has =
            |at: &usize, words: &str| parts(&header[*at]).iter().any(|part| is_among(words, part));
        let is_key = |at: &usize| {
            let name = header[*at].trim().to_lowercase();
            // `data` is a date in Italian, and the value in a log of topics.
            let is_date = DATE_NAMES.contains(&&*name) && !has(at, VALUE_WORDS);
            name == RUN || is_among(JOINT_NAMES, &name) || is_date
        };
        let place = |name: &str| header.iter().position(|of| of == name);
        let fine = place(WINCC_TIME).filter(|_| place(WINCC_NAME).is_some());
        let time = fine.or_else(|| time_place(header, options))?;
        let (keys, others): (Vec<usize>, Vec<usize>) =
            (0..header.len()).filter(|at| *at != time).partition(is_key);
        let units = others.iter().copied().find(|at| has(at, UNIT_WORDS));
        let (values, others): (Vec<usize>, Vec<usize>) =
            others.into_iter().filter(|at| Some(*at) != units).partition(|at| has(at, VALUE_WORDS));
        let (names, others): (Vec<usize>, Vec<usize>) =
            others.into_iter().partition(|at| has(at, NAME_WORDS));
        let is_named = !values.is_empty() && !names.is_empty();
        // The third column of three is known by its values.
        let is_long = is_named || header.len() == 3 && names.len() + values.len() == 1;
        let either = |found: Vec<usize>| if found.is_empty() { others.clone() } else { found };
        let (names, values) = (either(names), either(values));
        is_long.then_some(Self {
            time,
            names,
            values,
            is_named,
            units,
            keys,
            options: options.clone(),
        })
    }

    /// Returns the options with the column of the times, in the unit of its name or of its rate.
    pub fn with_time(&self, table: &Table, wide: &WideTable) -> ReadOptions {
        let mut options = self.options.clone();
        let (header, cells) = &table.columns[self.time];
        let is_given = options.columns.iter().any(|(ours, _)| ours == TIME);
        if is_given || header == TIME || options.rate_hz.is_some() || options.preset.is_some() {
            return options;
        }
        let is_wincc = header == WINCC_TIME && table.columns.iter().any(|(of, _)| of == WINCC_NAME);
        let has_numbers = (0..cells.len()).any(|row| is_number(cells, row));
        let by_rate = || time_unit(&wide.times).filter(|_| has_numbers);
        let unit = is_wincc.then_some(WINCC_UNIT).or_else(|| unit::stated(TIME, header));
        let unit = unit.or_else(by_rate).map_or_else(String::new, |unit| format!(":{unit}"));
        options.columns.push((TIME.to_owned(), format!("{header}{unit}")));
        options
    }

    /// Makes a column of each name. Returns `None` if the names are not those of several series.
    pub fn widen(&self, table: &Table) -> Option<WideTable> {
        let cells = |at: usize| &table.columns[at].1;
        let count = cells(self.time).len();
        let text = |at: usize, row: usize| cells(at).text_of(row);
        let numbers = |at: &usize| (0..count).filter(|row| is_number(cells(*at), *row)).count();
        let value = self.values.iter().copied().rev().max_by_key(numbers)?;
        let (names, name_column, series_of) = self.series(table, count)?;
        if name_column == value {
            return None;
        }
        let key = |row| self.keys.iter().map(|at| text(*at, row)).collect::<Vec<_>>();
        let (keys, _) = indices((0..count).map(key));
        let times = times(&table.name, TIME, cells(self.time)).unwrap_or_else(|_| {
            let (order, _) = indices((0..count).map(|row| text(self.time, row)));
            order.into_iter().map(|at| at as f64).collect()
        });
        let mut series: HashMap<(usize, usize), Series> = HashMap::new();
        let mut sample = |row: usize| {
            let (key, name) = (keys[row], series_of[row]);
            let (recording, time, repeat) = series.entry((key, name)).or_default().add(times[row]);
            Sample { order: (recording, time, key, repeat), name, row }
        };
        let mut samples: Vec<Sample> = (0..count).map(&mut sample).collect();
        samples.sort_by(|a, b| a.order.partial_cmp(&b.order).unwrap_or(Ordering::Equal));
        let rows: Vec<&[Sample]> = samples.chunk_by(|a, b| a.order == b.order).collect();
        // A state beside one measurement has each time once.
        if !self.is_named && rows.len() as f64 > MAX_UNNAMED_SHARE * samples.len() as f64 {
            return None;
        }
        let first: Vec<usize> = rows.iter().map(|row| row[0].row).collect();
        let is_kept = |at: &usize| {
            let is_same = |one: usize, other: usize| cells(*at).text(one) == cells(*at).text(other);
            let is_of_row = |row: &&[Sample]| row.iter().all(|of| is_same(of.row, row[0].row));
            let has_role = *at == value || self.names.contains(at) || Some(*at) == self.units;
            let varies = || !first.iter().all(|row| is_same(*row, first[0]));
            *at == self.time
                || self.keys.contains(at)
                || !has_role && varies() && rows.iter().all(is_of_row)
        };
        let kept = (0..table.columns.len()).filter(is_kept).map(|at| {
            let cells = cells(at).select(first.iter().map(|row| Some(*row)));
            (table.columns[at].0.clone(), cells)
        });
        let series = names.iter().enumerate().map(|(at, name)| {
            let row_of = |row: &&[Sample]| row.iter().find(|of| of.name == at).map(|of| of.row);
            (name.clone(), cells(value).select(rows.iter().map(row_of)))
        });
        let columns = kept.chain(series).collect();
        let times = (0..count).filter(|row| series_of[*row] == 0).map(|row| times[row]).collect();
        let table = Table { name: table.name.clone(), columns };
        Some(WideTable { table, first, times, columns: [name_column, value] })
    }

    /// Returns the names of the series, the column that holds most of them, and the series of each row.
    fn series(&self, table: &Table, count: usize) -> Option<(Vec<String>, usize, Vec<usize>)> {
        let text = |at: usize, row: usize| table.columns[at].1.text_of(row);
        let of_column = |at: usize| indices((0..count).map(|row| text(at, row))).1.len();
        let is_possible =
            |distinct: usize| (2..=MAX_NAMES).contains(&distinct) && 2 * distinct <= count;
        let sizes = self.names.iter().map(|at| (of_column(*at), *at));
        let mut sizes: Vec<(usize, usize)> = sizes.filter(|(size, _)| is_possible(*size)).collect();
        let is_words = |at: usize| !(0..count).all(|row| is_number(&table.columns[at].1, row));
        if !self.is_named || sizes.iter().any(|(_, at)| is_words(*at)) {
            sizes.retain(|(_, at)| is_words(*at));
        }
        let &(mut size, most) = sizes.iter().max_by_key(|(size, at)| (*size, Reverse(*at)))?;
        let mut parts = vec![most];
        for (_, at) in sizes.into_iter().filter(|(_, at)| *at != most) {
            let with = |row: usize| parts.iter().chain([&at]).map(|at| text(*at, row)).collect();
            let (_, found) = indices::<Vec<String>>((0..count).map(with));
            // Another name of each series, as an address, tells no more of them apart.
            if found.len() > size && is_possible(found.len()) {
                size = found.len();
                parts.push(at);
            }
        }
        parts.sort_unstable();
        let parts: Vec<(usize, bool)> = parts.into_iter().map(|at| (at, is_words(at))).collect();
        let name = |row: usize| {
            let words = parts.iter().map(|(at, is_words)| match text(*at, row) {
                number if !is_words => format!("{}_{number}", table.columns[*at].0),
                word => word,
            });
            words.collect::<Vec<_>>().join("/")
        };
        let (series, names) = indices((0..count).map(name));
        let unit = |at: usize| text(self.units?, series.iter().position(|of| *of == at)?).into();
        let units: Vec<Option<String>> = (0..names.len()).map(unit).collect();
        Some((self.column_names(names, &units), most, series))
    }

    /// Returns the names of the columns: without the path that all names share, and with units, unless `--columns` refers to a
    /// name.
    fn column_names(&self, names: Vec<String>, units: &[Option<String>]) -> Vec<String> {
        let is_mapped =
            |name: &str| self.options.columns.iter().any(|(_, theirs)| refers_to(theirs, name));
        let is_path = |length: &usize| {
            let of_first = names[0].get(..*length);
            of_first.is_some_and(|path| path.ends_with(['/', '.']))
                && names.iter().all(|name| name.len() > *length && name.get(..*length) == of_first)
        };
        let path = (1..names[0].len()).rev().find(is_path).unwrap_or(0);
        let path = if names.iter().any(|name| is_mapped(name)) { 0 } else { path };
        let named = names.iter().zip(units).map(|(name, unit)| {
            let short = &name[path..];
            let is_known = contract::names().any(|known| known == short) || is_mapped(short);
            match unit.as_deref().map(str::trim).filter(|unit| !is_known && unit::is_symbol(unit)) {
                Some(unit) => format!("{short} [{unit}]"),
                None => short.to_owned(),
            }
        });
        named.collect()
    }
}

/// The table with a column for each name.
pub(super) struct WideTable {
    pub table: Table,
    /// The first row of the long table in each of its rows.
    pub first: Vec<usize>,
    /// The times of the first series, in the unit of their column.
    times: Vec<f64>,
    /// The columns of the names and of the values.
    pub columns: [usize; 2],
}

/// A value: its place among the rows, its series and its row in the long table.
struct Sample {
    /// Recording, time, run or joint, and the number of values of the series at this time before it.
    order: (usize, f64, usize, usize),
    name: usize,
    row: usize,
}

/// The samples of a series so far.
#[derive(Default)]
struct Series {
    recording: usize,
    first: f64,
    last: f64,
    samples: usize,
    repeat: usize,
}

impl Series {
    /// Returns the recording of the next sample, its time, and the number of samples with this time before it.
    fn add(&mut self, time: f64) -> (usize, f64, usize) {
        // A row with an invalid time is rejected later.
        let time = if time.is_nan() { self.last } else { time };
        let is_restart = time - self.first < 0.5 * (self.last - self.first);
        if is_restart && self.samples >= MIN_SAMPLES {
            (self.recording, self.samples) = (self.recording + 1, 0);
        }
        self.repeat = if self.samples > 0 && time == self.last { self.repeat + 1 } else { 0 };
        if self.samples == 0 {
            (self.first, self.last) = (time, time);
        }
        self.last = self.last.max(time);
        self.samples += 1;
        (self.recording, time, self.repeat)
    }
}

fn is_number(cells: &Cells, row: usize) -> bool {
    cells.number(row).is_some()
}

/// Returns the index of each item among the distinct ones, and these in the order of their first occurrence.
fn indices<T: Clone + Eq + Hash>(items: impl Iterator<Item = T>) -> (Vec<usize>, Vec<T>) {
    let (mut known, mut distinct) = (HashMap::new(), Vec::new());
    let of = items.map(|item| {
        *known.entry(item).or_insert_with_key(|item| {
            distinct.push(item.clone());
            distinct.len() - 1
        })
    });
    (of.collect(), distinct)
}
