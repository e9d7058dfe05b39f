//! Scenario 15: a stalled motor in cold water.

use super::rig::{Joint, set};
use super::table::{ScenarioRow, check, row};
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| [stall(26.0), stall(13.0)].concat());
    &ROWS
}

/// Five minutes against a stop in water of 4 deg C; the thermistor is on the stator.
fn stall(current_a: f64) -> Vec<ScenarioRow> {
    let name = format!("{current_a} A against a stop for 300 s in water of 4 degC");
    let mut joint = Joint::with(set(0.0));
    joint.constants.water_temperature_c = 4.0;
    // The comparators would limit the simulation to steps of a microsecond; other scenarios show that the current is below them.
    joint.comparators = false;
    let (copper, shown, share) = joint.run_plant(
        |plant| {
            plant.heat_winding();
        },
        |master| {
            master.arm().expect("it arms");
            // Moves to the stop first: the driver would stop a joint that has never moved as miswired.
            master.current(100, 6.0);
            master.rig.plant_mut().hold(true);
            let (mut copper, mut shown, mut share) = (0.0f64, 0.0f64, 1.0f32);
            for _ in 0..300_000 {
                let winding = *master.rig.plant().winding().expect("a winding that heats up");
                copper = copper.max(winding.winding_c);
                shown = shown.max(winding.stator_c);
                master.rig.board_state_mut().motor_temperature_c = Some(winding.stator_c as f32);
                master.current(1, current_a);
                share = share.min(master.current_share());
            }
            assert!(master.rig.is_armed(), "{:?}", master.faults());
            (copper, shown, f64::from(share))
        },
    );
    // Limit of insulation class F: 155 deg C.
    vec![
        row(15, &name, "hottest copper, degC", copper, 4.0..=155.0),
        row(15, &name, "thermistor at that time, degC", shown, 4.0..=100.0),
        row(15, &name, "share of the current the driver leaves", share, 0.5..=1.0),
    ]
}

#[test]
fn stalled_winding_stays_within_its_temperature_class() {
    check(rows());
}
