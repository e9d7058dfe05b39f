//! Tests of the reaction when the bridge stops while the motor turns: coasting, or shorted low sides.

use super::driver::Joint;
use super::plant::Machine;
use firmware::control::{BridgeFault, MotorParameters, StageSample, ValidChannels};
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Code;

const CSV: u8 = 9;
const QUICK_STOP: u16 = 0x0B;

/// Returns a joint that turns at this velocity in CSV, with this reaction to a stop.
fn spinning(brake_at_stop: f32, velocity_rad_s: f64) -> Joint {
    let set = ParameterSet {
        motor: MotorParameters { brake_at_stop, ..MotorParameters::default() },
        ..ParameterSet::default()
    };
    let mut joint = Joint::with(Machine::default(), &set);
    joint.enable_mode(CSV);
    (0..600).for_each(|_| joint.drive_velocity(0x0F, velocity_rad_s));
    let found = joint.stage.plant.velocity();
    assert!((found - velocity_rad_s).abs() < 0.3, "{found} rad/s");
    joint
}

/// What happened after a stop.
#[derive(Clone, Copy, Debug, Default)]
struct Stop {
    turned_rad: f64,
    largest_a: f64,
    shorted_ms: usize,
    end_rad_s: f64,
}

/// Runs a time after a stop without the master, ms.
fn watch(joint: &mut Joint, milliseconds: usize) -> Stop {
    let from = joint.stage.plant.position();
    let mut stop = Stop::default();
    for _ in 0..milliseconds {
        joint.run_ms(1);
        let [d, q] = joint.stage.plant.current();
        stop.largest_a = stop.largest_a.max(d.hypot(q));
        stop.shorted_ms += usize::from(joint.stage.is_shorted());
        assert!(!joint.stage.is_on(), "the bridge drives");
    }
    stop.turned_rad = joint.stage.plant.position() - from;
    stop.end_rad_s = joint.stage.plant.velocity();
    stop
}

#[test]
fn shorted_low_sides_stop_a_joint_sooner_than_coasting() {
    for velocity_rad_s in [3.0, 8.0] {
        let [coast, short] = [0.0, 1.0].map(|brake_at_stop| {
            let mut joint = spinning(brake_at_stop, velocity_rad_s);
            joint.drive_velocity(QUICK_STOP, velocity_rad_s);
            let stop = watch(&mut joint, 3000);
            let supervisor = joint.background.node().joint.supervisor();
            assert!(supervisor.faults().is_empty(), "{:?}", supervisor.faults());
            assert!(!joint.stage.is_shorted(), "the brake ends at rest");
            stop
        });
        println!("{velocity_rad_s} rad/s: coasts {coast:.3?}, shorted {short:.3?}");
        assert_eq!(coast.shorted_ms, 0);
        assert!(short.turned_rad < 0.4 * coast.turned_rad, "{short:?}, {coast:?}");
        assert!(short.largest_a < 26.0 && short.shorted_ms > 100, "{short:?}");
    }
}

#[test]
fn load_on_a_stopped_joint_sinks_slowly_with_shorted_low_sides_and_falls_without() {
    let [coast, short] = [0.0, 1.0].map(|brake_at_stop| {
        let mut joint = spinning(brake_at_stop, 1.0);
        for step in 0..200 {
            joint.stage.plant.load = 8.0 * f64::from(step) / 200.0;
            joint.drive_velocity(0x0F, 0.0);
        }
        joint.drive_velocity(QUICK_STOP, 0.0);
        watch(&mut joint, 1000)
    });
    println!("a load of 8 Nm after a stop: open {coast:.2?}, shorted {short:.2?}");
    assert!(coast.end_rad_s < -15.0, "{coast:?}");
    assert!((-2.5..-0.5).contains(&short.end_rad_s) && short.shorted_ms > 990, "{short:?}");
}

#[test]
fn brake_after_a_frozen_encoder_or_a_lost_master_needs_no_encoder() {
    let mut joint = spinning(1.0, 3.0);
    let frozen = joint.stage.measure().encoder;
    joint.stage.frozen_encoder = Some(frozen);
    let stop = watch_after_trip(&mut joint);
    assert!(joint.has_fault(Code::EncoderLost));
    println!("frozen encoder at 3 rad/s: {stop:.3?}");
    assert!(stop.turned_rad < 0.3 && stop.shorted_ms > 100, "{stop:?}");
    let mut joint = spinning(1.0, 3.0);
    joint.run_ms(105);
    assert!(joint.has_fault(Code::CommandTimeout) && joint.stage.is_shorted());
    assert!(watch(&mut joint, 1000).turned_rad < 0.3);
}

/// Runs until the bridge stops driving, then a second.
fn watch_after_trip(joint: &mut Joint) -> Stop {
    joint.drive_velocity(0x0F, 3.0);
    joint.run_ms(1);
    watch(joint, 1000)
}

#[test]
fn low_sides_are_never_shorted_after_a_fault_of_the_bridge_or_its_shunts() {
    type Fault = (&'static str, fn(&mut Joint));
    let faults: [Fault; 5] = [
        ("gate driver", |joint| {
            (joint.stage.fault, joint.stage.has_latched_fault) =
                (Some(BridgeFault::GateDriver), true);
        }),
        ("comparators", |joint| joint.stage.fault = Some(BridgeFault::Overcurrent)),
        ("chip", |joint| joint.stage.fault = Some(BridgeFault::System)),
        ("shunt", |joint| joint.stage.valid -= ValidChannels::CURRENT_A),
        ("measured overcurrent", |joint| {
            let sample = joint.stage.measure();
            joint.stage.injected_sample =
                Some(StageSample { currents_a: [45.0, -20.0, -25.0], ..sample });
        }),
    ];
    for (name, fault) in faults {
        // While it drives.
        let mut joint = spinning(1.0, 3.0);
        fault(&mut joint);
        for _ in 0..1000 {
            joint.run_ms(1);
            assert!(!joint.stage.is_shorted(), "{name}, while driven");
        }
        // While it brakes.
        let mut joint = spinning(1.0, 8.0);
        joint.drive_velocity(QUICK_STOP, 0.0);
        joint.run_ms(2);
        assert!(joint.stage.is_shorted(), "{name}");
        fault(&mut joint);
        joint.run_ms(1);
        for _ in 0..1000 {
            assert!(!joint.stage.is_shorted(), "{name}, while it brakes");
            joint.run_ms(1);
        }
    }
}

#[test]
fn joint_that_brakes_can_be_armed_again_with_new_offsets() {
    let mut joint = spinning(1.0, 8.0);
    joint.drive_velocity(QUICK_STOP, 0.0);
    joint.run_ms(100);
    assert!(joint.stage.is_shorted());
    joint.stage.shunt_offset_a = [0.3, -0.26, 0.0];
    for word in [0x06, 0x07, 0x0F] {
        joint.drive_velocity(word, 0.0);
    }
    (0..1000).for_each(|_| joint.drive_velocity(0x0F, 0.0));
    assert!(joint.stage.is_on() && joint.background.node().joint.is_armed());
    assert!(joint.stage.plant.velocity().abs() < 0.1, "{}", joint.stage.plant.velocity());
}
