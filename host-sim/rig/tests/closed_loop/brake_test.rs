//! Scenario 28: the motor presses against its holding brake before arming, or on request (2030h:7 to :14).

use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::drive;
use firmware::node::dictionary::index;
use firmware::supervisor::Code;
use simulated_machines::joint_plant::{HoldingBrake, Load};
use std::sync::LazyLock;

/// Torque of the test, thousandths of the rated torque (26 Nm), and in Nm.
const TEST_PERMILLE: i16 = 400;
const TEST_NM: f64 = 10.4;
/// Way of 2030h:9, rad.
const WAY_RAD: f64 = 0.02;
/// Torque of a sound brake, of one that holds the load and not the test, and of one whose coil keeps it open, Nm.
const SOUND_NM: f64 = 18.0;
const WORN_NM: f64 = 7.0;
const OPEN_NM: f64 = 0.0;
/// Longest time of a test: wake-up, ramps of 0.6 s, and two times 50 ms.
const TEST_MS: u32 = 1000;
/// Time in which a test has pressed in both directions, and has not ended, ms.
const PRESSING_MS: u32 = 680;
const CSV: u8 = 9;
const ENABLED: u16 = 0x0F;
/// Sub-indices of 2030h.
const RELEASED: u8 = 6;
const TORQUE: u8 = 7;
const TIME: u8 = 8;
const ORDER: u8 = 11;
const RESULT: u8 = 12;
const FORWARDS: u8 = 13;
const BACK: u8 = 14;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = holds();
        rows.extend(slips("leg held horizontally, its brake has 7 Nm", Load::Leg, WORN_NM));
        rows.extend(slips("bare shaft, its brake stays open", Load::Free, OPEN_NM));
        rows.extend(without_torque());
        rows.extend(without_brake());
        rows.extend(interrupted());
        rows
    });
    &ROWS
}

/// Powers a joint with a brake of this torque up at rest, and sets the test.
fn with_brake<R>(load: Load, brake_nm: f64, work: impl FnOnce(&mut Master) -> R) -> R {
    let mut set = set(0.9);
    if load == Load::Leg {
        // As in scenario 18.
        set.motor.inertia_kg_m2 = 0.4;
        set.motor.velocity_gain_a_s_per_rad = 10.0;
    }
    let joint = Joint { load, ..Joint::with(set) };
    joint.run_plant(
        |plant| {
            plant.place(0.0);
            plant.brake = Some(HoldingBrake::new(brake_nm, 0.03, 0.04));
        },
        |master| {
            write_short(master, index::DISABLE_OPTION, 0, 1);
            master.rig.write_object_byte(index::HOLDING_BRAKE, 1, 1);
            master.rig.step_idle();
            write_short(master, index::HOLDING_BRAKE, TORQUE, TEST_PERMILLE);
            write_short(master, index::HOLDING_BRAKE, TIME, 50);
            master.rig.send_immediately(0, &[1, 1]);
            master.rig.write_object_byte(index::MODE, 0, CSV);
            master.rig.step_idle();
            work(master)
        },
    )
}

/// What a stretch of time showed: largest torque of the motor with the brake closed, in both directions, Nm; largest way from
/// the begin, rad, and speed, rad/s.
#[derive(Default)]
struct Seen {
    torque_nm: [f64; 2],
    way_rad: f64,
    speed_rad_s: f64,
}

/// Runs this time. The master sends a controlword, or nothing.
fn watch(master: &mut Master, milliseconds: u32, word: Option<u16>) -> Seen {
    let from = master.rig.plant().position_rad();
    let mut seen = Seen::default();
    for _ in 0..milliseconds {
        match word {
            Some(word) => drive(master, word, 0.0),
            None => master.rig.step_idle(),
        }
        // The torque per ampere is 1 Nm/A.
        let torque_nm = f64::from(master.rig.master_view().current_a);
        seen.torque_nm = [seen.torque_nm[0].max(torque_nm), seen.torque_nm[1].max(-torque_nm)];
        seen.way_rad = seen.way_rad.max((master.rig.plant().position_rad() - from).abs());
        seen.speed_rad_s = seen.speed_rad_s.max(master.rig.plant().velocity_rad_s().abs());
    }
    seen
}

/// Sends the controlwords that enable the drive.
fn enable(master: &mut Master) {
    for word in [0x06, 0x07] {
        (0..5).for_each(|_| drive(master, word, 0.0));
    }
}

fn result(master: &mut Master) -> f64 {
    f64::from(master.rig.read_object(index::HOLDING_BRAKE, RESULT).unwrap_or(u32::MAX))
}

/// The larger way that the driver reports, rad.
fn reported_rad(master: &mut Master) -> f64 {
    let [forwards, back] = [FORWARDS, BACK].map(|place| {
        let word = master.rig.read_object(index::HOLDING_BRAKE, place);
        1e-6 * f64::from(word.unwrap_or_default() as i32)
    });
    forwards.max(back)
}

fn has_limit(master: &mut Master) -> f64 {
    flag(master.rig.active_limits().contains(Code::BrakeTestFailed))
}

/// A sound brake: at the first arming, not at the second one, and on request.
fn holds() -> Vec<ScenarioRow> {
    let name = "leg held horizontally, its brake has 18 Nm, 2030h:7 = 400: enable";
    let again = "the same joint: disable with 605Ch = 1, enable again, disable, then 2030h:11 = 1";
    with_brake(Load::Leg, SOUND_NM, |master| {
        enable(master);
        let first = watch(master, PRESSING_MS, Some(ENABLED));
        let release = watch(master, TEST_MS - PRESSING_MS, Some(ENABLED));
        let first_result = result(master);
        let reported = reported_rad(master);
        (0..200).for_each(|_| drive(master, ENABLED, 0.3));
        let turns_rad_s = master.rig.plant().velocity_rad_s();
        (0..150).for_each(|_| drive(master, ENABLED, 0.0));
        watch(master, 300, Some(0x07));
        let second = watch(master, 150, Some(ENABLED));
        let released = master.rig.read_object(index::HOLDING_BRAKE, RELEASED).unwrap_or(0);
        watch(master, 300, Some(0x07));
        let was_armed = flag(master.rig.is_armed());
        master.rig.write_object_byte(index::HOLDING_BRAKE, ORDER, 1);
        let request = watch(master, TEST_MS, None);
        let open = master.rig.stage_mut().applied_duty().is_none();
        let torque = 0.93 * TEST_NM..=1.07 * TEST_NM;
        vec![
            row(28, name, "torque forwards, Nm", first.torque_nm[0], torque.clone()),
            row(28, name, "torque back, Nm", first.torque_nm[1], torque.clone()),
            row(28, name, "largest way in the test, rad", first.way_rad, 0.0..=0.005),
            // As at the first release of scenario 18.
            row(28, name, "largest way at the release, rad", release.way_rad, 0.0..=0.09),
            row(28, name, "way that is reported, rad", reported, 0.0..=WAY_RAD),
            row(28, name, "result (2030h:12)", first_result, 2.0..=2.0),
            row(28, name, "then turns with 60FFh = 0.3 rad/s, rad/s", turns_rad_s, 0.2..=0.4),
            row(
                28,
                again,
                "torque at the second enabling: that of the load, Nm",
                second.torque_nm[0].max(second.torque_nm[1]),
                0.0..=8.0,
            ),
            row(28, again, "released 150 ms later", released.into(), 1.0..=1.0),
            row(28, again, "armed before the request", was_armed, 0.0..=0.0),
            row(28, again, "torque on request, Nm", request.torque_nm[1], torque),
            row(28, again, "largest way on request, rad", request.way_rad, 0.0..=0.005),
            row(28, again, "result on request", result(master), 2.0..=2.0),
            row(28, again, "bridge open afterwards", flag(open), 1.0..=1.0),
        ]
    })
}

/// A brake that does not hold the test.
fn slips(what: &str, load: Load, brake_nm: f64) -> Vec<ScenarioRow> {
    let name = format!("{what}, 2030h:7 = 400: enable");
    with_brake(load, brake_nm, |master| {
        enable(master);
        let seen = watch(master, TEST_MS, Some(ENABLED));
        let reported = reported_rad(master);
        let rest = watch(master, 50, Some(ENABLED)).way_rad;
        vec![
            row(28, &name, "result (2030h:12)", result(master), 3.0..=3.0),
            row(28, &name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
            row(28, &name, "brake-test-failed is reported", has_limit(master), 1.0..=1.0),
            row(28, &name, "way that is reported, rad", reported, WAY_RAD..=2.0 * WAY_RAD),
            // At the bound, the ramp of 69 Nm/s has accelerated the joint; friction and brake stop it.
            row(28, &name, "largest way, rad", seen.way_rad, WAY_RAD..=4.0 * WAY_RAD),
            row(28, &name, "highest speed, rad/s", seen.speed_rad_s, 0.0..=1.5),
            row(28, &name, "way in the last 50 ms, rad", rest, 0.0..=0.001),
        ]
    })
}

/// The torque limit of the master is below the torque of the test.
fn without_torque() -> Vec<ScenarioRow> {
    let name = "bare shaft, its brake has 18 Nm, 2030h:7 = 400, 6072h = 300: enable";
    with_brake(Load::Free, SOUND_NM, |master| {
        write_short(master, index::MAX_TORQUE, 0, 300);
        enable(master);
        watch(master, TEST_MS, Some(ENABLED));
        vec![
            row(28, name, "result (2030h:12)", result(master), 4.0..=4.0),
            row(28, name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
            row(28, name, "brake-test-failed is reported", has_limit(master), 1.0..=1.0),
        ]
    })
}

/// A joint without a brake has no test.
fn without_brake() -> Vec<ScenarioRow> {
    let name = "bare shaft without a brake, 2030h:7 = 400: 2030h:11 = 1";
    with_brake(Load::Free, OPEN_NM, |master| {
        master.rig.write_object_byte(index::HOLDING_BRAKE, 1, 0);
        master.rig.step_idle();
        master.rig.write_object_byte(index::HOLDING_BRAKE, ORDER, 1);
        let seen = watch(master, 200, None);
        vec![
            row(28, name, "result (2030h:12)", result(master), 0.0..=0.0),
            row(28, name, "largest way, rad", seen.way_rad, 0.0..=0.001),
        ]
    })
}

/// "Disable voltage" during a test.
fn interrupted() -> Vec<ScenarioRow> {
    let name =
        "leg held horizontally, its brake has 18 Nm: enable, then disable voltage in the test";
    with_brake(Load::Leg, SOUND_NM, |master| {
        enable(master);
        watch(master, 250, Some(ENABLED));
        let seen = watch(master, 100, Some(0));
        vec![
            row(28, name, "result (2030h:12)", result(master), 5.0..=5.0),
            row(28, name, "largest way, rad", seen.way_rad, 0.0..=0.005),
            row(28, name, "brake-test-failed is reported", has_limit(master), 0.0..=0.0),
        ]
    })
}

#[test]
fn brake_is_tested_before_arming_and_on_request() {
    check(rows());
}
