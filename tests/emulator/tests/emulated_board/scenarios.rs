//! The closed-loop scenarios of `host-sim/rig`, with the shipped image on the emulated board as driver.
//!
//! The short form runs fifteen families, `LONG_TESTS=1` all. Of the motors to commission it runs the first ([`driver`]).

#[path = "../../../../host-sim/rig/tests/closed_loop/adaptation.rs"]
mod adaptation;
#[path = "../../../../host-sim/rig/tests/closed_loop/brake_test.rs"]
mod brake_test;
#[path = "../../../../host-sim/rig/tests/closed_loop/bus.rs"]
mod bus;
#[path = "../../../../host-sim/rig/tests/closed_loop/commissioning.rs"]
mod commissioning;
#[path = "../../../../host-sim/rig/tests/closed_loop/compact.rs"]
pub mod compact;
#[path = "../../../../host-sim/rig/tests/closed_loop/current_loop.rs"]
mod current_loop;
#[path = "../../../../host-sim/rig/tests/closed_loop/dead_time.rs"]
mod dead_time;
mod driver;
#[path = "../../../../host-sim/rig/tests/closed_loop/encoder.rs"]
mod encoder;
#[path = "../../../../host-sim/rig/tests/closed_loop/encoder_fault_cases.rs"]
mod encoder_fault_cases;
#[path = "../../../../host-sim/rig/tests/closed_loop/encoder_faults.rs"]
mod encoder_faults;
#[path = "../../../../host-sim/rig/tests/closed_loop/encoder_kinds.rs"]
mod encoder_kinds;
#[path = "../../../../host-sim/rig/tests/closed_loop/feed_forward.rs"]
mod feed_forward;
#[path = "../../../../host-sim/rig/tests/closed_loop/friction.rs"]
mod friction;
#[path = "../../../../host-sim/rig/tests/closed_loop/heat.rs"]
mod heat;
#[path = "../../../../host-sim/rig/tests/closed_loop/holding_brake.rs"]
mod holding_brake;
#[path = "../../../../host-sim/rig/tests/closed_loop/joint_encoder.rs"]
mod joint_encoder;
#[path = "../../../../host-sim/rig/tests/closed_loop/modes.rs"]
mod modes;
#[path = "../../../../host-sim/rig/tests/closed_loop/position.rs"]
mod position;
#[path = "../../../../host-sim/rig/tests/closed_loop/power_up.rs"]
mod power_up;
#[allow(dead_code)] // Parts of it serve the families that are left out.
#[path = "../../../../host-sim/rig/tests/closed_loop/rig.rs"]
pub mod rig;
#[path = "../../../../host-sim/rig/tests/closed_loop/self_drive.rs"]
mod self_drive;
#[path = "../../../../host-sim/rig/tests/closed_loop/stalls.rs"]
mod stalls;
#[path = "../../../../host-sim/rig/tests/closed_loop/stops.rs"]
mod stops;
#[allow(dead_code)] // Parts of it serve the families that are left out.
#[path = "../../../../host-sim/rig/tests/closed_loop/table.rs"]
mod table;
#[path = "../../../../host-sim/rig/tests/closed_loop/touch_probe.rs"]
mod touch_probe;
#[path = "../../../../host-sim/rig/tests/closed_loop/trials.rs"]
mod trials;
#[path = "../../../../host-sim/rig/tests/closed_loop/velocity.rs"]
mod velocity;
#[path = "../../../../host-sim/rig/tests/closed_loop/wiring.rs"]
mod wiring;

use table::{IMAGE_FILE, ScenarioRow};

/// Results of the families of this form.
fn families() -> Vec<&'static [ScenarioRow]> {
    let mut families = vec![power_up::rows(), wiring::rows(), bus::rows()];
    families.extend([stalls::rows(), stops::rows(), holding_brake::rows(), trials::rows()]);
    families.extend([
        feed_forward::rows(),
        modes::rows(),
        encoder_kinds::rows(),
        encoder_faults::rows(),
        dead_time::rows(),
    ]);
    families.extend([current_loop::rows(), brake_test::rows(), touch_probe::rows()]);
    families.push(compact::rows());
    families.push(joint_encoder::rows());
    if std::env::var_os("LONG_TESTS").is_some() {
        families.extend([encoder::rows(), commissioning::rows(), velocity::rows()]);
        families.extend([friction::rows(), heat::rows(), position::rows(), adaptation::rows()]);
        families.push(self_drive::rows());
    }
    families
}

#[test]
fn results_of_the_scenarios_are_written() {
    let written = table::write(IMAGE_FILE, families().into_iter().flatten());
    let is_long = std::env::var_os("LONG_TESTS").is_some();
    assert!(written.len() > 15 && (!is_long || written == table::scenarios()), "{written:?}");
}

#[test]
fn stack_in_all_scenarios_stays_above_guard() {
    families();
    let used = emulated_board::largest_stack_bytes();
    println!("measured: {used} bytes of stack at most");
    assert!(used > 0, "no scenario ran");
}
