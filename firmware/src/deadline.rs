//! The current loop's guard over its own time.
//!
//! A period has to end before the next one's duties are due. Where one does not, the loop does less: it
//! drops the compensation, at once and by itself, and keeps it dropped for a while; whoever is above
//! hears of it later and decides the rest. Three ways to be late: a period was *missed* (the trigger came and
//! nobody), it *starts* so late that it would end late (compensation is dropped before it is computed), or it
//! *ends* late all the same (dropped from the next on).
//!
//! Time is a free-running counter of processor cycles that wraps, and is passed in. All times of a period
//! count from its trigger, the middle of the PWM period the currents were sampled in, not from when the
//! interrupt got its turn.

/// What a period may take, in cycles and periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Cycles from trigger to trigger.
    pub period: u32,
    /// Latest start, cycles after the trigger: from here on the work no longer fits.
    pub latest_start: u32,
    /// Latest end, cycles after the trigger.
    pub latest_end: u32,
    /// Periods the compensation stays dropped after the last late one.
    pub hold: u32,
}

impl Limits {
    /// For a period of so many cycles: the start may use up half of it, the end 0.9; dropped for `hold`
    /// periods.
    pub const fn of_period(period: u32, hold: u32) -> Self {
        Self { period, latest_start: period / 2, latest_end: period - period / 10, hold }
    }
}

/// The guard.
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    limits: Limits,
    triggered: Option<u32>,
    /// Late periods in a row up to now, and the longest such row since it was last asked for.
    row: u32,
    longest: u32,
    /// Periods the compensation is still dropped for.
    dropped: u32,
}

impl Deadline {
    /// A guard that has seen no period yet.
    pub const fn new(limits: Limits) -> Self {
        Self { limits, triggered: None, row: 0, longest: 0, dropped: 0 }
    }

    /// A period begins: its trigger was at `triggered`, it is `now`. Says whether the compensation may
    /// be computed in it.
    #[inline]
    pub fn begin(&mut self, triggered: u32, now: u32) -> bool {
        let period = self.limits.period.max(1);
        if let Some(before) = self.triggered {
            let since = triggered.wrapping_sub(before);
            if since > period + period / 2 {
                self.late((since - period / 2) / period);
            }
        }
        self.triggered = Some(triggered);
        self.dropped = self.dropped.saturating_sub(1);
        if now.wrapping_sub(triggered) > self.limits.latest_start {
            // Whether it is a late one is seen at its end.
            self.dropped = self.limits.hold;
        }
        self.dropped == 0
    }

    /// The period ends: duties are written. Says whether that was in time.
    #[inline]
    pub fn end(&mut self, now: u32) -> bool {
        let Some(triggered) = self.triggered else { return true };
        let in_time = now.wrapping_sub(triggered) <= self.limits.latest_end;
        if in_time {
            self.row = 0;
        } else {
            self.late(1);
        }
        in_time
    }

    fn late(&mut self, periods: u32) {
        self.row = self.row.saturating_add(periods);
        self.longest = self.longest.max(self.row);
        self.dropped = self.limits.hold;
    }

    /// The longest row of late periods since [`Deadline::forget`]; one that is not over counts as far as
    /// it has come.
    pub const fn longest_row(&self) -> u32 {
        self.longest
    }

    /// The row was told; the next is counted from anew, but one that is not over goes on.
    pub const fn forget(&mut self) {
        self.longest = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u32 = 8500;

    fn guard() -> Deadline {
        Deadline::new(Limits::of_period(PERIOD, 3))
    }

    /// One period triggered at `at`, that starts and ends so many cycles after.
    fn run(guard: &mut Deadline, at: u32, start: u32, end: u32) -> (bool, bool) {
        (guard.begin(at, at.wrapping_add(start)), guard.end(at.wrapping_add(end)))
    }

    #[test]
    fn in_time_nothing_is_dropped_also_where_the_counter_wraps() {
        let mut guard = guard();
        let mut at = u32::MAX - 10 * PERIOD;
        for _ in 0..100 {
            assert_eq!(run(&mut guard, at, 200, 4000), (true, true));
            at = at.wrapping_add(PERIOD);
        }
        assert_eq!(guard.longest_row(), 0);
    }

    #[test]
    fn a_late_start_drops_the_compensation_of_that_very_period() {
        let mut guard = guard();
        run(&mut guard, 0, 200, 4000);
        // It got its turn late, and without compensation it came out in time.
        assert_eq!(run(&mut guard, PERIOD, PERIOD / 2 + 1, PERIOD - PERIOD / 10), (false, true));
        assert_eq!(guard.longest_row(), 0);
    }

    #[test]
    fn a_late_end_drops_it_for_the_hold_time_after_the_last() {
        let mut guard = guard();
        let mut at = 0;
        let mut next = |end| {
            at += PERIOD;
            run(&mut guard, at, 100, end)
        };
        assert_eq!(next(4000), (true, true));
        assert_eq!(next(PERIOD - PERIOD / 10 + 1), (true, false));
        assert_eq!(next(4000), (false, true));
        // Late again: the hold starts anew.
        assert_eq!(next(8000), (false, false));
        assert_eq!(next(4000), (false, true));
        assert_eq!(next(4000), (false, true));
        assert_eq!(next(4000), (true, true));
        assert_eq!(guard.longest_row(), 1);
    }

    #[test]
    fn missed_periods_are_counted_and_a_row_goes_on_over_a_report() {
        let mut guard = guard();
        run(&mut guard, 0, 100, 4000);
        // Two triggers passed nobody took; this is the third.
        assert_eq!(run(&mut guard, 3 * PERIOD, 100, 4000), (false, true));
        assert_eq!(guard.longest_row(), 2);
        guard.forget();
        assert_eq!(guard.longest_row(), 0);
        run(&mut guard, 4 * PERIOD, 100, 8000);
        run(&mut guard, 5 * PERIOD, 100, 8000);
        guard.forget();
        run(&mut guard, 6 * PERIOD, 100, 8000);
        assert_eq!(guard.longest_row(), 3);
        run(&mut guard, 7 * PERIOD, 100, 4000);
        guard.forget();
        run(&mut guard, 8 * PERIOD, 100, 8000);
        assert_eq!(guard.longest_row(), 1);
    }

    #[test]
    fn a_trigger_that_is_a_little_early_or_late_is_none_missed() {
        let mut guard = guard();
        let mut at = 0;
        for jitter in [0, 900, PERIOD / 2 - 1, 0, 17] {
            run(&mut guard, at + jitter, 100, 4000);
            at += PERIOD;
        }
        assert_eq!(guard.longest_row(), 0);
    }
}
