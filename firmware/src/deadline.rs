//! Time guard of the current loop.
//!
//! A period must end before the duties of the next one are due. If it does not, the guard drops the compensation
//! at once and for a hold time; the supervisor is informed later and decides what follows. A period is late in
//! one of three ways. It was *missed*: the trigger came, but the interrupt did not run. It *starts* so late that
//! it would end late: the compensation is dropped before it is computed. It *ends* late: the compensation is
//! dropped from the next period on.
//!
//! Time is a free-running counter of processor cycles, which wraps. It is passed in. All times of a period count
//! from its trigger, the middle of the PWM period in which the currents were sampled, not from the start of the
//! interrupt.

/// Time limits of a period, in cycles and periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeadlineLimits {
    /// Cycles from trigger to trigger.
    pub period: u32,
    /// Latest start, cycles after the trigger. After it, the work does not fit into the period.
    pub latest_start: u32,
    /// Latest end, cycles after the trigger.
    pub latest_end: u32,
    /// Periods without compensation after the last late one.
    pub hold: u32,
}

impl DeadlineLimits {
    /// Returns the limits of a period of `period` cycles: the latest start is at half of it, the latest end at
    /// 0.9. The compensation is dropped for `hold` periods.
    pub const fn for_period(period: u32, hold: u32) -> Self {
        Self { period, latest_start: period / 2, latest_end: period - period / 10, hold }
    }
}

/// Time guard of the current loop.
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    limits: DeadlineLimits,
    triggered: Option<u32>,
    /// Number of consecutive late periods up to now, and its maximum since the last reset.
    consecutive: u32,
    max_consecutive: u32,
    /// Periods for which the compensation stays dropped.
    hold_left: u32,
}

impl Deadline {
    /// Creates a guard before its first period.
    pub const fn new(limits: DeadlineLimits) -> Self {
        Self { limits, triggered: None, consecutive: 0, max_consecutive: 0, hold_left: 0 }
    }

    /// Begins a period that was triggered at `triggered`; `now` is the present time. Returns true if the
    /// compensation may be computed.
    #[inline]
    pub fn begin(&mut self, triggered: u32, now: u32) -> bool {
        let period = self.limits.period.max(1);
        if let Some(before) = self.triggered {
            // Signed: an interrupt that is late by a period is followed by one with the same trigger, whose time may read
            // some cycles earlier.
            let since = triggered.wrapping_sub(before).cast_signed();
            if since > (period + period / 2).cast_signed() {
                self.count_late((since.cast_unsigned() - period / 2) / period);
            }
        }
        self.triggered = Some(triggered);
        self.hold_left = self.hold_left.saturating_sub(1);
        if now.wrapping_sub(triggered) > self.limits.latest_start {
            // Whether the period itself is late is decided at its end.
            self.hold_left = self.limits.hold;
        }
        self.hold_left == 0
    }

    /// Ends a period: the duties are written. Returns true if it was in time.
    #[inline]
    pub fn end(&mut self, now: u32) -> bool {
        let Some(triggered) = self.triggered else { return true };
        let in_time = now.wrapping_sub(triggered) <= self.limits.latest_end;
        if in_time {
            self.consecutive = 0;
        } else {
            self.count_late(1);
        }
        in_time
    }

    fn count_late(&mut self, periods: u32) {
        self.consecutive = self.consecutive.saturating_add(periods);
        self.max_consecutive = self.max_consecutive.max(self.consecutive);
        self.hold_left = self.limits.hold;
    }

    /// Returns the maximum number of consecutive late periods since [`Deadline::reset_max_overruns`]. A sequence
    /// that still continues counts with its present length.
    pub const fn max_consecutive_overruns(&self) -> u32 {
        self.max_consecutive
    }

    /// Resets the maximum after a report. A sequence that continues is not reset.
    pub const fn reset_max_overruns(&mut self) {
        self.max_consecutive = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u32 = 8500;

    fn guard() -> Deadline {
        Deadline::new(DeadlineLimits::for_period(PERIOD, 3))
    }

    /// Runs one period triggered at `at`, which starts and ends the given cycles later.
    fn run(guard: &mut Deadline, at: u32, start: u32, end: u32) -> (bool, bool) {
        (guard.begin(at, at.wrapping_add(start)), guard.end(at.wrapping_add(end)))
    }

    #[test]
    fn periods_in_time_keep_the_compensation_when_the_counter_wraps() {
        let mut guard = guard();
        let mut at = u32::MAX - 10 * PERIOD;
        for _ in 0..100 {
            assert_eq!(run(&mut guard, at, 200, 4000), (true, true));
            at = at.wrapping_add(PERIOD);
        }
        assert_eq!(guard.max_consecutive_overruns(), 0);
    }

    #[test]
    fn late_start_drops_the_compensation_of_the_same_period() {
        let mut guard = guard();
        run(&mut guard, 0, 200, 4000);
        // It started late, but without compensation it ended in time.
        assert_eq!(run(&mut guard, PERIOD, PERIOD / 2 + 1, PERIOD - PERIOD / 10), (false, true));
        assert_eq!(guard.max_consecutive_overruns(), 0);
    }

    #[test]
    fn late_end_drops_the_compensation_for_the_hold_time() {
        let mut guard = guard();
        let mut at = 0;
        let mut next = |end| {
            at += PERIOD;
            run(&mut guard, at, 100, end)
        };
        assert_eq!(next(4000), (true, true));
        assert_eq!(next(PERIOD - PERIOD / 10 + 1), (true, false));
        assert_eq!(next(4000), (false, true));
        // Late again: the hold time restarts.
        assert_eq!(next(8000), (false, false));
        assert_eq!(next(4000), (false, true));
        assert_eq!(next(4000), (false, true));
        assert_eq!(next(4000), (true, true));
        assert_eq!(guard.max_consecutive_overruns(), 1);
    }

    #[test]
    fn trigger_that_reads_earlier_than_the_last_one_counts_no_missed_period() {
        let mut guard = guard();
        run(&mut guard, PERIOD, 100, 4000);
        run(&mut guard, PERIOD - 3, PERIOD / 3, 4000);
        assert_eq!(guard.max_consecutive_overruns(), 0);
    }

    #[test]
    fn missed_periods_are_counted_across_a_report() {
        let mut guard = guard();
        run(&mut guard, 0, 100, 4000);
        // Two triggers were missed; this is the third.
        assert_eq!(run(&mut guard, 3 * PERIOD, 100, 4000), (false, true));
        assert_eq!(guard.max_consecutive_overruns(), 2);
        guard.reset_max_overruns();
        assert_eq!(guard.max_consecutive_overruns(), 0);
        run(&mut guard, 4 * PERIOD, 100, 8000);
        run(&mut guard, 5 * PERIOD, 100, 8000);
        guard.reset_max_overruns();
        run(&mut guard, 6 * PERIOD, 100, 8000);
        assert_eq!(guard.max_consecutive_overruns(), 3);
        run(&mut guard, 7 * PERIOD, 100, 4000);
        guard.reset_max_overruns();
        run(&mut guard, 8 * PERIOD, 100, 8000);
        assert_eq!(guard.max_consecutive_overruns(), 1);
    }

    #[test]
    fn trigger_with_jitter_is_not_counted_as_missed() {
        let mut guard = guard();
        let mut at = 0;
        for jitter in [0, 900, PERIOD / 2 - 1, 0, 17] {
            run(&mut guard, at + jitter, 100, 4000);
            at += PERIOD;
        }
        assert_eq!(guard.max_consecutive_overruns(), 0);
    }
}
