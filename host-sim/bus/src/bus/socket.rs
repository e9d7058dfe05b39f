//! A CAN interface of the Linux kernel, for example `can0` or `vcan0`.
//!
//! One raw socket carries classic CAN, CAN FD and error frames; own frames are not received.
//!
//! * The kernel stamps a frame on arrival, so a latency does not include the scheduling of this program. The stamps are
//!   converted to a clock that does not jump.
//! * All waiting frames are fetched in one system call, because on a busy bus the calls dominate the cost.
//! * The kernel drops frames that are not fetched in time. Its drop counter is reported in [`Counters::lost`].
//! * If the queue of the interface is full (ENOBUFS, which poll does not report), sending retries for up to a second.

use super::link::wait;
use super::{Bus, BusError, Counters, OpenError, Received, SEND_TIMEOUT, WallClock, nanoseconds};
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

/// Requested receive buffer in the kernel, bytes: about 5,000 frames.
const RECEIVE_BUFFER_BYTES: usize = 4 << 20;
/// Maximum number of frames in one fetch.
const BATCH_FRAMES: usize = 32;
/// Size of the largest frame in the kernel, bytes.
const MAX_FRAME_BYTES: usize = 72;
/// Interval between comparisons of the system clock with ours, ns. After a change of the system time, stamps are wrong for
/// at most this time.
const CLOCK_COMPARISON_INTERVAL_NS: u64 = 100_000_000;
/// Pause between two attempts to send.
const SEND_RETRY_PAUSE: Duration = Duration::from_micros(200);

/// `SO_MEMINFO` and the index of the drop counter in it (`linux/sock_diag.h`).
const SO_MEMINFO: i32 = 55;
const SOL_SOCKET: i32 = 1;
const DROP_COUNTER_INDEX: usize = 8;

/// Interface type of CAN (`ARPHRD_CAN`).
const CAN_INTERFACE_TYPE: u32 = 280;
/// MTU of an interface with CAN FD, bytes.
const CAN_FD_MTU_BYTES: u32 = 72;

/// A CAN interface of the kernel.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanFdSocket,
    name: String,
    flexible: bool,
    clock: WallClock,
    /// System clock minus our clock at the last comparison, ns.
    system_offset_ns: i64,
    /// System time of the last comparison, ns.
    compared_ns: u64,
    /// Fetched frames that were not returned yet.
    fetched: VecDeque<Received>,
    /// True if the last fetch emptied the kernel's queue.
    drained: bool,
    counters: Counters,
}

impl SocketCan {
    /// Opens an interface, which must exist and be up.
    ///
    /// # Errors
    /// Returns [`BusError::Open`] with the command that corrects the cause.
    pub fn open(interface: &str) -> Result<Self, BusError> {
        let error = |source| BusError::Open { name: interface.into(), source };
        inspect(interface).map_err(error)?;
        let socket =
            CanFdSocket::open(interface).map_err(|cause| error(open_error(interface, cause)))?;
        let set = || {
            socket.set_nonblocking(true)?;
            socket.set_recv_timestamp(true)?;
            socket.set_error_filter_accept_all()
        };
        set().map_err(|cause: io::Error| error(cause.into()))?;
        // Only root may exceed the administrator's limit.
        if sockopt::set_socket_recv_buffer_size_force(&socket, RECEIVE_BUFFER_BYTES).is_err() {
            let _ = sockopt::set_socket_recv_buffer_size(&socket, RECEIVE_BUFFER_BYTES);
        }
        let flexible = property(interface, "mtu").is_none_or(|mtu| mtu >= CAN_FD_MTU_BYTES);
        Ok(Self {
            socket,
            name: interface.into(),
            flexible,
            clock: WallClock::new(),
            system_offset_ns: 0,
            compared_ns: 0,
            fetched: VecDeque::with_capacity(BATCH_FRAMES),
            drained: false,
            counters: Counters::default(),
        })
    }

    /// Returns true if the interface supports CAN FD.
    pub const fn supports_can_fd(&self) -> bool {
        self.flexible
    }

    fn failed(&self, source: io::Error) -> BusError {
        let name = self.name.clone();
        let missing = |why: &str| BusError::NoInterface { name: name.clone(), why: why.into() };
        match Errno::from_io_error(&source) {
            Some(Errno::NETDOWN) => {
                missing(&format!("the interface is down; ip link set {} up", self.name))
            }
            Some(Errno::NODEV | Errno::NXIO) => missing("the interface was removed"),
            _ => BusError::Io { name, source },
        }
    }

    /// Fetches all waiting frames without blocking.
    fn fetch(&mut self) -> Result<(), BusError> {
        // Allocated for each call, because a call stores the used length in the headers, which limits the next one.
        let mut headers =
            MultiHeaders::<()>::preallocate(BATCH_FRAMES, Some(nix::cmsg_space!(TimeSpec)));
        let mut frames = [[0; MAX_FRAME_BYTES]; BATCH_FRAMES];
        let mut slices = frames.each_mut().map(|frame| [IoSliceMut::new(frame)]);
        let (socket, flags) = (self.socket.as_raw_fd(), MsgFlags::MSG_DONTWAIT);
        let mut found = [(0, None); BATCH_FRAMES];
        let count = match recvmmsg(socket, &mut headers, &mut slices, flags, None) {
            Ok(messages) => {
                let places = found.iter_mut().zip(messages);
                places.map(|(place, message)| *place = (message.bytes, stamp_ns(&message))).count()
            }
            Err(nix::Error::EAGAIN | nix::Error::EINTR) => 0,
            Err(error) => return Err(self.failed(error.into())),
        };
        self.drained = count < BATCH_FRAMES;
        for (bytes, (length, stamp_ns)) in frames.iter().zip(found).take(count) {
            let Some(frame) = from_kernel(&bytes[..length]) else { continue };
            let time_ns = match stamp_ns {
                Some(stamp_ns) => self.bus_time_ns(stamp_ns),
                None => self.clock.now_ns(),
            };
            self.counters.received += 1;
            self.counters.errors += u64::from(matches!(frame, CanFrame::Error { .. }));
            self.fetched.push_back(Received { time_ns, frame });
        }
        Ok(())
    }

    /// Converts a time of the system clock to the bus clock.
    fn bus_time_ns(&mut self, stamp_ns: u64) -> u64 {
        if stamp_ns.abs_diff(self.compared_ns) > CLOCK_COMPARISON_INTERVAL_NS {
            self.compared_ns = stamp_ns;
            self.system_offset_ns = self.clock.system_offset_ns();
        }
        stamp_ns.saturating_add_signed(-self.system_offset_ns)
    }

    /// Returns the number of frames that the kernel dropped for this socket.
    fn lost(&self) -> u64 {
        let mut bytes = [0; 4 * 9];
        let option = self.socket.get_socket_option_bytes(SOL_SOCKET, SO_MEMINFO, &mut bytes);
        let (words, _) = bytes.as_chunks::<4>();
        option.map_or(0, |_| u32::from_ne_bytes(words[DROP_COUNTER_INDEX]).into())
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
            // The clock is read only here, because most frames find room at once.
            if start.is_some_and(|start| start.elapsed() >= SEND_TIMEOUT) {
                let waited_ms = SEND_TIMEOUT.as_millis() as u64;
                return Err(BusError::Full { name: self.name.clone(), waited_ms });
            }
            if start.is_none() {
                self.counters.waits += 1;
                start = Some(Instant::now());
            }
            thread::sleep(SEND_RETRY_PAUSE);
        }
        self.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            if let Some(received) = self.fetched.pop_front() {
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
            if self.fetched.is_empty() && self.clock.left(until_ns).is_zero() {
                return Ok(None);
            }
        }
    }

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn sleep_until(&mut self, until_ns: u64) -> bool {
        if until_ns > 0 {
            self.clock.sleep(until_ns);
        }
        true
    }

    fn counters(&self) -> Counters {
        Counters { lost: self.lost(), ..self.counters }
    }
}

/// Returns a numeric property of an interface, or `None` if the kernel does not provide it.
fn property(interface: &str, what: &str) -> Option<u32> {
    let text = fs::read_to_string(format!("/sys/class/net/{interface}/{what}")).ok()?;
    let text = text.trim();
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Checks the type and state of an interface.
fn inspect(interface: &str) -> Result<(), OpenError> {
    let Some(kind) = property(interface, "type") else { return Ok(()) };
    if kind != CAN_INTERFACE_TYPE {
        return Err(OpenError::OtherInterface);
    }
    let up = property(interface, "flags").is_none_or(|flags| flags & 1 == 1);
    if up { Ok(()) } else { Err(OpenError::Down(interface.into())) }
}

/// Returns the reason why an interface cannot be opened, and the remedy.
fn open_error(interface: &str, cause: io::Error) -> OpenError {
    // The kernel looks up the name first, so without CAN support it reports an unknown interface.
    let family = socket(AddressFamily::CAN, SocketType::RAW, None);
    if matches!(family, Err(Errno::AFNOSUPPORT)) {
        return OpenError::NoCan;
    }
    match Errno::from_io_error(&cause) {
        Some(Errno::NODEV | Errno::NXIO) => OpenError::NoInterface(interface.into()),
        _ => cause.into(),
    }
}

fn identifier(number: u32, extended: bool) -> Option<Id> {
    if extended {
        ExtendedId::new(number).map(Id::Extended)
    } else {
        StandardId::new(u16::try_from(number).ok()?).map(Id::Standard)
    }
}

/// Returns the arrival time of a frame, ns of the system clock, if the kernel provides it.
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

/// Parses a frame of the kernel (`struct can_frame`, `struct canfd_frame` of `linux/can.h`). Returns `None` if the size
/// matches neither.
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

    fn kernel_frame(word: u32, length: u8, flags: u8, data: &[u8]) -> Vec<u8> {
        let head = [&word.to_ne_bytes()[..], &[length, flags, 0, 0]].concat();
        [&head, data].concat()
    }

    #[test]
    fn from_kernel_with_each_kind_of_frame_returns_it() {
        let frame = |word, length| from_kernel(&kernel_frame(word, length, 0, &[7; 8])).unwrap();
        let bytes = [7, 7, 0, 0, 0, 0, 0, 0];
        let data = CanFrame::Data { identifier: 0x123, extended: false, length: 2, bytes };
        assert_eq!(frame(0x123, 2), data);
        let identifier = 0x1FFF_FFFF;
        let data = CanFrame::Data { identifier, extended: true, length: 8, bytes: [7; 8] };
        // A raw length code can exceed the data length.
        assert_eq!(frame(0x9FFF_FFFF, 15), data);
        let remote = CanFrame::Remote { identifier: 0x123, extended: false, length: 4 };
        assert_eq!(frame(0x4000_0123, 4), remote);
        let error = CanFrame::Error { class: 0x4, length: 8, bytes: [7; 8] };
        assert_eq!(frame(0x2000_0004, 8), error);
        let found = from_kernel(&kernel_frame(0x123, 12, 0xF5, &[9; 64])).unwrap();
        assert_eq!((found.data(), found.data().len()), (&[9; 12][..], 12));
        assert!(matches!(found, CanFrame::Flexible { identifier: 0x123, flags: 5, .. }));
        for length in [0, 7, 15, 17, 71] {
            assert_eq!(from_kernel(&vec![0; length]), None);
        }
    }
}
