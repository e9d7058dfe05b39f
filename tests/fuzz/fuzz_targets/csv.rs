//! Any bytes as a data file: an error of one line, or data that can be used.

#![no_main]

use friction_identification::data::{ReadOptions, SplitRule, read, segments, split};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;
use std::sync::LazyLock;

/// One file for the whole life of the process: in memory where there is such a place.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    folder.join(format!("fuzz-{}.csv", std::process::id()))
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(&*FILE, data).expect("the file can be written");
    let options = ReadOptions { columns: vec![], skip: data.len() % 3, ..ReadOptions::default() };
    let outcome = read(&[FILE.clone()], &options, &|_, _| {});
    let _ = std::fs::remove_file(&*FILE);
    let data = match outcome {
        Ok(data) => data,
        Err(error) => {
            let said = error.to_string();
            assert!(!said.contains(['\n', '\r']) && said.len() < 4000, "{said:?}");
            return;
        }
    };
    assert!(!data.runs.is_empty());
    for run in &data.runs {
        let rows = run.len();
        assert!(rows > 0 && run.velocity.len() == rows && run.torque.len() == rows);
        assert!(run.extra.iter().all(|column| column.len() == rows));
        let columns = run.extra.iter().chain([&run.velocity, &run.torque, &run.time_s]);
        assert!(columns.flatten().all(|value| value.is_finite()));
        assert_eq!(run.acceleration_or_derived().len(), rows);
        assert_eq!(segments(run).iter().map(|rows| rows.len()).sum::<usize>(), rows);
    }
    let _ = split(&data, &SplitRule::default(), 1);
    let _ = split(&data, &SplitRule::Tail { share: 0.3 }, 0);
});
