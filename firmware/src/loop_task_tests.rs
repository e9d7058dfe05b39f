//! The interrupt's work, without its registers.

use super::*;
use crate::control::PERIOD_S;
use crate::loop_parts::StageTraits;
use crate::parameter_set::ParameterSet;

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
        valid: Valid::CURRENT_A | Valid::CURRENT_B | Valid::BUS | Valid::ENCODER,
    }
}

fn parts() -> Parts {
    Parts::build(&ParameterSet::default(), StageTraits::NONE, PERIOD_S).unwrap()
}

fn drive(current_a: f32) -> LoopOrders {
    let setpoint = Setpoint { current_a, velocity_reference_rad_s: 0.0, age_s: 0.0 };
    LoopOrders { setpoint, bridge: true, compensation: true, ..NO_ORDERS }
}

impl Bench {
    /// A loop whose observer has settled.
    fn new() -> Self {
        let task = LoopTask::new(parts(), Limits::of_period(PERIOD, 10));
        let mut bench = Self { task, at: 0, sample: healthy() };
        for _ in 0..2000 {
            assert_eq!(bench.run(), Bridge::Off);
        }
        bench.task.reported();
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
                self.task.reported();
                return report;
            }
            self.run();
        }
    }
}

#[test]
fn the_bridge_follows_its_orders() {
    let mut bench = Bench::new();
    assert!(!bench.is_driving());
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
    bench.task.order(LoopOrders { bridge: false, ..drive(1.0) });
    assert!(!bench.is_driving());
}

#[test]
fn a_fault_opens_the_bridge_and_only_an_order_off_and_on_closes_it() {
    let mut bench = Bench::new();
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
    bench.sample.currents_a = [45.0, 0.0, 0.0];
    assert!(!bench.is_driving());
    bench.sample = healthy();
    // Orders that were on their way do not close it.
    bench.task.order(drive(1.0));
    assert!((0..100).all(|_| !bench.is_driving()));
    // Every report says why, until it was seen.
    for _ in 0..3 {
        assert!(bench.next_report().loop_flags.contains(LoopFlags::OVERCURRENT));
    }
    bench.task.order(LoopOrders { bridge: false, ..drive(1.0) });
    bench.task.reported();
    assert!(!bench.is_driving());
    assert!(!bench.next_report().loop_flags.contains(LoopFlags::OVERCURRENT));
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn every_fault_trips() {
    for (name, broken) in [
        (
            "currents",
            StageSample { valid: healthy().valid.difference(Valid::CURRENT_A), ..healthy() },
        ),
        ("overvoltage", StageSample { bus_v: 57.0, ..healthy() }),
        ("undervoltage", StageSample { bus_v: 17.0, ..healthy() }),
    ] {
        let mut bench = Bench::new();
        bench.task.order(drive(1.0));
        assert!(bench.is_driving(), "{name}");
        bench.sample = broken;
        assert!(!bench.is_driving(), "{name}");
        bench.sample = healthy();
        assert!(!bench.is_driving(), "{name}");
        assert!(LoopFlags::FAULTS.contains(bench.task.tripped()), "{name}");
    }
}

#[test]
fn a_fault_while_the_bridge_is_off_does_not_trip() {
    let mut bench = Bench::new();
    bench.sample.bus_v = 10.0;
    assert!(!bench.is_driving());
    bench.sample = healthy();
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn a_bridge_the_hardware_opened_is_told_and_held() {
    let mut bench = Bench::new();
    bench.task.order(drive(1.0));
    bench.at += PERIOD;
    let bridge = bench.task.period(&healthy(), Some(Broke::GateDriver), bench.at, bench.at + 100);
    assert_eq!(bridge, Bridge::Off);
    // The hardware has forgotten it by now; the loop has not.
    assert!(!bench.is_driving());
    assert!(bench.next_report().gate_driver_fault);
    assert!(bench.next_report().gate_driver_fault);
    bench.task.order(LoopOrders { bridge: false, ..drive(1.0) });
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
    bench.task.reported();
    assert!(!bench.next_report().gate_driver_fault);
}

#[test]
fn a_gate_driver_that_complains_with_the_bridge_off_is_told() {
    let mut bench = Bench::new();
    bench.at += PERIOD;
    bench.task.period(&healthy(), Some(Broke::GateDriver), bench.at, bench.at + 100);
    assert!(bench.next_report().gate_driver_fault);
    assert!(!bench.next_report().gate_driver_fault);
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn a_bridge_the_comparators_opened_is_an_overcurrent_until_it_is_ordered_off() {
    let mut bench = Bench::new();
    bench.task.order(drive(1.0));
    bench.at += PERIOD;
    let bridge = bench.task.period(&healthy(), Some(Broke::Overcurrent), bench.at, bench.at + 100);
    assert_eq!(bridge, Bridge::Off);
    assert!(!bench.is_driving());
    for _ in 0..2 {
        let report = bench.next_report();
        assert!(report.loop_flags.contains(LoopFlags::OVERCURRENT));
        assert!(!report.gate_driver_fault && !report.system_break);
    }
    bench.task.order(LoopOrders { bridge: false, ..drive(1.0) });
    bench.task.order(drive(1.0));
    assert!(bench.is_driving());
}

#[test]
fn a_set_point_goes_stale_when_no_orders_come() {
    let mut bench = Bench::new();
    bench.task.order(LoopOrders { compensation: false, ..drive(2.0) });
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
fn what_was_never_heard_does_not_age_into_being_heard() {
    let mut bench = Bench::new();
    for _ in 0..100 {
        bench.run();
    }
    assert_eq!(bench.task.orders.setpoint.age_s, -1.0);
    assert_eq!(bench.task.orders.covariates.radial_force_n.age_s, -1.0);
}

#[test]
fn a_late_start_computes_no_compensation_in_that_period() {
    let mut bench = Bench::new();
    bench.task.order(drive(1.0));
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
fn overruns_are_told_once_and_the_bridge_stays_on() {
    let mut bench = Bench::new();
    bench.task.order(drive(1.0));
    for _ in 0..2 {
        assert_ne!(bench.run_taking(200, PERIOD), Bridge::Off);
    }
    assert_eq!(bench.next_report().overruns_in_a_row, 2);
    assert_eq!(bench.next_report().overruns_in_a_row, 0);
}

#[test]
fn a_report_that_found_no_place_is_not_lost() {
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
fn reports_come_once_a_millisecond_and_say_what_was_measured() {
    let mut bench = Bench::new();
    bench.sample.currents_a = [1.0, 2.0, 9.0];
    let before = bench.at;
    let report = bench.next_report();
    assert_eq!((bench.at - before) / PERIOD, 20);
    // The third shunt is not there: its bit is off.
    assert_eq!(report.phase_currents_a, Some([1.0, 2.0, -3.0]));
    assert_eq!(report.bus_voltage_v, Some(48.0));
    assert_eq!(report.sample_age_us, Some(0));
    assert!(report.position_rad.is_nan() && report.residual_torque_nm.is_nan());
    bench.sample.valid = Valid::empty();
    let report = bench.next_report();
    assert!(report.bus_voltage_v.unwrap().is_nan());
    assert!(report.phase_currents_a.unwrap().iter().all(|current| current.is_nan()));
}

#[test]
fn temperature_takes_current_from_the_sum_also_after_a_swap() {
    let mut bench = Bench::new();
    bench.task.order(LoopOrders { current_share: 0.25, ..drive(20.0) });
    bench.run();
    let report = bench.next_report();
    assert_eq!(report.current_reference_a, 6.5);
    assert!(report.loop_flags.contains(LoopFlags::CURRENT_LIMITED));
    bench.task.swap(&parts());
    bench.run();
    assert_eq!(bench.next_report().current_reference_a, 6.5);
    bench.task.order(LoopOrders { current_share: f32::NAN, ..drive(20.0) });
    bench.run();
    assert_eq!(bench.next_report().current_reference_a, 0.0);
}

#[test]
fn parts_that_only_measure_never_drive_and_say_so() {
    let mut bench = Bench::new();
    bench.task.swap(&parts().measuring_only());
    bench.task.order(drive(1.0));
    assert!(!bench.is_driving());
    assert!(bench.next_report().loop_flags.contains(LoopFlags::NOT_FINITE));
    bench.task.swap(&parts());
    assert!(bench.is_driving());
}

#[test]
fn parts_of_a_set_that_cannot_be_built_are_refused_by_name() {
    let mut set = ParameterSet::default();
    set.motor.current_bandwidth_hz = 5000.0;
    assert_eq!(
        Parts::build(&set, StageTraits::NONE, PERIOD_S).unwrap_err().field,
        "current_bandwidth_hz"
    );
}

#[test]
fn a_joint_is_where_it_was_said_to_be_once() {
    let mut bench = Bench::new();
    assert!(bench.next_report().position_rad.is_nan(), "whole turns are not known");
    let home = |number| LoopOrders { home: Home { position_rad: -0.5, number }, ..NO_ORDERS };
    bench.task.order(home(1));
    assert!((bench.next_report().position_rad + 0.5).abs() < 1e-4);
    // A tenth of a motor turn on; the same order again says nothing new, another one does.
    let turned = 0x1_0000_0000u64 / 10;
    for _ in 0..1000 {
        bench.sample.encoder = bench.sample.encoder.wrapping_add((turned / 1000) as u32);
        bench.task.order(home(1));
        bench.run();
    }
    bench.task.reported();
    let moved_rad = bench.next_report().position_rad;
    assert!((moved_rad + 0.5).abs() > 1e-3, "{moved_rad}");
    bench.task.order(home(2));
    assert!((bench.next_report().position_rad + 0.5).abs() < 1e-4);
}

/// Of the STM32G474's stage: 0.5 us of dead time and 1.5 us of settling leave 84 % of the circle, and 52 us of the
/// encoder's age turn a field by what the loop then takes off.
#[test]
fn a_stage_bounds_the_modulation_and_ages_the_encoder() {
    let (dead_s, settle_s) = (0.5e-6, 1.5e-6);
    let most = StageTraits::modulation_for(PERIOD_S, dead_s, settle_s);
    assert!((0.83..0.85).contains(&most), "{most}");
    // At the largest duty the low side conducts just long enough before the top.
    let duty = (1.0 + most) / 2.0;
    let conducts_s = (1.0 - duty) * PERIOD_S / 2.0 - dead_s;
    assert!((conducts_s - settle_s).abs() < 1e-8, "{conducts_s}");

    let stage = StageTraits { encoder_age_s: 52e-6, modulation_max: most };
    let mut set = ParameterSet::default();
    let built = |set: &ParameterSet, stage| Parts::build(set, stage, PERIOD_S).unwrap().motor;
    set.motor.modulation_max = 0.95;
    let mut meant = set.clone();
    meant.motor.modulation_max = most;
    meant.motor.encoder_delay_s = 52e-6;
    assert_eq!(built(&set, stage), built(&meant, StageTraits::NONE));
    // What is asked for below the bound is given; the sensor's own delay comes on top.
    set.motor.modulation_max = 0.5;
    set.motor.encoder_delay_s = 100e-6;
    meant.motor.modulation_max = 0.5;
    meant.motor.encoder_delay_s = 152e-6;
    let (found, expected) = (built(&set, stage), built(&meant, StageTraits::NONE));
    assert_eq!(found, expected);
}
