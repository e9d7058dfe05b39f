//! A CAN bus as a trait: in this process, of the kernel, or behind a serial line.
//!
//! Whoever talks to a joint (replay, node, parameters, monitor) talks to a [`Bus`] and cannot tell which.
//! Each bus has its own clock, and waiting is said in its time: on [`Hub`], the bus in this process,
//! time is virtual, passes in no time at all, and is the same bit for bit from run to run; on
//! [`socket`] and [`slcan`] it is the wall clock's. A frame has the time it was on the bus, not the time
//! somebody looked.
//!
//! ```text
//! --bus loop | vcan0 | slcan:PATH|HOST:PORT      name -> Box<dyn Bus>
//! Recorder<B>, FaultInjector<B>                  around any of them, or each other
//! ```
//!
//! Frames are those of a log ([`CanFrame`]): data, remote, CAN FD and error frames, so that nothing a bus
//! does is out of sight. A joint's own frames ([`compensator_core::can::Frame`]) are the classic ones of
//! 11 bits: `CanFrame::from(frame)` and [`CanFrame::to_joint`] go to and fro.

mod address;
mod bits;
mod fault;
mod hub;
mod link;
mod name;
mod recorder;
pub mod slcan;
#[cfg(target_os = "linux")]
pub mod socket;

pub use address::Address;
pub use bits::BitRates;
pub use fault::{FaultCounters, FaultInjector, FaultPlan, Faults};
pub use hub::{Hub, Participant, Port};
pub use name::{BusName, BusNameError};
pub use recorder::Recorder;

use joint_trace::CanFrame;
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::io;
use std::time::{Duration, SystemTime};

/// A frame heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// When it was on the bus, ns of the bus's clock: not later than [`Bus::now_ns`].
    pub time_ns: u64,
    /// What it was.
    pub frame: CanFrame,
}

/// What happened on a bus since it was opened, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames given to the bus.
    pub sent: u64,
    /// Frames heard from others, error frames too.
    pub received: u64,
    /// Error frames among them.
    pub errors: u64,
    /// Frames that were for us and that the kernel, or a full queue, lost.
    pub lost: u64,
    /// Times there was no room and sending waited.
    pub waits: u64,
    /// Lines of an adapter that made no sense.
    pub garbage: u64,
    /// Bells of an adapter: it refused something.
    pub refused: u64,
}

/// Why a bus does not do what it was asked to; one line.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// It cannot be opened.
    #[error("bus {name}: {why}")]
    Open {
        /// What was asked for.
        name: String,
        /// What is wrong, and what to do.
        why: String,
    },
    /// The other end is gone, or the interface is down.
    #[error("bus {name}: {why}")]
    Closed {
        /// Which bus.
        name: String,
        /// How that showed.
        why: String,
    },
    /// There was no room for a frame for too long.
    #[error(
        "bus {name}: no room to send for {waited_ms} ms: is another node there to acknowledge?"
    )]
    Full {
        /// Which bus.
        name: String,
        /// How long was waited, ms.
        waited_ms: u64,
    },
    /// This bus has no such frames.
    #[error("bus {name}: {what} cannot be sent on it")]
    Unsupported {
        /// Which bus.
        name: String,
        /// Such frames.
        what: &'static str,
    },
    /// Participants on a loop answer each other and time stands still.
    #[error("bus loop: {events} events in one instant: participants answer each other without end")]
    Storm {
        /// How many.
        events: u32,
    },
    /// The record of it cannot be written.
    #[error("record of the bus: {0}")]
    Record(#[source] io::Error),
    /// The system refused.
    #[error("bus {name}: {source}")]
    Io {
        /// Which bus.
        name: String,
        /// What it said.
        source: io::Error,
    },
}

/// A place on a CAN bus.
///
/// Own frames are not heard. Time is that of the bus, in ns: of the epoch on a real bus, from 0 on a
/// [`Hub`].
pub trait Bus {
    /// Gives a frame to the bus; waits where there is no room yet.
    ///
    /// # Errors
    /// What the bus does not have, a bus that is gone, a bus that takes nothing.
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError>;

    /// The next frame, waiting for it until the clock says `until_ns`; at once with what is there where
    /// that time has come. `None` when it has and nothing was heard.
    ///
    /// # Errors
    /// A bus that is gone. What makes no sense is counted and passed over.
    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError>;

    /// What the clock of the bus says.
    fn now_ns(&self) -> u64;

    /// Sleeps until the clock says `until_ns` (0: not at all) without listening: what comes meanwhile is kept,
    /// with the time at which it came, and nobody is woken for it. `false`, at once, where frames are
    /// stamped by who hears them, so that one has to listen.
    fn rest(&mut self, _until_ns: u64) -> bool {
        false
    }

    /// What has happened so far.
    fn counters(&self) -> Counters;

    /// As [`Bus::receive`], for so long from now.
    ///
    /// # Errors
    /// As [`Bus::receive`].
    fn receive_within(&mut self, time: Duration) -> Result<Option<Received>, BusError> {
        let until_ns = self.now_ns().saturating_add(nanoseconds(time));
        self.receive(until_ns)
    }
}

impl<B: Bus + ?Sized> Bus for Box<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        (**self).receive(until_ns)
    }

    fn now_ns(&self) -> u64 {
        (**self).now_ns()
    }

    fn rest(&mut self, until_ns: u64) -> bool {
        (**self).rest(until_ns)
    }

    fn counters(&self) -> Counters {
        (**self).counters()
    }
}

impl<B: Bus + ?Sized> Bus for &mut B {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        (**self).receive(until_ns)
    }

    fn now_ns(&self) -> u64 {
        (**self).now_ns()
    }

    fn rest(&mut self, until_ns: u64) -> bool {
        (**self).rest(until_ns)
    }

    fn counters(&self) -> Counters {
        (**self).counters()
    }
}

/// The clock of a real bus: of the epoch, as a log wants it, but it never jumps, whoever sets the time.
#[derive(Clone, Copy, Debug)]
struct WallClock {
    /// What it is ahead of the kernel's monotonic clock, ns.
    ahead_ns: u64,
}

impl WallClock {
    fn new() -> Self {
        let system_ns = since_epoch_ns(SystemTime::now());
        Self { ahead_ns: system_ns.saturating_sub(monotonic_ns()) }
    }

    fn now_ns(&self) -> u64 {
        monotonic_ns().saturating_add(self.ahead_ns)
    }

    /// Sleeps until it says `until_ns`. Said as a time and not as a duration, so that nobody has to ask
    /// what time it is first.
    #[cfg(target_os = "linux")]
    fn sleep(&self, until_ns: u64) {
        let until = Duration::from_nanos(until_ns.saturating_sub(self.ahead_ns));
        if let Ok(until) = Timespec::try_from(until) {
            // A signal ends it early, which a wait may.
            let _ = rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &until);
        }
    }

    /// What the system's clock is ahead of this one, ns.
    fn system_ahead_ns(&self) -> i64 {
        since_epoch_ns(SystemTime::now()).cast_signed() - self.now_ns().cast_signed()
    }

    fn left(&self, until_ns: u64) -> Duration {
        Duration::from_nanos(until_ns.saturating_sub(self.now_ns()))
    }
}

fn monotonic_ns() -> u64 {
    // Neither is negative: the clock counts from the start of the machine.
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.cast_unsigned() * 1_000_000_000 + now.tv_nsec as u64
}

fn since_epoch_ns(time: SystemTime) -> u64 {
    nanoseconds(time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default())
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// How long sending waits for room.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
