//! A bus in this process, in virtual time.
//!
//! Two sorts of station. A [`Port`] is a [`Bus`] for whoever asks and waits; a [`Participant`] is asked: a
//! joint driver is told its frames and woken when it wants to be. Time passes only while somebody waits
//! on a port, from one event to the next, so a minute of traffic takes as long as its computing does, and
//! the same calls give the same frames at the same nanoseconds, always. Everything runs in the thread that
//! waits.
//!
//! At one instant, frames arrive before anybody is woken, and stations have their turn in the order in
//! which they joined. Without bit rates a frame takes no time. With them each takes what it would on the
//! wire, one after the other, and of several stations that want to send the lowest identifier wins;
//! within a station first come, first served, as in the kernel's queue.

use super::{BitRates, Bus, BusError, Counters, LONGEST_WAIT, Received, nanoseconds};
use joint_trace::CanFrame;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Frames a port may have waiting, as many as a Linux interface by default has room for.
const QUEUE: usize = 10;
/// Events in one instant that are taken for a storm.
const STORM: u32 = 1_000_000;

/// A station that is told and woken, as a joint driver is. Times are those of the hub, which is busy while
/// it tells: a participant has no port of its own.
pub trait Participant {
    /// A frame was on the bus.
    fn receive(&mut self, frame: &CanFrame, now_ns: u64);

    /// The time it asked for has come; it gives the next, or `None` to be told frames only.
    fn tick(&mut self, now_ns: u64) -> Option<u64>;

    /// The next frame it wants to send; asked until there is none, after each of the others.
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

/// The bus itself; a clone is the same bus.
#[derive(Clone, Default)]
pub struct Hub(Rc<RefCell<Wire>>);

impl Hub {
    /// A bus on which frames take no time.
    pub fn new() -> Self {
        Self::default()
    }

    /// A bus on which frames take their time, and wait for each other.
    pub fn with_bit_rates(rates: BitRates) -> Self {
        let wire = Wire { rates: Some(rates), ..Wire::default() };
        Self(Rc::new(RefCell::new(wire)))
    }

    /// Lets virtual time pass no faster than `rate` times the wall clock's from now on: for whoever
    /// watches. What happens stays the same.
    pub fn keep_pace(&self, rate: f64) {
        let mut wire = self.0.borrow_mut();
        wire.pace = Some((Instant::now(), wire.now_ns, rate.max(1e-6)));
    }

    /// A new place on the bus.
    pub fn port(&self) -> Port {
        let mut wire = self.0.borrow_mut();
        wire.stations.push(Station::default());
        Port { wire: self.0.clone(), station: wire.stations.len() - 1 }
    }

    /// Puts a participant on the bus, and wakes it for the first time, now.
    pub fn attach(&self, participant: impl Participant + 'static) {
        let mut wire = self.0.borrow_mut();
        let wake_ns = Some(wire.now_ns);
        let participant: Option<Box<dyn Participant>> = Some(Box::new(participant));
        wire.stations.push(Station { participant, wake_ns, ..Station::default() });
    }

    /// What the clock says, ns from the start.
    pub fn now_ns(&self) -> u64 {
        self.0.borrow().now_ns
    }

    /// Lets time pass; what ports hear waits for them.
    ///
    /// # Errors
    /// [`BusError::Storm`].
    pub fn run_until(&self, until_ns: u64) -> Result<(), BusError> {
        let mut wire = self.0.borrow_mut();
        while wire.step(until_ns)? {}
        wire.pass_to(until_ns);
        Ok(())
    }

    /// Share of the time so far in which a frame was on the wire, 0 to 1; 0 without bit rates.
    pub fn load(&self) -> f64 {
        let wire = self.0.borrow();
        if wire.now_ns == 0 { 0.0 } else { wire.busy_ns as f64 / wire.now_ns as f64 }
    }
}

/// A place on a [`Hub`]. What it hears waits for it; dropped, it hears nothing more.
pub struct Port {
    wire: Rc<RefCell<Wire>>,
    station: usize,
}

impl Bus for Port {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let mut wire = self.wire.borrow_mut();
        let deadline = wire.now_ns.saturating_add(nanoseconds(LONGEST_WAIT));
        if wire.rates.is_some() && wire.stations[self.station].queue.len() >= QUEUE {
            wire.stations[self.station].counters.waits += 1;
            while wire.stations[self.station].queue.len() >= QUEUE {
                if !wire.step(deadline)? {
                    wire.pass_to(deadline);
                    let waited_ms = LONGEST_WAIT.as_millis() as u64;
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
            // Also where that time has passed: what was sent at this instant arrives at it.
            let until_ns = until_ns.max(wire.now_ns);
            if !wire.step(until_ns)? {
                wire.pass_to(until_ns);
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
        // Never busy but where a participant owns a port against the rule; no panic while dropping.
        if let Ok(mut wire) = self.wire.try_borrow_mut() {
            let station = &mut wire.stations[self.station];
            station.deaf = true;
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
    deaf: bool,
}

impl Station {
    /// Takes what a participant wants to send.
    fn collect(&mut self, events: &mut u32) -> Result<(), BusError> {
        let Some(participant) = &mut self.participant else { return Ok(()) };
        while let Some(frame) = participant.transmit() {
            self.queue.push_back(frame);
            self.counters.sent += 1;
            *events += 1;
            if *events > STORM {
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
    /// Who sends, what, and when it will have been sent.
    flight: Option<(usize, CanFrame, u64)>,
    busy_ns: u64,
    events: u32,
    pace: Option<(Instant, u64, f64)>,
}

impl Wire {
    /// Lets the next event happen that is not after `until_ns`; says whether there was one.
    fn step(&mut self, until_ns: u64) -> Result<bool, BusError> {
        self.begin_flight();
        let arrival = self.flight.map(|(_, _, end_ns)| end_ns);
        let wake = (self.stations.iter().enumerate())
            .filter_map(|(at, station)| Some((station.wake_ns?, at)))
            .min();
        let arrives_first = arrival.is_some_and(|end| wake.is_none_or(|(time, _)| end <= time));
        let next = if arrives_first { arrival } else { wake.map(|(time, _)| time) };
        let Some(time) = next.filter(|time| *time <= until_ns) else { return Ok(false) };
        self.pass_to(time);
        self.events += 1;
        if self.events > STORM {
            return Err(BusError::Storm { events: self.events });
        }
        if arrives_first {
            self.land()?;
        } else if let Some((_, at)) = wake {
            self.wake(at)?;
        }
        Ok(true)
    }

    /// If nobody sends, whoever wins begins to.
    fn begin_flight(&mut self) {
        if self.flight.is_some() {
            return;
        }
        let ready = self.stations.iter().enumerate();
        let heads = ready.filter_map(|(at, station)| Some((priority(station.queue.front()?), at)));
        let Some((_, winner)) = heads.min() else { return };
        let Some(frame) = self.stations[winner].queue.pop_front() else { return };
        let duration_ns = self.rates.map_or(0, |rates| rates.duration_ns(&frame));
        self.busy_ns += duration_ns;
        self.flight = Some((winner, frame, self.now_ns + duration_ns));
    }

    /// The frame has been sent: all others hear it.
    fn land(&mut self) -> Result<(), BusError> {
        let Some((sender, frame, time_ns)) = self.flight.take() else { return Ok(()) };
        for (at, station) in self.stations.iter_mut().enumerate() {
            if at == sender || station.deaf {
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
        // Not again at this instant, or time would stand still.
        let next = participant.tick(self.now_ns);
        station.wake_ns = next.map(|time| time.max(self.now_ns + 1));
        station.collect(&mut self.events)
    }

    fn pass_to(&mut self, time_ns: u64) {
        if time_ns <= self.now_ns {
            return;
        }
        self.now_ns = time_ns;
        self.events = 0;
        if let Some((start, start_ns, rate)) = self.pace {
            let due = Duration::from_secs_f64((time_ns - start_ns) as f64 * 1e-9 / rate);
            std::thread::sleep(due.saturating_sub(start.elapsed()));
        }
    }
}

/// What wins when several begin at once: the lowest, as on the wire, where 0 is dominant.
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
