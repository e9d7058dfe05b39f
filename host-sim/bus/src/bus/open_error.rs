//! Why a bus cannot be opened, and the remedy.

use compensator_core::can::slcan::AdapterCommand;
use std::io;

/// Reason why a bus cannot be opened; with the remedy where one is known.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The path of an adapter does not exist.
    #[error("no such device or socket; check that it is connected")]
    NoDevice,
    /// The path is that of a file or folder.
    #[error("neither a serial device nor a socket")]
    NoStream,
    /// The path is that of another device.
    #[error("not a serial device")]
    NotSerial,
    /// The user may not open the device.
    #[error("{0}; join the group of the device (often dialout) or run as root")]
    Denied(io::Error),
    /// Another program has locked the device.
    #[error("in use by another program")]
    InUse,
    /// The device does not support this rate.
    #[error("the device has no baud rate of {0}")]
    BaudRate(u32),
    /// A name has no address.
    #[error("unknown host")]
    UnknownHost,
    /// The adapter answers a command with BEL.
    #[error("the adapter refuses {0:?}")]
    Refused(AdapterCommand),
    /// The kernel supports no CAN.
    #[error("this kernel has no CAN; modprobe can-raw vcan, or use loop or slcan:")]
    NoCan,
    /// The system is not Linux.
    #[error("CAN interfaces need Linux; use slcan:PATH or loop")]
    NeedsLinux,
    /// The interface is one of another network.
    #[error("not a CAN interface")]
    OtherInterface,
    /// The interface does not exist.
    #[error("no such interface; {}", creation(.0))]
    NoInterface(String),
    /// The interface is down.
    #[error("the interface is down; {}", start_command(.0))]
    Down(String),
    /// Any other error of the operating system.
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
