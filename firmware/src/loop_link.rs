//! Queues of whole values between the current loop's interrupt and the background.
//!
//! Commands and, after a commit, parts go to the interrupt; reports come back. Nothing is shared or locked: no
//! value is read half-written, and neither side waits for the other. [`LoopPort`] is the interrupt's end.
//! [`LoopLink`] is the background's end and also records when the loop last reported. If the reports stop, the
//! supervisor sees samples of growing age, and the watchdog is not refreshed.

use crate::control::probe::ProbeReport;
use crate::driver::{
    LoopCommands, LoopOutput, LoopReport, NumberedGains, PeriodValues, REPORT_PERIOD_S,
    ReportStatus,
};
use crate::loop_parts::{LoopParts, StageTraits};
use crate::parameter_set::ParameterSet;
use crate::scope::{QUEUE_ROWS, ScopeRow};
use compensator_core::adaptation::Gains;
use heapless::spsc::{Consumer, Producer, Queue};

/// Time without a report after which the loop counts as stopped, us.
pub const LOOP_TIMEOUT_US: u64 = 5000;

/// Time from one report to the next, us.
const REPORT_US: u64 = (REPORT_PERIOD_S * 1e6 + 0.5) as u64;

/// Storage of the queues, which must outlive both ends. A queue holds one value less than its size.
#[derive(Default)]
pub struct LoopQueues {
    commands: Queue<LoopCommands, 4>,
    parts: Queue<LoopParts, 2>,
    gains: Queue<Gains<f32>, 2>,
    reports: ReportQueues,
    scope: Queue<ScopeRow, QUEUE_ROWS>,
}

impl LoopQueues {
    /// Creates empty queues.
    pub const fn new() -> Self {
        Self {
            commands: Queue::new(),
            parts: Queue::new(),
            gains: Queue::new(),
            reports: ReportQueues::new(),
            scope: Queue::new(),
        }
    }

    /// Returns both ends, for a loop on this stage that starts now.
    pub fn split(&mut self, stage: StageTraits, now_us: u64) -> (LoopPort<'_>, LoopLink<'_>) {
        let (commands_out, commands_in) = self.commands.split();
        let (parts_out, parts_in) = self.parts.split();
        let (gains_out, gains_in) = self.gains.split();
        let (reports_out, reports_in) = self.reports.split();
        let (scope_out, scope_in) = self.scope.split();
        let port = LoopPort {
            commands: commands_in,
            parts: parts_in,
            gains: gains_in,
            reports: reports_out,
            scope: scope_out,
        };
        let link = LoopLink {
            commands: commands_out,
            parts: parts_out,
            gains: gains_out,
            reports: reports_in,
            scope: scope_in,
            last: LoopReport::default(),
            reported_us: now_us,
            has_reported: false,
            set_number: 0,
            gains_number: 0,
            stage,
        };
        (port, link)
    }
}

/// The interrupt's end of the queues.
pub struct LoopPort<'q> {
    pub(crate) commands: Consumer<'q, LoopCommands>,
    pub(crate) parts: Consumer<'q, LoopParts>,
    pub(crate) gains: Consumer<'q, Gains<f32>>,
    pub(crate) reports: ReportSender<'q>,
    pub(crate) scope: Producer<'q, ScopeRow>,
}

/// Queues of the parts of reports. A part is copied in fewer cycles than a whole report, and each is sent in another
/// period. The status comes last: with it, a report is complete.
#[derive(Default)]
struct ReportQueues {
    values: Queue<PeriodValues, 4>,
    probes: Queue<ProbeReport, 4>,
    statuses: Queue<ReportStatus, 4>,
}

/// The interrupt's end of the queues of reports.
pub(crate) struct ReportSender<'q> {
    pub values: Producer<'q, PeriodValues>,
    pub probes: Producer<'q, ProbeReport>,
    pub statuses: Producer<'q, ReportStatus>,
}

/// The background's end of the queues of reports.
struct ReportReceiver<'q> {
    values: Consumer<'q, PeriodValues>,
    probes: Consumer<'q, ProbeReport>,
    statuses: Consumer<'q, ReportStatus>,
}

impl ReportQueues {
    const fn new() -> Self {
        Self { values: Queue::new(), probes: Queue::new(), statuses: Queue::new() }
    }

    fn split(&mut self) -> (ReportSender<'_>, ReportReceiver<'_>) {
        let (values_out, values) = self.values.split();
        let (probes_out, probes) = self.probes.split();
        let (statuses_out, statuses) = self.statuses.split();
        (
            ReportSender { values: values_out, probes: probes_out, statuses: statuses_out },
            ReportReceiver { values, probes, statuses },
        )
    }
}

impl ReportReceiver<'_> {
    fn dequeue(&mut self) -> Option<LoopReport> {
        let status = self.statuses.dequeue()?;
        let probe = if status.has_probe { self.probes.dequeue()? } else { ProbeReport::default() };
        Some(LoopReport::join(&self.values.dequeue()?, &status, probe))
    }
}

/// The background's end of the queues.
pub struct LoopLink<'q> {
    commands: Producer<'q, LoopCommands>,
    parts: Producer<'q, LoopParts>,
    gains: Producer<'q, Gains<f32>>,
    reports: ReportReceiver<'q>,
    scope: Consumer<'q, ScopeRow>,
    last: LoopReport,
    reported_us: u64,
    /// The last tick found a report.
    has_reported: bool,
    /// Number of the parameter set that was last sent to the loop.
    set_number: u32,
    /// Number of the gains that were last sent to the loop.
    gains_number: u32,
    stage: StageTraits,
}

impl LoopLink<'_> {
    /// Passes every report since the last call to `take`. Without a new report, it passes the last one with a
    /// growing age and without the counted values. The age is the time that the report is overdue, because calls
    /// and reports have the same period, and a call just before a report finds none.
    pub fn reports(&mut self, now_us: u64, mut take: impl FnMut(LoopReport)) {
        let mut silent = true;
        while let Some(report) = self.reports.dequeue() {
            silent = false;
            self.reported_us = now_us;
            self.last = report;
            take(report);
        }
        self.has_reported = !silent;
        if silent {
            let overdue_us = now_us.saturating_sub(self.reported_us + REPORT_US);
            take(LoopReport {
                sample_age_us: Some(u32::try_from(overdue_us).unwrap_or(u32::MAX)),
                overruns_in_a_row: 0,
                residual_torque_nm: f32::NAN,
                is_repeated: true,
                ..self.last
            });
        }
    }

    /// Returns true if a report waits for the next call of [`Self::reports`].
    pub fn has_report(&self) -> bool {
        self.reports.statuses.ready()
    }

    /// Ends a tick at this time. Its reports were taken after its begin: if the tick was held up in between, the next one
    /// finds none, and their age must not include the delay of the background.
    pub fn end_tick(&mut self, now_us: u64) {
        if self.has_reported {
            self.reported_us = now_us;
        }
    }

    /// Passes every row of the scope since the last call to `take`.
    pub fn scope_rows(&mut self, mut take: impl FnMut(&ScopeRow)) {
        while let Some(row) = self.scope.dequeue() {
            take(&row);
        }
    }

    /// Returns true if the loop still reports. The watchdog is refreshed only then.
    pub fn is_alive(&self, now_us: u64) -> bool {
        now_us.saturating_sub(self.reported_us) < LOOP_TIMEOUT_US
    }

    /// Builds and sends the parts of a set, and returns true if there are any. The driver has built the set in the same way before
    /// it accepted it, but not the defaults after a loss of the flash.
    // Not inlined: its stack is free again during the rest of the tick.
    #[inline(never)]
    fn send_parts(&mut self, set: &ParameterSet) -> bool {
        let built = LoopParts::build_or_measure_only(set, self.stage, &mut None);
        built.is_ok_and(|parts| self.parts.enqueue(parts).is_ok())
    }

    /// Sends the output of a tick to the loop: gains only if they are others than the last ones, and before commands with
    /// another parameter set its parts.
    pub fn send(&mut self, output: &LoopOutput, set: &ParameterSet) {
        let commands = output.commands;
        if !self.parts.ready() {
            // The loop has not taken the last parts, so it does not run, and these commands do not fit the old
            // parts.
            return;
        }
        if commands.set_number != self.set_number {
            if !self.send_parts(set) {
                // The set-point goes stale in the loop.
                return;
            }
            self.set_number = commands.set_number;
        }
        // If the queue is full, the loop does not run, and its set-point goes stale there.
        let _ = self.commands.enqueue(commands);
        if let Some(NumberedGains { number, gains }) = output.gains
            && number != self.gains_number
            && self.parts.ready()
            && self.gains.enqueue(gains).is_ok()
        {
            self.gains_number = number;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::LoopFlags;
    use compensator_core::Flags;

    #[test]
    fn reports_with_one_missed_keep_age_0_and_with_two_report_an_age() {
        let mut queues = LoopQueues::new();
        let (mut port, mut link) = queues.split(StageTraits::NONE, 0);
        let age_us = |link: &mut LoopLink, now_us| {
            let mut age_us = None;
            link.reports(now_us, |report| age_us = report.sample_age_us);
            age_us
        };
        let status = ReportStatus {
            loop_flags: LoopFlags::empty(),
            flags: Flags::empty(),
            bristle_torque_nm: 0.0,
            overruns_in_a_row: 0,
            gate_driver_fault: false,
            system_break: false,
            magnet_fault: false,
            bridge_shorted: false,
            touch: Default::default(),
            has_probe: false,
        };
        port.reports.values.enqueue(PeriodValues::default()).unwrap();
        assert_eq!(age_us(&mut link, 1000), Some(0), "a report without its last part");
        port.reports.statuses.enqueue(status).unwrap();
        assert_eq!(age_us(&mut link, 1000), Some(0));
        // An interrupt was missed: the report comes 50 us after this call.
        assert_eq!(age_us(&mut link, 2000), Some(0));
        assert_eq!(age_us(&mut link, 3000), Some(1000));
        assert!(link.is_alive(5999) && !link.is_alive(6000));
    }
}
