//! Reading of Arrow IPC files and streams, and of damaged ones.

use super::data_garbage::read_damaged;
use super::folder::Folder;
use super::message;
use arrow_array::types::Int8Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float32Array, Float64Array, Int64Array,
    LargeStringArray, ListArray, RecordBatch, TimestampMicrosecondArray, UInt8Array,
};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions, StreamWriter};
use joint_log::{ReadOptions, read};
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

const ROWS: usize = 30;

/// One run of a table with columns of many types. In the first, row 3 has no torque.
fn batch(run: usize) -> RecordBatch {
    let rows = 0..ROWS;
    let shape = if run == 0 { "sine" } else { "step" };
    let run_names: DictionaryArray<Int8Type> = rows.clone().map(|_| Some(shape)).collect();
    let stamps = rows.clone().map(|i| Some(1_714_564_800_000_000 + 10_000 * i as i64));
    let torque = rows.clone().map(|i| (run > 0 || i != 3).then_some(i as f64 * 2.0));
    let lists = rows.clone().map(|_| Some(vec![Some(1.0), Some(2.0)]));
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("run", Arc::new(run_names)),
        ("time_s", Arc::new(stamps.collect::<TimestampMicrosecondArray>())),
        (
            "velocity_rad_s",
            Arc::new(Float32Array::from_iter(rows.clone().map(|i| i as f32 + 0.25))),
        ),
        ("torque_nm", Arc::new(torque.collect::<Float64Array>())),
        ("level", Arc::new(UInt8Array::from(vec![200; ROWS]))),
        ("count", Arc::new(Int64Array::from(vec![-7; ROWS]))),
        ("enabled", Arc::new(BooleanArray::from(vec![run == 0; ROWS]))),
        ("note", Arc::new(LargeStringArray::from(vec!["warm"; ROWS]))),
        (
            "cells",
            Arc::new(ListArray::from_iter_primitive::<arrow_array::types::Float64Type, _, _>(
                lists,
            )),
        ),
    ];
    RecordBatch::try_from_iter(columns).unwrap()
}

fn write(folder: &Folder, is_stream: bool, compression: Option<CompressionType>) -> PathBuf {
    let path = folder.0.join("log.arrow");
    let file = fs::File::create(&path).unwrap();
    let options = IpcWriteOptions::default().try_with_compression(compression).unwrap();
    let schema = batch(0).schema();
    if is_stream {
        let mut writer = StreamWriter::try_new_with_options(file, &schema, options).unwrap();
        (0..2).for_each(|run| writer.write(&batch(run)).unwrap());
        writer.finish().unwrap();
    } else {
        // A file has one dictionary, so both runs have one name.
        let mut writer = FileWriter::try_new_with_options(file, &schema, options).unwrap();
        writer.write(&batch(0)).unwrap();
        writer.finish().unwrap();
    }
    path
}

#[test]
fn read_with_arrow_of_each_compression_returns_rows() {
    let folder = Folder::new();
    for compression in [None, Some(CompressionType::LZ4_FRAME), Some(CompressionType::ZSTD)] {
        for is_stream in [false, true] {
            let path = write(&folder, is_stream, compression);
            let data = read(&[path], &ReadOptions::default(), &|_, _| {}).unwrap();
            let runs = 1 + usize::from(is_stream);
            assert_eq!((data.runs.len(), data.rows), (runs, runs * ROWS - 1));
            let bad = &data.bad_rows.first[0];
            // The header would be row 1, so the fourth sample is row 5.
            assert_eq!((bad.row, &*bad.column, &*bad.found), (5, "torque_nm", "an empty cell"));
            assert_eq!(data.runs[0].name, "sine");
            assert_eq!(data.runs[0].velocity[..4], [0.25, 1.25, 2.25, 4.25]);
            assert_eq!(data.runs[0].time_s[..2], [0.0, 0.01]);
            assert_eq!(data.covariates, ["level", "count"]);
            assert_eq!((data.runs[0].extra[0][0], data.runs[0].extra[1][0]), (200.0, -7.0));
            let labels = [("enabled", "true"), ("note", "warm")];
            assert_eq!(data.runs[0].labels, labels.map(|(a, b)| (a.to_owned(), b.to_owned())));
            assert_eq!(data.left_out_columns[0].name, "cells");
            message::check("reading", "column of lists", &data.left_out_columns[0].why, &[]);
        }
    }
}

#[test]
fn read_with_integer_stamps_of_arrow_keeps_all_digits() {
    let numbers = |number| Arc::new(Float64Array::from(vec![number; ROWS])) as ArrayRef;
    let stamps = (0..ROWS as i64).map(|row| 1_714_564_800_000_000_000 + 1_000 * row);
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("stamp", Arc::new(stamps.collect::<Int64Array>())),
        ("velocity_rad_s", numbers(1.5)),
        ("torque_nm", numbers(0.5)),
    ];
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let folder = Folder::new();
    let path = folder.0.join("log.arrow");
    let mut writer =
        FileWriter::try_new(fs::File::create(&path).unwrap(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    let columns = vec![("time_s".to_owned(), "stamp:ns".to_owned())];
    let options = ReadOptions { columns, ..ReadOptions::default() };
    let data = read(&[path], &options, &|_, _| {}).unwrap();
    assert_eq!(data.runs[0].time_s[..3], [0.0, 1e-6, 2e-6]);
}

#[test]
fn read_with_damaged_arrow_returns_error_without_panic() {
    let folder = Folder::new();
    for is_stream in [false, true] {
        let mark = if is_stream { &[0xff; 4][..] } else { b"ARROW1" };
        read_damaged(&write(&folder, is_stream, Some(CompressionType::ZSTD)), mark);
    }
}
