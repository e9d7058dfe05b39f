//! Tests of an encoder that repeats its angle with valid frames.

use super::no_compensation::NoCompensation;
use super::plant::Machine;
use super::rig::{PERIOD_S, Rig, cycles, no_compensation, parameters};
use firmware::control::velocity_loop::{VelocityGains, VelocityLoop};
use firmware::control::{Bridge, LoopFlags};

/// Returns a joint that turns at this velocity under a velocity loop, and the loop.
fn spinning(velocity_rad_s: f32) -> (Rig<NoCompensation>, VelocityLoop, VelocityGains) {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    let gains = VelocityGains::build(&parameters(), 1.0, 1e-3);
    let mut control = VelocityLoop::begin(0.0);
    let mut seen_rad_s = 0.0;
    for _ in 0..1000 {
        let command = control.step(&gains, velocity_rad_s, seen_rad_s, 26.0, 0.0);
        rig.setpoint.current_a = command.current_a;
        seen_rad_s = rig.run(cycles(1e-3)).velocity_rad_s;
    }
    let velocity = rig.stage.plant.velocity();
    assert!((velocity - f64::from(velocity_rad_s)).abs() < 0.1, "{velocity} rad/s");
    (rig, control, gains)
}

#[test]
fn bridge_opens_within_2_ms_after_the_encoder_freezes_at_speed() {
    for velocity_rad_s in [1.0f32, 3.0, -3.0, 8.0] {
        let (mut rig, mut control, gains) = spinning(velocity_rad_s);
        rig.stage.frozen_encoder = Some(rig.stage.measure().encoder);
        let from = rig.stage.plant.position();
        let (mut open_s, mut largest_a, mut seen_rad_s) = (None, 0.0f64, velocity_rad_s);
        for k in 0..cycles(1.0) {
            if k % cycles(1e-3) == 0 {
                let command = control.step(&gains, velocity_rad_s, seen_rad_s, 26.0, 0.0);
                rig.setpoint.current_a = command.current_a;
            }
            let cycle = rig.cycle();
            seen_rad_s = cycle.velocity_rad_s;
            let [d, q] = rig.stage.plant.current();
            largest_a = largest_a.max(d.hypot(q));
            if cycle.bridge == Bridge::Off && open_s.is_none() {
                assert!(cycle.flags.contains(LoopFlags::ENCODER_LOST), "{:?}", cycle.flags);
                open_s = Some(k as f32 * PERIOD_S);
                // The interrupt holds a tripped bridge open.
                rig.control.set_driving(false);
            }
        }
        let open_s = open_s.expect("the bridge opens");
        let turned_rad = (rig.stage.plant.position() - from).abs();
        println!(
            "frozen at {velocity_rad_s} rad/s: open after {:.2} ms, {largest_a:.1} A, {turned_rad:.3} rad to rest",
            1e3 * open_s
        );
        assert!(open_s < 2e-3, "{open_s} s");
        assert!(largest_a < 20.0, "{largest_a} A");
    }
}

/// The encoder of this rig has no noise, so it repeats its angle whenever the joint stands.
#[test]
fn bridge_stays_closed_in_reversals_at_full_current_with_an_encoder_without_noise() {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    for k in 0..cycles(3.0) {
        let t = k as f32 * PERIOD_S;
        // Reversals from 10 Hz to 70 Hz, and half of the time at rest.
        let phase = (t * (10.0 + 20.0 * t)).fract();
        let swing_a = if phase < 0.5 { 26.0 } else { -26.0 };
        rig.setpoint.current_a = if t.fract() < 0.5 { swing_a } else { 0.0 };
        let cycle = rig.cycle();
        assert!(cycle.bridge != Bridge::Off, "{t} s: {:?}", cycle.flags);
    }
}
