//! What the loop sends: reports to the driver, and rows to the scope.
//!
//! ```text
//! period:  record_cycle -> [report due, or row due] -> PeriodValues
//! later periods, one step each:  values -> probe, while a motor is measured -> status
//! ```
//! Flags are collected in every period, values in the period that a report describes. A report takes several periods,
//! because one period with all of it would be the longest. A period that takes commands or parts sends nothing.
//! If a queue is full, the values of a later period replace those that could not be sent, and the flags stay.
//!
//! The scope takes its rows from the same values. A row is sent at the end of the period that recorded it.

use super::LoopTask;
use crate::control::probe::ProbeReport;
use crate::control::{Compensate, CycleResult, LoopFlags, StageSample, ValidChannels};
use crate::driver::{PeriodValues, ReportStatus, ReportedAngle, TouchEdges};
use crate::loop_link::{LoopPort, ReportSender};
use crate::scope::{ScopeRow, signal};
use compensator_core::Flags;

/// Progress of a report. Every step is taken in another period, because one period with all of them would be the longest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReportStep {
    /// The values are recorded when a report is due.
    Collect,
    /// The values are recorded, and sent next.
    SendValues,
    /// A result of a motor measurement is sent next.
    SendProbe,
    /// The status is sent next.
    SendStatus,
}

/// State of the scope between two periods.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScopeTap {
    /// Periods since the last row.
    pub since: u16,
    /// The present period records its values.
    pub is_due: bool,
    /// The queue was full since the last row.
    pub has_gap: bool,
}

impl ScopeTap {
    pub const IDLE: Self = Self { since: u16::MAX, is_due: false, has_gap: false };
}

impl LoopTask {
    /// Sends the row of this period, if one is due, and finds whether the next period records one. The values are those of
    /// a report, which the period has recorded: the scope costs no period without it.
    #[cold]
    pub(super) fn step_scope(&mut self, port: &mut LoopPort<'_>) {
        let order = &self.commands.scope;
        if self.scope.is_due {
            let values = order.signals.map(|number| signal::value(number, &self.values));
            let (capture, is_after_gap) = (order.capture, self.scope.has_gap);
            let row = ScopeRow { values, capture, is_after_gap };
            self.scope.has_gap = port.scope.enqueue(row).is_err();
            self.scope.since = 0;
        }
        self.scope.since = self.scope.since.saturating_add(1);
        self.scope.is_due = self.scope.since >= order.every;
    }

    #[inline(always)]
    pub(super) fn send_values(&mut self, reports: &mut ReportSender<'_>) {
        let is_sent = reports.values.enqueue(self.values).is_ok();
        self.report_step = match (is_sent, self.commands.probe.is_some()) {
            // The queue is full: the values of a later period replace them.
            (false, _) => ReportStep::Collect,
            (true, false) => ReportStep::SendStatus,
            (true, true) => ReportStep::SendProbe,
        };
    }

    #[cold]
    pub(super) fn send_probe(&mut self, reports: &mut ReportSender<'_>) {
        self.has_sent_probe = reports.probes.enqueue(self.probe_report()).is_ok();
        self.report_step = ReportStep::SendStatus;
    }

    pub(super) fn probe_report(&self) -> ProbeReport {
        let [a, b, _] = self.guard.offset_a();
        ProbeReport { offset_a: [a, b], ..self.probe.report() }
    }

    #[inline(always)]
    pub(super) fn status(&self, magnet_fault: bool) -> ReportStatus {
        ReportStatus {
            loop_flags: self.loop_flags | self.tripped,
            flags: self.compensator_flags,
            bristle_torque_nm: self.current_loop.compensator().bristle_torque_nm(),
            overruns_in_a_row: self.deadline.max_consecutive_overruns(),
            gate_driver_fault: self.gate_fault || self.held_by_hardware && !self.held_by_system,
            system_break: self.system_break || self.held_by_system,
            magnet_fault,
            bridge_shorted: self.brake.is_shorted(),
            touch: self.touch,
            has_probe: self.has_sent_probe,
        }
    }

    /// Begins the flags and counts of the next report.
    pub(super) fn begin_report(&mut self) {
        self.loop_flags = LoopFlags::empty();
        self.compensator_flags = Flags::empty();
        self.deadline.reset_max_overruns();
        self.gate_fault = false;
        self.system_break = false;
        self.touch = TouchEdges::default();
        self.has_sent_probe = false;
        self.report_step = ReportStep::Collect;
    }

    #[inline]
    pub(super) fn record_cycle(&mut self, sample: &StageSample, cycle: &CycleResult) {
        self.since_report = self.since_report.saturating_add(1);
        self.loop_flags |= cycle.flags;
        self.compensator_flags |= cycle.compensator;
        let is_due = self.since_report >= self.report_every && !self.takes_input;
        let begins_report = is_due && self.report_step == ReportStep::Collect;
        if begins_report {
            self.since_report = 0;
            self.report_step = ReportStep::SendValues;
        }
        if begins_report || self.scope.is_due {
            self.record_values(sample, cycle);
        }
    }

    #[inline(always)]
    fn record_values(&mut self, sample: &StageSample, cycle: &CycleResult) {
        let valid = sample.valid;
        let [a, b, c] = sample.currents_a;
        let two = valid.contains(ValidChannels::CURRENT_A | ValidChannels::CURRENT_B);
        let known = |value: f32, valid: bool| if valid { value } else { f32::NAN };
        self.values = PeriodValues {
            bus_voltage_v: known(sample.bus_v, valid.contains(ValidChannels::BUS)),
            phase_currents_a: match (two, valid.contains(ValidChannels::CURRENT_C)) {
                (true, true) => [a, b, c],
                (true, false) => [a, b, -a - b],
                (false, _) => [f32::NAN; 3],
            },
            current_a: cycle.current_q_a,
            current_d_a: cycle.current_d_a,
            current_reference_a: cycle.current_reference_a,
            voltage_q_v: cycle.voltage_v.q,
            velocity_rad_s: cycle.velocity_rad_s,
            turned_rad: cycle.position_rad,
            rotor: ReportedAngle::new(
                self.current_loop.rotor_angle(),
                !cycle.flags.contains(LoopFlags::POSITION_UNREFERENCED),
            ),
            motor_torque_nm: cycle.motor_torque_nm,
            friction_torque_nm: cycle.friction_torque_nm,
            feed_forward_current_a: cycle.feed_forward_current_a,
            residual_torque_nm: known(cycle.residual_torque_nm, cycle.residual_valid),
            level_gain: self.level_gain,
        };
    }
}
