//! Where an slcan adapter is, as the command line has it.

use std::fmt;
use std::path::PathBuf;

/// Where an adapter is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A serial device, or a socket in the file system.
    Path {
        /// Where.
        path: PathBuf,
        /// Baud rate of the serial line, as `@3000000` behind the path; as it is set without. USB
        /// adapters take any.
        baud: Option<u32>,
    },
    /// `HOST:PORT`.
    Tcp(String),
}

impl Address {
    /// An address as the command line has it. With a slash it is a path; otherwise `HOST:PORT` if it
    /// looks so. `None` where it is empty.
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
