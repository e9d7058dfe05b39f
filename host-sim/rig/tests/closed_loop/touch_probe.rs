//! Scenario 25: the touch probe (60B8h to 60BDh) at an input and at the zero of the encoder.

use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::drive;
use firmware::node::dictionary::index;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Range in which the probe is touched, rad from the begin.
const TOUCHED_RAD: [f64; 2] = [0.6, 0.9];
const SPEED_RAD_S: f64 = 6.0;
/// Motor turns per turn of the joint, and ways between two zeros of the encoder, rad.
const GEAR: f64 = 51.0;
const ZEROS_RAD: f64 = TAU / GEAR;
/// Largest error of a position: half a period's way at this speed and 6 us of the encoder, and its noise of two counts of 14
/// bits behind the gear and at the begin, rad.
const ERROR_RAD: f64 = SPEED_RAD_S * (25e-6 + 6e-6) + 4.0 * TAU / 16384.0 / GEAR;
/// 60B8h: probe 1 at the input with both edges, once or again and again; probe 2 at the zero, positive edge, again and again.
const ONCE: u16 = 0x0031;
const CONTINUOUS: u16 = 0x0033;
const ZERO_CONTINUOUS: u16 = 0x1700;
const ZERO_ONCE: u16 = 0x1500;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(passes);
    &ROWS
}

/// Position of an object, rad; NaN if it is not read.
fn position(master: &mut Master, at_index: u16) -> f64 {
    master.rig.read_object(at_index, 0).map_or(f64::NAN, |word| 1e-6 * f64::from(word as i32))
}

fn status(master: &mut Master) -> u32 {
    master.rig.read_object(index::TOUCH_STATUS, 0).unwrap_or(u32::MAX)
}

fn set_function(master: &mut Master, word: u16) {
    write_short(master, index::TOUCH_FUNCTION, 0, word as i16);
}

/// Turns the joint by this velocity for this time, then to rest.
fn pass(master: &mut Master, milliseconds: u32, velocity_rad_s: f64) {
    (0..milliseconds).for_each(|_| drive(master, 0x0F, velocity_rad_s));
    (0..250).for_each(|_| drive(master, 0x0F, 0.0));
}

fn passes() -> Vec<ScenarioRow> {
    let forwards = "bare shaft with 6 rad/s through the range of its touch probe, 60B8h = 31h";
    let back = "the same, back without and with a new rise of bit 0, 60B8h = 33h";
    let zero = "the same, probe 2 at the zero of the encoder, 60B8h = 1700h, then 1500h";
    let mut set = set(0.9);
    set.motor.acceleration_max_rad_s2 = 100.0;
    Joint::with(set).run(|master| {
        master.rig.send_immediately(0, &[1, 1]);
        master.rig.write_object_byte(index::MODE, 0, 9);
        for word in [0x06, 0x07, 0x0F] {
            (0..20).for_each(|_| drive(master, word, 0.0));
        }
        let from_rad = master.rig.plant().position_rad();
        let offset_rad = position(master, index::ACTUAL_POSITION) - from_rad;
        let [rise_rad, fall_rad] = TOUCHED_RAD.map(|at| from_rad + at);
        master.rig.stage_mut().touched_rad = Some([rise_rad, fall_rad]);
        let read = |master: &mut Master| {
            let both = [index::TOUCH_1_POSITIVE, index::TOUCH_1_NEGATIVE];
            both.map(|object| position(master, object) - offset_rad)
        };
        set_function(master, ONCE | ZERO_CONTINUOUS);
        let armed = status(master) & 0xFF;
        pass(master, 220, SPEED_RAD_S);
        let first = read(master);
        let stored = status(master) & 0x3F;
        let zero_rad = position(master, index::TOUCH_2_POSITIVE) - offset_rad;
        let last_zero = (master.rig.plant().position_rad() / ZEROS_RAD).floor() * ZEROS_RAD;
        pass(master, 220, -SPEED_RAD_S);
        let kept = read(master);
        set_function(master, 0);
        set_function(master, CONTINUOUS | ZERO_ONCE);
        let cleared = status(master) & 0x3F;
        pass(master, 220, SPEED_RAD_S);
        let first_zero = position(master, index::TOUCH_2_POSITIVE) - offset_rad;
        let toggles = status(master) & 0xC0;
        pass(master, 220, -SPEED_RAD_S);
        let again = read(master);
        let toggled = toggles ^ status(master) & 0xC0;
        let edge = |case: &str, figure: &'static str, found: f64, truth: f64| {
            row(25, case, figure, (found - truth).abs() / ERROR_RAD, 0.0..=1.0)
        };
        let (at_rise, at_fall) =
            ("error at the rise, largest is 1", "error at the fall, largest is 1");
        let is_kept = flag(first == kept && cleared == 1);
        let distance = (first_zero / ZEROS_RAD - (first_zero / ZEROS_RAD).round()).abs();
        vec![
            row(25, forwards, "enabled, nothing stored", armed.into(), 1.0..=1.0),
            row(25, forwards, "both are stored", stored.into(), 7.0..=7.0),
            edge(forwards, at_rise, first[0], rise_rad),
            edge(forwards, at_fall, first[1], fall_rad),
            row(25, back, "positions stay until a new rise of bit 0", is_kept, 1.0..=1.0),
            edge(back, at_rise, again[0], fall_rad),
            edge(back, at_fall, again[1], rise_rad),
            row(25, back, "bits 6 and 7 show the new positions", toggled.into(), 192.0..=192.0),
            edge(zero, "error of the last zero, largest is 1", zero_rad, last_zero),
            row(25, zero, "first zero, error in rad", distance * ZEROS_RAD, 0.0..=ERROR_RAD),
            row(25, zero, "first zero, from the begin, rad", first_zero - from_rad, -0.1..=0.35),
        ]
    })
}

#[test]
fn touch_probe_stores_true_positions_of_edges() {
    check(rows());
}
