//! Notes on what became of a file's columns and rows.

use super::ChannelLayout;
use crate::clean::Cleaner;
use crate::clock;
use crate::columns::ColumnUse;
use crate::contract::{RUN, TIME};
use crate::counter::unsigned_bits;
use crate::dataset::{LeftOutColumn, Run};
use crate::error::DataError;
use crate::fill::Fill;
use crate::order::MIN_PAUSE_S;
use crate::setting::Setting;

impl Cleaner<'_> {
    /// Refuses signed values that the log holds as unsigned counters, with the option to type.
    pub(super) fn check_signs(&self) -> Result<(), DataError> {
        // A position may wrap at the range of its counter.
        let first = if self.layout.is_position { 2 } else { 1 };
        for at in first..3 {
            let reading = self.layout.required[at];
            let runs = self.runs.iter().map(|run| run.required[at].as_slice());
            let Some(bits) = unsigned_bits(runs, reading.conversion) else { continue };
            let column = &self.layout.names[reading.index];
            let mut sources = self.layout.sources.iter();
            let source = sources.find(|of| &of.header == column && of.name != TIME);
            let name = source.map_or("torque_nm", |source| &source.name);
            let unit = source.and_then(|source| source.unit.as_ref());
            let with_scale = match unit {
                Some(_) => String::new(),
                None => {
                    let example = if at == 1 { "0.01rpm" } else { "0.01Nm" };
                    format!(", followed by the value of a count, as int{bits} {example}")
                }
            };
            let unit = unit.map_or_else(String::new, |unit| format!(" {unit}"));
            let pair = format!("{name}={column}:int{bits}{unit}");
            return Err(DataError::request(
                format!("{}: column {column}", self.file.display()),
                format!("jumps by nearly 2^{bits} counts: negative values without their sign"),
                Setting::Columns.suggested(pair) + &with_scale,
            ));
        }
        Ok(())
    }

    /// Adds notes on the columns that are left out or filled.
    pub(super) fn add_column_notes(
        &mut self,
        uses: &[ColumnUse],
        filled: &[Option<(usize, Fill)>],
        clean: &[Run],
    ) {
        let is_label = |name: &String| {
            clean.iter().all(|run| run.labels.iter().any(|(label, _)| label == name))
        };
        let file = self.file.display();
        for (at, (column, column_use)) in self.layout.optional.iter().zip(uses).enumerate() {
            let (name, header) = (&column.name, &self.layout.names[column.reading.index]);
            let tally = &self.tallies[at];
            if let Some((_, method)) = filled[at] {
                let (numbers, rows) = (tally.numbers, self.rows);
                let description = method.description();
                let text = match &tally.first_text {
                    Some(cell) => format!("; row {} holds {}", cell.row, cell.found),
                    None => String::new(),
                };
                let count = format!("{name} is in {numbers} of {rows} rows");
                self.layout.notes.push(format!("{file}: {count} and is {description}{text}"));
            }
            let is_reported = self.layout.left_out.iter().any(|column| column.name == *header);
            let why = match column_use {
                ColumnUse::Numeric => continue,
                ColumnUse::Empty if is_reported => continue,
                ColumnUse::Empty => "it holds no value",
                ColumnUse::Text if is_label(name) => "it is text (kept as a label of each run)",
                ColumnUse::Text => "it is text that changes inside a run",
            };
            self.layout.left_out.push(LeftOutColumn { name: header.clone(), why: why.into() });
        }
        let lost = self.layout.optional.iter().zip(uses);
        let lost = lost.filter(|(column, of)| column.is_mapped && **of == ColumnUse::Empty);
        for (column, _) in lost {
            let (name, header) = (&column.name, &self.layout.names[column.reading.index]);
            let asked = format!("--columns {name}={header}");
            self.layout
                .notes
                .push(format!("{file}: {asked}: {name} is left out, as {header} holds no value"));
        }
    }

    /// Adds notes on the rows that are not in the data, and on the clock.
    pub(super) fn add_row_notes(
        &mut self,
        channels: ChannelLayout,
        other_rows: usize,
        extra_recordings: usize,
    ) {
        if self.unselected_rows > 0 {
            let asked =
                self.layout.only.iter().map(|only| {
                    format!("{}={}", self.layout.names[only.index], only.values.join(","))
                });
            let asked: Vec<String> = asked.collect();
            self.note(format!("{} rows are not of {}", self.unselected_rows, asked.join(" and ")));
        }
        if let Some(origin) = self.clock.origin_ns {
            self.note(format!("times count from {}", clock::format_origin(origin)));
        }
        if let Some(dates) = self.layout.dates.filter(|_| self.clock.is_dated) {
            self.note(format!("the dates of the times are from {}", self.layout.names[dates]));
        }
        if self.layout.is_position {
            self.note("no velocity is logged: it is the difference of the positions");
        }
        match channels {
            ChannelLayout::Merged => self.note(format!(
                "velocity and torque have separate time stamps: {other_rows} rows without a torque are ignored, and \
                 the velocity is interpolated in time at the rows with a torque"
            )),
            ChannelLayout::SeparateCovariates => self.note(format!(
                "{other_rows} rows hold neither velocity nor torque, only columns with separate time stamps"
            )),
            ChannelLayout::Single => {}
        }
        if extra_recordings > 0 {
            self.note(format!(
                "there is no column {RUN}: the file is split into {} runs, at pauses of more than {MIN_PAUSE_S} s and \
                 where the clock restarts",
                extra_recordings + 1,
            ));
        }
    }

    /// Adds notes on rows with equal time stamps, of which some were spread, on rows that occur twice, and on rows that were
    /// sorted.
    pub(super) fn add_order_notes(
        &mut self,
        late: usize,
        duplicates: usize,
        repeated: usize,
        spread: usize,
    ) {
        let rows = self.rows;
        if spread > 0 {
            self.note(format!(
                "{spread} rows repeat the time stamp before them: the rows of a stamp are spread evenly up to the next"
            ));
        }
        let repeated = repeated.saturating_sub(spread);
        if repeated > 0 {
            self.note(format!("{repeated} rows repeat the time stamp before them and are kept"));
        }
        if duplicates > 0 {
            self.note(format!(
                "{duplicates} of {rows} rows repeat an earlier row in all columns and are left out"
            ));
        }
        if late > 0 {
            self.note(format!(
                "{late} of {rows} rows come after a later one: the rows are sorted by time"
            ));
        }
    }
}
