//! A bus in this process, in virtual time.
//!
//! There are two kinds of station. A [`Port`] is a [`Bus`] whose caller sends and waits. A [`Participant`], such as a joint
//! driver, is called with its frames and at the times it requests. Time advances only while a caller waits on a port, from
//! one event to the next. So the same calls give the same frames at the same nanoseconds. Everything runs in the thread
//! that waits.
//!
//! At one instant, frames arrive before participants are called, and stations are served in the order in which they
//! joined. Without bit rates, a frame takes no time. With bit rates, each frame takes its time on the wire, and the lowest
//! identifier wins the arbitration. Within a station, frames are sent in order, as in the kernel's queue.

use super::{BitRates, Bus, BusError, Counters, Received, SEND_TIMEOUT, nanoseconds};
use joint_trace::CanFrame;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Maximum number of waiting frames of a port; the default of a Linux interface.
const MAX_QUEUED_FRAMES: usize = 10;
/// Maximum number of events in one instant before [`BusError::Storm`].
const MAX_EVENTS_PER_INSTANT: u32 = 1_000_000;

/// A station that the hub calls, such as a joint driver. Times are those of the hub. A participant must not own a port,
/// because the hub is borrowed during the call.
pub trait Participant {
    /// Processes a frame on the bus.
    fn receive(&mut self, frame: &CanFrame, now_ns: u64);

    /// Runs at a requested time. Returns the next requested time, or `None` for none.
    fn tick(&mut self, now_ns: u64) -> Option<u64>;

    /// Returns the next frame to send. Called until it returns `None`, after each of the other methods.
    fn transmit(&mut self) -> Option<CanFrame>;
}

impl<P: Participant + ?Sized> Participant for Rc<RefCell<P>> {
    fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        self.borrow_mut().receive(frame, now_ns);
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.borrow_mut().tick(now_ns)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.borrow_mut().transmit()
    }
}

/// The bus. A clone is a handle of the same bus.
#[derive(Clone, Default)]
pub struct Hub(Rc<RefCell<Wire>>);

impl Hub {
    /// Creates a bus on which frames take no time.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a bus on which frames take their time on the wire.
    pub fn with_bit_rates(rates: BitRates) -> Self {
        let wire = Wire { rates: Some(rates), ..Wire::default() };
        Self(Rc::new(RefCell::new(wire)))
    }

    /// Limits the speed of virtual time to `rate` times the wall clock, for live display. The events stay the same.
    pub fn keep_pace(&self, rate: f64) {
        let mut wire = self.0.borrow_mut();
        let (since, since_ns) = (Instant::now(), wire.now_ns);
        wire.pace = Some(Pace { since, since_ns, rate: rate.max(1e-6) });
    }

    /// Adds a port to the bus.
    pub fn port(&self) -> Port {
        let mut wire = self.0.borrow_mut();
        wire.stations.push(Station::default());
        Port { wire: self.0.clone(), station: wire.stations.len() - 1 }
    }

    /// Adds a participant to the bus. Its first tick is now.
    pub fn attach(&self, participant: impl Participant + 'static) {
        let mut wire = self.0.borrow_mut();
        let wake_ns = Some(wire.now_ns);
        let participant: Option<Box<dyn Participant>> = Some(Box::new(participant));
        wire.stations.push(Station { participant, wake_ns, ..Station::default() });
    }

    /// Returns the bus time, ns from the start.
    pub fn now_ns(&self) -> u64 {
        self.0.borrow().now_ns
    }

    /// Advances the time. Frames for ports wait in their queues.
    ///
    /// # Errors
    /// Returns [`BusError::Storm`].
    pub fn run_until(&self, until_ns: u64) -> Result<(), BusError> {
        let mut wire = self.0.borrow_mut();
        while wire.step(until_ns)? {}
        wire.advance_to(until_ns);
        Ok(())
    }

    /// Returns the bus load so far, 0 to 1; 0 without bit rates.
    pub fn load(&self) -> f64 {
        let wire = self.0.borrow();
        if wire.now_ns == 0 { 0.0 } else { wire.busy_ns as f64 / wire.now_ns as f64 }
    }
}

/// A port of a [`Hub`]. Received frames wait in its queue. A dropped port receives nothing.
pub struct Port {
    wire: Rc<RefCell<Wire>>,
    station: usize,
}

impl Bus for Port {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let mut wire = self.wire.borrow_mut();
        let deadline = wire.now_ns.saturating_add(nanoseconds(SEND_TIMEOUT));
        if wire.rates.is_some() && wire.stations[self.station].queue.len() >= MAX_QUEUED_FRAMES {
            wire.stations[self.station].counters.waits += 1;
            while wire.stations[self.station].queue.len() >= MAX_QUEUED_FRAMES {
                if !wire.step(deadline)? {
                    wire.advance_to(deadline);
                    let waited_ms = SEND_TIMEOUT.as_millis() as u64;
                    return Err(BusError::Full { name: "loop".into(), waited_ms });
                }
            }
        }
        let station = &mut wire.stations[self.station];
        station.queue.push_back(*frame);
        station.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        let mut wire = self.wire.borrow_mut();
        loop {
            if let Some(received) = wire.stations[self.station].inbox.pop_front() {
                return Ok(Some(received));
            }
            // Also if that time has passed, because frames sent at this instant arrive at it.
            let until_ns = until_ns.max(wire.now_ns);
            if !wire.step(until_ns)? {
                wire.advance_to(until_ns);
                return Ok(None);
            }
        }
    }

    fn now_ns(&self) -> u64 {
        self.wire.borrow().now_ns
    }

    fn counters(&self) -> Counters {
        self.wire.borrow().stations[self.station].counters
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        // Borrowed only if a participant owns a port, which is not allowed. Dropping must not panic.
        if let Ok(mut wire) = self.wire.try_borrow_mut() {
            let station = &mut wire.stations[self.station];
            station.is_closed = true;
            station.inbox.clear();
        }
    }
}

#[derive(Default)]
struct Station {
    queue: VecDeque<CanFrame>,
    inbox: VecDeque<Received>,
    participant: Option<Box<dyn Participant>>,
    wake_ns: Option<u64>,
    counters: Counters,
    is_closed: bool,
}

impl Station {
    /// Queues the frames that the participant sends.
    fn collect(&mut self, events: &mut u32) -> Result<(), BusError> {
        let Some(participant) = &mut self.participant else { return Ok(()) };
        while let Some(frame) = participant.transmit() {
            self.queue.push_back(frame);
            self.counters.sent += 1;
            *events += 1;
            if *events > MAX_EVENTS_PER_INSTANT {
                return Err(BusError::Storm { events: *events });
            }
        }
        Ok(())
    }
}

#[derive(Default)]
struct Wire {
    now_ns: u64,
    rates: Option<BitRates>,
    stations: Vec<Station>,
    transmission: Option<Transmission>,
    busy_ns: u64,
    events: u32,
    pace: Option<Pace>,
}

/// A frame on the wire. The sender is the place of its station.
struct Transmission {
    sender: usize,
    frame: CanFrame,
    end_ns: u64,
}

/// Speed of virtual time, in times of the wall clock, from a time on.
struct Pace {
    since: Instant,
    since_ns: u64,
    rate: f64,
}

impl Wire {
    /// Processes the next event up to `until_ns`. Returns false if there is none.
    fn step(&mut self, until_ns: u64) -> Result<bool, BusError> {
        self.begin_transmission();
        let arrival = self.transmission.as_ref().map(|transmission| transmission.end_ns);
        let wake = (self.stations.iter().enumerate())
            .filter_map(|(at, station)| Some((station.wake_ns?, at)))
            .min();
        let arrives_first = arrival.is_some_and(|end| wake.is_none_or(|(time, _)| end <= time));
        let next = if arrives_first { arrival } else { wake.map(|(time, _)| time) };
        let Some(time) = next.filter(|time| *time <= until_ns) else { return Ok(false) };
        self.advance_to(time);
        self.events += 1;
        if self.events > MAX_EVENTS_PER_INSTANT {
            return Err(BusError::Storm { events: self.events });
        }
        if arrives_first {
            self.end_transmission()?;
        } else if let Some((_, at)) = wake {
            self.wake(at)?;
        }
        Ok(true)
    }

    /// Starts the next transmission if the wire is free.
    fn begin_transmission(&mut self) {
        if self.transmission.is_some() {
            return;
        }
        let ready = self.stations.iter().enumerate();
        let heads = ready.filter_map(|(at, station)| Some((priority(station.queue.front()?), at)));
        let Some((_, winner)) = heads.min() else { return };
        let Some(frame) = self.stations[winner].queue.pop_front() else { return };
        let duration_ns = self.rates.map_or(0, |rates| rates.duration_ns(&frame));
        self.busy_ns += duration_ns;
        let end_ns = self.now_ns + duration_ns;
        self.transmission = Some(Transmission { sender: winner, frame, end_ns });
    }

    /// Ends the transmission: all other stations receive the frame.
    fn end_transmission(&mut self) -> Result<(), BusError> {
        let Some(ended) = self.transmission.take() else { return Ok(()) };
        let Transmission { sender, frame, end_ns: time_ns } = ended;
        for (place, station) in self.stations.iter_mut().enumerate() {
            if place == sender || station.is_closed {
                continue;
            }
            station.counters.received += 1;
            station.counters.errors += u64::from(matches!(frame, CanFrame::Error { .. }));
            match &mut station.participant {
                Some(participant) => {
                    participant.receive(&frame, time_ns);
                    station.collect(&mut self.events)?;
                }
                None => station.inbox.push_back(Received { time_ns, frame }),
            }
        }
        Ok(())
    }

    fn wake(&mut self, at: usize) -> Result<(), BusError> {
        let station = &mut self.stations[at];
        let Some(participant) = &mut station.participant else { return Ok(()) };
        // Later than this instant, so that time advances.
        let next = participant.tick(self.now_ns);
        station.wake_ns = next.map(|time| time.max(self.now_ns + 1));
        station.collect(&mut self.events)
    }

    fn advance_to(&mut self, time_ns: u64) {
        if time_ns <= self.now_ns {
            return;
        }
        self.now_ns = time_ns;
        self.events = 0;
        if let Some(Pace { since, since_ns, rate }) = self.pace {
            let due = Duration::from_secs_f64((time_ns - since_ns) as f64 * 1e-9 / rate);
            std::thread::sleep(due.saturating_sub(since.elapsed()));
        }
    }
}

/// Returns the arbitration value of a frame; the lowest wins, because 0 is dominant on the wire.
fn priority(frame: &CanFrame) -> u64 {
    let (identifier, extended, remote) = match *frame {
        CanFrame::Data { identifier, extended, .. }
        | CanFrame::Flexible { identifier, extended, .. } => (identifier, extended, false),
        CanFrame::Remote { identifier, extended, .. } => (identifier, extended, true),
        CanFrame::Error { .. } => return 0,
    };
    let (identifier, remote) = (u64::from(identifier), u64::from(remote));
    // 11 bits, then RTR (or SRR, always 1), IDE, 18 bits, RTR.
    if extended {
        (identifier >> 18) << 21 | 0b11 << 19 | (identifier & 0x3_FFFF) << 1 | remote
    } else {
        identifier << 21 | remote << 20
    }
}
