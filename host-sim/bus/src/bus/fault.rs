//! A bus on which things go wrong, by the dice.
//!
//! Each frame, either way, may be lost, come twice, late, with a bit flipped, or after the one that
//! follows it; each with its own probability, each counted. Dice are seeded and thrown the same number
//! of times for every frame, for each way apart: the same frames meet the same faults however their
//! sending and receiving interleave, and one probability changed leaves the other faults where they were.
//!
//! On a real bus a flipped bit is caught by the checksum; here it stands for what comes after that: a
//! gateway, a driver, a program at fault. A late frame that was sent goes out at the next call once its
//! time has come.

use super::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// How likely each fault is for a frame, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Lost.
    pub drop: f64,
    /// There twice.
    pub duplicate: f64,
    /// A bit of its data flipped; of its identifier where it has no data.
    pub corrupt: f64,
    /// Late by up to `longest_delay_ns`.
    pub delay: f64,
    /// Held back until the next frame has passed, but not longer than `longest_delay_ns`.
    pub reorder: f64,
    /// Latest that a frame is let through, ns.
    pub longest_delay_ns: u64,
}

/// Faults of both ways.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Of frames sent.
    pub sent: Faults,
    /// Of frames heard.
    pub received: Faults,
}

/// Faults that happened on one way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounters {
    /// Frames that came.
    pub frames: u64,
    /// Of them lost.
    pub dropped: u64,
    /// Doubled.
    pub duplicated: u64,
    /// With a bit flipped.
    pub corrupted: u64,
    /// Late.
    pub delayed: u64,
    /// Held back behind the next.
    pub reordered: u64,
}

/// Around a bus.
pub struct FaultInjector<B> {
    bus: B,
    sent: Way,
    received: Way,
}

impl<B: Bus> FaultInjector<B> {
    /// With its dice at the start of this seed.
    pub fn new(bus: B, plan: FaultPlan, seed: u64) -> Self {
        let way = |faults, number| Way {
            faults,
            dice: Pcg64Mcg::seed_from_u64(seed.wrapping_mul(2).wrapping_add(number)),
            held: Vec::new(),
            counters: FaultCounters::default(),
        };
        Self { bus, sent: way(plan.sent, 0), received: way(plan.received, 1) }
    }

    /// What happened to frames sent and heard.
    pub fn fault_counters(&self) -> (FaultCounters, FaultCounters) {
        (self.sent.counters, self.received.counters)
    }

    /// Other faults from now on; the dice go on.
    pub fn set_plan(&mut self, plan: FaultPlan) {
        (self.sent.faults, self.received.faults) = (plan.sent, plan.received);
    }

    /// The bus inside.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// Sends what is due.
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

/// One way.
struct Way {
    faults: Faults,
    dice: Pcg64Mcg,
    /// Frames on their way, in the order they go on.
    held: Vec<Held>,
    counters: FaultCounters,
}

#[derive(Clone, Copy)]
struct Held {
    due_ns: u64,
    /// Whether it waits for another to pass.
    behind_next: bool,
    late: bool,
    received: Received,
}

impl Way {
    /// Throws the dice for a frame and holds what becomes of it.
    fn pass(&mut self, mut received: Received, now_ns: u64) {
        let faults = self.faults;
        let [drop, duplicate, corrupt, delay, reorder]: [f64; 5] = self.dice.random();
        let (late, place): (f64, u64) = (self.dice.random(), self.dice.random());
        let counters = &mut self.counters;
        counters.frames += 1;
        if drop < faults.drop {
            counters.dropped += 1;
            return;
        }
        if corrupt < faults.corrupt && flip(&mut received.frame, place) {
            counters.corrupted += 1;
        }
        let mut held = Held { due_ns: now_ns, behind_next: false, late: false, received };
        if delay < faults.delay {
            counters.delayed += 1;
            held.late = true;
            held.due_ns = now_ns.saturating_add((late * faults.longest_delay_ns as f64) as u64);
        } else if reorder < faults.reorder {
            counters.reordered += 1;
            held.due_ns = now_ns.saturating_add(faults.longest_delay_ns);
            held.behind_next = true;
            held.late = true;
        }
        let twice = (duplicate < faults.duplicate).then_some(held);
        counters.duplicated += u64::from(twice.is_some());
        let passed = held.due_ns == now_ns;
        self.insert(held);
        if passed {
            // Whoever waited for a frame to pass goes on right behind this one.
            let waits = |held: &mut Held| held.behind_next && held.due_ns > now_ns;
            let waiting: Vec<Held> = self.held.extract_if(.., waits).collect();
            for held in waiting {
                self.insert(Held { due_ns: now_ns, behind_next: false, ..held });
            }
        }
        if let Some(twice) = twice {
            self.insert(twice);
        }
    }

    /// In the order of time; at one time, of coming.
    fn insert(&mut self, held: Held) {
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

/// Flips a bit; an error frame without data has none to flip.
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
