//! Reading of damaged files: every file must give data or an error of one line, and never a panic. Three kinds are
//! tried with a fixed seed: random bytes, bytes with frequent separators, quotes and partial numbers, and valid files
//! with a few bytes changed.

use std::fs;
use std::path::Path;

use super::folder::Folder;
use joint_log::{ReadOptions, SplitRule, read, segments, split};

/// Marsaglia's xorshift generator.
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % below.max(1)
    }
}

/// Reads the file with all options, and uses the result.
fn must_survive(path: &Path, random: &mut Random) {
    let options = ReadOptions { columns: vec![], skip: random.next(3), ..ReadOptions::default() };
    match read(&[path.to_path_buf()], &options, &|_, _| {}) {
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains(['\n', '\r']), "{message:?}");
            assert!(message.len() < 4000, "{message}");
        }
        Ok(data) => {
            assert!(data.runs.iter().all(|run| !run.is_empty()));
            for run in &data.runs {
                let n = run.len();
                assert!(run.velocity.len() == n && run.torque.len() == n);
                assert!(run.extra.iter().all(|column| column.len() == n));
                let columns = run.extra.iter().chain([&run.velocity, &run.torque, &run.time_s]);
                // A sum of huge numbers may overflow in the filter, not in the reader.
                assert!(columns.flatten().all(|value| value.is_finite()));
                assert_eq!(run.acceleration_or_derived().len(), n);
                assert_eq!(segments(run).iter().map(|rows| rows.len()).sum::<usize>(), n);
            }
            let _ = split(&data, &SplitRule::default(), random.next(100) as u64);
            let _ = split(&data, &SplitRule::Tail { share: 0.3 }, 0);
        }
    }
}

/// Reads damaged copies of a binary file in its place. The mark at its start stays.
pub fn read_damaged(path: &Path, mark: &[u8]) {
    let good = fs::read(path).unwrap();
    let mut random = Random(7);
    for round in 0..1000 {
        let mut bytes = good.clone();
        for _ in 0..=random.next(4) {
            let at = random.next(bytes.len());
            bytes[at] = random.next(256) as u8;
        }
        if round % 10 == 9 {
            bytes.truncate(mark.len() + random.next(bytes.len() - mark.len()));
        }
        bytes[..mark.len()].copy_from_slice(mark);
        fs::write(path, &bytes).unwrap();
        must_survive(path, &mut random);
    }
}

#[test]
fn read_with_random_bytes_never_panics() {
    const SNIPPETS: &[u8] = b",|,|,|\n|\n|\r\n|\r|\"|\"\"|;|\t| |0|1.5|-2e308|nan|1e|inf|\0|\xff|\xef\xbb\xbf|time_s|run|a\"b";
    const HEADERS: [&[u8]; 4] = [
        b"",
        b"time_s,velocity_rad_s,torque_nm\n",
        b"run,time_s,velocity_m_s,force_n,x,y\n",
        b"PAR1",
    ];
    let snippets: Vec<&[u8]> = SNIPPETS.split(|byte| *byte == b'|').collect();
    let folder = Folder::new();
    let path = folder.0.join("log.csv");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for _ in 0..3000 {
        let mut bytes = HEADERS[random.next(4)].to_vec();
        let raw = random.next(4) == 0;
        for _ in 0..random.next(300) {
            if raw {
                bytes.push(random.next(256) as u8);
            } else {
                bytes.extend(snippets[random.next(snippets.len())]);
            }
        }
        if bytes.starts_with(b"PAR1") && random.next(2) == 0 {
            let length = random.next(bytes.len()) as u32;
            bytes.extend(length.to_le_bytes());
            bytes.extend(b"PAR1");
        }
        fs::write(&path, &bytes).unwrap();
        must_survive(&path, &mut random);
    }
}

#[test]
fn read_with_damaged_file_never_panics() {
    let mut good = b"run,time_s,velocity_rad_s,torque_nm,kp,shape\n".to_vec();
    for i in 0..60 {
        let row = format!("{},{}.5,{},{},100,sine\n", i / 20, i, i % 7, (i * 3) % 5);
        good.extend(row.as_bytes());
    }
    let folder = Folder::new();
    let path = folder.0.join("log.csv");
    let mut random = Random(42);
    for _ in 0..2000 {
        let mut bytes = good.clone();
        for _ in 0..=random.next(4) {
            let at = random.next(bytes.len());
            match random.next(3) {
                0 => bytes[at] = random.next(256) as u8,
                1 => drop(bytes.drain(at..(at + random.next(30)).min(bytes.len()))),
                _ => bytes.insert(at, b"\",;\n\r-e."[random.next(8)]),
            }
        }
        fs::write(&path, &bytes).unwrap();
        must_survive(&path, &mut random);
    }
}
