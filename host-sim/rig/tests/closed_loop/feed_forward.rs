//! Scenario 23: a master adds what it knows to the targets, by 60B1h and 60B2h in a receive PDO of its own.

use super::holding_brake::with_brake;
use super::position::{CSP, micro};
use super::rig::{Joint, Master, set};
use super::stops::{flag, write_short};
use super::table::{ScenarioRow, check, row};
use super::velocity::drive;
use firmware::node::dictionary::index;
use std::sync::LazyLock;

/// Way of a lift, rad.
const LIFT_RAD: f64 = 0.3;
/// Torque that holds the leg, Nm: 2 kg under water, held horizontally.
const GRAVITY_NM: f64 = 5.9;
/// Identifiers of the master's frames of offsets, and of a target position.
const OFFSETS: u16 = 0x321;
const POSITION: u16 = 0x322;
const CSV: u8 = 9;
const CST: u8 = 10;
const ENABLED: u16 = 0x0F;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for share in [0.0, 1.0, 2.0, -1.0] {
            rows.extend(release(share));
        }
        rows.extend(silence());
        rows.extend(torque_mode());
        rows.extend(velocity_offsets());
        rows
    });
    &ROWS
}

/// Maps objects, each with its length in bits, to a frame of the master.
fn map(master: &mut Master, slot: u16, identifier: u16, objects: &[(u16, u32)]) {
    let (settings, mapping) = (0x1400 + slot, 0x1600 + slot);
    let unused = 1u32 << 31 | u32::from(identifier);
    master.rig.write_object(settings, 1, unused.to_le_bytes());
    master.rig.step_idle();
    master.rig.write_object_byte(mapping, 0, 0);
    master.rig.step_idle();
    for (place, (at_index, bits)) in objects.iter().enumerate() {
        let entry = u32::from(*at_index) << 16 | bits;
        master.rig.write_object(mapping, place as u8 + 1, entry.to_le_bytes());
        master.rig.step_idle();
    }
    master.rig.write_object_byte(mapping, 0, objects.len() as u8);
    master.rig.step_idle();
    master.rig.write_object(settings, 1, u32::from(identifier).to_le_bytes());
    master.rig.step_idle();
    let count = master.rig.read_object(mapping, 0);
    assert_eq!(count, Some(objects.len() as u32), "the mapping was refused");
}

fn map_offsets(master: &mut Master) {
    let offsets = [(index::VELOCITY_OFFSET, 32), (index::TORQUE_OFFSET, 16)];
    map(master, 4, OFFSETS, &offsets);
    map(master, 5, POSITION, &[(index::TARGET_POSITION, 32)]);
}

/// Sends the offsets, in rad/s and Nm.
fn send_offsets(master: &mut Master, velocity_rad_s: f64, torque_nm: f64, rated_nm: f64) {
    let permille = (1e3 * torque_nm / rated_nm).round() as i16;
    let data = [micro(velocity_rad_s).as_slice(), &permille.to_le_bytes()].concat();
    master.rig.send_immediately(OFFSETS, &data);
}

/// Returns the rated torque (6076h), Nm.
fn rated_nm(master: &mut Master) -> f64 {
    1e-3 * f64::from(master.rig.read_object(index::RATED_TORQUE, 0).unwrap_or_default())
}

/// Enables the drive in a mode, with an offset of the torque in each cycle.
fn enable(master: &mut Master, mode: u8, torque_nm: f64, rated_nm: f64) {
    master.rig.send_immediately(0, &[1, 1]);
    master.rig.write_object_byte(index::MODE, 0, mode);
    for word in [0x06, 0x07, ENABLED] {
        for _ in 0..20 {
            send_offsets(master, 0.0, torque_nm, rated_nm);
            drive(master, word, 0.0);
        }
    }
    assert!(master.rig.is_armed(), "{:?}", master.faults());
}

/// Runs this time with an offset in each cycle, `None` without. Returns the largest way from the start, rad.
fn moved(
    master: &mut Master,
    milliseconds: u32,
    word: u16,
    torque_nm: Option<f64>,
    rated: f64,
) -> f64 {
    let from = master.rig.plant().position_rad();
    (0..milliseconds).fold(0.0, |most, _| {
        if let Some(torque_nm) = torque_nm {
            send_offsets(master, 0.0, torque_nm, rated);
        }
        drive(master, word, 0.0);
        f64::max(most, (master.rig.plant().position_rad() - from).abs())
    })
}

/// Lifts the leg by [`LIFT_RAD`] and waits. The motor has then turned, so that a load without motion is no fault.
fn lift(master: &mut Master, torque_nm: Option<f64>, rated: f64) {
    let from = master.rig.plant().position_rad();
    for ms in 0..1500 {
        let target_rad = from + LIFT_RAD * (1e-3 * f64::from(ms)).min(1.0);
        master.rig.send_immediately(POSITION, &micro(target_rad));
        moved(master, 1, ENABLED, torque_nm, rated);
    }
}

/// The brake of the leg opens, closes, and opens again, with a share of the gravity as offset.
fn release(share: f64) -> Vec<ScenarioRow> {
    let name = format!(
        "leg held horizontally in CSP, 60B2h = {share} of its gravity: enable, disable with 605Ch = 1, enable again"
    );
    with_brake(true, |master| {
        map_offsets(master);
        let rated = rated_nm(master);
        let offset_nm = Some(share * GRAVITY_NM);
        enable(master, CSP, share * GRAVITY_NM, rated);
        let first = moved(master, 500, ENABLED, offset_nm, rated);
        lift(master, offset_nm, rated);
        let end_rad = master.rig.plant().position_rad();
        moved(master, 1000, 0x07, offset_nm, rated);
        let again = moved(master, 1000, ENABLED, offset_nm, rated);
        let armed = flag(master.rig.is_armed());
        // The loop finds the difference of the load and the offset, as scenario 18 does the load.
        let most_rad = 0.012 + 0.06 * (share - 1.0).abs();
        vec![
            row(23, &name, "largest way at the first release, rad", first, 0.0..=most_rad),
            row(23, &name, "position after a lift of 0.3 rad, rad", end_rad, 0.2..=0.4),
            row(23, &name, "largest way at the next release, rad", again, 0.0..=0.01),
            row(23, &name, "stays armed", armed, 1.0..=1.0),
        ]
    })
}

/// The master loses its offset, and later sends it again.
fn silence() -> Vec<ScenarioRow> {
    let name =
        "leg held horizontally in CSP, 60B2h = its gravity: the offset ends, and comes again";
    with_brake(true, |master| {
        map_offsets(master);
        let rated = rated_nm(master);
        enable(master, CSP, GRAVITY_NM, rated);
        lift(master, Some(GRAVITY_NM), rated);
        let lost = moved(master, 1500, ENABLED, None, rated);
        let back = moved(master, 1500, ENABLED, Some(GRAVITY_NM), rated);
        vec![
            row(23, name, "largest way without it, rad", lost, 0.002..=0.06),
            row(23, name, "largest way when it comes again, rad", back, 0.002..=0.08),
            row(23, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// Torque mode: 60B2h adds to 6071h, and the sum has the limit of 6072h.
fn torque_mode() -> Vec<ScenarioRow> {
    let name = "joint with its brake closed by another device, CST with 60B2h = 6 Nm, 6072h = 400";
    let joint = Joint::with(set(0.0));
    joint.run_plant(
        |plant| {
            plant.brake =
                Some(simulated_machines::joint_plant::HoldingBrake::new(60.0, 0.03, 0.04));
        },
        |master| {
            map_offsets(master);
            let rated = rated_nm(master);
            write_short(master, index::MAX_TORQUE, 0, 400);
            enable(master, CST, 0.0, rated);
            let mut command = |torque_nm: Option<f64>, target_permille: i16, milliseconds: u32| {
                for _ in 0..milliseconds {
                    if let Some(torque_nm) = torque_nm {
                        send_offsets(master, 0.0, torque_nm, rated);
                    }
                    let mut data = [0; 8];
                    data[..2].copy_from_slice(&ENABLED.to_le_bytes());
                    data[2..4].copy_from_slice(&target_permille.to_le_bytes());
                    master.rig.send_immediately(0x201, &data);
                    master.rig.step_idle();
                }
                let actual = master.rig.read_object(index::ACTUAL_TORQUE, 0).unwrap_or_default();
                1e-3 * rated * f64::from(actual as u16 as i16)
            };
            let alone = command(Some(6.0), 0, 200);
            let sum = command(Some(6.0), -100, 200);
            let limited = command(Some(6.0), 350, 200);
            let stale = command(None, 0, 600);
            vec![
                row(23, name, "torque with 6071h = 0, Nm", alone, 5.7..=6.3),
                row(
                    23,
                    name,
                    "torque with 6071h = -100, beyond 6 Nm less a tenth of the rated, Nm",
                    sum - (6.0 - 0.1 * rated),
                    -0.3..=0.3,
                ),
                row(
                    23,
                    name,
                    "torque with 6071h = 350 over the limit",
                    limited / (0.4 * rated),
                    0.95..=1.05,
                ),
                row(23, name, "torque 0.6 s after the last offset, Nm", stale, -0.3..=0.3),
            ]
        },
    )
}

/// Velocity offsets in CSV and CSP, of a bare shaft.
fn velocity_offsets() -> Vec<ScenarioRow> {
    let name = "bare shaft, 60B1h = 0.5 rad/s";
    let speed = |mode: u8, target_rad_s: f64, offset_rad_s: f64| {
        Joint::with(set(0.9)).run(|master| {
            map_offsets(master);
            // 3 rad/s at the joint.
            master.rig.write_object(index::MAX_MOTOR_SPEED, 0, 1461u32.to_le_bytes());
            master.rig.step_idle();
            enable(master, mode, 0.0, 1.0);
            for _ in 0..2000 {
                send_offsets(master, offset_rad_s, 0.0, 1.0);
                drive(master, ENABLED, target_rad_s);
            }
            let status = master.rig.read_object(index::STATUSWORD, 0).unwrap_or_default();
            let limited = flag(status & 1 << 11 != 0);
            [master.rig.plant().velocity_rad_s(), master.rig.plant().position_rad(), limited]
        })
    };
    let [sum_rad_s, ..] = speed(CSV, 1.0, 0.5);
    let [fast_rad_s, _, is_limited] = speed(CSV, 2.0, 2.0);
    let [rest_rad_s, way_rad, _] = speed(CSP, 0.0, 0.5);
    vec![
        row(23, name, "speed in CSV with 60FFh = 1 rad/s, rad/s", sum_rad_s, 1.45..=1.55),
        row(
            23,
            "bare shaft, CSV, 60FFh and 60B1h = 2 rad/s each, 6080h = 3 rad/s",
            "speed, rad/s",
            fast_rad_s,
            2.9..=3.05,
        ),
        row(
            23,
            "bare shaft, CSV, 60FFh and 60B1h = 2 rad/s each, 6080h = 3 rad/s",
            "internal limit is reported",
            is_limited,
            1.0..=1.0,
        ),
        row(23, name, "speed in CSP at rest, rad/s", rest_rad_s, -0.02..=0.02),
        row(
            23,
            name,
            "position in CSP at rest: 60B1h over the gain of the loop, rad",
            way_rad,
            0.04..=0.06,
        ),
    ]
}

#[test]
fn feed_forward_of_a_master_adds_once_and_decays() {
    check(rows());
}
