//! Scenario 9: an encoder that fails, at 3 rad/s with compensation.

use super::rig::{Joint, set};
use super::table::{ScenarioRow, check, row};
use joint_rig::EncoderFault;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let stops = [
            ("encoder angle frozen", EncoderFault::Frozen, 2.0),
            ("encoder's line low (zeros)", EncoderFault::Low, 10.0),
            ("encoder's line open (ones)", EncoderFault::High, 5.0),
            ("every encoder word disturbed", EncoderFault::Disturbed(1.0), 5.0),
        ];
        let stays = [
            ("encoder's magnet weak: noise x5", EncoderFault::Weak(15.5), 0.0),
            ("5 % of the encoder's words disturbed", EncoderFault::Disturbed(0.05), 0.0),
            ("encoder magnet 0.02 rad off centre", EncoderFault::None, 0.02),
        ];
        let mut rows = Vec::new();
        for (what, fault, within_ms) in stops {
            rows.extend(stopped(what, fault, within_ms));
        }
        for (what, fault, bend) in stays {
            rows.extend(kept(what, fault, bend));
        }
        rows.extend(at_rest());
        rows
    });
    &ROWS
}

/// Faults with which the joint cannot be driven: the driver stops within this time, ms.
fn stopped(what: &str, fault: EncoderFault, within_ms: f64) -> Vec<ScenarioRow> {
    let name = format!("{what}, at 3 rad/s");
    let (after, most, turned) = Joint::with(set(0.9)).run(|master| {
        master.arm().expect("it arms");
        master.spin(3.0, 300);
        let from = master.rig.plant().position_rad();
        let stage = master.rig.stage_mut();
        stage.board.as_mut().expect("a board").set_encoder(fault);
        stage.take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..500 {
            master.follow(3.0, 0.0);
            if after.is_infinite() && master.rig.stage_mut().applied_duty().is_none() {
                after = f64::from(k + 1);
            }
        }
        let turned = (master.rig.plant().position_rad() - from).abs();
        (after, master.rig.stage_mut().take_extremes(), turned)
    });
    vec![
        row(9, &name, "to open bridge, ms", after, 0.0..=within_ms),
        row(9, &name, "largest phase current, A", most.current_a, 0.5..=40.0),
        row(9, &name, "largest speed, rad/s", most.speed_rad_s, 2.0..=4.5),
        row(9, &name, "turned until rest, rad", turned, 0.0..=1.0),
    ]
}

/// Faults with which the driver continues.
fn kept(what: &str, fault: EncoderFault, bend: f64) -> Vec<ScenarioRow> {
    let name = format!("{what}, at 3 rad/s for 2 s");
    let mut joint = Joint::with(set(0.9));
    joint.constants.magnet_eccentricity_rad = bend;
    let (error, most, armed) = joint.run(|master| {
        master.arm().expect("it arms");
        master.spin(3.0, 500);
        let stage = master.rig.stage_mut();
        stage.board.as_mut().expect("a board").set_encoder(fault);
        stage.take_extremes();
        let mut sum = 0.0;
        for _ in 0..2000 {
            master.follow(3.0, 0.0);
            sum += (master.rig.plant().velocity_rad_s() - 3.0).powi(2);
        }
        let most = master.rig.stage_mut().take_extremes();
        ((sum / 2000.0f64).sqrt(), most, master.rig.is_armed())
    });
    vec![
        row(9, &name, "stays armed", f64::from(u8::from(armed)), 1.0..=1.0),
        row(9, &name, "RMS velocity error, rad/s", error, 0.0..=0.15),
        row(9, &name, "largest phase current, A", most.current_a, 0.5..=26.5),
    ]
}

/// A line that is low since power-up looks like a shaft at rest.
fn at_rest() -> Vec<ScenarioRow> {
    let name = "encoder's line low from power-up on";
    let armed = Joint::with(set(0.9)).run(|master| {
        let board = master.rig.stage_mut().board.as_mut().expect("a board");
        board.set_encoder(EncoderFault::Low);
        (0..300).for_each(|_| master.rig.step_idle());
        master.arm().is_ok()
    });
    vec![row(9, name, "arms", f64::from(u8::from(armed)), 0.0..=0.0)]
}

#[test]
fn encoder_fault_stops_joint_or_does_no_harm() {
    check(rows());
}
