//! Plays a plan to a driver, in time.
//!
//! Each frame has its time. Until then this program sleeps where the kernel keeps and stamps what comes, and
//! takes answers in by the dozen ([`HEARD_AT_ONCE`]): to be woken for each costs more than they do. A timer of
//! the kernel wakes late, by nearly the same every time: how late is learned, and so much earlier it is set
//! ([`EARLIEST_NS`] at most); where it wakes too early all the same the clock is watched. After a stall what
//! is due goes out faster than planned, but never in a burst ([`HURRY`]). As fast as the driver answers, so
//! many samples are on their way at most ([`WINDOW`]).

use super::check::{Check, Tally};
use super::plan::Plan;
use crate::bus::{Bus, BusError, Received};
use joint_trace::CanFrame;
use std::time::Instant;

/// How fast a plan is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// So many times as fast as it was recorded.
    Times(f64),
    /// As fast as the driver answers.
    Max,
}

/// Samples on their way, at most, as fast as the driver answers.
pub const WINDOW: usize = 16;

/// How long before its time a timer is set, at most, ns.
pub const EARLIEST_NS: u64 = 200_000;

/// Frames sent before the answers to them, which wait in the kernel, are taken in together.
pub const HEARD_AT_ONCE: usize = 32;

/// A wait longer than this is one that listens, ns.
const LONGEST_REST_NS: u64 = 2_000_000;

/// How many times as fast as planned frames go out that are late.
pub const HURRY: u64 = 4;

/// How long an answer is awaited, as fast as the driver answers, before more is sent without it, ns.
const PATIENCE_NS: u64 = 500_000_000;

/// So many windows without any answer, and the driver is taken for gone. In less than these a SYNC with a wrong
/// count is over, after which a driver hears nothing until the count comes round.
const SILENT_WINDOWS: u32 = 16;

/// How long the next answer is awaited after the last frame, ns.
const LINGER_NS: u64 = 1_000_000_000;

/// How a plan was played.
#[derive(Clone, Debug)]
pub struct Played {
    /// What came of the answers.
    pub tally: Tally,
    /// From each SYNC to the status that answered it, ns.
    pub round_trips_ns: Vec<u64>,
    /// How late each frame was sent, ns; empty as fast as the driver answers.
    pub lateness_ns: Vec<u64>,
    /// How far each step from SYNC to SYNC was from the plan's, ns; empty as fast as the driver answers.
    pub jitter_ns: Vec<u64>,
    /// From the first frame to the last, ns of the bus's clock.
    pub duration_ns: u64,
    /// The same as this PC's clock has it, ns: a virtual clock may stand still.
    pub elapsed_ns: u64,
    /// Time frames would take on a wire of 1 Mbit/s, sent and received, ns.
    pub wire_ns: u64,
    /// Frames sent.
    pub frames: u64,
    /// SYNCs sent within a fifth of the planned step after the one before.
    pub bursts: u64,
}

/// What is told on the way.
pub struct Progress {
    /// Samples sent so far.
    pub samples: u64,
    /// Of so many.
    pub of: u64,
}

/// Plays it.
///
/// # Errors
/// A bus that is gone, or takes nothing.
pub fn play(
    bus: &mut dyn Bus,
    plan: &Plan,
    rate: Rate,
    mut check: Check,
    tell: &mut dyn FnMut(Progress),
) -> Result<Played, BusError> {
    let start_ns = bus.now_ns();
    let begin = Instant::now();
    let mut player = Player {
        plan,
        played: Played {
            tally: Tally::default(),
            round_trips_ns: Vec::new(),
            lateness_ns: Vec::new(),
            jitter_ns: Vec::new(),
            duration_ns: 0,
            elapsed_ns: 0,
            wire_ns: 0,
            frames: 0,
            bursts: 0,
        },
        recorded: (0, 0),
        last_sync: None,
        last: None,
        early_ns: 0,
        unheard: 0,
        silent_windows: 0,
    };
    let mut samples = 0;
    for planned in &plan.frames {
        let (due_ns, now_ns) = match rate {
            Rate::Times(times) => {
                let due_ns = start_ns + (planned.due_ns as f64 / times) as u64;
                (due_ns, player.wait(bus, &mut check, due_ns)?)
            }
            Rate::Max => {
                player.make_room(bus, &mut check)?;
                if player.silent_windows == SILENT_WINDOWS {
                    break;
                }
                let now_ns = bus.now_ns();
                (now_ns, now_ns)
            }
        };
        let message = &planned.message;
        let frame = CanFrame::from(message.emit());
        check.sent(message, now_ns);
        bus.send(&frame)?;
        player.played.frames += 1;
        player.played.wire_ns += crate::bus::BitRates::FASTEST.duration_ns(&frame);
        let is_sync = matches!(message, compensator_core::can::Message::Sync(_));
        if let Rate::Times(times) = rate {
            player.played.lateness_ns.push(now_ns.saturating_sub(due_ns));
            if is_sync {
                player.step(due_ns, now_ns, times);
            }
        }
        if is_sync {
            samples += 1;
            if samples % 1000 == 0 {
                tell(Progress { samples, of: plan.samples });
            }
        }
    }
    let mut until_ns = bus.now_ns() + LINGER_NS;
    player.played.duration_ns = bus.now_ns() - start_ns;
    player.played.elapsed_ns = begin.elapsed().as_nanos() as u64;
    while check.waiting() > 0 {
        let Some(received) = bus.receive(until_ns)? else { break };
        let waited = check.waiting();
        player.take(&mut check, &received);
        if check.waiting() < waited {
            // A driver that is behind catches up; one that says no more is not waited for.
            until_ns = bus.now_ns() + LINGER_NS;
        }
    }
    // The telemetry of the last sample follows its status.
    let until_ns = bus.now_ns() + LINGER_NS / 100;
    while let Some(received) = bus.receive(until_ns)? {
        player.take(&mut check, &received);
    }
    let (tally, round_trips_ns) = check.finish();
    let (recorded_equal, recorded) = player.recorded;
    let tally = Tally { recorded_equal, recorded, ..tally };
    Ok(Played { tally, round_trips_ns, ..player.played })
}

struct Player<'a> {
    plan: &'a Plan,
    played: Played,
    /// Answers equal to recorded ones, and recorded ones.
    recorded: (u64, u64),
    /// The last SYNC: when it was due, and when it was sent, ns.
    last_sync: Option<(u64, u64)>,
    /// The last frame: when it was due, and when it was sent, ns.
    last: Option<(u64, u64)>,
    /// How much before its time a timer is set, ns.
    early_ns: u64,
    /// Frames sent since somebody looked what has come.
    unheard: usize,
    /// Windows in a row nobody answered.
    silent_windows: u32,
}

impl Player<'_> {
    /// Waits until a frame is due, and gives the time at which it is sent.
    fn wait(&mut self, bus: &mut dyn Bus, check: &mut Check, due_ns: u64) -> Result<u64, BusError> {
        let (last_due_ns, last_ns) = self.last.unwrap_or((due_ns, 0));
        let least_ns = (due_ns - last_due_ns) / HURRY;
        let mut send_ns = due_ns.max(last_ns + least_ns);
        let wake_ns = send_ns.saturating_sub(self.early_ns);
        let short = self.last.is_some() && wake_ns < last_ns + LONGEST_REST_NS;
        if short && bus.rest(0) {
            self.unheard += 1;
            if self.unheard == HEARD_AT_ONCE {
                self.hear(bus, check, 0)?;
            }
            if wake_ns > last_ns {
                bus.rest(wake_ns);
            }
        } else {
            self.hear(bus, check, wake_ns)?;
        }
        let mut now_ns = bus.now_ns();
        if wake_ns > last_ns {
            self.learn(now_ns.saturating_sub(wake_ns));
        }
        if now_ns > send_ns + EARLIEST_NS {
            // Somebody else had the processor, maybe since before the last frame got to the bus.
            send_ns = now_ns + least_ns.min(EARLIEST_NS);
        }
        while now_ns < send_ns {
            std::hint::spin_loop();
            let before_ns = std::mem::replace(&mut now_ns, bus.now_ns());
            if now_ns == before_ns {
                // On a virtual clock nothing passes by itself: waiting is what makes time pass.
                if let Some(received) = bus.receive(send_ns)? {
                    self.take(check, &received);
                }
                now_ns = bus.now_ns();
            }
        }
        self.last = Some((due_ns, now_ns));
        Ok(now_ns)
    }

    /// Takes in what comes until then.
    fn hear(
        &mut self,
        bus: &mut dyn Bus,
        check: &mut Check,
        until_ns: u64,
    ) -> Result<(), BusError> {
        self.unheard = 0;
        while let Some(received) = bus.receive(until_ns)? {
            self.take(check, &received);
        }
        Ok(())
    }

    /// A timer woke so much late. Set so much early that one in five wakes before its frame is due: earlier
    /// ones cost the processor, later ones the frame. What is later than any timer was somebody else's turn.
    fn learn(&mut self, late_ns: u64) {
        const STEP_NS: u64 = 500;
        self.early_ns = match late_ns {
            late_ns if late_ns > EARLIEST_NS => self.early_ns,
            late_ns if late_ns > self.early_ns => self.early_ns + STEP_NS,
            _ => self.early_ns.saturating_sub(4 * STEP_NS),
        };
    }

    /// Waits until another sample may be sent.
    fn make_room(&mut self, bus: &mut dyn Bus, check: &mut Check) -> Result<(), BusError> {
        if check.outstanding() < WINDOW {
            return Ok(());
        }
        let until_ns = bus.now_ns().saturating_add(PATIENCE_NS);
        while check.outstanding() >= WINDOW {
            match bus.receive(until_ns)? {
                Some(received) => self.take(check, &received),
                None => {
                    check.give_up();
                    self.silent_windows += 1;
                }
            }
        }
        Ok(())
    }

    fn step(&mut self, due_ns: u64, now_ns: u64, times: f64) {
        if let Some((last_due_ns, last_ns)) = self.last_sync {
            let (planned_ns, taken_ns) = (due_ns - last_due_ns, now_ns - last_ns);
            self.played.jitter_ns.push(planned_ns.abs_diff(taken_ns));
            let usual_ns = (self.plan.period_s * 1e9 / times) as u64;
            self.played.bursts += u64::from(planned_ns > 0 && taken_ns < usual_ns / 5);
        }
        self.last_sync = Some((due_ns, now_ns));
    }

    fn take(&mut self, check: &mut Check, received: &Received) {
        self.played.wire_ns += crate::bus::BitRates::FASTEST.duration_ns(&received.frame);
        let Some(frame) = received.frame.to_joint() else { return };
        let Some((sample, answer, status)) = check.received(&frame, received.time_ns) else {
            return;
        };
        self.silent_windows = 0;
        let recorded = self.plan.recorded.get(sample as usize).copied().flatten();
        if let Some(recorded) = recorded {
            self.recorded.1 += 1;
            let words = |answer: compensator_core::can::Answer| {
                (answer.friction_torque_nm.to_bits(), answer.feed_forward_current_a.to_bits())
            };
            let same = words(answer) == words(recorded.answer) && status == recorded.status;
            self.recorded.0 += u64::from(same);
        }
    }
}
