//! Detection of files that are often given as logs but are not supported, with the command that converts each.

use super::encoding::without_mark;
use super::json_document;
use super::sysid::is_sysid;

/// A file that is not supported: what it is, and what is expected. FILE stands for its path.
type Refusal = (&'static str, &'static str);

/// Archives that are unpacked, and therefore refused only inside another archive.
const PACKED: &[(&[u8], Refusal)] = &[
    (&[0x1f, 0x8b], ("a gzip archive", "a log that is packed once: gunzip FILE")),
    (b"PK\x03\x04", ("a zip archive", "a log that is packed once: unzip FILE")),
];

/// Files that are known by their first bytes.
const KNOWN: &[(&[u8], Refusal)] = &[
    (&[0x28, 0xb5, 0x2f, 0xfd], ("a zstd archive", "a CSV or Parquet file: unzstd FILE")),
    (b"\xfd7zXZ", ("an xz archive", "a CSV or Parquet file: unxz -k FILE")),
    (b"BZh", ("a bzip2 archive", "a CSV or Parquet file: bunzip2 -k FILE")),
    (b"7z\xbc\xaf\x27\x1c", ("a 7z archive", "a CSV or Parquet file: 7z x FILE")),
    (
        b"\x89HDF",
        (
            "an HDF5 file (or a MAT file of version 7.3)",
            "a CSV or Parquet file: python -c \"import pandas; pandas.read_hdf('FILE').to_parquet('log.parquet')\", or \
             writetable in MATLAB",
        ),
    ),
    (
        b"MATLAB 5.0 MAT-file",
        (
            "a MAT file",
            "a CSV or Parquet file: writetable(struct2table(load('FILE')), 'log.csv') in MATLAB",
        ),
    ),
    (
        b"\x93NUMPY",
        (
            "a NumPy array",
            "a CSV or Parquet file: python -c \"import numpy, pandas; \
             pandas.DataFrame(numpy.load('FILE')).to_csv('log.csv')\", with the columns' names",
        ),
    ),
    (
        b"SQLite format 3\0",
        (
            "an SQLite database (a ROS 2 bag, if it ends in .db3)",
            "an MCAP, CSV or Parquet file: ros2 bag convert -i FILE -o mcap.yaml, or sqlite3 -csv -header FILE 'select * \
             from TABLE' > log.csv",
        ),
    ),
    (
        b"#ROSBAG V",
        (
            "a ROS 1 bag",
            "an MCAP, CSV or Parquet file: mcap convert FILE log.mcap, or rostopic echo -b FILE -p /TOPIC > log.csv",
        ),
    ),
    (
        b"MDF     ",
        (
            "an MDF file",
            "a CSV or Parquet file: python -c \"from asammdf import MDF; MDF('FILE').export('parquet', 'log.parquet')\"",
        ),
    ),
    (
        b"TDSm",
        (
            "a TDMS file",
            "a CSV or Parquet file: python -c \"import nptdms; \
             nptdms.TdmsFile('FILE').as_dataframe().to_csv('log.csv')\"",
        ),
    ),
    (b"FEA1", ("a Feather file of version 1", PYARROW)),
    (
        &[0xd0, 0xcf, 0x11, 0xe0],
        ("a spreadsheet", "a CSV file: libreoffice --headless --convert-to csv FILE"),
    ),
    (b"\x80\x03", PICKLE),
    (b"\x80\x04", PICKLE),
    (b"\x80\x05", PICKLE),
    (b"%PDF", ("a PDF document", "a CSV or Parquet file")),
];

const PICKLE: Refusal = (
    "a pickle of Python",
    "a CSV or Parquet file: python -c \"import pandas; pandas.read_pickle('FILE').to_csv('log.csv')\"",
);

const PYARROW: &str = "a CSV or Parquet file: python -c \"import pyarrow.feather as f, pyarrow.parquet as p; \
                       p.write_table(f.read_table('FILE'), 'log.parquet')\"";

/// Words of XML documents of tools, in lower case, with what to export instead.
const XML_TOOLS: [(&[u8], &str); 7] = [
    (b"tcscope", "a CSV file: Export in TwinCAT Scope"),
    (b"beckhoff", "a CSV file: Export in TwinCAT Scope"),
    (
        b"ctrlx",
        "a CSV file: the CSV export of the oscilloscope in ctrlX DRIVE Engineering; for a PLC trace, Save trace as *.trace.csv",
    ),
    (
        b"rexroth",
        "a CSV file: the CSV export of the oscilloscope in ctrlX DRIVE Engineering; for a PLC trace, Save trace as *.trace.csv",
    ),
    (b"tracedata", "a CSV file: the CSV export of the trace in Startdrive or STARTER"),
    (b"trace", "a CSV file: in CODESYS, Save trace with the type *.trace.csv"),
    (b"", "a CSV or Parquet file: the CSV export of the tool that wrote it"),
];

/// The mark of a tar archive, and its place.
const TAR: (usize, &[u8]) = (257, b"ustar");

/// Returns what a file that begins with `head` is, and what is expected; `None` if it may be a log.
pub(super) fn recognise(head: &[u8]) -> Option<(&'static str, String)> {
    let text = without_mark(head);
    let of_json = || {
        let command = json_document::command(text).filter(|_| !is_sysid(text))?;
        Some(("a JSON document", command))
    };
    by_first_bytes(head).map(|(found, expected)| (found, expected.to_owned())).or_else(of_json)
}

/// Returns what a file that begins with `head` is, unless it is JSON.
fn by_first_bytes(head: &[u8]) -> Option<Refusal> {
    if let Some((_, refusal)) = PACKED.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(*refusal);
    }
    if head.get(TAR.0..).is_some_and(|rest| rest.starts_with(TAR.1)) {
        return Some(("a tar archive", "a CSV or Parquet file: tar -xf FILE"));
    }
    if let Some((_, refusal)) = KNOWN.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(*refusal);
    }
    let text = without_mark(head);
    if text.trim_ascii().is_empty() {
        Some(("an empty file", "a header and a row per sample"))
    } else if let Some(tool) = xml_tool(text) {
        Some(("an XML document", tool))
    } else if is_yaml(text) {
        Some((
            "a YAML document",
            "an MCAP or CSV file: ros2 bag record -s mcap /TOPIC, or ros2 topic echo --csv /TOPIC > log.csv with a \
             header",
        ))
    } else if !text.contains(&b'\n') && text.contains(&b'\r') {
        Some(("lines that end in CR alone", "lines that end in LF or CRLF"))
    } else {
        None
    }
}

/// Returns what a zip archive is by the names of its members: the formats of offices and NumPy are archives. `has`
/// states whether a member's name contains a text. Returns `None` for an archive of files.
pub(super) fn in_zip(has: &dyn Fn(&str) -> bool) -> Option<Refusal> {
    if has("[Content_Types].xml")
        || has("xl/worksheets")
        || has("opendocument.spreadsheet")
        || has("META-INF/manifest.xml")
    {
        Some(("a spreadsheet", "a CSV file: libreoffice --headless --convert-to csv FILE"))
    } else if has(".npy") {
        Some((
            "a NumPy archive",
            "a CSV or Parquet file: python -c \"import numpy, pandas; \
             pandas.DataFrame(dict(numpy.load('FILE'))).to_csv('log.csv')\"",
        ))
    } else {
        None
    }
}

/// Returns what the tool that wrote an XML document exports instead; `None` for other text.
fn xml_tool(text: &[u8]) -> Option<&'static str> {
    let line = text.trim_ascii_start().split(|byte| *byte == b'\n').next()?.trim_ascii();
    let is_tag = line.starts_with(b"<") && line.ends_with(b">") && !line.contains(&b',');
    if !is_tag && !line.starts_with(b"<?xml") {
        return None;
    }
    let text = text.to_ascii_lowercase();
    let has = |word: &[u8]| word.is_empty() || text.windows(word.len()).any(|part| part == word);
    XML_TOOLS.iter().find(|(word, _)| has(word)).map(|(_, expected)| *expected)
}

/// Returns true for documents of YAML, as `ros2 topic echo` writes them: keys, some of them indented.
fn is_yaml(text: &[u8]) -> bool {
    let mut lines = text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii_end);
    let is_key = |line: &[u8]| {
        let key = line
            .strip_suffix(b":")
            .or(line.split(|byte| *byte == b' ').next()?.strip_suffix(b":"))?;
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
        Some(!key.is_empty() && key.iter().all(is_word))
    };
    let mut top = lines.by_ref().filter(|line| !line.is_empty() && *line != b"---");
    let (Some(first), Some(second)) = (top.next(), top.next()) else { return false };
    let is_inside = second.starts_with(b"  ") || second.starts_with(b"- ");
    let second = second.strip_prefix(b"-").unwrap_or(second).trim_ascii_start();
    first.ends_with(b":")
        && is_key(first) == Some(true)
        && is_inside
        && (is_key(second) == Some(true) || !second.contains(&b','))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recognise_with_unsupported_file_returns_its_type() {
        assert_eq!(recognise(b"PAR1...."), None);
        assert_eq!(recognise(b"a,b\n"), None);
        assert_eq!(recognise(b"Settings:\n  a,b\n"), None);
        assert_eq!(recognise(b"MDF,time_s\n1,2\n"), None, "a header may begin alike");
        assert_eq!(recognise(b"<DATE>,<TIME>,<q>\n1,2,3\n"), None);
        let mut table = String::new();
        for (head, name) in [
            (&b""[..], "empty"),
            (b"\xef\xbb\xbf \r\n", "empty"),
            (&[&[b'a'; 257][..], b"ustar\x0000"].concat(), "tar"),
            (b"\x1f\x8b\x08", "gzip"),
            (b"PK\x03\x04\0\0log.csv", "zip"),
            (b"[\n {\"t\": 0},\n {\"t\": 1}]", "JSON"),
            (b"{\n \"t\": [0, 1], \"q\": [0, 1]}", "JSON"),
            (b"\xd0\xcf\x11\xe0\xa1\xb1", "spreadsheet"),
            (b"\x89HDF\r\n\x1a\n", "HDF5"),
            (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "a MAT "),
            (b"\x93NUMPY\x01\0", "NumPy"),
            (b"SQLite format 3\0", "SQLite"),
            (b"#ROSBAG V2.0\n", "ROS 1"),
            (b"MDF     4.10", "MDF"),
            (b"TDSm\x0e\0\0\0", "TDMS"),
            (b"<?xml version=\"1.0\"?>\n<Trace><Variable/></Trace>", "XML"),
            (b"<Oscilloscope Vendor=\"Bosch Rexroth\">\n</Oscilloscope>", "XML"),
            (b"header:\n  stamp:\n    sec: 1\n---\n", "YAML"),
            (b"\x80\x04\x95\x10", "pickle"),
            (b"a,b\r1,2\r", " CR "),
        ] {
            let (found, expected) = recognise(head).unwrap();
            assert!(found.contains(name), "{found}");
            table += &format!("found {found}, expected {expected}\n");
        }
        crate::message::check("errors", "types of files", &table, &[]);
    }

    #[test]
    fn in_zip_with_names_of_known_formats_returns_type() {
        let found = |names: &[&str]| {
            in_zip(&|name| names.iter().any(|of| of.contains(name))).map(|of| of.0)
        };
        assert_eq!(found(&["[Content_Types].xml", "xl/workbook.xml"]), Some("a spreadsheet"));
        assert_eq!(found(&["tau.npy"]), Some("a NumPy archive"));
        assert_eq!(found(&["log.csv"]), None);
    }
}
