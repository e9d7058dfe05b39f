//! Tables and contents of files in memory give the same data as files with the same cells.

use super::message;
use friction_diagnose::prepare::{PrepareOptions, Prepared, Source, prepare};
use joint_log::{
    Cells, DataError, Dataset, FileContent, ReadOptions, Table, read, read_contents, read_tables,
};

const ROWS: usize = 200;

/// A log as text, with missing cells, a label, and stamps as dates.
fn csv() -> String {
    let row = |row: usize| {
        let (second, milli) = (row / 100, row % 100 * 10);
        let velocity = (0.1 * row as f64).sin();
        let torque = if row == 7 { String::new() } else { (1.5 * velocity).to_string() };
        let pressure = if row % 9 == 2 { String::new() } else { (row as f64 * 1e3).to_string() };
        format!(
            "2024-05-01T12:00:{second:02}.{milli:03}Z,{velocity},{torque},{pressure},low,{}\n",
            row / 100
        )
    };
    let header = "time_s,velocity_rad_s,torque_nm,pressure_diff_pa,gear,run\n";
    header.to_owned() + &(0..ROWS).map(row).collect::<String>()
}

/// The cells of the text in the types of a data frame.
fn table(name: &str) -> Table {
    let text = csv();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let numbers = |column: usize| {
        let number = |row: &Vec<&str>| row[column].parse().unwrap_or(f64::NAN);
        Cells::Numbers(rows.iter().map(number).collect())
    };
    // 2024-05-01T12:00:00Z.
    let stamps = (0..ROWS as i64).map(|row| Some(1_714_564_800_000_000_000 + row * 10_000_000));
    let columns = [
        ("time_s", Cells::Stamps(stamps.collect())),
        ("velocity_rad_s", numbers(1)),
        ("torque_nm", numbers(2)),
        ("pressure_diff_pa", numbers(3)),
        ("gear", Cells::Texts(rows.iter().map(|row| row[4].to_owned()).collect())),
        ("run", Cells::Integers((0..ROWS as i64).map(|row| Some(row / 100)).collect())),
    ];
    let columns = columns.map(|(name, cells)| (name.to_owned(), cells));
    Table { name: name.to_owned(), columns: columns.into() }
}

fn tables(tables: &[Table]) -> Result<Dataset, DataError> {
    read_tables(tables, &ReadOptions::default())
}

#[test]
fn read_tables_with_cells_of_file_returns_data_of_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("log.csv");
    std::fs::write(&file, csv()).expect("written");
    let of_file = read(std::slice::from_ref(&file), &ReadOptions::default(), &|_, _| {}).unwrap();
    let of_table = tables(&[table(&file.display().to_string())]).unwrap();
    assert_eq!(format!("{of_file:?}"), format!("{of_table:?}"));
    assert_eq!((of_table.rows, of_table.bad_rows.count, of_table.runs.len()), (ROWS - 1, 1, 2));
    assert_eq!(of_table.bad_rows.first[0].row, 9);
}

#[test]
fn read_tables_with_unreadable_column_leaves_it_out_or_rejects_it() {
    let list = || Cells::Unreadable { rows: ROWS, kind: "a list".into() };
    let mut log = table("log");
    log.columns.push(("raw".into(), list()));
    let data = tables(std::slice::from_ref(&log)).unwrap();
    let left_out = data.left_out_columns.iter().find(|column| column.name == "raw");
    assert!(left_out.expect("a column").why.ends_with("a list"), "{left_out:?}");
    log.columns[2].1 = list();
    let error = tables(&[log]).unwrap_err();
    let DataError::Cell(cell) = &error else { panic!("{error}") };
    assert_eq!((cell.row, &*cell.column, &*cell.found), (1, "torque_nm", "a list"));
    message::check("tables", "column of lists", &error.to_string(), &["log: "]);
}

#[test]
fn read_tables_with_columns_of_two_lengths_names_them() {
    let mut log = table("log");
    log.columns[1].1 = Cells::Numbers(vec![1.0]);
    let error = tables(&[log]).unwrap_err().to_string();
    let parts = ["log: ", "1 ", "velocity_rad_s", "200 ", "time_s"];
    message::check("tables", "columns of two lengths", &error, &parts);
    let none = tables(&[]).unwrap_err();
    assert!(matches!(none, DataError::Request { what, .. } if what == "data"));
    let twice = tables(&[table("a"), table("a")]).unwrap_err().to_string();
    message::check("tables", "name twice", &twice, &["a: "]);
}

#[test]
fn read_tables_with_whole_numbers_keeps_all_digits() {
    let mut log = table("log");
    let start = 1_714_564_800_000_000_001;
    let stamps = (0..ROWS as i64).map(|row| Some(start + 200 * row)).collect();
    log.columns[0] = ("time_s".into(), Cells::Integers(stamps));
    let columns = vec![("time_s".to_owned(), "time_s:ns".to_owned())];
    let options = ReadOptions { columns, ..ReadOptions::default() };
    let data = read_tables(&[log], &options).unwrap();
    let step = data.runs[0].time_s[1] - data.runs[0].time_s[0];
    assert!((step - 200e-9).abs() < 1e-15, "{step}");
}

#[test]
fn prepare_of_tables_states_a_hash_of_their_contents() {
    let hash = |table: Table| {
        let options = PrepareOptions::default();
        prepare(&Source::Tables(vec![table]), &options).expect("prepared").hashes.concat()
    };
    let mut other = table("log");
    if let Cells::Numbers(torque) = &mut other.columns[2].1 {
        torque[0] += 1e-9;
    }
    assert_eq!(hash(table("log")), hash(table("another name")));
    assert_ne!(hash(table("log")), hash(other));
    assert_eq!(hash(table("log")).len(), 64);
}

/// Prepares a log that is in a file, and the same bytes in memory.
fn prepare_both(bytes: &[u8]) -> [Prepared; 2] {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    std::fs::write(&file, bytes).unwrap();
    let content = FileContent { name: file.clone(), bytes: bytes.to_vec() };
    [Source::Files(vec![file]), Source::Contents(vec![content])]
        .map(|source| prepare(&source, &PrepareOptions::default()).expect("prepared"))
}

#[test]
fn prepare_of_contents_gives_data_notes_and_hash_of_the_file() {
    let utf16 = |text: &str| -> Vec<u8> {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
    };
    let with_preamble = format!("recorded by a drive\nfirmware 7\n{}", csv());
    for bytes in [csv().into_bytes(), utf16(&csv()), with_preamble.into_bytes()] {
        let [file, content] = prepare_both(&bytes);
        assert_eq!(content.hashes, file.hashes);
        assert_eq!(content.data.notes, file.data.notes);
        assert_eq!(content.data.rows, file.data.rows);
        for (run, of_file) in content.data.runs.iter().zip(&file.data.runs) {
            assert_eq!(run.name, of_file.name);
            assert_eq!(run.time_s, of_file.time_s);
            assert_eq!(run.torque, of_file.torque);
        }
    }
}

#[test]
fn read_contents_with_other_formats_returns_error() {
    let error = |bytes: &[u8]| {
        let content = FileContent { name: "a.csv".into(), bytes: bytes.to_vec() };
        read_contents(&[content], &ReadOptions::default(), &|_, _| {}).unwrap_err().to_string()
    };
    message::check("tables", "archive", &error(&[0x1f, 0x8b, 8, 0]), &["a.csv", "archive"]);
    for bytes in [&b"(1.0) can0 181#0011\n"[..], &[1, 2, 0, 4, 5, 6, 7, 8]] {
        message::check("tables", "log of another format", &error(bytes), &["a.csv", "CSV"]);
    }
}
