//! Reading of Parquet files: the same validation and the same messages as for CSV files.
//!
//! The files are written here, column by column, with the types that pandas and polars use: nullable doubles, 32-bit
//! floats, integers of both signs, booleans, text, several row groups.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use super::data_garbage::read_damaged;
use super::folder::Folder;
use super::message;
use joint_log::{Dataset, JointKind, ReadOptions, read};
use parquet::basic::{BrotliLevel, Compression, ZstdLevel};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
    Int96, Int96Type,
};
use parquet::file::properties::{WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

const SCHEMA: &str = "message log {
    REQUIRED INT64 run;
    OPTIONAL DOUBLE time_s;
    OPTIONAL FLOAT velocity_rad_s;
    OPTIONAL DOUBLE torque_nm;
    REQUIRED INT32 level (INTEGER(8,false));
    OPTIONAL BOOLEAN enabled;
    OPTIONAL BYTE_ARRAY shape (STRING);
    OPTIONAL INT64 when (TIME(MICROS,true));
}";

fn column<T: DataType>(group: &mut SerializedRowGroupWriter<'_, fs::File>, cells: &[Option<T::T>]) {
    let mut column = group.next_column().unwrap().unwrap();
    let there: Vec<T::T> = cells.iter().flatten().cloned().collect();
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    column.typed::<T>().write_batch(&there, Some(&levels), None).unwrap();
    column.close().unwrap();
}

/// Writes two row groups of `rows` rows, one run each. In the first, row 3 has no torque.
fn write(folder: &Folder, compression: Compression, rows: usize) -> PathBuf {
    write_version(folder, WriterVersion::PARQUET_1_0, compression, rows)
}

/// Like [`write`], with pages of a version of the format. Version 2 stores the levels uncompressed and delta encodings.
fn write_version(
    folder: &Folder,
    version: WriterVersion,
    compression: Compression,
    rows: usize,
) -> PathBuf {
    let path = folder.0.join("log.parquet");
    let schema = Arc::new(parse_message_type(SCHEMA).unwrap());
    let properties = WriterProperties::builder().set_compression(compression);
    let properties = properties.set_writer_version(version).build();
    let file = fs::File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    for run in 0..2 {
        let mut group = writer.next_row_group().unwrap();
        let group_ref = &mut group;
        let all = 0..rows;
        column::<Int64Type>(group_ref, &vec![Some(run as i64 + 1); rows]);
        let time: Vec<_> = all.clone().map(|i| Some(i as f64 * 0.5)).collect();
        column::<DoubleType>(group_ref, &time);
        let velocity: Vec<_> = all.clone().map(|i| Some(i as f32 + 0.25)).collect();
        column::<FloatType>(group_ref, &velocity);
        let torque = |i| (run > 0 || i != 3).then_some(i as f64 * 2.0);
        column::<DoubleType>(group_ref, &all.map(torque).collect::<Vec<_>>());
        column::<Int32Type>(group_ref, &vec![Some(200); rows]);
        column::<BoolType>(group_ref, &vec![Some(run == 0); rows]);
        let shape = if run == 0 { "sine" } else { "step" };
        column::<ByteArrayType>(group_ref, &vec![Some(ByteArray::from(shape)); rows]);
        column::<Int64Type>(group_ref, &vec![None; rows]);
        group.close().unwrap();
    }
    writer.close().unwrap();
    path
}

fn read_one(path: PathBuf) -> Dataset {
    read(&[path], &ReadOptions::default(), &|_, _| {}).unwrap()
}

#[test]
fn read_with_parquet_returns_same_data_as_csv() {
    let compressions = [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
        Compression::BROTLI(BrotliLevel::default()),
    ];
    let versions = [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0];
    let both = compressions.into_iter().flat_map(|of| versions.map(|version| (of, version)));
    let folder = Folder::new();
    for (compression, version) in both {
        let data = read_one(write_version(&folder, version, compression, 30));
        assert_eq!(data.joint, JointKind::Revolute);
        assert_eq!((data.rows, data.rows_read, data.bad_rows.count), (59, 60, 1));
        let bad = &data.bad_rows.first[0];
        // The header would be row 1, so the fourth sample is row 5.
        assert_eq!(
            (bad.row, bad.column.as_str(), bad.found.as_str()),
            (5, "torque_nm", "an empty cell")
        );
        let names: Vec<&str> = data.runs.iter().map(|run| run.name.as_str()).collect();
        assert_eq!(names, ["1", "2"]);
        assert_eq!(data.runs[0].velocity[..4], [0.25, 1.25, 2.25, 4.25]);
        assert_eq!(data.runs[1].torque[29], 58.0);
        assert_eq!(data.covariates, ["level"]);
        assert_eq!(data.runs[0].extra[0][0], 200.0, "an unsigned byte above 127");
        let labels = |enabled: &str, shape: &str| {
            vec![("enabled".to_string(), enabled.to_string()), ("shape".into(), shape.into())]
        };
        assert_eq!(data.runs[0].labels, labels("true", "sine"));
        assert_eq!(data.runs[1].labels, labels("false", "step"));
        assert_eq!(data.left_out_columns[0].name, "when");
        message::check("reading", "column of times of day", &data.left_out_columns[0].why, &[]);
    }
}

/// Writes a table of 50 rows 10 ms apart, with times of the given type.
fn dated<T: DataType>(folder: &Folder, kind: &str, stamp: impl Fn(i64) -> T::T) -> PathBuf {
    let path = folder.0.join(format!("{kind}.parquet"));
    let schema = format!(
        "message log {{ OPTIONAL {kind}; OPTIONAL DOUBLE velocity_rad_s; OPTIONAL DOUBLE torque_nm; }}"
    );
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let properties = Arc::new(WriterProperties::builder().build());
    let file = fs::File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    column::<T>(&mut group, &(0..50).map(|i| Some(stamp(i))).collect::<Vec<_>>());
    column::<DoubleType>(&mut group, &vec![Some(1.5); 50]);
    column::<DoubleType>(&mut group, &vec![Some(0.5); 50]);
    group.close().unwrap();
    writer.close().unwrap();
    path
}

#[test]
fn read_with_dates_returns_times_to_the_nanosecond() {
    // 2024-05-01 12:00:00 UTC.
    const NOON_MS: i64 = 1_714_564_800_000;
    let folder = &Folder::new();
    let files = [
        dated::<Int64Type>(folder, "INT64 time_s (TIMESTAMP(MILLIS,true))", |i| NOON_MS + 10 * i),
        dated::<Int64Type>(folder, "INT64 time_s (TIMESTAMP(MICROS,false))", |i| {
            (NOON_MS + 10 * i) * 1000
        }),
        dated::<Int64Type>(folder, "INT64 time_s (TIMESTAMP(NANOS,true))", |i| {
            (NOON_MS + 10 * i) * 1_000_000
        }),
        dated::<Int64Type>(folder, "INT64 time_s (TIMESTAMP_MILLIS)", |i| NOON_MS + 10 * i),
        dated::<Int96Type>(folder, "INT96 time_s", |i| {
            let mut stamp = Int96::new();
            let ns = (NOON_MS % 86_400_000 + 10 * i) * 1_000_000;
            // Days are counted as astronomers do.
            let day = NOON_MS / 86_400_000 + 2_440_588;
            stamp.set_data(ns as u32, (ns >> 32) as u32, day as u32);
            stamp
        }),
    ];
    for file in files {
        let data = read_one(file);
        assert_eq!((data.rows, data.bad_rows.count), (50, 0));
        let times: Vec<f64> = (0..50).map(|i| (10 * i) as f64 / 1000.0).collect();
        assert_eq!(data.runs[0].time_s, times);
    }
    let days = dated::<Int32Type>(folder, "INT32 time_s (DATE)", |i| 19_844 + i as i32);
    assert_eq!(read_one(days).runs[0].time_s[..2], [0.0, 86_400.0]);
}

#[test]
fn read_with_integer_stamps_of_parquet_keeps_all_digits() {
    let folder = Folder::new();
    let stamp = |row| 1_714_564_800_000_000_000 + 1_000 * row;
    let path = dated::<Int64Type>(&folder, "INT64 stamp", stamp);
    let columns = vec![("time_s".to_owned(), "stamp:ns".to_owned())];
    let options = ReadOptions { columns, ..ReadOptions::default() };
    let data = read(&[path], &options, &|_, _| {}).unwrap();
    assert_eq!(data.runs[0].time_s[..3], [0.0, 1e-6, 2e-6]);
}

#[test]
fn read_with_more_rows_than_a_batch_keeps_columns_aligned() {
    let folder = Folder::new();
    for compression in [Compression::SNAPPY, Compression::ZSTD(ZstdLevel::default())] {
        let data = read_one(write(&folder, compression, 20_000));
        assert_eq!(data.rows, 39_999);
        let run = &data.runs[1];
        for row in 0..20_000 {
            assert_eq!(run.time_s[row] * 4.0, run.torque[row]);
        }
    }
}

#[test]
fn read_with_damaged_parquet_returns_error_without_panic() {
    let folder = Folder::new();
    for compression in [Compression::SNAPPY, Compression::ZSTD(ZstdLevel::default())] {
        read_damaged(&write(&folder, compression, 50), b"PAR1");
    }
}
