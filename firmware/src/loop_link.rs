//! Between the current loop's interrupt and the background: queues of whole values.
//!
//! Orders and, after a commit, parts go up to the interrupt; reports come down. Nothing is shared and
//! nothing locked, so nothing is seen half-written and neither side ever waits for the other. [`LoopPort`]
//! is the interrupt's end. [`LoopLink`] is the background's, which also knows when the loop last reported:
//! one that has fallen silent is told to the supervisor as samples that grow old, and starves the watchdog.

use crate::control::PERIOD_S;
use crate::driver::{LoopOrders, LoopReport, REPORT_PERIOD_S};
use crate::loop_parts::{Parts, StageTraits};
use crate::parameter_set::ParameterSet;
use heapless::spsc::{Consumer, Producer, Queue};

/// A loop that has not reported for so long no longer runs, us.
pub const LOOP_SILENT_US: u64 = 5000;

/// Time from one report to the next, us.
const REPORT_US: u64 = (REPORT_PERIOD_S * 1e6 + 0.5) as u64;

/// The queues themselves: a place for them, which outlives both ends. A queue holds one less than its number.
#[derive(Default)]
pub struct LoopQueues {
    orders: Queue<LoopOrders, 4>,
    parts: Queue<Parts, 2>,
    reports: Queue<LoopReport, 4>,
}

impl LoopQueues {
    /// Empty queues.
    pub const fn new() -> Self {
        Self { orders: Queue::new(), parts: Queue::new(), reports: Queue::new() }
    }

    /// Both ends, for a loop on this stage that starts now.
    pub fn split(&mut self, stage: StageTraits, now_us: u64) -> (LoopPort<'_>, LoopLink<'_>) {
        let (orders_out, orders_in) = self.orders.split();
        let (parts_out, parts_in) = self.parts.split();
        let (reports_out, reports_in) = self.reports.split();
        let port = LoopPort { orders: orders_in, parts: parts_in, reports: reports_out };
        let last = LoopReport::default();
        let (orders, parts, reports) = (orders_out, parts_out, reports_in);
        (port, LoopLink { orders, parts, reports, last, reported_us: now_us, set_number: 0, stage })
    }
}

/// The interrupt's end.
pub struct LoopPort<'q> {
    pub(crate) orders: Consumer<'q, LoopOrders>,
    pub(crate) parts: Consumer<'q, Parts>,
    pub(crate) reports: Producer<'q, LoopReport>,
}

/// The background's end.
pub struct LoopLink<'q> {
    orders: Producer<'q, LoopOrders>,
    parts: Producer<'q, Parts>,
    reports: Consumer<'q, LoopReport>,
    last: LoopReport,
    reported_us: u64,
    /// The parameter set the loop has parts of.
    set_number: u32,
    stage: StageTraits,
}

impl LoopLink<'_> {
    /// Gives every report since the last call; where none came the last one, grown old, with nothing
    /// counted twice. It is old by what it is overdue: reports and calls have the same period, and a call just before a
    /// report finds none.
    pub fn reports(&mut self, now_us: u64, mut take: impl FnMut(LoopReport)) {
        let mut silent = true;
        while let Some(report) = self.reports.dequeue() {
            silent = false;
            self.reported_us = now_us;
            self.last = report;
            take(report);
        }
        if silent {
            let overdue_us = now_us.saturating_sub(self.reported_us + REPORT_US);
            take(LoopReport {
                sample_age_us: Some(u32::try_from(overdue_us).unwrap_or(u32::MAX)),
                overruns_in_a_row: 0,
                residual_torque_nm: f32::NAN,
                ..self.last
            });
        }
    }

    /// Whether the loop still reports: a watchdog is fed only then.
    pub fn is_alive(&self, now_us: u64) -> bool {
        now_us.saturating_sub(self.reported_us) < LOOP_SILENT_US
    }

    /// Orders for the loop, and parts before the first orders with another parameter set.
    ///
    /// # Panics
    /// Where parts of the set in use cannot be built: the driver built them before it took the set.
    pub fn order(&mut self, orders: LoopOrders, set: &ParameterSet) {
        if !self.parts.ready() {
            // The loop has not taken the last parts: it does not run, and orders would be for the old ones.
            return;
        }
        if orders.set_number != self.set_number {
            self.set_number = orders.set_number;
            match Parts::build(set, self.stage, PERIOD_S) {
                Ok(parts) => drop(self.parts.enqueue(parts)),
                Err(refused) => panic!("committed parameters: {refused}"),
            }
        }
        // A full queue is a loop that does not run; its set-point grows old there.
        let _ = self.orders.enqueue(orders);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_just_missed_is_no_conversion_missing_and_two_are() {
        let mut queues = LoopQueues::new();
        let (mut port, mut link) = queues.split(StageTraits::NONE, 0);
        let age_us = |link: &mut LoopLink, now_us| {
            let mut age_us = None;
            link.reports(now_us, |report| age_us = report.sample_age_us);
            age_us
        };
        port.reports
            .enqueue(LoopReport { sample_age_us: Some(0), ..LoopReport::default() })
            .unwrap();
        assert_eq!(age_us(&mut link, 1000), Some(0));
        // An interrupt was missed: the report comes 50 us after this call.
        assert_eq!(age_us(&mut link, 2000), Some(0));
        assert_eq!(age_us(&mut link, 3000), Some(1000));
        assert!(link.is_alive(5999) && !link.is_alive(6000));
    }
}
