//! Reading of damaged files: every file must give data or an error of one line, and never a panic. Three kinds are
//! tried with a fixed seed: random bytes, bytes with frequent separators, quotes and partial numbers, and valid files
//! with a few bytes changed.

use std::fs;
use std::path::{Path, PathBuf};

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

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("garbage-{name}-{}", std::process::id()));
    fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn read_with_random_bytes_never_panics() {
    const SNIPPETS: [&[u8]; 24] = [
        b",",
        b",",
        b",",
        b"\n",
        b"\n",
        b"\r\n",
        b"\r",
        b"\"",
        b"\"\"",
        b";",
        b"\t",
        b" ",
        b"0",
        b"1.5",
        b"-2e308",
        b"nan",
        b"1e",
        b"inf",
        b"\0",
        b"\xff",
        b"\xef\xbb\xbf",
        b"time_s",
        b"run",
        b"a\"b",
    ];
    const HEADERS: [&[u8]; 4] = [
        b"",
        b"time_s,velocity_rad_s,torque_nm\n",
        b"run,time_s,velocity_m_s,force_n,x,y\n",
        b"PAR1",
    ];
    let folder = folder("bytes");
    let path = folder.join("log.csv");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for _ in 0..3000 {
        let mut bytes = HEADERS[random.next(4)].to_vec();
        let raw = random.next(4) == 0;
        for _ in 0..random.next(300) {
            if raw {
                bytes.push(random.next(256) as u8);
            } else {
                bytes.extend(SNIPPETS[random.next(SNIPPETS.len())]);
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
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn read_with_damaged_file_never_panics() {
    let mut good = b"run,time_s,velocity_rad_s,torque_nm,kp,shape\n".to_vec();
    for i in 0..60 {
        let row = format!("{},{}.5,{},{},100,sine\n", i / 20, i, i % 7, (i * 3) % 5);
        good.extend(row.as_bytes());
    }
    let folder = folder("changed");
    let path = folder.join("log.csv");
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
    fs::remove_dir_all(folder).unwrap();
}
