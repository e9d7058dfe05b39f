//! A fault injector around a bus.
//!
//! A frame in either direction may be lost, duplicated, delayed, corrupted by one bit, or moved behind the next frame.
//! Each fault has its own probability and counter. The random sampler has a seed and draws the same number of values for
//! every frame, separately for each direction. So the same frames get the same faults however sending and receiving
//! interleave, and a changed probability does not move the other faults.
//!
//! On a real bus, the checksum detects a flipped bit. Here it represents a fault after the checksum: in a gateway, a
//! driver, or a program. A delayed frame is sent at the first call after its time.

use super::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Probability of each fault for a frame, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// The frame is lost.
    pub drop: f64,
    /// The frame is duplicated.
    pub duplicate: f64,
    /// One bit of the data is flipped, or of the identifier if there are no data.
    pub corrupt: f64,
    /// The frame is delayed by up to `longest_delay_ns`.
    pub delay: f64,
    /// The frame is moved behind the next frame, but delayed by at most `longest_delay_ns`.
    pub reorder: f64,
    /// Maximum delay, ns.
    pub longest_delay_ns: u64,
}

/// Faults of both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Faults of sent frames.
    pub sent: Faults,
    /// Faults of received frames.
    pub received: Faults,
}

/// Fault counters of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounters {
    /// Frames in total.
    pub frames: u64,
    /// Lost frames.
    pub dropped: u64,
    /// Duplicated frames.
    pub duplicated: u64,
    /// Corrupted frames.
    pub corrupted: u64,
    /// Delayed frames.
    pub delayed: u64,
    /// Frames moved behind the next.
    pub reordered: u64,
}

/// Injects faults into the frames of a bus.
pub struct FaultInjector<B> {
    bus: B,
    sent: FaultChannel,
    received: FaultChannel,
}

impl<B: Bus> FaultInjector<B> {
    /// Creates a fault injector around a bus, with a seed for its random sampler.
    pub fn new(bus: B, plan: FaultPlan, seed: u64) -> Self {
        let channel = |faults, number| FaultChannel {
            faults,
            sampler: Pcg64Mcg::seed_from_u64(seed.wrapping_mul(2).wrapping_add(number)),
            held: Vec::new(),
            counters: FaultCounters::default(),
        };
        Self { bus, sent: channel(plan.sent, 0), received: channel(plan.received, 1) }
    }

    /// Returns the counters of sent and of received frames.
    pub fn fault_counters(&self) -> (FaultCounters, FaultCounters) {
        (self.sent.counters, self.received.counters)
    }

    /// Returns the inner bus.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// Sends the frames that are due.
    fn send_due(&mut self) -> Result<(), BusError> {
        while let Some(due) = self.sent.take_due(self.bus.now_ns()) {
            self.bus.send(&due.frame)?;
        }
        Ok(())
    }
}

impl<B: Bus> Bus for FaultInjector<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        self.send_due()?;
        let now_ns = self.bus.now_ns();
        self.sent.pass(Received { time_ns: now_ns, frame: *frame }, now_ns);
        self.send_due()
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            self.send_due()?;
            if let Some(due) = self.received.take_due(self.bus.now_ns()) {
                return Ok(Some(due));
            }
            let next = [self.sent.next_due_ns(), self.received.next_due_ns()];
            let wait_ns = next.into_iter().flatten().fold(until_ns, u64::min);
            match self.bus.receive(wait_ns)? {
                Some(received) => {
                    let now_ns = self.bus.now_ns();
                    self.received.pass(received, now_ns);
                }
                None if self.bus.now_ns() >= until_ns => {
                    self.send_due()?;
                    return Ok(self.received.take_due(self.bus.now_ns()));
                }
                None => {}
            }
        }
    }

    fn now_ns(&self) -> u64 {
        self.bus.now_ns()
    }

    fn counters(&self) -> Counters {
        self.bus.counters()
    }
}

/// One direction.
struct FaultChannel {
    faults: Faults,
    sampler: Pcg64Mcg,
    /// Held frames, in the order in which they are due.
    held: Vec<HeldFrame>,
    counters: FaultCounters,
}

#[derive(Clone, Copy)]
struct HeldFrame {
    due_ns: u64,
    /// True if it waits for the next frame.
    waits_for_next: bool,
    late: bool,
    received: Received,
}

impl FaultChannel {
    /// Draws the faults of a frame and holds the result until it is due.
    fn pass(&mut self, mut received: Received, now_ns: u64) {
        let faults = self.faults;
        let [drop, duplicate, corrupt, delay, reorder]: [f64; 5] = self.sampler.random();
        let (late, place): (f64, u64) = (self.sampler.random(), self.sampler.random());
        let counters = &mut self.counters;
        counters.frames += 1;
        if drop < faults.drop {
            counters.dropped += 1;
            return;
        }
        if corrupt < faults.corrupt && flip(&mut received.frame, place) {
            counters.corrupted += 1;
        }
        let mut held = HeldFrame { due_ns: now_ns, waits_for_next: false, late: false, received };
        if delay < faults.delay {
            counters.delayed += 1;
            held.late = true;
            held.due_ns = now_ns.saturating_add((late * faults.longest_delay_ns as f64) as u64);
        } else if reorder < faults.reorder {
            counters.reordered += 1;
            held.due_ns = now_ns.saturating_add(faults.longest_delay_ns);
            held.waits_for_next = true;
            held.late = true;
        }
        let twice = (duplicate < faults.duplicate).then_some(held);
        counters.duplicated += u64::from(twice.is_some());
        let passed = held.due_ns == now_ns;
        self.insert(held);
        if passed {
            // Frames that waited for the next frame follow this one.
            let waits = |held: &mut HeldFrame| held.waits_for_next && held.due_ns > now_ns;
            let waiting: Vec<HeldFrame> = self.held.extract_if(.., waits).collect();
            for held in waiting {
                self.insert(HeldFrame { due_ns: now_ns, waits_for_next: false, ..held });
            }
        }
        if let Some(twice) = twice {
            self.insert(twice);
        }
    }

    /// Inserts a frame, ordered by due time and then by arrival.
    fn insert(&mut self, held: HeldFrame) {
        let at = self.held.partition_point(|other| other.due_ns <= held.due_ns);
        self.held.insert(at, held);
    }

    fn next_due_ns(&self) -> Option<u64> {
        self.held.first().map(|held| held.due_ns)
    }

    fn take_due(&mut self, now_ns: u64) -> Option<Received> {
        if self.next_due_ns()? > now_ns {
            return None;
        }
        let held = self.held.remove(0);
        let on_time = held.received;
        let late = Received { time_ns: on_time.time_ns.max(held.due_ns), ..on_time };
        Some(if held.late { late } else { on_time })
    }
}

/// Flips one bit. Returns false for an error frame without data.
fn flip(frame: &mut CanFrame, place: u64) -> bool {
    let data = frame.data_mut();
    if !data.is_empty() {
        let bit = (place % (8 * data.len() as u64)) as usize;
        data[bit / 8] ^= 1 << (bit % 8);
        return true;
    }
    match frame {
        CanFrame::Data { identifier, extended, .. }
        | CanFrame::Remote { identifier, extended, .. }
        | CanFrame::Flexible { identifier, extended, .. } => {
            *identifier ^= 1 << (place % if *extended { 29 } else { 11 });
            true
        }
        CanFrame::Error { .. } => false,
    }
}
