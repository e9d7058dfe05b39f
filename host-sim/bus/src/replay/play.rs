//! Plays a plan to a driver on time.
//!
//! Each frame has its time. Until then the player sleeps, while the kernel stores and stamps the answers. Answers are read
//! in batches ([`ANSWER_BATCH_FRAMES`]), because a wake-up for each answer costs more than its processing.
//!
//! A kernel timer wakes late by a nearly constant time. The player estimates this time and sets the timer earlier by it
//! ([`MAX_TIMER_ADVANCE_NS`] at most). If it wakes too early, it polls the clock. After a stall, late frames are sent
//! faster than planned, but not in a burst ([`CATCH_UP_FACTOR`]). At the maximum rate, the number of unanswered samples is
//! limited ([`MAX_OUTSTANDING_SAMPLES`]).

use super::check::{Check, Tally};
use super::plan::{Plan, RecordedAnswer};
use crate::bus::{Bus, BusError, Received};
use compensator_core::can::Frame;
use joint_trace::CanFrame;
use std::time::Instant;

/// Rate of a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// A multiple of the recorded rate.
    Times(f64),
    /// As fast as the driver answers.
    Max,
}

/// Maximum number of unanswered samples at the maximum rate.
pub const MAX_OUTSTANDING_SAMPLES: usize = 16;

/// Maximum advance of a timer against its frame, ns.
pub const MAX_TIMER_ADVANCE_NS: u64 = 200_000;

/// Number of sent frames before their answers, which wait in the kernel, are read.
pub const ANSWER_BATCH_FRAMES: usize = 32;

/// Maximum wait without reading answers, ns.
const MAX_SLEEP_NS: u64 = 2_000_000;

/// Factor by which late frames are sent faster than planned.
pub const CATCH_UP_FACTOR: u64 = 4;

/// Time limit for an answer at the maximum rate, ns. Then the next samples are sent without it.
const ANSWER_TIMEOUT_NS: u64 = 500_000_000;

/// Number of windows without any answer after which the driver counts as silent. After a SYNC with a wrong count, a driver
/// ignores SYNCs until the count matches again; this takes fewer windows.
const MAX_SILENT_WINDOWS: u32 = 16;

/// Time limit for the next answer after the last frame, ns.
const FINAL_ANSWER_TIMEOUT_NS: u64 = 1_000_000_000;

/// Result of a replay.
#[derive(Clone, Debug, Default)]
pub struct PlayResult {
    /// Counts of the answers.
    pub tally: Tally,
    /// Round-trip times from SYNC to status, ns.
    pub round_trips_ns: Vec<u64>,
    /// Lateness of each frame, ns; empty at the maximum rate.
    pub lateness_ns: Vec<u64>,
    /// Deviation of each time between SYNCs from the plan, ns; empty at the maximum rate.
    pub jitter_ns: Vec<u64>,
    /// Duration from the first frame to the last, ns of bus time.
    pub duration_ns: u64,
    /// The same duration on this PC's clock, ns, because a virtual clock may stand still.
    pub elapsed_ns: u64,
    /// Duration of all frames on a wire at 1 Mbit/s, ns.
    pub wire_ns: u64,
    /// Number of sent frames.
    pub frames: u64,
    /// SYNCs sent less than a fifth of the planned time after the previous SYNC.
    pub bursts: u64,
}

/// Plays a plan to the driver on a bus, and checks its answers. `report_progress` receives the number of sent samples.
///
/// # Errors
/// Returns an error if the bus is closed or has no room.
pub fn play(
    bus: &mut dyn Bus,
    plan: &Plan,
    rate: Rate,
    mut check: Check,
    report_progress: &mut dyn FnMut(u64),
) -> Result<PlayResult, BusError> {
    let start_ns = bus.now_ns();
    let begin = Instant::now();
    let mut player = Player::new(plan);
    let mut samples = 0;
    for planned in &plan.frames {
        let (due_ns, now_ns) = match rate {
            Rate::Times(times) => {
                let due_ns = start_ns.saturating_add((planned.due_ns as f64 / times) as u64);
                (due_ns, player.wait(bus, &mut check, due_ns)?)
            }
            Rate::Max => {
                player.make_room(bus, &mut check)?;
                if player.silent_windows == MAX_SILENT_WINDOWS {
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
        player.result.frames += 1;
        player.result.wire_ns += crate::bus::BitRates::FASTEST.duration_ns(&frame);
        let is_sync = matches!(message, compensator_core::can::Message::Sync(_));
        if let Rate::Times(times) = rate {
            player.result.lateness_ns.push(now_ns.saturating_sub(due_ns));
            if is_sync {
                player.record_step(due_ns, now_ns, times);
            }
        }
        if is_sync {
            samples += 1;
            if samples % 1000 == 0 {
                report_progress(samples);
            }
        }
    }
    player.result.duration_ns = bus.now_ns() - start_ns;
    player.result.elapsed_ns = begin.elapsed().as_nanos() as u64;
    player.read_final_answers(bus, &mut check)?;
    let (tally, round_trips_ns) = check.finish();
    let (recorded, recorded_equal) = (player.recorded_answers, player.equal_to_recorded);
    let tally = Tally { recorded_equal, recorded, ..tally };
    Ok(PlayResult { tally, round_trips_ns, ..player.result })
}

#[derive(Default)]
struct Player<'a> {
    /// Time between SYNCs of the plan, s, and its recorded answers by sample.
    period_s: f64,
    answers: &'a [Option<RecordedAnswer>],
    result: PlayResult,
    /// Number of answers of which the log has one, and of those that are equal.
    recorded_answers: u64,
    equal_to_recorded: u64,
    /// Due time and send time of the last SYNC, ns.
    last_sync: Option<(u64, u64)>,
    /// Due time and send time of the last frame, ns.
    last: Option<(u64, u64)>,
    /// Current advance of the timer, ns.
    timer_advance_ns: u64,
    /// Number of frames sent since answers were read.
    sent_since_read: usize,
    /// Number of consecutive windows without an answer.
    silent_windows: u32,
}

impl<'a> Player<'a> {
    fn new(plan: &'a Plan) -> Self {
        Self { period_s: plan.period_s, answers: &plan.recorded, ..Self::default() }
    }

    /// Reads the answers that follow the last frame.
    fn read_final_answers(&mut self, bus: &mut dyn Bus, check: &mut Check) -> Result<(), BusError> {
        let mut until_ns = bus.now_ns() + FINAL_ANSWER_TIMEOUT_NS;
        while check.waiting() > 0 {
            let Some(received) = bus.receive(until_ns)? else { break };
            let waited = check.waiting();
            self.take(check, &received);
            if check.waiting() < waited {
                // A slow driver gets more time; a silent one does not.
                until_ns = bus.now_ns() + FINAL_ANSWER_TIMEOUT_NS;
            }
        }
        // The telemetry of the last sample follows its status.
        let until_ns = bus.now_ns() + FINAL_ANSWER_TIMEOUT_NS / 100;
        while let Some(received) = bus.receive(until_ns)? {
            self.take(check, &received);
        }
        Ok(())
    }

    /// Waits until a frame is due. Returns the time at which it is sent, ns.
    fn wait(&mut self, bus: &mut dyn Bus, check: &mut Check, due_ns: u64) -> Result<u64, BusError> {
        let (last_due_ns, last_ns) = self.last.unwrap_or((due_ns, 0));
        let least_ns = (due_ns - last_due_ns) / CATCH_UP_FACTOR;
        let mut send_ns = due_ns.max(last_ns + least_ns);
        let wake_ns = send_ns.saturating_sub(self.timer_advance_ns);
        let short = self.last.is_some() && wake_ns < last_ns + MAX_SLEEP_NS;
        if short && bus.sleep_until(0) {
            self.sent_since_read += 1;
            if self.sent_since_read == ANSWER_BATCH_FRAMES {
                self.read_answers(bus, check, 0)?;
            }
            if wake_ns > last_ns {
                bus.sleep_until(wake_ns);
            }
        } else {
            self.read_answers(bus, check, wake_ns)?;
        }
        let mut now_ns = bus.now_ns();
        if wake_ns > last_ns {
            self.adapt_timer_advance(now_ns.saturating_sub(wake_ns));
        }
        if now_ns > send_ns + MAX_TIMER_ADVANCE_NS {
            // Another program had the processor, perhaps since before the last frame reached the bus.
            send_ns = now_ns + least_ns.min(MAX_TIMER_ADVANCE_NS);
        }
        while now_ns < send_ns {
            std::hint::spin_loop();
            let before_ns = std::mem::replace(&mut now_ns, bus.now_ns());
            if now_ns == before_ns {
                // A virtual clock advances only while the caller waits.
                if let Some(received) = bus.receive(send_ns)? {
                    self.take(check, &received);
                }
                now_ns = bus.now_ns();
            }
        }
        self.last = Some((due_ns, now_ns));
        Ok(now_ns)
    }

    /// Reads answers until the given time.
    fn read_answers(
        &mut self,
        bus: &mut dyn Bus,
        check: &mut Check,
        until_ns: u64,
    ) -> Result<(), BusError> {
        self.sent_since_read = 0;
        while let Some(received) = bus.receive(until_ns)? {
            self.take(check, &received);
        }
        Ok(())
    }

    /// Adapts the advance to the lateness of a timer. The advance settles where one timer in five wakes before its frame is
    /// due: waking earlier costs processor time, waking later delays the frame. A larger lateness than any timer's comes
    /// from scheduling and is ignored.
    fn adapt_timer_advance(&mut self, late_ns: u64) {
        const STEP_NS: u64 = 500;
        self.timer_advance_ns = match late_ns {
            late_ns if late_ns > MAX_TIMER_ADVANCE_NS => self.timer_advance_ns,
            late_ns if late_ns > self.timer_advance_ns => self.timer_advance_ns + STEP_NS,
            _ => self.timer_advance_ns.saturating_sub(4 * STEP_NS),
        };
    }

    /// Waits until the next sample may be sent.
    fn make_room(&mut self, bus: &mut dyn Bus, check: &mut Check) -> Result<(), BusError> {
        if check.outstanding() < MAX_OUTSTANDING_SAMPLES {
            return Ok(());
        }
        let until_ns = bus.now_ns().saturating_add(ANSWER_TIMEOUT_NS);
        while check.outstanding() >= MAX_OUTSTANDING_SAMPLES {
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

    fn record_step(&mut self, due_ns: u64, now_ns: u64, times: f64) {
        if let Some((last_due_ns, last_ns)) = self.last_sync {
            let (planned_ns, taken_ns) = (due_ns - last_due_ns, now_ns - last_ns);
            self.result.jitter_ns.push(planned_ns.abs_diff(taken_ns));
            let usual_ns = (self.period_s * 1e9 / times) as u64;
            self.result.bursts += u64::from(planned_ns > 0 && taken_ns < usual_ns / 5);
        }
        self.last_sync = Some((due_ns, now_ns));
    }

    fn take(&mut self, check: &mut Check, received: &Received) {
        self.result.wire_ns += crate::bus::BitRates::FASTEST.duration_ns(&received.frame);
        for frame in received.frame.joint_frames() {
            self.take_frame(check, &frame, received.time_ns);
        }
    }

    fn take_frame(&mut self, check: &mut Check, frame: &Frame, time_ns: u64) {
        let Some((sample, answer)) = check.received(frame, time_ns) else { return };
        self.silent_windows = 0;
        if let Some(recorded) = self.answers.get(sample as usize).copied().flatten() {
            self.recorded_answers += 1;
            self.equal_to_recorded += u64::from(answer.has_bits_of(&recorded));
        }
    }
}
