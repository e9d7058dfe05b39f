//! An interface of the kernel: `can0`, `vcan0`.
//!
//! Classic CAN and CAN FD through one raw socket, error frames with them, own frames not. The kernel
//! stamps a frame when it comes, so that latencies are those of the bus and not of this program's turn;
//! stamps are brought to the clock that does not jump. What has come is fetched all at once: on a busy
//! bus a call of the system costs more than what is done with a frame. The kernel drops frames that nobody
//! fetches in time and counts them; the count is asked for, so that no loss goes unseen. Where the
//! interface's queue is full (ENOBUFS, which no poll waits for) sending tries again for up to a second.

use super::link::wait;
use super::{Bus, BusError, Counters, LONGEST_WAIT, Received, WallClock, nanoseconds};
use joint_trace::CanFrame;
use nix::sys::socket::{ControlMessageOwned, MsgFlags, MultiHeaders, RecvMsg, recvmmsg};
use nix::sys::time::TimeSpec;
use rustix::event::PollFlags;
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketType, socket, sockopt};
use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, CanRemoteFrame,
    EmbeddedFrame, ExtendedId, Id, Socket, SocketOptions, StandardId,
};
use std::collections::VecDeque;
use std::fs;
use std::io::{self, IoSliceMut};
use std::os::fd::{AsFd, AsRawFd};
use std::thread;
use std::time::{Duration, Instant};

/// Room asked for in the kernel, bytes: some 5,000 frames; it may give less.
const BUFFER: usize = 4 << 20;
/// Frames fetched at once, and the size of the largest.
const BATCH: usize = 32;
const LARGEST: usize = 72;
/// How often the system's clock is compared with ours, ns: whoever sets it shifts stamps for so long.
const COMPARED_EVERY_NS: u64 = 100_000_000;
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
    /// What the system's clock was ahead of ours when they were last compared, and the stamp then, ns.
    ahead_ns: i64,
    compared_ns: u64,
    /// Frames fetched and not yet asked for.
    heard: VecDeque<Received>,
    /// The last time there was no more to fetch.
    drained: bool,
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
        Ok(Self {
            socket,
            name: interface.into(),
            flexible,
            clock: WallClock::new(),
            ahead_ns: 0,
            compared_ns: 0,
            heard: VecDeque::with_capacity(BATCH),
            drained: false,
            counters: Counters::default(),
        })
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

    /// Fetches what has come, without waiting.
    fn fetch(&mut self) -> Result<(), BusError> {
        // Made anew: a call leaves in the headers how much it put there, and the next would have no more room.
        let mut headers = MultiHeaders::<()>::preallocate(BATCH, Some(nix::cmsg_space!(TimeSpec)));
        let mut frames = [[0; LARGEST]; BATCH];
        let mut slices = frames.each_mut().map(|frame| [IoSliceMut::new(frame)]);
        let (socket, flags) = (self.socket.as_raw_fd(), MsgFlags::MSG_DONTWAIT);
        let mut found = [(0, None); BATCH];
        let count = match recvmmsg(socket, &mut headers, &mut slices, flags, None) {
            Ok(messages) => {
                let places = found.iter_mut().zip(messages);
                places.map(|(place, message)| *place = (message.bytes, stamp_ns(&message))).count()
            }
            Err(nix::Error::EAGAIN | nix::Error::EINTR) => 0,
            Err(error) => return Err(self.failed(error.into())),
        };
        self.drained = count < BATCH;
        for (bytes, (length, stamp_ns)) in frames.iter().zip(found).take(count) {
            let Some(frame) = from_kernel(&bytes[..length]) else { continue };
            let time_ns = match stamp_ns {
                Some(stamp_ns) => self.ours(stamp_ns),
                None => self.clock.now_ns(),
            };
            self.counters.received += 1;
            self.counters.errors += u64::from(matches!(frame, CanFrame::Error { .. }));
            self.heard.push_back(Received { time_ns, frame });
        }
        Ok(())
    }

    /// What our clock said when the system's said this.
    fn ours(&mut self, stamp_ns: u64) -> u64 {
        if stamp_ns.abs_diff(self.compared_ns) > COMPARED_EVERY_NS {
            self.compared_ns = stamp_ns;
            self.ahead_ns = self.clock.system_ahead_ns();
        }
        stamp_ns.saturating_add_signed(-self.ahead_ns)
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
            if let Some(received) = self.heard.pop_front() {
                return Ok(Some(received));
            }
            let left = self.clock.left(until_ns);
            let mut came = true;
            if self.drained && !left.is_zero() {
                came = wait(self.socket.as_fd(), PollFlags::IN, left)
                    .map_err(|error| self.failed(error))?;
            }
            if came {
                self.fetch()?;
            }
            if self.heard.is_empty() && self.clock.left(until_ns).is_zero() {
                return Ok(None);
            }
        }
    }

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn rest(&mut self, until_ns: u64) -> bool {
        if until_ns > 0 {
            self.clock.sleep(until_ns);
        }
        true
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

/// When a frame came, ns of the system's clock, where the kernel says so.
fn stamp_ns(message: &RecvMsg<'_, '_, ()>) -> Option<u64> {
    message.cmsgs().ok()?.find_map(|about| match about {
        ControlMessageOwned::ScmTimestampns(stamp) => Some(nanoseconds(Duration::from(stamp))),
        _ => None,
    })
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

/// A frame as the kernel hands it over (`struct can_frame`, `struct canfd_frame` of `linux/can.h`);
/// `None` for what is neither.
fn from_kernel(bytes: &[u8]) -> Option<CanFrame> {
    const EXTENDED: u32 = 1 << 31;
    const REMOTE: u32 = 1 << 30;
    const ERROR: u32 = 1 << 29;
    let (head, data) = bytes.split_first_chunk::<8>()?;
    let [a, b, c, d, length, flags, ..] = *head;
    let word = u32::from_ne_bytes([a, b, c, d]);
    let extended = word & EXTENDED != 0;
    let identifier = word & if extended { 0x1FFF_FFFF } else { 0x7FF };
    if let Ok(bytes) = <[u8; 64]>::try_from(data) {
        let length = length.min(64);
        return Some(CanFrame::Flexible {
            identifier,
            extended,
            flags: flags & 0xF,
            length,
            bytes,
        });
    }
    let (mut bytes, length) = (<[u8; 8]>::try_from(data).ok()?, length.min(8));
    bytes[usize::from(length)..].fill(0);
    Some(if word & ERROR != 0 {
        CanFrame::Error { class: word & 0x1FFF_FFFF, length, bytes }
    } else if word & REMOTE != 0 {
        CanFrame::Remote { identifier, extended, length }
    } else {
        CanFrame::Data { identifier, extended, length, bytes }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernels(word: u32, length: u8, flags: u8, data: &[u8]) -> Vec<u8> {
        let head = [&word.to_ne_bytes()[..], &[length, flags, 0, 0]].concat();
        [&head, data].concat()
    }

    #[test]
    fn frames_of_the_kernel_are_understood() {
        let frame = |word, length| from_kernel(&kernels(word, length, 0, &[7; 8])).unwrap();
        let bytes = [7, 7, 0, 0, 0, 0, 0, 0];
        let data = CanFrame::Data { identifier: 0x123, extended: false, length: 2, bytes };
        assert_eq!(frame(0x123, 2), data);
        let identifier = 0x1FFF_FFFF;
        let data = CanFrame::Data { identifier, extended: true, length: 8, bytes: [7; 8] };
        // A length beyond the data is what raw length codes would give.
        assert_eq!(frame(0x9FFF_FFFF, 15), data);
        let remote = CanFrame::Remote { identifier: 0x123, extended: false, length: 4 };
        assert_eq!(frame(0x4000_0123, 4), remote);
        let error = CanFrame::Error { class: 0x4, length: 8, bytes: [7; 8] };
        assert_eq!(frame(0x2000_0004, 8), error);
        let found = from_kernel(&kernels(0x123, 12, 0xF5, &[9; 64])).unwrap();
        assert_eq!((found.data(), found.data().len()), (&[9; 12][..], 12));
        assert!(matches!(found, CanFrame::Flexible { identifier: 0x123, flags: 5, .. }));
        for length in [0, 7, 15, 17, 71] {
            assert_eq!(from_kernel(&vec![0; length]), None);
        }
    }
}
