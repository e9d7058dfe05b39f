//! Cycles of the compact image's interrupt on the B-G431B-ESC1, in closed loop.
//!
//! The interrupt executes from flash. The costs are those without a wait state, those with the simulated caches, and those
//! without any cache and prefetch, which no chip exceeds. A run writes them to `target/figures/interrupt-cycles-esc1.tsv`.

use crate::common::{compact_image, write_figures};
use crate::scenarios::compact::{ABZ, HALL, joint, power_up, turn_by_hand};
use compensator_core::LawKind;
use emulated_board::BoardDriver;
use emulated_board::costs::Costs;
use emulated_board::cycles::FlashAccess;
use firmware::reference_joint::configuration;
use firmware::supervisor::Code;
use joint_rig::{JointRig, PERIOD_CYCLES, RigFaults, SealSensorFault, stage_at_power_up};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Encoders, and faults of the sensors of side load and pressure, which the compensator guards against.
const CASES: [(&str, f32, SealSensorFault); 4] = [
    ("ABZ", ABZ, SealSensorFault::None),
    ("Hall sensors", HALL, SealSensorFault::None),
    ("ABZ, half of the load and pressure frames lost", ABZ, SealSensorFault::Dropped),
    ("ABZ, without load and pressure", ABZ, SealSensorFault::Absent),
];

/// Largest share of the period that the interrupt may take with the caches, and without: a seventh more than it takes.
const MOST_SHARES: [f64; 2] = [0.56, 0.9];

/// Cycles after the trigger of the currents from which `loop-late` is reported.
const LATE_CYCLES: u64 = 7650;

/// Least share of the period, by the lower estimate: a loop that measures, compensates and drives takes more.
const LEAST_SHARE: f64 = 0.2;

/// Access to the flash at 170 MHz without caches and prefetch.
const NO_CACHES: FlashAccess =
    FlashAccess { wait_states: 4, prefetch: false, code_cache: false, data_cache: false };

const HEAD: &str = "# Worst period\n\
case\tinstructions\tno wait states\tcaches\tno caches\t% of the period, caches\t% of the period, no caches\n";

/// Runs a course with an encoder of this kind, this fault, and this access to the flash; returns the costs.
fn measure(kind: f32, fault: SealSensorFault, access: Option<FlashAccess>) -> Costs {
    let mut joint = joint(kind, 0.9);
    joint.faults = RigFaults::seal_sensor(fault);
    let set = joint.set.as_mut().expect("a set of this joint");
    // A law with the levels over load, pressure, temperature and angle; the voltage of the dead time is compensated.
    set.friction = configuration(LawKind::ImprovedLugre, &[]);
    set.motor.dead_time_s = 0.5e-6;
    let start = power_up(&joint);
    let stage = stage_at_power_up(&start, joint.plant(), &joint.faults);
    let mut driver = BoardDriver::start_compact(compact_image(), &start, stage).expect("it starts");
    if let Some(access) = access {
        driver.machine_mut().chip_mut().flash_access = access;
    }
    let costs = driver.record_costs();
    let mut rig = JointRig::new(Box::new(driver), joint.faults);
    turn_by_hand(&mut rig);
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    let mut integral_a = 0.0;
    for k in 0..500 {
        let (sine, cosine) = (TAU * 2.0 * f64::from(k) * 1e-3).sin_cos();
        let error = 2.0 * sine - f64::from(rig.master_view().velocity_rad_s);
        integral_a += 1.5e-3 * error;
        let wanted = 0.12 * 4.0 * TAU * cosine + 1.5 * error + integral_a;
        rig.step_with_command(wanted as f32, (2.0 * sine) as f32);
    }
    assert!(rig.is_armed(), "{:?}", rig.latched_faults());
    let limits = rig.active_limits();
    assert!(!limits.contains(Code::LoopLate), "{limits:?}");
    drop(rig);
    costs.take()
}

fn share(cycles: u32) -> f64 {
    f64::from(cycles) / f64::from(PERIOD_CYCLES)
}

fn emit(rows: &[(&str, [Costs; 2])]) -> String {
    let mut text = HEAD.to_owned();
    for (name, [cached, uncached]) in rows {
        let [lower, upper, most] = [cached.worst.lower, cached.worst.upper, uncached.worst.upper];
        let _ = writeln!(
            text,
            "{name}\t{}\t{lower}\t{upper}\t{most}\t{:.0}\t{:.0}",
            cached.instructions,
            100.0 * share(upper),
            100.0 * share(most),
        );
    }
    text
}

#[test]
fn compact_interrupt_from_flash_stays_within_its_period() {
    let rows = CASES.map(|(name, kind, fault)| {
        (name, [None, Some(NO_CACHES)].map(|access| measure(kind, fault, access)))
    });
    let written = emit(&rows);
    print!("{written}");
    for (name, both) in &rows {
        for (costs, limit) in both.iter().zip(MOST_SHARES) {
            let (least, upper) = (share(costs.worst.lower), share(costs.worst.upper));
            assert!(upper <= limit, "{name}: {upper:.3} of a period");
            assert!(costs.latest_end < LATE_CYCLES, "{name}: ends after {}", costs.latest_end);
            assert!(
                costs.runs > 10_000 && least > LEAST_SHARE,
                "{name}: {} runs, {least:.3}",
                costs.runs
            );
        }
    }
    write_figures("interrupt-cycles-esc1.tsv", &written);
}
