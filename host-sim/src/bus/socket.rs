//! An interface of the kernel: `can0`, `vcan0`.
//!
//! Classic CAN and CAN FD through one raw socket, error frames with them, own frames not. The kernel
//! stamps a frame when it comes, so that latencies are those of the bus and not of this program's turn;
//! stamps are brought to the clock that does not jump. The kernel drops frames that nobody fetches in
//! time and counts them; the count is asked for, so that no loss goes unseen. Where the interface's queue
//! is full (ENOBUFS, which no poll waits for) sending tries again for up to a second.

use super::link::wait;
use super::{Bus, BusError, Counters, LONGEST_WAIT, Received, WallClock, since_epoch_ns};
use crate::trace::CanFrame;
use rustix::event::PollFlags;
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketType, socket, sockopt};
use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, CanRemoteFrame,
    EmbeddedFrame, ExtendedId, Id, Socket, SocketOptions, StandardId,
};
use std::fs;
use std::io;
use std::os::fd::AsFd;
use std::thread;
use std::time::{Duration, Instant};

/// Room asked for in the kernel, bytes: some 5,000 frames; it may give less.
const BUFFER: usize = 4 << 20;
/// Between two tries to send.
const PAUSE: Duration = Duration::from_micros(200);

/// `SO_MEMINFO` and the place of the drops in it (`linux/sock_diag.h`).
const SO_MEMINFO: i32 = 55;
const SOL_SOCKET: i32 = 1;
const DROPS: usize = 8;

/// Kind of interface that is CAN (`ARPHRD_CAN`), and the packet of CAN FD.
const CAN_KIND: u32 = 280;
const FLEXIBLE_MTU: u32 = 72;

/// An interface of the kernel.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanFdSocket,
    name: String,
    flexible: bool,
    clock: WallClock,
    /// What the system's clock was ahead of ours when we last slept, ns.
    ahead_ns: i64,
    counters: Counters,
}

impl SocketCan {
    /// Opens an interface that is there and up.
    ///
    /// # Errors
    /// [`BusError::Open`], with the command that mends it.
    pub fn open(interface: &str) -> Result<Self, BusError> {
        let error = |why: String| BusError::Open { name: interface.into(), why };
        inspect(interface).map_err(error)?;
        let socket =
            CanFdSocket::open(interface).map_err(|cause| error(refusal(interface, cause)))?;
        let set = || {
            socket.set_nonblocking(true)?;
            socket.set_recv_timestamp(true)?;
            socket.set_error_filter_accept_all()
        };
        set().map_err(|cause| error(cause.to_string()))?;
        // Beyond the administrator's limit only root may go.
        if sockopt::set_socket_recv_buffer_size_force(&socket, BUFFER).is_err() {
            let _ = sockopt::set_socket_recv_buffer_size(&socket, BUFFER);
        }
        let flexible = property(interface, "mtu").is_none_or(|mtu| mtu >= FLEXIBLE_MTU);
        let (clock, counters) = (WallClock::new(), Counters::default());
        let ahead_ns = clock.system_ahead_ns();
        Ok(Self { socket, name: interface.into(), flexible, clock, ahead_ns, counters })
    }

    /// Whether the interface takes CAN FD.
    pub const fn is_flexible(&self) -> bool {
        self.flexible
    }

    fn failed(&self, source: io::Error) -> BusError {
        let name = self.name.clone();
        let closed = |why: &str| BusError::Closed { name: name.clone(), why: why.into() };
        match Errno::from_io_error(&source) {
            Some(Errno::NETDOWN) => {
                closed(&format!("the interface is down; ip link set {} up", self.name))
            }
            Some(Errno::NODEV | Errno::NXIO) => closed("the interface is gone"),
            _ => BusError::Io { name, source },
        }
    }

    /// Frames the kernel dropped for this socket.
    fn lost(&self) -> u64 {
        let mut bytes = [0; 4 * 9];
        let told = self.socket.get_socket_option_bytes(SOL_SOCKET, SO_MEMINFO, &mut bytes);
        let (words, _) = bytes.as_chunks::<4>();
        told.map_or(0, |_| u32::from_ne_bytes(words[DROPS]).into())
    }
}

impl Bus for SocketCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let unsupported = |what| BusError::Unsupported { name: self.name.clone(), what };
        if matches!(frame, CanFrame::Flexible { .. }) && !self.flexible {
            return Err(unsupported("CAN FD"));
        }
        let frame = to_kernel(frame).ok_or_else(|| unsupported("this frame"))?;
        let mut start: Option<Instant> = None;
        while let Err(error) = self.socket.write_frame(&frame) {
            match Errno::from_io_error(&error) {
                Some(Errno::INTR) => continue,
                Some(Errno::NOBUFS | Errno::AGAIN) => {}
                _ => return Err(self.failed(error)),
            }
            // Asked for here and not before: for most frames there is room.
            if start.is_some_and(|start| start.elapsed() >= LONGEST_WAIT) {
                let waited_ms = LONGEST_WAIT.as_millis() as u64;
                return Err(BusError::Full { name: self.name.clone(), waited_ms });
            }
            if start.is_none() {
                self.counters.waits += 1;
                start = Some(Instant::now());
            }
            thread::sleep(PAUSE);
        }
        self.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            match self.socket.read_frame_with_timestamps() {
                Ok((frame, stamps)) => {
                    let frame = from_kernel(&frame);
                    let ours = |stamp| since_epoch_ns(stamp).saturating_add_signed(-self.ahead_ns);
                    let stamp = stamps.socket.map(ours);
                    let time_ns = stamp.unwrap_or_else(|| self.clock.now_ns());
                    self.counters.received += 1;
                    let is_error = matches!(frame, CanFrame::Error { .. });
                    self.counters.errors += u64::from(is_error);
                    return Ok(Some(Received { time_ns, frame }));
                }
                Err(error) => match Errno::from_io_error(&error) {
                    Some(Errno::INTR) => continue,
                    Some(Errno::AGAIN) => {}
                    _ => return Err(self.failed(error)),
                },
            }
            let left = self.clock.left(until_ns);
            if left.is_zero() {
                return Ok(None);
            }
            wait(self.socket.as_fd(), PollFlags::IN, left).map_err(|error| self.failed(error))?;
            // Whoever sets the system's clock meanwhile shifts the stamps until here; asking for it at
            // each frame costs two clocks a frame.
            self.ahead_ns = self.clock.system_ahead_ns();
        }
    }

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn counters(&self) -> Counters {
        Counters { lost: self.lost(), ..self.counters }
    }
}

/// A number the kernel tells of an interface; `None` where it tells nothing.
fn property(interface: &str, what: &str) -> Option<u32> {
    let text = fs::read_to_string(format!("/sys/class/net/{interface}/{what}")).ok()?;
    let text = text.trim();
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// What is wrong with an interface, as far as can be seen from outside.
fn inspect(interface: &str) -> Result<(), String> {
    let Some(kind) = property(interface, "type") else { return Ok(()) };
    if kind != CAN_KIND {
        return Err("no CAN interface".into());
    }
    let up = property(interface, "flags").is_none_or(|flags| flags & 1 == 1);
    if up { Ok(()) } else { Err(format!("the interface is down; {}", bring_up(interface))) }
}

/// Why the kernel does not open it.
fn refusal(interface: &str, cause: io::Error) -> String {
    // Names are looked up first, so a kernel without CAN says that there is no such interface.
    let family = socket(AddressFamily::CAN, SocketType::RAW, None);
    if matches!(family, Err(Errno::AFNOSUPPORT)) {
        return "this kernel has no CAN; modprobe can-raw vcan, or use loop or slcan:".into();
    }
    match Errno::from_io_error(&cause) {
        Some(Errno::NODEV | Errno::NXIO) if interface.starts_with("vcan") => format!(
            "no such interface; ip link add dev {interface} type vcan && {}",
            bring_up(interface)
        ),
        Some(Errno::NODEV | Errno::NXIO) => {
            "no such interface; ip link shows those there are".into()
        }
        _ => cause.to_string(),
    }
}

fn bring_up(interface: &str) -> String {
    if interface.starts_with("vcan") {
        format!("ip link set {interface} mtu 72 up")
    } else {
        format!("ip link set {interface} up type can bitrate 1000000")
    }
}

fn identifier(number: u32, extended: bool) -> Option<Id> {
    if extended {
        ExtendedId::new(number).map(Id::Extended)
    } else {
        StandardId::new(u16::try_from(number).ok()?).map(Id::Standard)
    }
}

fn to_kernel(frame: &CanFrame) -> Option<CanAnyFrame> {
    Some(match *frame {
        CanFrame::Data { identifier: number, extended, .. } => {
            CanDataFrame::new(identifier(number, extended)?, frame.data())?.into()
        }
        CanFrame::Remote { identifier: number, extended, length } => {
            CanRemoteFrame::new_remote(identifier(number, extended)?, length.into())?.into()
        }
        CanFrame::Flexible { identifier: number, extended, flags, .. } => {
            let flags = FdFlags::from_bits_truncate(flags);
            CanFdFrame::with_flags(identifier(number, extended)?, frame.data(), flags)?.into()
        }
        CanFrame::Error { class, .. } => CanErrorFrame::new_error(class, frame.data()).ok()?.into(),
    })
}

fn from_kernel(frame: &CanAnyFrame) -> CanFrame {
    let (identifier, extended) = match frame.id() {
        Id::Standard(number) => (u32::from(number.as_raw()), false),
        Id::Extended(number) => (number.as_raw(), true),
    };
    let classic = |data: &[u8]| {
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        (data.len().min(8) as u8, bytes)
    };
    match frame {
        CanAnyFrame::Normal(frame) => {
            let (length, bytes) = classic(frame.data());
            CanFrame::Data { identifier, extended, length, bytes }
        }
        CanAnyFrame::Remote(frame) => {
            CanFrame::Remote { identifier, extended, length: frame.dlc().min(8) as u8 }
        }
        CanAnyFrame::Fd(frame) => {
            let mut bytes = [0; 64];
            bytes.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
            let length = frame.data().len().min(64) as u8;
            let flags = frame.flags().bits() & 0xF;
            CanFrame::Flexible { identifier, extended, flags, length, bytes }
        }
        CanAnyFrame::Error(frame) => {
            let (length, bytes) = classic(frame.data());
            CanFrame::Error { class: frame.error_bits(), length, bytes }
        }
    }
}
