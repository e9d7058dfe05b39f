//! Finds the tests that check an object: `tests/objects/run` falsifies it, and a test that checks it fails.
//!
//! | variable | effect |
//! |---|---|
//! | `RECORDED_OBJECTS` | folder in which each test writes the objects that it transfers |
//! | `FALSIFIED_OBJECT` | index, hexadecimal: a bit of each value of this object is inverted, another one for each direction |
//!
//! The driver is not changed: values are falsified on their way, as an implementation with an error would send or take them.

use std::io::Write;
use std::path::PathBuf;
use std::sync::LazyLock;

static FALSIFIED: LazyLock<Option<u16>> = LazyLock::new(|| {
    let index = std::env::var("FALSIFIED_OBJECT").ok()?;
    Some(u16::from_str_radix(&index, 16).expect("an index"))
});
static RECORDED: LazyLock<Option<PathBuf>> =
    LazyLock::new(|| std::env::var_os("RECORDED_OBJECTS").map(PathBuf::from));

/// Client commands of transfers.
const DOWNLOAD_SEGMENT: u8 = 0;
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;
/// Bit of a start of a transfer: its frame holds the value.
const EXPEDITED: u8 = 2;

/// Object of the present transfer.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObjectObserver {
    index: u16,
    command: u8,
}

impl ObjectObserver {
    /// Notes a request, and returns it, falsified on request.
    pub fn request(&mut self, mut request: [u8; 8]) -> [u8; 8] {
        self.command = request[0] >> 5;
        if matches!(self.command, DOWNLOAD | UPLOAD) {
            self.index = u16::from_le_bytes([request[1], request[2]]);
            record(self.index);
        }
        if self.is_falsified() {
            match self.command {
                DOWNLOAD if request[0] & EXPEDITED != 0 => request[4] ^= 1,
                DOWNLOAD_SEGMENT => request[1] ^= 1,
                _ => {}
            }
        }
        request
    }

    /// Returns the answer to the last request, falsified on request.
    pub fn answer(&self, mut answer: [u8; 8]) -> [u8; 8] {
        if self.is_falsified() {
            match self.command {
                UPLOAD if answer[0] & EXPEDITED != 0 => answer[4] ^= 2,
                UPLOAD_SEGMENT => answer[1] ^= 2,
                _ => {}
            }
        }
        answer
    }

    fn is_falsified(&self) -> bool {
        *FALSIFIED == Some(self.index)
    }
}

/// Writes an object to the file of the present test.
fn record(index: u16) {
    let (Some(folder), Some(test)) = (&*RECORDED, std::thread::current().name().map(str::to_owned))
    else {
        return;
    };
    let path = folder.join(test.replace("::", "."));
    let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
    writeln!(file.expect("can be written"), "{index:04X}").expect("can be written");
}
