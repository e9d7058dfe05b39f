//! Fuzzes the reader of data files with any bytes: it returns an error of one line or usable data.

use joint_log::{ReadOptions, SplitRule, read, segments, split};
use std::path::PathBuf;
use std::sync::LazyLock;

/// The data file, one for each process. It is in memory if the system has a directory for that.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let shared_memory = PathBuf::from("/dev/shm");
    let directory = if shared_memory.is_dir() { shared_memory } else { std::env::temp_dir() };
    directory.join(format!("fuzz-{}.csv", std::process::id()))
});

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    std::fs::write(&*FILE, data).expect("the file can be written");
    let options = ReadOptions { columns: vec![], skip: data.len() % 3, ..ReadOptions::default() };
    let outcome = read(std::slice::from_ref(&*FILE), &options, &|_, _| {});
    let _ = std::fs::remove_file(&*FILE);
    let data = match outcome {
        Ok(data) => data,
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains(['\n', '\r']) && message.len() < 4000, "{message:?}");
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
}
