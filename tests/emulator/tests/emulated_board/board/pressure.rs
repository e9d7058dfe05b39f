//! The board's own pressure sensor: the image reads it over I2C, and its friction model follows the water.

use super::course::set;
use crate::common::image;
use emulated_board::BoardDriver;
use joint_rig::{JointRig, PowerUp, RigFaults, SealSensorFault, stage_at_power_up};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};

/// Pressure differences at the seal, Pa.
const PRESSURES_PA: [f64; 2] = [3e4, 3e5];

/// Returns the model's friction at 1 rad/s with low and with high pressure, Nm. No sensor on the bus reports it.
fn friction_nm(has_sensor: bool) -> [f64; 2] {
    let mut set = set();
    set.friction.model.envelope.pressure_diff_max_pa = 4e5;
    let start = PowerUp { set: Some(&set), commissioned: true, board: true, ..PowerUp::default() };
    let faults = RigFaults::seal_sensor(SealSensorFault::Absent);
    let plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
    let stage = stage_at_power_up(&start, plant, &faults);
    let mut driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
    if has_sensor {
        driver.connect_pressure_sensor();
    }
    let mut rig = JointRig::new(Box::new(driver), faults);
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    PRESSURES_PA.map(|pressure_pa| {
        rig.plant_mut().around.pressure_diff_pa = pressure_pa;
        let mut sum = 0.0;
        for k in 0..600 {
            let error = 1.0 - f64::from(rig.master_view().velocity_rad_s);
            rig.step_with_command((1.0 + 2.0 * error) as f32, 1.0);
            sum += if k < 500 { 0.0 } else { f64::from(rig.master_view().friction_torque_nm) };
        }
        assert!(rig.is_armed(), "{:?}", rig.latched_faults());
        sum / 100.0
    })
}

#[test]
fn friction_with_pressure_sensor_follows_pressure_of_water() {
    let [low, high] = friction_nm(true);
    let [without_low, without_high] = friction_nm(false);
    println!(
        "measured: {low:.2} to {high:.2} Nm, without sensor {without_low:.2} to {without_high:.2} Nm"
    );
    // 2.4e-6 Nm/Pa over 2.7e5 Pa.
    assert!((0.5..0.8).contains(&(high - low)), "{low} to {high} Nm");
    assert!((without_high - without_low).abs() < 0.2, "{without_low} to {without_high} Nm");
}
