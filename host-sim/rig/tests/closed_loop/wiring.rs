//! Scenarios 3 and 5: a motor wired differently from its parameters, and amplifier drift.

use super::rig::{Joint, set};
use super::table::{ScenarioRow, check, row};
use std::f64::consts::PI;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for wrong in WIRINGS {
            rows.extend(wired(wrong));
        }
        rows.extend(drift());
        rows
    });
    &ROWS
}

#[derive(Clone, Copy)]
enum WiringError {
    Nothing,
    Direction,
    Phases,
    Offset(f64),
}

const WIRINGS: [WiringError; 5] = [
    WiringError::Nothing,
    WiringError::Direction,
    WiringError::Phases,
    WiringError::Offset(0.5 * PI),
    WiringError::Offset(PI),
];

fn wired(wrong: WiringError) -> Vec<ScenarioRow> {
    let mut joint = Joint::with(set(0.0));
    let motor = &mut joint.set.as_mut().expect("a set").motor;
    let what = match wrong {
        WiringError::Nothing => "wired according to its parameters".to_owned(),
        WiringError::Direction => {
            motor.encoder_direction = -1.0;
            "encoder reversed".into()
        }
        WiringError::Phases => "phases b and c swapped".into(),
        WiringError::Offset(electrical) => {
            motor.encoder_offset_rad = (electrical / 7.0) as f32;
            format!("electrical zero {:+.0} degrees off", electrical.to_degrees())
        }
    };
    let (stopped, after, most, travel) = joint.run(|master| {
        master.rig.stage_mut().phases_swapped = matches!(wrong, WiringError::Phases);
        let from = master.rig.plant().position_rad();
        master.arm().expect("nothing is seen before it drives");
        master.rig.stage_mut().take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..2000 {
            let t = f64::from(k) * 1e-3;
            let share = (t / 0.5).min(1.0);
            master.follow(2.0 * share, if share < 1.0 { 4.0 } else { 0.0 });
            if !master.rig.is_armed() && after.is_infinite() {
                after = t;
            }
        }
        let most = master.rig.stage_mut().take_extremes();
        let travel = (master.rig.plant().position_rad() - from).abs();
        (!master.rig.is_armed(), after, most, travel)
    });
    let name = format!("{what}: arm, 2 rad/s commanded for 2 s");
    let flag = |yes: bool| f64::from(u8::from(yes));
    let mut rows = match wrong {
        WiringError::Nothing => {
            vec![row(3, &name, "stopped by the driver", flag(stopped), 0.0..=0.0)]
        }
        WiringError::Offset(electrical) if electrical > 2.0 => vec![
            row(3, &name, "stopped by the driver", flag(stopped), 1.0..=1.0),
            row(3, &name, "command to open bridge, s", after, 0.0..=1.0),
            // Half a turn, a safe distance for a hand.
            row(3, &name, "total travel, rad", travel, 0.0..=PI),
        ],
        // The field does not turn with the rotor: there is no torque, and the joint has never moved.
        _ => vec![
            row(3, &name, "stopped by the driver", flag(stopped), 1.0..=1.0),
            row(3, &name, "total travel, rad", travel, 0.0..=0.05),
        ],
    };
    // Overspeed is at 14 rad/s; a joint of 0.12 kg m^2 under 26 Nm gains 1 rad/s in 5 ms.
    rows.push(row(3, &name, "largest speed, rad/s", most.speed_rad_s, 0.0..=15.5));
    rows.push(row(3, &name, "largest phase current, A", most.current_a, 0.5..=40.0));
    rows
}

fn drift() -> Vec<ScenarioRow> {
    let name = "amplifiers of phases a and b drift by +0.3 and -0.3 A, 0 A commanded";
    let (before, after) = Joint::with(set(0.0)).run(|master| {
        master.arm().expect("it arms");
        master.rig.stage_mut().board.as_mut().expect("a board").drift_a = [0.3, -0.3];
        let most = |master: &mut super::rig::Master| {
            let mut most = 0.0f64;
            for _ in 0..500 {
                master.current(1, 0.0);
                most = most.max(master.rig.plant().phase_currents_a()[0].abs());
            }
            most
        };
        let before = most(master);
        master.rig.request_state(0);
        master.current(50, 0.0);
        master.arm().expect("it arms again");
        (before, most(master))
    });
    vec![
        row(5, name, "before it is armed again: phase current, A", before, 0.2..=0.5),
        // A mean of 256 samples with 0.06 A of noise, a count of 0.04 A, and the loop's own noise of 0.05 A.
        row(5, name, "armed again: phase current, A", after, 0.0..=0.2),
    ]
}

#[test]
fn miswired_motor_is_stopped_and_amplifier_drift_is_removed() {
    check(rows());
}
