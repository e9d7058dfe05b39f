//! Tests of the interrupt's work, without its registers.

use super::*;
use crate::control::probe::{BLOCK_PERIODS, ProbeCommand, ProbeReport};
use crate::control::{Covariates, PERIOD_S, Setpoint, ValidChannels};
use crate::driver::{Home, LoopOutput, LoopReport, NumberedGains};
use crate::loop_link::LoopQueues;
use crate::loop_parts::StageTraits;
use crate::parameter_set::ParameterSet;
use crate::scope::{Signal, signal};
use compensator_core::adaptation::Gains;
use compensator_core::compensator::Reading;

const PERIOD: u32 = 8500;

struct Bench {
    task: LoopTask,
    at: u32,
    sample: StageSample,
}

fn healthy() -> StageSample {
    StageSample {
        currents_a: [0.0; 3],
        bus_v: 48.0,
        encoder: 1 << 28,
        valid: ValidChannels::CURRENT_A
            | ValidChannels::CURRENT_B
            | ValidChannels::BUS
            | ValidChannels::ENCODER,
    }
}

fn parts() -> LoopParts {
    LoopParts::build(&ParameterSet::default(), StageTraits::NONE, PERIOD_S).unwrap()
}

fn drive(current_a: f32) -> LoopCommands {
    let setpoint = Setpoint { current_a, velocity_reference_rad_s: 0.0, age_s: 0.0 };
    LoopCommands { setpoint, bridge: true, compensation: true, ..LoopCommands::default() }
}

impl LoopTask {
    /// Applies both halves of commands, which the interrupt takes in different periods.
    fn apply_commands(&mut self, commands: LoopCommands) {
        self.take_measurements(&commands);
        self.apply(&commands);
    }

    /// Returns a report if its values are recorded. Its flags are kept until [`LoopTask::clear_report`].
    fn report(&self) -> Option<LoopReport> {
        let probe = self.commands.probe.map_or_else(Default::default, |_| self.probe_report());
        (self.report_step != ReportStep::Collect)
            .then(|| LoopReport::join(&self.values, &self.status(false), probe))
    }

    /// Discards a report that was recorded but not sent; the next one begins.
    fn clear_report(&mut self) {
        self.begin_report();
        self.since_report = 0;
    }
}

impl Bench {
    /// Creates a loop whose observer has settled.
    fn new() -> Self {
        let task = LoopTask::new(parts(), DeadlineLimits::for_period(PERIOD, 10));
        let mut bench = Self { task, at: 0, sample: healthy() };
        for _ in 0..2000 {
            assert_eq!(bench.run(), Bridge::Off);
        }
        bench.task.clear_report();
        bench
    }

    fn run(&mut self) -> Bridge {
        self.run_taking(200, 3000)
    }

    fn run_taking(&mut self, start: u32, end: u32) -> Bridge {
        self.at = self.at.wrapping_add(PERIOD);
        let at = self.at;
        let bridge = self.task.period(&self.sample, None, at, at.wrapping_add(start));
        self.task.end(at.wrapping_add(end));
        bridge
    }

    fn is_driving(&mut self) -> bool {
        self.run() != Bridge::Off
    }

    fn next_report(&mut self) -> LoopReport {
        loop {
            if let Some(report) = self.task.report() {
                self.task.clear_report();
                return report;
            }
            self.run();
        }
    }
}

#[test]
fn bridge_follows_its_commands() {
    let mut bench = Bench::new();
    assert!(!bench.is_driving());
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
    bench.task.apply_commands(LoopCommands { bridge: false, ..drive(1.0) });
    assert!(!bench.is_driving());
}

#[test]
fn fault_holds_the_bridge_open_until_commanded_off_and_on() {
    let mut bench = Bench::new();
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
    bench.sample.currents_a = [45.0, 0.0, 0.0];
    assert!(!bench.is_driving());
    bench.sample = healthy();
    // Commands already in the queue do not close it.
    bench.task.apply_commands(drive(1.0));
    assert!((0..100).all(|_| !bench.is_driving()));
    // Every report repeats the fault until it is cleared.
    for _ in 0..3 {
        assert!(bench.next_report().loop_flags.contains(LoopFlags::OVERCURRENT));
    }
    bench.task.apply_commands(LoopCommands { bridge: false, ..drive(1.0) });
    bench.task.clear_report();
    assert!(!bench.is_driving());
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::OVERCURRENT));
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn period_with_any_fault_trips() {
    for (name, broken) in [
        (
            "currents",
            StageSample {
                valid: healthy().valid.difference(ValidChannels::CURRENT_A),
                ..healthy()
            },
        ),
        ("overvoltage", StageSample { bus_v: 57.0, ..healthy() }),
        ("undervoltage", StageSample { bus_v: 17.0, ..healthy() }),
    ] {
        let mut bench = Bench::new();
        bench.task.apply_commands(drive(1.0));
        assert!(bench.is_driving(), "{name}");
        bench.sample = broken;
        assert!(!bench.is_driving(), "{name}");
        bench.sample = healthy();
        assert!(!bench.is_driving(), "{name}");
        assert!(LoopFlags::FAULTS.contains(bench.task.tripped()), "{name}");
    }
}

#[test]
fn fault_with_bridge_off_does_not_trip() {
    let mut bench = Bench::new();
    bench.sample.bus_v = 10.0;
    assert!(!bench.is_driving());
    bench.sample = healthy();
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn gate_driver_fault_is_reported_and_held() {
    let mut bench = Bench::new();
    bench.task.apply_commands(drive(1.0));
    bench.at += PERIOD;
    let bridge =
        bench.task.period(&healthy(), Some(BridgeFault::GateDriver), bench.at, bench.at + 100);
    assert_eq!(bridge, Bridge::Off);
    // The hardware signal is gone, but the loop holds the bridge open.
    assert!(!bench.is_driving());
    assert!(bench.next_report().gate_driver_fault);
    assert!(bench.next_report().gate_driver_fault);
    bench.task.apply_commands(LoopCommands { bridge: false, ..drive(1.0) });
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
    bench.task.clear_report();
    assert!(!bench.next_report().gate_driver_fault);
}

#[test]
fn gate_driver_fault_with_bridge_off_is_reported_once() {
    let mut bench = Bench::new();
    bench.at += PERIOD;
    bench.task.period(&healthy(), Some(BridgeFault::GateDriver), bench.at, bench.at + 100);
    assert!(bench.next_report().gate_driver_fault);
    assert!(!bench.next_report().gate_driver_fault);
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn comparator_fault_is_an_overcurrent_until_commanded_off() {
    let mut bench = Bench::new();
    bench.task.apply_commands(drive(1.0));
    bench.at += PERIOD;
    let bridge =
        bench.task.period(&healthy(), Some(BridgeFault::Overcurrent), bench.at, bench.at + 100);
    assert_eq!(bridge, Bridge::Off);
    assert!(!bench.is_driving());
    for _ in 0..2 {
        let report = bench.next_report();
        assert!(report.loop_flags.contains(LoopFlags::OVERCURRENT));
        assert!(!report.gate_driver_fault && !report.system_break);
    }
    bench.task.apply_commands(LoopCommands { bridge: false, ..drive(1.0) });
    bench.task.apply_commands(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn set_point_without_new_commands_goes_stale() {
    let mut bench = Bench::new();
    bench.task.apply_commands(LoopCommands { compensation: false, ..drive(2.0) });
    bench.run();
    bench.next_report();
    let fresh = bench.next_report();
    assert_eq!(fresh.current_reference_a, 2.0);
    // The default timeout is 0.1 s, or 2000 periods.
    for _ in 0..2010 {
        bench.run();
    }
    bench.next_report();
    let stale = bench.next_report();
    assert!(stale.loop_flags.contains(LoopFlags::SETPOINT_STALE));
    assert_eq!(stale.current_reference_a, 0.0);
}

#[test]
fn covariate_of_any_quantity_ages_in_the_loop_and_missing_ones_stay_missing() {
    for &quantity in Covariates::QUANTITIES {
        let mut bench = Bench::new();
        let mut commands = drive(1.0);
        *commands.covariates.get_mut(quantity).unwrap() = Reading::fresh(1.0);
        bench.task.apply_commands(commands);
        for _ in 0..100 {
            bench.run();
        }
        for &other in Covariates::QUANTITIES {
            let age_s = bench.task.commands.covariates.get_mut(other).unwrap().age_s;
            let expected_s = if other == quantity { 100.0 * PERIOD_S } else { -1.0 };
            assert!((age_s - expected_s).abs() < 1e-6, "{other:?}: {age_s} s");
        }
    }
}

#[test]
fn set_point_that_was_never_received_stays_missing() {
    let mut bench = Bench::new();
    for _ in 0..100 {
        bench.run();
    }
    assert_eq!(bench.task.commands.setpoint.age_s, -1.0);
}

#[test]
fn late_start_skips_the_compensation_of_that_period() {
    let mut bench = Bench::new();
    bench.task.apply_commands(drive(1.0));
    bench.next_report();
    bench.next_report();
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::COMPENSATION_OFF));
    bench.run_taking(PERIOD / 2 + 1, PERIOD / 2 + 2000);
    let report = bench.next_report();
    assert!(report.loop_flags.contains(LoopFlags::COMPENSATION_OFF));
    assert_eq!(report.overruns_in_a_row, 0);
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::COMPENSATION_OFF));
}

#[test]
fn overruns_are_reported_once_and_the_bridge_stays_on() {
    let mut bench = Bench::new();
    bench.task.apply_commands(drive(1.0));
    for _ in 0..2 {
        assert_ne!(bench.run_taking(200, PERIOD), Bridge::Off);
    }
    assert_eq!(bench.next_report().overruns_in_a_row, 2);
    assert_eq!(bench.next_report().overruns_in_a_row, 0);
}

#[test]
fn report_that_was_not_sent_is_repeated() {
    let mut bench = Bench::new();
    bench.sample.bus_v = f32::NAN;
    bench.run();
    bench.sample = healthy();
    for _ in 0..100 {
        bench.run();
    }
    assert!(bench.task.report().unwrap().loop_flags.contains(LoopFlags::BUS_INVALID));
    assert!(bench.next_report().loop_flags.contains(LoopFlags::BUS_INVALID));
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::BUS_INVALID));
}

#[test]
fn report_comes_every_millisecond_with_the_measured_values() {
    let mut bench = Bench::new();
    bench.sample.currents_a = [1.0, 2.0, 9.0];
    let before = bench.at;
    let report = bench.next_report();
    assert_eq!((bench.at - before) / PERIOD, 20);
    // The board has no third shunt: its bit is off.
    assert_eq!(report.phase_currents_a, Some([1.0, 2.0, -3.0]));
    assert_eq!(report.bus_voltage_v, Some(48.0));
    assert_eq!(report.sample_age_us, Some(0));
    assert!(report.position_rad.is_nan() && report.residual_torque_nm.is_nan());
    bench.sample.valid = ValidChannels::empty();
    let report = bench.next_report();
    assert!(report.bus_voltage_v.unwrap().is_nan());
    assert!(report.phase_currents_a.unwrap().iter().all(|current| current.is_nan()));
}

#[test]
fn current_share_limits_the_sum_also_after_a_swap() {
    let mut bench = Bench::new();
    bench.task.apply_commands(LoopCommands { current_share: 0.25, ..drive(20.0) });
    bench.run();
    let report = bench.next_report();
    assert_eq!(report.current_reference_a, 6.5);
    assert!(report.loop_flags.contains(LoopFlags::CURRENT_LIMITED));
    bench.task.swap(&parts());
    bench.run();
    assert_eq!(bench.next_report().current_reference_a, 6.5);
    bench.task.apply_commands(LoopCommands { current_share: f32::NAN, ..drive(20.0) });
    bench.run();
    assert_eq!(bench.next_report().current_reference_a, 0.0);
}

#[test]
fn parts_to_measure_only_never_drive_and_report_no_internal_error() {
    let mut bench = Bench::new();
    bench.task.swap(&LoopParts { may_drive: false, ..parts() });
    bench.task.apply_commands(drive(1.0));
    assert!(!bench.is_driving());
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::NOT_FINITE));
    bench.task.swap(&parts());
    assert!(bench.is_driving());
}

#[test]
fn home_position_is_applied_once_per_number() {
    let mut bench = Bench::new();
    assert!(bench.next_report().position_rad.is_nan(), "whole turns are not known");
    let home = |number| LoopCommands {
        home: Home { position_rad: -0.5, number },
        ..LoopCommands::default()
    };
    bench.task.apply_commands(home(1));
    assert!((bench.next_report().position_rad + 0.5).abs() < 1e-4);
    // After a tenth of a motor turn: the same number has no effect, a new one does.
    let turned = 0x1_0000_0000u64 / 10;
    for _ in 0..1000 {
        bench.sample.encoder = bench.sample.encoder.wrapping_add((turned / 1000) as u32);
        bench.task.apply_commands(home(1));
        bench.run();
    }
    bench.task.clear_report();
    let moved_rad = bench.next_report().position_rad;
    assert!((moved_rad + 0.5).abs() > 1e-3, "{moved_rad}");
    bench.task.apply_commands(home(2));
    assert!((bench.next_report().position_rad + 0.5).abs() < 1e-4);
}

/// A stage with a healthy sample and nothing behind its outputs.
struct StageStub;

impl PowerStage for StageStub {
    fn sample(&mut self) -> StageSample {
        healthy()
    }
    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        None
    }
    fn set_awake(&mut self, _awake: bool) {}
    fn drive(&mut self, _duty: [f32; 3]) {}
    fn off(&mut self) {}
    fn cycles(&self) -> u32 {
        0
    }
}

#[test]
fn interrupt_takes_parts_or_commands_or_gives_a_report_in_one_period() {
    let mut queues = LoopQueues::new();
    let (mut port, mut link) = queues.split(StageTraits::NONE, 0);
    let mut task = LoopTask::new(parts(), DeadlineLimits::for_period(PERIOD, 10));
    let reports = |link: &mut crate::loop_link::LoopLink| {
        let mut count = 0;
        link.reports(0, |report| count += u32::from(report.sample_age_us == Some(0)));
        count
    };
    for _ in 0..task.report_every - 1 {
        task.interrupt(&mut StageStub, &mut port, 0, 0);
    }
    // Another set comes with commands, and a report is due: one after the other, the set and the commands in two steps
    // each and the report in three.
    let set = ParameterSet::default();
    let mut covariates = Covariates::MISSING;
    covariates.load_torque_nm = Reading { value: 7.0, age_s: 0.0 };
    let commands = LoopCommands { set_number: 1, covariates, ..drive(1.0) };
    link.send(&LoopOutput { commands, gains: None }, &set);
    let mut taken = Vec::new();
    for _ in 0..7 {
        task.interrupt(&mut StageStub, &mut port, 0, 0);
        let has_parts = port.parts.ready();
        taken.push((has_parts, task.commands.set_number, task.report_step));
    }
    let steps = [
        (true, 0, ReportStep::Collect),
        (false, 0, ReportStep::Collect),
        (false, 0, ReportStep::Collect),
        (false, 1, ReportStep::Collect),
        (false, 1, ReportStep::SendValues),
        (false, 1, ReportStep::SendStatus),
        (false, 1, ReportStep::Collect),
    ];
    assert_eq!(taken, steps);
    assert_eq!(reports(&mut link), 1);
    assert_eq!(task.commands.covariates.load_torque_nm.value, 7.0);
    assert_eq!(task.commands.setpoint.current_a, 1.0);
}

#[test]
fn scope_signal_of_the_gain_follows_the_loop_and_is_one_after_a_swap() {
    let mut queues = LoopQueues::new();
    let (mut port, mut link) = queues.split(StageTraits::NONE, 0);
    let mut task = LoopTask::new(parts(), DeadlineLimits::for_period(PERIOD, 10));
    let number = Signal::from_name("level_gain").expect("a signal").number();
    let mut recorded = |port: &mut LoopPort<'_>| {
        for _ in 0..2 * task.report_every {
            task.interrupt(&mut StageStub, port, 0, 0);
        }
        signal::value(number, &task.values)
    };
    assert_eq!(recorded(&mut port), 1.0);
    let learnt = Gains { level: 1.25, ..Gains::default() };
    let gains = Some(NumberedGains { number: 1, gains: learnt });
    link.send(&LoopOutput { commands: drive(1.0), gains }, &ParameterSet::default());
    assert_eq!(recorded(&mut port), 1.25);
    let commands = LoopCommands { set_number: 1, ..drive(1.0) };
    link.send(&LoopOutput { commands, gains }, &ParameterSet::default());
    assert_eq!(recorded(&mut port), 1.0, "gains belong to the set that they were learnt with");
}

#[test]
fn report_of_a_motor_measurement_has_its_result() {
    let mut queues = LoopQueues::new();
    let (mut port, mut link) = queues.split(StageTraits::NONE, 0);
    let mut task = LoopTask::new(parts(), DeadlineLimits::for_period(PERIOD, 10));
    let probe = ProbeCommand {
        run: 3,
        along_v: 0.0,
        square_v: [0.0; 2],
        turn_per_period: 0,
        dead_v: 0.0,
        dead_a: 1.0,
        trip_a: 1.0,
    };
    for _ in 0..2 * BLOCK_PERIODS {
        task.probe.step(&probe, 0, Default::default(), 48.0);
    }
    assert_eq!(task.probe_report().run, 3);
    for probe in [Some(probe), None] {
        task.apply_commands(LoopCommands { probe, ..drive(0.0) });
        task.clear_report();
        for _ in 0..task.report_every + 3 {
            task.interrupt(&mut StageStub, &mut port, 0, 0);
        }
        let mut received = None;
        link.reports(0, |report| received = Some(report.probe));
        let is_measured = probe.is_some();
        let expected = if is_measured { task.probe_report() } else { ProbeReport::default() };
        assert_eq!(received, Some(expected));
    }
}
