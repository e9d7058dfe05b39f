//! The shipped driver in closed loop with a joint: what becomes of it where something is wrong.
//!
//! Driver, background, queues and interrupt are the firmware's; shunts in counts and an encoder over SPI go through its own
//! sensor code; the joint is `simulated-machines::joint_plant`. Orders are CAN frames, time is virtual. Every figure has a
//! limit on both sides, set from what the parts can do and not from what came out; together they are `docs/closed-loop.md`:
//!
//! ```text
//! UPDATE_TABLES=1 cargo test -p host-sim --test closed_loop
//! ```
//! writes the table; without it a test holds figures and table together.

mod bus;
mod commissioning;
mod encoder;
mod friction;
mod heat;
mod power_up;
mod rig;
mod stalls;
mod table;
mod velocity;
mod wiring;

use table::Row;

/// Every family's figures, computed once.
fn families() -> [&'static [Row]; 9] {
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
    ]
}

#[test]
fn the_table_says_what_comes_out() {
    table::compare(families().into_iter().flatten());
}
