//! Tests of braking while the bus can take no more energy: 55.3 V of at most 56 V.
//!
//! Sustained, the bus must receive nothing. What the bridge returns is computed from the plant's currents and duties.

use super::driver::Joint;
use super::no_compensation::NoCompensation;
use super::plant::Machine;
use super::rig::{Rig, cycles, no_compensation, parameters};
use firmware::control::LoopFlags;
use firmware::control::velocity_loop::{VelocityGains, VelocityLoop};
use firmware::supervisor::Code;

/// Bus voltage at which braking is nearly reduced to zero: 98.75 % of the maximum.
const FULL_BUS_V: f64 = 55.3;
/// Load of the joint, Nm. It pulls towards negative position.
const LOAD_NM: f64 = 8.0;

/// A joint whose velocity loop runs once a millisecond.
struct VelocityRig {
    rig: Rig<NoCompensation>,
    control: VelocityLoop,
    gains: VelocityGains,
}

impl VelocityRig {
    /// Returns a joint that holds the load at rest, on an empty bus.
    fn holding() -> Self {
        let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
        rig.stage.plant.load = LOAD_NM;
        let gains = VelocityGains::build(&parameters(), 1.0, 1e-3);
        let mut joint = Self { rig, control: VelocityLoop::begin(0.0), gains };
        joint.run(0.0, 1.0, |_| ());
        let velocity = joint.rig.stage.plant.velocity();
        assert!(velocity.abs() < 0.01, "{velocity} rad/s while it holds the load");
        joint
    }

    /// Runs with a target velocity, rad/s; `look` sees the joint after each period.
    fn run(&mut self, target_rad_s: f32, seconds: f64, mut look: impl FnMut(&Self)) -> LoopFlags {
        let mut flags = LoopFlags::empty();
        for _ in 0..(1e3 * seconds) as usize {
            let cycle = self.rig.cycle();
            let velocity_rad_s = cycle.velocity_rad_s;
            let command = self.control.step(&self.gains, target_rad_s, velocity_rad_s, 26.0, 0.0);
            self.rig.setpoint.current_a = command.current_a;
            flags |= cycle.flags;
            look(self);
            for _ in 1..cycles(1e-3) {
                flags |= self.rig.cycle().flags;
                look(self);
            }
        }
        flags
    }
}

#[test]
fn held_load_on_a_full_bus_does_not_sink() {
    let mut joint = VelocityRig::holding();
    joint.rig.stage.plant.machine.bus = FULL_BUS_V;
    let from = joint.rig.stage.plant.position();
    let mut energy_j = 0.0;
    joint.run(0.0, 2.0, |joint| energy_j += joint.rig.stage.bus_power_w() * 50e-6);
    let sunk_rad = from - joint.rig.stage.plant.position();
    println!(
        "a held load of {LOAD_NM} Nm sank by {sunk_rad:.5} rad in 2 s and took {energy_j:.1} J"
    );
    assert!(sunk_rad.abs() < 0.005, "{sunk_rad} rad");
    assert!(energy_j > 0.0, "{energy_j} J");
}

#[test]
fn lowered_load_on_a_full_bus_keeps_its_speed_and_charges_nothing() {
    for target_rad_s in [-0.5f32, -3.0, -8.0] {
        let mut joint = VelocityRig::holding();
        joint.rig.stage.plant.machine.bus = FULL_BUS_V;
        joint.run(target_rad_s, 0.5, |_| ());
        let (mut sum_w, mut count) = (0.0, 0.0);
        let (mut worst, mut vector_a) = (0.0f64, 0.0f64);
        let flags = joint.run(target_rad_s, 0.5, |joint| {
            sum_w += joint.rig.stage.bus_power_w();
            count += 1.0;
            let [d, q] = joint.rig.stage.plant.current();
            vector_a = vector_a.max(d.hypot(q));
            worst = worst.max((joint.rig.stage.plant.velocity() - f64::from(target_rad_s)).abs());
        });
        let mean_w = sum_w / count;
        println!(
            "{target_rad_s} rad/s: {mean_w:.1} W from the bus, {vector_a:.1} A, off by {worst:.3} rad/s"
        );
        assert!(worst < 0.05 * f64::from(target_rad_s.abs()).max(1.0), "{worst} rad/s");
        assert!(mean_w > -1.0, "{mean_w} W");
        assert!(vector_a < 27.0, "{vector_a} A");
        assert_eq!(flags.contains(LoopFlags::BRAKING_LIMITED), target_rad_s < -1.0);
    }
}

#[test]
fn braking_on_a_full_bus_beyond_what_the_copper_burns_is_reduced() {
    let machine = Machine { driven: Some(11.0), bus: FULL_BUS_V, ..Machine::default() };
    let mut rig = Rig::settled(machine, parameters(), no_compensation());
    for (current_a, expected_a) in [(-5.0f32, -5.3..-4.7), (-20.0, -12.0..-8.0), (10.0, 9.7..10.3)]
    {
        rig.setpoint.current_a = current_a;
        let last = rig.run(cycles(0.05));
        let mean_w = (0..cycles(0.02)).fold(0.0, |sum, _| {
            rig.cycle();
            sum + rig.stage.bus_power_w() / cycles(0.02) as f64
        });
        let [d, q] = rig.stage.plant.current();
        println!("{current_a} A at 11 rad/s: {q:.1} A q, {d:.1} A d, {mean_w:.1} W from the bus");
        assert!(expected_a.contains(&(q as f32)), "{q} A of {current_a} A");
        assert!(d.hypot(q) < 27.0 && mean_w > -2.0, "{d} {q} A, {mean_w} W");
        assert_eq!(last.flags.contains(LoopFlags::CURRENT_LIMITED), current_a == -20.0);
    }
}

#[test]
fn braking_on_a_bus_with_room_is_not_limited() {
    let machine = Machine { driven: Some(11.0), ..Machine::default() };
    let mut rig = Rig::settled(machine, parameters(), no_compensation());
    rig.setpoint.current_a = -20.0;
    let cycle = rig.run(cycles(0.05));
    assert!(!cycle.flags.intersects(LoopFlags::BRAKING_LIMITED | LoopFlags::CURRENT_LIMITED));
    assert_eq!((cycle.current_reference_a, cycle.current_d_reference_a), (-20.0, 0.0));
}

/// A load pushes the joint, and the bus is full: braking is limited for half a second.
#[test]
fn csv_after_limited_braking_stops_without_winding_up() {
    let mut joint = Joint::started();
    joint.enable_mode(9);
    (0..600).for_each(|_| joint.drive_velocity(0x0F, 9.5));
    for step in 0..500 {
        joint.stage.plant.load = -11.5 * f64::from(step) / 500.0;
        joint.drive_velocity(0x0F, 9.5);
    }
    joint.stage.plant.machine.bus = FULL_BUS_V;
    let mut least = f64::INFINITY;
    let mut limited_ms = 0;
    for _ in 0..1500 {
        joint.drive_velocity(0x0F, 0.0);
        least = least.min(joint.stage.plant.velocity());
        let limits = joint.background.node().joint.supervisor().limits();
        limited_ms += u32::from(limits.contains(Code::CurrentLimited));
    }
    let velocity = joint.stage.plant.velocity();
    println!("limited for {limited_ms} ms; undershoot {:.3} rad/s", -least);
    assert!(joint.stage.is_on() && velocity.abs() < 0.02, "{velocity} rad/s");
    assert!(limited_ms > 100, "{limited_ms} ms");
    assert!(least > -0.6, "{least} rad/s");
}
