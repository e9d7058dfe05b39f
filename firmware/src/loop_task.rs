//! What the current loop's interrupt does, but for the registers.
//!
//! ```text
//! interrupt: orders, parts -> LoopTask::interrupt <-> PowerStage;  a report, now and then
//! below it:  LoopLink <- reports;  Driver -> orders, parts -> LoopLink
//! ```
//! The interrupt owns a [`LoopTask`] and everything in it. What goes in and out are whole values through
//! queues ([`crate::loop_link`]): [`LoopOrders`] and, after a commit, [`Parts`] built below; [`LoopReport`]s
//! out. Between two orders the ages of what came over the bus grow here, so a background that has died is a
//! set-point gone stale, and no current.
//!
//! A fault seen while driving *trips*: the bridge opens in that period and stays open until the orders say
//! off. So the interrupt never closes it again before the supervisor has seen why. Until then every report
//! repeats the fault, so that a late supervisor does not miss it.

use crate::bridge_guard::BridgeGuard;
use crate::control::probe::{Probe, ProbeReport};
use crate::control::{
    Bridge, Broke, Compensate, Covariates, CurrentLoop, Cycle, LoopFlags, PowerStage, Setpoint,
    StageSample, Valid,
};
use crate::deadline::{Deadline, Limits};
use crate::driver::{Home, LoopOrders, LoopReport, REPORT_PERIOD_S};
use crate::loop_link::LoopPort;
use crate::loop_parts::{Model, Parts};
use compensator_core::Flags;
use compensator_core::compensator::Reading;

/// The interrupt's own.
#[derive(Clone, Debug)]
pub struct LoopTask {
    current_loop: CurrentLoop<Model>,
    deadline: Deadline,
    orders: LoopOrders,
    may_drive: bool,
    /// Why the bridge is held off until it was ordered off; empty where it is not.
    tripped: LoopFlags,
    /// The hardware opened the bridge while it was ordered on: held off in the same way.
    broken: bool,
    /// The hardware said so at any time since the last report, for the gate driver and for the chip.
    gate_fault: bool,
    system_break: bool,
    /// For whom it is held off.
    broken_by_system: bool,
    guard: BridgeGuard,
    probe: Probe,
    /// The guard wants something done before the bridge may close.
    waiting: bool,
    report: LoopReport,
    period_s: f32,
    /// Periods since the last report, and from one to the next.
    since_report: u32,
    report_every: u32,
}

/// Orders before the first: nothing is on.
const NO_ORDERS: LoopOrders = LoopOrders {
    setpoint: Setpoint::NONE,
    covariates: Covariates {
        radial_force_n: MISSING,
        pressure_diff_mpa: MISSING,
        temperature_c: MISSING,
        load_torque_nm: MISSING,
        auxiliary: MISSING,
        campaign_time_h: 0.0,
    },
    bridge: false,
    compensation: false,
    current_share: 1.0,
    compensation_share: 1.0,
    factors: None,
    set_number: 0,
    home: Home { position_rad: 0.0, number: 0 },
    gate_resets: 0,
    probe: None,
};
const MISSING: Reading<f32> = Reading { value: 0.0, age_s: -1.0 };

impl LoopTask {
    /// A loop that waits for orders, bridge off.
    pub fn new(parts: Parts, limits: Limits) -> Self {
        let period_s = parts.motor.period_s();
        let mut task = Self {
            current_loop: CurrentLoop::new(parts.motor, parts.model),
            deadline: Deadline::new(limits),
            orders: NO_ORDERS,
            may_drive: parts.may_drive,
            tripped: LoopFlags::empty(),
            broken: false,
            gate_fault: false,
            system_break: false,
            broken_by_system: false,
            guard: BridgeGuard::default(),
            probe: Probe::default(),
            waiting: false,
            report: LoopReport::default(),
            period_s,
            since_report: 0,
            report_every: ((REPORT_PERIOD_S / period_s) as u32).max(1),
        };
        task.clear_report();
        task
    }

    /// Takes orders. That the bridge is ordered off ends a trip: it was seen. A position that was said is
    /// the joint's from now on.
    pub fn order(&mut self, orders: LoopOrders) {
        if !orders.bridge {
            self.tripped = LoopFlags::empty();
            self.broken = false;
            self.broken_by_system = false;
        }
        if orders.home.number != self.orders.home.number {
            self.current_loop.set_position(orders.home.position_rad);
        }
        self.current_loop.compensator().set_share(orders.current_share);
        self.current_loop.compensator().set_compensation(orders.compensation_share);
        self.current_loop.supply(orders.factors);
        self.orders = orders;
    }

    /// Takes other parameters, between two periods.
    ///
    /// By reference, and copied where they are to be: a swap costs 1000 instructions of the interrupt, 2200 by value
    /// (`tests/cost/table.md`).
    pub fn swap(&mut self, parts: &Parts) {
        parts.model.set_share(self.orders.current_share);
        parts.model.set_compensation(self.orders.compensation_share);
        self.may_drive = parts.may_drive;
        self.current_loop.swap(&parts.motor);
        self.current_loop.swap_compensator(&parts.model);
    }

    /// The whole interrupt on a power stage: what came from the background, one period, a report if one is
    /// due. `triggered` is when the sample was taken and `now` when the interrupt began, in cycles.
    #[inline]
    pub fn interrupt(
        &mut self,
        stage: &mut impl PowerStage,
        port: &mut LoopPort<'_>,
        triggered: u32,
        now: u32,
    ) {
        let mut sample = stage.sample();
        // Parts first: orders to drive come after those they are for.
        if let Some(parts) = port.parts.peek() {
            self.swap(parts);
            drop(port.parts.dequeue());
        }
        while let Some(orders) = port.orders.dequeue() {
            self.order(orders);
        }
        let stopped = !self.tripped.is_empty() || self.broken;
        let ordered = self.orders.bridge && self.may_drive;
        let permission = self.guard.step(&mut sample, ordered, stopped, self.orders.gate_resets);
        self.waiting = !permission.may_close;
        // What a gate driver says in its sleep is no fault.
        let said = |by: &Broke| permission.settled || *by == Broke::System;
        let broke = stage.broke().filter(said);
        stage.apply(self.period(&sample, broke, triggered, now));
        stage.wake(permission.awake);
        self.end(stage.cycles());
        if let Some(report) = self.report()
            && port.reports.enqueue(report).is_ok()
        {
            self.reported();
        }
    }

    /// One period: what was sampled at the trigger, when that was and when it is now, in cycles; whether
    /// the hardware has opened the bridge by itself. Gives what the bridge is to do.
    #[inline]
    pub fn period(
        &mut self,
        sample: &StageSample,
        broke: Option<Broke>,
        triggered: u32,
        now: u32,
    ) -> Bridge {
        let in_time = self.deadline.begin(triggered, now);
        if broke == Some(Broke::Overcurrent) {
            self.open_for_overcurrent();
        } else if let Some(by) = broke {
            self.gate_fault |= by == Broke::GateDriver;
            self.system_break |= by == Broke::System;
            if self.orders.bridge {
                self.broken = true;
                self.broken_by_system |= by == Broke::System;
            }
        }
        let held = !self.tripped.is_empty() || self.broken || !self.may_drive || self.waiting;
        let driving = self.orders.bridge && !held;
        let probing = self.orders.probe.is_some();
        self.current_loop.set_driving(driving && !probing);
        self.current_loop.set_compensating(self.orders.compensation && in_time);
        let cycle = self.current_loop.step(sample, &self.orders.setpoint, &self.orders.covariates);
        if driving {
            self.tripped |= cycle.flags.intersection(LoopFlags::FAULTS);
        }
        let bridge = if probing { self.measure(sample, &cycle, driving) } else { cycle.bridge };
        self.grow_old();
        self.note(sample, &cycle);
        bridge
    }

    /// Comparators have opened the bridge: an overcurrent as if it had been measured.
    #[cold]
    fn open_for_overcurrent(&mut self) {
        self.report.loop_flags |= LoopFlags::OVERCURRENT;
        if self.orders.bridge {
            self.tripped |= LoopFlags::OVERCURRENT;
        }
    }

    /// A period of a measurement: the current loop only looks on. What opens the bridge under it opens it here.
    #[cold]
    fn measure(&mut self, sample: &StageSample, cycle: &Cycle, driving: bool) -> Bridge {
        let Some(order) = &self.orders.probe else { return Bridge::Off };
        let stopping = LoopFlags::FAULTS | LoopFlags::SETPOINT_STALE;
        if !driving || cycle.flags.intersects(stopping) {
            return Bridge::Off;
        }
        let measured = self.current_loop.measured(sample);
        self.probe.step(order, sample.encoder, measured, cycle.bus_v)
    }

    /// The period is over: the duties are written.
    #[inline]
    pub fn end(&mut self, now: u32) {
        self.deadline.end(now);
    }

    /// Why the bridge is held off until it is ordered off.
    pub fn tripped(&self) -> LoopFlags {
        self.tripped
    }

    /// A report, if one is due. Nothing of it is forgotten before [`LoopTask::reported`]: where it found no
    /// place, the next says it too.
    #[inline]
    pub fn report(&self) -> Option<LoopReport> {
        if self.since_report < self.report_every {
            return None;
        }
        let mut report = self.report;
        report.loop_flags |= self.tripped;
        if !self.may_drive {
            // The supervisor knows this one as the firmware's own mistake, and does not arm.
            report.loop_flags |= LoopFlags::NOT_FINITE;
        }
        report.gate_driver_fault = self.gate_fault || self.broken && !self.broken_by_system;
        report.system_break = self.system_break || self.broken_by_system;
        report.overruns_in_a_row = self.deadline.longest_row();
        report.bristle_torque_nm = self.current_loop.compensator().bristle_torque_nm();
        if self.orders.probe.is_some() {
            let [a, b, _] = self.guard.offset_a();
            report.probe = ProbeReport { offset_a: [a, b], ..self.probe.report() };
        }
        Some(report)
    }

    /// The report was handed over: the next begins.
    pub fn reported(&mut self) {
        self.clear_report();
        self.deadline.forget();
        self.gate_fault = false;
        self.system_break = false;
        self.since_report = 0;
    }

    fn clear_report(&mut self) {
        self.report.loop_flags = LoopFlags::empty();
        self.report.flags = Flags::empty();
    }

    /// What came over the bus is older by a period.
    fn grow_old(&mut self) {
        let LoopOrders { setpoint, covariates, .. } = &mut self.orders;
        let ages = [
            &mut setpoint.age_s,
            &mut covariates.radial_force_n.age_s,
            &mut covariates.pressure_diff_mpa.age_s,
            &mut covariates.temperature_c.age_s,
            &mut covariates.load_torque_nm.age_s,
            &mut covariates.auxiliary.age_s,
        ];
        for age_s in ages {
            // A negative age says that nothing ever came, and stays negative.
            if *age_s >= 0.0 {
                *age_s += self.period_s;
            }
        }
    }

    #[inline]
    fn note(&mut self, sample: &StageSample, cycle: &Cycle) {
        self.since_report = self.since_report.saturating_add(1);
        let valid = sample.valid;
        let [a, b, c] = sample.currents_a;
        let two = valid.contains(Valid::CURRENT_A | Valid::CURRENT_B);
        let currents = match (two, valid.contains(Valid::CURRENT_C)) {
            (true, true) => [a, b, c],
            (true, false) => [a, b, -a - b],
            (false, _) => [f32::NAN; 3],
        };
        let unreferenced = cycle.flags.contains(LoopFlags::POSITION_UNREFERENCED);
        let known = |value: f32, valid: bool| if valid { value } else { f32::NAN };
        let report = &mut self.report;
        report.bus_voltage_v = Some(known(sample.bus_v, valid.contains(Valid::BUS)));
        report.phase_currents_a = Some(currents);
        report.current_a = cycle.current_q_a;
        report.current_reference_a = cycle.current_reference_a;
        report.voltage_q_v = cycle.voltage_v[1];
        report.velocity_rad_s = cycle.velocity_rad_s;
        report.position_rad = known(cycle.position_rad, !unreferenced);
        report.turned_rad = cycle.position_rad;
        report.motor_torque_nm = cycle.motor_torque_nm;
        report.friction_torque_nm = cycle.friction_torque_nm;
        report.feed_forward_current_a = cycle.feed_forward_current_a;
        report.residual_torque_nm = known(cycle.residual_torque_nm, cycle.residual_valid);
        report.loop_flags |= cycle.flags;
        report.flags |= cycle.compensator;
        report.sample_age_us = Some(0);
    }
}

#[cfg(test)]
#[path = "loop_task_tests.rs"]
mod tests;
