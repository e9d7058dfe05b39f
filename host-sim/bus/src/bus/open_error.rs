//! Why a bus cannot be opened, and the remedy.

use compensator_core::can::slcan::AdapterCommand;
use std::io;

/// Reason why a bus cannot be opened; with the remedy where one is known.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum OpenError {
    #[error("no such device or socket; check that it is connected")]
    NoDevice,
    #[error("neither a serial device nor a socket")]
    NoStream,
    #[error("not a serial device")]
    NotSerial,
    #[error("{0}; join the group of the device (often dialout) or run as root")]
    Denied(io::Error),
    #[error("in use by another program")]
    InUse,
    #[error("the device has no baud rate of {0}")]
    BaudRate(u32),
    #[error("unknown host")]
    UnknownHost,
    #[error("the adapter refuses {0:?}")]
    Refused(AdapterCommand),
    #[error("this kernel has no CAN; modprobe can-raw vcan, or use loop or slcan:")]
    NoCan,
    #[error("CAN interfaces need Linux; use slcan:PATH or loop")]
    NeedsLinux,
    #[error("not a CAN interface")]
    OtherInterface,
    #[error("no such interface; {}", creation(.0))]
    NoInterface(String),
    #[error("the interface is down; {}", start_command(.0))]
    Down(String),
    #[error(transparent)]
    Io(#[from] io::Error),
}

fn is_virtual(interface: &str) -> bool {
    interface.starts_with("vcan")
}

/// Returns how an interface is made or found.
fn creation(interface: &str) -> String {
    if is_virtual(interface) {
        format!("ip link add dev {interface} type vcan && {}", start_command(interface))
    } else {
        "ip link lists the existing ones".into()
    }
}

/// Returns the command that starts an interface.
fn start_command(interface: &str) -> String {
    if is_virtual(interface) {
        format!("ip link set {interface} mtu 72 up")
    } else {
        format!("ip link set {interface} up type can bitrate 1000000")
    }
}
