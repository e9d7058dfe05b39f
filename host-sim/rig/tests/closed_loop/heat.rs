//! Scenario 15: a stalled motor in cold water.

use super::rig::{Joint, compute_in_parallel, set};
use super::table::{ScenarioRow, check, row};
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        compute_in_parallel(&[26.0, 13.0], |current_a| stall(*current_a)).concat()
    });
    &ROWS
}

/// Time of the stall, s, of which the first second is that of the rise.
const STALL_S: usize = 300;

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
            let (mut copper, mut shown, mut share) = (0.0f64, 0.0f64, f64::INFINITY);
            for second in 0..STALL_S {
                let mut sum_a = 0.0;
                for _ in 0..1000 {
                    let winding = master.rig.plant().winding.expect("a winding that heats up");
                    copper = copper.max(winding.winding_c);
                    shown = shown.max(winding.stator_c);
                    let stator_c = winding.stator_c as f32;
                    master.rig.board_state_mut().motor_temperature_c = Some(stator_c);
                    master.current(1, current_a);
                    sum_a += f64::from(master.rig.master_view().current_a);
                }
                if second > 0 {
                    share = share.min(1e-3 * sum_a / current_a);
                }
            }
            assert!(master.rig.is_armed(), "{:?}", master.faults());
            (copper, shown, share)
        },
    );
    // Limit of insulation class F: 155 deg C.
    vec![
        row(15, &name, "hottest copper, degC", copper, 4.0..=155.0),
        row(15, &name, "thermistor at that time, degC", shown, 4.0..=100.0),
        row(15, &name, "share of the current the driver leaves", share, 0.5..=1.02),
    ]
}

#[test]
fn stalled_winding_stays_within_its_temperature_class() {
    check(rows());
}
