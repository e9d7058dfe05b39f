//! A fleet in one table: a CSV or Parquet file with a column `joint` and, for several campaigns, `campaign`.
//!
//! The rows of each joint and campaign become a file of their own. It has the other columns of the table, so that each log is
//! read, checked and hashed as one of a folder, and a table that grows by a campaign gives the former results anew without a
//! computation. Lines of text are copied as they are.

use super::{CAMPAIGN, FleetError, FleetJob, JOINT};
use crate::ResultError;
use crate::table_file::{TableColumn, TableFile, TableFormat};
use joint_log::{Cells, Table};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Lines above the header of a text that are looked through.
const MAX_LINES_ABOVE: usize = 100;

/// Bytes of a piece that are kept in memory.
const MAX_BUFFERED: usize = 256 * 1024;

/// First bytes of a Parquet file.
const PARQUET: &[u8] = b"PAR1";

/// Names of joint and campaign.
type Names = (String, String);

/// Splits a table into one file for each joint and campaign, below `folder`.
///
/// # Errors
/// One line, if the table cannot be read or has no column `joint`, or a row names no joint.
pub fn jobs_of_table(table: &Path, folder: &Path) -> Result<Vec<FleetJob>, FleetError> {
    let failed = ResultError::of_file(table);
    let mut head = Vec::new();
    File::open(table).map_err(&failed)?.take(4096).read_to_end(&mut head).map_err(&failed)?;
    let pieces = match (head.starts_with(PARQUET), head.contains(&0)) {
        (true, _) => parquet_pieces(table, folder)?,
        (_, true) => return Err(FleetError::NoText(table.to_owned())),
        _ => text_pieces(table, folder)?,
    };
    let job = |((joint, campaign), file): (Names, PathBuf)| {
        let of = if campaign.is_empty() { String::new() } else { format!(", campaign={campaign}") };
        let addresses = vec![format!("{} (joint={joint}{of})", table.display())];
        FleetJob { joint, campaign, files: vec![file], addresses }
    };
    Ok(pieces.into_iter().map(job).collect())
}

/// Splits a table in memory, and writes each piece as Parquet.
fn parquet_pieces(table: &Path, folder: &Path) -> Result<BTreeMap<Names, PathBuf>, FleetError> {
    let read = joint_log::parquet_table(table)?;
    let place =
        |name: &str| read.columns.iter().position(|(known, _)| known.eq_ignore_ascii_case(name));
    let (joint, campaign) =
        (place(JOINT).ok_or_else(|| FleetError::NoJointColumn(table.to_owned()))?, place(CAMPAIGN));
    let rows = read.columns[joint].1.len();
    let mut of: BTreeMap<Names, Vec<usize>> = BTreeMap::new();
    for row in 0..rows {
        let name = read.columns[joint].1.text_of(row);
        if name.is_empty() {
            return Err(FleetError::UnnamedRow(table.to_owned(), row + 2));
        }
        let campaign = campaign.map_or(String::new(), |at| read.columns[at].1.text_of(row));
        of.entry((name, campaign)).or_default().push(row);
    }
    let named = [Some(joint), campaign];
    let write = |(at, (names, rows)): (usize, (Names, Vec<usize>))| {
        let content = piece(&read, &named, &rows).emit(TableFormat::Parquet)?;
        let file = folder.join(format!("{at}.parquet"));
        std::fs::write(&file, content).map_err(ResultError::of_file(&file))?;
        Ok((names, file))
    };
    of.into_iter().enumerate().map(write).collect()
}

/// Returns some rows of a table without the columns with the names.
fn piece(table: &Table, named: &[Option<usize>], rows: &[usize]) -> TableFile {
    let mut piece = TableFile::new(rows.len());
    for (at, (name, cells)) in table.columns.iter().enumerate() {
        let column = match cells {
            _ if named.contains(&Some(at)) => continue,
            Cells::Numbers(values) => {
                TableColumn::Numbers(rows.iter().map(|row| values[*row]).collect())
            }
            Cells::Unreadable { .. } => continue,
            cells => TableColumn::of_texts(rows.iter().map(|row| cells.text_of(*row)).collect()),
        };
        piece.push(name.clone(), column);
    }
    piece
}

/// The lines of one joint and campaign.
struct Piece {
    file: PathBuf,
    buffer: Vec<u8>,
}

impl Piece {
    fn flush(&mut self) -> Result<(), FleetError> {
        let file = OpenOptions::new().create(true).append(true).open(&self.file);
        file.and_then(|mut file| file.write_all(&self.buffer))
            .map_err(ResultError::of_file(&self.file))?;
        self.buffer.clear();
        Ok(())
    }
}

/// Copies the lines of a text to pieces, without the cells with the names.
fn text_pieces(table: &Path, folder: &Path) -> Result<BTreeMap<Names, PathBuf>, FleetError> {
    let failed = ResultError::of_file(table);
    let mut lines = BufReader::new(File::open(table).map_err(&failed)?);
    let (mut above, mut line) = (Vec::new(), Vec::new());
    let mut header = None;
    let mut pieces: BTreeMap<Names, Piece> = BTreeMap::new();
    let mut number = 0;
    loop {
        line.clear();
        if lines.read_until(b'\n', &mut line).map_err(&failed)? == 0 {
            break;
        }
        number += 1;
        let Some(header) = &header else {
            header = Header::parse(&line);
            above
                .extend(header.as_ref().map_or_else(|| line.clone(), |of| of.without_names(&line)));
            if header.is_none() && number == MAX_LINES_ABOVE {
                break;
            }
            continue;
        };
        if line.trim_ascii().is_empty() {
            continue;
        }
        let names =
            header.names(&line).ok_or_else(|| FleetError::UnnamedRow(table.to_owned(), number))?;
        let next = pieces.len();
        let piece = pieces.entry(names).or_insert_with(|| Piece {
            file: folder.join(format!("{next}.csv")),
            buffer: above.clone(),
        });
        piece.buffer.extend(header.without_names(&line));
        if piece.buffer.len() > MAX_BUFFERED {
            piece.flush()?;
        }
    }
    if header.is_none() {
        return Err(FleetError::NoJointColumn(table.to_owned()));
    }
    if pieces.is_empty() {
        return Err(FleetError::NoRows(table.to_owned()));
    }
    let flushed = |(names, mut piece): (Names, Piece)| piece.flush().map(|()| (names, piece.file));
    pieces.into_iter().map(flushed).collect()
}

/// Where the names are in a line of text.
struct Header {
    separator: u8,
    joint: usize,
    campaign: Option<usize>,
}

impl Header {
    /// Returns the header that a line is; `None` if it has no cell `joint`.
    fn parse(line: &[u8]) -> Option<Self> {
        b",;\t".iter().find_map(|&separator| {
            let cells: Vec<String> =
                cells(line, separator).into_iter().map(|cell| text(&line[cell])).collect();
            let place = |name: &str| {
                cells
                    .iter()
                    .position(|cell| cell.trim_start_matches('\u{feff}').eq_ignore_ascii_case(name))
            };
            let joint = place(JOINT).filter(|_| cells.len() > 1)?;
            Some(Self { separator, joint, campaign: place(CAMPAIGN) })
        })
    }

    /// Returns the names in a line; `None` if the line has no joint.
    fn names(&self, line: &[u8]) -> Option<Names> {
        let cells = cells(line, self.separator);
        let name = |at: usize| cells.get(at).map(|cell| text(&line[cell.clone()]));
        let joint = name(self.joint).filter(|name| !name.is_empty())?;
        Some((joint, self.campaign.and_then(name).unwrap_or_default()))
    }

    /// Returns a line without the cells with the names.
    fn without_names(&self, line: &[u8]) -> Vec<u8> {
        let cells = cells(line, self.separator).into_iter().enumerate();
        let kept = cells.filter(|(at, _)| *at != self.joint && Some(*at) != self.campaign);
        let kept: Vec<&[u8]> = kept.map(|(_, cell)| &line[cell]).collect();
        let mut line = kept.join(&self.separator);
        line.push(b'\n');
        line
    }
}

/// Returns the places of a line's cells. A separator between quotes is a part of its cell.
fn cells(line: &[u8], separator: u8) -> Vec<Range<usize>> {
    let end = line.trim_ascii_end().len();
    // A separator at the end may be white space: the tab before an empty cell.
    let end = if separator == b'\t' { line.len() - line_end(line) } else { end };
    let (mut start, mut is_quoted) = (0, false);
    let mut found = Vec::new();
    for (at, &byte) in line[..end].iter().enumerate() {
        is_quoted ^= byte == b'"';
        if byte == separator && !is_quoted {
            found.push(start..at);
            start = at + 1;
        }
    }
    found.push(start..end);
    found
}

/// Returns the number of bytes of the line's end.
fn line_end(line: &[u8]) -> usize {
    line.iter().rev().take_while(|&&byte| byte == b'\n' || byte == b'\r').count()
}

/// Returns the text of a cell.
fn text(cell: &[u8]) -> String {
    let text = String::from_utf8_lossy(cell);
    let text = text.trim();
    match text.strip_prefix('"').and_then(|text| text.strip_suffix('"')) {
        Some(inner) => inner.replace("\"\"", "\"").trim().to_owned(),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot;

    /// Returns joint, campaign and content of each piece of a text.
    fn pieces(content: &str) -> Result<Vec<(String, String, String)>, FleetError> {
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("table.csv");
        std::fs::write(&table, content).unwrap();
        let jobs = jobs_of_table(&table, folder.path())?;
        let content = |job: &FleetJob| std::fs::read_to_string(&job.files[0]).unwrap();
        Ok(jobs.iter().map(|job| (job.joint.clone(), job.campaign.clone(), content(job))).collect())
    }

    #[test]
    fn jobs_of_text_table_copy_the_other_columns() {
        let found = pieces(
            "# bench 3\ntime_s;Joint;torque_nm;campaign\n0,1;\"hip; left\";1,5;1\n0,2;knee;2,5;1\n\n0,3;knee;3,5;2\n",
        );
        let piece = |joint: &str, campaign: &str, row: &str| {
            (joint.into(), campaign.into(), format!("# bench 3\ntime_s;torque_nm\n{row}\n"))
        };
        assert_eq!(
            found.unwrap(),
            [
                piece("hip; left", "1", "0,1;1,5"),
                piece("knee", "1", "0,2;2,5"),
                piece("knee", "2", "0,3;3,5")
            ]
        );
        let error = pieces("time_s,torque_nm\n0,1\n").unwrap_err().to_string();
        assert!(error.contains("table.csv: ") && error.contains("joint"), "{error}");
        let unnamed = pieces("joint,torque_nm\nhip,1\n,1\n").unwrap_err().to_string();
        assert!(unnamed.contains("row 3: ") && unnamed.contains("joint"), "{unnamed}");
        snapshot::check("fleet", "tables without a joint", &(error + "\n" + &unnamed));
    }

    #[test]
    fn jobs_of_parquet_table_keep_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let mut written = TableFile::new(3);
        let texts = |of: [&str; 3]| TableColumn::of_texts(of.map(str::to_owned).to_vec());
        written.push("joint", texts(["knee", "hip", "knee"]));
        written.push("campaign", TableColumn::Numbers(vec![1.0, 1.0, 2.0]));
        written.push("torque_nm", TableColumn::Numbers(vec![0.1, f64::NAN, 1.0 / 3.0]));
        let table = folder.path().join("table.parquet");
        std::fs::write(&table, written.emit(TableFormat::Parquet).unwrap()).unwrap();
        let jobs = jobs_of_table(&table, folder.path()).unwrap();
        let names: Vec<(&str, &str)> =
            jobs.iter().map(|job| (&*job.joint, &*job.campaign)).collect();
        assert_eq!(names, [("hip", "1"), ("knee", "1"), ("knee", "2")]);
        let last = joint_log::parquet_table(&jobs[2].files[0]).unwrap();
        assert_eq!(last.columns, [("torque_nm".into(), Cells::Numbers(vec![1.0 / 3.0]))]);
        assert!(jobs[2].addresses[0].ends_with("table.parquet (joint=knee, campaign=2)"));
    }
}
