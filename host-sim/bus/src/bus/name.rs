//! The argument of `--bus`.

use super::{Address, Bus, BusError, Hub, slcan};
use std::fmt;
use std::str::FromStr;

/// Maximum length of an interface name, in bytes.
const MAX_INTERFACE_BYTES: usize = 15;

/// Name of a bus on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusName {
    /// `loop`: in this process.
    Loop,
    /// `can0`: an interface of the kernel.
    SocketCan(String),
    /// `slcan:/dev/ttyACM0`, `slcan:localhost:3333`: an adapter.
    Slcan(Address),
}

/// Error of a name that selects no bus; its message is one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "bus {name:?}: {why}; expected loop, an interface such as vcan0, slcan:/dev/ttyACM0 or slcan:HOST:PORT"
)]
pub struct BusNameError {
    name: String,
    why: &'static str,
}

impl FromStr for BusName {
    type Err = BusNameError;

    fn from_str(name: &str) -> Result<Self, BusNameError> {
        let error = |why| BusNameError { name: name.into(), why };
        if name == "loop" {
            return Ok(Self::Loop);
        }
        if let Some(address) = name.strip_prefix("slcan:") {
            let address = Address::parse(address).ok_or_else(|| error("no path or host"))?;
            return Ok(Self::Slcan(address));
        }
        if name.is_empty() {
            return Err(error("empty"));
        }
        if name.contains(':') {
            return Err(error("unknown kind of bus"));
        }
        if name.len() > MAX_INTERFACE_BYTES {
            return Err(error("longer than 15 letters"));
        }
        if !name.bytes().all(|byte| byte.is_ascii_graphic() && byte != b'/')
            || name.starts_with('.')
        {
            return Err(error("not the name of an interface"));
        }
        Ok(Self::SocketCan(name.into()))
    }
}

impl fmt::Display for BusName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Loop => f.write_str("loop"),
            Self::SocketCan(interface) => f.write_str(interface),
            Self::Slcan(address) => write!(f, "slcan:{address}"),
        }
    }
}

impl BusName {
    /// Opens the bus; an adapter with these options. `loop` opens a port of this hub.
    ///
    /// # Errors
    /// Returns [`BusError::Open`] with the remedy.
    pub fn open(&self, hub: &Hub, options: slcan::Options) -> Result<Box<dyn Bus>, BusError> {
        match self {
            Self::Loop => Ok(Box::new(hub.port())),
            Self::Slcan(address) => Ok(Box::new(slcan::Slcan::open(address, options)?)),
            #[cfg(target_os = "linux")]
            Self::SocketCan(interface) => Ok(Box::new(super::socket::SocketCan::open(interface)?)),
            #[cfg(not(target_os = "linux"))]
            Self::SocketCan(interface) => {
                let source = super::OpenError::NeedsLinux;
                Err(BusError::Open { name: interface.clone(), source })
            }
        }
    }

    /// Returns the interface name for a log: without blanks, at most 15 letters.
    pub fn interface(&self) -> &str {
        match self {
            Self::Loop => "loop",
            Self::SocketCan(interface) => interface,
            Self::Slcan(_) => "slcan0",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_parsed_and_displayed_is_unchanged() {
        for name in [
            "loop",
            "vcan0",
            "can-left.1",
            "slcan:/dev/ttyACM0",
            "slcan:/dev/ttyUSB0@3000000",
            "slcan:localhost:3333",
            "slcan:[::1]:3333",
            "slcan:./socket",
        ] {
            let parsed: BusName = name.parse().expect(name);
            assert_eq!(parsed.to_string(), name);
        }
        assert_eq!("loop".parse(), Ok(BusName::Loop));
        assert_eq!("can0".parse(), Ok(BusName::SocketCan("can0".into())));
    }

    #[test]
    fn parse_with_invalid_name_returns_one_line_error() {
        for name in ["", "slcan:", "tcp:1.2.3.4:5", "an-interface-too-long", "can 0", "../x", "a/b"]
        {
            let error = name.parse::<BusName>().expect_err(name).to_string();
            assert!(error.contains("expected loop") && error.lines().count() == 1, "{error}");
        }
    }
}
