//! The work of the current loop's interrupt, without its registers.
//!
//! ```text
//! interrupt: commands, parts -> LoopTask::interrupt <-> PowerStage;  reports
//! background: LoopLink <- reports;  Driver -> commands, parts -> LoopLink
//! ```
//! The interrupt owns a [`LoopTask`] and all its state. Whole values pass through queues ([`crate::loop_link`]):
//! [`LoopCommands`] and, after a commit, [`LoopParts`] come in; reports go out (`reports`). The ages of all inputs
//! from the bus grow here between two commands. If the background stops, the set-point goes stale and the
//! current becomes zero.
//!
//! A fault while driving *trips* the bridge: it opens in that period and stays open until the commands say off.
//! The interrupt therefore never closes it before the supervisor has evaluated the cause; it may short the low sides
//! instead ([`crate::stop_brake`]). Until then every
//! report repeats the fault, so that a late supervisor does not miss it.

mod reports;

use crate::bridge_guard::BridgeGuard;
use crate::control::probe::Probe;
use crate::control::{
    Bridge, BridgeFault, CurrentLoop, CycleResult, JointCompensator, LoopFlags, PowerStage,
    StageSample,
};
use crate::deadline::{Deadline, DeadlineLimits};
use crate::driver::{LoopCommands, PeriodValues, REPORT_PERIOD_S, TouchEdges};
use crate::loop_link::LoopPort;
use crate::loop_parts::LoopParts;
use crate::stop_brake::{self, StopBrake};
use compensator_core::Flags;
use reports::{ReportStep, ScopeTap};

/// State of the current loop's interrupt.
#[derive(Clone, Debug)]
pub struct LoopTask {
    current_loop: CurrentLoop<JointCompensator<f32>>,
    deadline: Deadline,
    commands: LoopCommands,
    may_drive: bool,
    /// Faults that hold the bridge off until it is commanded off; empty if there are none.
    tripped: LoopFlags,
    /// The hardware opened the bridge while it was commanded on; the bridge is held off in the same way.
    held_by_hardware: bool,
    /// Hardware faults since the last report: of the gate driver and of the chip.
    gate_fault: bool,
    system_break: bool,
    /// The chip, not the gate driver, opened the bridge.
    held_by_system: bool,
    guard: BridgeGuard,
    probe: Probe,
    brake: StopBrake,
    /// The bridge guard has to finish its sequence before the bridge may close.
    waiting: bool,
    /// Level of the touch probe's input, and its edges since the last report.
    is_touched: bool,
    touch: TouchEdges,
    /// Flags of the loop and the compensator since the last report.
    loop_flags: LoopFlags,
    compensator_flags: Flags,
    /// Values of the period that the next report describes.
    values: PeriodValues,
    report_step: ReportStep,
    has_sent_probe: bool,
    /// The first half of the commands in front of the queue is taken.
    has_taken_measurements: bool,
    /// The first half of the parts in front of the queue is swapped in.
    has_swapped: bool,
    /// Gain on the levels of the set in use.
    level_gain: f32,
    /// The present period takes parts or commands, so that it leaves reports to the next one.
    takes_input: bool,
    scope: ScopeTap,
    period_s: f32,
    /// Periods since the values were recorded, and from one report to the next.
    since_report: u32,
    report_every: u32,
}

impl LoopTask {
    /// Creates a task that waits for commands, bridge off.
    pub fn new(parts: LoopParts, limits: DeadlineLimits) -> Self {
        let period_s = parts.motor.period_s();
        Self {
            current_loop: CurrentLoop::new(parts.motor, parts.model),
            deadline: Deadline::new(limits),
            commands: LoopCommands::default(),
            may_drive: parts.may_drive,
            tripped: LoopFlags::empty(),
            held_by_hardware: false,
            gate_fault: false,
            system_break: false,
            held_by_system: false,
            guard: BridgeGuard::default(),
            probe: Probe::default(),
            brake: StopBrake::default(),
            waiting: false,
            is_touched: false,
            touch: TouchEdges::default(),
            loop_flags: LoopFlags::empty(),
            compensator_flags: Flags::empty(),
            values: PeriodValues::default(),
            report_step: ReportStep::Collect,
            has_sent_probe: false,
            has_taken_measurements: false,
            has_swapped: false,
            level_gain: 1.0,
            takes_input: false,
            scope: ScopeTap::IDLE,
            period_s,
            since_report: 0,
            report_every: ((REPORT_PERIOD_S / period_s) as u32).max(1),
        }
    }

    /// Applies the second half of the commands. A command to open the bridge clears a trip. A new home position sets the
    /// joint position.
    #[inline]
    fn apply(&mut self, commands: &LoopCommands) {
        if !commands.bridge {
            self.tripped = LoopFlags::empty();
            self.held_by_hardware = false;
            self.held_by_system = false;
        }
        if commands.home.number != self.commands.home.number {
            self.current_loop.set_position(commands.home.position_rad);
        }
        // All but the first half. A new field does not compile until one of the two functions takes it.
        let LoopCommands {
            covariates: _,
            factors: _,
            current_share: _,
            compensation_share: _,
            setpoint,
            bridge,
            brake,
            compensation,
            gate_resets,
            set_number,
            home,
            probe,
            scope,
        } = commands;
        let present = &mut self.commands;
        present.setpoint = *setpoint;
        present.bridge = *bridge;
        present.brake = *brake;
        present.compensation = *compensation;
        present.gate_resets = *gate_resets;
        present.set_number = *set_number;
        present.home = *home;
        present.probe = *probe;
        if present.scope != *scope {
            present.scope = *scope;
            self.scope = ScopeTap::IDLE;
        }
    }

    /// Takes the first half of the commands: covariates, network factors and shares. The halves cost the same.
    #[inline]
    fn take_measurements(&mut self, commands: &LoopCommands) {
        self.commands.covariates = commands.covariates;
        self.commands.factors = commands.factors;
        self.current_loop.supply(commands.factors);
        self.commands.current_share = commands.current_share;
        self.commands.compensation_share = commands.compensation_share;
        self.current_loop.compensator().set_current_share(commands.current_share);
        self.current_loop.compensator().set_compensation_share(commands.compensation_share);
    }

    /// Swaps in other parameters between two periods.
    ///
    /// `parts` is passed by reference and copied in place: a swap costs 1000 instructions of the interrupt this
    /// way, 2200 by value.
    pub fn swap(&mut self, parts: &LoopParts) {
        parts.model.set_current_share(self.commands.current_share);
        parts.model.set_compensation_share(self.commands.compensation_share);
        self.may_drive = parts.may_drive;
        self.current_loop.swap(&parts.motor);
        self.current_loop.swap_compensator(&parts.model);
        self.level_gain = 1.0;
    }

    /// Runs the whole interrupt on a power stage: new parts or commands, one period, and a report if it is due.
    /// `triggered` is the time of the sample and `now` the start of the interrupt, in cycles.
    ///
    /// A period takes parts, or half of the commands, or a step of a report, so that its longest time is not their sum.
    /// The others wait for a later period.
    #[inline]
    pub fn interrupt(
        &mut self,
        stage: &mut impl PowerStage,
        port: &mut LoopPort<'_>,
        triggered: u32,
        now: u32,
    ) {
        let mut sample = stage.sample();
        let is_touched = stage.is_touched();
        if is_touched != self.is_touched {
            self.record_touch(is_touched);
        }
        self.takes_input = self.take_input(port);
        // A step that this period prepares is taken in a later one.
        let report_step = if self.takes_input { ReportStep::Collect } else { self.report_step };
        // The brake needs the gate driver, which sleeps once the brake has ended.
        let is_tripped = !self.tripped.is_empty() && !self.brake.is_shorted();
        let stopped = is_tripped || self.held_by_hardware;
        let ordered = self.commands.bridge && self.may_drive && self.brake.has_ended();
        let permission = self.guard.step(&mut sample, ordered, stopped, self.commands.gate_resets);
        self.waiting = !permission.may_close;
        // A gate driver that sleeps or wakes reports invalid faults.
        let is_valid = |by: &BridgeFault| permission.settled || *by == BridgeFault::System;
        let fault = stage.bridge_fault().filter(is_valid);
        stage.apply(self.period(&sample, fault, triggered, now));
        stage.set_awake(permission.awake);
        self.end(stage.cycles());
        if self.commands.scope.every != 0 {
            self.step_scope(port);
        }
        match report_step {
            ReportStep::Collect => {}
            ReportStep::SendValues => self.send_values(&mut port.reports),
            ReportStep::SendProbe => self.send_probe(&mut port.reports),
            ReportStep::SendStatus => {
                // A probe that was sent belongs to this status, even if the commands have ended the measurement.
                let status = self.status(stage.has_magnet_fault());
                let _ = port.reports.statuses.enqueue(status);
                self.begin_report();
            }
        }
    }

    /// Takes one input that waits: parts, gains, or half of the commands. Returns false if there is none.
    #[inline(always)]
    fn take_input(&mut self, port: &mut LoopPort<'_>) -> bool {
        // Parts first: the commands that follow were made for them.
        if let Some(parts) = port.parts.peek() {
            // In two periods, because the copy of the tuned set takes as long as that of the rest of the model.
            if self.has_swapped {
                self.current_loop.complete_swap(&parts.model);
                drop(port.parts.dequeue());
            } else {
                self.swap(parts);
            }
            self.has_swapped = !self.has_swapped;
        } else if let Some(gains) = port.gains.dequeue() {
            self.current_loop.set_gains(&gains);
            self.level_gain = gains.level;
        } else if let Some(commands) = port.commands.peek() {
            // In two periods, because a period with both halves would be the longest.
            if self.has_taken_measurements {
                self.apply(commands);
                let _ = port.commands.dequeue();
            } else {
                self.take_measurements(commands);
            }
            self.has_taken_measurements = !self.has_taken_measurements;
        } else {
            return false;
        }
        true
    }

    /// Keeps the rotor's angle of the last period at an edge of the touch probe's input.
    #[cold]
    fn record_touch(&mut self, is_touched: bool) {
        self.is_touched = is_touched;
        let edge = if is_touched { &mut self.touch.rise } else { &mut self.touch.fall };
        if edge.is_none() {
            *edge = Some(self.current_loop.rotor_angle());
        }
    }

    /// Runs one period with a sample and any hardware fault. `triggered` is the time of the sample and `now` the
    /// present time, in cycles. Returns the state of the bridge.
    #[inline]
    pub fn period(
        &mut self,
        sample: &StageSample,
        fault: Option<BridgeFault>,
        triggered: u32,
        now: u32,
    ) -> Bridge {
        let in_time = self.deadline.begin(triggered, now);
        if fault == Some(BridgeFault::Overcurrent) {
            self.open_for_overcurrent();
        } else if let Some(by) = fault {
            self.gate_fault |= by == BridgeFault::GateDriver;
            self.system_break |= by == BridgeFault::System;
            if self.commands.bridge {
                self.held_by_hardware = true;
                self.held_by_system |= by == BridgeFault::System;
            }
        }
        let held =
            !self.tripped.is_empty() || self.held_by_hardware || !self.may_drive || self.waiting;
        let driving = self.commands.bridge && !held;
        let probing = self.commands.probe.is_some();
        self.current_loop.set_driving(driving && !probing);
        self.current_loop.set_compensating(self.commands.compensation && in_time);
        let cycle =
            self.current_loop.step(sample, &self.commands.setpoint, &self.commands.covariates);
        if driving {
            self.tripped |= cycle.flags.intersection(LoopFlags::FAULTS);
        }
        let bridge = if probing { self.step_probe(sample, &cycle, driving) } else { cycle.bridge };
        let bridge = self.step_brake(bridge, &cycle, fault.is_some());
        self.age_inputs();
        self.record_cycle(sample, &cycle);
        bridge
    }

    /// Replaces an open bridge by shorted low sides where the reaction to a stop is to brake.
    #[inline(always)]
    fn step_brake(
        &mut self,
        bridge: Bridge,
        cycle: &CycleResult,
        has_hardware_fault: bool,
    ) -> Bridge {
        if !matches!(bridge, Bridge::Off) {
            self.brake.record_driven();
            return bridge;
        }
        if !self.brake.is_due() {
            return Bridge::Off;
        }
        self.brake_motor(cycle, has_hardware_fault)
    }

    /// Returns the bridge of a period of the brake.
    #[cold]
    fn brake_motor(&mut self, cycle: &CycleResult, has_hardware_fault: bool) -> Bridge {
        let preventing = (cycle.flags | self.tripped).intersects(stop_brake::PREVENTING);
        // The guard finds the offsets with open switches before the bridge closes again.
        let closes_again = self.commands.bridge && self.waiting && self.tripped.is_empty();
        let has_fault = has_hardware_fault || self.held_by_hardware || preventing;
        let may_short = self.commands.brake && !has_fault && !closes_again;
        self.brake.step(may_short, self.current_loop.measured_current())
    }

    /// Handles comparators that opened the bridge as a measured overcurrent.
    #[cold]
    fn open_for_overcurrent(&mut self) {
        self.loop_flags |= LoopFlags::OVERCURRENT;
        if self.commands.bridge {
            self.tripped |= LoopFlags::OVERCURRENT;
        }
    }

    /// Runs a period of a commissioning measurement. The current loop only observes; its faults still open the
    /// bridge.
    #[cold]
    fn step_probe(&mut self, sample: &StageSample, cycle: &CycleResult, driving: bool) -> Bridge {
        let Some(order) = &self.commands.probe else { return Bridge::Off };
        let stopping = LoopFlags::FAULTS | LoopFlags::SETPOINT_STALE;
        if !driving || cycle.flags.intersects(stopping) {
            return Bridge::Off;
        }
        let measured = self.current_loop.measured_current();
        self.probe.step(order, sample.encoder, measured, cycle.bus_v)
    }

    /// Ends the period: the duties are written.
    #[inline]
    pub fn end(&mut self, now: u32) {
        self.deadline.end(now);
    }

    /// Returns the faults that hold the bridge off until it is commanded off.
    pub fn tripped(&self) -> LoopFlags {
        self.tripped
    }

    /// Adds a period to the age of every input from the bus.
    fn age_inputs(&mut self) {
        let LoopCommands { setpoint, covariates, .. } = &mut self.commands;
        let period_s = self.period_s;
        let age = |age_s: &mut f32| {
            // A negative age marks an input that was never received, and stays negative.
            if *age_s >= 0.0 {
                *age_s += period_s;
            }
        };
        age(&mut setpoint.age_s);
        covariates.for_each_age(age);
    }
}

#[cfg(test)]
#[path = "loop_task_tests.rs"]
mod tests;
