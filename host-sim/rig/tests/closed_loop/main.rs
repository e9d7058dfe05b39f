//! The shipped driver in closed loop with a joint under faults.
//!
//! Driver, background loop, queues and interrupt are the firmware's own. Shunts in counts and an encoder over SPI go through
//! its sensor code. The joint is `simulated-machines::joint_plant`. Commands are CAN frames, and time is virtual.
//!
//! Every result has two limits, set from the capabilities of the parts and not from earlier results. They stand at the row in
//! its family's file; a run writes its results to `target/figures/closed-loop.tsv`.

mod adaptation;
mod brake_test;
mod bus;
pub(crate) mod commissioning;
mod compact;
mod current_loop;
mod dead_time;
mod drawn_drive;
mod driver;
mod encoder;
mod encoder_fault_cases;
mod encoder_faults;
mod encoder_kinds;
mod feed_forward;
mod friction;
mod heat;
mod holding_brake;
mod joint_encoder;
mod modes;
mod position;
mod power_up;
pub mod rig;
mod self_drive;
mod stalls;
mod stops;
mod table;
mod touch_probe;
mod trials;
mod velocity;
mod wiring;

use table::{LIBRARY_FILE, ScenarioRow};

/// Results of every family, computed once.
fn families() -> [&'static [ScenarioRow]; 25] {
    [
        power_up::rows(),
        wiring::rows(),
        commissioning::rows(),
        bus::rows(),
        encoder::rows(),
        stalls::rows(),
        friction::rows(),
        heat::rows(),
        velocity::rows(),
        stops::rows(),
        holding_brake::rows(),
        position::rows(),
        trials::rows(),
        adaptation::rows(),
        feed_forward::rows(),
        modes::rows(),
        touch_probe::rows(),
        encoder_kinds::rows(),
        encoder_faults::rows(),
        dead_time::rows(),
        current_loop::rows(),
        brake_test::rows(),
        compact::rows(),
        joint_encoder::rows(),
        self_drive::rows(),
    ]
}

#[test]
fn results_of_every_scenario_are_written() {
    let written = table::write(LIBRARY_FILE, families().into_iter().flatten());
    assert_eq!(written, table::scenarios());
}
