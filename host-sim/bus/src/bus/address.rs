//! The address of an slcan adapter on the command line.

use std::fmt;
use std::path::PathBuf;

/// Address of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A serial device, or a socket in the file system.
    Path {
        /// Path in the file system.
        path: PathBuf,
        /// Baud rate of the serial line, written as `@3000000` after the path. `None` keeps the current
        /// rate. USB adapters accept any rate.
        baud: Option<u32>,
    },
    /// `HOST:PORT`.
    Tcp(String),
}

impl Address {
    /// Parses an address. A text with a slash is a path; otherwise `HOST:PORT` is a TCP address. Returns
    /// `None` for an empty text.
    pub fn parse(text: &str) -> Option<Self> {
        let port = text.rsplit_once(':').filter(|(host, port)| {
            !text.contains('/') && !host.is_empty() && port.parse::<u16>().is_ok()
        });
        if port.is_some() {
            return Some(Self::Tcp(text.into()));
        }
        let number = |baud: &str| baud.parse().ok().filter(|baud| *baud > 0);
        let (path, baud) = match text.rsplit_once('@') {
            Some((path, baud)) if number(baud).is_some() => (path, number(baud)),
            _ => (text, None),
        };
        (!path.is_empty()).then(|| Self::Path { path: path.into(), baud })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path { path, baud: None } => write!(f, "{}", path.display()),
            Self::Path { path, baud: Some(baud) } => write!(f, "{}@{baud}", path.display()),
            Self::Tcp(host) => f.write_str(host),
        }
    }
}
