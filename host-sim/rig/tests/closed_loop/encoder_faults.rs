//! Scenario 26, faults: every kind of encoder, missing, stuck, noisy, jumping and reversed. The image runs some of them.

use super::commissioning::commission;
use super::driver::ALL_ENCODER_FAULTS;
use super::encoder_fault_cases::Fault::{self, Chip, Hall};
use super::encoder_fault_cases::Reaction::{Stops, Warns};
use super::encoder_fault_cases::{
    AS5047P, AS5048A, Case, KINDS, LOST, REVERSED, STUCK, Start, Stop, cases,
};
use super::encoder_kinds::{
    ABZ, ABZ_HALL, HALL, SPEED_RAD_S, flag, is_position_known, joint, reach, reach_speed,
    turn_by_hand,
};
use super::rig::{Joint, Master};
use super::table::{ScenarioRow, check, outside_row, row};
use firmware::node::dictionary::index;
use firmware::sensors::SensorParameters;
use joint_rig::{EncoderFault, HallFault};
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for (kind, name) in KINDS {
            for case in cases(kind) {
                rows.extend(in_motion(kind, name, &case));
            }
        }
        let is_run = |start: &Start| ALL_ENCODER_FAULTS || start.stop.code == LOST.code;
        for start in REVERSED.iter().filter(|start| is_run(start)) {
            rows.extend(from_rest(start, "reversed"));
        }
        rows.extend(sound());
        if ALL_ENCODER_FAULTS {
            for start in &STUCK {
                rows.extend(from_rest(start, "stuck"));
            }
            rows.extend(turned_by_load(AS5047P, "AS5047P", Chip(EncoderFault::Detached)));
            rows.extend(turned_by_load(HALL, "Hall sensors alone", Hall(HallFault::Frozen)));
            rows.extend(half_a_turn_off());
            rows.extend(reversed_after_proof());
            rows.extend(commissioned());
        }
        // A run takes ten seconds.
        let is_long = std::env::var_os("LONG_TESTS").is_some();
        let count = if ALL_ENCODER_FAULTS { 2 } else { usize::from(is_long) };
        for hall in [HallFault::Reversed, HallFault::Jump].into_iter().take(count) {
            rows.extend(commissioned_with_hall(hall));
        }
        rows
    });
    &ROWS
}

/// A fault at 3 rad/s.
fn in_motion(kind: f32, kind_name: &str, case: &Case) -> Vec<ScenarioRow> {
    let Case { what, fault, reaction, .. } = *case;
    let name = format!("{kind_name}: {what}, at 3 rad/s");
    let (figure, within_ms) = match reaction {
        Stops(within_ms) => ("to encoder-lost, open bridge and unknown position, ms", within_ms),
        Warns(within_ms) => ("to its report, joint driven on, ms", within_ms),
    };
    let (after, most) = started(&joint(kind), kind, |master| {
        reach_speed(master);
        let is_early = is_warned(master);
        fault.set(master);
        master.rig.stage_mut().take_extremes();
        let mut after = f64::INFINITY;
        for k in 0..if matches!(reaction, Stops(_)) { 50 } else { 150 } {
            master.follow(SPEED_RAD_S, 0.0);
            let is_over = match reaction {
                Stops(_) => master.rig.stage_mut().applied_duty().is_none(),
                // Every request of the state runs the board for some time.
                Warns(_) => !is_early && k % 10 == 9 && is_warned(master),
            };
            if after.is_infinite() && is_over {
                after = f64::from(k + 1);
            }
        }
        let is_so = match reaction {
            Stops(_) => master.has("encoder-lost") != 0.0 && !is_position_known(master),
            Warns(_) => master.rig.is_armed(),
        };
        (if is_so { after } else { f64::INFINITY }, master.rig.stage_mut().take_extremes())
    });
    let bears_a = if matches!(reaction, Stops(_)) { 40.0 } else { 26.5 };
    vec![
        row(26, &name, figure, after, 0.0..=within_ms),
        row(26, &name, "largest phase current, A", most.current_a, 0.5..=bears_a),
    ]
}

/// A joint whose wiring is not proven, with a fault since before it is armed, to 2 rad/s in 0.5 s.
fn from_rest(start: &Start, what: &str) -> Vec<ScenarioRow> {
    let Start { kind, name, fault, stop } = *start;
    let Stop { code, figure, within_ms } = stop;
    let name = format!("{name}: {what} since the start, 2 rad/s commanded");
    let (after, way, most) = started(&joint(kind), kind, |master| {
        fault.set(master);
        (0..150).for_each(|_| master.rig.step_idle());
        master.arm().expect("nothing is seen at rest");
        master.rig.stage_mut().take_extremes();
        let (after, way) = accelerate(master, within_ms as u32);
        let is_so = master.has(code) != 0.0;
        let most = master.rig.stage_mut().take_extremes();
        (if is_so { after } else { f64::INFINITY }, way, most)
    });
    vec![
        row(26, &name, figure, after, 0.0..=within_ms),
        // A field that does not turn with the rotor holds it within an electrical turn, 18 mrad.
        row(26, &name, "farthest, rad", way, 0.0..=0.018),
        row(26, &name, "largest phase current, A", most.current_a, 0.5..=40.0),
    ]
}

/// Commands 2 rad/s, reached in 0.5 s. Returns the time until the bridge is open, ms, and the largest way, rad.
fn accelerate(master: &mut Master, milliseconds: u32) -> (f64, f64) {
    let from = master.rig.plant().position_rad();
    let (mut after, mut way) = (f64::INFINITY, 0.0f64);
    for k in 0..milliseconds {
        let share = (f64::from(k) / 500.0).min(1.0);
        master.follow(2.0 * share, if share < 1.0 { 4.0 } else { 0.0 });
        way = way.max((master.rig.plant().position_rad() - from).abs());
        if after.is_infinite() && master.rig.stage_mut().applied_duty().is_none() {
            after = f64::from(k + 1);
        }
    }
    (after, way)
}

/// An encoder that stands while the load turns the joint at a constant speed.
fn turned_by_load(kind: f32, name: &str, fault: Fault) -> Vec<ScenarioRow> {
    let at = |speed_rad_s: f64| {
        let name = format!("{name}: stands while its load turns it at {speed_rad_s} rad/s");
        let after = joint(kind).run(|master| {
            master.rig.plant_mut().turn(Some(speed_rad_s));
            (0..50).for_each(|_| master.rig.step_idle());
            master.arm().expect("it arms");
            fault.set(master);
            let open = |master: &mut Master| {
                master.current(1, 0.0);
                master.rig.stage_mut().applied_duty().is_none()
            };
            let after =
                (1..=100).find(|_| open(master)).filter(|_| master.has("encoder-lost") != 0.0);
            after.map_or(f64::INFINITY, f64::from)
        });
        // The observer comes to rest in 12 ms, and 3 electrical turns take 26 ms at 2 rad/s.
        row(26, &name, "to open bridge with encoder-lost, ms", after, 0.0..=45.0)
    };
    [2.0, 5.0, 9.0].map(at).to_vec()
}

/// A rotor that is driven against its speed runs away until its EMF shows the sign.
fn half_a_turn_off() -> Vec<ScenarioRow> {
    let name = "Hall sensors alone: half an electrical turn off since the start, 2 rad/s commanded";
    let (after, way, is_named) = joint(HALL).run(|master| {
        Hall(HallFault::Jump).set(master);
        (0..150).for_each(|_| master.rig.step_idle());
        master.arm().expect("nothing is seen at rest");
        let (after, _) = accelerate(master, 1000);
        // Until rest.
        let way = master.rig.plant().position_rad().abs();
        (after, way, master.has("motor-against-order") != 0.0)
    });
    let after = if is_named { after } else { f64::INFINITY };
    vec![
        row(26, name, "to open bridge with motor-against-order, ms", after, 0.0..=1000.0),
        // Half a turn, a safe distance for a hand.
        row(26, name, "total travel, rad", way, 0.0..=std::f64::consts::PI),
    ]
}

/// A proven joint whose encoder was reversed while it was disarmed: its limit `stalled` is reported.
fn reversed_after_proof() -> Vec<ScenarioRow> {
    let name = "AS5047P reversed after a proof of the wiring, 2 rad/s commanded";
    let (stalled, way) = joint(AS5047P).run(|master| {
        reach_speed(master);
        (0..100).for_each(|_| master.follow(0.0, 0.0));
        master.rig.request_state(0);
        (0..50).for_each(|_| master.rig.step_idle());
        Chip(EncoderFault::Reversed).set(master);
        (0..150).for_each(|_| master.rig.step_idle());
        master.arm().expect("nothing is seen at rest");
        let (_, way) = accelerate(master, 1000);
        let limits = master.rig.active_limits();
        (limits.iter().any(|code| code.info().name == "stalled"), way)
    });
    vec![
        row(26, name, "stalled is reported", flag(stalled), 1.0..=1.0),
        row(26, name, "farthest, rad", way, 0.0..=0.018),
    ]
}

/// Joints that stand or are moved by their load have no encoder that stands: counts of runs without a fault.
fn sound() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (kind, name) in KINDS.into_iter().filter(|(kind, _)| ALL_ENCODER_FAULTS || *kind == HALL) {
        let mut count = |what: &str, runs: Vec<bool>| {
            let (good, all) = (runs.iter().filter(|run| **run).count() as f64, runs.len() as f64);
            let name = format!("{name}: {what}");
            rows.push(row(26, &name, "runs in which it stays armed", good, all..=all));
        };
        // As in homing to a stop.
        count("20 A into a stop at 0.3 rad/s, and back", vec![is_armed_after_stop(kind, 0.3)]);
        if ALL_ENCODER_FAULTS {
            let held = [0.0, 20.0, 170.0, 333.0].map(|hz| is_armed_while_held(kind, hz));
            count("held, 20 A in both directions, at 0, 20, 170 and 333 Hz", held.to_vec());
            let turned = [0.1, 0.2, 0.3, 0.5, 0.7, 1.5].map(|speed| {
                [20.0, -20.0].map(|current_a| is_armed_while_turned(kind, speed, current_a))
            });
            count(
                "turned at 0.1 to 1.5 rad/s, with and against 20 A",
                turned.as_flattened().to_vec(),
            );
        }
    }
    rows.extend(stops());
    rows
}

/// Joints that are driven into a stop at speed. Lines have no noise, so that a rotor without a bounce looks like a frozen encoder.
fn stops() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for (kind, name) in KINDS.into_iter().filter(|_| ALL_ENCODER_FAULTS) {
        let name = format!("{name}: 20 A into a stop at 3 rad/s, and back");
        let armed = flag(is_armed_after_stop(kind, SPEED_RAD_S));
        let has_lines = [ABZ, ABZ_HALL].contains(&kind);
        let row_of = if has_lines { outside_row } else { row };
        rows.push(row_of(26, &name, "stays armed", armed, 1.0..=1.0));
    }
    rows
}

/// Starts a joint and its encoder.
fn started<R>(joint: &Joint, kind: f32, work: impl FnOnce(&mut Master) -> R) -> R {
    joint.run(|master| {
        if kind == ABZ {
            turn_by_hand(master);
        }
        work(master)
    })
}

/// A joint whose gear is as stiff as a strain-wave gear meets a rigid stop.
fn is_armed_after_stop(kind: f32, speed_rad_s: f64) -> bool {
    let mut joint = joint(kind);
    joint.constants.output_stiffness_nm_per_rad = 1e4;
    joint.constants.output_damping_nm_s_per_rad = 3.0;
    started(&joint, kind, |master| {
        reach(master, speed_rad_s);
        master.rig.plant_mut().hold(true);
        master.current(100, 20.0);
        master.current(100, -20.0);
        master.rig.is_armed()
    })
}

/// A current that changes its direction at this rate, on a held joint.
fn is_armed_while_held(kind: f32, hz: f64) -> bool {
    started(&joint(kind), kind, |master| {
        master.rig.plant_mut().hold(true);
        master.arm().expect("it arms");
        for k in 0..300 {
            let phase = (f64::from(k) * 1e-3 * hz + 0.1).rem_euclid(1.0);
            master.current(1, if phase < 0.5 { 20.0 } else { -20.0 });
        }
        master.rig.is_armed()
    })
}

fn is_armed_while_turned(kind: f32, speed_rad_s: f64, current_a: f64) -> bool {
    started(&joint(kind), kind, |master| {
        master.rig.plant_mut().turn(Some(speed_rad_s));
        master.arm().expect("it arms");
        master.current(400, current_a);
        master.rig.is_armed()
    })
}

/// Commissioning of motors with reversed encoders: it finds the direction, and the joint can be driven.
fn commissioned() -> Vec<ScenarioRow> {
    let mut rows = Vec::new();
    for Start { kind, name, fault, .. } in REVERSED {
        if kind == AS5048A {
            continue;
        }
        let is_found = kind != ABZ_HALL;
        let joint = Joint { commissioned: false, ..joint(kind) };
        let outcome = started(&joint, kind, |master| {
            fault.set(master);
            (0..150).for_each(|_| master.rig.step_idle());
            commission(master)
        });
        let name = format!("{name}: reversed, commissioning");
        let is_driven = outcome.torque_share.is_some();
        let expected = flag(is_found);
        rows.push(row(
            26,
            &name,
            "joint can be driven afterwards",
            flag(is_driven),
            expected..=expected,
        ));
        if is_found {
            rows.push(row(26, &name, "direction of the encoder", outcome.direction, -1.0..=-1.0));
        }
    }
    rows
}

/// An ABZ encoder with Hall sensors, commissioned as one without. It finds their order and place, with which kind 3 is driven.
fn commissioned_with_hall(hall: HallFault) -> Vec<ScenarioRow> {
    let what = if hall == HallFault::Jump { "half an electrical turn off" } else { "reversed" };
    let name = format!("Hall sensors {what}, commissioned as ABZ");
    let abz = Joint { commissioned: false, ..joint(ABZ) };
    let [order, begin_rad] = started(&abz, ABZ, |master| {
        Hall(hall).set(master);
        (0..150).for_each(|_| master.rig.step_idle());
        commission(master);
        ["hall_order", "hall_offset_rad"].map(|parameter| {
            let place = SensorParameters::NAMES.iter().position(|name| *name == parameter);
            let subindex = place.expect("a parameter") as u8 + 1;
            f32::from_bits(master.rig.read_object(index::SENSORS, subindex).expect("a number"))
        })
    });
    let mut both = joint(ABZ_HALL);
    let set = both.set.as_mut().expect("a set");
    (set.sensors.hall_order, set.sensors.hall_offset_rad) = (order, begin_rad);
    let armed = both.run(|master| {
        Hall(hall).set(master);
        (0..150).for_each(|_| master.rig.step_idle());
        reach_speed(master);
        (0..100).for_each(|_| master.follow(SPEED_RAD_S, 0.0));
        master.rig.is_armed()
    });
    let (true_order, true_rad) = if hall == HallFault::Jump { (1.0, PI) } else { (-1.0, PI / 3.0) };
    let off = (f64::from(begin_rad) - true_rad + PI).rem_euclid(TAU) - PI;
    vec![
        row(26, &name, "order of the Hall sensors", order.into(), true_order..=true_order),
        // The placement of the sensors.
        row(
            26,
            &name,
            "error of their place, electrical degrees",
            off.to_degrees().abs(),
            0.0..=5.0,
        ),
        row(26, &name, "at 3 rad/s as ABZ and Hall sensors: stays armed", flag(armed), 1.0..=1.0),
    ]
}

/// Returns true if the driver reports a warning of the encoder.
fn is_warned(master: &mut Master) -> bool {
    let codes = master.rig.active_limits();
    codes.iter().any(|code| ["encoder-magnet", "encoder-coasting"].contains(&code.info().name))
}

#[test]
fn faults_of_all_encoders_stop_the_joint_or_are_reported() {
    check(rows());
}
