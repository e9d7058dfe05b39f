//! A CAN bus as a trait: in this process, of the kernel, or behind a serial line.
//!
//! Replay, node, parameters and monitor use the trait [`Bus`] and do not depend on the kind of bus. Each bus has its own
//! clock, and every deadline is a time of that clock:
//!
//! * [`Hub`], the bus in this process, has virtual time. Two runs give the same bits.
//! * [`socket`] and [`slcan`] use the wall clock.
//!
//! The time of a frame is the time at which it was on the bus, not the time at which it was read.
//!
//! ```text
//! --bus loop | vcan0 | slcan:PATH|HOST:PORT      name -> Box<dyn Bus>
//! Recorder<B>, FaultInjector<B>                  around a bus, or around each other
//! ```
//!
//! A bus carries all frames of a log ([`CanFrame`]): data, remote, CAN FD and error frames. The frames of a joint
//! ([`compensator_core::can::Frame`]) are classic with 11-bit identifiers. `CanFrame::from(frame)` and
//! [`CanFrame::to_joint`] convert between both.

mod address;
mod bits;
mod fault;
mod hub;
mod link;
mod name;
mod open_error;
mod recorder;
pub mod slcan;
#[cfg(target_os = "linux")]
pub mod socket;

pub use address::Address;
pub use bits::BitRates;
pub use fault::{FaultCounters, FaultInjector, FaultPlan, Faults};
pub use hub::{Hub, Participant, Port};
pub use name::{BusName, BusNameError};
pub use open_error::OpenError;
pub use recorder::Recorder;

use joint_trace::CanFrame;
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::io;
use std::time::{Duration, SystemTime};

/// A received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Time on the bus, ns of the bus clock; not later than [`Bus::now_ns`].
    pub time_ns: u64,
    /// The frame.
    pub frame: CanFrame,
}

/// Event counters of a bus since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Sent frames.
    pub sent: u64,
    /// Received frames, error frames included.
    pub received: u64,
    /// Error frames among them.
    pub errors: u64,
    /// Frames for this node that the kernel or a full queue dropped.
    pub lost: u64,
    /// Number of times that sending waited for room.
    pub waits: u64,
    /// Malformed lines of an adapter.
    pub garbage: u64,
    /// Refusals of an adapter (BEL).
    pub refused: u64,
}

/// Error of a bus; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum BusError {
    /// The bus cannot be opened.
    #[error("bus {name}: {source}")]
    Open { name: String, source: OpenError },
    /// The other end of a serial line is gone.
    #[error("bus {name}: {why}")]
    Closed { name: String, why: String },
    /// The interface is down or was removed.
    #[error("bus {name}: {why}")]
    NoInterface { name: String, why: String },
    /// There was no room for a frame within the time limit.
    #[error(
        "bus {name}: no room to send for {waited_ms} ms; check that another node acknowledges frames"
    )]
    Full { name: String, waited_ms: u64 },
    /// This bus does not carry this kind of frame.
    #[error("bus {name}: {what} cannot be sent on it")]
    Unsupported { name: String, what: &'static str },
    /// Participants on a loop answer each other without end, so time does not advance.
    #[error("bus loop: {events} events in one instant: participants answer each other without end")]
    Storm { events: u32 },
    /// The recording cannot be written.
    #[error("recording of the bus: {0}")]
    Record(#[source] io::Error),
    /// The operating system returned an error.
    #[error("bus {name}: {source}")]
    Io { name: String, source: io::Error },
}

/// A node's access to a CAN bus.
///
/// A node does not receive its own frames. Times are those of the bus clock, in ns: since the epoch on a real bus, from 0
/// on a [`Hub`].
pub trait Bus {
    /// Sends a frame. Waits while there is no room.
    ///
    /// # Errors
    /// Returns an error if the bus does not carry this kind of frame, is closed, or has no room within the time limit.
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError>;

    /// Returns the next frame, and waits for it until the bus time `until_ns`. Does not wait if that time has passed.
    /// Returns `None` if no frame arrived.
    ///
    /// # Errors
    /// Returns an error if the bus is closed. Malformed input is counted and skipped.
    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError>;

    /// Returns the bus time, ns.
    fn now_ns(&self) -> u64;

    /// Sleeps until the bus time `until_ns` (0: not at all) without receiving. Frames that arrive meanwhile are kept with
    /// their time of arrival. Returns `false` at once if this bus stamps frames when they are read.
    fn sleep_until(&mut self, _until_ns: u64) -> bool {
        false
    }

    /// Returns the event counters.
    fn counters(&self) -> Counters;

    /// Receives like [`Bus::receive`], with a duration from now as the limit.
    ///
    /// # Errors
    /// See [`Bus::receive`].
    fn receive_within(&mut self, time: Duration) -> Result<Option<Received>, BusError> {
        let until_ns = self.now_ns().saturating_add(nanoseconds(time));
        self.receive(until_ns)
    }

    /// Waits for a duration from now. Frames that arrive meanwhile are discarded.
    ///
    /// # Errors
    /// See [`Bus::receive`].
    fn discard_within(&mut self, time: Duration) -> Result<(), BusError> {
        let until_ns = self.now_ns().saturating_add(nanoseconds(time));
        while self.receive(until_ns)?.is_some() {}
        Ok(())
    }
}

/// Implements [`Bus`] for a pointer to one.
macro_rules! forward_bus {
    ($pointer:ty) => {
        impl<B: Bus + ?Sized> Bus for $pointer {
            fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
                (**self).send(frame)
            }

            fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
                (**self).receive(until_ns)
            }

            fn now_ns(&self) -> u64 {
                (**self).now_ns()
            }

            fn sleep_until(&mut self, until_ns: u64) -> bool {
                (**self).sleep_until(until_ns)
            }

            fn counters(&self) -> Counters {
                (**self).counters()
            }
        }
    };
}

forward_bus!(Box<B>);
forward_bus!(&mut B);

/// Clock of a real bus. It counts from the epoch, and does not jump when the system time is set.
#[derive(Clone, Copy, Debug)]
struct WallClock {
    /// Offset to the kernel's monotonic clock, ns.
    offset_ns: u64,
}

impl WallClock {
    fn new() -> Self {
        let system_ns = since_epoch_ns(SystemTime::now());
        Self { offset_ns: system_ns.saturating_sub(monotonic_ns()) }
    }

    fn now_ns(&self) -> u64 {
        monotonic_ns().saturating_add(self.offset_ns)
    }

    /// Sleeps until the time `until_ns`. An absolute time avoids reading the clock first.
    #[cfg(target_os = "linux")]
    fn sleep(&self, until_ns: u64) {
        let until = Duration::from_nanos(until_ns.saturating_sub(self.offset_ns));
        if let Ok(until) = Timespec::try_from(until) {
            // A signal may end the sleep early.
            let _ = rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &until);
        }
    }

    /// Returns the system clock minus this clock, ns.
    fn system_offset_ns(&self) -> i64 {
        since_epoch_ns(SystemTime::now()).cast_signed() - self.now_ns().cast_signed()
    }

    fn left(&self, until_ns: u64) -> Duration {
        Duration::from_nanos(until_ns.saturating_sub(self.now_ns()))
    }
}

fn monotonic_ns() -> u64 {
    // Neither value is negative, because the clock counts from the start of the machine.
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.cast_unsigned() * 1_000_000_000 + now.tv_nsec as u64
}

fn since_epoch_ns(time: SystemTime) -> u64 {
    nanoseconds(time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default())
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// Time limit for sending when there is no room.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
