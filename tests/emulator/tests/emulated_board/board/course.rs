//! A course in closed loop that every fault of the image's wiring to its registers must spoil: the mutations of
//! `tests/emulator/run` run it.

use crate::common::image;
use compensator_core::LawKind;
use emulated_board::{BoardDriver, EmulatorError};
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::reference_joint::configuration;
use joint_rig::{InterruptTiming, JointRig, PowerUp, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::f64::consts::TAU;

/// The driver's set, with the plant's inertia.
pub fn set() -> ParameterSet {
    ParameterSet {
        friction: configuration(LawKind::ImprovedLugre, &[]),
        motor: MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() },
        ..ParameterSet::default()
    }
}

/// Starts the image with this set on the reference joint.
pub fn rig(set: &ParameterSet) -> Result<JointRig, EmulatorError> {
    let start = PowerUp { set: Some(set), commissioned: true, board: true, ..PowerUp::default() };
    let faults = RigFaults::default();
    let mut plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
    plant.watch_overcurrent();
    let stage = stage_at_power_up(&start, plant, &faults);
    let driver = BoardDriver::start(image(), &start, stage)?;
    Ok(JointRig::new(Box::new(driver), faults))
}

/// Lets a master without the driver's velocity loop, at 1.5 A per rad/s, follow a sine of velocity. Returns the RMS error of
/// the velocity, rad/s, and the largest current, A.
pub fn follow_sine(mut rig: JointRig) -> (f64, f64) {
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    rig.stage_mut().take_extremes();
    let (mut sum, mut integral_a) = (0.0, 0.0);
    for k in 0..1500 {
        let (sine, cosine) = (TAU * f64::from(k) * 1e-3).sin_cos();
        let error = 2.0 * sine - f64::from(rig.master_view().velocity_rad_s);
        let wanted = 0.12 * 2.0 * TAU * cosine + 1.5 * error + integral_a;
        integral_a += 1.5e-3 * error;
        rig.step_with_command(wanted as f32, (2.0 * sine) as f32);
        if k >= 500 {
            sum += (rig.plant().velocity_rad_s() - 2.0 * sine).powi(2);
        }
    }
    let rms = (sum / 1000.0f64).sqrt();
    let most = rig.stage_mut().take_extremes();
    assert!(!rig.is_reset(), "the watchdog resets the chip");
    assert!(rig.is_armed(), "stopped: {:?}", rig.latched_faults());
    let limits: Vec<_> = rig.active_limits().iter().map(|code| code.info().name).collect();
    assert!(!limits.contains(&"loop-late"), "{limits:?}");
    (rms, most.current_a)
}

#[test]
fn joint_with_image_follows_sine_of_velocity() {
    let (rms_rad_s, most_a) = follow_sine(rig(&set()).expect("the image starts"));
    println!("measured: RMS velocity error {rms_rad_s:.3} rad/s, {most_a:.2} A at most");
    assert!(rms_rad_s < 0.5, "{rms_rad_s}");
    assert!((1.0..8.0).contains(&most_a), "{most_a}");
}

#[test]
fn joint_with_hanging_loop_is_stopped_at_level_of_its_comparators() {
    let mut set = set();
    set.motor.overcurrent_a = 20.0;
    set.motor.current_limit_a = 15.0;
    let mut rig = rig(&set).expect("the image starts");
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    for _ in 0..400 {
        let error = 6.0 - f64::from(rig.master_view().velocity_rad_s);
        rig.step_with_command((4.0 * error).clamp(-15.0, 15.0) as f32, 6.0);
    }
    assert!(rig.is_armed() && rig.plant().velocity_rad_s() > 4.0, "{:?}", rig.latched_faults());
    rig.stage_mut().take_extremes();
    // The timer keeps its last duties while the rotor turns. The watchdog would act after 50 ms.
    rig.stage_mut().interrupts.extend([InterruptTiming::Missed; 30 * 20]);
    (0..30).for_each(|_| rig.step_idle());
    assert!(rig.stage_mut().applied_duty().is_none() && !rig.is_reset(), "it is not stopped");
    let most = rig.stage_mut().take_extremes().current_a;
    println!("measured: {most:.1} A where the comparators open the bridge");
    // 5 % and 2 A above `overcurrent_a`, 2 A of tolerance, and the rise within the period until they act.
    assert!((23.0..30.0).contains(&most), "{most} A");
}
