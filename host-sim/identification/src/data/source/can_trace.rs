//! CAN logs, made into rows.
//!
//! What [`joint_trace`] puts together goes through the same `clean` as the rows of a CSV file, under the
//! names of the contract; the row of a message is the line of the sample's SYNC. Which columns a joint
//! measures shows only in the data, so the log is read twice: once to see, once to take. The driver's
//! answers are no measurement and stay out, or a model would be judged by what another one said.

use std::borrow::Cow;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::{Input, Source};
use crate::data::clean::{Cleaner, FileData, MAX_BAD_SHARE, Row};
use crate::data::dataset::LeftOutColumn;
use crate::data::error::{BadCell, BadRows, DataError, NAMED_BAD_ROWS, listed, quoted};
use crate::data::header::layout;
use compensator_core::quantity::Quantity;
use joint_trace::{
    Assembler, Census, Frames, LineError, Summary, TextFormat, TextReader, TraceSample,
};

/// Lines between two calls of the progress function.
const PROGRESS_LINES: u64 = 64 * 1024;

/// Longer than any line of such a log.
const LONGEST_LINE: u64 = 4096;

/// What `candump -L`, Vector's and PEAK's tools write.
pub(super) const SOURCE: Source = Source { is_it: is_trace, read };

/// Whether a file that begins so is a CAN log.
fn is_trace(head: &[u8]) -> bool {
    TextFormat::of(head).is_some()
}

/// A column of the table a log is made into.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Column {
    Run,
    Time,
    Measured(Quantity),
}

/// A sample as a row of that table.
struct TraceRow<'a> {
    sample: &'a TraceSample,
    time_s: f64,
    columns: &'a [Column],
}

impl Row for TraceRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        match self.columns.get(column)? {
            Column::Run => self.sample.run.map(f64::from),
            Column::Time => Some(self.time_s),
            Column::Measured(quantity) => Some(f64::from(self.sample.get(*quantity))),
        }
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        let text = match (self.columns.get(column), self.number(column), &self.sample.fault) {
            (Some(Column::Run), _, _) => {
                self.sample.run.map(|run| run.to_string()).unwrap_or_default()
            }
            (_, Some(value), Some(fault)) if value.is_nan() => fault.to_string(),
            (_, Some(value), None) if value.is_nan() => "no frame of it".to_owned(),
            (_, value, _) => value.map(|value| value.to_string()).unwrap_or_default(),
        };
        Cow::Owned(text.into_bytes())
    }
}

/// What the first reading shows.
struct Overview {
    summary: Summary,
    columns: Vec<Column>,
    /// Stamp the time counts from, ns: the first sample's.
    origin_ns: u64,
    /// Lines that begin as one of a frame and are none; the first few by name.
    bad: BadRows,
    /// Lines that are something else: remarks, what candump says of dropped frames.
    remarks: u64,
}

fn read(input: Input) -> Result<FileData, DataError> {
    let Input { path, mut file, head, size, options, progress } = input;
    let format = TextFormat::of(head).unwrap_or_default();
    let overview = look(path, &mut file, format, &|bytes| progress(bytes / 2))?;
    let kind = overview.summary.kind;
    let name = |column: &Column| match column {
        Column::Run => "run",
        Column::Time => "time_s",
        Column::Measured(quantity) => quantity.name(kind),
    };
    let columns = &overview.columns;
    let names = columns.iter().map(|column| name(column).to_owned()).collect();
    let mut cleaner = Cleaner::new(path, layout(path, names, options)?);
    for bad in &overview.bad.first {
        cleaner.leave_out(bad.row, None, bad.found.clone(), &bad.expected);
    }
    let second_half = |bytes| progress((size + bytes) / 2);
    each_sample(
        path,
        &mut file,
        format,
        &second_half,
        |_| {},
        |sample| {
            // Signed, for the clock may have been set back. A division, so that a millisecond is the
            // number 0.001 and not one beside it.
            let since_ns = i128::from(sample.time_ns) - i128::from(overview.origin_ns);
            let time_s = since_ns as f64 / 1e9;
            cleaner.take(sample.line, &TraceRow { sample, time_s, columns })
        },
    )?;
    let mut data = cleaner.finish()?;
    data.bad.count += overview.bad.count - overview.bad.first.len();
    tell(path, &overview, &mut data);
    Ok(data)
}

/// What is worth knowing of a log beside its rows.
fn tell(path: &Path, overview: &Overview, data: &mut FileData) {
    let (file, summary) = (path.display(), &overview.summary);
    if summary.answers > 0 {
        for name in ["friction_torque_nm", "feed_forward_current_a", "flags"] {
            let why = "it is the driver's answer and no measurement".into();
            data.left_out.push(LeftOutColumn { name: name.into(), why });
        }
    }
    if summary.lost > 0 {
        let lost = summary.lost;
        data.notes.push(format!("{file}: {lost} samples are missing by the count of the SYNCs"));
    }
    if summary.errors > 0 {
        data.notes.push(format!("{file}: {} error frames are passed over", summary.errors));
    }
    if overview.remarks > 0 {
        data.notes.push(format!("{file}: {} lines are no frames", overview.remarks));
    }
}

/// The first reading.
fn look(
    path: &Path,
    file: &mut File,
    format: TextFormat,
    progress: &dyn Fn(u64),
) -> Result<Overview, DataError> {
    let (mut bad, mut remarks) = (BadRows::default(), 0);
    let mut seen = [false; Quantity::ALL.len()];
    let (mut has_runs, mut origin_ns) = (false, None);
    let aside = |aside: Aside| match aside {
        Aside::Remark => remarks += 1,
        Aside::Bad { row, line, error } => {
            bad.count += 1;
            if bad.first.len() < NAMED_BAD_ROWS {
                let (column, found) = ("(all)".into(), quoted(line));
                let expected = error.expected().into();
                bad.first.push(BadCell { file: path.into(), row, column, found, expected });
            }
        }
    };
    let summary = each_sample(path, file, format, progress, aside, |sample| {
        for (seen, quantity) in seen.iter_mut().zip(Quantity::ALL) {
            *seen |= !sample.get(*quantity).is_nan();
        }
        has_runs |= sample.run.is_some();
        origin_ns.get_or_insert(sample.time_ns);
        Ok(())
    })?;
    let rows = summary.frames as usize + bad.count;
    if bad.count as f64 > MAX_BAD_SHARE * rows as f64 {
        let (first, bad) = (bad.first[0].clone(), bad.count);
        return Err(DataError::TooManyBad { first, bad, rows });
    }
    let wrong = |found: String, expected: &str| {
        Err(DataError::File { file: path.into(), found, expected: expected.into() })
    };
    if !summary.others.is_empty() {
        let all = summary.joint.iter().chain(&summary.others);
        let all: Vec<String> = all.map(|(bus, node)| format!("{node} on {bus}")).collect();
        let found = format!("inputs of the joints {}", listed(&all));
        return wrong(found, "those of one joint: cut its frames and the SYNC out with grep");
    }
    let is_seen = |quantity: Quantity| seen[quantity as usize];
    let complete = is_seen(Quantity::Velocity) && is_seen(Quantity::Torque);
    let Some(origin_ns) = origin_ns.filter(|_| complete) else {
        let io = |source| DataError::Io { file: path.into(), source };
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let census = Census::of(BufReader::new(&*file)).map_err(io)?;
        let found = format!("{census} and no joint's velocity and torque");
        let expected = "Motion (480 + node), Torque (680 + node) and the SYNC (080) of joint.dbc";
        return wrong(found, expected);
    };
    let quantities = Quantity::ALL.iter().copied().filter(|of| is_seen(*of)).map(Column::Measured);
    let run = has_runs.then_some(Column::Run);
    let columns = run.into_iter().chain([Column::Time]).chain(quantities).collect();
    Ok(Overview { summary, columns, origin_ns, bad, remarks })
}

/// A line that is no frame.
enum Aside<'a> {
    /// It begins as one.
    Bad { row: u64, line: &'a [u8], error: LineError },
    /// It does not.
    Remark,
}

/// Walks the file from its start and hands out its samples, and the lines that are no frames.
fn each_sample(
    path: &Path,
    file: &mut File,
    format: TextFormat,
    progress: &dyn Fn(u64),
    mut aside: impl FnMut(Aside),
    mut sink: impl FnMut(&TraceSample) -> Result<(), DataError>,
) -> Result<Summary, DataError> {
    let io = |source| DataError::Io { file: path.into(), source };
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut reader = BufReader::with_capacity(1 << 20, file);
    let mut assembler = Assembler::default();
    let mut lines = TextReader::new(format);
    let mut line = Vec::with_capacity(256);
    let (mut row, mut bytes) = (0u64, 0u64);
    loop {
        let is_rest = line.len() as u64 == LONGEST_LINE && !line.ends_with(b"\n");
        line.clear();
        // A file of one endless line must not be held; what follows the part that was is skipped.
        let read = reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).map_err(io)?;
        if read == 0 {
            break;
        }
        bytes += read as u64;
        if is_rest {
            continue;
        }
        row += 1;
        if row.is_multiple_of(PROGRESS_LINES) {
            progress(bytes);
        }
        match lines.read(&line) {
            Frames::Line(frame) => {
                if let Some(sample) = assembler.take(row, &frame) {
                    sink(&sample)?;
                }
            }
            Frames::Bad(error) => aside(Aside::Bad { row, line: line.trim_ascii(), error }),
            // Vector's and PEAK's tools write much beside frames, and head their files.
            Frames::None if format == TextFormat::Candump && !line.trim_ascii().is_empty() => {
                aside(Aside::Remark);
            }
            Frames::None => {}
        }
    }
    let (last, summary) = assembler.finish();
    if let Some(sample) = last {
        sink(&sample)?;
    }
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_known_by_its_first_line() {
        for log in [
            "(1436509052.249713) vcan0 044#2A366C2BBA\n",
            "\n# a remark\n  (0.5) can0 123#R\n",
            "(1436509052.249713) vcan0 044#2A36",
            "(1436509052.249713) can0 rubbish\n",
        ] {
            assert!(is_trace(log.as_bytes()), "{log}");
        }
        for other in ["", "time_s,velocity_rad_s\n", "(a),b\n1,2\n", "(1,2)\n", "PAR1"] {
            assert!(!is_trace(other.as_bytes()), "{other}");
        }
    }
}
