//! Scenario 26, faults: every kind of encoder, missing, stuck, noisy, jumping and reversed. The image runs some of them.

use super::commissioning::commission;
use super::driver::ALL_ENCODER_FAULTS;
use super::encoder_kinds::{
    ABZ, ABZ_HALL, BISS, HALL, SPEED_RAD_S, board, flag, is_position_known, joint, reach,
    reach_speed, turn_by_hand,
};
use super::rig::{Joint, Master};
use super::table::{ScenarioRow, check, outside_row, row};
use firmware::node::dictionary::index;
use firmware::sensors::SensorParameters;
use joint_rig::{EncoderFault, HallFault, LineFault, SerialFault};
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

const AS5047P: f32 = 0.0;
const AS5048A: f32 = 1.0;

/// Kinds of encoders: value of `encoder_kind`, and name.
const KINDS: [(f32, &str); 6] = [
    (AS5047P, "AS5047P"),
    (AS5048A, "AS5048A"),
    (ABZ, "ABZ"),
    (ABZ_HALL, "ABZ and Hall sensors"),
    (HALL, "Hall sensors alone"),
    (BISS, "BiSS C"),
];

/// A fault of any encoder.
#[derive(Clone, Copy)]
enum Fault {
    Chip(EncoderFault),
    Lines(LineFault),
    Hall(HallFault),
    Serial(SerialFault),
}

impl Fault {
    fn set(self, master: &mut Master) {
        match self {
            Self::Chip(fault) => board(master).set_encoder(fault),
            Self::Lines(fault) => board(master).set_lines(fault),
            Self::Hall(fault) => board(master).set_hall(fault),
            Self::Serial(fault) => board(master).set_serial(fault),
        }
    }
}

/// What the driver does, within a time in ms.
#[derive(Clone, Copy)]
enum Reaction {
    /// It opens the bridge with `encoder-lost`, and the position is unknown.
    Stops(f64),
    /// It drives on, and reports `encoder-magnet` or `encoder-coasting`.
    Warns(f64),
}

use Fault::{Chip, Hall, Lines, Serial};
use Reaction::{Stops, Warns};

/// A fault in motion: its name, itself, the reaction, and whether the image runs it, too.
type Case = (&'static str, Fault, Reaction, bool);

/// 2 ms until the rotor is lost, a step of the background, and one of the master.
const LOST_MS: f64 = 4.0;
/// 16 samples, 0.8 ms.
const FROZEN_MS: f64 = 3.0;
/// The observer comes to rest in 12 ms, and 3 electrical turns take 3 ms each at 2.7 rad/s.
const UNSEEN_MS: f64 = 30.0;

/// Faults of an AS504x.
const CHIP: [Case; 7] = [
    ("line open", Chip(EncoderFault::High), Stops(LOST_MS), false),
    ("line low", Chip(EncoderFault::Low), Stops(LOST_MS), false),
    ("angle frozen", Chip(EncoderFault::Frozen), Stops(FROZEN_MS), false),
    ("magnet off its shaft", Chip(EncoderFault::Detached), Stops(UNSEEN_MS), true),
    ("every word disturbed", Chip(EncoderFault::Disturbed(1.0)), Stops(LOST_MS), false),
    // Missing words in two reports in a row, of twenty each, are nearly sure.
    ("5 % of the words disturbed", Chip(EncoderFault::Disturbed(0.05)), Warns(40.0), false),
    ("angle jumps by a quarter of a turn", Chip(EncoderFault::Jump(4096)), Stops(LOST_MS), false),
];

/// Faults of an ABZ encoder, with Hall sensors and without.
const LINES: [Case; 5] = [
    // A contradiction of the Hall sensors in the first 0.8 ms leaves no angle for 2 ms.
    ("lines missing", Lines(LineFault::Missing), Stops(FROZEN_MS + 2.0), true),
    ("count jumps by a quarter of a turn", Lines(LineFault::Jump(1024)), Stops(LOST_MS), true),
    // The next index, after 41 ms at most, and 10 ms between two looks.
    ("30 counts lost", Lines(LineFault::Lost(30)), Warns(60.0), true),
    ("index missing", Lines(LineFault::NoIndex), Warns(110.0), true),
    ("every 50th edge lost or counted twice", Lines(LineFault::Noisy(0.02)), Warns(130.0), true),
];

/// Faults of Hall sensors alone.
const HALLS: [Case; 5] = [
    ("plug off", Hall(HallFault::Missing), Stops(LOST_MS), true),
    // An illegal level within an electrical turn, 6 ms, and 2 ms until the rotor is lost.
    ("a sensor stuck", Hall(HallFault::StuckSensor), Stops(10.0), true),
    ("all levels stuck", Hall(HallFault::Frozen), Stops(UNSEEN_MS + 10.0), true),
    ("levels jump by half an electrical turn", Hall(HallFault::Jump), Stops(LOST_MS), true),
    ("a wrong level in 0.4 % of the periods", Hall(HallFault::Noisy(0.004)), Warns(130.0), false),
];

/// Faults of an encoder with BiSS C.
const SERIAL: [Case; 9] = [
    ("line open", Serial(SerialFault::Open), Stops(LOST_MS), true),
    ("line low", Serial(SerialFault::Low), Stops(LOST_MS), true),
    ("position frozen", Serial(SerialFault::Frozen), Stops(FROZEN_MS), true),
    ("disc off its shaft", Serial(SerialFault::Detached), Stops(UNSEEN_MS), false),
    ("every frame disturbed", Serial(SerialFault::Disturbed(1.0)), Stops(LOST_MS), true),
    ("error bit", Serial(SerialFault::Error), Stops(LOST_MS), true),
    // A report comes every millisecond, and 10 ms are between two looks.
    ("5 % of the frames disturbed", Serial(SerialFault::Disturbed(0.05)), Warns(40.0), true),
    ("warning bit", Serial(SerialFault::Warning), Warns(40.0), true),
    (
        "position jumps by a quarter of a turn",
        Serial(SerialFault::Jump(0.25)),
        Stops(LOST_MS),
        true,
    ),
];

/// Faults of one part of two, or that only one of two kinds bears.
const LINE_A_OF_ABZ: Case = ("line A stuck", Lines(LineFault::StuckLine), Stops(UNSEEN_MS), true);
const OF_BOTH: [Case; 5] = [
    // The Hall sensors contradict the count after 85 degrees (electrical), 1.4 ms, and the start of a sector; then 2 ms until the
    // rotor is lost.
    ("line A stuck", Lines(LineFault::StuckLine), Stops(6.0), true),
    ("Hall sensors' plug off", Hall(HallFault::Missing), Stops(LOST_MS), false),
    ("a Hall sensor stuck", Hall(HallFault::StuckSensor), Stops(10.0), false),
    ("all Hall levels stuck", Hall(HallFault::Frozen), Stops(6.0), false),
    (
        "a wrong Hall level in 0.4 % of the periods",
        Hall(HallFault::Noisy(0.004)),
        Warns(130.0),
        true,
    ),
];

fn cases(kind: f32) -> Vec<Case> {
    let mut cases = match kind {
        AS5047P | AS5048A => CHIP.to_vec(),
        ABZ => LINES.map(|(what, fault, reaction, _)| (what, fault, reaction, false)).to_vec(),
        ABZ_HALL => [&LINES[..], &OF_BOTH].concat(),
        HALL => HALLS.to_vec(),
        _ => SERIAL.to_vec(),
    };
    if kind == ABZ {
        cases.push(LINE_A_OF_ABZ);
    }
    cases.retain(|case| ALL_ENCODER_FAULTS || case.3 && kind != AS5048A);
    cases
}

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for (kind, name) in KINDS {
            for case in cases(kind) {
                rows.extend(in_motion(kind, name, &case));
            }
        }
        let on_board = |stop: &Stop| ALL_ENCODER_FAULTS || stop.0 == LOST.0;
        for (kind, name, fault, stop) in REVERSED.into_iter().filter(|case| on_board(&case.3)) {
            rows.extend(from_rest(kind, name, "reversed", fault, stop));
        }
        rows.extend(sound());
        if ALL_ENCODER_FAULTS {
            for (kind, name, fault, stop) in STUCK {
                rows.extend(from_rest(kind, name, "stuck", fault, stop));
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
    let (what, fault, reaction, _) = *case;
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

/// What stops a joint that was at rest, and within which time, ms.
type Stop = (&'static str, &'static str, f64);

/// Half a second at 5 A, which the loop of the master reaches within 0.4 s.
const STANDS: Stop = ("motor-stands", "to open bridge with motor-stands, ms", 1000.0);
/// Two sectors after the friction is overcome, by 5 A at most.
const LOST: Stop = ("encoder-lost", "to open bridge with encoder-lost, ms", 500.0);

/// Encoders that count against the phases since before the start.
const REVERSED: [(f32, &str, Fault, Stop); 7] = [
    (AS5047P, "AS5047P", Chip(EncoderFault::Reversed), STANDS),
    (AS5048A, "AS5048A", Chip(EncoderFault::Reversed), STANDS),
    (ABZ, "ABZ", Lines(LineFault::Reversed), STANDS),
    (ABZ_HALL, "ABZ and Hall sensors, lines", Lines(LineFault::Reversed), LOST),
    (ABZ_HALL, "ABZ and Hall sensors, Hall sensors", Hall(HallFault::Reversed), STANDS),
    (HALL, "Hall sensors alone", Hall(HallFault::Reversed), STANDS),
    (BISS, "BiSS C", Serial(SerialFault::Reversed), STANDS),
];

/// Encoders that stand since before the start.
const STUCK: [(f32, &str, Fault, Stop); 6] = [
    (AS5047P, "AS5047P", Chip(EncoderFault::Detached), STANDS),
    (AS5048A, "AS5048A", Chip(EncoderFault::Detached), STANDS),
    (ABZ, "ABZ", Lines(LineFault::Missing), STANDS),
    (ABZ_HALL, "ABZ and Hall sensors, lines", Lines(LineFault::Missing), LOST),
    (HALL, "Hall sensors alone", Hall(HallFault::Frozen), STANDS),
    (BISS, "BiSS C", Serial(SerialFault::Frozen), STANDS),
];

/// A joint whose wiring is not proven, with a fault since before it is armed, to 2 rad/s in 0.5 s.
fn from_rest(kind: f32, name: &str, what: &str, fault: Fault, stop: Stop) -> Vec<ScenarioRow> {
    let (code, figure, within_ms) = stop;
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
    for (kind, name, fault, _) in REVERSED {
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
