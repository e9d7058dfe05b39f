//! Scenario 31: no torque of the compensation drives a joint that a master gives no torque.
//!
//! The friction of the joint falls below what its set or its learnt gains compensate. Each joint runs the same course without
//! compensation, too: by then the compensated one may be faster by 5 % of its largest speed, 12 rad/s.

use super::rig::{Joint, Master, compute_in_parallel, set};
use super::stops::flag;
use super::table::{ScenarioRow, check, row};
use super::velocity::drive;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use simulated_machines::joint;
use simulated_machines::joint_plant::JointPlant;
use std::f64::consts::TAU;
use std::sync::LazyLock;

const TQ: u8 = 4;
pub const CSV: u8 = 9;
pub const CST: u8 = 10;
pub const ENABLED: u16 = 0x0F;
/// Largest excess of the speed, rad/s.
pub const EXCESS_RAD_S: f64 = 0.05 * 12.0;
/// Time after an event at which the speed counts, ms.
pub const AFTER_MS: usize = 500;
/// Modes of 2044h:1.
const OFF: u8 = 0;
const ON: u8 = 1;
const ON_IN_EVERY_MODE: u8 = 3;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let cases = [
            Case {
                name: "set right, a drag ends at 0.5 rad/s",
                ends_in_motion: true,
                ..Case::NONE
            },
            Case {
                name: "learnt against a drag, which ends at 0.5 rad/s",
                adapt: ON,
                ends_in_motion: true,
                ..Case::NONE
            },
            Case {
                name: "the same, adaptation in every mode",
                adapt: ON_IN_EVERY_MODE,
                ends_in_motion: true,
                ..Case::NONE
            },
            Case {
                name: "learnt against a drag, which ends at rest, adaptation in every mode",
                adapt: ON_IN_EVERY_MODE,
                ..Case::NONE
            },
            Case {
                name: "learnt against a drag in one direction, which ends, adaptation in every mode",
                adapt: ON_IN_EVERY_MODE,
                is_one_way: true,
                ends_in_motion: true,
                ..Case::NONE
            },
            Case {
                name: "seal at 0.65 of the set, push of 3 Nm",
                wear: 0.65,
                push: true,
                ..Case::NONE
            },
            Case {
                name: "set of 1.7 times the friction, push of 3 Nm",
                wear: 1.0 / 1.7,
                push: true,
                ..Case::NONE
            },
            Case {
                name: "mode 4, seal at 0.65 of the set, push of 3 Nm",
                wear: 0.65,
                push: true,
                mode: TQ,
                ..Case::NONE
            },
        ];
        compute_in_parallel(&cases, Case::rows).concat()
    });
    &ROWS
}

/// A torque from outside, Nm, in the direction of positive motion.
pub fn set_outside(plant: &mut JointPlant, torque_nm: f64) {
    plant.hidden = Some(joint::Joint { offset_nm: -torque_nm, ..joint::Joint::default() });
}

/// A drag of the water plants, which opposes motion, Nm.
pub fn drag_nm(velocity_rad_s: f64) -> f64 {
    -2.0 * (velocity_rad_s / 0.02).clamp(-1.0, 1.0)
}

pub fn enable(master: &mut Master, mode: u8) {
    master.rig.send_immediately(0, &[1, 1]);
    master.rig.write_object_byte(index::MODE, 0, mode);
    for word in [0x06, 0x07, ENABLED] {
        (0..20).for_each(|_| drive(master, word, 0.0));
    }
    assert!(master.rig.is_armed(), "{:?}", master.faults());
}

/// Sends the targets 0 for this time, ms, with this torque from outside.
pub fn rest(master: &mut Master, milliseconds: usize, outside_nm: impl Fn(f64) -> f64) {
    for _ in 0..milliseconds {
        let velocity_rad_s = master.rig.plant().velocity_rad_s();
        set_outside(master.rig.plant_mut(), outside_nm(velocity_rad_s));
        drive(master, ENABLED, 0.0);
    }
}

pub fn speed(master: &Master) -> f64 {
    master.rig.plant().velocity_rad_s().abs()
}

/// A joint whose compensation exceeds its friction.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    adapt: u8,
    /// Friction of the seal as a share of that of the set.
    wear: f64,
    /// The drag in which it learns acts in one direction only, or ends while a hand moves the joint.
    is_one_way: bool,
    ends_in_motion: bool,
    push: bool,
    mode: u8,
}

impl Case {
    const NONE: Self = Self {
        name: "",
        adapt: OFF,
        wear: 1.0,
        is_one_way: false,
        ends_in_motion: false,
        push: false,
        mode: CST,
    };

    fn rows(&self) -> Vec<ScenarioRow> {
        let [at_release, after, later, armed] = self.run(0.9);
        let [_, bare, ..] = self.run(0.0);
        let name = format!("target torque 0, {}", self.name);
        vec![
            row(31, &name, "speed at the event, rad/s", at_release, 0.0..=6.0),
            row(
                31,
                &name,
                "speed after 0.5 s less that without compensation, rad/s",
                after - bare,
                -6.0..=EXCESS_RAD_S,
            ),
            row(31, &name, "speed after 4 s, rad/s", later, 0.0..=0.1),
            row(31, &name, "stays armed", armed, 1.0..=1.0),
        ]
    }

    /// Returns the speeds at the event and after it, and whether the joint is armed.
    fn run(&self, share: f64) -> [f64; 4] {
        let drag = |velocity: f64| {
            if self.is_one_way && velocity < 0.0 { 0.0 } else { drag_nm(velocity) }
        };
        Joint::with(set(share as f32)).run_plant(
            |plant| plant.seal.set_wear(self.wear),
            |master| {
                enable(master, CSV);
                if self.adapt != OFF && share > 0.0 {
                    let [mode, adapt] = [AdaptationObject::MODE, self.adapt];
                    master.rig.write_object_byte(index::ADAPTATION, mode, adapt);
                    for ms in 0..60_000 {
                        let velocity_rad_s = master.rig.plant().velocity_rad_s();
                        set_outside(master.rig.plant_mut(), drag(velocity_rad_s));
                        drive(master, ENABLED, 0.8 * (TAU * 0.5e-3 * f64::from(ms)).sin().signum());
                    }
                }
                for _ in 0..500 {
                    drive(master, ENABLED, 0.0);
                }
                master.rig.write_object_byte(index::MODE, 0, self.mode);
                rest(master, 200, drag);
                if self.push {
                    rest(master, 200, |_| 3.0);
                } else if self.ends_in_motion {
                    rest(master, 600, |velocity| 8.0 * (0.5 - velocity) + drag(velocity));
                }
                let at_release = speed(master);
                rest(master, AFTER_MS, |_| 0.0);
                let after = speed(master);
                rest(master, 4000 - AFTER_MS, |_| 0.0);
                [at_release, after, speed(master), flag(master.rig.is_armed())]
            },
        )
    }
}

#[test]
fn compensation_without_a_command_drives_no_joint() {
    check(rows());
}
