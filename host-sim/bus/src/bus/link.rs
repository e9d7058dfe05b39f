//! A byte stream: a serial device, a TCP connection, or a socket in the file system.
//!
//! Reading and writing never block; [`Link::wait`] waits. A serial device is set to raw mode with eight bits and no
//! handshake. It is also locked, so that two programs do not share an adapter by mistake.

use super::address::Address;
use super::open_error::OpenError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::termios::{self, ControlModes, OptionalActions, QueueSelector, SpecialCodeIndex};
use std::fmt::Debug;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// Time limit for a TCP connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);

/// A stream of the operating system.
trait Stream: Read + Write + AsFd + Debug {}

impl<S: Read + Write + AsFd + Debug> Stream for S {}

/// An open byte stream.
#[derive(Debug)]
pub(super) struct Link(Box<dyn Stream>);

impl Link {
    /// Opens the stream at an address.
    ///
    /// # Errors
    /// Returns the reason and the remedy.
    pub(super) fn open(address: &Address) -> Result<Self, OpenError> {
        match address {
            Address::Tcp(host) => connect(host),
            Address::Path { path, baud } => {
                let kind = fs::metadata(path).map_err(|error| match error.kind() {
                    ErrorKind::NotFound => OpenError::NoDevice,
                    _ => error.into(),
                })?;
                if kind.file_type().is_socket() {
                    let stream = UnixStream::connect(path)?;
                    stream.set_nonblocking(true)?;
                    Ok(Self(Box::new(stream)))
                } else if kind.file_type().is_char_device() {
                    Ok(Self(Box::new(serial(path, *baud)?)))
                } else {
                    Err(OpenError::NoStream)
                }
            }
        }
    }

    /// Reads the available bytes. Returns `None` if there are none, and 0 if the other end is closed.
    pub(super) fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        would_block(self.0.read(bytes))
    }

    /// Writes as many bytes as there is room for. Returns `None` if there is none.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<Option<usize>> {
        would_block(self.0.write(bytes))
    }

    /// Waits until there are bytes to read, or room to write if `write` is set.
    pub(super) fn wait(&self, write: bool, time: Duration) -> io::Result<()> {
        let flags = if write { PollFlags::IN | PollFlags::OUT } else { PollFlags::IN };
        wait(self.0.as_fd(), flags, time).map(|_| ())
    }
}

/// Waits for an event. Returns true if it occurred. A signal ends the wait early.
pub(super) fn wait(fd: BorrowedFd, flags: PollFlags, time: Duration) -> io::Result<bool> {
    let mut fds = [PollFd::from_borrowed_fd(fd, flags)];
    // Limited to a day, which the caller repeats.
    let time = time.min(Duration::from_secs(86_400));
    let time = Timespec { tv_sec: time.as_secs() as i64, tv_nsec: time.subsec_nanos().into() };
    match poll(&mut fds, Some(&time)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

fn would_block(done: io::Result<usize>) -> io::Result<Option<usize>> {
    match done {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn connect(host: &str) -> Result<Link, OpenError> {
    let mut why = OpenError::UnknownHost;
    for address in host.to_socket_addrs()? {
        let connected = TcpStream::connect_timeout(&address, CONNECT_TIMEOUT).and_then(|stream| {
            stream.set_nodelay(true)?;
            stream.set_nonblocking(true)?;
            Ok(stream)
        });
        match connected {
            Ok(stream) => return Ok(Link(Box::new(stream))),
            Err(error) => why = error.into(),
        }
    }
    Err(why)
}

fn serial(path: &Path, baud: Option<u32>) -> Result<File, OpenError> {
    // Does not wait for a carrier, and does not become the controlling terminal.
    let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
    let file = (OpenOptions::new().read(true).write(true))
        .custom_flags(flags.bits() as i32)
        .open(path)
        .map_err(|error| match error.kind() {
            ErrorKind::PermissionDenied => OpenError::Denied(error),
            _ => error.into(),
        })?;
    let mut line = termios::tcgetattr(&file).map_err(|_| OpenError::NotSerial)?;
    file.try_lock().map_err(|_| OpenError::InUse)?;
    line.make_raw();
    line.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
    line.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
    line.special_codes[SpecialCodeIndex::VMIN] = 1;
    line.special_codes[SpecialCodeIndex::VTIME] = 0;
    if let Some(baud) = baud {
        line.set_speed(baud).map_err(|_| OpenError::BaudRate(baud))?;
    }
    let set = termios::tcsetattr(&file, OptionalActions::Now, &line);
    set.and_then(|()| termios::tcflush(&file, QueueSelector::IOFlush)).map_err(io::Error::from)?;
    Ok(file)
}
