//! Scenario 30: a second encoder at the joint's side of a gear with play, and its faults.
//!
//! The sixth transmit PDO carries both sides at each SYNC: 60E4h:1 and 6064h.

use super::rig::{Joint, Master, set};
use super::stops::{REST_RAD_S, flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::{drive, enable};
use firmware::node::dictionary::index;
use joint_rig::SerialFault;
use simulated_machines::joint_plant::OutputEncoder;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Speed of the joint with the faults, rad/s.
const SPEED_RAD_S: f64 = 3.0;
/// Play of a worn gear from end to end, 20 minutes of arc, and its torsion: rad and Nm/rad.
const PLAY_RAD: f64 = 6e-3;
const STIFFNESS_NM_PER_RAD: f64 = 6000.0;
/// Largest difference of the two sides, rad: the default of the window.
const WINDOW_RAD: f64 = 0.05;
/// Deceleration of the reaction to a fault, rad/s^2.
const QUICK: f64 = 50.0;
/// Identifier of the frame with both sides: 260h + node.
const SIDES: u16 = 0x261;
/// A bit of the encoder, and three standard deviations of its noise, rad.
const RESOLUTION_RAD: f64 = 3.5 * TAU / 262_144.0;
/// Largest eccentricity of its ring, rad.
const ECCENTRICITY_RAD: f64 = 5e-4;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = measures();
        for (what, fault) in [
            ("line open", SerialFault::Open),
            ("line low", SerialFault::Low),
            ("every frame disturbed", SerialFault::Disturbed(1.0)),
            ("error bit", SerialFault::Error),
        ] {
            rows.extend(missing(what, fault));
        }
        rows.extend(disturbed());
        rows.extend(single_jump());
        rows.extend(noisy());
        // The way of the window at 3 rad/s takes 17 ms.
        let frozen = |master: &mut Master| output(master).set_fault(SerialFault::Frozen);
        rows.extend(stopped("position frozen", [14.0, 25.0], frozen));
        // Three frames are left out, and two milliseconds pass until the driver reacts.
        let jump = |master: &mut Master| output(master).set_fault(SerialFault::Jump(0.25));
        rows.extend(stopped("position jumps by a quarter of a turn", [3.0, 8.0], jump));
        // Friction of 1 to 6 Nm decelerates the free output (0.02 kg m^2): the window after 18 to 60 ms.
        let broken = |master: &mut Master| master.rig.plant_mut().limit_coupling(0.0);
        rows.extend(stopped("coupling broken", [15.0, 60.0], broken));
        rows.extend(reversed());
        rows
    });
    &ROWS
}

fn output<'a>(master: &'a mut Master) -> &'a mut OutputEncoder {
    master.rig.stage_mut().board.as_mut().expect("a board").output_encoder()
}

fn joint() -> Joint {
    let mut set = set(0.9);
    set.sensors.joint_encoder_kind = 1.0;
    set.motor.acceleration_max_rad_s2 = 100.0;
    let mut joint = Joint::with(set);
    joint.constants.backlash_rad = PLAY_RAD;
    joint.constants.output_stiffness_nm_per_rad = STIFFNESS_NM_PER_RAD;
    joint
}

/// Writes an object of four bytes, and waits for the answer.
fn write(master: &mut Master, at_index: u16, sub_index: u8, word: u32) {
    master.rig.write_object(at_index, sub_index, word.to_le_bytes());
    (0..3).for_each(|_| master.rig.step_idle());
}

fn write_count(master: &mut Master, count: u8) {
    master.rig.write_object_byte(index::MAPPING_DRIVE, 0, count);
    (0..3).for_each(|_| master.rig.step_idle());
}

/// Sets the position, maps both sides to the sixth transmit PDO, sets the reaction to a fault, and enables the drive.
fn begin(master: &mut Master) {
    let at_rad = master.rig.plant().position_rad() as f32;
    master.rig.write_object(index::STATE, 6, at_rad.to_le_bytes());
    let identifier = u32::from(SIDES);
    write(master, index::TRANSMIT_DRIVE, 1, identifier | 1 << 31);
    write_count(master, 0);
    write(master, index::MAPPING_DRIVE, 1, u32::from(index::ADDITIONAL_POSITION) << 16 | 0x0120);
    write(master, index::MAPPING_DRIVE, 2, u32::from(index::ACTUAL_POSITION) << 16 | 0x0020);
    write_count(master, 2);
    write(master, index::TRANSMIT_DRIVE, 1, identifier);
    write_short(master, index::FAULT_OPTION, 0, 2);
    write(master, index::QUICK_DECELERATION, 0, (1e6 * QUICK) as u32);
    enable(master);
}

/// Position of the joint's side, NaN without one, and of the motor's side, in the last frame, rad.
fn sides(master: &mut Master) -> Option<[f64; 2]> {
    let frames = master.rig.take_answers();
    let frame = frames.iter().rev().find(|frame| frame.identifier() == SIDES)?;
    let ([joint, motor], []) = frame.data().as_chunks::<4>() else { return None };
    let [joint, motor] = [joint, motor].map(|word| i32::from_le_bytes(*word));
    let joint_rad = if joint == i32::MIN { f64::NAN } else { 1e-6 * f64::from(joint) };
    Some([joint_rad, 1e-6 * f64::from(motor)])
}

/// Drives for 1 ms; returns both sides, if a frame came in it.
fn step(master: &mut Master, velocity_rad_s: f64) -> Option<[f64; 2]> {
    drive(master, 0x0F, velocity_rad_s);
    sides(master)
}

/// Accelerates to this velocity, and holds it for some time.
fn reach(master: &mut Master, velocity_rad_s: f64, milliseconds: usize) {
    (0..milliseconds).for_each(|_| drive(master, 0x0F, velocity_rad_s));
    master.rig.take_answers();
}

/// True position of the joint's side less that of the motor's, rad.
fn true_difference(master: &Master) -> f64 {
    let plant = master.rig.plant();
    plant.position_rad() - plant.motor_position_rad()
}

/// Mean differences of the two sides, shown and true, while the joint passes this range at this velocity, rad.
fn pass(master: &mut Master, range_rad: [f64; 2], velocity_rad_s: f64) -> [f64; 2] {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for _ in 0..600 {
        let shown = step(master, velocity_rad_s);
        let at_rad = master.rig.plant().position_rad();
        if let Some([joint_rad, motor_rad]) = shown
            && (range_rad[0]..range_rad[1]).contains(&at_rad)
        {
            sums[0] += joint_rad - motor_rad;
            sums[1] += true_difference(master);
            count += 1.0;
        }
        let is_beyond = if velocity_rad_s > 0.0 {
            at_rad > range_rad[1] + 0.05
        } else {
            at_rad < range_rad[0] - 0.05
        };
        if is_beyond {
            break;
        }
    }
    sums.map(|sum| sum / count)
}

/// Position at rest, and the play that the difference of the two sides shows in both directions.
fn measures() -> Vec<ScenarioRow> {
    let rest = "gear with 6 mrad of play, at rest";
    let moving = "the same, at 3 rad/s forwards and back through the same way";
    let mut joint = joint();
    let seed = joint.faults.seed;
    let set = joint.set.as_mut().expect("a set");
    // As a person sets it with the joint at a known position.
    let zero_rad = TAU * OutputEncoder::new(seed).zero_turns;
    set.sensors.joint_encoder_offset_rad = -zero_rad as f32;
    joint.run(|master| {
        begin(master);
        let mut off_rad = 0.0f64;
        for _ in 0..50 {
            let Some([joint_rad, _]) = step(master, 0.0) else { continue };
            let error_rad = joint_rad - master.rig.plant().position_rad();
            off_rad = if error_rad.is_nan() { f64::INFINITY } else { off_rad.max(error_rad.abs()) };
        }
        let from_rad = master.rig.plant().position_rad();
        let range_rad = [from_rad + 0.5, from_rad + 0.8];
        let forwards = pass(master, range_rad, SPEED_RAD_S);
        reach(master, 0.0, 120);
        let back = pass(master, range_rad, -SPEED_RAD_S);
        let [shown_rad, true_rad] = [0, 1].map(|at| (back[at] - forwards[at]).abs());
        let error_rad = (shown_rad - true_rad).abs();
        let limits = master.rig.active_limits();
        let is_warned = limits.iter().any(|code| code.info().name == "encoder-magnet");
        // Play, and the torsion by friction (1 to 6 Nm) in both directions.
        let (least, most) = (PLAY_RAD, PLAY_RAD + 2.0 * 6.0 / STIFFNESS_NM_PER_RAD);
        // Both sides are of the same time within a period.
        let aligned_rad = 2.0 * SPEED_RAD_S * 50e-6 + RESOLUTION_RAD;
        vec![
            row(
                30,
                rest,
                "largest error of 60E4h:1, rad",
                off_rad,
                0.0..=ECCENTRICITY_RAD + RESOLUTION_RAD,
            ),
            row(30, moving, "change of the difference, rad", shown_rad, least..=most),
            row(30, moving, "its error, rad", error_rad, 0.0..=aligned_rad),
            row(30, moving, "warns", flag(is_warned), 0.0..=0.0),
            row(30, moving, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// Share of the frames with a position, time to the report, and whether the joint stays armed.
fn watch(master: &mut Master, milliseconds: usize) -> (f64, f64, bool) {
    let (mut after_ms, mut valid, mut frames) = (f64::INFINITY, 0.0, 0.0);
    for k in 0..milliseconds {
        if let Some([joint_rad, _]) = step(master, SPEED_RAD_S) {
            valid += flag(!joint_rad.is_nan());
            frames += 1.0;
        }
        // Every request of the state runs the board for some time.
        if after_ms.is_infinite() && k % 10 == 9 {
            let limits = master.rig.active_limits();
            if limits.iter().any(|code| code.info().name == "encoder-magnet") {
                after_ms = (k + 1) as f64;
            }
        }
    }
    (valid / frames, after_ms, master.rig.is_armed())
}

/// A fault without a position: the joint goes on with the motor's encoder.
fn missing(what: &str, fault: SerialFault) -> Vec<ScenarioRow> {
    let name = format!("joint's encoder, {what}, at 3 rad/s");
    joint().run(|master| {
        begin(master);
        reach(master, SPEED_RAD_S, 100);
        output(master).set_fault(fault);
        // The frame of the last report may still be on its way.
        reach(master, SPEED_RAD_S, 3);
        let (valid, after_ms, armed) = watch(master, 60);
        output(master).set_fault(SerialFault::None);
        reach(master, SPEED_RAD_S, 3);
        let (valid_again, ..) = watch(master, 30);
        vec![
            row(30, &name, "share of the frames with a position", valid, 0.0..=0.0),
            // Two milliseconds, and 10 ms between two looks.
            row(30, &name, "to its report, ms", after_ms, 0.0..=20.0),
            row(30, &name, "stays armed", flag(armed), 1.0..=1.0),
            row(30, &name, "share with a position after the fault", valid_again, 1.0..=1.0),
        ]
    })
}

/// Some frames are disturbed.
fn disturbed() -> Vec<ScenarioRow> {
    let name = "joint's encoder, 5 % of the frames disturbed, at 3 rad/s";
    joint().run(|master| {
        begin(master);
        reach(master, SPEED_RAD_S, 100);
        output(master).set_fault(SerialFault::Disturbed(0.05));
        let (valid, after_ms, armed) = watch(master, 120);
        vec![
            // Of 120 frames, 95 % less three standard deviations.
            row(30, name, "share of the frames with a position", valid, 0.89..=1.0),
            row(30, name, "to its report, ms", after_ms, 0.0..=90.0),
            row(30, name, "stays armed", flag(armed), 1.0..=1.0),
        ]
    })
}

/// A jump that lasts a frame.
fn single_jump() -> Vec<ScenarioRow> {
    let name = "joint's encoder, position jumps by 0.1 turns for 1 ms, at 3 rad/s";
    joint().run(|master| {
        begin(master);
        reach(master, SPEED_RAD_S, 100);
        let (mut most_rad, mut last) = (0.0f64, None);
        for k in 0..30 {
            if k == 10 {
                output(master).set_fault(SerialFault::Jump(0.1));
            }
            let shown = step(master, SPEED_RAD_S);
            output(master).set_fault(SerialFault::None);
            let Some([joint_rad, motor_rad]) = shown.filter(|[joint_rad, _]| !joint_rad.is_nan())
            else {
                continue;
            };
            let difference_rad = joint_rad - motor_rad;
            most_rad = most_rad.max((difference_rad - last.unwrap_or(difference_rad)).abs());
            last = Some(difference_rad);
        }
        vec![
            // Torsion, noise, and a period between both sides.
            row(30, name, "largest change of the difference, rad", most_rad, 0.0..=1.5e-3),
            row(30, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// A noise of a fifth of the window.
fn noisy() -> Vec<ScenarioRow> {
    let name = "joint's encoder, noise of 0.01 rad, at 3 rad/s";
    joint().run(|master| {
        begin(master);
        reach(master, SPEED_RAD_S, 100);
        output(master).set_noise(0.01);
        let (_, after_ms, armed) = watch(master, 60);
        vec![
            row(30, name, "to its report, ms", after_ms, 0.0..=20.0),
            row(30, name, "stays armed", flag(armed), 1.0..=1.0),
        ]
    })
}

/// A fault with which the two sides differ by more than the window.
fn stopped(what: &str, within_ms: [f64; 2], act: impl Fn(&mut Master)) -> Vec<ScenarioRow> {
    let name = format!("joint's encoder, {what}, at 3 rad/s, 605Eh = 2");
    joint().run(|master| {
        begin(master);
        reach(master, SPEED_RAD_S, 100);
        act(master);
        master.rig.stage_mut().take_extremes();
        let (mut fault_ms, mut open_ms, mut speed_rad_s) = (f64::INFINITY, f64::INFINITY, 0.0);
        let mut before_rad = motor_rad(master);
        for k in 1..=400 {
            drive(master, 0x0F, SPEED_RAD_S);
            if fault_ms.is_infinite() && has_emergency(master, 30) {
                fault_ms = f64::from(k);
            }
            let at_rad = motor_rad(master);
            let is_open = master.rig.stage_mut().applied_duty().is_none();
            if is_open && open_ms.is_infinite() {
                (open_ms, speed_rad_s) = (f64::from(k), ((at_rad - before_rad) * 1e3).abs());
            }
            before_rad = at_rad;
        }
        let most_a = master.rig.stage_mut().take_extremes().current_a;
        let is_named = master.has("following-error");
        let [least_ms, most_ms] = within_ms;
        // As in scenario 17: the ramp, the lag of the velocity loop, and 20 ms at rest. A motor that crosses the play at this
        // speed rests later.
        let ramp_ms = 1e3 * SPEED_RAD_S / QUICK;
        let crossing_ms = 1e3 * PLAY_RAD / REST_RAD_S;
        vec![
            row(30, &name, "to the fault, ms", fault_ms, least_ms..=most_ms),
            row(30, &name, "following-error", is_named, 1.0..=1.0),
            row(
                30,
                &name,
                "from the fault to open bridge, ms",
                open_ms - fault_ms,
                0.9 * ramp_ms + 15.0..=ramp_ms + 120.0 + crossing_ms,
            ),
            row(30, &name, "speed of the motor's side then, rad/s", speed_rad_s, 0.0..=0.2),
            row(30, &name, "largest phase current, A", most_a, 0.5..=26.5),
        ]
    })
}

fn motor_rad(master: &Master) -> f64 {
    master.rig.plant().motor_position_rad()
}

/// Takes the frames since the last call. Returns true if there is the emergency of this code.
fn has_emergency(master: &mut Master, number: u8) -> bool {
    let frames = master.rig.take_answers();
    let is_of_code = |data: &[u8]| data.get(3) == Some(&number);
    frames.iter().any(|frame| frame.identifier() == 0x081 && is_of_code(frame.data()))
}

/// The encoder falls while the joint moves in its positive direction.
fn reversed() -> Vec<ScenarioRow> {
    let name = "joint's encoder reversed, 3 rad/s commanded, 605Eh = 2";
    joint().run(|master| {
        output(master).is_reversed = true;
        begin(master);
        let from_rad = master.rig.plant().position_rad();
        let mut fault_rad = f64::INFINITY;
        for _ in 0..200 {
            drive(master, 0x0F, SPEED_RAD_S);
            if fault_rad.is_infinite() && has_emergency(master, 30) {
                fault_rad = master.rig.plant().position_rad() - from_rad;
            }
        }
        let travel_rad = master.rig.plant().position_rad() - from_rad;
        let ramp_rad = 0.5 * SPEED_RAD_S * SPEED_RAD_S / QUICK;
        vec![
            // The difference is twice the way, and includes the play. The joint moves for two milliseconds more.
            row(
                30,
                name,
                "way to the fault, rad",
                fault_rad,
                0.5 * (WINDOW_RAD - 2.0 * PLAY_RAD)..=0.5 * WINDOW_RAD + 3e-3 * SPEED_RAD_S,
            ),
            row(30, name, "total travel, rad", travel_rad, 0.02..=0.04 + ramp_rad),
            row(30, name, "following-error", master.has("following-error"), 1.0..=1.0),
        ]
    })
}

#[test]
fn encoder_of_the_joint_shows_play_and_its_faults_are_found() {
    check(rows());
}
